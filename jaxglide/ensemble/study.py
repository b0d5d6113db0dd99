"""What a sweep is to compute: cases, what is fixed, and how to solve."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, InitVar, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .._lib.checks import as_array, as_number, check_kind
from .._lib.defaults import MAX_STEPS, MAX_TIME, SOLVER, TOLERANCE
from ..flight.case import Case
from ..flight.dynamics import Glider
from ..flight.ends import AbstractEnd, Ground, Outcome, outcome_words
from ..flight.launch import Launch
from .base import check_setup, published_case
from .identity import case_of_record, case_record, floats_as_arrays, own_parts_of, state_size
from .parts import TABLES, case_of
from .plan import MOST_CASES as MOST_CASES
from .plan import AbstractPlan, Told, check_number_of_cases, read_text
from .study_file import Span, read_study_file


def expanded(grid: Mapping[str, Sequence[float] | Span]) -> dict[str, Any]:
    """A grid with its spans as values, which are made only where they are not too many."""
    sizes = {n: v.count if isinstance(v, Span) else len(v) for n, v in grid.items()}
    check_number_of_cases(sizes)
    found = {}
    for name, values in grid.items():
        if isinstance(values, Span):
            if values.count == 1 and values.start != values.stop:
                raise ValueError(
                    f"{name} from {values.start:g} to {values.stop:g} is more than 1 value"
                )
            values = values.values()
        found[name] = values
    return found


@dataclass(frozen=True, eq=False)
class Study(AbstractPlan):
    """A grid or a list of cases over any floats of a glider, its launch and its ends.

    What is varied is named by its path, `gait.nu_theta`, `air.velocity[0]`, or by its short
    name, `nu_theta`, in the units people read (see `Case`). What is fixed, and all floats of
    the base, are traced: the same study with another height or mass compiles nothing.

    Args:
        grid: values by name; every combination is a case, the last name varying fastest.
        cases: values by name, all of one length N; the n-th of each make a case. Give
            either `grid` or `cases`.
        fixed: values of other parameters.
        setup: "polar", "node_set", "nodes" of the published snake.
        rtol, atol: tolerances.
        max_time: longest flight [s].
        max_steps: most solver steps.
        times: times [s] at which to keep every trajectory, (T,), or None.
        case: the base, whose values hold where nothing else is given; by default the
            published snake, its amplitude on the shape line and its mass by its length.
        glider, launch, ends: the base in parts, instead of `case`.

    Raises:
        TypeError: a part of another type.
        ValueError: an unknown name, a value out of range, or lengths that differ.

    Examples:
        >>> from jaxglide import Study
        >>> study = Study({"nu_theta": [1.0, 1.2, 1.4], "d_psi": [0, 10]}, fixed={"height": 2})
        >>> len(study)
        6
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
    _: KW_ONLY
    case: Case = None  # type: ignore[assignment]
    glider: InitVar[Glider | None] = None
    launch: InitVar[Launch | None] = None
    ends: InitVar[AbstractEnd | Sequence[AbstractEnd] | None] = None

    def __post_init__(self, glider, launch, ends):
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
        case, setup = base_of(self.setup, self.case, glider, launch, ends)
        arrays = _named(case, {n: as_array(n, v) for n, v in varied.items()})
        fixed = _named(case, {n: as_number(n, v) for n, v in self.fixed.items()})
        solver = {n: as_number(n, getattr(self, n)) for n in (*SOLVER, "max_time")}
        times = None if self.times is None else tuple(as_array("times", self.times).tolist())
        plain = {kind: arrays, "fixed": fixed, "setup": setup, "case": case, "times": times}
        for name, value in (plain | solver).items():
            object.__setattr__(self, name, value)
        self._check()
        check_above_ground(case, fixed | arrays, paired=self.grid is None)
        object.__setattr__(self, "max_steps", int(self.max_steps))

    @cached_property
    def base(self) -> Case:
        """The case with what is fixed, every float of it an array."""
        return fixed_case(self.case, self.fixed)

    @cached_property
    def told(self) -> Told | None:
        if self.setup:
            return None
        known = {n: self.case.parameter(n) for n in (*self.varied, *self.fixed)}
        others = list(outcome_words(self.case.ends).values())[len(Outcome) :]
        return Told(
            case=case_record(self.case),
            about={name: (p.unit, p.meaning) for name, p in known.items()},
            words=tuple(others),
            state=state_size(self.case),
        )

    @property
    def own(self) -> bool:
        """Whether the base has parts that are not the package's."""
        return bool(not self.setup and own_parts_of(self.case))

    def part(self, index: np.ndarray) -> "Study":
        """A study of some of the cases alone, (n,)."""
        case: Any = None if self.setup else self.case
        return dataclasses.replace(self, grid=None, cases=self.lanes(index), case=case)

    @classmethod
    def from_json(cls, text: str, case: Case | None = None) -> "Study":
        """The study that `to_json` wrote.

        Args:
            text: its text.
            case: its base, where that has parts of a user's own.

        Raises:
            ValueError: it did not write that, or of another base.
        """
        given = read_text(text)
        told = given.pop("base")
        if told is None and case is not None:
            raise ValueError("the study flies the published snake: it takes no case")
        if told is not None:
            given["case"] = case_of_record(told.case) if case is None else case
        study = cls(**given)
        if case is not None and study.told != told:
            raise ValueError("the study flies another case than this one")
        return study

    @classmethod
    def from_file(cls, path: str | Path) -> "Study":
        """Read a study from a TOML file.

        Tables `[grid]` or `[cases]`, `[fixed]`, `[setup]` and `[solver]` hold what `Study`
        takes; values of a grid are a list or `{ start, stop, count }`. Names with a dot or
        an index stand in quotes. Instead of `[setup]` the tables `[body]`, `[gait]`,
        `[polar]`, `[aerodynamics]`, `[air]`, `[launch]`, `[[ends]]` and the number `gravity`
        may make another base (see `parts.case_of`); names of files in them count from the
        study file.

        Raises:
            ValueError: not TOML, an unknown entry, or wrong values; the message names the
                file and the entry.
            OSError: a file cannot be read.
        """
        from .._lib.documents import about

        tables = read_study_file(path)
        solver = tables.pop("solver", {})
        parts = {name: tables.pop(name) for name in TABLES if name in tables}
        grid = tables.get("grid", {})
        with about(path):
            if parts and "setup" in tables:
                raise ValueError(
                    "[setup] is of the published snake alone: beside other parts give "
                    "polar.name, body.node_set and body.nodes"
                )
            if parts:
                tables["case"] = case_of(parts, Path(path).parent)
            if grid:
                tables["grid"] = expanded(grid)
            return cls(**tables, **solver)


