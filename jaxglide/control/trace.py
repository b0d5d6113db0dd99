"""A controlled flight as a trajectory, for figures, views and files, and what it was told."""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_kind
from .._lib.fields import parameters_of
from ..flight.dynamics import ANGLES, RIGID
from ..flight.solve import settings_of
from ..flight.trajectory import AbstractTrajectory, Trajectory
from ..shape.drives import Actuated, Stepped, soft
from ..shape.gait import Gait
from ..shape.motion import Driven
from ..shape.shapes import Serpenoid
from .environment import Environment, Flown
from .plant import INPUTS, Flying, Plant

_FREE = 500.0  # half of a range; one that is wider is none


@eqx.filter_jit
def _steps(plant: Plant, times, states, inputs, before):
    """Times and states after every step of the solver, from samples, (N, steps) and so on."""
    shares = [(before, plant.late)] if plant.late else []
    shares += [(inputs, 1 - plant.late)]

    def one(time, state, *told):
        flying = plant.launched(state)._replace(time=time)
        kept = []
        for held, (_, share) in zip(told, shares, strict=True):
            count = max(1, int(np.ceil(share * plant.steps - 1e-9)))

            def on(flying: Flying, _, held=held, each=share / count):
                flying = plant.advance(flying, held, each)
                return flying, (flying.time, flying.state)

            flying, path = jax.lax.scan(on, flying, None, length=count)
            kept.append(path)
        return jax.tree.map(lambda *parts: jnp.concatenate(parts), *kept)

    return jax.vmap(one)(times, states, *(told for told, _ in shares))


def retrace(environment: Environment, flown: Flown, key) -> Trajectory:
    """A controlled flight as a trajectory, step by step, with what it was told in its glider.

    Figures, views and files take it like any other flight; between the steps it is
    interpolated linearly.

    Args:
        environment: what flew.
        flown: one flight of it; see `controlled_flight`.
        key: that it was drawn from.

    Raises:
        TypeError: a part is of another type.
        ValueError: it is a batch, or its state is not finite.

    Examples:
        >>> import jax
        >>> from jaxglide import Case, Constant, Environment, Gait, Glider, Launch, Polar, Snake
        >>> from jaxglide import controlled_flight, retrace
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(), Polar.smooth())
        >>> environment = Environment(Case(glider, Launch(height=2.0)))
        >>> law, key = Constant(environment.plant.inputs), jax.random.key(0)
        >>> flown = controlled_flight(environment, law, key, 20)
        >>> print(retrace(environment, flown, key))
        Flight from 0.0000 s: landed at 0.7128 s
          end point        x -0.0075   y 1.2976   z 0.0000 m
          solver steps     89 accepted, 0 rejected
    """
    check_kind("environment", environment, Environment)
    check_kind("flown", flown, Flown)
    if flown.ended.time.ndim:
        raise ValueError(
            f"flown is a batch of flights of shape {flown.ended.time.shape}: pass one"
        )
    if not np.isfinite(np.append(flown.ended.state, flown.ended.time)).all():
        raise ValueError("the flight's state is not finite: there is nothing to trace")
    plant = environment.reset(key)[0].plant
    going = ~np.asarray(flown.over)
    if not going.any():
        raise ValueError("the flight was over at its launch: there is nothing to trace")
    samples, told = np.asarray(flown.times)[going], np.asarray(flown.inputs)[going]
    states = np.asarray(flown.states)[going]
    held = np.concatenate([np.asarray(plant.inputs)[None], told[:-1]])
    path = _steps(plant, samples, states, told, held)
    times, states = _whole(flown, samples[0], states[0], *map(np.asarray, path))
    drive = plant.drive
    since = samples + float(plant.late * plant.interval)
    if plant.late:  # until then what the gait holds
        since, told = np.append(samples[0], since), np.concatenate([held[:1], told])
    law = Stepped(since, told)
    glider = plant.flight.glider
    glider = eqx.tree_at(
        lambda g: g.gait.drive, glider, eqx.tree_at(lambda d: d.law, drive, law)
    )
    step = float(plant.interval / plant.steps)
    settings = settings_of(
        rtol=1e-3,
        atol=1e-3,
        max_time=float(times[-1]),
        times=None,
        ends=plant.ends,
        solver=None,
        step=step,
        max_steps=len(times),
        dense=True,
    )
    interpolation: Any = diffrax.LinearInterpolation(*map(jnp.asarray, (times, states)))
    return Trajectory(
        glider=glider,
        settings=settings,
        phase=plant.flight.phase,
        start_time=jnp.asarray(times[0]),
        start=jnp.asarray(states[0]),
        outcome=flown.ended.outcome,
        time=jnp.asarray(times[-1]),
        state=jnp.asarray(states[-1]),
        max_angles=jnp.asarray(np.abs(states[:, ANGLES]).max(axis=0)),
        accepted=jnp.asarray(len(times) - 1),
        rejected=jnp.asarray(0),
        states=None,
        interpolation=interpolation,
    )


