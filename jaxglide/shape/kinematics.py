"""Backbone kinematics and aerofoil frames (eqs 8, 13-15)."""

import equinox as eqx
import jax.numpy as jnp

from .._lib.numerics import once, rows_times, sincos
from .._lib.types import Nodes, Nodes3
from ..body.sections import Sections
from .motion import Bending


class Backbone(eqx.Module):
    """The body in co-moving axes, origin at the centre of mass.

    Attributes:
        position, velocity, acceleration: of the nodes [m, m/s, m/s^2], (3, n), time
            derivatives at fixed arc length.
        tangent: unit tangent, snout to vent, (3, n).
        chord: unit chord direction c, in the body's horizontal plane, (3, n).
        normal: b = t x c, out of the back, (3, n).
        turning, turning_rate: rate of the chord's direction, about z, and the rate of that
            [rad/s, rad/s^2], (n,).
    """

    position: Nodes3
    velocity: Nodes3
    acceleration: Nodes3
    tangent: Nodes3
    chord: Nodes3
    normal: Nodes3
    turning: Nodes
    turning_rate: Nodes


def backbone(sections: Sections, wave: Bending) -> Backbone:
    """Shape and motion of the body that bends so (eqs 8, 13-15), without the integrals."""
    return bent(sections, wave)[0]


def bent(
    sections: Sections, wave: Bending
) -> tuple[Backbone, tuple[Nodes, ...], tuple[Nodes, ...]]:
    """Shape and motion of the body that bends so (eqs 8, 13-15).

    The time derivatives are closed forms. All nine cumulative integrals (three components
    of the tangent and of its two derivatives) are one matrix product.

    Args:
        sections: the body at its nodes.
        wave: bending angles there and their time derivatives.

    Returns:
        The body, and the nine integrands, (n,) each, and integrals: of position, velocity and
        acceleration, component by component.
    """
    sin_t, cos_t = sincos(wave.theta)
    sin_p, cos_p = sincos(wave.psi)
    dt, dp = wave.theta_dot, wave.psi_dot

    # Heading of the tangent's horizontal part, d/dtheta of it, and length's derivatives.
    flat_rate = -sin_p * dp
    flat_second = -cos_p * dp**2 - sin_p * wave.psi_ddot
    turn = once(2 * flat_rate * dt + cos_p * wave.theta_ddot)
    shrink = once(flat_second - cos_p * dt**2)
    tangent = [cos_p * sin_t, -cos_p * cos_t, sin_p]
    integrands = [
        *tangent,
        flat_rate * sin_t + cos_p * dt * cos_t,
        -flat_rate * cos_t + cos_p * dt * sin_t,
        cos_p * dp,
        shrink * sin_t + turn * cos_t,
        -shrink * cos_t + turn * sin_t,
        cos_p * wave.psi_ddot - sin_p * dp**2,
    ]
    integrands = [sections.length * row for row in integrands]  # over s/L
    path = rows_times(integrands, sections.unit_integral)

    # c = z x t/|z x t| and b = t x c (eqs 14-15) in closed form. Where the body bends past
    # the vertical z x t reverses; the chord is carried on instead, as a body carries it.
    zero = jnp.zeros_like(cos_p)
    body = Backbone(
        position=jnp.stack(path[0:3]),
        velocity=jnp.stack(path[3:6]),
        acceleration=jnp.stack(path[6:9]),
        tangent=jnp.stack(tangent),
        chord=jnp.stack([cos_t, sin_t, zero]),
        normal=jnp.stack([-sin_p * sin_t, sin_p * cos_t, cos_p]),
        turning=wave.theta_dot,
        turning_rate=wave.theta_ddot,
    )
    return body, tuple(integrands), path
