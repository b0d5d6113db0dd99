"""`integrate`: flights in pieces, from any state, with every kind of own state in it."""

import sys

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Actuated,
    Driven,
    Gait,
    Glider,
    Ground,
    LaggingCirculation,
    Launch,
    Planned,
    Polar,
    Programme,
    Serpenoid,
    TabulatedBody,
    UniformWind,
    integrate,
    simulate,
    six_degrees_of_freedom,
)
from jaxglide.body.sections import discretise
from jaxglide.flight.dynamics import OMEGA, Flight

GAIT = Gait.from_degrees()
OTHER = Gait.from_degrees(105, 28, 1.25, 1.5, 5, 20)
NAMES = (
    "wind",
    "lag",
    "share",
    "natural_frequency",
    "damping",
    "point_position",
    "point_mass",
    "bend",
    "omega",
    "ground",
)
AT = np.array([-1.0, 5.0, 0.6, 25.0, 0.7, 0.21, 0.01, 0.1, 1.5, 0.05])
SCALE = np.array([1.0, 1.0, 0.1, 5.0, 0.1, 0.05, 0.01, 0.1, 1.0, 0.05])


def build(p):
    """A robot with actuators and lagging air, in wind: every new part, and a number in each."""
    wind, lag, share, frequency, damping, place, weight, bend, omega, ground = p
    body = TabulatedBody(
        [0.0, 0.3, 0.7],
        [0.03, 0.05, 0.02],
        [0.03, 0.06, 0.04],
        jnp.stack([jnp.asarray(place), jnp.asarray(0.5)]),
        jnp.stack([jnp.asarray(weight), jnp.asarray(0.02)]),
        neck_fraction=0.08,
        nodes=24,
        node_set="gauss",
    )
    programme = Programme((0.0, 0.1, 0.3), [GAIT, OTHER, GAIT])
    bent = programme.inputs.at[1, 3].set(bend)
    programme = eqx.tree_at(lambda x: x.inputs, programme, bent)
    limits = {"rate_limit": 50 * np.ones(6), "low": -4 * np.ones(6), "high": 4 * np.ones(6)}
    drive = Actuated(Planned(programme), GAIT, frequency, damping, **limits)
    glider = Glider(
        body,
        Driven(Serpenoid(), drive),
        LaggingCirculation(Polar.smooth(), lag, share),
        UniformWind(jnp.stack([jnp.asarray(0.5), jnp.asarray(wind), jnp.asarray(0.0)])),
    )
    launch = Launch(0.4, 4.0, omega=jnp.stack([jnp.asarray(omega), 0.0 * omega, 0.3 * omega]))
    return glider, launch, Ground(ground)


def glide(p, **options):
    glider, launch, ground = build(p)
    return simulate(glider, launch, ends=ground, **{"step": 0.01, "max_time": 0.6, **options})


def outputs(p):
    """End time, where, and turning there."""
    found = glide(p)
    return jnp.concatenate([found.time[None], found.landing_point[:2], found.state[OMEGA]])


@pytest.fixture(scope="module")
def flown():
    return glide(AT)


def onwards(flown, state, t0, t1, **options):
    return integrate(
        flown.glider, state, t0, t1, phase=flown.phase, **{"step": 0.01, **options}
    )


def test_own_states_stand_behind_the_rigid_body(flown):
    """Positions and rates of six actuators, their turns, and a circulation at every node."""
    assert flown.take_off.state.shape == (13 + 13 + 26,)
    assert flown.ending == "landed"
    assert 0.15 < float(flown.time) < 0.4
    # the actuators have moved, and air and body have answered
    moved = np.abs(np.asarray(flown.state - flown.take_off.state))
    assert (moved[13:26] > 1e-6).sum() > 8
    assert (moved[26:50] > 1e-4).all()


def test_a_launch_may_turn(flown):
    np.testing.assert_allclose(flown.take_off.state[OMEGA], [1.5, 0, 0.45], rtol=1e-15)


def test_two_pieces_are_one_flight(flown):
    """From a rotating launch, with fixed steps to round-off: own states are carried on."""
    start = flown.take_off.state
    whole = onwards(flown, start, 0.0, 0.14)
    first = onwards(flown, start, 0.0, 0.06)
    second = onwards(flown, first.state, 0.06, 0.14)
    scale = np.abs(np.asarray(whole.state)).max()
    np.testing.assert_allclose(second.state, whole.state, rtol=0, atol=1e-12 * scale)
    assert float(second.start_time) == 0.06
    assert second.ending == "ran out of time"
    # where they start anew instead, the flight is another
    anew = onwards(flown, first.state[:13], 0.06, 0.14)
    assert np.abs(np.asarray(anew.state - whole.state))[:13].max() > 1e-4


def test_two_pieces_with_adaptive_steps_agree_to_their_tolerance(flown):
    start, tight = flown.take_off.state, {"step": None, "rtol": 1e-9, "atol": 1e-9}
    whole = onwards(flown, start, 0.0, 0.14, **tight)
    first = onwards(flown, start, 0.0, 0.061, **tight)
    second = onwards(flown, first.state, 0.061, 0.14, **tight)
    np.testing.assert_allclose(second.state, whole.state, rtol=0, atol=1e-6)


