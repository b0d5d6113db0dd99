"""What is known of a study without the glider that it flies: what its store needs."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta

from .._lib.checks import check_integer, check_range
from .._lib.defaults import SOLVER
from ..flight.dynamics import RIGID
from ..flight.ends import Outcome
from .base import published_case

MOST_CASES = 10**7
"""Most cases of one study."""
_HEIGHTS = ("height", "launch.height")
_FREQUENCIES = ("f_theta", "gait.f_theta")


def check_number_of_cases(sizes: Mapping[str, int]) -> None:
    """Raise `ValueError` where a grid of that many values by name has too many cases."""
    total = math.prod(sizes.values())
    if total > MOST_CASES:
        said = " x ".join(f"{name} {size}" for name, size in sizes.items())
        raise ValueError(
            f"the study has {total} cases ({said}); at most {MOST_CASES} are allowed"
        )


class Told(NamedTuple):
    """What the text of a study tells of a base case that is not the published snake.

    Attributes:
        case: record of the case (see `identity`).
        about: unit and meaning by name of what is varied or fixed.
        words: how flights end beside the words of `Outcome`.
        state: how many numbers a state has.
    """

    case: dict[str, Any]
    about: dict[str, tuple[str, str]]
    words: tuple[str, ...]
    state: int


class AbstractPlan:
    """Cases, what is fixed, and how to solve; see `Study` and `Plan`.

    Attributes:
        grid, cases: values by name, (N,), one of them None.
        fixed: values by name.
        setup: of the published snake; empty for another base.
        rtol, atol, max_time, max_steps, times: as in `Study`.
        told: of another base than the published snake, or None.
    """

    grid: Mapping[str, Any] | None
    cases: Mapping[str, Any] | None
    fixed: Mapping[str, float]
    setup: Mapping[str, Any]
    rtol: float
    atol: float
    max_time: float
    max_steps: int
    times: Any

    @property
    def told(self) -> Told | None:
        """Of another base than the published snake; None for that."""
        raise NotImplementedError

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
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
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions of its results."""
        return tuple(self.varied) if self.cases is None else ("case",)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, or (N,)."""
        if self.cases is None:
            return tuple(len(values) for values in self.varied.values())
        return (len(next(iter(self.varied.values()))),)

    def __len__(self) -> int:
        return math.prod(self.shape)

    @property
    def state_size(self) -> int:
        """How many numbers a state has."""
        return RIGID if self.told is None else self.told.state

    @property
    def outcomes(self) -> dict[int, str]:
        """How flights end, in words, by code."""
        words = [str(outcome) for outcome in Outcome]
        return dict(enumerate([*words, *(() if self.told is None else self.told.words)]))

    def about(self, name: str) -> tuple[str, str]:
        """Unit, as people read it, and meaning of what is varied or fixed."""
        if self.told is not None:
            return self.told.about[name]
        known = published_case().parameter(name)
        return known.unit, known.meaning

    def lanes(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """Values by name that are varied, of the cases at `index`, (n,), each (n,)."""
        if self.cases is None:
            places = np.unravel_index(index, self.shape)
            varied = zip(self.varied.items(), places, strict=True)
            return {name: values[place] for (name, values), place in varied}
        return {name: values[index] for name, values in self.varied.items()}

    def columns(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """The same, with those that are fixed."""
        fixed = {name: np.full(len(index), x) for name, x in self.fixed.items()}
        return self.lanes(index) | fixed

    def order(self) -> np.ndarray:
        """Case numbers in an order that puts flights of similar length together, (N,).

        Longer from higher up and with faster undulation; cases expected equal stay in the
        order of the grid, where neighbours are alike.
        """
        column = self.lanes(np.arange(len(self)))
        height, f_theta = (
            next((column[name] for name in names if name in column), np.asarray(usual))
            for names, usual in ((_HEIGHTS, 10.0), (_FREQUENCIES, 1.2))
        )
        time = np.sqrt(np.maximum(height, 0)) + height / 5
        expected = np.broadcast_to(time * (0.5 + f_theta), (len(self),))
        return np.argsort(np.round(expected, 6), kind="stable")

    def _check(self) -> None:
        """Raise `ValueError` unless values and settings, all plain by now, fit together."""
        sizes = {name: array.size for name, array in self.varied.items()}
        if self.cases is not None and len(set(sizes.values())) > 1:
            said = ", ".join(f"{name} {size}" for name, size in sizes.items())
            raise ValueError(f"cases differ in length: {said}")
        check_number_of_cases(sizes if self.cases is None else {"case": max(sizes.values())})
        for name, values in self.varied.items() if self.cases is None else ():
            ordered = np.sort(values)
            same = ordered[1:][ordered[1:] == ordered[:-1]]
            if same.size:
                raise ValueError(f"{name} = {same[0]:g} stands twice in the grid")
        for name in self.fixed:
            if name in sizes:
                raise ValueError(f"{name} is both varied and fixed")
        for name, p in SOLVER.items():
            check_range(name, getattr(self, name), p.unit, p.low, p.high, low_open=p.low_open)
        check_range("max_time", self.max_time, "s", 0, 1e4, low_open=True)
        check_integer("max_steps", self.max_steps, 1, 10**9)
        if self.times is not None:
            check_range("times", self.times, "s", 0, self.max_time)
            if np.any(np.diff(self.times) < 0):
                raise ValueError("times must increase")

    @cached_property
    def _text(self) -> str:
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
        if self.told is not None:
            record["base"] = self.told._asdict()
        return json.dumps(record, sort_keys=True)

    def to_json(self) -> str:
        """The study as canonical JSON, exact to the last bit."""
        return self._text

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the canonical JSON."""
        return hashlib.sha256(self.to_json().encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class Plan(AbstractPlan):
    """What the text of a study tells, with which its results can be read; see `Study`."""

    grid: Mapping[str, Any] | None
    cases: Mapping[str, Any] | None
    fixed: Mapping[str, float]
    setup: Mapping[str, Any]
    rtol: float
    atol: float
    max_time: float
    max_steps: int
    times: tuple[float, ...] | None
    base: Told | None

    @property
    def told(self) -> Told | None:
        return self.base

    @classmethod
    def from_json(cls, text: str) -> "Plan":
        """What `AbstractPlan.to_json` wrote.

        Raises:
            ValueError: it did not write that.
        """
        given = read_text(text)
        for kind in ("grid", "cases"):
            values = given[kind]
            if values is not None:
                given[kind] = {name: np.asarray(v, float) for name, v in values.items()}
        if given["times"] is not None:
            given["times"] = tuple(given["times"])
        plan = cls(**given)
        plan._check()
        return plan


_Column = Annotated[list[float], Meta(min_length=1)]


class _Base(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    case: dict[str, Any]
    about: dict[str, tuple[str, str]]
    words: list[str]
    state: Annotated[int, Meta(ge=RIGID, le=10**5)]


class _Text(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A study as `to_json` writes it."""

    fixed: dict[str, float]
    setup: dict[str, str | int]
    rtol: float
    atol: float
    max_time: float
    max_steps: int
    grid: Annotated[list[tuple[str, _Column]], Meta(min_length=1)] | None = None
    cases: Annotated[list[tuple[str, _Column]], Meta(min_length=1)] | None = None
    times: _Column | None = None
    base: _Base | None = None


def read_text(text: str) -> dict[str, Any]:
    """What stands in the text of a study, by name.

    Raises:
        ValueError: it is no JSON, or not of that structure.
    """
    try:
        found = msgspec.json.decode(text, type=_Text)
        record = msgspec.structs.asdict(found)
        if (found.grid is None) == (found.cases is None):
            raise ValueError("it has either a grid or cases")
        if found.base is not None:
            base = found.base
            record["base"] = Told(base.case, base.about, tuple(base.words), base.state)
            given = found.grid or found.cases or []
            for name in (*(name for name, _ in given), *found.fixed):
                if name not in base.about:
                    raise ValueError(f"it does not say what {name!r} is")
    except (ValueError, RecursionError) as error:
        raise ValueError(f"this is not the text of a study: {error}") from None
    for kind in ("grid", "cases"):
        record[kind] = None if record[kind] is None else dict(record[kind])
    return record
