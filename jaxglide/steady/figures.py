"""The numbers of a steady glide, from its cycle and the derivative of its map."""

import jax.numpy as jnp

from .._lib.types import Array, Float
from ..flight.dynamics import ANGLES, PATH, POSITION
from .closure import Kind, Sought
from .reduced import Reduced, Slopes


def mean_path(states, period, kind: Kind):
    """Forward speed, sink rate and rate of turning of the mean path of a cycle.

    The places at the starts of cycles lie on a helix about the vertical: an arc longer than
    its chord by x/sin x of half the angle turned.
    """
    shift, turn = states[-1, POSITION], states[-1, ANGLES][0]
    sink = -shift[2] / period
    if kind.frozen:  # the path itself is the helix
        return states[-1, PATH] / period, sink, turn / period
    chord = jnp.hypot(shift[0], shift[1])
    if kind.mirrored:
        return chord / period, sink, 0 * turn
    return chord / (jnp.sinc(turn / (2 * jnp.pi)) * period), sink, turn / period


def _spectrum(slopes: Slopes, kind: Kind):
    """Multipliers, the largest first."""
    values = jnp.linalg.eigvals(slopes)
    values = jnp.exp(values) if kind.frozen else values
    return values[jnp.argsort(-jnp.abs(values))]


def figures(
    u: Reduced, posed: Sought, states: Float[Array, "C 13"], slopes: Slopes
) -> dict[str, Array]:
    """Fields of a `SteadyGlide`, by name.

    Args:
        u: scaled reduced state at the start of a cycle, (8,).
        posed: what was sought.
        states: of flight over a cycle, of which the last counts, (C, 13).
        slopes: derivative of the return map by the scaled state (of a frozen body, of the
            rates), (8, 8).
    """
    forward, sink, turn = mean_path(states, posed.period, posed.kind)
    state, multipliers = u * posed.scales(), _spectrum(slopes, posed.kind)
    return {
        "state": state,
        "speed": jnp.sqrt(jnp.sum(state[:3] ** 2)),
        "glide_angle": jnp.arctan2(sink, forward),
        "forward_speed": forward,
        "sink_rate": sink,
        "turn_rate": turn,
        "multipliers": multipliers,
        "spectral_radius": jnp.abs(multipliers[0]),
    }
