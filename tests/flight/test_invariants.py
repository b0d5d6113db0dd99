"""Conservation laws and first principles, which no wrong term of the equations survives."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Gait,
    Glider,
    Launch,
    Outcome,
    Polar,
    Snake,
    discretise,
    elements,
    simulate,
    six_degrees_of_freedom,
)
from jaxglide.flight.attitude import rotation_matrix
from jaxglide.flight.dynamics import ANGLES, OMEGA, POSITION, VELOCITY, Flight
from jaxglide.loads.inertia import inertia
from jaxglide.shape.gait import wave_phase, waves
from jaxglide.shape.kinematics import backbone

GAIT = Gait.from_degrees(theta_m=100, psi_m=28, nu_theta=1.2, f_theta=1.4, d_psi=12, d_theta=15)
FLAT = Snake.from_svl(gyration=0.25)  # whose sections have inertia of their own
LAUNCH = Launch(height=2.0, speed=2.0, phi_theta=0.4, angles=[0.2, -0.1, 0.15])


def in_vacuum(gravity, gait=GAIT):
    return Glider(FLAT, gait, Polar.published(0.0, 0.0), gravity=gravity)


def body_at(time, flight):
    glider, sections, phi_theta = flight
    phase = wave_phase(glider.gait, phi_theta, time)
    return backbone(
        sections, waves(glider.gait, glider.body.neck_fraction, sections.fraction, *phase)
    )


def points(time, flight):
    """Half of every element's mass on either side of the backbone, body axes [m], (3, 2n)."""
    body = body_at(time, flight)
    offset = flight.glider.body.gyration * flight.sections.chord * body.chord
    return jnp.concatenate([body.position + offset, body.position - offset], axis=1)


def halves(along_nodes):
    """What an element has, shared between its two points, (..., 2n)."""
    return jnp.concatenate([along_nodes, along_nodes], axis=-1) / 2


def node_positions(time, state, flight):
    """Of all points in inertial axes [m], (3, 2n)."""
    R = rotation_matrix(state[ANGLES])
    return state[POSITION, None] + R.T @ points(time, flight)


def node_velocities(time, state, flight):
    """The same in motion [m/s], by differentiating along the flow; nothing else."""
    flow = six_degrees_of_freedom(time, state, flight)
    return jax.jvp(lambda t, y: node_positions(t, y, flight), (time, state), (1.0, flow))[1]


def angular_momentum_I(time, state, flight):
    """About the centre of mass, inertial axes [kg m^2/s], (3,)."""
    arms = node_positions(time, state, flight) - state[POSITION, None]
    momenta = halves(flight.sections.mass) * node_velocities(time, state, flight)
    return jnp.sum(jnp.cross(arms, momenta, axis=0), axis=1)


@jax.jit
def along(times, states, flight):
    """Angular and linear momentum (inertial), kinetic energy, over instants."""

    def at(time, state):
        velocities = node_velocities(time, state, flight)
        mass = halves(flight.sections.mass)
        energy = 0.5 * jnp.sum(mass * jnp.sum(velocities**2, axis=0))
        return angular_momentum_I(time, state, flight), velocities @ mass, energy

    return jax.vmap(at)(times, states)


def sections_of(glider):
    return jax.jit(discretise)(glider.body)


def fly_in_vacuum(gravity, launch=LAUNCH):
    return simulate(
        in_vacuum(gravity),
        launch,
        rtol=1e-11,
        atol=1e-11,
        dense=True,
        max_time=0.7,
        max_steps=4096,
    )


def test_momentum_is_conserved_while_the_body_undulates():
    glide = fly_in_vacuum(0.0)
    assert int(glide.outcome) == Outcome.OUT_OF_TIME
    times = glide.sample_times(40)
    flight = Flight(glide.glider, sections_of(glide.glider), LAUNCH.phi_theta)
    states = glide.at(times)
    spin, momentum, _ = along(times, states, flight)
    mass = float(glide.glider.body.mass)
    np.testing.assert_allclose(momentum, np.tile([0, 2 * mass, 0], (40, 1)), rtol=0, atol=1e-15)
    size = np.linalg.norm(spin[0])
    assert size > 1e-5  # kg m^2/s
    assert (np.abs(spin - spin[0]) / size).max() < 1e-8
    # it does turn meanwhile, and not by a little
    assert np.ptp(np.asarray(states[:, ANGLES]), axis=0).max() > np.deg2rad(10)
    line = [0, 2, 0] * np.asarray(times)[:, None] + [0, 0, 2]
    np.testing.assert_allclose(states[:, POSITION], line, rtol=0, atol=1e-12)


