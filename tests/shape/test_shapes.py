"""Shapes whose every coordinate moves: the closed form, and any function instead of it."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Coordinates, Driven, Gait, Running, Serpenoid, Snake, Waveform, discretise
from jaxglide.shape import backbone
from jaxglide.shape.drives import inputs_of
from jaxglide.shape.motion import Bending, at_rest

SECTIONS = discretise(Snake.from_svl(nodes=24, node_set="gauss"))
GAIT = Gait.from_degrees(theta_m=100, psi_m=28, nu_theta=1.2, f_theta=1.4, d_psi=12, d_theta=15)


def serpenoid(x, q):
    """The paper's waves as anybody would write them down."""
    theta_m, psi_m, nu, d_psi, d_theta, phase = q
    a = 2 * jnp.pi * nu * x + phase
    return (
        theta_m * jnp.sin(jnp.pi / 2 * jnp.cos(a)) + d_theta * x,
        psi_m * jnp.cos(2 * a - jnp.pi) + d_psi * x,
    )


WRITTEN = Waveform(serpenoid, Serpenoid().coordinates)


def moving(seed):
    """Coordinates all of which move and accelerate."""
    rng = np.random.default_rng(seed)
    q = np.array([1.7, 0.4, 1.3, 0.2, 0.3, 0.5]) + 0.1 * rng.normal(size=6)
    return Coordinates(*map(jnp.asarray, (q, rng.normal(size=6), 5 * rng.normal(size=6))))


@jax.jit
def body_of(coordinates):
    """Position, velocity and acceleration of the closed form and of the function."""

    def body(shape):
        bending = shape.bending(SECTIONS.fraction, SECTIONS.neck_fraction, coordinates)
        found = backbone(SECTIONS, bending)
        return jnp.stack([found.position, found.velocity, found.acceleration])

    return jnp.stack([body(Serpenoid()), body(WRITTEN)])


@pytest.mark.parametrize("seed", range(3))
def test_one_function_is_as_good_as_the_closed_form(seed):
    closed, written = np.asarray(body_of(moving(seed)))
    for k, scale in enumerate((0.1, 0.1, 0.5)):
        assert np.abs(closed[k]).max() > scale
        np.testing.assert_allclose(written[k], closed[k], rtol=0, atol=1e-13 * 10**k)


def test_the_gradient_of_one_function_is_that_of_the_closed_form():
    by_q, by_rate, by_second = jax.jit(jax.jacfwd(body_of))(moving(3))
    for slope in (by_q, by_rate, by_second):
        closed, written = np.asarray(slope)
        size = np.abs(closed).max()
        assert size > 0.1
        np.testing.assert_allclose(written, closed, rtol=0, atol=1e-12 * size)
    # every coordinate, its rate and its acceleration move the body
    for slope in (by_q[0, 0], by_rate[0, 1], by_second[0, 2]):
        assert (np.abs(slope).max(axis=(0, 1)) > 1e-2).all()


def test_the_closed_form_is_the_derivative_along_the_path():
    """Positions differentiated twice along q + q' t + q'' t^2/2, by JAX; nothing else."""
    q, rate, second = moving(4)

    def position(t):
        now = Coordinates(q + rate * t + second * t**2 / 2, rate, second)
        bending = Serpenoid().bending(SECTIONS.fraction, SECTIONS.neck_fraction, now)
        return backbone(SECTIONS, bending).position

    def velocity(t):
        return jax.jvp(position, (t,), (1.0,))[1]

    expected = jax.jit(lambda: (position(0.0), *jax.jvp(velocity, (0.0,), (1.0,))))()
    np.testing.assert_allclose(
        body_of(Coordinates(q, rate, second))[0], expected, rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("time", [0.0, 0.37])
def test_at_constant_rates_the_closed_form_is_the_gait(time):
    given = SECTIONS.fraction, SECTIONS.neck_fraction, jnp.asarray(time), jnp.asarray(0.3)
    driven = Driven(Serpenoid(), Running(GAIT))
    expected, _ = GAIT.bending(*given, jnp.zeros(0), at_rest())
    found, states = driven.bending(*given, jnp.zeros(0), at_rest())
    assert states.shape == (0,)
    for name in Bending._fields:
        value = np.asarray(getattr(found, name))
        np.testing.assert_allclose(value, getattr(expected, name), rtol=0, atol=2e-12)
        assert np.abs(value).max() > 0.1
    cycle, expected = (motion.cycle(*given[:2], given[3]) for motion in (driven, GAIT))
    np.testing.assert_allclose(cycle, expected, rtol=0, atol=1e-13)


def test_a_waveform_may_do_without_the_neck():
    bare = Waveform(serpenoid, Serpenoid().coordinates, neck=False)
    q = Coordinates(inputs_of(GAIT).at[-1].set(0.3), jnp.zeros(6), jnp.zeros(6))
    whole, ramped = (
        shape.bending(SECTIONS.fraction, SECTIONS.neck_fraction, q) for shape in (bare, WRITTEN)
    )
    expected = serpenoid(SECTIONS.fraction, q.q)
    np.testing.assert_allclose([whole.theta, whole.psi], expected, rtol=0, atol=1e-15)
    behind = np.asarray(SECTIONS.fraction) > float(SECTIONS.neck_fraction)
    np.testing.assert_allclose(ramped.theta[behind], whole.theta[behind], atol=1e-15)
    assert np.abs(whole.theta - ramped.theta)[~behind].max() > 0.1


def test_parameters_of_a_function_that_is_a_module_have_derivatives():
    class Bow(eqx.Module):
        stiffness: jax.Array

        def __call__(self, x, q):
            return self.stiffness * q[0] * x**2, 0 * x

    def end(stiffness):
        shape = Waveform(Bow(stiffness), ("bow",), neck=False)
        now = Coordinates(jnp.array([0.5]), jnp.array([2.0]), jnp.array([3.0]))
        found = shape.bending(jnp.array([0.5, 1.0]), jnp.asarray(0.0), now)
        return jnp.stack([found.theta[1], found.theta_dot[1], found.theta_ddot[1]])

    np.testing.assert_allclose(end(jnp.asarray(4.0)), [2.0, 8.0, 12.0], rtol=1e-14)
    slope = jax.jacfwd(end)(jnp.asarray(4.0))
    np.testing.assert_allclose(slope, [0.5, 2.0, 3.0], rtol=1e-14)
