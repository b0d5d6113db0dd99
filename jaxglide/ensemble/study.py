"""What a sweep is to compute: cases, what is fixed, and how to solve."""

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.checks import check_integer, check_range
from .._lib.parameters import MAX_STEPS, MAX_TIME, PARAMETERS, SOLVER, TOLERANCE
from .cases import as_array, as_number, check_parameters, check_setup
from .study_file import Span, read_study_file, read_study_text

MOST_CASES = 10**7
"""Most cases of one study."""


def check_number_of_cases(sizes: Mapping[str, int]) -> None:
    """Raise `ValueError` where a grid of that many values by name has too many cases."""
    total = math.prod(sizes.values())
    if total > MOST_CASES:
        said = " x ".join(f"{name} {size}" for name, size in sizes.items())
        raise ValueError(
            f"the study has {total} cases ({said}); at most {MOST_CASES} are allowed"
        )


def expanded(grid: Mapping[str, Sequence[float] | Span]) -> dict[str, Any]:
    """A grid with its spans as values, which are made only where they are not too many."""
    sizes = {n: v.count if isinstance(v, Span) else len(v) for n, v in grid.items()}
    check_number_of_cases(sizes)
    found = {}
    for name, values in grid.items():
        if isinstance(values, Span):
            check_parameters({name: (values.start, values.stop)})
            if values.count == 1 and values.start != values.stop:
                raise ValueError(
                    f"{name} from {values.start:g} to {values.stop:g} is more than 1 value"
                )
            values = values.values()
        found[name] = values
    return found


