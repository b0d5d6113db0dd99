"""A problem of optimisation, and its values and gradients at many points."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, InitVar, dataclass, field
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import as_number, check_range
from .._lib.defaults import GRADIENT_SETUP as SETUP
from .._lib.defaults import SEARCH_TOLERANCE
from .._lib.records import encode
from .._lib.types import Array, Float, Scalar
from ..ensemble.study import base_of, check_above_ground, fixed_case
from ..flight.case import Case
from ..flight.dynamics import Glider
from ..flight.ends import AbstractEnd
from ..flight.launch import Launch
from .objective import Constraint, Objective, Trial, plain


class Evaluation(NamedTuple):
    """Values at S points: the objective and m slacks, and their gradients.

    Attributes:
        values: (S, 1 + m).
        gradients: by the n parameters in their units, (S, 1 + m, n).
    """

    values: np.ndarray
    gradients: np.ndarray

    @property
    def slacks(self) -> np.ndarray:
        """Slacks of the constraints, (S, m)."""
        return self.values[:, 1:]

    @property
    def finite(self) -> np.ndarray:
        """Where every value and gradient is finite, (S,)."""
        ordinary = np.isfinite(self.values).all(axis=1)
        return np.logical_and(ordinary, np.isfinite(self.gradients).all(axis=(1, 2)))


def _bounds(case: Case, free: Any) -> dict[str, tuple[float, float]]:
    """Bounds by name, from those or from names alone; see `Problem`."""
    if not isinstance(free, Mapping):
        if not isinstance(free, Iterable):
            raise TypeError(f"free = {free!r} is neither bounds by name nor a list of names")
        names = [free] if isinstance(free, str) else list(free)
        ranges = {name: case.parameter(name).observed for name in names}
        for name, observed in ranges.items():
            if observed is None:
                known = [case.name(p) for p, about in case.parameters.items() if about.observed]
                raise ValueError(
                    f"give bounds of {name!r}: ranges observed are of {', '.join(known)}"
                )
            if names.count(name) > 1:
                raise ValueError(f"{name} is named twice among what is free")
        free = ranges
    if not free:
        raise ValueError("no parameter is free")
    bounds = {}
    for name, ends in free.items():
        case.check({name: ends})
        if np.shape(ends) != (2,) or not ends[0] < ends[1]:
            raise ValueError(f"bounds of {name} are {ends}, not lowest and highest")
        bounds[name] = float(ends[0]), float(ends[1])
    return bounds


class Asked(NamedTuple):
    """What of a problem is part of a compiled function."""

    objective: Objective
    constraints: tuple[Constraint, ...]
    free: tuple[str, ...]


class Given(NamedTuple):
    """What is not: other numbers compile nothing."""

    case: Case
    rtol: Scalar
    atol: Scalar
    max_time: Scalar


def trial_at(asked: Asked, given: Given, x, kind=Trial) -> Trial:
    """What is judged at a point (n,)."""
    case = given.case.replace(dict(zip(asked.free, x, strict=True)))
    limits = {name: getattr(given, name) for name in ("rtol", "atol", "max_time")}
    return kind(case.glider, case.launch, ends=case.ends, **limits)


def judged(asked: Asked, trial: Trial) -> Float[Array, " v"]:
    """The objective and the slacks of the constraints, (1 + m,)."""
    slacks = [constraint.slack(trial) for constraint in asked.constraints]
    return jnp.stack([asked.objective.value(trial), *slacks])


def values_at(asked: Asked, given: Given, x) -> Float[Array, " v"]:
    """The same at a point (n,)."""
    return judged(asked, trial_at(asked, given, x))


@dataclass(frozen=True, eq=False)
class Problem:
    """What to make as large as possible, by changing what, within which limits.

    Every float of a base case can be free or fixed, one of a part of a user's own too. It is
    named by its path or its short name, `gait.nu_theta` or `nu_theta` (see `Case`).

    Args:
        objective: what to maximise (see `Objective.wanted`).
        free: bounds by name, in the unit people read; a sequence of names takes the ranges
            observed in flight.
        constraints: inequalities to meet.
        fixed: values of other floats by name, in the unit people read.
        setup: "polar", "node_set", "nodes" of the published snake, where there is no `case`;
            smooth polar, Gauss nodes where not given.
        rtol, atol: tolerances of the glides.
        max_time: longest flight [s].
        case: glider, launch and ends that are varied; by default the published snake from
            10 m, its amplitude on the shape line and its mass that of its length.
        glider, launch, ends: the same in parts, instead of `case`.

    Problems are equal that ask the same, of the same objects as objective and constraints.

    Attributes:
        base: the case with what is fixed, every float of it an array.

    Raises:
        ValueError: an unknown name, bounds out of range or without room between them.
        TypeError: what is no objective, constraint or case.

    Examples:
        >>> from jaxglide import Problem, landing_distance, stability_margin
        >>> problem = Problem(
        ...     landing_distance,
        ...     {"d_psi": (-10, 40), "nu_theta": (1, 1.5)},
        ...     [stability_margin.at_least(10, scale=10)],
        ...     fixed={"height": 5},
        ... )
        >>> problem.names
        ('d_psi', 'nu_theta')
    """

    objective: Objective
    free: Any
    constraints: tuple[Constraint, ...] = ()
    fixed: Mapping[str, float] | None = None
    setup: Mapping[str, Any] | None = None
    rtol: float = SEARCH_TOLERANCE
    atol: float = SEARCH_TOLERANCE
    max_time: float = 60.0
    _: KW_ONLY
    case: Case = None  # type: ignore[assignment]
    glider: InitVar[Glider | None] = None
    launch: InitVar[Launch | None] = None
    ends: InitVar[AbstractEnd | Sequence[AbstractEnd] | None] = None
    base: Case = field(init=False, repr=False)

    def __post_init__(self, glider, launch, ends):
        if not isinstance(self.objective, Objective):
            raise TypeError(f"objective = {self.objective!r} is not an Objective")
        constraints = self.constraints
        constraints = (constraints,) if isinstance(constraints, Constraint) else constraints
        for constraint in constraints:
            if not isinstance(constraint, Constraint):
                raise TypeError(
                    f"{constraint!r} is not a Constraint: say objective.at_least(bound)"
                )
        for name in ("fixed", "setup"):
            given = getattr(self, name)
            if not isinstance(given, Mapping | None):
                raise TypeError(f"{name} = {given!r} is not values by name")
        setup = dict(self.setup or {})
        if self.case is None and glider is None:
            setup = SETUP | setup
        case, setup = base_of(setup, self.case, glider, launch, ends)
        free, fixed = _bounds(case, self.free), dict(self.fixed or {})
        fixed = {name: as_number(name, value) for name, value in fixed.items()}
        case.check(fixed)
        taken: dict[str, str] = {}
        for kind, names in (("free", free), ("fixed", fixed)):
            for name in names:
                other = taken.setdefault(case.path(name), kind)
                if other != kind:
                    raise ValueError(f"{name} is both free and fixed")
        if len(taken) < len(free) + len(fixed):
            raise ValueError(f"{', '.join((*free, *fixed))} name one float twice")
        check_above_ground(case, fixed | free)
        for name in ("rtol", "atol"):
            check_range(name, getattr(self, name), "", 0, 0.1, low_open=True, shape=())
        check_range("max_time", self.max_time, "s", 0, 1e4, low_open=True, shape=())
        plain = {name: float(getattr(self, name)) for name in ("rtol", "atol", "max_time")}
        plain |= {"case": case, "setup": setup, "free": free, "fixed": fixed}
        plain["base"] = fixed_case(case, fixed)
        for name, value in {**plain, "constraints": tuple(constraints)}.items():
            object.__setattr__(self, name, value)

    def _identity(self) -> tuple:
        fixed, setup = (tuple(sorted((p or {}).items())) for p in (self.fixed, self.setup))
        asked = self.objective, tuple(self.free.items()), self.constraints, fixed, setup
        return (*asked, self.rtol, self.atol, self.max_time)

    def __eq__(self, other) -> bool:
        if not isinstance(other, Problem):
            return NotImplemented
        same = self._identity() == other._identity()
        return same and bool(eqx.tree_equal(self.case, other.case))

    def __hash__(self) -> int:
        return hash(self._identity())

    def at(self, point: Mapping[str, float]) -> Case:
        """The case at values of free parameters by name."""
        return self.base.replace(point)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, n of them."""
        return tuple(self.free)

    @property
    def low(self) -> np.ndarray:
        """Lowest values, (n,)."""
        return np.array([ends[0] for ends in self.free.values()])

    @property
    def high(self) -> np.ndarray:
        """Highest values, (n,)."""
        return np.array([ends[1] for ends in self.free.values()])

    @property
    def asked(self) -> Asked:
        """What of it is part of a compiled function."""
        return Asked(self.objective, self.constraints, self.names)

    def given(self, rtol=None, atol=None) -> Given:
        """What of it is not; tolerances default to its own."""
        rtol = self.rtol if rtol is None else rtol
        atol = self.atol if atol is None else atol
        numbers = (jnp.asarray(x, float) for x in (rtol, atol, self.max_time))
        return Given(self.base, *numbers)

    def values(self, x, rtol=None, atol=None):
        """The objective and the slacks of the constraints at a point (n,), (1 + m,)."""
        return values_at(self.asked, self.given(rtol, atol), x)

    def answer(self, found: Evaluation, count: int, gradients: bool) -> Evaluation:
        """What an evaluator found at `count` points, in float64, checked.

        Raises:
            ValueError: arrays of another shape; gradients are dropped if not asked for.
        """
        if not isinstance(found, Evaluation):
            raise TypeError(f"the evaluator gave a {type(found).__name__}, not an Evaluation")
        shape = count, 1 + len(self.constraints)
        full = *shape, len(self.names)
        values, slopes = (np.asarray(part, float) for part in found)
        slopes = slopes if gradients else np.empty((*shape, 0))
        for what, array, right in (("values", values, shape), ("gradients", slopes, full)):
            if array.shape != right and (gradients or array is values):
                raise ValueError(
                    f"the evaluator gave {what} of shape {array.shape}: {right} was asked for"
                )
        return Evaluation(values, slopes)

    def describe(self) -> dict[str, Any]:
        """The problem in plain values."""
        return {
            "objective": self.objective.name,
            "free": {name: list(ends) for name, ends in self.free.items()},
            "constraints": [f"{c} (scale {plain(c.scale)})" for c in self.constraints],
            "fixed": dict(self.fixed or {}),
            "setup": dict(self.setup or {}),
            "case": encode(self.case),
            "rtol": self.rtol,
            "atol": self.atol,
            "max_time": self.max_time,
        }
