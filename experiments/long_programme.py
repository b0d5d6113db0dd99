"""A programme for a whole flight from 75 m, by multiple shooting, flown blindly and held.

The default gait with d_psi 5 degrees (smooth polar, 40 Gauss nodes) tumbles from 75 m. Forty
knots of d_psi and d_theta, with 30 degrees of margin to the limits of the angles, are made to
fly as far as they can. The programme flies by itself at tolerances of 1e-9 and 1e-11, and under
the feedback that keeps to it: the whole state sensed, and attitude and rates alone; beside it
the regulator about the steady glide. Then eight knots of d_psi from 10 m, by single shooting:
blind and held in 16 flights launched at 1.5 to 2 m/s, told with 2 degrees and 0.2 rad/s of
noise, 50 ms late. `--size` is the number of steps of the long search (60).
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

BODY = Snake.from_svl(0.70, nodes=40, node_set="gauss")
LATE = Senses(angle_noise=np.deg2rad(2.0), omega_noise=0.2, delay=0.05)
INPUTS = "d_psi", "d_theta"
KNOTS, STEPS, MARGIN, SAMPLES = 40, 60, 30.0, 150
HEADER = "16 flights from 10 m", "land", "nearest (m)", "median (m)", "farthest (m)"


def short() -> list[tuple]:
    """A programme from 10 m, launched faster and slower, blind and held."""
    glider = Glider(BODY, Gait.from_degrees(d_psi=5), Polar.smooth())
    case = Case(glider, Launch(height=10.0))
    found = optimise_program(case, INPUTS[:1], 8, starts=2, steps=30, progress=False)
    print(found)
    random = Environment(case, INPUTS[:1], senses=LATE, vary={"launch.speed": (1.5, 2.0)})
    law = linear_quadratic(Environment(case, INPUTS[:1], senses=LATE), along=found.path(random))
    keys, rows = jax.random.split(jax.random.key(1), 16), []
    held = jax.vmap(lambda key: controlled_flight(random, law, key, SAMPLES))(keys)
    blind = []
    for key in keys:
        launch = Launch(height=10.0, speed=float(random.drawn(key)["launch.speed"]))
        blind.append(simulate(found.glider, launch))
    ends = {
        "blind": ([glide.stable for glide in blind], [glide.state[1] for glide in blind]),
        "held": (held.landed, held.ended.state[:, 1]),
    }
    for name, (landed, forward) in ends.items():
        spread = np.quantile(np.asarray(forward), [0.0, 0.5, 1.0]).tolist()
        rows.append((name, int(np.sum(landed)), *spread))
    return rows


def main() -> None:
    options = arguments(__doc__)
    glider = Glider(BODY, Gait.from_degrees(d_psi=5), Polar.smooth())
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
    paths = {"programme": np.append(joined.states[:, 1:3], [[found.value, 0.0]], axis=0)}
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
    write_table(options.out / "short_programme", HEADER, short())
    with style():
        figure = Figure(figsize=(120 / 25.4, 80 / 25.4), dpi=300, layout="constrained")
        ax = figure.subplots()
        for k, (name, path) in enumerate(paths.items()):
            drawn: dict[str, Any] = {"lw": 3.5 - 0.6 * k, "zorder": k}
            if name == "programme":
                drawn = {"ls": "", "marker": "o", "ms": 3, "zorder": 9}
            ax.plot(*path.T, label=name, **drawn)
        ax.set(xlabel="forward (m)", ylabel="height (m)", aspect="equal")
        figure.legend(loc="outside right upper")
        save_figure(figure, options.out / "long_programme.png")


if __name__ == "__main__":
    main()
