"""Inertia of the moving body about its centre of mass (floor 2, MODEL section 8)."""

from typing import NamedTuple

import jax.numpy as jnp

from ._numerics import cross
from ._types import Mat3, Nodes, Nodes3, Vec3
from .kinematics import Backbone


class Inertia(NamedTuple):
    """Inertia in body axes.

    Attributes:
        tensor: inertia tensor [kg m^2], (3, 3).
        tensor_rate: its rate at fixed body axes [kg m^2/s], (3, 3).
        momentum: angular momentum of the shape change, sum m r x r' [kg m^2/s], (3,).
        momentum_rate: sum m r x r'' [N m], (3,).
    """

    tensor: Mat3
    tensor_rate: Mat3
    momentum: Vec3
    momentum_rate: Vec3


def inertia_tensor(mass: Nodes, position: Nodes3) -> Mat3:
    """Inertia tensor sum m (|r|^2 1 - r r^T) [kg m^2], (3, 3)."""
    x, y, z = position
    mx, my, mz = mass * x, mass * y, mass * z
    xx, yy, zz = jnp.sum(mx * x), jnp.sum(my * y), jnp.sum(mz * z)
    xy, xz, yz = jnp.sum(mx * y), jnp.sum(mx * z), jnp.sum(my * z)
    return jnp.stack(
        [
            jnp.stack([yy + zz, -xy, -xz]),
            jnp.stack([-xy, xx + zz, -yz]),
            jnp.stack([-xz, -yz, xx + yy]),
        ]
    )


def over_nodes(vectors: Nodes3) -> Vec3:
    """Sum over nodes, (3,); row by row, which XLA fuses with what made the rows."""
    return jnp.stack([jnp.sum(row) for row in vectors])


def moment_of(position: Nodes3, vectors: Nodes3) -> Vec3:
    """Sum over nodes of position x vector, (3,)."""
    return over_nodes(cross(position, vectors))


def angular_momentum(mass: Nodes, body: Backbone) -> Vec3:
    """Angular momentum of the shape change, sum m r x r' [kg m^2/s], (3,)."""
    return moment_of(body.position, mass * body.velocity)


def inertia(mass: Nodes, body: Backbone) -> Inertia:
    """All inertial properties of the body at one instant."""
    r, v = body.position, body.velocity
    outer = (mass * r) @ v.T
    symmetric = outer + outer.T
    return Inertia(
        tensor=inertia_tensor(mass, r),
        tensor_rate=jnp.trace(symmetric) * jnp.eye(3) - symmetric,
        momentum=angular_momentum(mass, body),
        momentum_rate=moment_of(r, mass * body.acceleration),
    )
