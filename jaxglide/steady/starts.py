"""Where a search for steady glides may start."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from scipy.stats import qmc

from .._lib.types import Array, Float, Scalar
from ..body.sections import discretise
from ..flight.dynamics import Flight
from .closure import COARSE, Reached, Sought
from .reduced import Reduced, Slopes, flown, rates

PHASES = 12
"""Phases over which the rates are averaged where a search starts."""
_ITERATIONS = 40
_PITCHES = np.deg2rad([-45.0, -10.0, -70.0, 20.0])
_ANGLE_OF_ATTACK = np.deg2rad(35.0)
_SPEED = 1.4  # of the speed that the state is scaled by
_CYCLES = 12  # of the flight whose end is a start
# What a Sobol set spans: speed, path below the horizontal, sideslip, rates of turning, pitch,
# roll; scaled, radians.
_LOW = np.array([0.7, 0.2, -0.3, -0.3, -0.3, -0.3, -1.2, -0.5])
_HIGH = np.array([2.0, 1.4, 0.3, 0.3, 0.3, 0.3, 0.5, 0.5])


def _velocity(speed, slope, sideslip):
    along = speed * np.cos(slope)
    return np.stack(
        [along * np.sin(sideslip), along * np.cos(sideslip), -speed * np.sin(slope)], axis=-1
    )


def guesses() -> np.ndarray:
    """Scaled reduced states of straight flight, nose low and high, (4, 8)."""
    slope = np.clip(_ANGLE_OF_ATTACK - _PITCHES, 0.3, 1.4)
    found = np.zeros((len(_PITCHES), 8))
    found[:, :3] = _velocity(_SPEED, slope, 0 * slope)
    found[:, 6] = _PITCHES
    return found


def sobol(count: int) -> np.ndarray:
    """A Sobol set of scaled reduced states, always the same, (count, 8)."""
    if count == 0:
        return np.zeros((0, 8))
    points = qmc.Sobol(8, rng=0).random(1 << (count - 1).bit_length())[:count]
    drawn = _LOW + points * (_HIGH - _LOW)
    return np.concatenate([_velocity(*drawn[:, :3].T), drawn[:, 3:]], axis=1)


def phases_of(posed: Sought, count: int) -> Float[Array, " P"]:
    """Equally spaced phases of the waves, as they follow in flight; of a frozen body one."""
    count = 1 if posed.kind.frozen else count
    return posed.phase - 2 * jnp.pi * jnp.arange(count) / count  # in flight they fall


def _by_phase(u: Reduced, posed: Sought, phases: Float[Array, " P"]) -> Float[Array, "P 8"]:
    """Scaled rates at phases of the waves, the state held."""
    unit, sections = posed.scales(), discretise(posed.glider.body)

    def at(phase):
        flight = Flight(posed.glider, sections, phase)
        return rates(jnp.zeros_like(u[0]), u * unit, flight) / unit

    return jax.vmap(at)(phases)


def mean_rates(u: Reduced, posed: Sought, phases: Float[Array, " P"]) -> Reduced:
    """Scaled rates of the averaged model [1/s]: means over phases of the waves, (8,)."""
    return jnp.mean(_by_phase(u, posed, phases), axis=0)


def mean_rates_with_slopes(
    u: Reduced, posed: Sought, phases: Float[Array, " P"]
) -> tuple[Reduced, Slopes]:
    """The same, and their derivatives by the scaled state, (8, 8)."""

    def mean(u):
        value = mean_rates(u, posed, phases)
        return value, value

    slopes, value = jax.jacfwd(mean, has_aux=True)(u)
    return value, slopes


@eqx.filter_custom_jvp
def _known_slopes(u, given):
    return mean_rates(u, *given)


@_known_slopes.def_jvp
def _(primals, tangents):
    value, slopes = mean_rates_with_slopes(primals[0], *primals[1])
    return value, slopes @ tangents[0]


def equilibrium(guess: Reduced, posed: Sought, phases: Float[Array, " P"]) -> Reached:
    """A zero of the mean rates near a guess, or where the search for it ends.

    No derivative passes through it.
    """
    found = optx.root_find(
        _known_slopes,
        optx.Dogleg(rtol=0.0, atol=1e-6),
        guess,
        (posed, phases),
        max_steps=_ITERATIONS,
        throw=False,
    )
    taken = found.stats["num_steps"].astype(jnp.int32)
    return Reached(found.value, found.result == optx.RESULTS.successful, taken)


def averaged(guess: Reduced, posed: Sought) -> tuple[Reduced, Scalar]:
    """A steady glide of the averaged model, set back to the phase of the start.

    The eight rates are averaged over the phases of the waves with the state held, and their
    zero is found. About it, the state of the flight swings by the integral of what the
    average leaves out; that of the start is added.

    Args:
        guess: scaled reduced state, (8,).
        posed: what is sought; no derivative passes through it.

    Returns:
        Scaled reduced state, (8,), and the largest scaled mean rate that is left [1/s].
    """
    phases = phases_of(posed, PHASES)
    found = equilibrium(guess, posed, phases).u
    now = _by_phase(found, posed, phases)
    return found + _swing(now, posed.period), jnp.max(jnp.abs(jnp.mean(now, axis=0)))


def _swing(rates: Float[Array, "P 8"], period: Scalar) -> Reduced:
    """What the integral of periodic rates, without their means, is at the first of them."""
    count = rates.shape[0]
    if count == 1:
        return jnp.zeros_like(rates[0])
    waves = jnp.fft.rfft(rates, axis=0)[1 : (count + 1) // 2]  # the highest has no phase
    order = jnp.arange(1, waves.shape[0] + 1)[:, None]
    turning = 2j * jnp.pi * order / period
    return jnp.sum(2 * jnp.real(waves / turning), axis=0) / count


def _settled(start: Reduced, posed: Sought) -> Reduced:
    """Where a flight is after some cycles; its start, if it tumbles out of all bounds."""
    unit, cycle = posed.scales(), posed.cycle(COARSE)
    steps = cycle._replace(steps=cycle.steps * (2 if posed.kind.mirrored else 1))

    def on(_, u):
        return flown(u * unit, posed.period, steps)[0] / unit

    end = jax.lax.fori_loop(0, _CYCLES, on, start)
    return jnp.where(jnp.all(jnp.abs(end) < 10), end, start)


@eqx.filter_jit
def known_starts(posed: Sought) -> Float[Array, "5 8"]:
    """Scaled reduced states, the likeliest first, (5, 8).

    The steady glides of the averaged model, those that are some before what the search for
    them was left with, and the shallowest first; and the end of a flight from the first.

    Args:
        posed: what is sought; no derivative passes through it.
    """
    posed = jax.lax.stop_gradient(posed)
    given = jnp.asarray(guesses(), posed.phase.dtype)
    found, left = jax.vmap(lambda guess: averaged(guess, posed))(given)
    found = jnp.where(jnp.isfinite(found), found, given)
    slope = jnp.arctan2(-found[:, 2], found[:, 1])
    order = jnp.argsort(jnp.where(left < 1e-4, slope, 10.0 + slope))
    found = found[order]
    return jnp.concatenate([found, _settled(found[0], posed)[None]])
