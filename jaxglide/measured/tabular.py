"""Reading anyone's own recordings: a CSV file of markers and a TOML file of the body.

NAME.csv holds a row a frame, in equal steps, lengths in metres, y forward and z up, markers
numbered from the head, nothing or NA where one was not seen:

    time_s,m01_x,m01_y,m01_z,m02_x,...
    0.0000,0.012,0.501,8.320,0.014,...

NAME.toml beside it, or body.toml for all recordings of the folder:

    snake = "A"
    mass = 0.038                  # kg
    svl = 0.70                    # snout-vent length, m
    tape = [0.05, 0.06, 0.07]     # along the body from each marker to the next, m
    vent = 12                     # number of the marker at the vent, from 1
    density = [[0, 0.8], [1, 1.1], [1.4, 0.2]]   # arc length / SVL, relative linear density

Without `density` the body is taken as uniform.
"""

from pathlib import Path

import msgspec
import numpy as np

from .._lib.columns import check_clock, numbers, read_rows
from .._lib.documents import fitted, read_toml
from .recording import Body, Recording, RecordingError

_UNIFORM = [(0.0, 1.0), (2.0, 1.0)]
_HINTS = {
    "mass": "a number of kg",
    "svl": "a number of m",
    "tape": "numbers of m, from each marker to the next",
    "vent": "the number of a marker, from 1",
    "density": "pairs of arc length / SVL and relative density",
}


def tabular_files(folder: Path) -> dict[str, Path]:
    """CSV files in a folder that have a body file, by name."""
    return {path.stem: path for path in sorted(folder.glob("*.csv")) if _body_file(path)}


def _body_file(source: Path) -> Path | None:
    places = (source.with_suffix(".toml"), source.with_name("body.toml"))
    return next((place for place in places if place.is_file()), None)


class _BodyFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What stands in the file of the body."""

    snake: str
    mass: float
    svl: float
    tape: list[float]
    vent: int
    density: list[tuple[float, float]] = msgspec.field(default_factory=lambda: _UNIFORM)


def _read_body(source: Path) -> Body:
    try:
        found = fitted(read_toml(source), _BodyFile, source, _HINTS)
    except ValueError as error:
        raise RecordingError(str(error)) from None
    return Body(
        snake=found.snake,
        mass=found.mass,
        svl=found.svl,
        svl_mean=found.svl,
        tape=np.array(found.tape),
        vent=found.vent - 1,
        density=np.array(found.density).reshape(-1, 2),
        source=source,
        column="tape",
    )


def read_tabular(source: Path) -> Recording:
    """One recording of markers in a CSV file, with its body in a TOML file; see above.

    Raises:
        RecordingError: a file or column is missing, or what it holds cannot be right; the
            message names file and column.
        OSError: a file cannot be read.
    """
    source = Path(source)
    body_file = _body_file(source)
    if body_file is None:
        raise RecordingError(f"{source}: no {source.stem}.toml or body.toml beside it")
    rows = read_rows(source)
    count = sum(name.endswith("_x") for name in rows[0])
    columns = [f"m{marker:02d}_{axis}" for marker in range(1, count + 1) for axis in "xyz"]
    markers = numbers(rows, columns, source).reshape(len(rows), -1, 3)
    times = numbers(rows, ("time_s",), source)[:, 0]
    rate = _rate(times, source)
    check_clock(rows, rate, source, "time_s")
    return Recording(source.stem, rate, markers, columns, _read_body(body_file), source)


def _rate(times: np.ndarray, source: Path) -> float:
    """Frames a second [Hz]: the straight line through the times, however rounded."""
    if len(times) < 2 or not np.isfinite(times).all() or not times[-1] > times[0]:
        raise RecordingError(f"{source}: column 'time_s' does not rise from frame to frame")
    return 1 / float(np.polyfit(np.arange(len(times)), times, 1)[0])
