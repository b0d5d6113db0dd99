"""The averaged model: its equilibrium, its multipliers, and where it meets the full one."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxglide as jg
from jaxglide.body import discretise
from jaxglide.flight.dynamics import Flight
from jaxglide.steady.reduced import rates

BODY = jg.Snake.from_svl(0.70, nodes=30, node_set="gauss")


def glider(**changes):
    gait = {"theta_m": 60, "psi_m": 0.0, "nu_theta": 1.738, "f_theta": 1.3, "d_psi": 5.5}
    return jg.Glider(BODY, jg.Gait.from_degrees(**gait | changes), jg.Polar.band_limited())


@pytest.fixture(scope="module")
def glide():
    return jg.averaged_glide(glider())


def mean_rates(glider, count=64):
    """Of the reduced state in SI units, phase by phase."""
    sections = discretise(glider.body)
    phases = 2 * np.pi * np.arange(count) / count

    def mean(state):
        def at(phase):
            return rates(jnp.zeros(()), state, Flight(glider, sections, phase))

        return jnp.mean(jax.vmap(at)(jnp.asarray(phases)), axis=0)

    return mean


def test_the_mean_of_the_rates_vanishes_there(glide):
    assert bool(glide.found)
    assert glide.averaged
    assert float(glide.residual) < 1e-12
    assert int(glide.iterations) > 2
    assert np.abs(mean_rates(glider())(glide.state)).max() < 1e-11
    assert str(glide).startswith("Steady glide, averaged, ")


def test_its_multipliers_are_those_of_the_mean_rates(glide):
    slopes = jax.jacfwd(mean_rates(glider()))(glide.state)
    expected = np.exp(np.linalg.eigvals(slopes) / 1.3)
    expected = expected[np.argsort(-np.abs(expected))]
    np.testing.assert_allclose(np.abs(glide.multipliers), np.abs(expected), rtol=1e-9)
    assert float(glide.period) == pytest.approx(1 / 1.3)
    assert len(glide.modes) < 8  # pairs


def test_its_path_is_what_its_state_says(glide):
    right, forward, up = np.asarray(glide.state[:3])
    assert float(glide.speed) == pytest.approx(np.sqrt(right**2 + forward**2 + up**2))
    slope = np.arctan2(-up, np.hypot(right, forward))
    assert float(glide.glide_angle) == pytest.approx(slope)
    assert float(glide.sink_rate) == pytest.approx(-up)
    np.testing.assert_allclose(
        glide.states[-1, :3], glide.state[:3] / 1.3, rtol=1e-9, atol=1e-9
    )


@pytest.mark.slow
def test_with_a_lateral_bias_it_is_a_helix():
    """Whose path, summed up step by step, is that of its states."""
    turning = jg.averaged_glide(glider(d_theta=8.0))
    assert bool(turning.found)
    assert abs(float(turning.turn_rate)) > 0.01
    states, t = np.asarray(turning.states), np.asarray(turning.times)
    middle = (states[1:, 3:6] + states[:-1, 3:6]) / 2
    summed = np.cumsum(middle * np.diff(t)[:, None], axis=0)
    np.testing.assert_allclose(states[1:, :3], summed, atol=1e-4)
    np.testing.assert_allclose(states[:, 9], float(turning.turn_rate) * t, atol=1e-12)
    opposite = jg.averaged_glide(glider(d_theta=-8.0))
    assert float(opposite.turn_rate) == pytest.approx(-float(turning.turn_rate), rel=1e-6)


@pytest.mark.slow
def test_it_has_derivatives(glide):
    def angle(d_psi):
        gait = dataclasses.replace(glider().gait, d_psi=d_psi)
        changed = dataclasses.replace(glider(), gait=gait)
        found = jg.averaged_glide(changed, glide.state)
        return jnp.stack([found.glide_angle, found.spectral_radius])

    at, step = glider().gait.d_psi, 1e-6
    slopes = jax.jacfwd(angle)(at)
    expected = (angle(at + step) - angle(at - step)) / (2 * step)
    np.testing.assert_allclose(slopes, expected, rtol=1e-5)


def test_how_sure_it_is_nobody_asks(glide):
    with pytest.raises(ValueError, match="of the full model's glide alone"):
        _ = glide.uncertainty
    with pytest.raises(ValueError, match="of the full model's glide alone"):
        _ = glide.discretisation


def test_what_cannot_be_averaged_is_named():
    with pytest.raises(ValueError, match="f_theta = 0 Hz is not allowed"):
        jg.averaged_glide(glider(f_theta=0.0))
    with pytest.raises(ValueError, match=r"guess has shape \(2,\)"):
        jg.averaged_glide(glider(), [1.0, 2.0])


@pytest.mark.slow
def test_inertia_swings_the_body_as_far_at_every_frequency(glide):
    """Which is why the averaged glide stays apart from the full one; velocities settle."""
    yaw, velocity, off = [], [], []
    state = [0.09, 8.94, -3.80, 0.017, 0.932, -0.780, -0.0863, -0.0789]
    for f in (1.3, 1.6, 2.2, 3.0, 4.0):
        full = jg.steady_glide(glider(f_theta=f), state)
        assert bool(full.found)
        state = full.state
        swing = np.ptp(np.asarray(full.states), axis=0)
        yaw.append(np.rad2deg(swing[9]))
        velocity.append(np.linalg.norm(swing[3:6]))
        mean = jg.averaged_glide(glider(f_theta=f), glide.state)
        off.append(np.rad2deg(abs(float(full.glide_angle - mean.glide_angle))))
    np.testing.assert_allclose(yaw, 11.2, atol=0.5)
    assert velocity[-1] < 0.2 * velocity[0]
    assert min(off) > 1
