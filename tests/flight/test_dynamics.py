"""The vector field: against the published code, the paper's equations, and the NumPy peer."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Gait, Glider, Polar, Snake, discretise, elements, six_degrees_of_freedom
from jaxglide.flight.dynamics import ANGLES, OMEGA, PATH, POSITION, VELOCITY, Flight
from jaxglide.loads.inertia import inertia

GAIT = {"theta_m": 101, "psi_m": 31, "nu_theta": 1.23, "f_theta": 1.6, "d_psi": -13}


BATCH = 40  # instants at a time, always the same, so that it compiles once a polar


@jax.jit
def _field(times, states, flight):
    rates = jax.vmap(six_degrees_of_freedom, (0, 0, None))(times, states, flight)
    return rates, jax.vmap(elements, (0, 0, None))(times, states, flight)


def field(times, states, flight):
    """Rates of the states and the elements, over a batch of instants."""
    count = len(times)
    filled = np.resize(times, BATCH), np.resize(states, (BATCH, 13))
    return jax.tree.map(lambda x: np.asarray(x)[:count], _field(*filled, flight))


def flight_of(glider, phi_theta):
    return Flight(glider, jax.jit(discretise)(glider.body), jnp.asarray(phi_theta))


def test_against_the_published_code(golden, glider_of, relative_error):
    (entry,) = golden("rhs")
    cases = entry["cases"]
    states = np.zeros((len(cases), 13))
    inputs = ("velocity_I", VELOCITY), ("omega_B", OMEGA), ("yaw_pitch_roll", ANGLES)
    for name, where in inputs:
        states[:, where] = [case[name] for case in cases]
    times = np.array([case["t"] for case in cases])
    rates, _ = field(times, states, flight_of(glider_of(entry), entry["phi_theta"]))
    outputs = ("acceleration_I", VELOCITY), ("omega_dot_B", OMEGA), ("angle_rates", ANGLES)
    for rate, state, case in zip(rates, states, cases, strict=True):
        for name, where in outputs:
            assert relative_error(rate[where], case[name]) < 5e-5
        np.testing.assert_array_equal(rate[POSITION], state[VELOCITY])
        assert rate[PATH] == pytest.approx(np.hypot(*state[VELOCITY][:2]), rel=1e-15)


@pytest.mark.parametrize("polar", ["published", "smooth"])
def test_against_the_numpy_peer(polar, peer, random_states):
    """Two implementations that share nothing but the equations."""
    times, states = random_states(40, seed=1)
    degrees = {name: np.deg2rad(value) for name, value in GAIT.items()}
    degrees |= {name: GAIT[name] for name in ("nu_theta", "f_theta")}
    settings = peer.Settings(
        **degrees, d_theta=0.4, svl=0.81, polar=polar, lift_scale=1.36, drag_scale=0.6
    )
    model = peer.prepare(settings)
    glider = Glider(
        Snake.from_svl(0.81),
        Gait.from_degrees(**GAIT, d_theta=np.rad2deg(0.4)),
        Polar.from_name(polar, lift_scale=1.36, drag_scale=0.6),
    )
    rates, _ = field(times, states, flight_of(glider, 0.7))
    expected = np.stack(
        [peer.vector_field(t, y, model, 0.7) for t, y in zip(times, states, strict=True)]
    )
    for where in (POSITION, VELOCITY, OMEGA, ANGLES, slice(PATH, 13)):
        error = np.linalg.norm(rates[:, where] - expected[:, where], axis=1)
        assert (error / np.linalg.norm(expected[:, where], axis=1)).max() < 1e-11


@pytest.mark.parametrize("gyration", [None, 0.25, 1.0])
def test_rotation_is_the_papers_equation(gyration, flight, random_states):
    """I w' = M - w x I w - [I'] w - w x h - [h'], with each term from `inertia`."""
    times, states = random_states(40, seed=2)
    snake = Snake.from_svl(gyration=gyration)
    flight = flight_of(Glider(snake, flight.glider.gait), flight.phase)
    rates, now = field(times, states, flight)
    parts = jax.jit(jax.vmap(lambda body: inertia(flight.sections, body)))(now.body)
    tensor, tensor_rate, h, h_dot = (np.asarray(part) for part in parts)
    omega, omega_dot = states[:, OMEGA], np.asarray(rates[:, OMEGA])
    M = np.asarray(now.moment).sum(axis=2)
    turning = np.cross(omega, np.einsum("nij,nj->ni", tensor, omega) + h)
    reshaping = np.einsum("nij,nj->ni", tensor_rate, omega)
    right = M - turning - reshaping - h_dot
    expected = np.linalg.solve(tensor, right[..., None])[..., 0]
    scale = np.linalg.norm(expected, axis=1)
    assert (np.linalg.norm(omega_dot - expected, axis=1) / scale).max() < 1e-10
    for term in (M, turning, reshaping, h_dot):  # every term matters at these states
        assert np.abs(term).max() > 1e-4


def test_element_velocities_and_forces_are_sweep_theory(flight, random_states):
    """Equations 23-26 as the paper has them: fold, angle of attack, force along c and b."""
    times, states = random_states(30, seed=3)
    _, now = field(times, states, flight)
    air, body = now.aerodynamics, now.body
    R, r = np.asarray(now.R_BI), np.asarray(body.position)
    velocity_B = np.einsum("nij,nj->ni", R, states[:, VELOCITY])
    spin = np.cross(states[:, None, OMEGA], r.transpose(0, 2, 1)).transpose(0, 2, 1)
    V = velocity_B[:, :, None] + np.asarray(body.velocity) + spin
    np.testing.assert_allclose(now.air_velocity, V, rtol=0, atol=1e-13)

    v_c, v_b = (np.sum(V * np.asarray(axis), axis=1) for axis in (body.chord, body.normal))
    U, total = np.hypot(v_c, v_b), np.linalg.norm(V, axis=1)
    sigma = np.where(v_c >= 0, 1.0, -1.0)
    alpha = np.arctan2(-v_b, np.abs(v_c))
    np.testing.assert_allclose(air.angle_of_attack, alpha, rtol=0, atol=1e-13)
    np.testing.assert_allclose(air.speed, total, rtol=1e-13)
    reynolds = total * np.asarray(flight.sections.chord) / 1.568e-5
    np.testing.assert_allclose(air.reynolds, reynolds, rtol=1e-13)
    np.testing.assert_allclose(air.dynamic_pressure, 0.5 * 1.165 * U**2, rtol=1e-12)
    along = np.sum(V * np.asarray(body.tangent), axis=1)
    # v_c, v_b and the axial part make up the whole velocity, but for the guard's 1e-11
    np.testing.assert_allclose(U**2 + along**2, total**2, rtol=1e-10)
    np.testing.assert_allclose(np.tan(air.sweep_angle) * U, along, rtol=0, atol=1e-11)

    lift, drag = (
        np.asarray(c)
        for c in flight.glider.aerodynamics.polar(jnp.asarray(alpha), air.reynolds)
    )
    q = 0.5 * 1.165 * U * np.asarray(flight.sections.area)
    F_c = q * (-drag * v_c - sigma * lift * v_b)
    F_b = q * (-drag * v_b + sigma * lift * v_c)
    force = F_c[:, None] * np.asarray(body.chord) + F_b[:, None] * np.asarray(body.normal)
    # the published lift jumps at -90 degrees: leave out the elements on that edge
    inner = np.abs(alpha + np.pi / 2) > 1e-9
    error = np.linalg.norm(air.force - force, axis=1)[inner]
    assert error.max() < 1e-12 * np.linalg.norm(force, axis=1).max()
    np.testing.assert_allclose(air.lift, q * U * lift, rtol=0, atol=1e-12)
    np.testing.assert_allclose(air.drag, q * U * drag, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        now.moment, np.cross(r, force, axis=1), rtol=0, atol=1e-12 * np.abs(force).max()
    )


def test_drag_opposes_and_lift_does_no_work(random_states):
    """Power of the air on every element is -drag x normal speed: lift does none."""
    glider = Glider(Snake.from_svl(), Gait.from_degrees(), Polar.smooth())
    times, states = random_states(30, seed=4)
    _, now = field(times, states, flight_of(glider, 0.0))
    air = now.aerodynamics
    power = np.sum(np.asarray(air.force * now.air_velocity), axis=1)
    normal_speed = np.sqrt(2 * np.asarray(air.dynamic_pressure) / 1.165)
    np.testing.assert_allclose(power, -air.drag * normal_speed, rtol=0, atol=1e-12)
    assert (air.drag > 0).all()


def test_sinking_level_body_is_lifted(flight):
    state = np.zeros(13)
    state[VELOCITY] = [0, 0, -5.0]
    rates, now = field(np.zeros(1), state[None], flight)
    assert rates[0, 5] > -9.81 + 1
    assert (now.aerodynamics.angle_of_attack[0] > 0.5).all()
    assert (now.aerodynamics.lift[0] > 0).all()


def test_at_rest_the_field_and_its_derivative_are_finite(flight):
    """No air velocity at all: the origin of the angle of attack and of every square root."""
    still = Flight(
        Glider(flight.glider.body, Gait.from_degrees(f_theta=0.0), Polar.smooth()),
        flight.sections,
        flight.phase,
    )
    rates, jacobian = jax.jit(
        lambda y: (
            six_degrees_of_freedom(0.0, y, still),
            jax.jacfwd(six_degrees_of_freedom, argnums=1)(0.0, y, still),
        )
    )(jnp.zeros(13))
    np.testing.assert_allclose(rates, [0, 0, 0, 0, 0, -9.81, *[0] * 7], rtol=0, atol=1e-12)
    assert np.isfinite(jacobian).all()


@pytest.mark.parametrize("gyration", [None, 0.25])
def test_the_vector_field_has_the_derivatives_of_its_differences(gyration, random_states):
    """By every number of state, gait and body; the body's change how it is integrated along."""
    times, states = random_states(3, seed=4)
    gait = jnp.deg2rad(jnp.array([95.0, 20.0, 8.0, 4.0]))
    start = jnp.array([0.65, 0.05, *gait, 1.3])  # length, neck, gait

    def field(x, time):
        length, neck, theta_m, psi_m, d_psi, d_theta, nu_theta = x[:7]
        body = Snake(length, 0.06, neck, gyration=gyration, nodes=30, node_set="gauss")
        gait = Gait(theta_m, psi_m, nu_theta, 1.2, d_psi, d_theta)
        flight = Flight(Glider(body, gait, Polar.smooth()), discretise(body), -0.03)
        return six_degrees_of_freedom(time, x[7:], flight)

    forward, reverse = (jax.jit(d(field)) for d in (jax.jacfwd, jax.jacrev))
    compiled, width = jax.jit(field), 1e-6
    for time, state in zip(times, states, strict=True):
        x = jnp.concatenate([start, state])
        found = forward(x, time)
        steps = width * np.eye(x.size)
        change = [compiled(x + s, time) - compiled(x - s, time) for s in steps]
        difference = np.stack(change, axis=1) / (2 * width)
        scale = np.abs(difference).max(axis=1, keepdims=True) + 1e-12
        assert np.all(np.abs(found - difference) < 1e-6 * scale)
        np.testing.assert_allclose(reverse(x, time), found, rtol=1e-9, atol=1e-9)
