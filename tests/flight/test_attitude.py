"""Euler angles, rotation matrix and angle rates (eq. 22)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide.flight.attitude import angle_rates, euler_angles, rotation_matrix

RNG = np.random.default_rng(0)


def elementary(yaw, pitch, roll):
    """C2(roll) C1(pitch) C3(yaw), factor by factor."""
    c, s = np.cos(pitch), np.sin(pitch)
    c1 = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    c, s = np.cos(roll), np.sin(roll)
    c2 = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    c, s = np.cos(yaw), np.sin(yaw)
    c3 = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    return c2 @ c1 @ c3


@pytest.fixture(scope="module")
def angles():
    """Yaw, pitch, roll (300, 3); pitch short of 90 degrees."""
    scale = [np.pi, np.pi / 2 - 1e-3, np.pi]
    return RNG.uniform(-1, 1, size=(300, 3)) * scale


def test_matrix_is_the_product_of_its_rotations(angles):
    matrices = jax.vmap(rotation_matrix)(angles)
    expected = np.stack([elementary(*a) for a in angles])
    np.testing.assert_allclose(matrices, expected, rtol=0, atol=1e-15)


def test_matrix_is_a_rotation(angles):
    matrices = np.asarray(jax.vmap(rotation_matrix)(3 * angles))
    products = matrices @ matrices.transpose(0, 2, 1)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=2e-15)
    np.testing.assert_allclose(np.linalg.det(matrices), 1.0, rtol=1e-14)


def test_round_trip(angles):
    back = jax.vmap(lambda a: euler_angles(rotation_matrix(a)))(angles)
    np.testing.assert_allclose(back, angles, rtol=0, atol=1e-12)


def test_signs_are_the_pilots():
    nose, right = np.array([0.0, 1, 0]), np.array([1.0, 0, 0])
    small = 0.1
    yaw, pitch, roll = (np.asarray(rotation_matrix(small * jnp.eye(3)[i])).T for i in range(3))
    assert (yaw @ nose)[0] == pytest.approx(-np.sin(small))  # nose left
    assert (pitch @ nose)[2] == pytest.approx(np.sin(small))  # nose up
    assert (roll @ right)[2] == pytest.approx(-np.sin(small))  # right flank down


def test_angle_rates_turn_the_matrix(angles):
    """dC/dt = -[omega]x C."""
    omega = 5 * RNG.normal(size=angles.shape)

    def both(angles, omega):
        rates = angle_rates(angles, omega)
        C, C_dot = jax.jvp(rotation_matrix, (angles,), (rates,))
        return C_dot, -jnp.cross(omega, C, axisb=0, axisc=0), rates

    C_dot, expected, rates = jax.vmap(both)(angles, omega)
    largest = np.abs(rates).max(axis=1)[:, None, None]
    assert (np.abs(C_dot - expected) / largest).max() < 1e-13


def test_gradient_of_the_angles_is_finite_when_pointing_straight_up():
    matrix = rotation_matrix(jnp.array([0.0, np.pi / 2, 0.0]))
    assert np.isfinite(jax.jacobian(euler_angles)(matrix)).all()
    exact = jnp.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert euler_angles(exact)[1] == pytest.approx(np.pi / 2, abs=1e-15)
    assert np.isfinite(jax.jacobian(euler_angles)(exact)).all()
