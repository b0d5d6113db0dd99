"""What the equations of motion need of the motion of all nodes, with cheap tangents.

Positions, velocities and accelerations of the nodes are nine integrals along the body: a
product with a matrix, which costs as much as everything else together. Of the tangents,
which are many, only the three rows that make up the velocity are integrated. What is summed
over the nodes needs none: for weights w it is `sum_i w_i d(f M)_i = sum_j (M w)_j df_j`,
and all tangents share M w.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from .._lib.numerics import by_rows, cross, once, over_last, rows_times
from .._lib.types import Array, Nodes, Nodes3, NodesNodes, Vec3
from ..loads.inertia import moment_of, over_nodes, second_moments


class Integrals(NamedTuple):
    """Integrals along the body.

    Attributes:
        integrands: of position, velocity and acceleration, three components each, (n,).
        matrix: the integration, (n, n).
        integrals: the nine products, (n,). Their tangents are ignored here: they follow from
            those of the others.
    """

    integrands: tuple[Nodes, ...]
    matrix: NodesNodes
    integrals: tuple[Nodes, ...]


def _thirds(rows) -> tuple[Nodes3, ...]:
    return tuple(jnp.stack(rows[k : k + 3]) for k in (0, 3, 6))


def _is_zero(tangent) -> bool:
    return isinstance(tangent, SymbolicZero)


def _zero(tangents) -> bool:
    return all(map(_is_zero, jax.tree.leaves(tangents, is_leaf=_is_zero)))


def _filled(tangents):
    """Tangents, zeros written out."""
    return jax.tree.map(
        lambda x: jnp.zeros(x.shape, x.dtype) if _is_zero(x) else x, tangents, is_leaf=_is_zero
    )


def _kept_thirds(tangents) -> tuple[Nodes3, ...]:
    return _thirds([once(row) for row in _filled(tangents)])


def _rates(of: Integrals, rates: Integrals) -> tuple[Nodes, ...]:
    """Tangents of the integrals, (n,) each."""
    primals = of.integrands, of.matrix
    return jax.jvp(rows_times, primals, _filled((rates.integrands, rates.matrix)))[1]


def _velocity(whole, omega, integrals) -> Nodes3:
    position, velocity, _ = _thirds(integrals)
    spin = cross(omega, position)
    return by_rows(lambda whole, *parts: whole + sum(parts), whole, velocity, spin)


@jax.custom_jvp
def node_velocity(of: Integrals, whole: Vec3, omega: Vec3) -> Nodes3:
    """Velocity of the nodes in still air [m/s], (3, n).

    Args:
        of: integrals along the body.
        whole: velocity of the centre of mass in body axes [m/s].
        omega: angular velocity in body axes [rad/s].
    """
    return _velocity(whole, omega, of.integrals)


def _node_velocity_jvp(primals, tangents):
    of, _, omega = primals
    rates, whole_rate, omega_rate = tangents
    parts = [jnp.zeros((3, 1), omega.dtype)]
    if not _zero(rates.matrix):
        position, velocity, _ = _thirds(_rates(of, rates))
        parts += [velocity, cross(omega, position)]
    elif not _zero(rates.integrands[:6]):
        position, velocity, _ = _kept_thirds(rates.integrands)
        moved = by_rows(jnp.add, velocity, cross(omega, position))
        parts.append(jnp.stack([row @ of.matrix for row in moved]))
    if not _zero(omega_rate):
        parts.append(cross(omega_rate, jnp.stack(of.integrals[:3])))
    if not _zero(whole_rate):
        parts.append(whole_rate[:, None])
    zero = jnp.zeros_like(of.integrals[0])
    return node_velocity(*primals), by_rows(lambda *parts: zero + sum(parts), *parts)


node_velocity.defjvp(_node_velocity_jvp, symbolic_zeros=True)


def relative_acceleration(omega: Vec3, integrals: tuple[Nodes, ...]) -> Nodes3:
    """Acceleration of the nodes but for the part due to that of the spin [m/s^2], (3, n).

    r'' + 2 omega x r' + omega x (omega x r), about the centre of mass.
    """
    position, velocity, acceleration = _thirds(integrals)
    doubled = by_rows(lambda v, s: 2 * v + s, velocity, cross(omega, position))
    return by_rows(jnp.add, acceleration, cross(omega, doubled))


def _effective(omega, mass, force, integrals) -> Nodes3:
    """The air's force less that of the elements' inertia [N], (3, n)."""
    return by_rows(
        lambda force, acceleration: force - mass * acceleration,
        force,
        relative_acceleration(omega, integrals),
    )


def _moments(omega, mass, force, integrals) -> tuple[Vec3, tuple[Array, ...]]:
    position = jnp.stack(integrals[:3])
    moment = moment_of(position, _effective(omega, mass, force, integrals))
    return moment, second_moments(mass, position)


@jax.custom_jvp
def moments(
    of: Integrals, omega: Vec3, mass: Nodes, force: Nodes3
) -> tuple[Vec3, tuple[Array, ...]]:
    """Moment of the air's force less that of every element's inertia, and `second_moments`.

    Args:
        of: integrals along the body.
        omega: angular velocity in body axes [rad/s].
        mass: of the elements [kg], (n,).
        force: of the air on them [N], (3, n).
    """
    return _moments(omega, mass, force, of.integrals)


def _moments_jvp(primals, tangents):
    of, *others = primals
    rates, *other_rates = tangents
    omega, mass, force = others
    if not _zero(rates.matrix):
        given = *others, of.integrals
        change = *_filled(other_rates), _rates(of, rates)
        return moments(*primals), jax.jvp(_moments, given, change)[1]
    moved = [k for k in range(3) if not _zero(other_rates[k])]

    def direct(*values):
        given = list(others)
        for k, value in zip(moved, values, strict=True):
            given[k] = value
        return _moments(*given, of.integrals)  # type: ignore

    turn, seconds = jnp.zeros_like(omega), (jnp.zeros_like(omega[0]),) * 6
    if moved:
        given = tuple(others[k] for k in moved), tuple(other_rates[k] for k in moved)
        turn, seconds = jax.jvp(direct, *given)[1]
    if not _zero(rates.integrands):
        position = jnp.stack(of.integrals[:3])
        effective = _effective(omega, mass, force, of.integrals)
        weights = rows_times([*effective, *(mass * position)], of.matrix.T)
        pull, lever = _thirds([*weights, *weights[:3]])[:2]
        dr, dv, da = _kept_thirds(rates.integrands)
        inner = relative_acceleration(omega, (*dr, *dv, *da))
        turn = turn + over_nodes(by_rows(jnp.subtract, cross(dr, pull), cross(lever, inner)))
        (x, y, z), (mx, my, mz) = dr, lever
        pairs = (
            2 * x * mx,
            2 * y * my,
            x * my + y * mx,
            2 * z * mz,
            x * mz + z * mx,
            y * mz + z * my,
        )
        seconds = tuple(s + over_last(p) for s, p in zip(seconds, pairs, strict=True))
    return moments(*primals), (turn, seconds)


moments.defjvp(_moments_jvp, symbolic_zeros=True)