def base_of(
    setup: Mapping[str, Any],
    case: Case | None,
    glider: Glider | None = None,
    launch: Launch | None = None,
    ends: Any = None,
) -> tuple[Case, dict[str, Any]]:
    """The base case that is given, whole or in parts, or the published snake.

    Returns:
        The case, and the full setup of the published snake; of any other base it is empty.

    Raises:
        TypeError: a part of another type.
        ValueError: two bases, or an unknown setting.
    """
    parts = {"glider": glider, "launch": launch, "ends": ends}
    given = [name for name, part in parts.items() if part is not None]
    if case is not None:
        check_kind("case", case, Case)
        if given or setup:
            other = given[0] if given else "setup"
            raise ValueError(f"give a case or {other}, not both")
        return case, {}
    if glider is not None and setup:
        raise ValueError("setup is of the published snake: a glider of one's own has its own")
    base = published_case(setup) if glider is None else Case(glider)
    if not given:
        return base, check_setup(setup)
    launch = base.launch if launch is None else launch
    ends = base.ends if ends is None else ends
    return Case(base.glider, launch, ends, base.follow), {}


def fixed_case(case: Case, fixed: Mapping[str, float]) -> Case:
    """A case with other values, which do not follow from others any more."""
    given = {case.path(name) for name in fixed}
    case = case.replace(fixed)
    follow = tuple(path for path in case.follow if path not in given)
    return floats_as_arrays(Case(case.glider, case.launch, case.ends, follow))


def _named(case: Case, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values by the briefest name that means each, checked.

    Raises:
        ValueError: an unknown name, one of several numbers, two that mean the same, or a
            value out of range.
    """
    found = {}
    for name, value in values.items():
        path = case.path(name)
        if case.name(path) in found:
            raise ValueError(f"{name} is named twice: it means {path}")
        _check_single(case, name, path)
        case.check({name: value})
        found[case.name(path)] = value
    return found


def check_above_ground(case: Case, values: Mapping[str, Any], paired: bool = False) -> None:
    """Raise `ValueError` where a launch would not be above the ground that ends the flight.

    Args:
        case: the base.
        values: by name, those that are varied and fixed; of each any that there may be.
        paired: whether the n-th values of all go together, else every combination is meant.
    """
    given = {case.path(name): np.asarray(value) for name, value in values.items()}
    for k, end in enumerate(case.ends):
        if isinstance(end, Ground):
            launched = given.get("launch.height", np.asarray(case.launch.height))
            level = given.get(f"ends[{k}].level", np.asarray(end.level))
            if not paired:
                launched, level = launched.min(), level.max()
            launched, level = np.broadcast_arrays(launched, level)
            under = np.flatnonzero(launched <= level)
            if under.size:
                height, ground = launched.flat[under[0]], level.flat[under[0]]
                raise ValueError(
                    f"height = {height:g} m is not allowed: the launch must be above the "
                    f"ground at {ground:g} m that ends the flight"
                )


def _check_single(case: Case, name: str, path: str) -> None:
    """Raise `ValueError` unless a path means one number."""
    value = case.value(path)
    if np.ndim(value):
        raise ValueError(
            f"{name} is not one number but of shape {np.shape(value)}: name one of them, such "
            f"as {name}[{','.join('0' * np.ndim(value))}]"
        )


def nodes_of(case: Case) -> int:
    """How many nodes a body has."""
    return jax.eval_shape(lambda: case.glider.body.sections().chord).shape[0]
