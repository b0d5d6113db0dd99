"""Drives against their closed forms: programmes, actuators and their limits."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from jaxglide import (
    Actuated,
    AttitudeLaw,
    Gait,
    Observation,
    Planned,
    Programme,
    Running,
    TabulatedMotion,
)
from jaxglide.shape.drives import inputs_of, soft
from jaxglide.shape.motion import at_rest

GAIT = Gait.from_degrees(d_theta=15)
NOWHERE = at_rest()
TIMES = (0.2, 0.5, 0.9, 1.0, 1.6)
INPUTS = np.random.default_rng(0).normal(size=(5, 3)) + np.arange(3)


def on(drive, times, phase=0.3):
    """Coordinates of a drive without states over times."""
    drive_at = jax.vmap(lambda t: drive(t, jnp.asarray(phase), jnp.zeros(0), NOWHERE)[0])
    return jax.jit(drive_at)(jnp.asarray(times))


def test_a_running_gait_keeps_its_shape_and_its_rate():
    found = on(Running(GAIT), [0.0, 0.7])
    expected = np.asarray(inputs_of(GAIT))
    np.testing.assert_array_equal(found.q[:, :-1], np.tile(expected[:-1], (2, 1)))
    phase = 0.3 - 2 * np.pi * 1.2 * np.array([0, 0.7])
    np.testing.assert_allclose(found.q[:, -1], phase, rtol=1e-15)
    np.testing.assert_allclose(found.q_dot, np.tile([0] * 5 + [-2 * np.pi * 1.2], (2, 1)))
    assert not np.any(found.q_ddot)
    held = on(Running([1.0, 2.0], cyclic=False), [0.7])
    np.testing.assert_array_equal(held.q, [[1.0, 2.0]])


def test_a_programme_is_the_spline_through_its_knots():
    spline = CubicSpline(TIMES, INPUTS, bc_type="clamped")
    times = np.array([*TIMES, 0.3, 0.77, 1.49])
    found = on(Programme(TIMES, INPUTS, cyclic=False), times)
    for order, values in enumerate(found):
        np.testing.assert_allclose(values, spline(times, order), rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.q[:5], INPUTS, rtol=0, atol=1e-14)
    assert np.abs(found.q_ddot).max() > 10


def test_a_programme_is_held_before_and_after():
    found = on(Programme(TIMES, INPUTS, cyclic=False), [0.0, 0.1, 1.7, 30.0])
    np.testing.assert_allclose(found.q, INPUTS[[0, 0, -1, -1]], rtol=0, atol=1e-14)
    assert not np.any(found.q_dot)
    assert not np.any(found.q_ddot)


def test_the_phase_is_the_integral_of_the_frequency():
    spline = CubicSpline(TIMES, INPUTS[:, -1], bc_type="clamped")

    def frequency(t):
        return float(spline(np.clip(t, TIMES[0], TIMES[-1])))

    times = [0.0, 0.1, 0.6, 1.3, 2.5]
    found = on(Programme(TIMES, INPUTS), times)
    for k, t in enumerate(times):
        turns = quad(frequency, 0, t, points=[x for x in TIMES if x < t] or None)[0]
        assert float(found.q[k, -1]) == pytest.approx(0.3 - 2 * np.pi * turns, abs=1e-9)
        assert float(found.q_dot[k, -1]) == pytest.approx(-2 * np.pi * frequency(t), abs=1e-12)


@pytest.mark.parametrize("cyclic", [True, False])
def test_rates_of_a_programme_are_its_derivatives(cyclic):
    drive = Programme(TIMES, INPUTS, cyclic=cyclic)

    def q(t):
        return drive(t, jnp.asarray(0.3), jnp.zeros(0), NOWHERE)[0].q

    def rate(t):
        return jax.jvp(q, (t,), (jnp.ones(()),))[1]

    for t in (0.0, 0.33, 0.95, 1.2, 2.0):
        time = jnp.asarray(t)
        found = on(drive, [t])
        _, second = jax.jvp(rate, (time,), (jnp.ones(()),))
        np.testing.assert_allclose(found.q_dot[0], rate(time), rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.q_ddot[0], second, rtol=0, atol=1e-10)


def test_gaits_are_the_rows_of_a_programme():
    other = Gait.from_degrees(nu_theta=1.1)
    rows = Programme((0.0, 1.0), [GAIT, other]).inputs
    names = ("theta_m", "psi_m", "nu_theta", "d_psi", "d_theta", "f_theta")
    expected = [[float(getattr(gait, name)) for name in names] for gait in (GAIT, other)]
    np.testing.assert_array_equal(rows, expected)


# Actuators


def wanted(time, observation):
    return jnp.array([0.8, -0.3])


@eqx.filter_jit
def respond(drive, times):
    """Coordinates and their rates over times, solved tightly from the start."""

    def rates(time, states, _):
        return drive(time, jnp.zeros(()), states, NOWHERE)[1]

    states = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),
        diffrax.Dopri8(),
        0.0,
        times[-1],
        1e-3,
        drive.start(jnp.zeros(())),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.PIDController(1e-11, 1e-12),
        max_steps=20_000,
    ).ys
    return jax.vmap(lambda t, y: drive(t, jnp.zeros(()), y, NOWHERE)[0])(times, states)


def step_response(t, w, z):
    """Of u'' + 2 z w u' + w^2 u = w^2 from rest at 0, and its rate."""
    root = np.emath.sqrt(z**2 - 1) * w
    if z == 1:
        return 1 - np.exp(-w * t) * (1 + w * t), w**2 * t * np.exp(-w * t)
    fast, slow = -z * w - root, -z * w + root
    value = 1 + (fast * np.exp(slow * t) - slow * np.exp(fast * t)) / (slow - fast)
    rate = slow * fast * (np.exp(slow * t) - np.exp(fast * t)) / (slow - fast)
    return np.real(value), np.real(rate)


