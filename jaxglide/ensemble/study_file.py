"""The structure of a study file, declared once."""

from pathlib import Path
from typing import Annotated, Any, TypeAlias

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from .._lib.documents import fitted, read_toml
from .._lib.parameters import CHOICES, PARAMETERS


class Span(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Equally spaced values, both ends included."""

    start: float
    stop: float
    count: Annotated[int, Meta(ge=1, le=10**7)]

    def values(self) -> np.ndarray:
        """All of them, (count,)."""
        return np.linspace(self.start, self.stop, self.count)


def _table(name: str, kind: Any, names) -> Any:
    """A table of entries of one kind, each of which may be left out."""
    fields = [(entry, kind | UnsetType, UNSET) for entry in names]
    return msgspec.defstruct(name, fields, forbid_unknown_fields=True, frozen=True)


Values = Annotated[list[float], Meta(min_length=1)]
Grid: TypeAlias = _table("Grid", Values | Span, PARAMETERS)  # type: ignore[valid-type]
Cases: TypeAlias = _table("Cases", Values, PARAMETERS)  # type: ignore[valid-type]
Fixed: TypeAlias = _table("Fixed", float, PARAMETERS)  # type: ignore[valid-type]


class Setup(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Choices that are not numbers to vary."""

    polar: str | UnsetType = UNSET
    node_set: str | UnsetType = UNSET
    nodes: int | UnsetType = UNSET


class Solver(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Tolerances and limits."""

    rtol: float | UnsetType = UNSET
    atol: float | UnsetType = UNSET
    max_time: float | UnsetType = UNSET
    max_steps: int | UnsetType = UNSET
    times: Values | UnsetType = UNSET


class StudyFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A study as it stands in a file."""

    grid: Grid | UnsetType = UNSET
    cases: Cases | UnsetType = UNSET
    fixed: Fixed | UnsetType = UNSET
    setup: Setup | UnsetType = UNSET
    solver: Solver | UnsetType = UNSET


_HINTS = {
    "grid": "[grid] holds, by name of a parameter, a list of numbers or "
    f"{{ start, stop, count }} with at most {10**7} of them",
    "cases": "[cases] holds, by name of a parameter, a list of numbers",
    "fixed": "[fixed] holds numbers by name of a parameter",
    "setup": "[setup] holds "
    + ", ".join(f"{n} ({' or '.join(c)})" for n, c in CHOICES.items())
    + ", nodes (a whole number)",
    "solver": "[solver] holds the numbers rtol, atol, max_time, max_steps and the list times",
}


def read_study_file(path: str | Path) -> dict[str, dict[str, Any]]:
    """Tables of a study file by name, with what each holds; see `Study.from_file`.

    Raises:
        ValueError: not TOML, an unknown entry, or one of another kind than declared.
        OSError: the file cannot be read.
    """
    document = read_toml(path)
    found = fitted(document, StudyFile, path, _HINTS)
    return {  # in the order of the file: the last name of a grid varies fastest
        name: {entry: getattr(getattr(found, name), entry) for entry in table}
        for name, table in document.items()
    }


class _Text(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A study as `Study.to_json` writes it."""

    fixed: dict[str, float]
    setup: dict[str, str | int]
    rtol: float
    atol: float
    max_time: float
    max_steps: int
    grid: list[tuple[str, list[float]]] | None = None
    cases: list[tuple[str, list[float]]] | None = None
    times: list[float] | None = None


def read_study_text(text: str) -> dict[str, Any]:
    """Arguments of the study whose `to_json` is `text`.

    Raises:
        ValueError: it is no JSON, or not of that structure.
    """
    try:
        record = msgspec.structs.asdict(msgspec.json.decode(text, type=_Text))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"this is not the text of a study: {error}") from None
    for kind in ("grid", "cases"):
        record[kind] = None if record[kind] is None else dict(record[kind])
    return record
