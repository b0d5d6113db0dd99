"""Coordinated turns: to a heading at a pace, leaning as a steady helix does."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_kind, check_range
from .._lib.types import Array, Float, Scalar
from .policy import AbstractPolicy, Sensed, turned
from .regulator import REACH, YAW, Linear, Regulator, lifted

PACE = 0.1
"""Largest turn in a cycle by default [rad]."""
SETTLE = 3.0
"""Cycles after launch in which no turn is begun by default."""
_CYCLES = 2.0  # in which what is left of a turn is to be made
_UNABLE = 1e-6  # rad a cycle by half the ranges of the inputs; less is no turn


def steady_turn(linear: Linear, half) -> tuple[np.ndarray, np.ndarray]:
    """The cheapest change of the inputs, the same in every cycle, that turns by a radian in it.

    Args:
        linear: of one cycle of a steady glide.
        half: half of the ranges of the inputs, in which they are counted, (c,).

    Returns:
        The inputs, (N, c), and the states that repeat themselves under them, the yaw less an
        even turn, (N, n); zeros where the inputs cannot turn it.
    """
    A, B = np.asarray(linear.A), np.asarray(linear.B)
    count, n, c = B.shape
    whole, told, _ = lifted(linear, np.zeros((n, n)), np.zeros((c, c)))
    own = np.delete(np.arange(n), YAW)
    start = np.zeros_like(told)
    start[own] = np.linalg.solve(np.eye(n - 1) - whole[np.ix_(own, own)], told[own])
    gained = (whole @ start + told)[YAW]
    cheap = gained * np.tile(np.asarray(half), count) ** 2
    if np.sqrt(cheap @ gained) < _UNABLE:
        return np.zeros((count, c)), np.zeros((count, n))
    inputs = cheap / (cheap @ gained)
    state, states = start @ inputs, []
    inputs = inputs.reshape(count, c)
    for k in range(count):
        states.append(state)
        state = A[k] @ state + B[k] @ inputs[k]
    states = np.array(states)
    states[:, YAW] -= np.arange(count) / count
    return inputs, states


class CoordinatedTurn(AbstractPolicy):
    """A regulator that turns to its heading at a pace, and holds it then.

    A turn adds to inputs and state what a steady one needs, so the regulator does not fight
    it. Where gusts have turned the body farther than the regulator calls it back from, the
    turn goes on from there.

    Args:
        regulator: its heading is where the turn ends; see `linear_quadratic`.
        pace: largest turn in a cycle [rad], 0 to 1.
        settle: cycles after launch in which it only holds where it is, 0 to 1,000.
        forward: what a turn of a radian in a cycle adds to the inputs, (N, c); by default the
            cheapest.

    Raises:
        TypeError: the regulator is none.
        ValueError: a number is out of range.
    """

    regulator: Regulator
    pace: Scalar
    settle: Scalar
    forward: Float[Array, "N c"]

    def __init__(
        self, regulator: Regulator, pace: Any = PACE, settle: Any = SETTLE, forward: Any = None
    ):
        check_kind("regulator", regulator, Regulator)
        check_range("pace", pace, "rad a cycle", 0, 1, shape=())
        check_range("settle", settle, "cycles", 0, 1000, shape=())
        self.regulator, self.pace = regulator, jnp.asarray(pace, float)
        self.settle = jnp.asarray(settle, float)
        if forward is not None:
            shape = regulator.K.shape[0] - regulator.launch, len(regulator.chosen)
            check_range("forward", forward, "", shape=shape)
            self.forward = jnp.asarray(forward, float)
            return
        half, glide = (regulator.high - regulator.low) / 2, slice(regulator.launch, None)
        inputs, states = steady_turn(Linear(*(part[glide] for part in regulator.linear)), half)
        held = np.einsum("kcn,kn->kc", np.asarray(regulator.K[glide]), states)
        self.forward = jnp.asarray(inputs + held)

    def start(self):
        return self.regulator.start(), jnp.zeros(())

    def __call__(self, memory, sensed: Sensed):
        return self.towards(self.regulator.heading, memory, sensed)

    def towards(self, heading, memory, sensed: Sensed) -> tuple[Float[Array, "6"], Any]:
        """Inputs on the way to a heading [rad], and what is remembered."""
        known, (remembered, now) = self.regulator, memory
        count, (row, cycles) = self.forward.shape[0], known.place(sensed.sample)
        yaw = turned(sensed.angles[0] - known.linear.states[row, YAW] - known.turn * cycles)
        now = jnp.where(sensed.sample == 0, yaw, now)
        apart = turned(yaw - now)
        lost = apart - jnp.clip(apart, -REACH, REACH)
        now = now + lost
        still = sensed.sample < jnp.maximum(known.launch, self.settle * count)
        pace = jnp.where(still, 0.0, self.pace)
        turn = jnp.clip(turned(heading - now) / _CYCLES, -pace, pace)
        moving, step = dataclasses.replace(known, heading=now), turn / count
        apart = moving.estimate(remembered.at[YAW].add(-lost), sensed)
        change = turn * self.forward[row - known.launch] - known.K[row] @ apart
        return moving.within(row, change), (apart.at[YAW].add(-step), now + step)