def test_free_fall_is_ballistic_and_lands_on_time():
    glide = fly_in_vacuum(9.81)
    fall = np.sqrt(2 * 2.0 / 9.81)
    assert int(glide.outcome) == Outcome.LANDED
    assert float(glide.time) == pytest.approx(fall, abs=1e-10)
    np.testing.assert_allclose(glide.landing_point, [0, 2 * fall, 0], rtol=0, atol=1e-9)
    assert float(glide.path_length) == pytest.approx(2 * fall, abs=1e-9)
    t = np.asarray(glide.sample_times(40))
    states = np.asarray(glide.at(t))
    path = np.stack([0 * t, 2 * t, 2 - 0.5 * 9.81 * t**2], axis=1)
    np.testing.assert_allclose(states[:, POSITION], path, rtol=0, atol=1e-9)
    np.testing.assert_allclose(states[:, 5], -9.81 * t, rtol=0, atol=1e-9)
    # gravity has no moment: the body turns as it does without weight
    weightless = fly_in_vacuum(0.0)
    np.testing.assert_allclose(
        states[:-1, ANGLES], weightless.at(t[:-1])[:, ANGLES], rtol=0, atol=1e-9
    )


def test_a_frozen_body_spins_as_a_rigid_one():
    """No air, no weight, no undulation, thrown with a spin about all three axes."""
    glider = in_vacuum(0.0, Gait.from_degrees(psi_m=30, f_theta=0.0))
    flight = Flight(glider, sections_of(glider), jnp.asarray(0.3))
    start = jnp.zeros(13).at[OMEGA].set(jnp.array([1.0, 2.0, -1.5]))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(six_degrees_of_freedom),
        diffrax.Dopri5(),
        t0=0.0,
        t1=0.8,
        dt0=0.01,
        y0=start,
        args=flight,
        saveat=diffrax.SaveAt(ts=jnp.linspace(0, 0.8, 40)),
        stepsize_controller=diffrax.PIDController(1e-12, 1e-12),
        max_steps=20_000,
    )
    times, states = solution.ts, solution.ys
    spin, _, energy = along(times, states, flight)
    tensor = np.asarray(inertia(flight.sections, body_at(0.0, flight)).tensor)
    omega = np.asarray(states[:, OMEGA])
    rigid = 0.5 * np.einsum("ni,ij,nj->n", omega, tensor, omega)
    np.testing.assert_allclose(energy, rigid, rtol=1e-10)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(omega @ tensor, axis=1), np.linalg.norm(spin[0]))
    scale = np.linalg.norm(spin[0])
    assert (np.abs(spin - spin[0]) / scale).max() < 1e-9
    assert np.ptp(omega, axis=0).min() > 0.05  # Euler's equations at work


@pytest.fixture(scope="module", params=["published", "smooth"])
def lively(request, random_states):
    """Instants of undulating flight in air: (times, states, flight)."""
    glider = Glider(FLAT, GAIT, Polar.from_name(request.param, 1.2, 0.9))
    return *random_states(30, seed=5), Flight(glider, sections_of(glider), jnp.asarray(0.4))


@jax.jit
def balance(times, states, flight):
    """Force each element needs beyond the air's and its weight: what the body must exert.

    Accelerations are second derivatives of the elements' inertial positions along the
    flow, so that no term of the equations of motion enters but the rates under test.
    """
    mass = halves(flight.sections.mass)
    gravity = flight.glider.gravity

    def at(time, state):
        flow = six_degrees_of_freedom(time, state, flight)
        velocities, accelerations = jax.jvp(
            lambda t, y: node_velocities(t, y, flight), (time, state), (1.0, flow)
        )
        arms = node_positions(time, state, flight) - state[POSITION, None]
        now = elements(time, state, flight)
        air = halves(now.R_BI.T @ now.aerodynamics.force)
        body = mass * (accelerations + jnp.array([[0.0], [0], [gravity]])) - air
        shape = now.R_BI.T @ jax.jvp(lambda t: points(t, flight), (time,), (1.0,))[1]

        def energy(t, y):
            motion = 0.5 * jnp.sum(mass * jnp.sum(node_velocities(t, y, flight) ** 2, axis=0))
            return motion + gravity * jnp.sum(mass * node_positions(t, y, flight)[2])

        rate = jax.jvp(energy, (time, state), (1.0, flow))[1]
        power = jnp.sum(air * velocities), jnp.sum(body * shape)
        moments = (jnp.sum(jnp.cross(arms, f, axis=0), axis=1) for f in (body, air))
        met = jnp.mean(velocities.reshape(3, 2, -1), axis=1)
        apart = met - now.R_BI.T @ now.air_velocity
        return jnp.sum(body, axis=1), *moments, rate, *power, jnp.abs(apart).max()

    return jax.vmap(at)(times, states)


