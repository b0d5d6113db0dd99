"""The fast sine, cosine and arctangent, and the other helpers that replace a library's."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide._lib.numerics import arctan2, cross, once, safe_sqrt, sincos, solve3

EPS32 = float(np.finfo(np.float32).eps)


@pytest.fixture(scope="module")
def angles():
    """A dense grid over several turns, random angles up to 1e5, and every octant's edge."""
    rng = np.random.default_rng(1)
    edges = np.arange(-64, 65) * np.pi / 4
    return np.concatenate(
        [
            np.linspace(-20, 20, 100_001),
            rng.uniform(-1e5, 1e5, 100_000),
            rng.normal(size=10_000) * 10.0 ** rng.uniform(-300, 5, 10_000).clip(-300, 4),
            edges,
            np.nextafter(edges, np.inf),
            np.nextafter(edges, -np.inf),
            [0.0, -0.0, 1e-300, -1e-300, 1e5, -1e5],
        ]
    )


@pytest.fixture(scope="module")
def points():
    """y, x in all quadrants, on the axes and diagonals, at sizes 1e-100 to 1e100."""
    rng = np.random.default_rng(2)
    angle = np.concatenate(
        [np.linspace(-np.pi, np.pi, 50_001), np.arange(-16, 17) * np.pi / 16]
    )
    size = 10.0 ** rng.uniform(-100, 100, angle.size)
    axis = np.array([-2.0, 0.0, 3.0])
    y, x = (a.ravel() for a in np.meshgrid(axis, axis))
    scattered = rng.normal(size=(2, 100_000))
    return (
        np.concatenate([np.sin(angle) * size, y, scattered[0]]),
        np.concatenate([np.cos(angle) * size, x, scattered[1]]),
    )


def test_sine_and_cosine_match_numpy(angles):
    sine, cosine = jax.jit(sincos)(angles)
    assert np.abs(sine - np.sin(angles)).max() < 1e-15
    assert np.abs(cosine - np.cos(angles)).max() < 1e-15


def test_sine_of_a_small_angle_keeps_its_relative_precision():
    small = 10.0 ** np.linspace(-300, -1, 500)
    assert np.abs(sincos(jnp.asarray(small))[0] / np.sin(small) - 1).max() < 1e-15


def test_arctan2_matches_numpy(points):
    y, x = points
    assert np.abs(jax.jit(arctan2)(y, x) - np.arctan2(y, x)).max() < 1e-15


@pytest.mark.parametrize(
    ("y", "x", "angle"),
    [
        (0.0, 0.0, 0.0),
        (-0.0, 0.0, 0.0),
        (0.0, -0.0, 0.0),
        (0.0, 2.0, 0.0),
        (0.0, -2.0, np.pi),
        (-0.0, -2.0, np.pi),
        (2.0, 0.0, np.pi / 2),
        (-2.0, 0.0, -np.pi / 2),
        (1.0, 1.0, np.pi / 4),
        (1.0, -1.0, 3 * np.pi / 4),
        (-1.0, -1.0, -3 * np.pi / 4),
        (-1.0, 1.0, -np.pi / 4),
        (-1e-300, -1.0, -np.pi),
    ],
)
def test_arctan2_on_axes_and_diagonals(y, x, angle):
    assert float(arctan2(jnp.asarray(y), jnp.asarray(x))) == pytest.approx(angle, abs=1e-15)


def test_nan_is_not_hidden():
    nan = jnp.asarray(np.nan)
    assert np.isnan(np.stack(sincos(nan))).all()
    assert np.isnan(arctan2(nan, 1.0 + 0 * nan))
    assert np.isnan(arctan2(jnp.asarray(1.0), nan))


def test_derivatives_of_sine_and_cosine():
    x = jnp.linspace(-30, 30, 4001)
    one = jnp.ones_like(x)
    _, (ds, dc) = jax.jvp(sincos, (x,), (2 * one,))
    np.testing.assert_allclose(ds, 2 * np.cos(x), rtol=0, atol=1e-14)
    np.testing.assert_allclose(dc, -2 * np.sin(x), rtol=0, atol=1e-14)

    def weighted(x):
        sine, cosine = sincos(x)
        return 3 * sine + 5 * cosine

    first = jax.vmap(jax.grad(weighted))
    second = jax.vmap(jax.grad(jax.grad(weighted)))
    np.testing.assert_allclose(first(x), 3 * np.cos(x) - 5 * np.sin(x), rtol=0, atol=1e-14)
    np.testing.assert_allclose(second(x), -3 * np.sin(x) - 5 * np.cos(x), rtol=0, atol=1e-14)


