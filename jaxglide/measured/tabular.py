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

import tomllib
from pathlib import Path
from typing import Any

import numpy as np

from .columns import check_clock, numbers, read_rows
from .recording import Body, Recording, RecordingError

_NEEDED = ("snake", "mass", "svl", "tape", "vent")
_UNIFORM = ((0.0, 1.0), (2.0, 1.0))


def tabular_files(folder: Path) -> dict[str, Path]:
    """CSV files in a folder that have a body file, by name."""
    return {path.stem: path for path in sorted(folder.glob("*.csv")) if _body_file(path)}


def _body_file(source: Path) -> Path | None:
    places = (source.with_suffix(".toml"), source.with_name("body.toml"))
    return next((place for place in places if place.is_file()), None)


def _array(values: Any, shape: tuple[int, ...], source: Path, name: str) -> np.ndarray:
    """An entry as an array of the given shape, -1 for any length."""
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        array = np.empty(())
    if array.ndim != len(shape) or any(
        want not in (-1, have) for want, have in zip(shape, array.shape, strict=True)
    ):
        raise RecordingError(f"{source}: {name!r} does not hold numbers as documented")
    return array


def _read_body(source: Path) -> Body:
    try:
        with source.open("rb") as file:
            entries = tomllib.load(file)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise RecordingError(f"{source}: {error}") from None
    for name in _NEEDED:
        if name not in entries:
            raise RecordingError(f"{source}: {name!r} is missing")
    for name in entries.keys() - {*_NEEDED, "density"}:
        raise RecordingError(f"{source}: unknown {name!r}")
    svl = float(_array(entries["svl"], (), source, "svl"))
    return Body(
        snake=str(entries["snake"]),
        mass=float(_array(entries["mass"], (), source, "mass")),
        svl=svl,
        svl_mean=svl,
        tape=_array(entries["tape"], (-1,), source, "tape"),
        vent=int(_array(entries["vent"], (), source, "vent")) - 1,
        density=_array(entries.get("density", _UNIFORM), (-1, 2), source, "density"),
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
    rate = (len(times) - 1) / (times[-1] - times[0]) if times[-1] > times[0] else np.nan
    check_clock(times, rate, source, "time_s")
    return Recording(source.stem, rate, markers, columns, _read_body(body_file), source)
