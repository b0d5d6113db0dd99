"""Laws trained by gradients: how many of 1,000 disturbed flights land?

The default snake (d_psi 5 degrees, smooth polar, 40 Gauss nodes) from 70 to 80 m. Launches,
masses and force coefficients are drawn, and a gust stands somewhere in the way; attitude and
rates are sensed with noise, velocity is not, and inputs arrive 50 ms late. Four laws set d_psi
and d_theta: none, the linear-quadratic regulator, and two that start from it and are trained, a
gain-scheduled one and a small network. Each flies `--size` (1,000) flights as trained on, and a
fifth of that under conditions that were not trained on. The same seed draws the same flights
for all. With `--resume` a killed training goes on where it was.

Then what the window does: the gain-scheduled law trained anew through windows, without and with
a terminal value, and through whole flights, as many samples of flight in all and as large a sum
of rates.
"""

import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure

from jaxglide import (
    AngleLimit,
    Case,
    Constant,
    End,
    Environment,
    GainScheduled,
    Gait,
    Glider,
    Ground,
    Gust,
    Launch,
    NeuralPolicy,
    Polar,
    Senses,
    Snake,
    StillAir,
    Turbulence,
    evaluate_policy,
    linear_quadratic,
    train_policy,
)
from jaxglide.control.training import upright
from jaxglide.plot import style

BODY = Snake.from_svl(0.70, nodes=40, node_set="gauss")
MASS = float(BODY.mass)
FLIGHTS, SEED = 1000, 2020
JUDGED = SEED + 1  # seed of the flights that judge, which no training has seen
TRAINING = {"updates": 80, "flights": 32, "window": 16}
RATES = {"gain-scheduled": 3e-4, "network": 3e-4}
BUDGET = 20_480  # samples of flight that a training through other windows flies: half
TRAVEL = 0.012  # updates times rate in each of these
WINDOWS = (16, 0), (16, 16), (80, 0)
"""Samples in a window, and how many samples the cost of its last state stands for."""


class Wall(eqx.Module):
    """How far a flight is from a wall across its way, 2 m thick [m].

    Args:
        height: [m].
        ahead: forward distance of its middle [m].
    """

    height: jax.Array = eqx.field(converter=jnp.asarray)
    ahead: jax.Array = eqx.field(converter=jnp.asarray)

    def __call__(self, time, state):
        return jnp.maximum(state[2] - self.height, jnp.abs(state[1] - self.ahead) - 1.0)


class Staying(eqx.Module):
    """A terminal value: the cost of a state, as if it stayed for so many samples.

    Args:
        samples: how many (static).
    """

    samples: int = eqx.field(static=True)

    def __call__(self, state):
        return self.samples * upright(state)


def environment(
    air=None,
    gust: float = 1.0,
    wrong: float = 0.1,
    noise: float = 2.0,
    wall: bool = False,
    polar: str = "smooth",
    step: float = 1 / 120,
) -> Environment:
    """Random flights.

    Args:
        air: by default a gust, of at most so much in each direction.
        gust: [m/s].
        wrong: share by which mass and coefficients are off, at most.
        noise: of the attitude [deg]; of the rates 0.05 times as much a second.
        wall: whether one stands in the way.
        polar: of the snake.
        step: longest of the solver [s].
    """
    scale = "aerodynamics.polar"
    vary = {
        "launch.speed": (1.3, 2.2),
        "launch.height": (70.0, 80.0),
        "launch.elevation": (-10.0, 10.0),
        "launch.heading": (-10.0, 10.0),
        "body.mass": ((1 - wrong) * MASS, (1 + wrong) * MASS),
        f"{scale}.lift_scale": (1 - wrong, 1 + wrong),
        f"{scale}.drag_scale": (1 - wrong, 1 + wrong),
    }
    if air is None:
        air = Gust([0.0, 0.0, 0.0])
        vary |= {f"air.velocity[{k}]": (-gust, gust) for k in range(3)}
        vary |= {"air.gust_start": (2.0, 40.0), "air.gust_length": (2.0, 10.0)}
    ends = Ground(), AngleLimit()
    if wall:
        ends = *ends, End(Wall(30.0, 12.0), "hit the wall")
    glider = Glider(BODY, Gait.from_degrees(d_psi=5.0), Polar.from_name(polar), air=air)
    senses = Senses(np.deg2rad(noise), 0.05 * noise, delay=0.05)
    case = Case(glider, Launch(height=75.0), ends)
    return Environment(case, vary=vary, senses=senses, step=step)