def test_derivatives_of_arctan2():
    rng = np.random.default_rng(3)
    y, x = rng.normal(size=(2, 500))
    square = x**2 + y**2
    gradient = jax.vmap(jax.grad(arctan2, argnums=(0, 1)))(y, x)
    np.testing.assert_allclose(gradient, [x / square, -y / square], rtol=1e-13)
    hessian = jax.vmap(jax.hessian(arctan2, argnums=(0, 1)))(y, x)
    expected = np.array([[-2 * x * y, y**2 - x**2], [y**2 - x**2, 2 * x * y]]) / square**2
    np.testing.assert_allclose(hessian, expected, rtol=1e-11, atol=1e-12)


def test_gradients_are_finite_and_zero_at_the_origin():
    assert jax.grad(arctan2, argnums=(0, 1))(0.0, 0.0) == (0.0, 0.0)
    assert jax.grad(safe_sqrt)(0.0) == 0.0
    assert jax.grad(jax.grad(safe_sqrt))(0.0) == 0.0
    # One element at the origin must not spoil its neighbours.
    y, x = jnp.array([0.0, 3.0]), jnp.array([0.0, 4.0])
    gradient = jax.grad(lambda y: jnp.sum(arctan2(y, x)))(y)
    np.testing.assert_allclose(gradient, [0.0, 4 / 25], rtol=1e-14)


def test_safe_sqrt_is_the_square_root_above_zero():
    x = jnp.array([1e-300, 1e-20, 0.25, 2.0, 1e200])
    np.testing.assert_allclose(safe_sqrt(x), np.sqrt(x), rtol=1e-15)
    np.testing.assert_allclose(jax.vmap(jax.grad(safe_sqrt))(x), 0.5 / np.sqrt(x), rtol=1e-14)
    assert safe_sqrt(jnp.asarray(0.0)) == 0.0


def test_once_is_the_identity_and_kept_with_its_tangents():
    """A division by what the tangents share would become a product, which is not kept."""
    x, direction = np.random.default_rng(6).normal(size=(2, 3, 5))
    slopes = jax.jit(jax.vmap(lambda d: jax.jvp(once, (x,), (d,))[1]))
    several = np.stack([direction, 2 * direction])
    np.testing.assert_array_equal(jax.jit(once)(x), x)
    np.testing.assert_array_equal(slopes(several), several)
    np.testing.assert_array_equal(
        jax.grad(lambda x: jnp.vdot(once(x), direction))(x), direction
    )
    square = jax.grad(jax.grad(lambda x: once(once(x) ** 3)))
    np.testing.assert_allclose(jax.vmap(square)(x.ravel()), 6 * x.ravel(), rtol=1e-15)
    assert re.search(r"f64\[2,3,5\]\S* divide\(", slopes.lower(several).compile().as_text())


def test_cross_product_matches_numpy():
    a, b = np.random.default_rng(4).normal(size=(2, 3, 40))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b, axis=0), rtol=0, atol=1e-14)


def test_solve3_matches_numpy():
    rng = np.random.default_rng(5)
    matrices, b = rng.normal(size=(200, 3, 3)), rng.normal(size=(200, 3))
    x = np.linalg.solve(matrices, b[..., None])[..., 0]
    condition = np.linalg.cond(matrices)
    error = np.abs(jax.vmap(solve3)(matrices, b) - x).max(axis=1) / np.abs(x).max(axis=1)
    assert (error < 1e-14 * condition).all()
    # and at the size of a snake's inertia tensor [kg m^2]
    tensor = 1e-5 * np.array([[9.0, -2.4, 0.8], [-2.4, 17.9, 2.8], [0.8, 2.8, 24.5]])
    np.testing.assert_allclose(tensor @ solve3(jnp.asarray(tensor), b[0]), b[0], rtol=1e-13)


def test_float32_is_accurate_to_float32():
    x = np.linspace(-700, 700, 200_001).astype(np.float32)
    sine, cosine = sincos(jnp.asarray(x))
    assert sine.dtype == cosine.dtype == jnp.float32
    assert np.abs(sine - np.sin(x.astype(float))).max() < 1.5 * EPS32
    assert np.abs(cosine - np.cos(x.astype(float))).max() < 1.5 * EPS32
    y, x = np.random.default_rng(6).normal(size=(2, 100_000)).astype(np.float32)
    with jax.enable_x64(False):
        angle = arctan2(jnp.asarray(y), jnp.asarray(x))
    assert np.abs(angle - np.arctan2(y.astype(float), x.astype(float))).max() < 3 * EPS32


def test_float32_stays_float32_beside_float64():
    ones = jnp.ones(3, jnp.float32)
    assert arctan2(ones, ones).dtype == jnp.float32
    assert safe_sqrt(ones).dtype == jnp.float32
    assert solve3(jnp.eye(3, dtype=jnp.float32), ones).dtype == jnp.float32
