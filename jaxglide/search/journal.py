"""Evaluations of an optimisation, kept as they come.

The first line of a log describes the search, every other one an evaluation: which one it is,
of which starts, at which points, and what was found there. Each carries a digest of itself
and of the line before it, so that no line can be changed, moved, lost or doubled unseen.
"""

import contextlib
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from .._lib.writing import WriteError, alone, write_bytes, writing
from .problem import Evaluation

_Number = float | Literal["nan", "inf", "-inf"]  # JSON has no other form of these


class _Header(msgspec.Struct, forbid_unknown_fields=True):
    jaxglide: Literal["log of an optimisation, 2"]
    asked: dict[str, Any]
    digest: str = ""


class _Line(msgspec.Struct, forbid_unknown_fields=True):
    number: int
    starts: list[int]
    points: list[list[float]]
    values: list[list[_Number]]
    gradients: list[list[list[_Number]]]
    digest: str = ""


def _sealed(record: _Header | _Line, before: str) -> tuple[bytes, str]:
    """The line of a record with its digest, which follows on that of the line before."""
    bare = msgspec.json.encode(msgspec.structs.replace(record, digest=before))
    digest = hashlib.sha256(bare).hexdigest()[:32]
    return msgspec.json.encode(msgspec.structs.replace(record, digest=digest)), digest


def _opened(line: bytes, kind, before: str):
    """The record of a line, None if it is not the line that belongs there."""
    try:
        record = msgspec.json.decode(line, type=kind)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return None
    return record if _sealed(record, before)[0] == line else None


def _plain(values: np.ndarray) -> list:
    """An array as lists of numbers, or words where they are not finite."""
    whole, odd = values.astype(object), ~np.isfinite(values)
    whole[odd] = [str(value) for value in values[odd]]
    return whole.tolist()


class Journal:
    """Evaluations kept as lines of JSON, so that a killed run goes on where it was.

    What happens between evaluations is cheap and exact, and is simply done again.

    Args:
        path: the file, held by `alone`; None keeps nothing.
        asked: the search in plain values: another one's log is refused.

    Raises:
        ValueError: no log, another search's, or a damaged one.
        OSError: it cannot be read or written.
    """

    def __init__(self, path: str | Path | None, asked: dict[str, Any]):
        self.kept: list[_Line] = []
        self.recalled = 0
        if path is None:
            self.path = None
            return
        self.path = Path(path)
        first, self._last = _sealed(_Header("log of an optimisation, 2", asked), "")
        data = self.path.read_bytes() if self.path.exists() else b""
        if b"\n" not in data:
            if not (first + b"\n").startswith(data):
                raise ValueError(f"{self.path} is not the log of an optimisation")
            write_bytes(self.path, first + b"\n")
            self._size = len(first) + 1
            return
        head, *lines, torn = data.split(b"\n")
        self._last = self._compared(head, asked)
        for number, line in enumerate(lines, 2):
            record = _opened(line, _Line, self._last)
            if record is None:
                raise ValueError(
                    f"{self.path} is damaged: line {number} is not the one written there; cut "
                    "the file before it to go on from there"
                )
            self.kept.append(record)
            self._last = record.digest
        self._size = len(data) - len(torn)
        if torn:  # cut short by a kill or a full disk
            with writing(self.path):
                os.truncate(self.path, self._size)

    def _compared(self, head: bytes, asked: dict[str, Any]) -> str:
        """The digest of the first line, if that is one of this search."""
        header = _opened(head, _Header, "")
        if header is None:
            raise ValueError(
                f"{self.path} is not the log of an optimisation, or line 1 is damaged"
            )
        kept, given = header.asked, msgspec.json.decode(msgspec.json.encode(asked))
        for name in [*given, *kept]:
            if kept.get(name) != given.get(name):
                was, now = (str(x.get(name)) for x in (kept, given))
                change = f", {was} there and {now} here" if len(was + now) < 200 else ""
                raise ValueError(
                    f"{self.path} is the log of another optimisation: {name} differs{change}"
                )
        return header.digest

    def recall(self, starts: np.ndarray, points: np.ndarray) -> Evaluation | None:
        """The next evaluation, of the starts (k,) at points (k, n), if it was kept."""
        if self.recalled >= len(self.kept):
            return None
        line, number = self.kept[self.recalled], self.recalled + 2
        self.recalled += 1
        # Another machine may place a point a rounding error away.
        near = 1e-9 * np.abs(points).max(axis=0)
        same = line.number == number - 1 and line.starts == starts.tolist()
        if not same or not np.allclose(line.points, points, rtol=0, atol=near):
            raise ValueError(f"{self.path}: line {number} answers another question")
        return Evaluation(np.array(line.values, float), np.array(line.gradients, float))

    def keep(self, starts: np.ndarray, points: np.ndarray, found: Evaluation) -> None:
        """Append an evaluation and see that it reaches the disk.

        Raises:
            WriteError: the disk is full, or somebody else has changed the file.
        """
        if self.path is None:
            return
        self.recalled += 1
        line = _Line(
            self.recalled,
            starts.tolist(),
            points.tolist(),
            _plain(found.values),
            _plain(found.gradients),
        )
        text, self._last = _sealed(line, self._last)
        with writing(self.path), self.path.open("r+b") as file:
            if file.seek(0, os.SEEK_END) != self._size:
                raise WriteError(f"cannot write {self.path}: it was changed meanwhile")
            file.write(text + b"\n")
            file.flush()
            os.fsync(file.fileno())
        self._size += len(text) + 1


def read_log(path: str | Path) -> tuple[dict[str, Any], list[_Line]]:
    """The search in plain values, and the evaluations kept, of a log that may be in use.

    Raises:
        ValueError: it is no log, or a damaged one.
        OSError: it cannot be read.
    """
    head, *lines = Path(path).read_bytes().split(b"\n")[:-1] or [b""]  # the last may be torn
    header = _opened(head, _Header, "")
    if header is None:
        raise ValueError(f"{path} is not the log of an optimisation, or line 1 is damaged")
    kept, last = [], header.digest
    for number, line in enumerate(lines, 2):
        record = _opened(line, _Line, last)
        if record is None:
            raise ValueError(f"{path} is damaged: line {number} is not the one written there")
        kept.append(record)
        last = record.digest
    return header.asked, kept


@contextlib.contextmanager
def keeping(path: str | Path | None, asked: dict[str, Any]) -> Iterator[Journal]:
    """The journal at a path, for this process alone until the block ends; see `Journal`.

    Raises:
        BusyError: another process is at work on it.
    """
    with contextlib.nullcontext() if path is None else alone(path):
        yield Journal(path, asked)