@pytest.mark.parametrize("damping", [0.3, 1.0, 2.5])
def test_an_actuator_answers_a_step_as_a_second_order_system(damping):
    """With limits that are not come near: there it is linear exactly."""
    w, start, times = 20.0, np.array([0.1, 0.2]), np.linspace(0, 0.6, 25)
    drive = Actuated(
        wanted,
        start,
        w,
        damping,
        rate_limit=[30.0, 30.0],
        low=[-3.0, -3.0],
        high=[3.0, 3.0],
        cyclic=False,
    )
    found = respond(drive, jnp.asarray(times))
    value, rate = step_response(times, w, damping)
    change = np.array([0.8, -0.3]) - start
    np.testing.assert_allclose(found.q, start + np.outer(value, change), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found.q_dot, np.outer(rate, change), rtol=0, atol=1e-7)
    if damping == 0.3:
        assert found.q[:, 0].max() > 0.8 + 0.2  # it overshoots


def test_the_phase_of_actuators_is_the_integral_of_their_frequency():
    times = np.linspace(0, 0.6, 25)
    drive = Actuated(wanted, [0.1, 0.2], 20.0, 1.0)
    found = respond(drive, jnp.asarray(times))
    w, change = 20.0, -0.5
    # the integral of the response of a critically damped one
    lag = times - (2 - np.exp(-w * times) * (2 + w * times)) / w
    turns = 0.2 * times + change * lag
    np.testing.assert_allclose(found.q[:, -1], -2 * np.pi * turns, rtol=0, atol=1e-8)


LIMITED = Actuated(
    wanted,
    [0.1, 0.2],
    30.0,
    0.2,
    rate_limit=[2.0, 0.7],
    low=[-0.4, -0.25],
    high=[0.5, 0.3],
    cyclic=False,
)


def test_limits_of_rate_and_range_are_never_passed():
    """At states of any size, a solver's wildest included."""
    rng = np.random.default_rng(1)
    states = rng.normal(size=(20_000, 4)) * 10 ** rng.uniform(-2, 4, (20_000, 1))
    at = jax.vmap(lambda y: LIMITED(jnp.zeros(()), jnp.zeros(()), y, NOWHERE)[0])
    found = jax.jit(at)(states)
    low, high = np.asarray(LIMITED.low), np.asarray(LIMITED.high)
    assert (found.q >= low - 1e-15).all()
    assert (found.q <= high + 1e-15).all()
    assert (np.abs(found.q_dot) <= np.asarray(LIMITED.rate_limit) + 1e-15).all()
    # and they are come near
    np.testing.assert_allclose(found.q.max(axis=0), high, rtol=1e-6)
    assert np.abs(found.q_dot).max() > 1.9


def test_a_step_runs_at_the_limit_of_rate_and_stops_at_that_of_range():
    found = respond(LIMITED, jnp.linspace(0, 1.0, 101))
    rate = np.abs(np.asarray(found.q_dot))
    assert 0.99 * 2.0 < rate[:, 0].max() <= 2.0
    assert 0.99 * 0.7 < rate[:, 1].max() <= 0.7
    # 0.8 and -0.3 are wanted, which lie beyond
    assert 0.48 < float(found.q[-1, 0]) <= 0.5
    assert -0.25 <= float(found.q[-1, 1]) < -0.24


