"""`steady_glide`: the periodic flight that a gait would settle into, and its stability."""

import dataclasses
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_integer, check_range, is_traced, number
from .._lib.types import Array, Float
from ..flight.dynamics import ANGLES, Glider, check_glider
from ..loads.aerodynamics import AbstractAerodynamics
from ..shape.gait import Gait
from .closure import (
    FORWARD,
    NEAR,
    Kind,
    Reached,
    Sought,
    carried,
    first_found,
    missed_of,
    orbit,
    orbit_of,
    refined,
    search,
    slopes,
    slopes_of,
)
from .figures import figures
from .reduced import COMPONENTS
from .result import Reason, SteadyGlide
from .starts import known_starts, sobol

STEP = 1 / 300
"""Longest step of the solver by default [s]."""


@eqx.filter_jit
def _glide(glider, posed: Sought, root: Reached, u, flown, slopes) -> SteadyGlide:
    """The result of a search that has come to `u`."""
    kind, period = posed.kind, posed.period
    residual = jnp.max(jnp.abs(flown.missed))
    upended = jnp.any(jnp.abs(flown.states[:, ANGLES][:, 1]) >= jnp.pi / 2)
    closed = residual < NEAR[u.dtype.itemsize]
    reason = jnp.where(upended, Reason.UPENDED, Reason.FOUND)
    reason = jnp.where(closed, reason, Reason.NOT_CLOSED)
    reason = jnp.where(root.converged, reason, Reason.NOT_CONVERGED).astype(jnp.int32)
    found = reason == Reason.FOUND
    safe = jnp.where(found, slopes, jnp.eye(u.shape[0], dtype=u.dtype))
    known = figures(u, posed, flown.states, safe) | {"slopes": slopes, "states": flown.states}
    masked: dict[str, Any] = {
        name: jnp.where(found, value, jnp.nan) for name, value in known.items()
    }
    search: dict[str, Any] = {"residual": residual, "iterations": root.iterations}
    given: dict[str, Any] = {"period": period, "step": posed.step, "frozen": kind.frozen}
    return SteadyGlide(glider, posed.phase, found, reason, **search, **given, **masked)


def finished(glider, posed: Sought, root: Reached) -> SteadyGlide:
    """The steady glide at what a search has come to, with its derivatives."""
    u = refined(root.u, posed)
    return _glide(glider, posed, root, u, orbit(u, posed), slopes(u, posed))


def at_root(glider: Glider, u, kind: Kind, step: float) -> SteadyGlide:
    """The steady glide at a root that is known, with its derivatives in forward mode alone.

    Only what is asked for is carried along: cheaper than `finished` for a few parameters.

    Args:
        glider: as in `steady_glide`.
        u: scaled reduced state, (8,), or NaN where there is none.
        kind: which equation it fulfils.
        step: longest step of the solver [s].
    """
    u, dtype = jax.lax.stop_gradient(u), u.dtype
    still = dataclasses.replace(glider, air=carried(glider.air))
    posed = Sought(still, jnp.zeros((), dtype), jnp.asarray(step, dtype), kind)
    flown, sloping = partial(orbit_of, adjoint=FORWARD), partial(slopes_of, adjoint=FORWARD)
    u = refined(u, posed, partial(missed_of, adjoint=FORWARD))
    root = Reached(u, jnp.all(jnp.isfinite(u)), jnp.asarray(0, jnp.int32))
    return _glide(glider, posed, root, u, flown(u, posed), sloping(u, posed))


_first_found = eqx.filter_jit(first_found)
_search_all = eqx.filter_jit(jax.vmap(search, (0, None)))


def _starts(posed: Sought, more: int) -> Float[Array, "K 8"]:
    """Where searches start, the likeliest first."""
    return jnp.concatenate([known_starts(posed), jnp.asarray(sobol(more), posed.phase.dtype)])


