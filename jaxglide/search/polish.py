"""The last gain of an optimisation: better points sampled near the best.

How far a gait glides has ridges narrower than a step that follows the gradient. Sampling
climbs them: that no nearby point is better is what it stops at.
"""

from collections.abc import Callable

import numpy as np

from .ascent import FEASIBLE, Best
from .problem import Evaluation, Problem

RADIUS = 0.02
"""Half width of the neighbourhood, in ranges of the parameters."""

SAMPLES = 256
"""Points sampled in a round."""

_NARROW = 0.03  # of the radius: the narrowest cloud
_WORTH = 1e-3  # a relative gain worth another round
_BARREN = 3  # rounds without one, after which it ends
_SUMMITS = 3  # starts sampled around


def neighbours(problem: Problem, centre, radius, count: int, rng) -> np.ndarray:
    """Points within `radius` (a number or (K, 1)) of the ranges around a point, (K, n)."""
    drawn = rng.uniform(-1, 1, (count, len(centre)))
    around = centre + radius * (problem.high - problem.low) * drawn
    return np.clip(around, problem.low, problem.high)


def summits(problem: Problem, best: Best) -> list[int]:
    """The best feasible starts, best first, at most three: none whose end lies within half
    the radius of a better one's."""
    chosen: list[int] = []
    place = (best.points - problem.low) / (problem.high - problem.low)
    for start in best.order[best.feasible[best.order]]:
        apart = [np.abs(place[start] - place[other]).max() for other in chosen]
        if min(apart, default=np.inf) > RADIUS / 2:
            chosen.append(int(start))
    return chosen[:_SUMMITS]


def sample_uphill(
    problem: Problem,
    best: Best,
    lead: int,
    evaluate: Callable[[np.ndarray], Evaluation],
    rounds: int,
    seed: int,
    told: Callable[[int, np.ndarray, Evaluation], None],
) -> int:
    """Move a start to the best feasible of its neighbours until three rounds gain nothing.

    Args:
        problem: what is maximised.
        best: where the starts ended; changed in place.
        lead: the start, a feasible one.
        evaluate: values at points (K, n).
        rounds: most rounds of 256 neighbours, half of them in ever narrower clouds.
        seed: of the samples.
        told: called after each round with the start, the best of the round's points that meet
            the constraints, (1, n), and what was found there.

    Returns:
        Rounds done.
    """
    rng, barren = np.random.default_rng([seed, 1]), 0
    for done in range(rounds):
        radius = RADIUS * _NARROW ** rng.uniform(0, 1, (SAMPLES, 1))
        radius[::2] = RADIUS
        points = neighbours(problem, best.points[lead], radius, SAMPLES, rng)
        found = evaluate(points)
        met = found.finite & (found.slacks >= -FEASIBLE).all(axis=1)
        before = best.values[lead]
        k = np.array([np.argmax(np.where(met, found.values[:, 0], -np.inf))])
        only = Evaluation(found.values[k], found.gradients[k])
        best.update(np.array([lead]), points[k], only)
        told(lead, points[k], only)
        gained = best.values[lead] - before > _WORTH * abs(before)
        barren = 0 if gained else barren + 1
        if barren == _BARREN:
            return done + 1
    return rounds
