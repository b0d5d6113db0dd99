"""How many of the 121 published shapes land from 75 m, without control and with feedback.

Smooth polar, 40 Gauss nodes. Set are d_psi (-20 to 30 degrees), d_theta (-30 to 30) and psi_m
(0 to 45), eight times a cycle. A shape is brought to one of its upright steady glides forward,
of its own gait or of another d_psi and psi_m: the launch is planned over four cycles or eight,
then the linear-quadratic regulator holds the glide. Those of 26 such glides that grow least in
a cycle are tried first, each at two prices of the inputs, until all flights land: the whole
state is sensed, and the design must land by steps of 1/480 s and by the published polar too;
attitude, angular velocity and actuators alone; the same with noise of 2 degrees and 0.2 rad/s,
50 ms late; the same in a gust of up to 1 m/s. In the last two 16 flights, with other noise,
launches of 1.5 to 2 m/s and other gusts. `--size` is the number of shapes, by default all.
"""

import itertools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure

from jaxglide import (
    Case,
    Gait,
    Glider,
    Launch,
    Outcome,
    Polar,
    Snake,
    SteadyGlide,
    simulate,
    steady_glide,
)
from jaxglide.air import Gust
from jaxglide.control import (
    Environment,
    Regulator,
    Senses,
    controlled_flight,
    linear_quadratic,
)
from jaxglide.ensemble.published import NU_THETA, THETA_M
from jaxglide.plot import style

HEIGHT = 75.0
SAMPLES = 176  # 18 s
AGAIN = 16
LAUNCHES = 4, 8  # cycles that are planned
STEP, FINE = 1 / 60, 1 / 480
RANGES = {"d_psi": (-20.0, 30.0), "d_theta": (-30.0, 30.0), "psi_m": (0.0, 45.0)}
OWN = (10.0, 20.0)
REFERENCES = (
    OWN,
    *((d, p) for p in (20.0, 30.0, 10.0, 40.0, 5.0) for d in (5.0, 0.0, 15.0, -5.0, 20.0)),
)
"""d_psi and psi_m of the glides that are tried [deg per SVL and deg]."""
PRICES, GLIDES = (1.0, 10.0), 6
STEEPEST, LEANING = np.deg2rad(65.0), np.deg2rad(40.0)  # pitch and roll of an upright glide
_LATE = {"angle_noise": np.deg2rad(2.0), "omega_noise": 0.2, "delay": 0.05}
SITUATIONS = {
    "whole state": (Senses(velocity=True), 0.0),
    "attitude and rates": (Senses(), 0.0),
    "noise and delay": (Senses(**_LATE), 0.0),
    "noise, delay, gust": (Senses(**_LATE), 1.0),
}


def glider_of(shape, reference=OWN, polar=None) -> Glider:
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    names = "theta_m", "nu_theta", "d_psi", "psi_m"
    gait = Gait.from_degrees(**dict(zip(names, (*shape, *reference), strict=True)))
    return Glider(body, gait, Polar.smooth() if polar is None else polar)


def environment_of(glider: Glider, senses, gust: float, many: bool, step=STEP) -> Environment:
    """A shape from 75 m, perhaps in a gust of either side, launched at many speeds."""
    air = Gust(velocity=jnp.zeros(3), gust_start=3.0, gust_length=10.0)
    flown = Glider(glider.body, glider.gait, glider.aerodynamics, air)
    ranges = {name: tuple(np.deg2rad(ends)) for name, ends in RANGES.items()}
    vary = {"launch.speed": (1.5, 2.0)} if many else {}
    if gust:  # at most so strong in any direction
        most = gust / np.sqrt(2)
        vary |= {f"air.velocity[{k}]": (-most, most) for k in (0, 1)}
    case = Case(flown, Launch(height=HEIGHT))
    told = {"senses": senses, "vary": vary, "actuators": {"ranges": ranges}, "step": step}
    return Environment(case, tuple(RANGES), **told)


@eqx.filter_jit
def ended(environment: Environment, policy, keys):
    """Ends of flights, and which landed."""
    flown = jax.vmap(lambda key: controlled_flight(environment, policy, key, SAMPLES))(keys)
    return flown.ended, flown.landed


class Held(NamedTuple):
    """A shape under feedback.

    Attributes:
        reference: d_psi and psi_m of the glide.
        price: of the inputs.
        cycles: that are planned.
        share: of its flights that landed.
        end: of the first: seconds, sideways, forward [m].
        again: with the whole state sensed, whether it lands by fine steps and by the
            published polar; else NaN.
    """

    reference: tuple[float, float]
    price: float
    cycles: int
    share: float
    end: tuple[float, ...]
    again: tuple[float, float]


def ahead(glide: SteadyGlide) -> float:
    """Mean velocity of a glide along its heading [m/s]: some go backwards."""
    states = np.asarray(glide.states)
    yaw = states[:, 9]
    return float(np.mean(states[:, 4] * np.cos(yaw) - states[:, 3] * np.sin(yaw)))


def upright_glides(shape, phase: float) -> list[tuple]:
    """Upright steady glides forward of a shape, those first which grow least in a cycle:
    reference, glider, glide."""
    found = []
    for reference in REFERENCES:
        glider = glider_of(shape, reference)
        glide = steady_glide(glider, phase=phase)
        pitch, roll = np.asarray(glide.state)[6:8]
        upright = abs(pitch) < STEEPEST and abs(roll) < LEANING
        if bool(glide.found) and upright and ahead(glide) > 0:
            found.append((reference, glider, glide))
    return sorted(found, key=lambda one: float(one[2].spectral_radius))[:GLIDES]


