"""The body as a surface: cross-sections along a curve.

A surface is a list of stations, each at a place along the body with a width and a height, and
one outline that is stretched to them. The page draws from the same lists and the same rule.
"""

from typing import NamedTuple

import numpy as np

# Outlines across the body as (chordwise, dorsal, belly?), once round; the corners between
# back and belly are there twice, so that light and colour break at them.
_HALF_BACK = [(0.5, 0.0), (0.47, 0.05), (0.36, 0.19), (0.22, 0.31), (0.09, 0.385), (0.0, 0.4)]
_BELLY = [(-0.5, 0.0), (-0.25, 0.0), (0.0, 0.0), (0.25, 0.0), (0.5, 0.0)]
_SINK = 0.15  # how far the belly lies below the nodes, in chords


def _outline() -> np.ndarray:
    back = [*_HALF_BACK, *[(-across, up) for across, up in _HALF_BACK[-2::-1]]]
    rows = [(x, z - _SINK, 0.0) for x, z in back] + [(x, z - _SINK, 1.0) for x, z in _BELLY]
    return np.array(rows)


OUTLINE = _outline()
"""Flattened triangle, one chord wide, flat below: (chordwise, dorsal, belly), (p, 3)."""

_ROUND = np.linspace(0, np.pi, 9)
HEAD_OUTLINE = np.array(
    [(np.cos(a) / 2, np.sin(a) / 2, 0.0) for a in _ROUND]
    + [(-np.cos(a) / 2, -0.6 * np.sin(a) / 2, 1.0) for a in _ROUND[::2]]
)
"""The head's: round above, flatter below, one wide and 0.8 high, (p, 3)."""

_CAP = np.array([0.0, 0.06, 0.2, 0.4, 0.65])  # stations on a rounded end
# The head from snout to neck: place, width, height, the last two in chords at its widest.
_HEAD = np.array(
    [
        (0.0, 0.0, 0.0),
        (0.015, 0.24, 0.22),
        (0.06, 0.44, 0.42),
        (0.16, 0.68, 0.6),
        (0.3, 0.9, 0.8),
        (0.45, 1.14, 0.92),
        (0.6, 1.32, 0.95),
        (0.72, 1.34, 0.9),
        (0.83, 1.2, 0.8),
        (0.93, 0.98, 0.66),
        (1.0, 0.8, 0.5),
    ]
)
_HEAD_LENGTH = 1.3  # of the head of the mass distribution; its end lies inside the neck
_COVER = 0.84  # of the head: up to here it hides the body, whose chord the snout does not have


class Stations(NamedTuple):
    """Where cross-sections stand, and how large they are.

    Attributes:
        segment: node before the station, -1 before the first, (m,).
        within: place between that node and the next, 0 to 1; beyond the ends the distance
            from the last node [m], (m,).
        fraction: place over SVL, (m,).
        width, height: factors of the outline's two directions [m], (m,).
    """

    segment: np.ndarray
    within: np.ndarray
    fraction: np.ndarray
    width: np.ndarray
    height: np.ndarray


def _located(at, fraction, svl: float, width, height) -> Stations:
    """Stations at places `at` over SVL on nodes at `fraction`."""
    last = len(fraction) - 1
    segment = np.searchsorted(fraction, at, side="right") - 1
    inside = np.clip(segment, 0, last - 1)
    within = (at - fraction[inside]) / (fraction[inside + 1] - fraction[inside])
    within = np.where(segment < 0, (fraction[0] - at) * svl, within)
    within = np.where(segment >= last, (at - fraction[-1]) * svl, within)
    return Stations(segment, within, at, width, height)


