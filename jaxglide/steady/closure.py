"""What a steady glide must fulfil, and the point where it does."""

from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from .._lib.either_mode import either_mode
from .._lib.types import Array, Flag, Float, Integer, Scalar
from ..air.air import AbstractAir, StillAir, UniformWind
from ..body.sections import discretise
from ..flight.dynamics import Flight, Glider
from .reduced import (
    MIRROR,
    MOST_STEPS,
    Reduced,
    ReturnMap,
    Slopes,
    ended,
    flown,
    flown_with_slopes,
    rates,
    reduce,
    scales,
)

LEAST_STEPS = 128
"""Fewest steps of the solver in a cycle."""
MOST_ITERATIONS = 25  # of each stage of a search
NEAR = {8: 1e-9, 4: 1e-4}  # how far from closed is still found, by the size of a float
FORWARD = diffrax.ForwardMode()
COARSE = 0.25  # of the steps, with which a search begins
COARSE_ENOUGH = {8: 1e-7, 4: 1e-3}


class Kind(NamedTuple):
    """Which equation a steady glide fulfils; static.

    Attributes:
        frozen: that eight rates vanish; else that a map comes back.
        mirrored: half a cycle later it is its own mirror image; else it is the same a cycle
            later.
    """

    frozen: bool
    mirrored: bool


def carried(air: AbstractAir) -> StillAir:
    """The air as one sees it that is carried along by it."""
    if not isinstance(air, StillAir | UniformWind):
        raise TypeError(
            f"air must be of type StillAir or UniformWind, not {type(air).__name__}: where the "
            "wind changes from place to place no glide is steady"
        )
    return StillAir(air_density=air.air_density, kinematic_viscosity=air.kinematic_viscosity)


