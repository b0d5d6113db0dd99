"""How far simulated flights are from measured ones, and its derivatives.

Flights fly on below the ground. A simulation that tumbles is continued by a parabola, so that
the misfit stays smooth. Each flight knows the multipliers and its own corrections only.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.types import Array, Float
from ..flight.dynamics import POSITION, VELOCITY
from ..flight.ends import AngleLimit
from ..flight.glide import simulate
from ..loads.polar import Polar
from .flights import Measured, build_flight

SCALES = ("lift_scale", "drag_scale")
"""What is fitted: multipliers of the force coefficients."""

_TOLERANCE = 1e-6  # of the simulations


class FitPlan(eqx.Module):
    """Which angles are corrected, and their standard deviations [rad]."""

    corrected: tuple[str, ...] = eqx.field(static=True)
    spread: Float[Array, " c"]


class FitData(NamedTuple):
    """What simulations are compared with: flights, times [s] and places from the start [m]."""

    flights: Measured
    times: Float[Array, "N K"]
    places: Float[Array, "N K 3"]


def _apart(logarithms, change, flight: Measured, times, places, plan: FitPlan) -> Array:
    """Of one flight: its path from its start, less the measured one, (3 K,) [m]."""
    by = dict(zip(plan.corrected, change * plan.spread, strict=True))
    flight = replace(flight, **{name: getattr(flight, name) + by[name] for name in by})
    glider, launch = build_flight(flight, Polar.smooth(*jnp.exp(logarithms)), None)
    options: dict[str, Any] = {"rtol": _TOLERANCE, "atol": _TOLERANCE}
    options |= {"ends": AngleLimit(), "max_steps": 4096, "adjoint": diffrax.ForwardMode()}
    glide = simulate(glider, launch, times=times, max_time=times[-1], **options)
    after = jnp.maximum(times - glide.time, 0.0)[:, None]
    fall = jnp.array([0.0, 0.0, -0.5]) * glider.gravity
    state = glide.state
    parabola = state[POSITION] + state[VELOCITY] * after + fall * after**2
    assert glide.states is not None
    flying = jnp.isfinite(glide.states[:, :1])
    path = jnp.where(flying, jnp.where(flying, glide.states, 0.0)[:, POSITION], parabola)
    return (path - jnp.array([0.0, 0.0, 1.0]) * flight.height - places).ravel()


@eqx.filter_jit
def distances(logarithms, changes, data: FitData, plan: FitPlan) -> Array:
    """Of paths from the measured ones [m], (N, 3 K).

    Args:
        logarithms: of the scales, (2,).
        changes: of the angles of each flight [sd], (N, c).
        data, plan: the flights, and what is fixed.
    """
    own = (None, 0, 0, 0, 0, None)
    return jax.vmap(_apart, in_axes=own)(logarithms, changes, *data, plan)


@eqx.filter_jit
def sensitivities(logarithms, changes, data: FitData, plan: FitPlan) -> tuple[Array, Array]:
    """The same, and its derivatives by the logarithms and by each flight's own changes,
    (N, 3 K, 2 + c)."""

    def one(change, flight, times, places):
        def apart(z):
            free = z[: len(SCALES)], z[len(SCALES) :]
            found = _apart(*free, flight, times, places, plan)
            return found, found

        return jax.jacfwd(apart, has_aux=True)(jnp.concatenate([logarithms, change]))

    slopes, found = jax.vmap(one)(changes, *data)
    return found, slopes
