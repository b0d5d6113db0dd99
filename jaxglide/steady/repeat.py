"""Some cycles of a steady glide, from the one that is known: what follows repeats it."""

import dataclasses
from typing import Any

import diffrax
import jax.numpy as jnp
import numpy as np

from ..flight.dynamics import ANGLES, PATH, POSITION, VELOCITY
from ..flight.ends import Outcome
from ..flight.solve import settings_of
from ..flight.trajectory import Trajectory
from .glide import carried
from .result import SteadyGlide


def _turned(vectors: np.ndarray, angle: float) -> np.ndarray:
    """Vectors (..., 3) turned about the vertical, to the left [rad]."""
    s, c = np.sin(angle), np.cos(angle)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([c * x - s * y, s * x + c * y, z], axis=-1)


def _moved(states: np.ndarray, shift: np.ndarray, turn: float, path: float) -> np.ndarray:
    """States of flight, (T, 13), that start elsewhere, with another yaw, after a path."""
    states = states.copy()
    for part in (POSITION, VELOCITY):
        states[:, part] = _turned(states[:, part], turn)
    states[:, POSITION] += shift
    states[:, ANGLES.start] += turn
    states[:, PATH] += path
    return states


def repeated(glide: SteadyGlide, cycles: int = 2) -> Trajectory:
    """Some cycles as a flight through the air, whose mean path starts forward, along y.

    Nothing is solved: a cycle that is turned and shifted is the next one. It is linear
    between the samples of a cycle.

    Args:
        glide: one that was found.
        cycles: how many; of a frozen body, seconds.

    Raises:
        ValueError: it was not found.
    """
    if not bool(glide.found):
        raise ValueError(f"there is no steady glide to draw: {glide.why}")
    one, period = np.asarray(glide.states), float(glide.period)
    last = one[-1]
    turn = float(last[ANGLES.start])
    x, y = np.sign(np.sinc(turn / (2 * np.pi))) * last[:2]  # of the chord, ahead
    # the mean path starts half a turn to the right of it
    yaw, shift, parts = float(np.arctan2(x, y)) + turn / 2, np.zeros(3), []
    for k in range(cycles):
        parts.append(_moved(one, shift, yaw, k * float(last[PATH]))[k > 0 :])
        shift, yaw = parts[-1][-1, POSITION], yaw + turn
    states = np.concatenate(parts)
    times = np.linspace(0.0, cycles * period, len(states))
    return _trajectory(glide, jnp.asarray(times, one.dtype), jnp.asarray(states))


def _trajectory(glide: SteadyGlide, times, states) -> Trajectory:
    still = dataclasses.replace(glide.glider, air=carried(glide.glider.air))
    none = jnp.asarray(0, jnp.int32)
    path: Any = diffrax.LinearInterpolation(times, states)
    settings = settings_of(
        rtol=1e-6, atol=1e-6, max_time=float(times[-1]), times=None, ends=(), solver=None,
        step=None, max_steps=1, dense=True,
    )  # fmt: skip
    return Trajectory(
        glider=still,
        settings=settings,
        phase=glide.phase,
        start_time=times[0],
        start=states[0],
        outcome=jnp.asarray(int(Outcome.OUT_OF_TIME), jnp.int32),
        time=times[-1],
        state=states[-1],
        max_angles=jnp.max(jnp.abs(states[:, ANGLES]), axis=0),
        accepted=none,
        rejected=none,
        states=None,
        interpolation=path,
    )