def test_simulate_is_integrate_from_its_take_off(flown):
    found = onwards(
        flown, flown.take_off.state, 0.0, 0.6, ends=flown.settings.ends, save=[0.0, 0.05, 0.5]
    )
    np.testing.assert_array_equal(found.state, flown.state)
    assert float(found.time) == float(flown.time)
    np.testing.assert_array_equal(found.states[0], flown.take_off.state)
    assert np.isnan(found.states[2]).all()


@pytest.mark.slow
def test_the_end_moves_by_the_vector_field_with_the_last_time(flown):
    start = flown.take_off.state

    @jax.jit
    def end(t1):
        return onwards(flown, start, 0.0, t1, step=None, rtol=1e-7, atol=1e-7).state

    t1 = jnp.asarray(0.1)
    state, slope = jax.jvp(end, (t1,), (jnp.ones(()),))
    flight = Flight(flown.glider, discretise(flown.glider.body), flown.phase)
    expected = np.asarray(six_degrees_of_freedom(t1, state, flight))
    np.testing.assert_allclose(slope, expected, rtol=0, atol=1e-4 * np.abs(expected).max())


# Derivatives through one of each new part


@pytest.fixture(scope="module")
def forward():
    """Jacobian at two points: jit of vmap of jacfwd."""
    points = np.stack([AT, AT + 0.1 * SCALE])
    return points, np.asarray(jax.jit(jax.vmap(jax.jacfwd(outputs)))(points))


def test_rates_have_derivatives_by_every_new_number(flown):
    """Of the vector field, forward and reverse, under jit and vmap, against differences."""
    phase, state = flown.phase, flown.state

    def rates(p):
        glider = build(p)[0]
        return six_degrees_of_freedom(
            0.12, state, Flight(glider, discretise(glider.body), phase)
        )

    values = jax.jit(jax.vmap(rates))
    forward = jax.jit(jax.vmap(jax.jacfwd(rates)))(AT[None])[0]
    reverse = jax.jit(jax.vmap(jax.jacrev(rates)))(AT[None])[0]
    shifts = 1e-5 * np.diag(SCALE)
    difference = (values(AT + shifts) - values(AT - shifts)).T / 2e-5
    size = np.abs(difference).max(axis=0)
    used = np.array([name not in ("omega", "ground") for name in NAMES])  # by the field
    assert (size[used] > 1e-3).all()
    assert not size[~used].any()
    for found in (forward, reverse):
        error = np.abs(np.asarray(found) * SCALE - difference) / np.where(size, size, 1.0)
        assert (error < 1e-6).all(), dict(zip(NAMES, error.max(axis=0), strict=True))


@pytest.mark.slow
def test_derivatives_agree_with_differences_of_fixed_step_solves(forward):
    points, jacobian = forward
    values = jax.jit(jax.vmap(outputs))
    step = 3e-4 * SCALE
    shifts = np.concatenate([step[:, None] * np.eye(len(AT)) * k for k in (1, -1, 2, -2)])
    for point, found in zip(points, jacobian, strict=True):
        near, back, far, away = np.split(np.asarray(values(point + shifts)), 4)
        difference = ((8 * (near - back) - (far - away)) / (12 * step[:, None])).T
        largest = (np.abs(found) * SCALE).max(axis=1, keepdims=True)
        error = np.abs(found - difference) * SCALE / largest
        assert (error < 1e-6).all(), dict(zip(NAMES, error.max(axis=0), strict=True))
        # every number matters
        assert ((np.abs(found) * SCALE / largest).max(axis=0) > 1e-5).all()


@pytest.mark.slow
def test_reverse_mode_is_forward_mode(forward):
    points, jacobian = forward
    reverse = jax.jit(jax.jacrev(outputs))(points[0])
    size = np.abs(jacobian[0] * SCALE).max(axis=1, keepdims=True)
    np.testing.assert_allclose(
        reverse * SCALE / size, jacobian[0] * SCALE / size, rtol=0, atol=1e-9
    )


@pytest.mark.slow
def test_the_checkpointed_adjoint_is_an_independent_derivative(forward):
    points, jacobian = forward

    def checkpointed(p):
        adjoint = diffrax.RecursiveCheckpointAdjoint()
        found = glide(p, adjoint=adjoint)
        return jnp.concatenate([found.time[None], found.landing_point[:2], found.state[OMEGA]])

    reverse = jax.jit(jax.jacrev(checkpointed))(points[0])
    size = np.abs(jacobian[0] * SCALE).max(axis=1, keepdims=True)
    np.testing.assert_allclose(
        reverse * SCALE / size, jacobian[0] * SCALE / size, rtol=0, atol=1e-6
    )


def test_other_values_trace_nothing_again(flown, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("traced again")

    monkeypatch.setattr(sys.modules["jaxglide.flight.glide"], "_fly_either_mode", refuse)
    monkeypatch.setattr(sys.modules["jaxglide.flight.integrate"], "_flown", refuse)
    other = glide(AT + 0.1 * SCALE)
    assert float(other.time) != float(flown.time)
    with pytest.raises(AssertionError, match="traced again"):
        glide(AT, max_steps=4097)
