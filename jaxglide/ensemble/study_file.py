"""The structure of a study file, declared once."""

import math
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from .._lib.defaults import CHOICES
from .._lib.documents import fitted, read_toml


class Span(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Equally spaced values, both ends included."""

    start: float
    stop: float
    count: Annotated[int, Meta(ge=1, le=10**7)]

    def values(self) -> np.ndarray:
        """All of them, (count,); of ends that are not finite these alone, to be refused."""
        if not (math.isfinite(self.start) and math.isfinite(self.stop)):
            return np.array([self.start, self.stop])
        return np.linspace(self.start, self.stop, self.count)


Values = Annotated[list[float], Meta(min_length=1)]


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


_Table = dict[str, Any]


class StudyFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A study as it stands in a file; what its parts hold is looked at in `parts`."""

    grid: _Table | UnsetType = UNSET
    cases: _Table | UnsetType = UNSET
    fixed: _Table | UnsetType = UNSET
    setup: Setup | UnsetType = UNSET
    solver: Solver | UnsetType = UNSET
    body: _Table | UnsetType = UNSET
    gait: _Table | UnsetType = UNSET
    polar: _Table | UnsetType = UNSET
    aerodynamics: _Table | UnsetType = UNSET
    air: _Table | UnsetType = UNSET
    launch: _Table | UnsetType = UNSET
    ends: list[_Table] | UnsetType = UNSET
    gravity: float | UnsetType = UNSET


_ENTRIES = {"grid": Values | Span, "cases": Values, "fixed": float}
_HINTS = {
    "grid": "[grid] holds, by name of a parameter, a list of numbers or "
    f"{{ start, stop, count }} with at most {10**7} of them",
    "cases": "[cases] holds, by name of a parameter, a list of numbers",
    "fixed": "[fixed] holds numbers by name of a parameter",
    "setup": "[setup] holds "
    + ", ".join(f"{n} ({' or '.join(c)})" for n, c in CHOICES.items())
    + ", nodes (a whole number)",
    "solver": "[solver] holds the numbers rtol, atol, max_time, max_steps and the list times",
    "ends": "every table [[ends]] holds the kind of an end, and its numbers",
}


def read_study_file(path: str | Path) -> dict[str, Any]:
    """Tables of a study file by name, with what each holds; see `Study.from_file`.

    Raises:
        ValueError: not TOML, an unknown entry, or one of another kind than declared.
        OSError: the file cannot be read.
    """
    document = read_toml(path)
    found = fitted(document, StudyFile, path, _HINTS)
    tables: dict[str, Any] = {}
    for name, table in document.items():  # in its order: the last of a grid varies fastest
        value = getattr(found, name)
        if name in _ENTRIES:
            kind, places = _ENTRIES[name], {entry: f"{name}.{entry}" for entry in table}
            value = {n: fitted(table[n], kind, path, _HINTS, p) for n, p in places.items()}
        elif isinstance(value, msgspec.Struct):
            value = {entry: getattr(value, entry) for entry in table}
        tables[name] = value
    return tables
