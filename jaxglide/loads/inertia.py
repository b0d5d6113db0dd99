"""Inertia of the moving body about its centre of mass (in eqs 16-20).

Every element has its mass on the backbone, as published, or, where the snake has a `gyration`,
in two halves a radius of gyration either side of it, along the chord. The equations of motion
hold for such points too, so that nothing else changes.
"""

from typing import NamedTuple

import jax.numpy as jnp

from .._lib.numerics import cross, over_last
from .._lib.types import Array, Mat3, Nodes, Nodes3, Vec3
from ..body.sections import Sections
from ..shape.kinematics import Backbone


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


def second_moments(mass: Nodes, position: Nodes3) -> tuple[Array, ...]:
    """Sums over nodes of m xx, m yy, m xy, m zz, m xz, m yz [kg m^2]."""
    x, y, z = position
    mx, my, mz = mass * x, mass * y, mass * z
    products = mx * x, my * y, mx * y, mz * z, mx * z, my * z
    return tuple(over_last(product) for product in products)


def tensor_of(sections: Sections, chord: Nodes3, moments: tuple[Array, ...]) -> Mat3:
    """Inertia tensor of `second_moments`, and of what the sections have, (3, 3)."""
    xx, yy, xy, zz, xz, yz = moments
    if sections.axial_inertia is not None:
        c_x, c_y, _ = chord
        across = c_x * c_x, c_y * c_y, c_x * c_y
        more = [over_last(sections.axial_inertia * share) for share in across]
        xx, yy, xy = xx + more[0], yy + more[1], xy + more[2]
    return jnp.stack(
        [
            jnp.stack([yy + zz, -xy, -xz]),
            jnp.stack([-xy, xx + zz, -yz]),
            jnp.stack([-xz, -yz, xx + yy]),
        ]
    )


def inertia_tensor(sections: Sections, body: Backbone) -> Mat3:
    """Inertia tensor sum m (|r|^2 1 - r r^T) [kg m^2], (3, 3)."""
    return tensor_of(sections, body.chord, second_moments(sections.mass, body.position))


def over_nodes(vectors: Nodes3) -> Vec3:
    """Sum over nodes, (3,); row by row."""
    return jnp.stack([over_last(row) for row in vectors])


def moment_of(position: Nodes3, vectors: Nodes3) -> Vec3:
    """Sum over nodes of position x vector, (3,): of forces their moment (eq. 18)."""
    return over_nodes(cross(position, vectors))


def angular_momentum(sections: Sections, body: Backbone) -> Vec3:
    """Angular momentum of the shape change, sum m r x r' [kg m^2/s], (3,) (eq. 19)."""
    momentum = moment_of(body.position, sections.mass * body.velocity)
    if sections.axial_inertia is None:
        return momentum
    return momentum.at[2].add(jnp.sum(sections.axial_inertia * body.turning))


def shape_moment(sections: Sections, body: Backbone) -> Nodes3:
    """Rate of every element's share of that momentum, m r x r'' [N m], (3, n) (eq. 20)."""
    moment = cross(body.position, sections.mass * body.acceleration)
    if sections.axial_inertia is None:
        return moment
    return moment.at[2].add(sections.axial_inertia * body.turning_rate)


def section_moment(sections: Sections, body: Backbone, omega_B: Vec3) -> Vec3:
    """Moment that turning the sections with the body takes [N m], (3,).

    For points at +-d c it is m d^2 c x (c'' + 2 omega x c' + omega x (omega x c)), without
    the term in omega'; c' = w z x c with w the chord's rate of turning.
    """
    assert sections.axial_inertia is not None
    c_x, c_y, _ = body.chord
    about_chord = omega_B[0] * c_x + omega_B[1] * c_y
    tilt = about_chord * (2 * body.turning + omega_B[2])
    turn = body.turning_rate + about_chord * (c_x * omega_B[1] - c_y * omega_B[0])
    return over_nodes(sections.axial_inertia * jnp.stack([tilt * c_y, -tilt * c_x, turn]))


def inertia(sections: Sections, body: Backbone) -> Inertia:
    """All inertial properties of the body at one instant."""
    mass, r, v = sections.mass, body.position, body.velocity
    outer = (mass * r) @ v.T
    if sections.axial_inertia is not None:
        chord_rate = body.turning * cross(jnp.array([0.0, 0.0, 1.0]), body.chord)
        outer = outer + (sections.axial_inertia * body.chord) @ chord_rate.T
    symmetric = outer + outer.T
    return Inertia(
        tensor=inertia_tensor(sections, body),
        tensor_rate=jnp.trace(symmetric) * jnp.eye(3) - symmetric,
        momentum=angular_momentum(sections, body),
        momentum_rate=over_nodes(shape_moment(sections, body)),
    )