def _whole(flown: Flown, first, start, times, states):
    """Times and states from launch to end, (T,) and (T, s), each time once."""
    end, last = float(flown.ended.time), np.asarray(flown.ended.state)
    times, states = times.ravel(), states.reshape(-1, last.size)
    # a step is made twice where a delay ends; at the end of the flight it stands still
    least = 1e-9 * max(end, 1.0)
    rising = np.asarray(np.diff(times, prepend=first), float) > least
    before = rising & (times < end - least)
    parts = [first], times[before], [end]
    return np.concatenate(parts), np.concatenate([[start], states[before], [last]])


class History(NamedTuple):
    """What became of an input that was set, in the unit that people read.

    Attributes:
        name: of the input.
        unit: of all its numbers.
        meaning: in words.
        position: of its actuator at the times asked for, (T,).
        told: at these times, (T,).
        low, high: its range.
    """

    name: str
    unit: str
    meaning: str
    position: np.ndarray
    told: np.ndarray
    low: float
    high: float


def histories(flight: AbstractTrajectory, times) -> list[History]:
    """The inputs that were set in a flight under control; none of another flight.

    Args:
        flight: see `retrace`.
        times: [s], (T,), within it.
    """
    gait: Any = flight.glider.gait
    if not (isinstance(gait, Driven) and isinstance(gait.shape, Serpenoid)):
        return []
    drive = gait.drive
    if not (isinstance(drive, Actuated) and isinstance(drive.law, Stepped)):
        return []
    if drive.low is None or drive.high is None:
        return []
    lows, highs = np.asarray(drive.low), np.asarray(drive.high)
    states = np.asarray(flight.at(times))[:, RIGID:][:, : len(INPUTS)]
    law, found = drive.law, []
    row = np.searchsorted(np.asarray(law.times), np.asarray(times), side="right") - 1
    told = np.asarray(law.inputs)[np.maximum(row, 0)]
    for k, name in enumerate(INPUTS):
        low, high = float(lows[k]), float(highs[k])
        middle, half = (high + low) / 2, (high - low) / 2
        if half > _FREE:
            continue
        known = parameters_of(Gait)[name]
        position = middle + np.asarray(soft(states[:, k] - middle, half)[0])
        ends = low / known.factor, high / known.factor
        of_time = position / known.factor, told[:, k] / known.factor
        found.append(History(name, known.unit, known.meaning, *of_time, *ends))
    return found


class Target(NamedTuple):
    """Where a policy goes.

    Attributes:
        heading: yaw that it holds [rad], or None.
        points: to the right of the origin and forward of it [m], (K, 2), or None.
    """

    heading: float | None = None
    points: np.ndarray | None = None


def target_of(policy: Any) -> Target:
    """Where a policy goes, by its own `points` or `heading`, or those of the law within it."""
    for name in ("points", "heading"):
        value = getattr(policy, name, None)
        if value is not None:
            held = np.asarray(value, float)
            return Target(points=held) if name == "points" else Target(heading=float(held))
    for name in ("steering", "regulator", "base"):
        inner = getattr(policy, name, None)
        if inner is not None:
            return target_of(inner)
    return Target()