def sought(glider: Glider, phase, step) -> Sought:
    """A steady glide to be found, checked."""
    check_glider(glider)
    gait, aerodynamics = glider.gait, glider.aerodynamics
    if not isinstance(gait, Gait):
        raise TypeError(f"gait must be of type Gait, whose cycle is known, not {_kind(gait)}")
    if type(aerodynamics).start is not AbstractAerodynamics.start:
        raise TypeError(
            f"aerodynamics of type {_kind(aerodynamics)} have states of their own, which a "
            "steady glide does not have: take SweepTheory"
        )
    check_range("phase", phase, "rad", -1e6, 1e6, shape=())
    check_range("step", step, "s", 1e-5, 0.05, shape=())
    frozen = not is_traced(gait.f_theta) and float(gait.f_theta) == 0
    mirrored = not frozen and not is_traced(gait.d_theta) and float(gait.d_theta) == 0
    still = dataclasses.replace(glider, air=carried(glider.air))
    dtype = gait.theta_m.dtype
    given = jnp.asarray(phase, dtype), jnp.asarray(step, dtype)
    return Sought(still, *given, Kind(frozen, mirrored))


def _kind(part) -> str:
    return type(part).__name__


def steady_glide(
    glider: Glider,
    guess=None,
    *,
    phase: float = 0.0,
    step: float = STEP,
    starts: int = 4,
) -> SteadyGlide:
    """A steady glide of a gait: a flight that repeats itself, and its stability.

    Newton's method on the map from one cycle to the next, with exact derivatives: on half a
    cycle and its mirror image where the gait is its own (d_theta = 0), on the eight rates
    where the body is frozen (f_theta = 0). Without a guess it is sought from the steady
    glides of the averaged model, from the end of a flight of twelve cycles, and from a Sobol
    set, one after the other until one is found. A gait may have others: see `steady_glides`.

    Pure: `jit`, `vmap`, `grad`, `jacfwd` apply, with respect to every float in `glider`, by
    the implicit function theorem. Where two multipliers meet, they have no derivative. Inside
    `vmap`, and where they are differentiated with respect to, f_theta must not be 0, and
    d_theta costs the mirror: the whole cycle is solved.

    Args:
        glider: what glides: a `Gait` in still air or a uniform wind.
        guess: state at the start of a cycle (see `SteadyGlide.state`), (8,).
        phase: of the waves at the start of a cycle [rad].
        step: longest step of the solver [s], 1e-5 to 0.05; a cycle has at least 128.
        starts: points of the Sobol set, 0 to 4096.

    Raises:
        TypeError: a part of the glider has states of its own, no cycle, or a wind that
            changes.
        ValueError: an argument is not finite, out of range or of the wrong shape.

    Examples:
        >>> from jaxglide import Gait, Glider, Polar, Snake, steady_glide
        >>> body = Snake.from_svl(0.70, nodes=60, node_set="gauss")
        >>> glide = steady_glide(Glider(body, Gait.from_degrees(), Polar.smooth()))
        >>> print(f"{glide.speed:.2f} m/s, spectral radius {glide.spectral_radius:.1f}")
        11.55 m/s, spectral radius 6.9
    """
    posed = sought(glider, phase, step)
    check_integer("starts", starts, 0, 4096)
    known = jax.lax.stop_gradient(posed)
    if guess is None:
        tried = _starts(known, starts)
    else:
        guess = number("guess")(guess)
        check_range("guess", guess, "", shape=(len(COMPONENTS),))
        tried = (guess / known.scales())[None]
    return finished(glider, posed, _first_found(jax.lax.stop_gradient(tried), known))


def steady_glides(
    glider: Glider,
    *,
    starts: int = 16,
    phase: float = 0.0,
    step: float = STEP,
    apart: float = 1e-5,
) -> tuple[SteadyGlide, ...]:
    """All steady glides of a gait that a search finds, the shallowest first.

    From every start of `steady_glide`, as one batch. It cannot promise that there are no
    more.

    Args:
        glider, phase, step: as in `steady_glide`.
        starts: points of the Sobol set, 0 to 4096.
        apart: scaled distance from which two are different.

    Raises:
        TypeError, ValueError: as in `steady_glide`.
    """
    posed = sought(glider, phase, step)
    check_integer("starts", starts, 0, 4096)
    check_range("apart", apart, "", 0, 1, low_open=True, shape=())
    roots = _search_all(_starts(posed, starts), posed)
    kept: list[np.ndarray] = []
    found: list[SteadyGlide] = []
    for k in np.flatnonzero(np.asarray(roots.converged)):
        root = jax.tree.map(lambda leaf, k=k: leaf[k], roots)
        here = np.asarray(root.u)
        if any(np.max(np.abs(here - other)) < apart for other in kept):
            continue
        kept.append(here)
        glide = finished(glider, posed, root)
        if bool(glide.found):
            found.append(glide)
    return tuple(sorted(found, key=lambda glide: float(glide.glide_angle)))
