"""The launch planned ahead: from the launch to the steady glide, within the inputs' limits;
or a whole flight that another is to keep to.

The linear-quadratic problem of `regulator` along the real flight: differential dynamic
programming with first derivatives of the flight (iterative LQR), from a guess that need not be
a flight. Every sample of it may miss the next, as in multiple shooting, and a step closes as
much of the gaps as it goes (Giftthaler et al., 2018; Mastalli et al., 2020).
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .plant import Plant
from .sampled import next_state

SHORTEST = 0.5**6
"""Shortest part of a step that is tried."""
CLOSED = 1e-9
"""Largest gap, scaled, of what counts as a flight."""
_SETTLED = 1e-4  # relative gain of a step that is the last
_FIRM, _FIRMEST = 1e-6, 1e6  # regularisation, relative to the inputs' weights


class PlanGoal(NamedTuple):
    """What a plan is to come near to, and what that is worth.

    Attributes:
        states: of the steady glide, or of another flight, (N + 1, n).
        inputs: of it, (N, c).
        Q, R, P: weights of state, inputs and of the last state, (n, n), (c, c), (n, n).
        low, high: limits of the inputs, (c,).
    """

    states: np.ndarray
    inputs: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    P: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def cost(self, states, inputs) -> float:
        """Of states (N + 1, n) and inputs (N, c)."""
        apart, told = states - self.states, inputs - self.inputs
        on_the_way = np.einsum("ki,ij,kj->", apart[:-1], self.Q, apart[:-1])
        on_the_way += np.einsum("ki,ij,kj->", told, self.R, told)
        return float(on_the_way + apart[-1] @ self.P @ apart[-1])


class LaunchPlan(NamedTuple):
    """A flight from a launch, and the feedback that keeps to it.

    Attributes:
        states: controlled states at the samples, (N + 1, n).
        inputs: the chosen ones, (N, c).
        A, B: derivatives along it, (N, n, n), (N, n, c).
        K: gains about it, (N, c, n).
        cost: see `PlanGoal.cost`.
        gap: largest miss of a sample, scaled; 0 for a flight.
        iterations: steps taken.
    """

    states: np.ndarray
    inputs: np.ndarray
    A: np.ndarray
    B: np.ndarray
    K: np.ndarray
    cost: float
    gap: float
    iterations: int


@eqx.filter_jit
def _slopes(states, inputs, times, plant: Plant, chosen):
    """Where every sample gets to, and its derivatives."""

    def one(x, u, time):
        def to(x, u):
            reached = next_state(x, u, time, plant, chosen)
            return reached, reached

        (A, B), reached = jax.jacfwd(to, (0, 1), has_aux=True)(x, u)
        return reached, A, B

    return jax.vmap(one)(states, inputs, times)


@eqx.filter_jit
def _flown(x, states, inputs, K, gaps, times, plant: Plant, chosen, low, high):
    """States and inputs of the flight with gaps, under feedback."""

    def on(x, given):
        old, u, K, gap, time = given
        u = jnp.clip(u + K @ (x - old), low, high)
        later = next_state(x, u, time, plant, chosen) - gap
        return later, (later, u)

    rest, told = jax.lax.scan(on, x, (states, inputs, K, gaps, times))[1]
    return jnp.concatenate([x[None], rest]), told


def _within(H, g, low, high):
    """The least of d H d / 2 + g d within limits, (c,), and which numbers are free, (c,)."""
    free, d = np.ones(len(g), bool), np.zeros(len(g))
    for _ in range(2 * len(g) + 1):
        rest = g + H[:, ~free] @ d[~free]
        d[free] = -np.linalg.solve(H[np.ix_(free, free)], rest[free])
        held = np.clip(d, low, high)
        if (held == d).all():
            break
        free &= held == d
        d = held
        if not free.any():
            break
    return d, free


def _backwards(wanted: PlanGoal, states, inputs, A, B, gaps, firm: float):
    """Steps (N, c) and gains (N, c, n)."""
    N, n, c = B.shape
    Vxx, Vx = 2 * wanted.P, 2 * wanted.P @ (states[-1] - wanted.states[-1])
    steps, gains = np.zeros((N, c)), np.zeros((N, c, n))
    for k in range(N - 1, -1, -1):
        ahead = Vx + Vxx @ gaps[k]
        Qx = 2 * wanted.Q @ (states[k] - wanted.states[k]) + A[k].T @ ahead
        Qu = 2 * wanted.R @ (inputs[k] - wanted.inputs[k]) + B[k].T @ ahead
        Qxx = 2 * wanted.Q + A[k].T @ Vxx @ A[k]
        Quu = 2 * (1 + firm) * wanted.R + B[k].T @ Vxx @ B[k]
        Qux = B[k].T @ Vxx @ A[k]
        steps[k], free = _within(Quu, Qu, wanted.low - inputs[k], wanted.high - inputs[k])
        if free.any():
            gains[k][free] = -np.linalg.solve(Quu[np.ix_(free, free)], Qux[free])
        s, K = steps[k], gains[k]
        Vx = Qx + K.T @ (Quu @ s + Qu) + Qux.T @ s
        Vxx = Qxx + K.T @ Quu @ K + K.T @ Qux + Qux.T @ K
        Vxx = (Vxx + Vxx.T) / 2
    return steps, gains


class _Place(NamedTuple):
    """A guess, and what is known there."""

    states: np.ndarray
    inputs: np.ndarray
    A: np.ndarray
    B: np.ndarray
    gaps: np.ndarray
    missed: float
    cost: float


class _Planner:
    """Steps of a plan; arguments as in `plan_launch`."""

    def __init__(
        self, start, plant: Plant, chosen: tuple[int, ...], wanted: PlanGoal, count: int
    ):
        self.start, self.flight, self.wanted = jnp.asarray(start), (plant, chosen), wanted
        self.times = plant.interval * jnp.arange(count)
        self.scale, self.penalty = np.sqrt(np.diag(wanted.Q)), 1.0
        self.limits = jnp.asarray(wanted.low), jnp.asarray(wanted.high)

    def place(self, states, inputs) -> _Place:
        found = _slopes(states[:-1], inputs, self.times, *self.flight)
        reached, A, B = map(np.asarray, found)
        gaps = reached - states[1:]
        missed = float(np.abs(gaps * self.scale).sum())
        return _Place(states, inputs, A, B, gaps, missed, self.wanted.cost(states, inputs))

    def step(self, here: _Place, firm: float) -> tuple[Any, float]:
        """The next guess, of the longest part of a step that is better, and its gain; or None.

        What is better costs less, gaps included, at a price that lets none of them grow.
        """
        given = here.A, here.B, here.gaps
        try:
            steps, gains = _backwards(self.wanted, here.states, here.inputs, *given, firm)
        except np.linalg.LinAlgError:  # a guess that grows beyond what floats hold
            return None, 0.0
        if here.missed > CLOSED:
            self.penalty = max(self.penalty, 1 + here.cost / here.missed)
        was, share = here.cost + self.penalty * here.missed, 1.0
        while share >= SHORTEST:
            told, open_ = here.inputs + share * steps, (1 - share) * here.gaps
            given = here.states[:-1], told, gains, open_, self.times, *self.flight
            states, inputs = map(np.asarray, _flown(self.start, *given, *self.limits))
            if np.isfinite(states).all():
                left = self.penalty * (1 - share) * here.missed
                gain = was - self.wanted.cost(states, inputs) - left
                if gain > 0:
                    return (states, inputs), gain / was
            share /= 2
        return None, 0.0


def plan_launch(
    start, plant: Plant, chosen: tuple[int, ...], wanted: PlanGoal, guess: Any, most: int = 50
) -> LaunchPlan:
    """The cheapest flight from a start, as far as steps that go down lead.

    Args:
        start: controlled state at launch, (n,).
        plant: what flies.
        chosen: which inputs are set.
        wanted: what to come near to.
        guess: states (N + 1, n), which need be no flight, and inputs (N, c).
        most: steps.

    Raises:
        ValueError: errors on the way grow too large for a feedback.
    """
    states, inputs = (np.array(part, float) for part in guess)
    states[0] = start
    planner = _Planner(start, plant, chosen, wanted, len(inputs))
    here, firm, taken = planner.place(states, inputs), _FIRM, 0
    while taken < most and firm <= _FIRMEST:
        better, gain = planner.step(here, firm)
        if better is None:
            firm, planner.penalty = 100 * firm, 10 * planner.penalty
            continue
        here, firm, taken = planner.place(*better), max(firm / 100, _FIRM), taken + 1
        if gain < _SETTLED and here.missed < CLOSED:
            break
    free = np.full_like(wanted.low, np.inf)
    wide, none = wanted._replace(low=-free, high=free), np.zeros_like(here.gaps)
    try:
        K = -_backwards(wide, here.states, here.inputs, here.A, here.B, none, 0.0)[1]
    except np.linalg.LinAlgError:
        raise ValueError(
            f"no feedback keeps to a launch planned over {len(inputs)} samples: an error on it "
            "grows beyond what floats hold; plan fewer cycles"
        ) from None
    gap = float(np.abs(here.gaps * planner.scale).max())
    return LaunchPlan(here.states, here.inputs, here.A, here.B, K, here.cost, gap, taken)
