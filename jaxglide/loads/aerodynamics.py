"""Sweep-theory aerodynamics of the body's elements (eqs 23-26).

Only the air's velocity normal to the body makes force. All in body axes.
"""

import equinox as eqx
import jax.numpy as jnp

from .._lib.numerics import arctan2, safe_sqrt
from .._lib.types import Nodes, Nodes3
from ..air.environment import Environment
from ..body.snake import Sections
from ..shape.kinematics import Backbone
from .polar import Polar


class Aerodynamics(eqx.Module):
    """The air's action on each element of the body.

    Attributes:
        force: force on the element in body axes [N], (3, n).
        lift, drag: magnitude-signed parts of it [N], (n,); lift is positive dorsally in
            everyday sinking flight.
        beta: angle of attack on the full circle [rad], (n,).
        angle_of_attack: folded fore and aft, in +-pi/2 [rad], (n,).
        sweep_angle: between the air and the plane normal to the body [rad], (n,).
        reynolds: Reynolds number on chord and total speed, (n,).
        dynamic_pressure: of the speed normal to the body [Pa], (n,).
        lift_coefficient, drag_coefficient: C_L (with the fold's sign) and C_D, (n,).
        speed: total speed of the element through the air [m/s], (n,).
    """

    force: Nodes3
    lift: Nodes
    drag: Nodes
    beta: Nodes
    angle_of_attack: Nodes
    sweep_angle: Nodes
    reynolds: Nodes
    dynamic_pressure: Nodes
    lift_coefficient: Nodes
    drag_coefficient: Nodes
    speed: Nodes


def element_forces(
    sections: Sections,
    body: Backbone,
    air_velocity: Nodes3,
    polar: Polar,
    environment: Environment,
) -> Aerodynamics:
    """Forces on the elements moving at `air_velocity` through still air.

    Args:
        sections: chords and areas.
        body: frames of the elements.
        air_velocity: velocity of the elements in body axes [m/s], (3, n).
        polar: force coefficients.
        environment: air density and viscosity.
    """
    V, c, b = air_velocity, body.chord, body.normal
    v_c = V[0] * c[0] + V[1] * c[1]
    v_b = V[0] * b[0] + V[1] * b[1] + V[2] * b[2]
    normal_speed = safe_sqrt(v_c**2 + v_b**2)
    speed = safe_sqrt(V[0] ** 2 + V[1] ** 2 + V[2] ** 2)
    reynolds = speed * sections.chord / environment.kinematic_viscosity
    beta = arctan2(-v_b, v_c)
    lift_coefficient, drag_coefficient = polar(beta, reynolds)

    # One power of the normal speed is in the vectors (eqs 23-26).
    q = 0.5 * environment.air_density * normal_speed * sections.area
    along_c = q * (-drag_coefficient * v_c - lift_coefficient * v_b)
    along_b = q * (-drag_coefficient * v_b + lift_coefficient * v_c)
    fold = jnp.where(v_c >= 0, 1.0, -1.0)
    pressure = 0.5 * environment.air_density * normal_speed**2
    return Aerodynamics(
        force=jnp.stack(
            [along_c * c[0] + along_b * b[0], along_c * c[1] + along_b * b[1], along_b * b[2]]
        ),
        lift=pressure * sections.area * fold * lift_coefficient,
        drag=pressure * sections.area * drag_coefficient,
        beta=beta,
        angle_of_attack=arctan2(-v_b, jnp.abs(v_c)),
        sweep_angle=arctan2(
            V[0] * body.tangent[0] + V[1] * body.tangent[1] + V[2] * body.tangent[2],
            normal_speed,
        ),
        reynolds=reynolds,
        dynamic_pressure=pressure,
        lift_coefficient=lift_coefficient,
        drag_coefficient=drag_coefficient,
        speed=speed,
    )
