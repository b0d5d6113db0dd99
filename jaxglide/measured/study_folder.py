"""Reading the published study's data folder, or anyone's laid out in the same way.

    mocap/{trial}_{snake}.tsv                 positions of the markers [mm]
    markers/Marker-summary_{d}00_{snake}.csv  the markers' places along the body [mm]
    snake_master.csv                          mass [g] and snout-vent length [mm]
    snake_density.csv                         linear density along the body

with d the first digit of the trial. The TSV has ten lines of settings, a header (Frame,
Time, 01 X, 01 Y, 01 Z, ...) and tab-separated rows, NA where a marker was not seen.
"""

from pathlib import Path

import numpy as np

from .._lib.columns import check_clock, numbers, read_rows, text_of, texts
from .recording import LENGTHS, Body, Recording, RecordingError

MM = GRAM = 1e-3
_SETTINGS = 10
_NOT_RECORDED = {"86": 1}
"""Snakes of whose markers one, by index, is in the summary but in no recording."""
_TAPE, _TYPE, _SVL = "Dist to next, mm", "Marker type", "svl (mm)"
_ALONG, _DENSITY = "arc length (SVL)", "density (rho/rho_bar)"


def study_files(folder: Path) -> dict[str, Path]:
    """Files of the recordings in a study folder, by trial, `{trial}_{snake}.tsv`."""
    return {trial: files[0] for trial, files in _recordings(folder).items()}


def _recordings(folder: Path) -> dict[str, list[Path]]:
    """The same, with every file of a trial."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.glob("mocap/*_*.tsv")):
        found.setdefault(path.stem.split("_")[0], []).append(path)
    return found


def _setting(source: Path, name: str) -> float:
    """One of the settings above a recording's header."""
    for line in text_of(source).splitlines()[:_SETTINGS]:
        words = line.strip().split("\t")
        if words[0] == name and words[1:]:
            try:
                return float(words[1])
            except ValueError:
                break
    raise RecordingError(f"{source}: no number {name} in the first {_SETTINGS} lines")


def _master(folder: Path, trial: str, snake: str) -> tuple[float, float]:
    """Mass [kg] and snout-vent length [m] of the snake in a trial."""
    source = folder / "snake_master.csv"
    rows = read_rows(source)
    names = zip(texts(rows, "Snake", source), texts(rows, "Trial ID", source), strict=True)
    found = [row for row, name in zip(rows, names, strict=True) if name == (snake, trial)]
    if not found:
        raise RecordingError(
            f"{source}: no row with {snake} in column 'Snake' and {trial} in 'Trial ID'"
        )
    mass, svl = numbers(found, ("Mass (g)", "SVL (mm)"), source)[0].tolist()
    if not 0.03 < mass * GRAM / (svl * MM) ** 3 < 1:  # the study's snakes: 0.10 to 0.35
        raise RecordingError(
            f"{source}: {mass:g} in column 'Mass (g)' does not go with {svl:g} in 'SVL (mm)': "
            "check their units"
        )
    low, high = (bound / MM for bound in LENGTHS)
    if not low <= svl <= high:
        raise RecordingError(
            f"{source}: {svl:g} in column 'SVL (mm)' is not allowed: it must be in [{low:g}, "
            f"{high:g}] mm"
        )
    return mass * GRAM, svl * MM


def _body(folder: Path, trial: str, snake: str) -> Body:
    mass, svl_mean = _master(folder, trial, snake)
    source = folder / "markers" / f"Marker-summary_{trial[0]}00_{snake}.csv"
    rows = read_rows(source)
    tape = numbers(rows, (_TAPE,), source, MM)[:-1, 0]
    types = texts(rows, _TYPE, source)
    if "vent" not in types:
        raise RecordingError(f"{source}: no 'vent' in column {_TYPE!r}")
    vent = types.index("vent")
    if snake in _NOT_RECORDED:
        lost = _NOT_RECORDED[snake]
        tape = np.concatenate(
            [tape[: lost - 1], [tape[lost - 1] + tape[lost]], tape[lost + 1 :]]
        )
        vent -= 1
    table = folder / "snake_density.csv"
    density = numbers(read_rows(table), (_ALONG, _DENSITY), table)
    svl = float(numbers(rows, (_SVL,), source, MM)[0, 0])
    return Body(snake, mass, svl, svl_mean, tape, vent, density, source, _TAPE, table)


def read_study(folder: Path, trial: str) -> Recording:
    """One recording of a study folder.

    Args:
        folder: the folder.
        trial: name of the flight, as in the file `mocap/{trial}_{snake}.tsv`.

    Raises:
        RecordingError: a file or column is missing, or what it holds cannot be right; the
            message names file and column.
        OSError: a file cannot be read.
    """
    folder, trial = Path(folder), str(trial)
    files = _recordings(folder).get(trial, [])
    if not files:
        raise RecordingError(f"{folder}: no recording mocap/{trial}_SNAKE.tsv")
    if len(files) > 1:
        said = " and ".join(path.name for path in files)
        raise RecordingError(f"{folder}: {said} are of one trial: keep one of them in mocap")
    source = files[0]
    body = _body(folder, trial, source.stem.split("_")[1])
    rate = _setting(source, "FREQUENCY")
    rows = read_rows(source, "\t", _SETTINGS)
    count = sum(name.strip().endswith(" X") for name in rows[0])
    columns = [f"{marker:02d} {axis}" for marker in range(1, count + 1) for axis in "XYZ"]
    markers = numbers(rows, columns, source, MM).reshape(len(rows), -1, 3)
    check_clock(rows, rate, source, "Time")
    return Recording(trial, rate, markers, columns, body, source, "mm", MM)
