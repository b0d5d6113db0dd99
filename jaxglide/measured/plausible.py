"""What a recording of a flight can hold: spikes, lost markers and wrong axes are refused.

The bounds leave room for every recording of the published study, whose neighbouring markers
are up to 0.24 SVL farther apart than the tape between them, whose markers move at up to
19 m/s from one frame to the next and are never twice at exactly the same place, and whose
flights fall 5 to 8 m at 6 to 7 m/s, up to 53 degrees to the left or right of forward.
"""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .recording import Recording

FARTHEST = 100.0
"""Farthest that a marker can be from the origin, along any axis [m]."""
SLACK = 1 / 3
"""By how much two neighbours can be farther apart than the tape between them, and by how
much a marker can be misplaced between two frames, over SVL."""
FASTEST = 40.0
"""Highest speed of a marker from one frame to the next [m/s]."""
STILL = 0.03
"""Longest time at exactly the same place [s]: in free fall a marker that turns there leaves
the millimetre to which its place may be rounded."""
SPIKES = {1: 0.145, 2: 0.17}
"""How far a marker can be from the middle of its places some frames before and after, over
SVL, by that number of frames; 0.070 and 0.084 in the study's recordings."""
SPEEDS = (0.5, 30.0)
"""Lowest and highest mean speed of a flight [m/s]."""
BACKWARDS = 0.5
"""How far a flight can end above, behind or, past `HEADING`, beside its start [m]."""
HEADING = 70.0
"""Largest angle of a flight to the left or right of forward [deg]."""

_AXES = "x must point to the right, y forward, z up"


def problem(recording: "Recording") -> str | None:
    """What cannot be in a recording, in words, with frame and marker; None if all can."""
    for check in (_zeros, _far, _still, _chords, _jumps, _spikes, _flight):
        if found := check(recording):
            return found
    return None


def _marker(recording: "Recording", marker: int) -> str:
    first, _, last = recording.columns[3 * marker : 3 * marker + 3]
    return f"marker {marker + 1} (columns {first!r} to {last!r})"


def _length(recording: "Recording", metres: float) -> str:
    return f"{metres / recording.scale:.5g} {recording.unit}"


def _zeros(recording: "Recording") -> str | None:
    lost = np.argwhere((recording.markers == 0).all(axis=-1))
    if not lost.size:
        return None
    frame, marker = lost[0]
    return (
        f"{_marker(recording, marker)} is at exactly 0, 0, 0 in frame {frame + 1}, as some "
        "programs write a marker that was not seen: leave it empty or write NA"
    )


def _far(recording: "Recording") -> str | None:
    far = np.argwhere(np.abs(recording.markers) > FARTHEST)
    if not far.size:
        return None
    frame, marker, axis = far[0]
    where = float(recording.markers[frame, marker, axis])
    return (
        f"column {recording.columns[3 * marker + axis]!r} is {_length(recording, where)} in "
        f"frame {frame + 1} (marker {marker + 1}); positions in a flight are within "
        f"{_length(recording, FARTHEST)}, nothing or NA where a marker was not seen"
    )


def _still(recording: "Recording") -> str | None:
    """Whether a tracker wrote the last place of a marker on and on."""
    for marker, places in enumerate(recording.markers.swapaxes(0, 1)):
        seen = np.flatnonzero(np.isfinite(places).all(axis=-1))
        if not seen.size:
            continue
        moves = np.diff(places[seen], axis=0).any(axis=-1)
        bounds = np.concatenate([[0], np.flatnonzero(moves) + 1, [len(seen)]])
        first, last = seen[bounds[:-1]], seen[bounds[1:] - 1]
        worst = int(np.argmax(last - first))
        if last[worst] - first[worst] > STILL * recording.rate:
            return (
                f"{_marker(recording, marker)} is at exactly the same place from frame "
                f"{first[worst] + 1} to frame {last[worst] + 1}, as some programs write a "
                "marker that was lost: leave it empty or write NA"
            )
    return None


