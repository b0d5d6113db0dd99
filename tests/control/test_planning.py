"""The planned launch: a flight, the cheapest near it, handed over to the glide."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Case, Gait, Glider, Launch, Polar, Snake, steady_glide
from jaxglide.control import Constant, Environment, Senses, controlled_flight, linear_quadratic
from jaxglide.control.planning import PlanGoal, plan_launch
from jaxglide.control.plant import limits
from jaxglide.control.regulator import riccati, scales, weights
from jaxglide.control.sampled import controlled_state, next_state

RANGES = {"d_psi": (-20, 30), "d_theta": (-30, 30), "psi_m": (0, 45)}


def environment_of(inputs=("d_psi", "d_theta"), senses=None, **gait) -> Environment:
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    glider = Glider(body, Gait.from_degrees(**gait), Polar.smooth())
    ranges = {name: tuple(np.deg2rad(RANGES[name])) for name in inputs}
    case, actuators = Case(glider, Launch(height=75.0)), {"ranges": ranges}
    senses = Senses(velocity=True) if senses is None else senses
    return Environment(case, inputs, senses=senses, actuators=actuators, step=1 / 60)


@pytest.fixture(scope="module")
def environment() -> Environment:
    return environment_of(d_psi=5)


@pytest.fixture(scope="module")
def glide(environment):
    return steady_glide(environment.held, phase=float(environment.plant.flight.phase))


@pytest.fixture(scope="module")
def planned(environment, glide):
    return linear_quadratic(environment, glide, launch=2)


@pytest.fixture(scope="module")
def asked(environment, planned) -> tuple[Any, PlanGoal]:
    """The same problem, posed to the planner itself."""
    plant, chosen = environment.plant, environment.chosen
    linear = jax.tree.map(lambda x: x[planned.launch :], planned.linear)
    cost = weights(plant, chosen, scales(environment.held, plant.flight.sections))
    P = riccati(linear, *cost).P
    states = np.concatenate([linear.states, linear.states, linear.states[:1]])
    held = np.tile(np.asarray(plant.inputs)[list(chosen)], (len(states) - 1, 1))
    low, high = map(np.asarray, limits(plant.drive, chosen))
    start = np.asarray(planned.linear.states[0])
    return start, PlanGoal(states, held, *cost, P, low, high)


def flown(environment, start, inputs) -> np.ndarray:
    """States along inputs (N, c)."""
    plant, chosen = environment.plant, environment.chosen
    times = plant.interval * jnp.arange(len(inputs))

    def on(x, given):
        later = next_state(x, given[0], given[1], plant, chosen)
        return later, later

    rest = jax.lax.scan(on, jnp.asarray(start), (jnp.asarray(inputs), times))[1]
    return np.concatenate([start[None], rest])


def test_the_plan_is_the_flight_from_the_launch(environment, planned):
    """Flown without feedback, its inputs lead along its states and to the hand-over."""
    M = planned.launch
    assert M == 16
    situation, _ = environment.reset(jax.random.key(0))
    state = situation.flying.state
    held = environment.plant.inputs[jnp.array(environment.chosen)]
    start = controlled_state(state, held, environment.chosen)
    np.testing.assert_allclose(planned.linear.states[0], start, atol=1e-12)
    states = flown(environment, np.asarray(start), planned.told[:M])
    np.testing.assert_allclose(states[:M], planned.linear.states[:M], atol=1e-9)
    reached = planned.linear.states[M] + planned.jump
    np.testing.assert_allclose(states[M], reached, atol=1e-9)


def test_after_the_plan_the_glide_has_turned_as_if_from_the_launch(planned):
    """Rows repeat after the plan; cycles are counted from the launch, as its goal counted."""
    places = [tuple(map(int, planned.place(sample))) for sample in (0, 15, 16, 23, 24)]
    assert places == [(0, 0), (15, 0), (16, 2), (23, 2), (16, 3)]


def test_no_other_inputs_are_cheaper(environment, planned, asked):
    start, wanted = asked
    told = np.asarray(planned.told[: planned.launch])
    least = wanted.cost(flown(environment, start, told), told)
    rng = np.random.default_rng(0)
    for size in (1e-2, 1e-1):
        for _ in range(6):
            change = size * rng.normal(size=told.shape)
            other = np.clip(told + change, wanted.low, wanted.high)
            assert wanted.cost(flown(environment, start, other), other) > least
    alone = wanted.inputs
    assert least < 0.7 * wanted.cost(flown(environment, start, alone), alone)


def test_limits_hold_and_bind(environment, planned, asked):
    """Narrower limits are met exactly, and cost more."""
    start, wanted = asked
    told = np.asarray(planned.told[: planned.launch])
    assert (told >= wanted.low).all()
    assert (told <= wanted.high).all()
    half = 0.3 * np.abs(told - wanted.inputs).max(axis=0)
    held = wanted.inputs[0]
    narrow = wanted._replace(low=held - half, high=held + half)
    guess = wanted.states, wanted.inputs
    plan = plan_launch(start, environment.plant, environment.chosen, narrow, guess)
    assert plan.gap < 1e-9
    assert (np.abs(plan.inputs - narrow.inputs) <= half).all()
    assert np.isclose(np.abs(plan.inputs - narrow.inputs), half).any()
    free = wanted.cost(flown(environment, start, told), told)
    np.testing.assert_allclose(narrow.cost(plan.states, plan.inputs), plan.cost, rtol=1e-9)
    assert plan.cost > free
    assert plan.iterations < 25
    rng = np.random.default_rng(1)
    for _ in range(12):  # nothing within the limits is cheaper
        change = 0.1 * half * rng.normal(size=told.shape)
        other = np.clip(plan.inputs + change, narrow.low, narrow.high)
        assert narrow.cost(flown(environment, start, other), other) > plan.cost


@pytest.mark.slow
def test_a_launch_the_glides_feedback_loses_is_flown_by_plan():
    """From 75 m; with attitude and rates alone, noise and delay, as well."""
    inputs = "d_psi", "d_theta", "psi_m"
    gait = {"theta_m": 108, "nu_theta": 1.1, "d_psi": 0}
    seeing = environment_of(inputs, **gait)
    glide = steady_glide(seeing.held, phase=float(seeing.plant.flight.phase))
    alone = controlled_flight(seeing, Constant(seeing.plant.inputs), jax.random.key(0), 100)
    assert not alone.landed
    for cycles, landed in ((0, False), (4, True)):
        policy = linear_quadratic(seeing, glide, launch=cycles)
        assert bool(controlled_flight(seeing, policy, jax.random.key(0), 100).landed) == landed
    senses = Senses(angle_noise=np.deg2rad(2), omega_noise=0.2, delay=0.05)
    sensing = environment_of(inputs, senses, **gait)
    policy = linear_quadratic(sensing, glide, launch=4)
    keys = jax.random.split(jax.random.key(1), 8)
    many = jax.vmap(lambda key: controlled_flight(sensing, policy, key, 100))(keys)
    assert np.asarray(many.landed).sum() >= 7


def test_gains_that_cannot_be_computed_are_told(environment, asked):
    """Where the cost decides nothing no step can be taken, and no feedback holds."""
    start, wanted = asked
    free = wanted._replace(Q=0 * wanted.Q, R=0 * wanted.R, P=0 * wanted.P)
    guess = wanted.states, wanted.inputs
    chosen = environment.chosen
    with pytest.raises(ValueError, match="over 16 samples: an error on it grows beyond"):
        plan_launch(start, environment.plant, chosen, free, guess)


def test_bad_input(environment, glide):
    with pytest.raises(ValueError, match="launch = 21"):
        linear_quadratic(environment, glide, launch=21)
