"""First principles where every part moves: shape, drive, wind, lag and point masses at once."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Actuated,
    AngleLimit,
    AttitudeLaw,
    Driven,
    Gait,
    Glider,
    LaggingCirculation,
    Polar,
    Programme,
    Running,
    Serpenoid,
    Snake,
    TabulatedBody,
    Turbulence,
    discretise,
    elements,
    integrate,
    six_degrees_of_freedom,
)
from jaxglide.flight.attitude import rotation_matrix
from jaxglide.flight.dynamics import (
    ANGLES,
    OMEGA,
    POSITION,
    VELOCITY,
    Flight,
    observation,
    with_own_states,
)
from jaxglide.loads.inertia import angular_momentum, inertia_tensor
from jaxglide.shape.drives import inputs_of
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

SNAKE = Snake.from_svl(nodes=24, node_set="gauss")
GAIT = Gait.from_degrees()
LIVELY = Gait.from_degrees(115, 35, 1.15, 1.6, -10, 25)
NOTHING = Polar.published(0.0, 0.0)
ROBOT = TabulatedBody(
    [0.0, 0.3, 0.7],
    [0.03, 0.05, 0.02],
    [0.03, 0.06, 0.04],
    [0.21, 0.4],
    [0.01, 0.02],
    nodes=24,
    node_set="gauss",
)
# all six inputs change, the number of waves too
CHANGING = Programme((0.0, 0.15, 0.4, 0.7), [GAIT, LIVELY, GAIT, LIVELY])
FEEDBACK = Actuated(
    AttitudeLaw(GAIT, 0.5 * np.ones((6, 3)), 0.05 * np.ones((6, 3))), GAIT, 25.0, 0.5
)
MOTIONS = {
    "programme": Driven(Serpenoid(), CHANGING),
    "feedback": Driven(Serpenoid(), FEEDBACK),
}
MOVING = pytest.mark.parametrize("name", MOTIONS)


def launched(glider, phase=0.3):
    """Flight, and a lively state of it with the own states at their start."""
    flight = Flight(glider, discretise(glider.body), jnp.asarray(phase))
    rigid = jnp.array([1.0, 2.0, 10.0, 0.5, 4.0, -3.0, 1.0, -2.0, 1.5, 0.3, -0.2, 0.1, 0.0])
    return flight, with_own_states(jnp.zeros(()), rigid, flight)


def node_positions(time, state, flight):
    """Of all elements, inertial axes [m], (3, n)."""
    now = elements(time, state, flight)
    return state[POSITION, None] + now.R_BI.T @ now.body.position


def node_velocities(time, state, flight):
    """The same in motion [m/s], by differentiating along the flow; nothing else."""
    flow = six_degrees_of_freedom(time, state, flight)
    return jax.jvp(lambda t, y: node_positions(t, y, flight), (time, state), (1.0, flow))[1]


@eqx.filter_jit
def momenta(times, states, flight):
    """Angular momentum about the centre of mass, and momentum, inertial axes, over instants."""

    def at(time, state):
        arms = node_positions(time, state, flight) - state[POSITION, None]
        velocities = node_velocities(time, state, flight)
        mass = flight.sections.mass
        return jnp.sum(jnp.cross(arms, mass * velocities, axis=0), axis=1), velocities @ mass

    return jax.vmap(at)(times, states)


@MOVING
def test_momentum_is_conserved_while_every_coordinate_moves(name):
    flight, start = launched(Glider(ROBOT, MOTIONS[name], NOTHING, gravity=0.0))
    times = np.linspace(0, 0.6, 13)
    flown = integrate(
        flight.glider, start, 0.0, 0.6, phase=0.3, save=times, rtol=1e-10, atol=1e-10
    )
    assert flown.ending == "ran out of time"
    spin, momentum = momenta(jnp.asarray(times), flown.states, flight)
    size = np.linalg.norm(spin[0])
    assert size > 1e-4  # kg m^2/s
    assert (np.abs(spin - spin[0]) / size).max() < 1e-7
    expected = float(flight.sections.total_mass) * np.asarray(start[VELOCITY])
    np.testing.assert_allclose(momentum, np.tile(expected, (13, 1)), rtol=1e-12, atol=1e-14)
    assert np.ptp(flown.states[:, OMEGA], axis=0).min() > 0.5


@MOVING
def test_coordinates_have_exact_derivatives_along_the_flight(name):
    glider = Glider(ROBOT, MOTIONS[name], Polar.smooth())
    flight, start = launched(glider)
    count = start.shape[0] - 13
    state = start.at[13:].add(0.3 * jnp.arange(1.0, count + 1) / (count + 1))
    drive = glider.gait.drive

    def coordinates(time, state):
        return drive(time, flight.phase, state[13:], observation(state))[0]

    @jax.jit
    def along(time, state):
        flow = six_degrees_of_freedom(time, state, flight)
        return jax.jvp(coordinates, (time, state), (1.0, flow))

    for time in (0.07, 0.33):
        now, change = along(jnp.asarray(time), state)
        np.testing.assert_allclose(change.q, now.q_dot, rtol=0, atol=1e-11)
        np.testing.assert_allclose(change.q_dot, now.q_ddot, rtol=0, atol=1e-9)
        assert np.abs(now.q_dot).min() > 1e-3
        assert np.abs(now.q_ddot).min() > 1e-3


@MOVING
def test_in_wind_the_air_changes_the_momenta_by_its_force_and_moment(name):
    """Newton and Euler for the sum of all elements, every part at work."""
    air = Turbulence(2.0, 1.5, [1.0, -2.0, 0.5], seed=1)
    flight, start = launched(
        Glider(ROBOT, MOTIONS[name], LaggingCirculation(Polar.smooth()), air)
    )
    time = jnp.asarray(0.21)

    @jax.jit
    def laws(state):
        def at(t, y):
            spin, momentum = momenta(t[None], y[None], flight)
            return spin[0], momentum[0]

        flow = six_degrees_of_freedom(time, state, flight)
        rates = jax.jvp(at, (time, state), (1.0, flow))[1]
        now = elements(time, state, flight)
        back = now.R_BI.T
        force = back @ jnp.sum(now.aerodynamics.force, axis=1)
        arms, forces = now.body.position, now.aerodynamics.force
        return rates, (back @ jnp.sum(jnp.cross(arms, forces, axis=0), axis=1), force)

    (spin_rate, momentum_rate), (moment, force) = laws(start)
    weight = np.array([0, 0, -9.81 * float(flight.sections.total_mass)])
    np.testing.assert_allclose(momentum_rate, force + weight, rtol=1e-11, atol=1e-13)
    size = np.abs(moment).max()
    np.testing.assert_allclose(spin_rate, moment, rtol=0, atol=1e-10 * size)
    assert size > 1e-3  # N m


def test_a_frozen_body_gains_the_work_of_the_air_and_of_its_weight():
    """In wind: force times velocity over the ground, though made by that through the air."""
    frozen = Driven(Serpenoid(), Running(Gait.from_degrees(f_theta=0)))
    air = Turbulence(2.0, 1.5, [1.0, -2.0, 0.5], seed=1)
    flight, start = launched(Glider(ROBOT, frozen, Polar.smooth(), air))

    @jax.jit
    def powers(state):
        def energy(t, y):
            velocities = node_velocities(t, y, flight)
            kinetic = 0.5 * jnp.sum(flight.sections.mass * jnp.sum(velocities**2, axis=0))
            return kinetic + flight.sections.total_mass * 9.81 * y[2]

        flow = six_degrees_of_freedom(0.0, state, flight)
        gain = jax.jvp(energy, (0.0, state), (1.0, flow))[1]
        now = elements(0.0, state, flight)
        force = now.R_BI.T @ now.aerodynamics.force
        return gain, jnp.sum(force * node_velocities(0.0, state, flight))

    gain, work = powers(start)
    assert float(gain) == pytest.approx(float(work), rel=1e-11)
    assert abs(float(work)) > 0.1  # W


# Turning by inertia alone: a geometric phase

BIAS = np.array([0.0, 10, 20, 30, 45, 60])  # d_theta [deg]
YAW = [-0.12, -10.54, -20.97, -31.36, -46.75, -61.79]  # deg per cycle


def without_momentum(gait, body):
    """A glider in empty space, and a level state of it without angular momentum."""
    sections = discretise(body)
    bending = waves(
        gait, sections.neck_fraction, sections.fraction, 0.0, -2 * jnp.pi * gait.f_theta
    )
    bent = backbone(sections, bending)
    tensor, h = inertia_tensor(sections, bent), angular_momentum(sections, bent)
    state = jnp.zeros(13).at[OMEGA].set(-jnp.linalg.solve(tensor, h))
    return Glider(body, gait, NOTHING, gravity=0.0), state


def test_a_biased_gait_turns_by_inertia_alone():
    body = Snake.from_svl(nodes=60, node_set="gauss")

    @jax.jit
    @jax.vmap
    def turn(d_theta):
        gait = eqx.tree_at(lambda g: g.d_theta, GAIT, d_theta)
        glider, state = without_momentum(gait, body)
        return integrate(glider, state, 0.0, 1 / 1.2, ends=(), rtol=1e-8, atol=1e-8).state

    turned = np.rad2deg(turn(np.deg2rad(BIAS))[:, ANGLES])
    np.testing.assert_allclose(turned[:, 0], YAW, rtol=0, atol=0.00501)
    assert turned[0, 1] == pytest.approx(2.02, abs=0.00501)


def test_a_bias_that_actuators_apply_in_flight_turns_a_body_without_angular_momentum():
    """Bent to the side by inputs that accelerate, it turns, and its momenta stay."""
    wanted = Gait.from_degrees(d_theta=30)
    drive = Actuated(lambda time, seen: inputs_of(wanted), GAIT, 25.0)
    _, start = without_momentum(GAIT, SNAKE)
    glider = Glider(SNAKE, Driven(Serpenoid(), drive), NOTHING, gravity=0.0)
    flight = Flight(glider, discretise(SNAKE), jnp.zeros(()))
    start = with_own_states(jnp.zeros(()), start.at[VELOCITY].set([0.5, 6.0, -4.0]), flight)
    times = np.linspace(0, 1 / 1.2, 21)
    flown: Any = integrate(glider, start, 0.0, times[-1], save=times, rtol=1e-12, atol=1e-12)

    @eqx.filter_jit
    @jax.vmap
    def own(time, state):
        """Angular momentum of the change of shape, and how the bias accelerates."""
        now = elements(time, state, flight)
        coordinates = drive(time, flight.phase, state[13:], observation(state))[0]
        return angular_momentum(flight.sections, now.body), coordinates.q_ddot[4]

    shape, bias = own(jnp.asarray(times), flown.states)
    spin, momentum = momenta(jnp.asarray(times), flown.states, flight)
    size = np.linalg.norm(shape, axis=1).max()
    assert size > 5e-4  # kg m^2/s
    assert np.abs(spin).max() < 1e-10 * size
    expected = float(flight.sections.total_mass) * np.asarray(start[VELOCITY])
    np.testing.assert_allclose(momentum, np.tile(expected, (21, 1)), rtol=0, atol=1e-15)
    assert np.ptp(bias) > 10  # rad/s^2 per SVL
    assert np.rad2deg(flown.state[ANGLES][0]) < -20  # in a cycle


def test_turning_flight_passes_85_degrees_of_yaw_where_no_end_forbids_it():
    gait = Gait.from_degrees(d_theta=60)
    glider, state = without_momentum(gait, SNAKE)
    turning = AngleLimit(angles=("pitch", "roll"))
    free, held = (
        integrate(glider, state, 0.0, 1.3, ends=ends, rtol=1e-5, atol=1e-5)
        for ends in (turning, AngleLimit())
    )
    assert free.ending == "ran out of time"
    assert float(free.end_angles[0]) < -np.deg2rad(86)
    assert held.ending == "unstable in yaw"
    assert float(held.end_angles[0]) == pytest.approx(-np.deg2rad(85), abs=1e-9)
    assert float(held.time) < 1.3


def test_the_state_turns_with_the_velocity_of_its_axes():
    """The check's own tool: inertial axes and body axes agree on what a velocity is."""
    flight, start = launched(Glider(SNAKE, GAIT, NOTHING))
    now = elements(0.1, start, flight)
    spin = jnp.cross(start[OMEGA, None], now.body.position, axis=0)
    R_BI = rotation_matrix(start[ANGLES])
    expected = start[VELOCITY, None] + R_BI.T @ (now.body.velocity + spin)
    found = node_velocities(jnp.asarray(0.1), start, flight)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