@dataclass(frozen=True, eq=False)
class Study:
    """A grid or a list of cases over any parameters of glider and launch.

    Values are in the units people read (see `parameters.PARAMETERS`).

    Args:
        grid: values by name; every combination is a case, the last name varying fastest.
        cases: values by name, all of one length N; the n-th of each make a case. Give
            either `grid` or `cases`.
        fixed: values of other parameters.
        setup: "polar", "node_set", "nodes".
        rtol, atol: tolerances.
        max_time: longest flight [s].
        max_steps: most solver steps.
        times: times [s] at which to keep every trajectory, (T,), or None.

    Raises:
        ValueError: an unknown name, a value out of range, or lengths that differ.
    """

    grid: Mapping[str, Any] | None = None
    cases: Mapping[str, Any] | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    setup: Mapping[str, Any] = field(default_factory=dict)
    rtol: float = TOLERANCE
    atol: float = TOLERANCE
    max_time: float = MAX_TIME
    max_steps: int = MAX_STEPS
    times: Any = None

    def __post_init__(self):
        """Check every value, and keep it as Python's or NumPy's plain kind."""
        if (self.grid is None) == (self.cases is None):
            raise ValueError("a study has either a grid or cases")
        kind = "grid" if self.cases is None else "cases"
        for name in (kind, "fixed", "setup"):
            if not isinstance(getattr(self, name), Mapping):
                raise ValueError(f"{name} = {getattr(self, name)!r} is not values by name")
        varied = getattr(self, kind)
        if not varied:
            raise ValueError("a study varies at least one parameter")
        arrays = {name: as_array(name, values) for name, values in varied.items()}
        check_parameters(arrays)
        sizes = {name: array.size for name, array in arrays.items()}
        if self.cases is not None and len(set(sizes.values())) > 1:
            said = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise ValueError(f"cases differ in length: {said}")
        check_number_of_cases(sizes if self.cases is None else {"case": max(sizes.values())})
        for name, values in arrays.items() if kind == "grid" else ():
            ordered = np.sort(values)
            same = ordered[1:][ordered[1:] == ordered[:-1]]
            if same.size:
                raise ValueError(f"{name} = {same[0]:g} stands twice in the grid")
        fixed = {name: as_number(name, value) for name, value in self.fixed.items()}
        check_parameters(fixed)
        for name in fixed:
            if name in arrays:
                raise ValueError(f"{name} is both varied and fixed")
        solver = {name: as_number(name, getattr(self, name)) for name in (*SOLVER, "max_time")}
        for name, p in SOLVER.items():
            check_range(name, solver[name], p.unit, p.low, p.high, low_open=p.low_open)
        check_range("max_time", solver["max_time"], "s", 0, 1e4, low_open=True)
        check_integer("max_steps", self.max_steps, 1, 10**9)
        plain = {kind: arrays, "fixed": fixed, "setup": check_setup(self.setup), **solver}
        plain |= {"max_steps": int(self.max_steps), "times": self._kept_times(solver)}
        for name, value in plain.items():
            object.__setattr__(self, name, value)

    def _kept_times(self, solver: Mapping[str, float]) -> tuple[float, ...] | None:
        if self.times is None:
            return None
        times = as_array("times", self.times)
        check_range("times", times, "s", 0, solver["max_time"])
        if np.any(np.diff(times) < 0):
            raise ValueError("times must increase")
        return tuple(times.tolist())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Study):
            return NotImplemented
        return self.to_json() == other.to_json()

    def __hash__(self) -> int:
        return hash(self.to_json())

    @property
    def varied(self) -> dict[str, np.ndarray]:
        """The values given, by name: of the grid's axes or of the cases."""
        found = self.grid if self.cases is None else self.cases
        return dict(found)  # type: ignore[arg-type]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, or (N,)."""
        if self.cases is None:
            return tuple(len(values) for values in self.varied.values())
        return (len(next(iter(self.varied.values()))),)

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    def columns(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """Values by name of the cases at `index`, (n,), fixed ones included, each (n,)."""
        if self.cases is None:
            places = np.unravel_index(index, self.shape)
            varied = zip(self.varied.items(), places, strict=True)
            found = {name: values[place] for (name, values), place in varied}
        else:
            found = {name: values[index] for name, values in self.varied.items()}
        return found | {name: np.full(len(index), x) for name, x in self.fixed.items()}

    def order(self) -> np.ndarray:
        """Case numbers in an order that puts flights of similar length together, (N,).

        Longer from higher up and with faster undulation; cases expected equal stay in the
        order of the grid, where neighbours are alike.
        """
        column = self.columns(np.arange(len(self)))
        height = column.get("height", PARAMETERS["height"].default)
        f_theta = column.get("f_theta", PARAMETERS["f_theta"].default)
        time = np.sqrt(np.asarray(height)) + np.asarray(height) / 5
        expected = np.broadcast_to(time * (0.5 + np.asarray(f_theta)), (len(self),))
        return np.argsort(np.round(expected, 6), kind="stable")

    def to_json(self) -> str:
        """The study as canonical JSON, exact to the last bit."""
        kind = "grid" if self.cases is None else "cases"
        record = {
            kind: [[name, values.tolist()] for name, values in self.varied.items()],
            "fixed": self.fixed,
            "setup": self.setup,
            "rtol": self.rtol,
            "atol": self.atol,
            "max_time": self.max_time,
            "max_steps": self.max_steps,
            "times": self.times,
        }
        return json.dumps(record, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> "Study":
        """The study that `to_json` wrote.

        Raises:
            ValueError: it did not write that.
        """
        return cls(**read_study_text(text))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the canonical JSON."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()

    @classmethod
    def from_file(cls, path: str | Path) -> "Study":
        """Read a study from a TOML file.

        Tables `[grid]` or `[cases]`, `[fixed]`, `[setup]` and `[solver]` hold what `Study`
        takes; values of a grid are a list or `{ start, stop, count }`.

        Raises:
            ValueError: not TOML, an unknown entry, or wrong values; the message names the
                file and the entry.
            OSError: the file cannot be read.
        """
        from .._lib.documents import about

        tables = read_study_file(path)
        solver = tables.pop("solver", {})
        grid = tables.get("grid", {})
        with about(path):
            if grid:
                tables["grid"] = expanded(grid)
            return cls(**tables, **solver)
