"""Steady glides that nobody computed: on a helix, or straight, with a wiggle in every cycle."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxglide import Branch, Gait, Glider, Polar, Snake, SteadyGlide
from jaxglide.steady import Reason
from jaxglide.steady.reduced import SAMPLES, reduce

FORWARD, SINK, WIGGLE = 8.0, 4.0, 0.05  # m/s, m/s, m
HEADING = 0.3  # rad, of the mean path from the nose at the start of a cycle, to the right


def on_the_way(times, turn_rate=0.0, heading=HEADING, f_theta=1.25):
    """States through the air at times [s], (T, 13): a helix, and a wiggle across it."""
    t = np.asarray(times, float)
    to_left = turn_rate * t - heading  # where the mean path goes
    r = FORWARD / turn_rate if turn_rate else np.inf
    x = r * (np.cos(to_left) - np.cos(heading)) if turn_rate else -FORWARD * t * np.sin(to_left)
    y = r * (np.sin(to_left) + np.sin(heading)) if turn_rate else FORWARD * t * np.cos(to_left)
    w = 2 * np.pi * f_theta
    across, rate = WIGGLE * np.sin(w * t), WIGGLE * w * np.cos(w * t)
    right = np.stack([np.cos(to_left), np.sin(to_left)])
    ahead = np.stack([-np.sin(to_left), np.cos(to_left)])
    states = np.zeros((t.size, 13))
    states[:, :2] = (np.stack([x, y]) + across * right).T
    states[:, 2] = -SINK * t
    states[:, 3:5] = ((FORWARD + turn_rate * across) * ahead + rate * right).T
    states[:, 5] = -SINK
    states[:, 8] = turn_rate
    states[:, 9] = turn_rate * t + 0.1 * np.sin(w * t)
    states[:, 10], states[:, 11] = -0.2 + 0.05 * np.cos(w * t), 0.15 * np.sin(w * t)
    states[:, 12] = FORWARD * t
    return states


def spectrum_of(radius):
    """A derivative of the map, (8, 8): a pair of a modulus, and real multipliers below 0.5."""
    slopes = np.diag([0.5, 0.3, -0.2, 0.1, 0.05, 0.01, 0.0, 0.0])
    angle = 0.7
    pair = radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    slopes[6:, 6:] = pair
    return slopes


def made_steady(turn_rate=0.0, radius=0.9, found=True, **changes):
    """A steady glide with these figures; `changes` of its other fields."""
    gait = Gait.from_degrees()
    glider = Glider(Snake.from_svl(nodes=12), gait, Polar.smooth())
    f_theta = float(gait.f_theta)
    period = 1 / f_theta
    states = on_the_way(np.linspace(0, period, SAMPLES + 1), turn_rate, f_theta=f_theta)
    slopes = spectrum_of(radius)
    multipliers = np.linalg.eigvals(slopes)
    multipliers = multipliers[np.argsort(-np.abs(multipliers))]
    figures = {
        "state": np.asarray(reduce(jnp.asarray(states[0]))),
        "speed": np.linalg.norm(states[0, 3:6]),
        "glide_angle": np.arctan2(SINK, FORWARD),
        "forward_speed": FORWARD,
        "sink_rate": SINK,
        "turn_rate": turn_rate,
        "multipliers": multipliers,
        "spectral_radius": abs(multipliers[0]),
        "slopes": slopes,
        "states": states,
    }
    if not found:
        figures = {name: np.full_like(value, np.nan) for name, value in figures.items()}
    rest = {
        "phase": 0.3,
        "found": found,
        "residual": 1e-14 if found else 0.2,
        "period": period,
        "step": 1 / 300,
    }
    arrays = {name: jnp.asarray(value) for name, value in (figures | rest).items()}
    reason = Reason.FOUND if found else Reason.NOT_CONVERGED
    counts = {
        "reason": jnp.asarray(int(reason), jnp.int32),
        "iterations": jnp.asarray(7, jnp.int32),
    }
    fields: dict[str, Any] = {"glider": glider, "frozen": False} | arrays | counts | changes
    return SteadyGlide(**fields)


def made_branch(count=61):
    """A branch in f_theta that folds back, stable up to a third of the way."""
    along = np.linspace(0, 1, count)
    value, radius = 0.5 + 4 * along * (1 - along), 0.7 + 0.9 * along
    kinds = np.full(count, "", "<U5")
    kinds[count // 4], kinds[np.argmax(value)] = "start", "fold"
    kinds[np.argmin(np.abs(radius - 1))] = "pair"
    multipliers = np.zeros((count, 8), complex)
    multipliers[:, 0] = radius
    arrays = {name: np.full(count, 2.0) for name in ("speed", "forward_speed", "sink_rate")}
    arrays |= {"parameter": value, "period": 1 / value, "turn_rate": 0 * value}
    arrays |= {"glide_angle": np.deg2rad(25 + 30 * along), "multipliers": multipliers}
    arrays |= {"state": np.ones((count, 8)), "states": np.ones((count, 1, 8)), "kinds": kinds}
    known = {"name": "f_theta", "unit": "Hz", "found": True, "ends": ("here", "there")}
    return Branch(**known, frozen=False, mirrored=True, **arrays)