def test_what_bends_over_at_a_limit_is_smooth():
    x = jnp.linspace(-3.0, 3.0, 601)
    by_jax = jax.vmap(jax.jacfwd(lambda v: jnp.stack(soft(v, 1.0)[:2])))(x)
    value, slope, curvature = soft(x, 1.0)
    np.testing.assert_allclose(by_jax[:, 0], slope, rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_jax[:, 1], curvature, rtol=0, atol=1e-10)
    linear = np.abs(x) <= 0.9
    np.testing.assert_array_equal(value[linear], x[linear])
    edge = np.asarray(soft(0.9 + jnp.array([-1e-7, 1e-7]), 1.0))
    assert (np.abs(edge[:, 1] - edge[:, 0]) < 1e-3).all()


def test_laws_say_what_they_are_told():
    seen = Observation(
        jnp.zeros(3), jnp.zeros(3), jnp.array([0.1, 0.2, 0.3]), jnp.array([0.4, 0.5, 0.6])
    )
    gain, by_rate = np.arange(6.0).reshape(2, 3), np.ones((2, 3))
    law = AttitudeLaw([1.0, 2.0], gain, by_rate, [0.0, 0.1, 0.0])
    expected = [1, 2] - gain @ [0.4, 0.4, 0.6] - 0.6
    np.testing.assert_allclose(law(0.0, seen), expected, rtol=1e-14)
    np.testing.assert_allclose(
        AttitudeLaw([1.0, 2.0], gain)(0.0, seen), [1, 2] - gain @ [0.4, 0.5, 0.6], rtol=1e-14
    )
    programme = Programme(TIMES, INPUTS)
    np.testing.assert_array_equal(
        Planned(programme)(jnp.asarray(0.7), seen), programme.at(jnp.asarray(0.7))
    )


# Motions from tables


def sampled(step):
    """The gait at stations and times, so many apart [s]; it has no neck here."""
    times, stations = np.arange(0, 2 + step / 2, step), np.linspace(0, 1, round(2 / step) + 1)
    at = jax.vmap(
        lambda t: GAIT.bending(
            jnp.asarray(stations), jnp.asarray(0.0), t, jnp.asarray(0.3), jnp.zeros(0), NOWHERE
        )[0]
    )(jnp.asarray(times))
    return TabulatedMotion(times, stations, at.theta, at.psi)


def bent(motion, times, fraction):
    at = jax.vmap(
        lambda t: motion.bending(
            fraction, jnp.asarray(0.0), t, jnp.asarray(0.3), jnp.zeros(0), NOWHERE
        )[0]
    )
    return np.stack(jax.jit(at)(times))


def test_a_tabulated_motion_converges_to_the_gait_it_was_sampled_from():
    """In the middle: fourth order in the angles, third in the rates, second beyond."""
    times, fraction = jnp.linspace(0.8, 1.2, 398), jnp.linspace(0.3, 0.7, 11)
    exact = bent(GAIT, times, fraction)
    errors = np.stack(
        [
            np.abs(bent(sampled(step), times, fraction) - exact).max(axis=(1, 2))
            for step in (0.04, 0.02)
        ]
    )
    orders = np.log2(errors[0] / errors[1]).reshape(2, 3)
    np.testing.assert_allclose(orders, [[4, 3, 2]] * 2, rtol=0, atol=0.4)
    share = (errors[1] / np.abs(exact).max(axis=(1, 2))).reshape(2, 3)
    assert (share < [5e-5, 5e-4, 2e-2]).all()


def test_a_tabulated_motion_is_smooth_in_time():
    motion, fraction = sampled(0.1), jnp.linspace(0, 1, 7)

    def angles(t):
        return motion.bending(
            fraction, jnp.asarray(0.0), t, jnp.asarray(0.0), jnp.zeros(0), NOWHERE
        )[0]

    def both(t):
        now = angles(t)
        return jnp.stack([now.theta, now.theta_dot, now.psi, now.psi_dot])

    for t in (0.05, 0.31, 1.26):
        now, slope = (
            angles(jnp.asarray(t)),
            jax.jvp(both, (jnp.asarray(t),), (jnp.ones(()),))[1],
        )
        expected = [now.theta_dot, now.theta_ddot, now.psi_dot, now.psi_ddot]
        np.testing.assert_allclose(slope, expected, rtol=0, atol=1e-10)
    # at a knot the second derivative comes from both sides to one value
    before, after = bent(motion, 0.5 + jnp.array([-1e-9, 1e-9]), fraction).transpose(1, 0, 2)
    np.testing.assert_allclose(before, after, rtol=0, atol=1e-5)
    assert np.abs(after[2]).max() > 10
