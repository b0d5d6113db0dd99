"""How the starts of an optimisation move.

Each moves in coordinates u without bounds, x = middle + half sin(u), so that a bound can be
reached and left again. Constraints enter by an augmented Lagrangian (Nocedal and Wright,
Numerical Optimization, section 17.4).
"""

import warnings

import jax
import jax.numpy as jnp
import numpy as np
import optax
from scipy.stats import qmc

from .problem import Evaluation, Problem

FEASIBLE = 1e-3
"""Largest violation that counts as none, in scales of the constraints."""

_INSIDE = 2e-4  # of half the range: starts keep off a bound, where the slope by u vanishes
_CLIP = 0.3  # longest step in u, whose range is pi
_SHRINK, _SHORTEST = 0.4, 0.01  # of the steps' scale, at first 1
_PENALTY = 10.0  # at first
_GROWTH = 4.0  # of the penalty where a violation has not shrunk to a quarter
_MULTIPLIERS_EVERY = 4  # steps between updates of the multipliers


def rule_of(optimiser, rate: float) -> optax.GradientTransformation:
    """The optax rule of a name, or the one given."""
    if not isinstance(optimiser, str):
        return optimiser
    if optimiser == "adam":
        return optax.adam(rate)
    return optax.chain(optax.scale_by_lbfgs(memory_size=8), optax.scale(-1.0))


class Best:
    """The best point of every start so far: feasible ones by value, others by violation.

    Args:
        starts, n, m: numbers of starts, parameters and constraints.
        tolerance: relative gain of value that counts as a gain; of violation a tenth does.
    """

    def __init__(self, starts: int, n: int, m: int, tolerance: float):
        self.tolerance = tolerance
        self.points = np.full((starts, n), np.nan)
        self.values = np.full(starts, -np.inf)
        self.slacks = np.full((starts, m), -np.inf)
        self.violation = np.full(starts, np.inf)
        self.marked = np.full((starts, 2), [-np.inf, np.inf])  # value, violation of last gain
        self.since = np.zeros(starts, int)  # steps since then

    @property
    def feasible(self) -> np.ndarray:
        """Which starts have met the constraints, (S,)."""
        return self.violation <= FEASIBLE

    def update(self, index, points, found: Evaluation) -> None:
        """Take in what was found at points (k, n) of the starts `index` (k,)."""
        values, slacks = found.values[:, 0], found.slacks
        violation = np.maximum(-slacks, 0).max(axis=1, initial=0.0)
        was, now = self.feasible[index], violation <= FEASIBLE
        better = np.where(
            was & now,
            values > self.values[index],
            np.where(was | now, now, violation < self.violation[index]),
        )
        better &= found.finite
        to = index[better]
        self.points[to], self.values[to] = points[better], values[better]
        self.slacks[to], self.violation[to] = slacks[better], violation[better]
        worth, open_ = self.marked[index].T
        gain = np.where(now, values > worth + self.tolerance * np.abs(values), False)
        gain |= ~now & ~was & (violation < 0.9 * open_)
        gain &= better
        self.since[index] += 1
        self.since[index[gain]] = 0
        kept = np.where(now, values, -np.inf), violation
        self.marked[index[gain]] = np.stack(kept, axis=1)[gain]

    @property
    def order(self) -> np.ndarray:
        """The starts, best first, (S,)."""
        rank = np.where(self.feasible, 0.0, np.where(np.isfinite(self.violation), 1.0, 2.0))
        merit = np.where(self.feasible, -self.values, self.violation)
        return np.lexsort((merit, rank))

    @property
    def leader(self) -> int:
        """The best start."""
        return int(self.order[0])


def sobol(problem: Problem, count: int, seed: int) -> np.ndarray:
    """Points of a Sobol set within the bounds, (count, n)."""
    with warnings.catch_warnings():  # that the number is no power of 2
        warnings.simplefilter("ignore")
        drawn = qmc.Sobol(len(problem.names), rng=seed).random(count)
    return problem.low + drawn * (problem.high - problem.low)