@pytest.fixture(scope="module")
def balanced(lively):
    return [np.asarray(part) for part in balance(*lively)]


def test_internal_forces_add_up_to_nothing(balanced):
    """Newton's third law within the body: no net force, no net moment, whatever it does."""
    force, moment, air_moment, *_, apart = balanced
    assert np.abs(force).max() < 1e-13  # N, of a weight of 0.37
    scale = np.abs(air_moment).max()
    assert scale > 5e-3  # N m
    assert (np.abs(moment).max() / scale) < 1e-11
    assert apart.max() < 1e-12  # the air meets the elements at these velocities


def test_energy_changes_by_the_power_of_the_air_and_of_the_muscles(balanced):
    *_, rate, air, muscle, _ = balanced
    assert np.abs(rate - air - muscle).max() < 1e-9 * np.abs(rate).max()
    assert (air < 0).all()  # the air only ever takes
    assert np.abs(muscle).max() > 1e-2 * np.abs(rate).max()


def test_the_field_does_not_depend_on_where_or_which_way(random_states):
    """Moved anywhere and turned about the vertical, the glider feels the same."""
    glider = Glider(Snake.from_svl(), GAIT, Polar.smooth())
    times, states = random_states(30, seed=6)
    flight = Flight(glider, sections_of(glider), jnp.asarray(0.4))
    field = jax.jit(jax.vmap(six_degrees_of_freedom, (0, 0, None)))
    turn = 0.7
    c, s = np.cos(turn), np.sin(turn)
    matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    moved = states.copy()
    moved[:, POSITION] += [3.0, -4.0, 50.0]
    moved[:, VELOCITY] = states[:, VELOCITY] @ matrix.T
    moved[:, ANGLES.start] += turn
    before, after = (np.asarray(field(times, y, flight)) for y in (states, moved))
    np.testing.assert_allclose(
        after[:, VELOCITY], before[:, VELOCITY] @ matrix.T, rtol=0, atol=1e-10
    )
    scale = np.abs(before[:, OMEGA]).max()
    np.testing.assert_allclose(after[:, OMEGA], before[:, OMEGA], rtol=0, atol=1e-11 * scale)
    np.testing.assert_allclose(after[:, ANGLES], before[:, ANGLES], rtol=0, atol=1e-11)


def test_the_world_looks_the_same_in_every_direction():
    """A launch turned left with its attitude flies the same path, turned left."""
    glider = Glider(Snake.from_svl(), GAIT, Polar.smooth())
    options = {"rtol": 1e-9, "atol": 1e-9}
    angles, turn = np.array([0.2, -0.1, 0.15]), 0.5
    fields = {"height": 2.0, "speed": 2.0, "phi_theta": 0.4, "elevation": -0.3}
    ahead = simulate(glider, Launch(angles=angles, **fields), **options)
    turned = Launch(angles=angles + np.array([turn, 0, 0]), heading=turn, **fields)
    left = simulate(glider, turned, **options)
    cosine, sine = np.cos(turn), np.sin(turn)
    to_left = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    assert ahead.outcome == left.outcome == Outcome.LANDED
    np.testing.assert_allclose(left.landing_point, to_left @ ahead.landing_point, atol=1e-7)
    np.testing.assert_allclose(left.velocity, to_left @ ahead.velocity, atol=1e-6)
    expected = np.asarray(ahead.end_angles) + np.array([turn, 0, 0])
    np.testing.assert_allclose(left.end_angles, expected, atol=1e-6)
    assert left.take_off.state[3] < 0  # to the left
