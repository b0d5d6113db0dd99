"""What the actuators of a body do: their power, from the balance of energy."""

import jax
import jax.numpy as jnp

from .._lib.types import Scalar, State
from ..flight.attitude import rotation_matrix
from ..flight.dynamics import (
    ANGLES,
    OMEGA,
    POSITION,
    VELOCITY,
    Flight,
    elements,
    six_degrees_of_freedom,
)


def _node_velocity(time, state: State, flight: Flight):
    """Velocity over the ground of every element, body axes [m/s], (3, n), and the elements."""
    now = elements(time, state, flight)
    carried = rotation_matrix(state[ANGLES]) @ state[VELOCITY]
    turned = jnp.cross(state[OMEGA], now.body.position.T).T
    return now.body.velocity + turned + carried[:, None], now


def energy(time: Scalar, state: State, flight: Flight) -> Scalar:
    """Kinetic and potential energy of a flight [J]: of its moving elements, not of actuators.

    Args:
        time: since launch [s].
        state: of the flight, (s,).
        flight: glider, sections, launch phase.
    """
    velocity, _ = _node_velocity(time, state, flight)
    sections = flight.sections
    moving = 0.5 * jnp.sum(sections.mass * jnp.sum(velocity**2, axis=0))
    return moving + sections.total_mass * flight.glider.gravity * state[POSITION][2]


def actuator_power(time: Scalar, state: State, flight: Flight) -> Scalar:
    """Power that bends the body [W]: by how much energy rises beyond what the air gives.

    Negative where the air bends the body.

    Args:
        time, state, flight: as in `energy`.
    """
    rate = six_degrees_of_freedom(time, state, flight)
    one = jnp.ones_like(time)
    _, rises = jax.jvp(lambda t, y: energy(t, y, flight), (time, state), (one, rate))
    velocity, now = _node_velocity(time, state, flight)
    return rises - jnp.sum(now.aerodynamics.force * velocity)
