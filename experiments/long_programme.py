"""A programme for a whole flight from 75 m, by multiple shooting, flown blindly and held.

The default gait with d_psi 5 degrees (smooth polar, 40 Gauss nodes) tumbles from 75 m. Forty
knots of d_psi and d_theta, with 45 degrees of margin to the limits of the angles, are made to
fly as far as they can. The programme flies by itself at tolerances of 1e-9 and 1e-11, and under
the feedback that keeps to it: the whole state sensed, and attitude and rates alone; beside it
the regulator about the steady glide. `--size` is the number of steps of the search (60).
"""

import time
from typing import Any

import jax
import numpy as np
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure

from jaxglide import (
    Case,
    Environment,
    Gait,
    Glider,
    Launch,
    Outcome,
    Polar,
    Senses,
    Snake,
    controlled_flight,
    linear_quadratic,
    optimise_program,
    simulate,
    stability_margin,
)
from jaxglide.plot import style

INPUTS = "d_psi", "d_theta"
KNOTS, STEPS, MARGIN, SAMPLES = 40, 60, 45.0, 150


def main() -> None:
    options = arguments(__doc__)
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    glider = Glider(body, Gait.from_degrees(d_psi=5), Polar.smooth())
    case = Case(glider, Launch(height=75.0))
    begun = time.perf_counter()
    found = optimise_program(
        case,
        INPUTS,
        KNOTS,
        shooting="multiple",
        steps=options.size or STEPS,
        constraints=[stability_margin.at_least(MARGIN, scale=10.0)],
    )
    print(f"{found}\nin {time.perf_counter() - begun:.0f} s", flush=True)
    joined, key = found.optimum, jax.random.key(0)
    rows: list[tuple] = [("programme", found.value, joined.duration, "joined", joined.gap)]
    paths = {"programme": joined.states[:, 1:3]}
    for tolerance in (1e-9, 1e-11):
        flown = simulate(found.glider, case.launch, rtol=tolerance, atol=tolerance, dense=True)
        name, said = f"blind, {tolerance:g}", str(Outcome(int(flown.outcome)))
        rows.append((name, float(flown.state[1]), float(flown.time), said, np.nan))
        paths[name] = np.asarray(flown.at(np.linspace(0, float(flown.time), 300)))[:, 1:3]
    for name, senses in (("held", Senses(velocity=True)), ("held, partly seen", Senses())):
        environment = Environment(case, INPUTS, senses=senses)
        laws = {name: linear_quadratic(environment, along=found.path(environment))}
        if senses.velocity:
            laws["regulator"] = linear_quadratic(environment, launch=4)
        for label, law in laws.items():
            flown = controlled_flight(environment, law, key, SAMPLES)
            end, said = flown.ended, str(Outcome(int(flown.ended.outcome)))
            rows.append((label, float(end.state[1]), float(end.time), said, np.nan))
            states = np.asarray(flown.states)[~np.asarray(flown.over)]
            paths[label] = np.concatenate([states[:, 1:3], np.asarray(end.state)[None, 1:3]])
    header = ("flight", "forward (m)", "time (s)", "how it ended", "largest gap")
    write_table(options.out / "long_programme", header, rows)
    with style():
        figure = Figure(figsize=(120 / 25.4, 80 / 25.4), dpi=300, layout="constrained")
        ax = figure.subplots()
        for name, path in paths.items():
            marks: dict[str, Any] = {"lw": 1}
            if name == "programme":
                marks = {"ls": "", "marker": "o", "ms": 3}
            ax.plot(*path.T, label=name, **marks)
        ax.set(xlabel="forward (m)", ylabel="height (m)", aspect="equal")
        ax.legend()
        save_figure(figure, options.out / "long_programme.png")


if __name__ == "__main__":
    main()
