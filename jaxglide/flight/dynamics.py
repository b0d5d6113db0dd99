"""Equations of motion (eqs 4-5, 16-20, 22).

The state of a glide is one flat vector of 13 numbers:

| index | what | unit |
| --- | --- | --- |
| 0:3 | position of the centre of mass, inertial axes | m |
| 3:6 | its velocity, inertial axes | m/s |
| 6:9 | angular velocity, body axes | rad/s |
| 9:12 | yaw, pitch, roll | rad |
| 12 | horizontal path length so far | m |
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_kind, is_traced
from .._lib.numerics import cross, safe_sqrt, solve3
from .._lib.types import Mat3, Nodes3, Scalar, State
from ..air.environment import Environment
from ..body.snake import Sections, Snake
from ..loads.aerodynamics import Aerodynamics, element_forces
from ..loads.inertia import inertia_tensor, moment_of, over_nodes, section_moment
from ..loads.polar import Polar
from ..shape.gait import Gait
from ..shape.kinematics import Backbone, backbone, wave_phase
from .attitude import angle_rates, rotation_matrix

POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
OMEGA = slice(6, 9)
ANGLES = slice(9, 12)
PATH = 12

ANGLE_LIMIT = np.deg2rad(85.0)
"""A glide whose |yaw|, |pitch| or |roll| reaches this is unstable [rad]."""


class Glider(eqx.Module):
    """What flies: a snake, its gait, its force coefficients, and the air around it.

    Every float in it can be differentiated with respect to.

    Raises:
        TypeError: a part is of another type.
        ValueError: a value in it is not allowed, or a straight body has no inertia about its
            own axis (see `Snake.gyration`).
    """

    snake: Snake
    gait: Gait
    polar: Polar = eqx.field(default_factory=Polar.published)
    environment: Environment = eqx.field(default_factory=Environment)

    def __check_init__(self):
        check_kind("snake", self.snake, Snake).__check_init__()
        check_kind("gait", self.gait, Gait).__check_init__()
        check_kind("polar", self.polar, Polar).__check_init__()
        check_kind("environment", self.environment, Environment).__check_init__()
        bends = [getattr(self.gait, n) for n in ("theta_m", "psi_m", "d_psi", "d_theta")]
        if self.snake.gyration is None and not any(is_traced(b) or float(b) for b in bends):
            raise ValueError(
                "gyration = None is not allowed of a straight body (theta_m, psi_m, d_psi and "
                "d_theta all 0): with all mass on the backbone it has no inertia about its own "
                "axis; a flat ellipse has a gyration of 0.25 chords"
            )


def check_glider(glider) -> Glider:
    """`glider`, checked again: its parts may have been exchanged since it was made."""
    check_kind("glider", glider, Glider).__check_init__()
    return glider


class Flight(NamedTuple):
    """What the vector field needs besides time and state.

    Attributes:
        glider: the glider.
        sections: its snake, discretised.
        phi_theta: launch phase of the horizontal wave [rad].
    """

    glider: Glider
    sections: Sections
    phi_theta: Scalar


class Elements(NamedTuple):
    """The body's elements at one instant, in body axes unless named otherwise.

    Attributes:
        body: positions, velocities, accelerations and frames in co-moving axes.
        air_velocity: velocity through the air [m/s], (3, n).
        relative_acceleration: acceleration relative to the centre of mass but for the
            part due to the angular acceleration [m/s^2], (3, n).
        moment: moment of the air's force about the centre of mass [N m], (3, n).
        aerodynamics: forces, coefficients and angles of every element.
        R_BI: rotation from inertial to body components, (3, 3).
    """

    body: Backbone
    air_velocity: Nodes3
    relative_acceleration: Nodes3
    moment: Nodes3
    aerodynamics: Aerodynamics
    R_BI: Mat3


def elements(time: Scalar, state: State, flight: Flight) -> Elements:
    """Motion of and force on every element.

    Args:
        time: since launch [s].
        state: the 13 numbers named in this module.
        flight: glider, sections and launch phase.
    """
    glider, sections, phi_theta = flight
    phase, phase_rate = wave_phase(glider.gait, phi_theta, time)
    body = backbone(sections, glider.gait, glider.snake.neck_fraction, phase, phase_rate)
    R_BI = rotation_matrix(state[ANGLES])
    velocity_B = jnp.sum(R_BI * state[VELOCITY], axis=1)
    omega_B = state[OMEGA]
    spin = cross(omega_B, body.position)
    air_velocity = velocity_B[:, None] + body.velocity + spin
    # r'' + 2 omega x r' + omega x (omega x r); the term in omega' is the unknown
    relative = body.acceleration + cross(omega_B, 2 * body.velocity + spin)
    air = element_forces(sections, body, air_velocity, glider.polar, glider.environment)
    moment = cross(body.position, air.force)
    return Elements(body, air_velocity, relative, moment, air, R_BI)


@jax.jit
def six_degrees_of_freedom(time: Scalar, state: State, flight: Flight) -> State:
    """Rate of the state in free flight.

    The rotational equation I omega' = M_A - omega x (I omega) - [I'] omega - omega x h
    - [h'] is written as the moment of the air minus that of every element's inertia,
    since omega x (I omega) + [I'] omega + omega x h + [h'] = sum m r x (r'' + 2 omega x r'
    + omega x (omega x r)): one sum over the nodes instead of four.

    Args:
        time: since launch [s].
        state: the 13 numbers named in this module.
        flight: glider, sections and launch phase.
    """
    glider, sections, _ = flight
    now = elements(time, state, flight)
    force_B = over_nodes(now.aerodynamics.force)
    force_I = jnp.sum(now.R_BI * force_B[:, None], axis=0)
    weight = jnp.stack([0.0 * glider.environment.gravity] * 2 + [glider.environment.gravity])
    acceleration = force_I / glider.snake.mass - weight
    effective = now.aerodynamics.force - sections.mass * now.relative_acceleration
    moment = moment_of(now.body.position, effective)
    if sections.axial_inertia is not None:
        moment = moment - section_moment(sections, now.body, state[OMEGA])
    omega_dot = solve3(inertia_tensor(sections, now.body), moment)
    velocity = state[VELOCITY]
    path_rate = safe_sqrt(velocity[0] ** 2 + velocity[1] ** 2)
    return jnp.concatenate(
        [
            velocity,
            acceleration,
            omega_dot,
            angle_rates(state[ANGLES], state[OMEGA]),
            path_rate[None],
        ]
    )
