"""A recording of markers on a body, and the checks that every recording must pass."""

import unicodedata
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .._lib.columns import TableError
from .._lib.documents import shown
from .plausible import problem

MINIMUM_MARKERS = 5
MINIMUM_FRAMES = 30
LENGTHS = (0.1, 1.5)
"""Shortest and longest snout-vent length [m]."""
STOUTNESS = (0.03, 10.0)
"""Lowest and highest mass over the cube of SVL [kg/m^3]; the study's snakes: 0.10 to 0.35."""

_NOT_IN_NAMES = ("Cc", "Cs", "Zl", "Zp")
"""Unicode's control characters, halves of characters, and ends of lines and paragraphs."""


RecordingError = TableError
"""A recording that cannot be used; the message says where and why."""


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
        table: the file that gives `density`, if another.
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
    table: Path | None = None


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
        unit, scale: unit of length of the columns, for messages, and its size [m].

    Raises:
        RecordingError: wrong number of markers, a marker never seen, too few frames,
            lengths that cannot be in the stated unit, places that no flight has, a name that
            cannot be written.
    """

    trial: str
    rate: float
    markers: np.ndarray
    columns: list[str]
    body: Body
    source: Path
    unit: str = "m"
    scale: float = 1.0

    def __post_init__(self):
        _check_names(self)
        _check_body(self.body)
        _check_density(self.body)
        _check_markers(self)


def _check_names(recording: Recording) -> None:
    """Refuse control characters, line ends and bytes that are no text: names are written."""
    source, body = recording.source, recording.body
    for place, entry, name in (
        (source.parent, "file", source.name),
        (source, "trial", recording.trial),
        (body.source, "snake", body.snake),
    ):
        wrong = next((c for c in name if unicodedata.category(c) in _NOT_IN_NAMES), None)
        if wrong is not None:
            raise RecordingError(
                f"{place}: {entry} = {shown(name)} is not allowed: {wrong!r} cannot stand in a "
                "name"
            )


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
    if not LENGTHS[0] <= body.svl_mean <= LENGTHS[1]:
        raise RecordingError(
            f"{body.source}: svl = {body.svl_mean:g} m is not allowed: it must be in "
            f"[{LENGTHS[0]:g}, {LENGTHS[1]:g}] m; check its unit"
        )
    stout = body.mass / body.svl_mean**3
    if not STOUTNESS[0] < stout < STOUTNESS[1]:
        low, high = (bound * body.svl_mean**3 for bound in STOUTNESS)
        raise RecordingError(
            f"{body.source}: mass = {body.mass:g} kg does not go with svl = "
            f"{body.svl_mean:g} m, where {low:.2g} to {high:.2g} kg may be: check their units"
        )


def _check_density(body: Body) -> None:
    source, table = body.table or body.source, body.density
    if table.ndim != 2 or table.shape[1] != 2 or len(table) < 2:
        raise RecordingError(
            f"{source}: density = {shown(table.tolist())} is not allowed: at least two rows "
            "are needed, each of arc length / SVL and relative density"
        )
    along, weight = table.T
    if not (0 <= along[0] < 0.1 and 1 <= along[-1] < 3 and (np.diff(along) > 0).all()):
        raise RecordingError(
            f"{source}: the density's arc length must rise from 0 past the vent at 1"
        )
    if not (np.isfinite(weight).all() and (weight > 0).all()):
        raise RecordingError(f"{source}: a density is not positive")


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
        raise RecordingError(
            f"{source}: {recording.rate:g} frames a second, where 70 to 1e5 are needed: "
            "check the unit of the times"
        )
    never = np.flatnonzero(~np.isfinite(markers).any(axis=0).ravel())
    if never.size:
        raise RecordingError(f"{source}: column {recording.columns[never[0]]!r} has no value")
    with np.errstate(over="ignore"):
        chords = np.linalg.norm(np.diff(markers, axis=1), axis=-1)
    pairs = np.isfinite(chords).any(axis=0)
    ratio = np.nanmedian(chords[:, pairs], axis=0).sum() / body.tape[pairs].sum()
    if pairs.any() and not 0.3 < ratio < 1.5:
        raise RecordingError(
            f"{source}: columns {recording.columns[0]!r} to {recording.columns[-1]!r} put the "
            f"markers {ratio:.3g} times as far apart as {body.source} ({body.column!r}): "
            "check the unit of both"
        )
    if found := problem(recording):
        raise RecordingError(f"{source}: {found}")


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
