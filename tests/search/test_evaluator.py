"""Values and gradients of many points: the same as alone, whoever the neighbours are."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Actuated,
    Case,
    Driven,
    Gait,
    Glider,
    LaggingCirculation,
    Launch,
    Polar,
    Serpenoid,
    Snake,
    TimeLimit,
)
from jaxglide.air.air import UniformWind
from jaxglide.ensemble import batch
from jaxglide.flight.ends import AngleLimit, Ground
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.objective import Objective
from jaxglide.search.objectives import landing_distance, stability_margin
from jaxglide.search.problem import Problem

SETUP = {"polar": "smooth", "node_set": "gauss", "nodes": 24}
FREE = {"theta_m": (85.0, 100.0), "nu_theta": (1.3, 1.5), "launch.height": (0.1, 1.5)}
MANY = FREE | {
    "d_psi": (-5.0, 20.0),
    "psi_m": (5.0, 25.0),
    "f_theta": (1.0, 1.6),
    "svl": (0.6, 0.8),
    "mass": (0.03, 0.05),
    "speed": (1.4, 2.0),
}


def points_of(problem, count, seed):
    drawn = np.random.default_rng(seed).uniform(size=(count, len(problem.names)))
    return problem.low + drawn * (problem.high - problem.low)


def alone(problem, x):
    """Values and gradients of one point, by `jacfwd` of the whole simulation."""

    def twice(x):
        values = problem.values(x)
        return values, values

    slopes, values = jax.jit(jax.jacfwd(twice, has_aux=True))(jnp.asarray(x))
    return np.asarray(values), np.asarray(slopes)


@pytest.fixture(scope="module")
def flights():
    limit = stability_margin.at_least(10.0, scale=10.0)
    return Problem(landing_distance, FREE, (limit,), setup=SETUP)


@pytest.fixture(scope="module")
def together(flights):
    points = points_of(flights, 40, 0)
    return points, Evaluator(flights)(points)


def test_in_the_pool_as_alone(flights, together):
    points, found = together
    assert found.gradients.shape == (40, 2, 3)
    longest = np.argsort(points[:, 2])[-2:]
    for k in (0, 1, 2, *longest):
        values, slopes = alone(flights, points[k])
        np.testing.assert_allclose(found.values[k], values, rtol=1e-8)
        np.testing.assert_allclose(found.gradients[k], slopes, rtol=1e-5, atol=1e-9)


@pytest.mark.slow  # by the compiler that users have, as the slow set is
def test_bits_depend_on_no_neighbour(flights, together, monkeypatch):
    points, found = together
    chosen = np.array([31, 4, 17, 4, 9])
    few = Evaluator(flights)(points[chosen])
    monkeypatch.setattr("jaxglide.search.evaluator.default_width", lambda *_, **__: 32)
    wide = Evaluator(flights)(points)
    for one, places in ((few, chosen), (wide, np.arange(40))):
        np.testing.assert_array_equal(one.values, found.values[places])
        np.testing.assert_array_equal(one.gradients, found.gradients[places])


def test_lanes_are_busy_with_gradients(flights, monkeypatch):
    turns, fly = [], batch.fly

    def counted(program, values, fleet, shared):
        for found in fly(program, values, fleet, shared):
            turns.append((int(found[2].steps) * fleet.lanes, int(found[2].busy)))
            yield found

    monkeypatch.setattr(batch, "fly", counted)
    Evaluator(flights)(points_of(flights, 200, 1))
    steps, busy = np.sum(turns, axis=0)
    assert busy / steps > 0.9


def leaning(time, observation):
    """Inputs of a serpenoid that turns against its roll."""
    return jnp.stack([1.7, 0.35, 1.4, 0.1, -0.3 * observation.angles[2], 1.2])


@pytest.mark.slow
def test_times_winds_and_states_of_parts_move_too():
    """A free end of the time, wind, and gains of parts with states of their own."""
    motion = Driven(
        Serpenoid(), Actuated(leaning, Gait.from_degrees(nu_theta=1.4), natural_frequency=25.0)
    )
    body = Snake.from_svl(nodes=12, node_set="gauss")
    air = UniformWind(velocity=jnp.array([0.3, 0.0, 0.0]))
    glider = Glider(body, motion, LaggingCirculation(Polar.smooth()), air)
    ends = Ground(), AngleLimit.degrees(60.0, "roll"), TimeLimit(0.2)
    case = Case(glider, Launch(3.0, 1.7, angles=(0.1, 0.0, 0.2)), ends)
    sunk = Objective("height left", "m", lambda trial: trial.glide.state[2])
    free = {"end_time": (0.1, 0.4), "air.velocity[0]": (-1, 1), "natural_frequency": (10, 40)}
    problem = Problem(sunk, free, case=case, rtol=1e-9, atol=1e-9)
    points = np.array([[0.2, 0.5, 20.0], [0.12, -0.5, 30.0]])
    found = Evaluator(problem)(points)
    for k in range(2):
        values, slopes = alone(problem, points[k])
        np.testing.assert_allclose(found.values[k], values, rtol=1e-9)
        np.testing.assert_allclose(found.gradients[k], slopes, rtol=1e-6, atol=1e-10)
    assert (np.abs(found.gradients) > 1e-7).all()
    # as the speed of sinking at the end
    move = 1e-4
    near = points[[0, 0]] + [[move, 0, 0], [-move, 0, 0]]
    up, down = Evaluator(problem, gradients=False)(near).values[:, 0]
    assert found.gradients[0, 0, 0] == pytest.approx((up - down) / (2 * move), rel=1e-5)


@pytest.mark.slow
def test_of_many_parameters_backwards():
    """The same values as forwards, gradients but for rounding; bits of no neighbour.

    Of steps that rounding hardly moves: their error is estimated as a difference of large
    numbers. At 1e-7 a thousandth of the tolerance moves the slope by f_theta by 5e-3 of it.
    """
    problem = Problem(landing_distance, MANY, setup=SETUP, rtol=1e-5, atol=1e-5)
    points = points_of(problem, 12, 2)
    back, forth = Evaluator(problem), Evaluator(problem)
    assert back._backwards
    forth._backwards = False
    found, expected = back(points), forth(points)
    np.testing.assert_allclose(found.values, expected.values, rtol=1e-8)
    scale = np.abs(expected.gradients).max(axis=0)
    np.testing.assert_allclose(found.gradients / scale, expected.gradients / scale, atol=1e-8)
    few = back(points[[7, 3]])
    np.testing.assert_array_equal(few.values, found.values[[7, 3]])
    np.testing.assert_array_equal(few.gradients, found.gradients[[7, 3]])
