"""Reading columns of numbers from text files, with errors that name file and column."""

import csv
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from .recording import RecordingError

Rows = list[dict[str, str]]


def read_rows(source: Path, delimiter: str = ",", skip: int = 0) -> Rows:
    """Rows of a text file, after `skip` lines and a header.

    Raises:
        RecordingError: the file is not text, has no row, or has one of another length.
    """
    try:
        with source.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(islice(file, skip, None), delimiter=delimiter)
            rows = list(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{source}: not a text file of columns ({error})") from None
    if not rows:
        raise RecordingError(f"{source}: no rows below the header")
    for line, row in enumerate(rows, skip + 2):
        row.pop("", None)  # a tab at the end of the header
        if None in row or None in row.values():
            raise RecordingError(f"{source}, line {line}: not as many columns as the header")
    return rows


def texts(rows: Rows, column: str, source: Path) -> list[str]:
    """A column as it stands.

    Raises:
        RecordingError: it is missing.
    """
    if column not in rows[0]:
        raise RecordingError(f"{source}: column {column!r} is missing")
    return [row[column].strip() for row in rows]


def numbers(rows: Rows, columns: Sequence[str], source: Path, scale: float = 1) -> np.ndarray:
    """Columns as numbers times `scale`, NaN for NA or nothing, (rows, columns).

    Raises:
        RecordingError: a column is missing, or holds something else.
    """
    table = np.empty((len(rows), len(columns)))
    for index, column in enumerate(columns):
        for row, text in enumerate(texts(rows, column, source)):
            try:
                table[row, index] = np.nan if text in ("", "NA", "NaN", "nan") else float(text)
            except ValueError:
                raise RecordingError(
                    f"{source}: {text!r} in column {column!r} is not a number"
                ) from None
    return table * scale


def check_clock(times: np.ndarray, rate: float, source: Path, column: str) -> None:
    """Compare a column of times [s] with the rate [Hz].

    Raises:
        RecordingError: a frame is off by more than a tenth of a step.
    """
    drift = np.abs(times - times[0] - np.arange(len(times)) / rate) * rate
    if not (drift < 0.1).all():
        frame = int(np.argmax(~(drift < 0.1)))
        raise RecordingError(
            f"{source}: column {column!r} is not in equal steps of 1/{rate:g} s "
            f"(first at frame {frame} of the file)"
        )
