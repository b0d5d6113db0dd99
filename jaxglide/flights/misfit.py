"""The misfit of simulated flights from measured ones, and its least squares.

Flights fly on below the ground. A simulation that tumbles is continued by a parabola, so that
the misfit stays smooth.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from .._lib.either_mode import either_mode
from .._lib.types import Array, Float
from ..flight.dynamics import POSITION, VELOCITY
from ..flight.ends import AngleLimit
from ..flight.glide import simulate
from ..loads.polar import Polar
from .flights import Measured, build_flight

SCALES = ("lift_scale", "drag_scale")
"""What is fitted: multipliers of the force coefficients."""

_TOLERANCE = 1e-6  # of the simulations
_STEPS = 60  # most of one fit


class FitPlan(eqx.Module):
    """What is part of the compiled function: angles corrected, and longest window [s]."""

    corrected: tuple[str, ...] = eqx.field(static=True)
    longest: float = eqx.field(static=True)


class FitData(NamedTuple):
    """What a fit is made to: flights, times [s] and places from the start [m], weights."""

    flights: Measured
    times: Float[Array, "N K"]
    places: Float[Array, "N K 3"]
    weights: Float[Array, " N"]
    spread: Float[Array, " c"]


def _flown(scales, change, flight: Measured, times, *, adjoint, plan) -> Array:
    """Path of one flight from its start at the times, (K, 3) [m]."""
    moved = {name: getattr(flight, name) + change[k] for k, name in enumerate(plan.corrected)}
    flight = replace(flight, **moved)
    glider, launch = build_flight(flight, Polar.smooth(*scales), None)
    options: dict[str, Any] = {"rtol": _TOLERANCE, "atol": _TOLERANCE, "adjoint": adjoint}
    options |= {"ends": AngleLimit(), "max_steps": 4096}
    glide = simulate(glider, launch, times=times, max_time=plan.longest, **options)
    after = jnp.maximum(times - glide.time, 0.0)[:, None]
    fall = jnp.array([0.0, 0.0, -0.5]) * glider.gravity
    state = glide.state
    parabola = state[POSITION] + state[VELOCITY] * after + fall * after**2
    assert glide.states is not None
    flying = jnp.isfinite(glide.states[:, :1])
    path = jnp.where(flying, jnp.where(flying, glide.states, 0.0)[:, POSITION], parabola)
    return path - jnp.array([0.0, 0.0, 1.0]) * flight.height


_fly_to_times = either_mode(_flown)


def _paths(y, data: FitData, plan: FitPlan):
    """Paths of all flights, (N, K, 3), for logarithms of scales, and changes [sd]."""
    scales, changes = y

    def one(change, flight, times):
        change = change * data.spread
        return _fly_to_times(jnp.exp(scales), change, flight, times, plan=plan)

    return jax.vmap(one)(changes, data.flights, data.times)


def _residuals(y, args):
    """Misfit of all flights over root of their number, and changes over their sd."""
    data, plan = args
    count = data.weights.sum()
    apart = (_paths(y, data, plan) - data.places) / jnp.sqrt(data.times.shape[1] * count)
    apart = jnp.sqrt(data.weights)[:, None, None] * apart
    return apart, y[1]


@eqx.filter_jit
def solve(start, data: FitData, plan: FitPlan, prior):
    """One fit from one start."""

    def weighed(y, args):
        apart, change = _residuals(y, args)
        return apart, change * prior

    solution = optx.least_squares(
        weighed,
        optx.LevenbergMarquardt(rtol=1e-3, atol=1e-5),
        start,
        args=(data, plan),
        max_steps=_STEPS,
        throw=False,
    )
    apart = _residuals(solution.value, (data, plan))[0]
    done = solution.result == optx.RESULTS.successful
    return solution.value, jnp.sum(apart**2), solution.stats["num_steps"], done


@eqx.filter_jit
def sensitivities(y, data: FitData, plan: FitPlan):
    """Misfits, (N, 3 K), and their derivatives by the logarithms of the scales and by each
    flight's own changes [sd], (N, 3 K, 2 + c)."""
    scales, changes = y

    def one(change, flight, times, places):
        def apart(z):
            scales, change = jnp.split(z, [len(SCALES)])
            change = change * data.spread
            found = _fly_to_times(jnp.exp(scales), change, flight, times, plan=plan) - places
            return found.ravel(), found.ravel()

        return jax.jacfwd(apart, has_aux=True)(jnp.concatenate([scales, change]))

    slopes, found = jax.vmap(one)(changes, data.flights, data.times, data.places)
    return found, slopes
