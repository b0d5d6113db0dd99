"""How sure the numbers of a steady glide are: by the coefficients, by nodes and steps."""

import dataclasses
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.report import Report, Reported
from .._lib.types import Array, Float, Scalar
from ..loads.polar import AbstractPolar
from .closure import (
    Sought,
    orbit,
    orbit_of,
    refined,
    search,
    slopes,
    slopes_of,
)
from .figures import figures
from .reduced import Reduced

_TOGETHER = 32  # directions that one solve carries


class Uncertainty(eqx.Module, Reported):
    """By how much the numbers of a steady glide may be off, under their own names.

    Attributes:
        state: (8,).
        speed, forward_speed, sink_rate: [m/s].
        glide_angle: [rad].
        turn_rate: [rad/s].
        moduli: of the multipliers, the largest first, (8,). Where two multipliers meet within
            what they may be off, they have no derivative, and this is NaN.
        spectral_radius: the first of them.
        source: what makes them unsure, in words (static).
    """

    state: Reduced
    speed: Scalar
    glide_angle: Scalar
    forward_speed: Scalar
    sink_rate: Scalar
    turn_rate: Scalar
    moduli: Float[Array, "8"]
    spectral_radius: Scalar
    source: str = eqx.field(static=True)

    def report(self) -> Report:
        moduli = "  ".join(f"{float(value):.2g}" for value in self.moduli)
        rows = (
            ("speed", f"{float(self.speed):.2g} m/s, sinking {float(self.sink_rate):.2g} m/s"),
            ("glide angle", f"{np.rad2deg(float(self.glide_angle)):.2g} deg"),
            ("turn rate", f"{np.rad2deg(float(self.turn_rate)):.2g} deg/s"),
            ("spectral radius", f"{float(self.spectral_radius):.2g}"),
            ("moduli", moduli),
        )
        return Report(f"Uncertainty of a steady glide by {self.source}", rows)


@eqx.filter_jit
def _slopes_by_polar(u: Reduced, posed: Sought, spread: AbstractPolar):
    """Derivatives by the scaled state and along every deviation of the polar, (8 + P, ...).

    Of the miss of a cycle, of its end, and of the derivative of the map. In forward mode: two
    hundred deviations are more than come out, but a solve carries many at once.
    """
    where = lambda posed: posed.glider.aerodynamics.polar  # noqa: E731
    moving, fixed = eqx.partition(where(posed), eqx.is_inexact_array)
    forward = diffrax.ForwardMode()

    def at(u, moving):
        moved = eqx.tree_at(where, posed, eqx.combine(moving, fixed))
        flown = orbit_of(u, moved, adjoint=forward)
        return flown.missed, flown.states[-1], slopes_of(u, moved, adjoint=forward)

    def along(direction):
        return jax.jvp(at, (u, moving), direction)[1]

    count = jax.tree.leaves(spread)[0].shape[0]
    of_state = jnp.concatenate([jnp.eye(8, dtype=u.dtype), jnp.zeros((count, 8), u.dtype)])
    of_polar = jax.tree.map(
        lambda leaf: jnp.concatenate([jnp.zeros((8, *leaf.shape[1:]), leaf.dtype), leaf]),
        eqx.filter(spread, eqx.is_inexact_array),
    )
    return jax.lax.map(along, (of_state, of_polar), batch_size=_TOGETHER)


def by_coefficients(
    u: Reduced, posed: Sought, end: Float[Array, "13"], slopes: Float[Array, "8 8"]
) -> Uncertainty | None:
    """Standard deviations that the coefficients leave, to first order.

    Args:
        u: scaled reduced state of a steady glide, (8,).
        posed: what was sought.
        end: state of flight at the end of a cycle, (13,).
        slopes: derivative of its map.

    Returns:
        None where the polar does not know how sure it is.
    """
    aerodynamics: Any = posed.glider.aerodynamics
    spread = aerodynamics.polar.spread()
    if spread is None:
        return None
    missed, ends, turned = _slopes_by_polar(u, posed, spread)
    # what a deviation adds to the miss, the state takes off: the implicit function theorem
    moved = -np.linalg.solve(np.asarray(missed[:8]).T, np.asarray(missed[8:]).T).T  # (P, 8)
    totals = [jnp.asarray(t[8:] + np.tensordot(moved, t[:8], 1)) for t in (ends, turned)]

    def numbers(u, end, slopes):
        return figures(u, posed, end[None], slopes)

    def along(*directions):
        return jax.jvp(numbers, (u, end, slopes), directions)[1]

    found = numbers(u, end, slopes)
    rates = jax.vmap(along)(jnp.asarray(moved), *totals)
    return Uncertainty(**in_sum(found, rates), source="the coefficients (standard deviations)")


def in_sum(found: dict[str, Any], moved: dict[str, Any]) -> dict[str, Any]:
    """Roots of the sums of squares over deviations, by name.

    Args:
        found: values, multipliers among them.
        moved: their derivatives along the deviations, which come first.
    """
    values, rates = (np.asarray(each["multipliers"]) for each in (found, moved))
    apart = np.abs(values[:, None] - values) + np.diag(np.full(len(values), np.inf))
    off = np.sqrt(np.sum(np.abs(rates) ** 2, axis=0))
    moduli = _deviation(np.real(np.conj(values) * rates) / np.abs(values))
    moduli = np.where(off < np.min(apart, axis=1), moduli, np.nan)
    others = {name: _deviation(rate) for name, rate in moved.items() if name != "multipliers"}
    return others | {"moduli": moduli, "spectral_radius": moduli[0]}


def _deviation(rates) -> np.ndarray:
    return np.sqrt(np.sum(np.square(np.asarray(rates)), axis=0))


_search = eqx.filter_jit(search)
_figures = eqx.filter_jit(figures)


def by_discretisation(u: Reduced, posed: Sought) -> Uncertainty:
    """How far the numbers are from those on twice as many Gauss nodes, by half the step.

    Args:
        u: scaled reduced state of a steady glide, (8,).
        posed: what was sought.

    Raises:
        TypeError: the body has no number of nodes that can be changed.
        ValueError: on the finer nodes there is no such glide.
    """
    body: Any = posed.glider.body
    if not hasattr(body, "nodes"):
        raise TypeError(f"body of type {type(body).__name__} has no other number of nodes")
    spacing = {"spacing": None} if hasattr(body, "spacing") else {}
    finer = dataclasses.replace(body, nodes=2 * body.nodes, node_set="gauss", **spacing)
    glider = dataclasses.replace(posed.glider, body=finer)
    fine = dataclasses.replace(posed, glider=glider, step=posed.step / 2)
    there = _search(u, fine)
    if not bool(there.converged):
        raise ValueError("on twice as many nodes there is no steady glide near this one")
    known = [_numbers(u, posed), _numbers(refined(there.u, fine), fine)]
    off: Any = jax.tree.map(lambda a, b: np.abs(np.asarray(a) - b), *known)
    return Uncertainty(**off, source="nodes and steps (change on twice as many)")


def _numbers(u: Reduced, posed: Sought) -> dict:
    found = dict(_figures(u, posed, orbit(u, posed).states, slopes(u, posed)))
    return found | {"moduli": np.abs(found.pop("multipliers"))}
