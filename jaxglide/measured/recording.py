"""A recording of markers on a body, and the checks that every recording must pass."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

MINIMUM_MARKERS = 5
MINIMUM_FRAMES = 30


class RecordingError(ValueError):
    """A recording that cannot be used; the message names the file and the column."""


@dataclass(frozen=True)
class Body:
    """The body that carries the markers.

    Args:
        snake: name of the animal.
        mass: [kg].
        svl: snout-vent length, as found with these markers [m].
        svl_mean: the animal's snout-vent length by which arc length is divided in the
            gait [m].
        tape: distance along the body from each marker to the next, head first, (n-1,) [m].
        vent: index of the marker at the vent, from 0.
        density: rows of (arc length / SVL, relative linear density), tail included, (k, 2).
        source: the file that says so.
        column: the name there of `tape`.
    """

    snake: str
    mass: float
    svl: float
    svl_mean: float
    tape: np.ndarray
    vent: int
    density: np.ndarray
    source: Path
    column: str


@dataclass(frozen=True)
class Recording:
    """Markers of one flight, head first.

    Args:
        trial: name of the flight.
        rate: frames a second [Hz].
        markers: positions, y forward and z up, NaN where a marker was not seen,
            (frames, n, 3) [m].
        columns: names of the columns in the file, three a marker.
        body: the body.
        source: the file.

    Raises:
        RecordingError: wrong number of markers, a marker never seen, too few frames,
            lengths that cannot be in the stated unit.
    """

    trial: str
    rate: float
    markers: np.ndarray
    columns: list[str]
    body: Body
    source: Path

    def __post_init__(self):
        _check_body(self.body)
        _check_markers(self)


def _check_body(body: Body) -> None:
    if not 0 < body.vent < len(body.tape) + 1:
        raise RecordingError(f"{body.source}: no marker after the head is at the vent")
    for name in ("mass", "svl", "svl_mean"):
        value = getattr(body, name)
        if not (np.isfinite(value) and value > 0):
            raise RecordingError(f"{body.source}: {name} is {value}, not a positive number")
    if not (np.isfinite(body.tape).all() and (body.tape > 0).all()):
        raise RecordingError(
            f"{body.source}: {body.column!r} holds a value that is not positive"
        )
    marked = body.tape[: body.vent].sum() / body.svl
    if not 0.5 < marked < 1.1:
        raise RecordingError(
            f"{body.source}: {body.column!r} adds up to {marked:.3g} times the snout-vent "
            "length from head to vent: check its unit"
        )
    if not 0.5 < body.svl / body.svl_mean < 2:
        raise RecordingError(
            f"{body.source}: a snout-vent length of {body.svl:.4g} m, where the animal's is "
            f"{body.svl_mean:.4g} m: check their units"
        )
    along, weight = body.density.T
    if not (0 <= along[0] < 0.1 and 1 <= along[-1] < 3 and (np.diff(along) > 0).all()):
        raise RecordingError(
            f"{body.source}: the density's arc length must rise from 0 past the vent at 1"
        )
    if not (np.isfinite(weight).all() and (weight > 0).all()):
        raise RecordingError(f"{body.source}: a density is not positive")


def _check_markers(recording: Recording) -> None:
    markers, body, source = recording.markers, recording.body, recording.source
    count, expected = markers.shape[1], len(body.tape) + 1
    if count != expected:
        raise RecordingError(
            f"{source}: {count} markers, where {body.source} ({body.column!r}) has {expected}"
        )
    if count < MINIMUM_MARKERS:
        raise RecordingError(f"{source}: {count} markers, fewer than {MINIMUM_MARKERS}")
    if not 70 < recording.rate < 1e5:
        raise RecordingError(f"{source}: {recording.rate} frames a second; more than 70 needed")
    never = np.flatnonzero(~np.isfinite(markers).any(axis=0).ravel())
    if never.size:
        raise RecordingError(f"{source}: column {recording.columns[never[0]]!r} has no value")
    chords = np.linalg.norm(np.diff(markers, axis=1), axis=-1)
    pairs = np.isfinite(chords).any(axis=0)
    ratio = np.nanmedian(chords[:, pairs], axis=0).sum() / body.tape[pairs].sum()
    if pairs.any() and not 0.3 < ratio < 1.5:
        raise RecordingError(
            f"{source}: columns {recording.columns[0]!r} to {recording.columns[-1]!r} put the "
            f"markers {ratio:.3g} times as far apart as {body.source} ({body.column!r}): "
            "check the unit of both"
        )


def whole_interval(recording: Recording) -> slice:
    """Frames from the first to the last in which every marker was seen.

    Raises:
        RecordingError: fewer than 30 frames lie between.
    """
    whole = np.flatnonzero(np.isfinite(recording.markers).all(axis=(1, 2)))
    if whole.size == 0 or whole[-1] - whole[0] + 1 < MINIMUM_FRAMES:
        raise RecordingError(
            f"{recording.source}: {MINIMUM_FRAMES} frames are needed between the first and the "
            f"last in which every marker was seen; {whole.size} such frames found"
        )
    return slice(int(whole[0]), int(whole[-1]) + 1)
