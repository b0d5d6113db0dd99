"""The waves of bending: definition, time derivatives, neck."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Gait, shape_line
from jaxglide.shape.gait import waves
from jaxglide.shape.motion import Bending

NECK = 0.075
GAITS = [
    Gait.from_degrees(),
    Gait.from_degrees(theta_m=115, psi_m=45, nu_theta=1.13, f_theta=1.7, d_psi=-20, d_theta=35),
]


def at(gait, fraction, time, phi=0.3):
    rate = -2 * jnp.pi * gait.f_theta
    return waves(gait, NECK, fraction, phi + rate * time, rate)


@pytest.mark.parametrize("gait", GAITS)
def test_waves_are_the_papers(gait):
    """Equations 2-3, 6-7, with the vertical wave at twice everything."""
    x, t, phi = np.linspace(NECK, 1, 97), 0.37, 0.3
    wave = at(gait, x, t, phi)
    nu, f = float(gait.nu_theta), float(gait.f_theta)
    a = 2 * np.pi * nu * x - 2 * np.pi * f * t + phi
    theta = float(gait.theta_m) * np.sin(np.pi / 2 * np.cos(a)) + float(gait.d_theta) * x
    a_psi = 2 * np.pi * (2 * nu) * x - 2 * np.pi * (2 * f) * t + 2 * (phi - np.pi / 2)
    psi = float(gait.psi_m) * np.cos(a_psi) + float(gait.d_psi) * x
    np.testing.assert_allclose(wave.theta, theta, rtol=0, atol=1e-13)
    np.testing.assert_allclose(wave.psi, psi, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.cos(a_psi), np.cos(2 * a - np.pi), atol=1e-13)


@pytest.mark.parametrize("gait", GAITS)
def test_rates_are_the_time_derivatives(gait):
    x = np.linspace(0, 1, 41)

    def angles(t):
        wave = at(gait, x, t)
        return jnp.stack([wave.theta, wave.psi])

    def rates(t):
        return jax.jvp(angles, (t,), (1.0,))[1]

    @jax.jit
    def everything(t):
        return angles(t), *jax.jvp(rates, (t,), (1.0,)), at(gait, x, t)

    for t in (0.0, 0.21, 1.9):
        value, first, second, wave = everything(t)
        np.testing.assert_allclose([wave.theta, wave.psi], value, rtol=0, atol=1e-14)
        np.testing.assert_allclose([wave.theta_dot, wave.psi_dot], first, rtol=0, atol=1e-12)
        np.testing.assert_allclose([wave.theta_ddot, wave.psi_ddot], second, rtol=0, atol=1e-10)
        assert np.abs(second).min(axis=1).max() < np.abs(second).max()


@pytest.mark.parametrize("gait", GAITS)
def test_neck_ramps_linearly_from_the_snout(gait):
    """Equations 9-12, for the full angles with their biases, and their rates."""
    end = at(gait, np.array([NECK]), 0.4)
    x = np.linspace(0, NECK, 11)
    wave = at(gait, x, 0.4)
    for name in Bending._fields:
        expected = x / NECK * np.asarray(getattr(end, name))
        np.testing.assert_allclose(getattr(wave, name), expected, rtol=0, atol=1e-12)
    assert np.abs(end.theta).min() > 0.01


def test_angles_are_continuous_at_the_end_of_the_neck():
    around = NECK + np.array([-1e-9, 0, 1e-9])
    for row in at(GAITS[1], around, 0.1):
        assert np.ptp(row) < 1e-8 * (1 + 20 * np.abs(row).max())
        assert np.abs(row).min() > 0


def test_lateral_bias_turns_the_horizontal_wave_only():
    x = np.linspace(NECK, 1, 21)
    straight = at(Gait.from_degrees(), x, 0.2)
    turning = at(Gait.from_degrees(d_theta=25), x, 0.2)
    np.testing.assert_allclose(
        turning.theta - straight.theta, np.deg2rad(25) * x, rtol=0, atol=1e-14
    )
    for name in set(Bending._fields) - {"theta"}:
        np.testing.assert_array_equal(getattr(turning, name), getattr(straight, name))


def test_degrees_and_the_published_line():
    gait = Gait.from_degrees(nu_theta=1.25)
    assert float(gait.theta_m) == pytest.approx(np.deg2rad(104.977605), abs=1e-12)
    assert shape_line(1.4) == pytest.approx(96.48753)
    assert float(gait.psi_m) == pytest.approx(np.deg2rad(20), abs=1e-15)
    assert float(gait.d_psi) == pytest.approx(np.deg2rad(10), abs=1e-15)
    assert (float(gait.f_theta), float(gait.d_theta)) == (1.2, 0.0)
