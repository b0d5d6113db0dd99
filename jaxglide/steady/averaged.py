"""`averaged_glide`: the steady glide of the rates averaged over the waves."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy.linalg as jsl

from .._lib.checks import check_range, number
from .._lib.types import Array, Float
from ..body.sections import discretise
from ..flight.dynamics import ANGLES, Flight, Glider, six_degrees_of_freedom
from .closure import NEAR, Sought
from .figures import figures
from .glide import STEP, sought
from .reduced import COMPONENTS, SAMPLES, Reduced, embed
from .result import Reason, SteadyGlide
from .starts import equilibrium, guesses, mean_rates_with_slopes, phases_of

PHASES = 64
"""Phases of the waves over which the rates are averaged."""


def _path(state: Reduced, posed: Sought) -> Float[Array, "C 13"]:
    """States of flight over a cycle on which the reduced state stays what it is."""
    flight = Flight(posed.glider, discretise(posed.glider.body), posed.phase)
    start = embed(state)
    turning = six_degrees_of_freedom(jnp.zeros_like(posed.phase), start, flight)[ANGLES][0]
    right, forward, up = state[:3]

    def at(t):
        yaw = turning * t
        along = t * jnp.sinc(yaw / jnp.pi)  # integrals of the yaw's cosine and sine
        across = t * yaw / 2 * jnp.sinc(yaw / (2 * jnp.pi)) ** 2
        place = right * along - forward * across, right * across + forward * along, up * t
        s, c = jnp.sin(yaw), jnp.cos(yaw)
        velocity = right * c - forward * s, right * s + forward * c, up
        way = jnp.hypot(right, forward) * t
        return jnp.stack([*place, *velocity, *state[3:6], yaw, *state[6:], way])

    return jax.vmap(at)(jnp.linspace(0.0, 1.0, SAMPLES + 1) * posed.period)


@eqx.filter_jit
def _glide(glider: Glider, posed: Sought, starts: Float[Array, "K 8"]) -> SteadyGlide:
    """The shallowest of what is found from the starts."""
    phases = phases_of(posed, PHASES)
    known = jax.lax.stop_gradient((posed, phases))
    ends = jax.vmap(lambda start: equilibrium(start, *known))(starts)
    upright = jnp.abs(ends.u[:, 6]) < jnp.pi / 2
    slope = jnp.arctan2(-ends.u[:, 2], jnp.hypot(ends.u[:, 0], ends.u[:, 1]))
    best = jnp.argmin(jnp.where(ends.converged & upright, slope, jnp.inf))

    def newton(u, _):  # the last of them carries the derivatives of what it starts from
        value, slopes = mean_rates_with_slopes(u, posed, phases)
        return u - jnp.linalg.solve(slopes, value), (u, value, slopes)

    start = jax.lax.stop_gradient(ends.u[best])
    _, steps = jax.lax.scan(newton, start, None, length=3)
    u, left, slopes = jax.tree.map(lambda step: step[-1], steps)
    of_cycle = jsl.expm(slopes * posed.period)
    residual = jnp.max(jnp.abs(left))
    reason = jnp.where(upright[best], Reason.FOUND, Reason.UPENDED)
    closed = ends.converged[best] & (residual < NEAR[u.dtype.itemsize])
    reason = jnp.where(closed, reason, Reason.NOT_CONVERGED).astype(jnp.int32)
    found = reason == Reason.FOUND
    states = _path(u * posed.scales(), posed)
    safe = jnp.where(found, of_cycle, jnp.eye(len(COMPONENTS), dtype=u.dtype))
    numbers = figures(u, posed, states, safe) | {"slopes": of_cycle, "states": states}
    masked: dict[str, Any] = {
        name: jnp.where(found, value, jnp.nan) for name, value in numbers.items()
    }
    given: dict[str, Any] = {"iterations": ends.iterations[best], "residual": residual}
    given |= {"period": posed.period, "step": posed.step, "frozen": False, "averaged": True}
    return SteadyGlide(glider, posed.phase, found, reason, **given, **masked)


def averaged_glide(glider: Glider, guess=None) -> SteadyGlide:
    """The steady glide that a gait would have if only the mean of its waves counted.

    The eight rates of the reduced state are averaged over the phases of the waves with the
    state held, and their zero is found: an equilibrium of an autonomous model. Its multipliers
    are exp(eigenvalue period), of the mean rates' derivative. Beside `steady_glide` it shows
    what of a glide and of its stability the waves make by themselves.

    Pure, as `steady_glide` is. `uncertainty` and `discretisation` it has none, and `fly` flies
    the full model from its state.

    Args:
        glider: as in `steady_glide`, undulating.
        guess: mean state (see `SteadyGlide.state`), (8,); by default the shallowest is taken
            of those found from four straight descents.

    Raises:
        TypeError, ValueError: as in `steady_glide`; f_theta = 0 has nothing to average.

    Examples:
        >>> from jaxglide import Gait, Glider, Polar, Snake, averaged_glide
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glide = averaged_glide(Glider(body, Gait.from_degrees(), Polar.band_limited()))
        >>> print(f"{glide.speed:.2f} m/s, spectral radius {glide.spectral_radius:.1f}")
        9.02 m/s, spectral radius 1.9
    """
    posed = sought(glider, 0.0, STEP)
    if posed.kind.frozen:
        raise ValueError("f_theta = 0 Hz is not allowed: a frozen body has nothing to average")
    if guess is None:
        return _glide(glider, posed, jnp.asarray(guesses(), posed.phase.dtype))
    guess = number("guess")(guess)
    check_range("guess", guess, "", shape=(len(COMPONENTS),))
    return _glide(glider, posed, (guess / posed.scales())[None])
