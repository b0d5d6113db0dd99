"""Coordinated turns, and flight to points."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxglide
from jaxglide import (
    AngleLimit,
    Case,
    Controller,
    CoordinatedTurn,
    Environment,
    Gait,
    Glider,
    Ground,
    Launch,
    Polar,
    Senses,
    Snake,
    Waypoints,
    controlled_flight,
    linear_quadratic,
    steady_glide,
)
from jaxglide.control.regulator import YAW, Linear
from jaxglide.control.turning import steady_turn
from jaxglide.control.waypoints import course

FLAT = Gait.from_degrees(82, 12.6, 1.12, 1.58, 7.2)
ENDS = Ground(), AngleLimit(angles=("pitch", "roll"))
SAMPLES = 250


def environment_of(gait=FLAT, **senses) -> Environment:
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    case = Case(Glider(body, gait, Polar.smooth()), Launch(height=75.0), ENDS)
    return Environment(case, senses=Senses(**{"velocity": True, "place": True, **senses}))


@pytest.fixture(scope="module")
def environment() -> Environment:
    return environment_of()


@pytest.fixture(scope="module")
def regulator(environment):
    return linear_quadratic(environment)


def told(steering, points, near=2.0) -> Waypoints:
    return Waypoints(steering, jnp.asarray(points, float), jnp.asarray(near))


def nearest(path, points):
    """Least horizontal distance of a path (N, 2) from each point [m]."""
    start, step = path[:-1], np.diff(path, axis=0)
    share = np.einsum("kni,ni->kn", points[:, None] - start, step) / (step**2).sum(axis=1)
    there = start + np.clip(share, 0, 1)[..., None] * step
    return np.linalg.norm(there - points[:, None], axis=2).min(axis=1)


def test_the_cheapest_turn_repeats_itself_but_for_the_yaw():
    """Of a system like those of flights: nothing depends on the yaw."""
    rng, count, n, half = np.random.default_rng(0), 4, 15, np.array([0.4, 1.2])
    A, B = 0.2 * rng.normal(size=(count, n, n)), rng.normal(size=(count, n, 2))
    A[:, :, YAW] = np.eye(n)[YAW]
    inputs, states = steady_turn(Linear(states=None, A=A, B=B), half)  # type: ignore[arg-type]

    def after(inputs, state):
        for k in range(count):
            state = A[k] @ state + B[k] @ inputs[k]
        return state

    yaw, own = np.eye(n)[YAW], np.delete(np.arange(n), YAW)
    np.testing.assert_allclose(after(inputs, states[0]) - states[0], yaw, atol=1e-9)
    cycle = np.linalg.multi_dot(A[::-1])

    def cost(inputs):
        """Of periodic inputs, as far as they turn by a radian."""
        start = np.zeros(n)
        left = after(inputs, start)[own]
        start[own] = np.linalg.solve(np.eye(n - 1) - cycle[np.ix_(own, own)], left)
        return np.sum((inputs / after(inputs, start)[YAW] / half) ** 2)

    assert cost(inputs) == pytest.approx(np.sum((inputs / half) ** 2), rel=1e-9)
    for _ in range(4):
        other = 1e-3 * np.abs(inputs).max() * rng.normal(size=inputs.shape)
        assert min(cost(inputs + other), cost(inputs - other)) > cost(inputs)
    none = np.zeros_like(B)
    assert not np.any(steady_turn(Linear(None, A, none), half)[0])  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_turn_goes_at_its_pace_and_ends_at_its_heading(environment, regulator):
    """To either side; a regulator by itself goes a quarter as fast."""
    steering = CoordinatedTurn(regulator, pace=0.2)
    wanted = np.array([120.0, -120.0])

    def fly(heading):
        policy = eqx.tree_at(lambda law: law.regulator.heading, steering, heading)
        return controlled_flight(environment, policy, jax.random.key(0), SAMPLES)

    flown: Any = jax.vmap(fly)(jnp.deg2rad(wanted))
    assert flown.landed.all()
    for k, sign in enumerate((1, -1)):
        yaw = sign * np.rad2deg(flown.states[k, ~np.asarray(flown.over[k])][::8, 9])
        assert yaw[-1] == pytest.approx(120, abs=5)
        begun, done = (int(np.argmax(yaw > angle)) for angle in (40, 100))
        pace = (yaw[done] - yaw[begun]) / (done - begun)
        assert pace == pytest.approx(np.rad2deg(0.2), rel=0.05)


POINTS = np.array(
    [
        [[-20.0, 50.0], [0.0, 90.0]],
        [[20.0, 60.0], [40.0, 90.0]],
        [[-30.0, 30.0], [-70.0, 30.0]],
    ]
)


def test_waypoints_are_passed_one_after_another(environment, regulator):
    """From 75 m, within a few metres, and landed near the last where that is in reach."""
    steering = CoordinatedTurn(regulator, pace=0.2)
    flown: Any = jax.vmap(
        lambda points: controlled_flight(
            environment, told(steering, points), jax.random.key(0), SAMPLES
        )
    )(jnp.asarray(POINTS))
    assert flown.landed.all()
    for k, points in enumerate(POINTS):
        flying = ~np.asarray(flown.over[k])
        path = np.vstack([flown.states[k, flying, :2], flown.ended.state[k, None, :2]])
        assert (nearest(path, points) < 3).all()


@pytest.mark.slow
def test_waypoints_without_a_sense_of_velocity():
    environment = environment_of(velocity=False, angle_noise=0.02, delay=0.02)
    steering = CoordinatedTurn(linear_quadratic(environment))
    policy = told(steering, POINTS[1])
    flown: Any = controlled_flight(environment, policy, jax.random.key(0), SAMPLES)
    assert flown.landed
    flying = ~np.asarray(flown.over)
    assert (nearest(np.asarray(flown.states[flying, :2]), POINTS[1]) < 10).all()


def test_a_point_is_passed_near_it_or_abeam_of_it_and_the_last_never(regulator):
    policy = told(CoordinatedTurn(regulator), [[0.0, 10.0], [10.0, 10.0], [0.0, 0.0]])
    for k, place, passed in (
        (0, (0.0, 7.9), 0),
        (0, (0.0, 8.1), 1),
        (0, (5.0, 9.9), 0),
        (0, (5.0, 10.1), 1),
        (1, (9.9, 14.0), 0),
        (1, (10.1, 14.0), 1),
        (2, (0.0, 0.0), 0),
    ):
        assert policy._passed(k, jnp.array(place)) == passed


def test_the_path_of_the_glide_is_where_its_course_says(environment, regulator):
    """By the place after a cycle, flown."""
    phase = float(environment.plant.flight.phase)
    glide = steady_glide(environment.held, regulator.linear.states[0, :8], phase=phase)
    right, forward = glide.states[-1, :2]
    assert float(course(regulator)) == pytest.approx(np.arctan2(-right, forward), abs=2e-3)
    assert abs(float(course(regulator))) > 0.1


def test_waypoints_come_back_from_a_file(environment, regulator, tmp_path):
    """The same inputs at launch, and beyond the first point."""
    policy = told(CoordinatedTurn(regulator, pace=0.2), POINTS[0])
    path = jaxglide.save(Controller(policy, environment), tmp_path / "points.nc")
    again: Any = jaxglide.open(path)
    sensed = environment.reset(jax.random.key(0))[1]
    for k in (0, 30):
        here = sensed._replace(place=jnp.array([5.0, 1.7 * k]), sample=jnp.asarray(k))
        both = [law(law.start(), here)[0] for law in (policy, again.policy)]
        np.testing.assert_array_equal(*both)


def test_bad_input(environment, regulator):
    steering = CoordinatedTurn(regulator)
    with pytest.raises(TypeError, match="regulator"):
        CoordinatedTurn(steering)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"pace = 1\.5 rad a cycle is not allowed"):
        CoordinatedTurn(regulator, pace=1.5)
    with pytest.raises(ValueError, match="settle"):
        CoordinatedTurn(regulator, settle=-1)
    with pytest.raises(ValueError, match="forward has shape"):
        CoordinatedTurn(regulator, forward=np.zeros((8, 3)))
    with pytest.raises(TypeError, match="steering"):
        Waypoints(regulator, [[0.0, 1.0]])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="points is empty"):
        told(steering, np.zeros((0, 2)))
    with pytest.raises(ValueError, match="points has shape"):
        told(steering, [0.0, 1.0])
    with pytest.raises(ValueError, match="near"):
        told(steering, [[0.0, 1.0]], 0.0)
    turning = eqx.tree_at(lambda r: r.turn, regulator, jnp.asarray(0.1))
    with pytest.raises(ValueError, match=r"turns by 5\.73 deg a cycle by itself"):
        told(CoordinatedTurn(turning), [[0.0, 1.0]])
    blind = environment_of(place=False)
    policy = told(steering, [[0.0, 1.0]])
    with pytest.raises(ValueError, match="the place is not sensed"):
        controlled_flight(blind, policy, jax.random.key(0), 3)