CONDITIONS = {
    "as trained on": {},
    "gusts to 2 m/s": {"gust": 2.0},
    "mass, coefficients ±20 %": {"wrong": 0.2},
    "noise of 4°": {"noise": 4.0},
    "turbulence of 1 m/s": {"air": Turbulence(1.0, seed=1)},
    "a wall 30 m high, 12 m ahead": {"wall": True},
    "the published polar": {"polar": "published"},
    "half the solver's step": {"step": 1 / 240},
}


def trained(options, name: str, law, random: Environment, **told):
    """A law trained; it says how long that took."""
    log = options.out / f"{name.replace(' ', '_')}.log" if options.resume else None
    begun = time.perf_counter()
    found = train_policy(law, random, seed=SEED, log=log, **told)
    print(f"{name}: trained in {time.perf_counter() - begun:.0f} s")
    return found


def windows(options, law: GainScheduled, flights: Environment, count: int) -> list[tuple]:
    """Trainings through other windows, as many samples of flight in all."""
    rows = []
    for window, beyond in WINDOWS:
        updates = BUDGET // (TRAINING["flights"] * window)
        told = {"window": window, "samples": 80, "updates": updates, "rate": TRAVEL / updates}
        told |= {"flights": TRAINING["flights"]}
        if beyond:
            told |= {"value": Staying(beyond)}
        found = trained(options, f"window {window} {beyond}", law, flights, **told)
        ends = evaluate_policy(flights, found.policy, count, seed=JUDGED)
        rows.append((window, beyond, updates, 100 * float(ends.landed.mean())))
    return rows


def draw(found: dict, runs: dict) -> Figure:
    """Losses of the trainings, and where the flights under each law end."""
    figure = Figure(figsize=(150 / 25.4, 70 / 25.4), dpi=300, layout="constrained")
    left, right = figure.subplots(1, 2)
    colours = dict(zip(found, ("#888888", "#0072B2", "#009E73", "#D55E00"), strict=True))
    for name, run in runs.items():
        smooth = np.convolve(run.losses, np.ones(10) / 10, "valid")
        left.plot(np.arange(len(smooth)) + 10, smooth, color=colours[name], label=name)
    left.set(xlabel="updates", ylabel="mean cost, of ten updates", ylim=(0, None))
    left.legend()
    for name, ends in found.items():
        y, z = ends.position.sel(axis="forward"), ends.position.sel(axis="up")
        label = f"{name}: {100 * float(ends.landed.mean()):.0f} %"
        right.plot(y, z, ".", ms=2, color=colours[name], label=label)
    right.set(xlabel="end, forward (m)", ylabel="end, height (m)")
    right.legend(title="landed", markerscale=4)
    return figure


def main() -> None:
    options = arguments(__doc__)
    count = options.size or FLIGHTS
    flights = environment()
    regulator = linear_quadratic(environment(air=StillAir()))
    laws = {"none": Constant(flights.plant.inputs), "linear-quadratic": regulator}
    starts = {
        "gain-scheduled": GainScheduled.of(flights, regulator),
        "network": NeuralPolicy.of(flights, regulator, seed=SEED),
    }
    runs = {}
    for name, start in starts.items():
        told = {**TRAINING, "rate": RATES[name]}
        runs[name] = trained(options, name, start, flights, **told)
        laws[name] = runs[name].policy
    rows, usual = [], {}
    for condition, told in CONDITIONS.items():
        here, size = environment(**told), count if not told else max(count // 5, 32)
        row = []
        for name, law in laws.items():
            evaluate_policy(here, law, 32, seed=JUDGED)  # which compiles it
            begun = time.perf_counter()
            found = evaluate_policy(here, law, size, seed=JUDGED)
            if not told:
                usual[name] = found
                print(f"{name}: {size} flights in {time.perf_counter() - begun:.0f} s")
            row.append(100 * float(found.landed.mean()))
        rows.append((condition, size, *row))
    header = ("condition", "flights", *(f"{name} (%)" for name in laws))
    write_table(options.out / "trained", header, rows)
    rows = []
    for name, found in usual.items():
        if not found.landed.any():
            continue
        down = found.position.sel(axis="forward").where(found.landed)
        rows.append((name, float(down.mean()), float(found.time.where(found.landed).mean())))
    header = ("law", "distance of those that land (m)", "their time (s)")
    write_table(options.out / "trained_laws", header, rows)
    header = ("window", "the last state counts for", "updates", "landed (%)")
    others = windows(options, starts["gain-scheduled"], flights, max(count // 5, 32))
    write_table(options.out / "trained_windows", header, others)
    with style():
        save_figure(draw(usual, runs), options.out / "trained.png")


if __name__ == "__main__":
    main()