def body_stations(fraction, chord, svl: float, between: int = 4) -> Stations:
    """The body's, snout to vent: every node, `between` steps from each to the next, and ends.

    Args:
        fraction: nodes' places over SVL, increasing, (n,).
        chord: chords at the nodes [m], (n,): the widths there.
        svl: snout-vent length [m].
        between: steps from a node to the next, at least 1.
    """
    fraction = np.asarray(fraction, float)
    steps = np.linspace(fraction[:-1], fraction[1:], between, endpoint=False, axis=1).ravel()
    along = np.append(steps, fraction[-1])
    end = max(1.0, fraction[-1] + 0.2 * (fraction[-1] - fraction[-2]))
    snout, vent = fraction[0] * _CAP, end - (end - fraction[-1]) * _CAP[::-1]
    at = np.concatenate([snout, along, vent])
    round_end = np.sqrt(1 - (1 - _CAP) ** 2)
    taper = np.concatenate([round_end, np.ones(len(along)), round_end[::-1]])
    width = taper * np.interp(at, fraction, chord)
    return _located(at, fraction, svl, width, width)


def head_stations(fraction, chord, svl: float, head_fraction: float) -> Stations:
    """The head's, over the body's first part: a snake's, wider than the neck.

    None where the head has no length.
    """
    if not head_fraction > 0:
        none = np.zeros(0)
        return Stations(none.astype(int), none, none, none, none)
    fraction = np.asarray(fraction, float)
    at = _HEAD[:, 0] * _HEAD_LENGTH * head_fraction
    size = np.interp(at[7], fraction, chord)
    return _located(at, fraction, svl, _HEAD[:, 1] * size, _HEAD[:, 2] * size)


def covered(head_fraction: float) -> float:
    """Place over SVL up to which the head is drawn and the body's surface is not."""
    return _COVER * _HEAD_LENGTH * head_fraction


def _curve(stations: Stations, nodes, tangent, step):
    """Points of the body's curve at the stations [m], (m, 3): cubic between nodes."""
    last = len(nodes) - 1
    i, u = np.clip(stations.segment, 0, last - 1), stations.within[:, None]
    h = step[i][:, None]
    start, end = h * tangent[i], h * tangent[i + 1]
    a, b = nodes[i], nodes[i + 1]
    cubic = (
        (1 + 2 * u) * (1 - u) ** 2 * a
        + u * (1 - u) ** 2 * start
        + u**2 * (3 - 2 * u) * b
        + u**2 * (u - 1) * end
    )
    before, after = nodes[0] - u * tangent[0], nodes[-1] + u * tangent[-1]
    cubic = np.where(stations.segment[:, None] < 0, before, cubic)
    return np.where(stations.segment[:, None] >= last, after, cubic)


def _between(stations: Stations, vectors):
    """Unit vectors at the stations from those at the nodes, (m, 3)."""
    last = len(vectors) - 1
    i = np.clip(stations.segment, 0, last - 1)
    u = np.clip(stations.within, 0, 1)
    u = np.where(stations.segment < 0, 0.0, np.where(stations.segment >= last, 1.0, u))[:, None]
    mixed = (1 - u) * vectors[i] + u * vectors[i + 1]
    return mixed / np.maximum(np.linalg.norm(mixed, axis=1, keepdims=True), 1e-9)


def loft(stations: Stations, outline, nodes, chordwise, dorsal, step) -> np.ndarray:
    """Points of a surface at one instant.

    Args:
        stations: where and how large, (m,).
        outline: across the body, (p, 3).
        nodes: positions of the nodes [m], (n, 3).
        chordwise, dorsal: unit vectors there, (n, 3).
        step: distances between nodes along the body [m], (n - 1,).

    Returns:
        Points [m], (m, p, 3).
    """
    centre = centreline(stations, nodes, chordwise, dorsal, step)
    across, up = _between(stations, chordwise), _between(stations, dorsal)
    across, up = stations.width[:, None] * across, stations.height[:, None] * up
    return (
        centre[:, None]
        + outline[None, :, :1] * across[:, None]
        + outline[None, :, 1:2] * up[:, None]
    )


def centreline(stations: Stations, nodes, chordwise, dorsal, step) -> np.ndarray:
    """The body's curve at the stations [m], (m, 3); arguments as `loft`."""
    return _curve(stations, nodes, np.cross(chordwise, dorsal), step)