class Ascent:
    """All starts, moving uphill.

    Args:
        problem: what is maximised.
        points: where they start, within the bounds, (S, n).
        optimiser, rate: as in `optimise`.
    """

    def __init__(self, problem: Problem, points: np.ndarray, optimiser, rate: float):
        starts, m = len(points), len(problem.constraints)
        self.low, self.high = problem.low, problem.high
        self.middle = (problem.low + problem.high) / 2
        self.half = (problem.high - problem.low) / 2
        most = 1 - _INSIDE
        self.u = np.arcsin(np.clip((points - self.middle) / self.half, -most, most))
        rule = rule_of(optimiser, rate)
        self.state = jax.vmap(rule.init)(self.u)
        self._update = jax.jit(jax.vmap(rule.update))
        self.good = self.u.copy()  # where all was finite last
        self.multiplier, self.penalty = np.zeros((starts, m)), np.full((starts, m), _PENALTY)
        self.before = np.full((starts, m), np.inf)  # violation at the last update of those
        self.taken = 0
        self.scale = np.ones(starts)  # of the steps; shrinks where nothing is gained

    @property
    def points(self) -> np.ndarray:
        """Parameters of all starts in their units, within the bounds, (S, n)."""
        return np.clip(self.middle + self.half * np.sin(self.u), self.low, self.high)

    def step(self, index: np.ndarray, found: Evaluation) -> np.ndarray:
        """Move the starts `index` (k,) by what was found there; norm of their slopes (k,).

        Where that is not finite a start goes half way back to where it was.
        """
        finite = found.finite
        slope = self._slope(index, found)
        moved = np.zeros(len(self.u), bool)
        moved[index[finite]] = True
        downhill = np.zeros_like(self.u)
        downhill[moved] = -slope[finite]
        change = self._change(downhill, moved)
        lost = index[~finite]
        self.u[lost] = (self.u[lost] + self.good[lost]) / 2
        self.good[moved] = self.u[moved]
        self.u[moved] += change[moved]
        self.taken += 1
        if self.taken % _MULTIPLIERS_EVERY == 0:
            self._weigh(index[finite], found.slacks[finite])
        return np.linalg.norm(slope, axis=1)

    def _slope(self, index, found: Evaluation) -> np.ndarray:
        """Gradient of the augmented Lagrangian by u, (k, n)."""
        objective, slacks = found.gradients[:, 0], found.gradients[:, 1:]
        weight = np.maximum(0, self.multiplier[index] - self.penalty[index] * found.slacks)
        uphill = objective + np.einsum("sm,smn->sn", weight, slacks)
        return uphill * self.half * np.cos(self.u[index])

    def _change(self, downhill: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """The optimiser's steps, clipped, (S, n); its memory of other starts stays."""
        change, after = self._update(jnp.asarray(downhill), self.state, jnp.asarray(self.u))

        def keep(new, old):
            return jnp.where(moved.reshape(-1, *[1] * (new.ndim - 1)), new, old)

        self.state = jax.tree.map(keep, after, self.state)
        change = np.nan_to_num(np.asarray(change))
        size = np.linalg.norm(change, axis=1, keepdims=True)
        clipped = change * np.minimum(1, _CLIP / np.maximum(size, 1e-30))
        return self.scale[:, None] * clipped

    def shrink(self, starts: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Go on from points (S, n) with shorter steps, where `starts` (S,) is true.

        Returns:
            Where the steps have become as short as they may, (S,).
        """
        place = np.clip((points - self.middle) / self.half, -1, 1)
        known = starts & np.isfinite(place).all(axis=1)
        self.u[known] = np.arcsin(place[known])
        self.scale[starts] *= _SHRINK
        return self.scale < _SHORTEST

    def _weigh(self, index: np.ndarray, slacks: np.ndarray) -> None:
        """Update multipliers and penalties."""
        old = self.multiplier[index] - self.penalty[index] * slacks
        self.multiplier[index] = np.maximum(0, old)
        violation = np.maximum(-slacks, 0)
        stuck = violation > np.maximum(self.before[index] / 4, FEASIBLE)
        self.penalty[index] *= np.where(stuck, _GROWTH, 1.0)
        self.before[index] = violation
