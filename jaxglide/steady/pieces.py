"""A cycle in pieces: one point of a branch, and Newton's method that comes back to it."""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib import paths
from .._lib.types import Array, Flag, Float, Integer, Scalar
from ..body.sections import discretise
from ..flight.case import Case
from ..flight.dynamics import Flight, six_degrees_of_freedom
from .closure import Kind
from .reduced import (
    MIRROR,
    SIZE,
    Reduced,
    ReturnMap,
    embed,
    ended,
    ended_with_slopes,
    reduce,
)

MOST_ITERATIONS = 8
CLOSED = {8: 1e-10, 4: 3e-5}  # scaled miss of every piece, by the size of a float
_FARTHEST = 0.5  # that a step of Newton's may go, scaled


class Followed(eqx.Module):
    """A steady glide that depends on one number.

    Attributes:
        case: the glider in still air, and the phase of the waves at the start as
            `launch.phi_theta`; the number in it is 0.
        along: the part that owns the number: its change with the scaled number.
        unit: what the reduced state is measured in all along, (8,).
        span: what the number is measured in, in the unit that people read.
        owner: path of the part, empty for the glider itself (static); what is compiled
            serves all its numbers.
        kind: which equation (static).
        pieces: into how many the time of the map is cut (static).
    """

    case: Case
    along: eqx.Module
    unit: Reduced
    span: Scalar
    owner: str = eqx.field(static=True)
    kind: Kind = eqx.field(static=True)
    pieces: int = eqx.field(static=True)

    @classmethod
    def of(cls, case: Case, path: str, span, unit: Reduced, kind: Kind, pieces: int):
        """The same, of a number by its path in the case."""
        owner = path.rpartition(".")[0]
        none, one = (
            eqx.filter(_part(case.replace({path: value}), owner), eqx.is_inexact_array)
            for value in (0.0, 1.0)
        )
        span = jnp.asarray(span, unit.dtype)
        along = jax.tree.map(lambda a, b: span * (b - a), none, one)
        return cls(case.replace({path: 0.0}), along, unit, span, owner, kind, pieces)

    def at(self, p: Scalar) -> tuple[Flight, Scalar]:
        """What flies, and for how long a piece does [s], where the scaled number is p."""
        part = _part(self.case, self.owner)
        moved = eqx.apply_updates(part, jax.tree.map(lambda leaf: p * leaf, self.along))
        case = eqx.tree_at(lambda case: _part(case, self.owner), self.case, moved)
        glider, phase = case.glider, case.launch.phi_theta
        flight = Flight(glider, discretise(glider.body), phase)
        if self.kind.frozen:
            return flight, jnp.ones_like(p)
        parts = self.pieces * (2 if self.kind.mirrored else 1)
        return flight, 1 / (glider.gait.f_theta * parts)


def _part(case: Case, path: str) -> Any:
    """The part of a case at a path; the glider's own are named without it."""
    if path.split(".")[0] == "launch":
        return case.launch
    return paths.get(case.glider, path) if path else case.glider


class Place(NamedTuple):
    """A point beside or on a branch.

    Attributes:
        u: scaled reduced states at the starts of the pieces, (k, 8).
        p: the scaled number.
    """

    u: Float[Array, "k 8"]
    p: Scalar


class Known(NamedTuple):
    """What is known at a place.

    Attributes:
        missed: by how much every piece misses the start of the next; of a frozen body the
            scaled rates [1/s], (k, 8).
        slopes: derivatives of the scaled ends by the scaled starts, mirrored behind the last
            where the map is; of a frozen body of the rates, (k, 8, 8).
        by_p: derivatives of `missed` by the scaled number, (k, 8).
        ends: states of flight at the ends of the pieces, each from the origin and yaw 0; of
            a frozen body its rates, (k, 13).
    """

    missed: Float[Array, "k 8"]
    slopes: Float[Array, "k 8 8"]
    by_p: Float[Array, "k 8"]
    ends: Float[Array, "k 13"]


def _equilibrium(place: Place, followed: Followed) -> Known:
    unit = followed.unit

    def rate(u, p):
        flight, _ = followed.at(p)
        state = embed(u * unit)
        moving = six_degrees_of_freedom(jnp.zeros_like(p), state, flight)
        scaled = jax.jvp(reduce, (state,), (moving,))[1] / unit
        return scaled, (scaled, moving)

    both, (missed, moving) = jax.jacfwd(rate, (0, 1), has_aux=True)(place.u[0], place.p)
    slopes, by_p = both
    return Known(missed[None], slopes[None], by_p[None], moving[None])


