"""How the starts of an optimisation move, step by step."""

import numpy as np
import optax
import pytest

from jaxglide.search.ascent import Ascent
from jaxglide.search.objectives import landing_distance, stability_margin
from jaxglide.search.problem import Evaluation, Problem

PROBLEM = Problem(
    landing_distance,
    {"theta_m": (80.0, 120.0), "nu_theta": (1.0, 1.5)},
    (stability_margin.at_least(1.0),),
)
POINTS = np.array([[90.0, 1.1], [105.0, 1.4]])


def value(x):
    """Made-up objective of points (S, 2)."""
    return np.sin(x[:, 0] / 20) + x[:, 1] ** 2


def slack(x):
    """Made-up slack: negative at the second point."""
    return 2.5 - x[:, 0] / 60 - x[:, 1] ** 3 / 2


def found_at(x):
    slopes = [np.stack([np.cos(x[:, 0] / 20) / 20, 2 * x[:, 1]], axis=1)]
    slopes.append(np.stack([np.full(len(x), -1 / 60), -1.5 * x[:, 1] ** 2], axis=1))
    return Evaluation(np.stack([value(x), slack(x)], axis=1), np.stack(slopes, axis=1))


def ascent_of(rate=0.02):
    return Ascent(PROBLEM, POINTS, optax.sgd(rate), rate)


def test_the_slope_is_that_of_the_augmented_lagrangian():
    ascent = ascent_of()
    ascent.multiplier[:] = [[0.3], [0.2]]
    assert slack(POINTS)[1] < 0 < slack(POINTS)[0]

    def lagrangian(u):
        x = ascent.middle + ascent.half * np.sin(u)
        weight = np.maximum(0, ascent.multiplier - ascent.penalty * slack(x)[:, None])[:, 0]
        squares = weight**2 - ascent.multiplier[:, 0] ** 2
        return value(x) - squares / (2 * ascent.penalty[:, 0])

    step = 1e-6
    expected = np.stack(
        [
            (lagrangian(ascent.u + d) - lagrangian(ascent.u - d)) / (2 * step)
            for d in step * np.eye(2)
        ],
        axis=1,
    )
    before = ascent.u.copy()
    size = ascent.step(np.arange(2), found_at(POINTS))
    np.testing.assert_allclose(size, np.linalg.norm(expected, axis=1), rtol=1e-6)
    moved = 0.02 * expected
    moved *= np.minimum(1, 0.3 / np.linalg.norm(moved, axis=1, keepdims=True))
    np.testing.assert_allclose(ascent.u - before, moved, rtol=1e-6)


def test_a_start_that_is_lost_goes_half_way_back():
    ascent = ascent_of()
    first = ascent.u.copy()
    ascent.step(np.arange(2), found_at(POINTS))
    second = ascent.u.copy()
    lost = found_at(ascent.points)
    lost.values[0] = np.nan
    ascent.step(np.arange(2), lost)
    np.testing.assert_allclose(ascent.u[0], (first[0] + second[0]) / 2)
    assert (ascent.u[1] != second[1]).all()


def test_a_stuck_start_goes_on_from_its_best_with_shorter_steps():
    ascent = ascent_of()
    start = ascent.u.copy()
    ascent.step(np.arange(2), found_at(POINTS))
    first = ascent.u - start
    ended = ascent.shrink(np.array([True, False]), POINTS)
    assert not ended.any()
    np.testing.assert_allclose(ascent.points[0], POINTS[0])
    ascent.step(np.array([0]), Evaluation(*(part[:1] for part in found_at(POINTS))))
    np.testing.assert_allclose(ascent.u[0] - start[0], 0.4 * first[0])
    ended = [ascent.shrink(np.array([True, False]), POINTS) for _ in range(5)]
    assert [bool(e[0]) for e in ended] == [False, False, False, False, True]
    assert not any(e[1] for e in ended)


def test_multipliers_grow_where_a_constraint_is_violated():
    ascent = ascent_of(rate=1e-9)
    for _ in range(4):
        ascent.step(np.arange(2), found_at(POINTS))
    assert ascent.multiplier[0, 0] == 0
    assert ascent.multiplier[1, 0] == pytest.approx(-10 * slack(POINTS)[1])