def _chords(recording: "Recording") -> str | None:
    markers, body = recording.markers, recording.body
    apart = np.linalg.norm(np.diff(markers, axis=1), axis=-1)
    bound = body.tape + SLACK * body.svl
    long = np.argwhere(apart > bound)
    if not long.size:
        return None
    frame, pair = long[0]
    centre = np.nanmedian(markers[frame], axis=0)
    off = np.linalg.norm(markers[frame, pair : pair + 2] - centre, axis=1)
    marker = pair + int(np.argmax(off))
    return (
        f"{_marker(recording, marker)} in frame {frame + 1}: markers {pair + 1} and {pair + 2} "
        f"are {_length(recording, float(apart[frame, pair]))} apart, where the tape allows "
        f"{_length(recording, float(bound[pair]))}"
    )


def _jumps(recording: "Recording") -> str | None:
    for marker, places in enumerate(recording.markers.swapaxes(0, 1)):
        seen = np.flatnonzero(np.isfinite(places).all(axis=-1))
        moved = np.linalg.norm(np.diff(places[seen], axis=0), axis=-1)
        bound = FASTEST * np.diff(seen) / recording.rate + SLACK * recording.body.svl
        if (moved > bound).any():
            worst = int(np.argmax(moved - bound))
            return (
                f"{_marker(recording, marker)} moves {_length(recording, moved[worst])} from "
                f"frame {seen[worst] + 1} to frame {seen[worst + 1] + 1}, more than "
                f"{_length(recording, bound[worst])}"
            )
    return None


def _spikes(recording: "Recording") -> str | None:
    markers = recording.markers
    for step, share in SPIKES.items():
        middle = (markers[: -2 * step] + markers[2 * step :]) / 2
        off = np.nan_to_num(np.linalg.norm(markers[step:-step] - middle, axis=-1))
        bound = share * recording.body.svl
        if off.max(initial=0) > bound:
            before, marker = np.unravel_index(np.argmax(off), off.shape)
            return (
                f"{_marker(recording, int(marker))} in frame {before + step + 1} is "
                f"{_length(recording, off[before, marker])} from the middle of its places in "
                f"frames {before + 1} and {before + 2 * step + 1}, more than "
                f"{_length(recording, bound)}"
            )
    return None


def _flight(recording: "Recording") -> str | None:
    """Whether the body falls forward, at the speed of a flight."""
    whole = np.flatnonzero(np.isfinite(recording.markers).all(axis=(1, 2)))
    if whole.size < 2:
        return None
    first, last = whole[0], whole[-1]
    way = (recording.markers[last] - recording.markers[first]).mean(axis=0)
    speed = float(np.linalg.norm(way)) * recording.rate / (last - first)
    between = f"from frame {first + 1} to frame {last + 1}"
    if not SPEEDS[0] <= speed <= SPEEDS[1]:
        rest = "the body is at rest: " if speed < SPEEDS[0] / 10 else ""
        return (
            f"{rest}the markers move at {speed:.3g} m/s {between}, where a flight has "
            f"{SPEEDS[0]:g} to {SPEEDS[1]:g} m/s: check the unit of the times"
        )
    x, y, z = recording.columns[:3]
    for column, moved, wrong in ((y, -way[1], "backwards"), (z, way[2], "upwards")):
        if moved > BACKWARDS:
            return (
                f"the body moves {_length(recording, moved)} {wrong} {between} by columns such "
                f"as {column!r}: {_AXES}"
            )
    heading = float(np.rad2deg(np.arctan2(abs(way[0]), way[1])))
    if abs(way[0]) > BACKWARDS and heading > HEADING:
        side = "right" if way[0] > 0 else "left"
        return (
            f"the body moves {_length(recording, abs(way[0]))} to the {side} {between} by "
            f"columns such as {x!r}, {heading:.3g} degrees off forward, where a flight has "
            f"{HEADING:g} at most: {_AXES}"
        )
    return None
