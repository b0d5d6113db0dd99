"""Trim: roots, their derivatives, stiffness and effectiveness, against finite differences."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import AbstractMotion, Gait, Glider, Launch, Polar, Snake
from jaxglide.tunnel.loads import loads
from jaxglide.tunnel.trim import GAIT_PARAMETERS, derivatives, pitch_moment, trim

FINE = {"rtol": 1e-11, "atol": 1e-11}


def shaped(values, snake=None):
    """Glider of theta_m [deg], nu_theta, d_psi [deg], smooth polar."""
    gait = Gait.from_degrees(theta_m=values[0], nu_theta=values[1], d_psi=values[2])
    snake = Snake.from_svl(nodes=40, node_set="gauss") if snake is None else snake
    return Glider(snake, gait, Polar.smooth())


def slope(function, values, i, step):
    """Fourth-order central difference."""
    d = step * np.eye(len(values))[i]
    near = function(values + d) - function(values - d)
    far = function(values + 2 * d) - function(values - 2 * d)
    return (8 * float(near) - float(far)) / (12 * step)


HERE = np.array([96.5, 1.4, 10.0])
STEPS = (1e-2, 1e-4, 1e-2)


def moment(values):
    return pitch_moment(shaped(values), **FINE)


def test_a_launch_made_beforehand_may_be_used_inside_jit():
    launch = Launch(2.0, 1.7)
    found = jax.eval_shape(lambda values: pitch_moment(shaped(values), launch), HERE)
    assert found.shape == ()


@pytest.fixture(scope="module")
def slopes():
    """Gradient in forward mode, and value, of the mean pitch moment."""
    return jax.jit(jax.jacfwd(lambda values: (moment(values),) * 2, has_aux=True))


@pytest.mark.slow
def test_the_gradient_of_the_mean_pitch_moment_against_differences(slopes):
    """To 1e-6 of the value. The solver's steps change from value to value, by which single
    differences scatter more than that: their median over nine widths does not."""
    expected = [
        np.median(
            [slope(lambda x: slopes(x)[1], HERE, i, h) for h in np.geomspace(h / 2, 2 * h, 9)]
        )
        for i, h in enumerate(STEPS)
    ]
    np.testing.assert_allclose(slopes(HERE)[0], expected, rtol=1e-6)


@pytest.mark.slow
def test_the_gradient_is_the_same_in_reverse_mode(slopes):
    np.testing.assert_allclose(jax.jit(jax.grad(moment))(HERE), slopes(HERE)[0], rtol=1e-9)


@pytest.fixture(scope="module")
def trimmed():
    """Function of (theta_m, nu_theta) that gives the trimmed d_psi [rad] and its gradient."""
    return jax.jit(
        jax.value_and_grad(lambda x: trim(shaped([x[0], x[1], 0.0]), points=5, **FINE).value)
    )


@pytest.mark.slow
def test_trim_derivatives_against_trims_solved_again(trimmed):
    value, gradient = trimmed(HERE[:2])
    assert np.deg2rad(5) < float(value) < np.deg2rad(20)
    for i, step in enumerate((0.05, 1e-4)):
        expected = slope(lambda x: trimmed(x)[0], HERE[:2], i, step)
        assert float(gradient[i]) == pytest.approx(expected, rel=1e-5)


@pytest.fixture(scope="module")
def found():
    return trim(shaped(HERE), points=5)


class Tail(AbstractMotion):
    """A part from outside that describes none of its floats: half of a gait's bend."""

    gait: Gait
    bend: float = 0.0

    def _bent(self):
        return eqx.tree_at(lambda g: g.d_psi, self.gait, 2 * jnp.asarray(self.bend))

    def bending(self, *given):
        return self._bent().bending(*given)

    def cycle(self, *given):
        return self._bent().cycle(*given)


@pytest.mark.slow
def test_a_float_of_a_part_of_ones_own_is_trimmed(found):
    glider = eqx.tree_at(lambda g: g.gait, shaped(HERE), Tail(shaped(HERE).gait))
    own = trim(glider, "gait.bend", np.deg2rad((-10.0, 10.0)), points=5)
    assert float(own.value) == pytest.approx(float(found.value) / 2, abs=1e-9)
    assert str(own).startswith(f"trim at gait.bend = {float(own.value):.6f}, where")