class Sought(eqx.Module):
    """A steady glide to be found.

    Attributes:
        glider: in still air.
        phase: of the waves at the start [rad].
        step: longest step of the solver [s].
        kind: which equation (static).
    """

    glider: Glider
    phase: Scalar
    step: Scalar
    kind: Kind = eqx.field(static=True)

    @property
    def period(self) -> Scalar:
        """Of a cycle [s]; a second where the body is frozen."""
        if self.kind.frozen:
            return jnp.ones_like(self.phase)
        gait: Any = self.glider.gait
        return 1 / gait.f_theta

    @property
    def duration(self) -> Scalar:
        """Of the map [s]."""
        return self.period / 2 if self.kind.mirrored else self.period

    def scales(self) -> Reduced:
        """What its numbers are measured in."""
        return scales(self.glider, discretise(self.glider.body))

    def cycle(self, share: Scalar | float = 1.0) -> ReturnMap:
        """What the map needs, with a share of the solver's steps."""
        flight = Flight(self.glider, discretise(self.glider.body), self.phase)
        parts = 2 if self.kind.mirrored else 1
        steps = jnp.ceil(self.duration / self.step)
        steps = jnp.clip(steps, LEAST_STEPS // parts, MOST_STEPS // parts - 2)
        return ReturnMap(flight, jax.lax.stop_gradient(jnp.ceil(share * steps)))


def missed_with_slopes(
    u: Reduced, posed: Sought, adjoint: diffrax.AbstractAdjoint, share: Scalar | float = 1.0
) -> tuple[Reduced, Slopes]:
    """By how much the map misses its start, and its derivative; both scaled.

    Args:
        u: scaled reduced state at the start, (8,).
        posed: what is sought.
        adjoint: how Diffrax differentiates.
        share: of the solver's steps.

    Returns:
        The miss, (8,), and the derivative of the map (of the rates, where the body is frozen)
        by the scaled state, (8, 8).
    """
    unit, cycle = posed.scales(), posed.cycle(share)
    if posed.kind.frozen:

        def rate(u):
            scaled = rates(jnp.zeros_like(u[0]), u * unit, cycle.flight) / unit
            return scaled, scaled

        slopes, value = jax.jacfwd(rate, has_aux=True)(u)
        return value, slopes
    end, slopes = flown_with_slopes(u * unit, posed.duration, cycle, adjoint)
    if posed.kind.mirrored:
        end, slopes = jnp.asarray(MIRROR * end), jnp.asarray(MIRROR[:, None] * slopes)
    return end / unit - u, jnp.asarray(slopes * unit / unit[:, None])


def _less_one(slopes: Slopes, posed: Sought) -> Slopes:
    """Derivative of the miss, of that of the map."""
    return slopes if posed.kind.frozen else slopes - jnp.eye(len(MIRROR), dtype=slopes.dtype)


@eqx.filter_custom_jvp
def _known_slopes(u, given):
    """`missed`, whose derivative by u the solver need not be asked for once more."""
    posed, share = given
    return missed_with_slopes(u, posed, diffrax.ForwardMode(), share)[0]


@_known_slopes.def_jvp
def _(primals, tangents):
    (u, (posed, share)), along = primals, tangents[0]
    value, slopes = missed_with_slopes(u, posed, diffrax.ForwardMode(), share)
    return value, _less_one(slopes, posed) @ along


class Reached(NamedTuple):
    """Where a search has come to.

    Attributes:
        u: the scaled reduced state, (8,).
        converged: whether the search says so.
        iterations: derivatives of the map that it took.
    """

    u: Reduced
    converged: Flag
    iterations: Integer


def newton(start: Reached, posed: Sought, share, near, most: int = MOST_ITERATIONS) -> Reached:
    """Newton's method, its steps held within a trust region (Optimistix's dogleg).

    Args:
        start: where it begins; one that has not converged is left as it is.
        posed: what is sought.
        share: of the solver's steps.
        near: scaled miss that is near enough.
        most: iterations.
    """
    tolerance: Any = jnp.where(start.converged, near, jnp.inf)
    found = optx.root_find(
        _known_slopes,
        optx.Dogleg(rtol=0.0, atol=tolerance),
        start.u,
        (posed, share),
        max_steps=most,
        throw=False,
    )
    good = start.converged & (found.result == optx.RESULTS.successful)
    taken = start.iterations + found.stats["num_steps"]
    return Reached(found.value, good, taken.astype(jnp.int32))


def begun(u: Reduced) -> Reached:
    """A search that has not moved yet."""
    return Reached(u, jnp.asarray(True), jnp.asarray(0, jnp.int32))


def search(start: Reduced, posed: Sought) -> Reached:
    """Newton's method with a quarter of the solver's steps first, then with all of them.

    No derivative passes through it.

    Args:
        start: scaled reduced state, (8,).
        posed: what is sought.
    """
    start, posed = jax.lax.stop_gradient((start, posed))
    size, dtype = start.dtype.itemsize, start.dtype

    def stage(root: Reached, how):
        return newton(root, posed, *how), None

    shares = jnp.asarray([COARSE, 1.0], dtype)
    near = jnp.asarray([COARSE_ENOUGH[size], NEAR[size]], dtype)
    return jax.lax.scan(stage, begun(start), (shares, near))[0]


def first_found(starts: Float[Array, "K 8"], posed: Sought) -> Reached:
    """Search from one start after the other, until one leads to a steady glide.

    Args:
        starts: scaled reduced states, (K, 8).
        posed: what is sought.
    """

    def unfinished(carry):
        k, root = carry
        return (k < starts.shape[0]) & ~root.converged

    def another(carry):
        k, root = carry
        found = search(starts[k], posed)
        return k + 1, found._replace(iterations=found.iterations + root.iterations)

    none = Reached(starts[0], jnp.asarray(False), jnp.asarray(0, jnp.int32))
    return jax.lax.while_loop(unfinished, another, (jnp.asarray(0), none))[1]


class Orbit(eqx.Module):
    """A cycle flown; of a frozen body, a second.

    Attributes:
        missed: by how much it misses its start, scaled; of a frozen body its scaled rates
            [1/s], (8,).
        states: states of flight through the air at equally spaced times from its start to
            its end (see `dynamics`), from the origin and yaw 0, (C, 13).
    """

    missed: Reduced
    states: Float[Array, "C 13"]


def orbit_of(u, posed: Sought, *, adjoint) -> Orbit:
    unit, cycle = posed.scales(), posed.cycle()
    steps = cycle.steps * (2 if posed.kind.mirrored else 1)  # the same ones, so the same map
    end, states = flown(u * unit, posed.period, cycle._replace(steps=steps), adjoint)
    if posed.kind.frozen:
        return Orbit(rates(jnp.zeros_like(u[0]), u * unit, cycle.flight) / unit, states)
    return Orbit(end / unit - u, states)


def slopes_of(u, posed: Sought, *, adjoint) -> Slopes:
    """Derivative of the return map by the scaled state; of a frozen body, of the rates."""
    slopes = missed_with_slopes(u, posed, adjoint)[1]
    return slopes @ slopes if posed.kind.mirrored else slopes


def missed_of(u, posed: Sought, *, adjoint) -> Reduced:
    """By how much the map misses its start, scaled, (8,); of a frozen body its rates."""
    unit, cycle = posed.scales(), posed.cycle()
    if posed.kind.frozen:
        return rates(jnp.zeros_like(u[0]), u * unit, cycle.flight) / unit
    end = reduce(ended(u * unit, posed.duration, cycle, adjoint))
    return (jnp.asarray(MIRROR * end) if posed.kind.mirrored else end) / unit - u


orbit = eqx.filter_jit(either_mode(orbit_of))
slopes = eqx.filter_jit(either_mode(slopes_of))
missed = eqx.filter_jit(either_mode(missed_of))
_by_state = eqx.filter_jit(
    either_mode(lambda u, posed, *, adjoint: missed_with_slopes(u, posed, adjoint)[1])
)


def refined(u: Reduced, posed: Sought, missed=missed) -> Reduced:
    """The steady glide at a root, with its derivatives by the implicit function theorem.

    One more step of Newton's: what is left of the miss is taken off, and what a change of
    the glider would add to it, -(derivative)^-1 d(miss). Half a cycle is enough where the
    other half is its mirror image.

    Args:
        u: scaled reduced state that a search has come to, (8,).
        posed: what is sought.
        missed: as that of this module, whose derivative works in either mode.
    """
    u, known = jax.lax.stop_gradient((u, posed))
    by_state = _less_one(jax.lax.stop_gradient(_by_state(u, known)), posed)
    return u - jnp.linalg.solve(by_state, missed(u, posed))