def best_of(designs, senses, gust: float) -> Held | None:
    """The first design all of whose flights land, or the one with most; None without any."""
    best = None
    for cycles, (reference, glider, glide), price in designs:
        try:
            known = environment_of(glider, senses, 0.0, False)
            policy = linear_quadratic(known, glide, price=price, launch=cycles)
        except ValueError:  # it cannot be stabilised, or no flight leads there
            continue
        many = bool(senses.delay)
        environment = environment_of(glider, senses, gust, many)
        keys = jax.random.split(jax.random.key(0), AGAIN if many else 1)
        end, landed = ended(environment, policy, keys)
        share, again = float(np.mean(np.asarray(landed))), (np.nan, np.nan)
        if share == 1 and bool(senses.velocity):
            again = verified(glider, policy, senses)
        if best is None or (share, *again) > (best.share, *best.again):
            where = float(end.time[0]), *map(float, end.state[0, :2])
            best = Held(reference, price, cycles, share, where, again)
        if best.share == 1 and 0 not in best.again:
            return best
    return best


def kept(more, tried: list):
    """The rest of the designs, each of which is kept among those tried."""
    for design in more:
        tried.append(design)
        yield design


def verified(glider: Glider, policy: Regulator, senses: Senses) -> tuple[float, float]:
    """Whether it lands by fine steps, and by the published polar."""
    other = Glider(glider.body, glider.gait, Polar.published())
    keys = jax.random.split(jax.random.key(0), 1)
    fine = environment_of(glider, senses, 0.0, False, FINE)
    published = environment_of(other, senses, 0.0, False)
    first, second = (float(ended(one, policy, keys)[1][0]) for one in (fine, published))
    return first, second


def rows_of(shape: tuple[float, float]) -> list[tuple]:
    """Rows of one shape."""
    alone = simulate(glider_of(shape), Launch(height=HEIGHT))
    said, none = str(Outcome(int(alone.outcome))), (np.nan,) * 9
    rows: list[tuple] = [
        (*shape, "none", said, float(alone.stable), float(alone.time), *none[:8])
    ]
    known = environment_of(glider_of(shape), Senses(), 0.0, False)
    glides = upright_glides(shape, float(known.plant.flight.phase))
    more = itertools.product(LAUNCHES, glides, PRICES)
    tried: list = []
    for name, (senses, gust) in SITUATIONS.items():
        held = best_of(itertools.chain(tuple(tried), kept(more, tried)), senses, gust)
        if held is None:
            rows.append((*shape, name, "no glide to fly", 0.0, *none))
            continue
        # the same is tried first in the next situation
        last = held.cycles, held.reference, held.price
        tried.sort(key=lambda design: (design[0], design[1][0], design[2]) != last)
        said = "landed" if held.share == 1 else f"{100 * held.share:.0f} % landed"
        design = *held.reference, held.price, held.cycles
        rows.append((*shape, name, said, held.share, *held.end, *design, *held.again))
    return rows


def told(shape: tuple[float, float]) -> list[tuple]:
    """The same, and how far it has come."""
    rows = rows_of(shape)
    print(*shape, *(f"{row[4]:.2f}" for row in rows), rows[1][-6:], flush=True)
    return rows


HEADER = (
    "theta_m (deg)",
    "nu_theta",
    "sensed",
    "how it ended",
    "share that landed",
    "time (s)",
    "sideways (m)",
    "forward (m)",
    "reference d_psi (deg/SVL)",
    "reference psi_m (deg)",
    "price",
    "cycles planned",
    "lands by steps of 1/480 s",
    "lands by the published polar",
)


def draw(rows: list[tuple]) -> Figure:
    """Maps of the shapes and the share of their flights that land, situation by situation."""
    names = ("none", *SITUATIONS)
    with style():
        figure = Figure(figsize=(180 / 25.4, 50 / 25.4), layout="constrained")
        axes = figure.subplots(1, len(names), sharex=True, sharey=True)
        for ax, name in zip(axes, names, strict=True):
            mine = [row for row in rows if row[2] == name]
            nu, theta, share = ([row[k] for row in mine] for k in (1, 0, 4))
            dots = ax.scatter(nu, theta, c=share, s=9, vmin=0, vmax=1, cmap="RdYlGn", lw=0)
            count = sum(one == 1 for one in share)
            ax.set_title(f"{name}\n{count} of {len(mine)}", fontsize=6)
            ax.set_xlabel(r"$\nu_\theta$")
        axes[0].set_ylabel(r"$\theta_m$ (deg)")
        figure.colorbar(dots, ax=axes, label="share that lands", aspect=30)
    return figure


def main() -> None:
    options = arguments(__doc__)
    shapes = [(float(t), float(n)) for t in THETA_M for n in NU_THETA]
    if options.size:
        shapes = shapes[:: max(1, len(shapes) // options.size)]
    rows = [row for one in shapes for row in told(one)]
    write_table(options.out / "control", HEADER, rows)
    totals = []
    for name in ("none", *SITUATIONS):
        mine = [row for row in rows if row[2] == name]
        share = [row[4] for row in mine]
        all_, most = (sum(one >= least for one in share) for least in (1.0, 0.9))
        totals.append((name, len(mine), all_, most, float(np.mean(share))))
    head = ("sensed", "shapes", "all flights land", "nine of ten", "share of all flights")
    write_table(options.out / "control_totals", head, totals)
    save_figure(draw(rows), options.out / "control.png")


if __name__ == "__main__":
    main()
