"""Reading columns of numbers from text files, with errors that name file and column."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from .documents import read_text, shown


class TableError(ValueError):
    """A table from outside that cannot be used; the message says where and why."""


Rows = list[dict[str, str]]
_NOTHING = ("", "NA", "NaN", "nan")


def text_of(source: Path) -> str:
    """A text file, of bounded size; bytes that are no text stay in their cells.

    Raises:
        TableError: it is too large.
        OSError: it cannot be read.
    """
    try:
        return read_text(source, errors="surrogateescape")
    except ValueError as error:
        raise TableError(str(error)) from None


def read_rows(source: Path, delimiter: str = ",", skip: int = 0) -> Rows:
    """Rows of a text file, after `skip` lines and a header.

    Raises:
        TableError: the file has no row, one of another length, or two columns of a name.
        OSError: it cannot be read.
    """
    lines = io.StringIO(text_of(source), newline="")
    reader = csv.DictReader(islice(lines, skip, None), delimiter=delimiter)
    try:
        rows = list(reader)
    except csv.Error as error:
        raise TableError(f"{source}: not a text file of columns ({error})") from None
    if not rows:
        raise TableError(f"{source}: no rows below the header")
    for name, count in Counter(reader.fieldnames).items():
        if count > 1 and name:
            raise TableError(f"{source}: column {name!r} is there {count} times")
    for line, row in enumerate(rows, skip + 2):
        row.pop("", None)  # a tab at the end of the header
        if None in row or None in row.values():
            raise TableError(f"{source}, line {line}: not as many columns as the header")
    return rows


def texts(rows: Rows, column: str, source: Path) -> list[str]:
    """A column as it stands.

    Raises:
        TableError: it is missing, or holds bytes that are no text.
    """
    if column not in rows[0]:
        raise TableError(f"{source}: column {column!r} is missing")
    cells = [row[column].strip() for row in rows]
    for row, cell in enumerate(cells):
        if not cell.isascii() and not _is_text(cell):
            raw = cell.encode(errors="surrogateescape")
            raise TableError(
                f"{source}: {shown(raw)[1:]} in column {column!r}, row {row + 1} below "
                "the header, is not UTF-8 text"
            )
    return cells


def _is_text(cell: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in cell)


def numbers(rows: Rows, columns: Sequence[str], source: Path, scale: float = 1) -> np.ndarray:
    """Columns as numbers times `scale`, NaN for NA or nothing, (rows, columns).

    Raises:
        TableError: a column is missing, or holds something else.
    """
    table = np.empty((len(rows), len(columns)))
    for index, column in enumerate(columns):
        for row, text in enumerate(texts(rows, column, source)):
            table[row, index] = np.nan if text in _NOTHING else _number(text)
        wrong = np.flatnonzero(np.isinf(table[:, index]))
        if wrong.size:
            text = rows[wrong[0]][column]
            raise TableError(
                f"{source}: {shown(text)} in column {column!r}, row {wrong[0] + 1} "
                "below the header, is not a finite number; nothing or NA stands where there is "
                "none"
            )
    return table * scale


def _number(text: str) -> float:
    """A number; infinity where the text is none, or means infinity."""
    try:
        value = float("inf" if "_" in text else text)
    except ValueError:
        return np.inf
    return value if np.isfinite(value) else np.inf


def rounding(rows: Rows, column: str, source: Path) -> float:
    """The last digit kept anywhere in a column of numbers, 0.001 for thousandths."""
    cells = texts(rows, column, source)
    if any("e" in cell.lower() for cell in cells):
        return 0.0
    return 10.0 ** -max(len(cell.partition(".")[2]) for cell in cells)


def check_clock(rows: Rows, rate: float, source: Path, column: str) -> None:
    """Compare a column of times [s] with the rate [Hz].

    Raises:
        TableError: a frame is off by more than a tenth of a step and the times' own
            rounding, or by half a step.
    """
    times = numbers(rows, (column,), source)[:, 0]
    drift = np.abs(times - times[0] - np.arange(len(times)) / rate) * rate
    allowed = min(0.1 + 1.5 * rate * rounding(rows, column, source), 0.5)
    if not (drift < allowed).all():
        frame = int(np.argmax(~(drift < allowed))) + 1
        raise TableError(
            f"{source}: column {column!r} is not in equal steps of 1/{rate:g} s "
            f"(first at frame {frame} of the file)"
        )


def read_columns(
    path: str | Path, wanted: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, np.ndarray]:
    """Columns of numbers of a CSV file, by name, each (rows,).

    Args:
        path: the file; its first line names the columns.
        wanted: columns that must be there.
        optional: columns that may be there; no other may.

    Raises:
        TableError: a column is missing, unknown or not of numbers; one sentence names it.
        OSError: the file cannot be read.
    """
    source = Path(path)
    rows = read_rows(source)
    known = (*wanted, *optional)
    names = [name.strip() for name in rows[0]]
    rows = [dict(zip(names, row.values(), strict=True)) for row in rows]
    for name in names:
        if names.count(name) > 1:
            raise TableError(f"{source}: column {name!r} is there {names.count(name)} times")
        if name not in known:
            raise TableError(
                f"{source}: column {name!r} is not known: known are {', '.join(known)}"
            )
    there = [name for name in known if name in wanted or name in rows[0]]
    table = numbers(rows, there, source)
    for name, column in zip(there, table.T, strict=True):
        if not np.isfinite(column).all():
            row = int(np.flatnonzero(~np.isfinite(column))[0]) + 1
            raise TableError(
                f"{source}: column {name!r} has no number in row {row} below the header"
            )
    return dict(zip(there, table.T, strict=True))