def _pieces(place: Place, followed: Followed, steps: Scalar) -> Known:
    unit, k = followed.unit, followed.pieces
    signs = jnp.ones((k, SIZE), unit.dtype)
    if followed.kind.mirrored:
        signs = signs.at[-1].set(jnp.asarray(MIRROR, unit.dtype))
    part = jnp.pi if followed.kind.mirrored else 2 * jnp.pi
    gone = part / k * jnp.arange(k, dtype=unit.dtype)  # in flight the phase falls

    def piece(u, gone, sign):
        def cycle(p):
            flight, duration = followed.at(p)
            later = flight._replace(phase=flight.phase - gone)
            return duration, ReturnMap(later, steps)

        def end(p):
            return reduce(ended(u * unit, *cycle(p), diffrax.ForwardMode()))

        by_p = jax.jvp(end, (place.p,), (jnp.ones_like(place.p),))[1]
        state, slopes = ended_with_slopes(u * unit, *cycle(place.p), diffrax.ForwardMode())
        slopes = sign[:, None] * slopes * unit / unit[:, None]
        return sign * reduce(state) / unit, slopes, sign * by_p / unit, state

    arrived, slopes, by_p, ends = jax.vmap(piece)(place.u, gone, signs)
    return Known(arrived - jnp.roll(place.u, -1, axis=0), slopes, by_p, ends)


def found_at(place: Place, followed: Followed, steps: Scalar) -> Known:
    """By how much a place misses the branch, and the derivatives of that.

    Args:
        place: where.
        followed: what.
        steps: of the solver in a piece.
    """
    if followed.kind.frozen:
        return _equilibrium(place, followed)
    return _pieces(place, followed, steps)


def _bordered(found: Known, row: Float[Array, " n"], frozen: bool) -> Float[Array, "n n"]:
    """Derivative of the miss by all unknowns, and a last row."""
    k, size = found.missed.shape
    blocks = jnp.zeros((k, size, k, size), row.dtype)
    here = jnp.arange(k)
    blocks = blocks.at[here, :, here, :].add(found.slopes)
    if not frozen:
        blocks = blocks.at[here, :, (here + 1) % k, :].add(-jnp.eye(size, dtype=row.dtype))
    upper = jnp.concatenate([blocks.reshape(k * size, -1), found.by_p.reshape(-1, 1)], axis=1)
    return jnp.concatenate([upper, row[None]])


def _flat(place: Place) -> Float[Array, " n"]:
    return jnp.concatenate([place.u.ravel(), place.p[None]])


def _placed(flat: Float[Array, " n"], pieces: int) -> Place:
    return Place(flat[:-1].reshape(pieces, SIZE), flat[-1])


class Corrected(NamedTuple):
    """Where Newton's method has come to.

    Attributes:
        place: the point of the branch.
        found: what is known there.
        tangent: of the branch, of length 1 by `length`, along the one given.
        good: whether it is on the branch.
        iterations: derivatives of the map that it took.
    """

    place: Place
    found: Known
    tangent: Place
    good: Flag
    iterations: Integer


def weights(pieces: int) -> Float[Array, " n"]:
    """Of the squares of the unknowns in a length along the branch, (8k + 1,).

    The mean over the pieces of the squares of the scaled states, and that of the number.
    """
    return jnp.concatenate([jnp.full(SIZE * pieces, 1 / pieces), jnp.ones(1)])


@eqx.filter_jit
def corrected(
    guess: Place, along: Place, held: Flag, followed: Followed, steps: Scalar
) -> Corrected:
    """The point of the branch across from a guess, or with its number where that is held.

    Newton's method on the closure of all pieces and one more equation. The derivative at the
    point that it ends in is the one that gives the tangent and the multipliers.

    Args:
        guess: where it starts.
        along: tangent; the step is across it.
        held: whether the number is held instead.
        followed: what.
        steps: of the solver in a piece.
    """
    start, k = _flat(guess), followed.pieces
    weighed = weights(k).astype(start.dtype) * _flat(along)
    number = jnp.zeros_like(start).at[-1].set(1.0)
    row = jnp.where(held, number, weighed)
    near = CLOSED[start.dtype.itemsize]

    def step(carry):
        flat, _, count, _, _ = carry
        found = found_at(_placed(flat, k), followed, steps)
        left = jnp.concatenate([found.missed.ravel(), jnp.dot(row, flat - start)[None]])
        change = jnp.linalg.solve(_bordered(found, row, followed.kind.frozen), -left)
        good = jnp.max(jnp.abs(left)) < near
        lost = ~(jnp.max(jnp.abs(change)) < _FARTHEST) & ~good
        flat = jnp.where(good | lost, flat, flat + change)
        return flat, found, count + 1, good, lost

    def unfinished(carry):
        _, _, count, good, lost = carry
        return (count < MOST_ITERATIONS) & ~good & ~lost

    nothing = jax.eval_shape(lambda: found_at(guess, followed, steps))
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), nothing)
    no = jnp.asarray(False)
    begin = (start, nothing, jnp.asarray(0, jnp.int32), no, no)
    flat, found, count, good, _ = jax.lax.while_loop(unfinished, step, begin)
    matrix = _bordered(found, weighed, followed.kind.frozen)
    tangent = jnp.linalg.solve(matrix, number)
    size = jnp.sqrt(jnp.sum(weights(k).astype(start.dtype) * tangent**2))
    return Corrected(_placed(flat, k), found, _placed(tangent / size, k), good, count)
