"""Circulation that lags: nothing lags in steady flow, and the rest is the indicial function."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Flow, LaggingCirculation, Polar, SweepTheory

POLAR = Polar.smooth()
N = 5
CHORD = np.linspace(0.03, 0.05, N)
SPEED = 8.0


def flow(angle, speed=SPEED):
    """Elements across the air at an angle of attack each [rad], (n,)."""
    angle = jnp.broadcast_to(jnp.asarray(angle, float), (N,))
    velocity = speed * jnp.stack([jnp.cos(angle), 0 * angle, -jnp.sin(angle)])
    axes = (jnp.tile(jnp.eye(3)[k][:, None], N) for k in (1, 0, 2))
    return Flow(
        velocity,
        jnp.zeros((3, N)),
        *axes,
        jnp.asarray(CHORD),
        jnp.asarray(0.01 * CHORD),
        jnp.asarray(1.165),
        jnp.asarray(1.568e-5),
    )


ANGLES = np.deg2rad([5, 17, 32, 48, 130])
STEADY = flow(ANGLES)


def test_nothing_lags_in_steady_flow():
    model = LaggingCirculation(POLAR)
    states = model.start(STEADY)
    assert states.shape == (N,)
    found, rates = model(STEADY, states)
    expected, none = SweepTheory(POLAR)(STEADY, jnp.zeros(0))
    assert none.shape == (0,)
    for name, value in vars(expected).items():
        np.testing.assert_allclose(getattr(found, name), value, rtol=1e-14, atol=1e-17)
    np.testing.assert_allclose(rates, 0, atol=1e-12)
    assert np.abs(found.force).max() > 1e-3


def test_without_a_share_it_is_sweep_theory_whatever_the_states():
    found, _ = LaggingCirculation(POLAR, share=0.0)(STEADY, jnp.linspace(-9.0, 9.0, N))
    expected, _ = SweepTheory(POLAR)(STEADY, jnp.zeros(0))
    np.testing.assert_allclose(found.force, expected.force, rtol=1e-14, atol=1e-17)


@eqx.filter_jit
def forces(model, flow_at, times):
    """Lift over times, (T, n), with the states that the model's rates lead to."""

    def rates(time, states, _):
        return model(flow_at(time), states)[1]

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        diffrax.Dopri8(),
        0.0,
        times[-1],
        1e-5,
        model.start(flow_at(0.0)),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(1e-10, 1e-12),
        max_steps=20_000,
    )
    return jax.vmap(lambda t, y: model(flow_at(t), y)[0].lift)(times, solution.ys)


@pytest.mark.parametrize(("lag", "share"), [(6.8, 0.5), (2.0, 0.9)])
def test_a_step_is_answered_by_the_indicial_function(lag, share):
    """1 - share exp(-s/lag), by the half chords travelled since."""
    model = LaggingCirculation(POLAR, lag, share)
    before, after = flow(ANGLES), flow(ANGLES + np.deg2rad(8))
    times = jnp.linspace(0.0, 0.05, 12)

    @eqx.filter_jit
    def stepped():
        def rates(time, states, _):
            return model(after, states)[1]

        states = diffrax.diffeqsolve(
            diffrax.ODETerm(rates),
            diffrax.Dopri8(),
            0.0,
            0.05,
            1e-4,
            model.start(before),
            saveat=diffrax.SaveAt(ts=times),
            stepsize_controller=diffrax.PIDController(1e-11, 1e-13),
        ).ys
        return jax.vmap(lambda y: model(after, y)[0].lift_coefficient)(states)

    old, new = (
        SweepTheory(POLAR)(now, jnp.zeros(0))[0].lift_coefficient for now in (before, after)
    )
    s = 2 * SPEED * np.asarray(times)[:, None] / CHORD
    indicial = 1 - share * np.exp(-s / lag)
    np.testing.assert_allclose(stepped(), old + (new - old) * indicial, rtol=0, atol=1e-9)
    assert np.abs(new - old).max() > 0.1


def test_the_defaults_come_within_their_bound_of_wagners_function():
    s = np.linspace(0, 200, 20_001)
    jones = 1 - 0.165 * np.exp(-0.0455 * s) - 0.335 * np.exp(-0.3 * s)
    model = LaggingCirculation(POLAR)
    indicial = 1 - float(model.share) * np.exp(-s / float(model.lag))
    assert 0.041 < np.abs(indicial - jones).max() < 0.042


def test_for_a_lag_that_goes_to_zero_it_goes_to_sweep_theory():
    """In flow that changes all the time; the error is in proportion to the lag."""

    def changing(time):
        return flow(ANGLES[:1] + 0.3 * jnp.sin(30 * time))

    times = jnp.linspace(0.1, 0.2, 9)
    exact = jax.vmap(lambda t: SweepTheory(POLAR)(changing(t), jnp.zeros(0))[0].lift)(times)
    errors = np.array(
        [
            np.abs(forces(LaggingCirculation(POLAR, lag), changing, times) - exact).max()
            for lag in (0.4, 0.2, 0.1)
        ]
    )
    np.testing.assert_allclose(errors[:-1] / errors[1:], 2, rtol=0, atol=0.1)
    assert errors[0] < 0.1 * np.abs(exact).max()


def test_air_at_rest_makes_no_force_and_moves_no_state():
    model = LaggingCirculation(POLAR)
    still = flow(ANGLES, speed=0.0)
    found, rates = model(still, jnp.ones(N))
    assert not np.any(found.force)
    np.testing.assert_allclose(rates, 0, atol=1e-12)
    slopes = jax.jacfwd(lambda v: model(still._replace(velocity=v), jnp.ones(N))[0].force)(
        still.velocity
    )
    assert np.isfinite(slopes).all()