def test_a_trim_has_no_moment_and_lies_where_the_sign_changes(found):
    glider = shaped(HERE)
    assert bool(found.found)
    assert int(found.crossings) == 1
    assert abs(float(found.moment)) < 1e-12
    moments = np.asarray(found.moments)
    k = int(np.argmax(np.diff(np.sign(moments)) != 0))
    assert found.scanned[k] < found.value < found.scanned[k + 1]
    at = eqx.tree_at(lambda g: g.gait.d_psi, glider, found.value)
    assert abs(float(pitch_moment(at))) < 1e-12
    for gait_value, expected in zip(found.scanned, moments, strict=True):
        other = eqx.tree_at(lambda g: g.gait.d_psi, glider, gait_value)
        assert float(pitch_moment(other)) == pytest.approx(expected, rel=1e-6)
    assert f"trim at d_psi = {np.rad2deg(float(found.value)):.6f} deg/SVL" in str(found)
    assert "<b>trim at d_psi" in found._repr_html_()
    # the same range without its upper part: no change of sign, no root
    missing = trim(glider, bounds=np.deg2rad((-20.0, 5.0)), points=5)
    assert not bool(missing.found)
    assert np.isnan(float(missing.value))
    assert np.isnan(float(missing.moment))
    assert int(missing.crossings) == 0
    assert (np.asarray(missing.moments) < 0).all()
    assert str(missing).startswith("no trim")


def test_stiffness_and_effectiveness_against_differences():
    glider = shaped(HERE, Snake.from_svl(nodes=60, node_set="gauss"))
    velocity, angles = np.array([0.0, 4.0, -5.0]), np.array([0.02, -0.1, 0.03])
    found = derivatives(glider, velocity, angles, time=0.1, phases=12)

    def mean(angles, gait):
        other = eqx.tree_at(lambda g: g.gait, glider, gait)
        read = loads(other, velocity, angles, time=0.1, phases=12)
        return np.asarray(read.aerodynamic).mean(axis=0)

    np.testing.assert_allclose(found.moment, mean(angles, glider.gait), atol=1e-15)
    step = 1e-5
    for i in range(3):
        d = step * np.eye(3)[i]
        expected = (mean(angles + d, glider.gait) - mean(angles - d, glider.gait)) / (2 * step)
        np.testing.assert_allclose(found.by_angles[:, i], expected, rtol=1e-5, atol=1e-9)
    assert float(found.pitch_stiffness) == float(found.by_angles[0, 1])
    for name in GAIT_PARAMETERS:

        def moved(change, name=name):
            value = getattr(glider.gait, name) + change
            return mean(angles, eqx.tree_at(lambda g: getattr(g, name), glider.gait, value))

        expected = (moved(step) - moved(-step)) / (2 * step)
        np.testing.assert_allclose(getattr(found.by_gait, name), expected, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("bend",), "there is no parameter 'bend': known are svl"),
        (("ends[1].limit", (0.1, 0.2)), "there is no parameter"),
        (("chord", (0.1, 0.2)), r"chord is an array of shape \(3,\): name a number in it"),
        (("speed", (-1.0, 2.0)), "speed = -1 m/s"),
        (("theta_m",), "bounds of theta_m must be given"),
        (("d_psi", (0.3, -0.3)), "are not lowest and highest"),
        (("d_psi", (0.0, 9.0)), "d_psi = 9 rad"),
        (("d_psi", (0.0, np.nan)), "not lowest and highest"),
        (("d_psi", (0.0,)), r"bounds has shape \(1,\)"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        trim(shaped(HERE), *arguments)


def test_parameters_of_the_gait_are_all_there():
    assert set(GAIT_PARAMETERS) == {
        "theta_m", "psi_m", "nu_theta", "f_theta", "d_psi", "d_theta"
    }  # fmt: skip
    assert jnp.asarray(0.0).dtype == jnp.float64
