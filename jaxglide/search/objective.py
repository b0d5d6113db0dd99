"""What is judged, how, and with which arithmetic: trials, objectives, constraints.

The objectives themselves are in `objectives`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_range
from .._lib.numerics import safe_sqrt
from .._lib.types import Array, Scalar
from ..body.sections import Sections, discretise
from ..flight.dynamics import VELOCITY, Glider
from ..flight.ends import AbstractEnd, AngleLimit, Ground, Outcome, check_ends, default_ends
from ..flight.glide import Glide, simulate
from ..flight.launch import Launch
from ..shape.kinematics import Backbone, backbone
from ..shape.motion import Bending, at_rest
from ..steady import SteadyGlide, steady_glide


class Trial:
    """A glider and launch under judgement; flies at most once, however many ask.

    Args:
        glider, launch: what is judged.
        **options: how to solve and what ends the flight; keyword arguments of `simulate`.

    Attributes:
        known: its steady glide, a function of the glider, where a search has found it before.
    """

    known: Callable[[Glider], SteadyGlide] | None = None

    def __init__(self, glider: Glider, launch: Launch | None = None, **options):
        self.glider = glider
        self.launch = Launch() if launch is None else launch
        self.options = options

    @classmethod
    def of(cls, glide: Glide) -> "Trial":
        """The judgement of a glide that has been flown."""
        settings = glide.settings
        limits = {name: getattr(settings, name) for name in ("rtol", "atol", "max_time")}
        trial = cls(glide.glider, glide.launch, ends=settings.ends, **limits)
        trial.glide = glide
        return trial

    @cached_property
    def ends(self) -> tuple[AbstractEnd, ...]:
        ends = self.options.get("ends")
        return default_ends() if ends is None else check_ends(ends)

    @cached_property
    def sections(self) -> Sections:
        return discretise(self.glider.body)

    @cached_property
    def glide(self) -> Glide:
        return simulate(self.glider, self.launch, **self.options)

    @cached_property
    def steady(self) -> SteadyGlide:
        """The glide that it would settle into; NaN where none is found."""
        return steady_glide(self.glider) if self.known is None else self.known(self.glider)

    @cached_property
    def ground(self) -> Ground:
        """The ground among the ends; `ValueError` where there is none."""
        for end in self.ends:
            if isinstance(end, Ground):
                return end
        raise ValueError(
            "ends hold no Ground: distance, duration, sink rate and margin are those to it"
        )

    @cached_property
    def limits(self) -> tuple[AngleLimit, ...]:
        """The limits of the angles among the ends; `ValueError` where there is none."""
        found = tuple(end for end in self.ends if isinstance(end, AngleLimit))
        if not found:
            raise ValueError("ends hold no AngleLimit: there is no margin of stability to one")
        return found

    def cycle(self, fraction, phase) -> Bending:
        """Bending at a phase [rad] of the motion's cycle, derivatives by phase.

        Raises:
            ValueError: it has no cycle.
        """
        bent = self.glider.gait.cycle(fraction, self.sections.neck_fraction, phase)
        if bent is None:
            kind = type(self.glider.gait).__name__
            raise ValueError(
                f"gait = {kind} has no cycle: curvature, power and clearance are those of one"
            )
        return bent

    def moving(self, phase) -> Backbone:
        """The body as it moves at launch, at a phase [rad] of the motion's cycle."""
        sections, gait = self.sections, self.glider.gait
        self.cycle(sections.fraction, phase)
        time, own = jnp.zeros_like(phase), gait.start(phase)
        given = sections.fraction, sections.neck_fraction, time, phase, own, at_rest()
        return backbone(sections, gait.bending(*given)[0])

    @cached_property
    def landed(self) -> Array:
        return self.glide.outcome == Outcome.LANDED

    @cached_property
    def height(self) -> Scalar:
        """Height of the launch above the ground [m]."""
        return self.launch.height - self.ground.level

    @cached_property
    def height_left(self) -> Scalar:
        """Height above the ground at the end [m], 0 for a landing."""
        above = self.glide.state[2] - self.ground.level
        return jnp.where(self.landed, 0.0, jnp.maximum(above, 0.0))

    @cached_property
    def drop_time(self) -> Scalar:
        """Time that a body without air takes from the end to the ground [s], inf for never."""
        v_z, gravity = self.glide.state[VELOCITY][2], self.glider.gravity
        root = safe_sqrt(v_z**2 + 2 * gravity * self.height_left)
        # (v_z + root)/g without cancellation for a falling body, and without gravity too
        down = 2 * self.height_left / jnp.where(root > v_z, root - v_z, 1.0)
        falls = jnp.where(root > v_z, down, jnp.inf)
        return jnp.where(self.height_left > 0, falls, 0.0)

    @cached_property
    def distance(self) -> Scalar:
        """Forward distance at the ground [m], continued."""
        return self.glide.state[1] + self.drop_time * self.glide.state[VELOCITY][1]

    @cached_property
    def path_length(self) -> Scalar:
        """Horizontal path length to the ground [m], continued."""
        v_x, v_y, _ = self.glide.state[VELOCITY]
        return self.glide.path_length + self.drop_time * safe_sqrt(v_x**2 + v_y**2)

    @cached_property
    def time(self) -> Scalar:
        """Duration to the ground [s], continued."""
        return self.glide.time + self.drop_time


def plain(number: float) -> str:
    """A number as briefly as is exact, without a decimal point where it is whole."""
    return repr(float(number)).removesuffix(".0")


def _number(value: Any) -> float | None:
    """A finite number in an objective's arithmetic, None for anything else."""
    if isinstance(value, str) or np.ndim(value):
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        return None
    check_range("a number beside an objective", number, "")
    return number


@dataclass(frozen=True)
class Objective:
    """A number to be made as large as possible, or kept in bounds.

    Call it with a glider and a launch; options are those of `simulate`.

    Args:
        name: in a word, or as a sum of words.
        unit: of its value.
        function: of a `Trial`.
        sense: 1 where more is better, -1 where less is.
    """

    name: str
    unit: str
    function: Callable[[Trial], Scalar]
    sense: int = 1

    __array_ufunc__ = None  # NumPy leaves the arithmetic to the methods below

    def __post_init__(self):
        if not isinstance(self.name, str) or not callable(self.function):
            raise TypeError(
                f"Objective({self.name!r}, ...) needs a name and a function of a Trial, "
                f"not {self.function!r}"
            )
        if self.sense not in (1, -1):
            raise ValueError(f"sense = {self.sense!r} is neither 1 (more is better) nor -1")

    def value(self, trial: Trial) -> Scalar:
        """Its value for a trial, checked to be one number."""
        value = jnp.asarray(self.function(trial), float)
        if value.ndim:
            raise ValueError(f"objective {self.name} has shape {value.shape}, not one number")
        return value

    def __call__(self, glider: Glider, launch: Launch | None = None, **options) -> Scalar:
        return self.value(Trial(glider, launch, **options))

    def __mul__(self, factor: float) -> "Objective":
        weight = _number(factor)
        if weight is None:
            return NotImplemented
        return Objective(
            f"{plain(weight)} * {self.name}",
            self.unit,
            lambda trial: weight * self.function(trial),
            self.sense if weight >= 0 else -self.sense,
        )

    __rmul__ = __mul__

    def __truediv__(self, divisor: float) -> "Objective":
        number = _number(divisor)
        if number is None:
            return NotImplemented
        if number == 0:
            raise ValueError(f"{self.name} cannot be divided by 0")
        return self * (1 / number)

    def __add__(self, other: "Objective | float") -> "Objective":
        if isinstance(other, Objective):
            return Objective(
                f"{self.name} + {other.name}",
                self.unit if self.unit == other.unit else "mixed",
                lambda trial: self.function(trial) + other.function(trial),
                self.sense if self.sense == other.sense else 1,
            )
        constant = _number(other)
        if constant is None:
            return NotImplemented
        if constant == 0:  # so that `sum` works
            return self
        return Objective(
            f"{self.name} + {plain(constant)}",
            self.unit,
            lambda trial: self.function(trial) + constant,
            self.sense,
        )

    __radd__ = __add__

    def __neg__(self) -> "Objective":
        return Objective(
            f"-{self.name}", self.unit, lambda trial: -self.function(trial), -self.sense
        )

    def __sub__(self, other: "Objective | float") -> "Objective":
        if not isinstance(other, Objective) and _number(other) is None:
            return NotImplemented
        total = self + (-other)
        name = other.name if isinstance(other, Objective) else plain(float(other))
        return Objective(f"{self.name} - {name}", total.unit, total.function, total.sense)

    def __rsub__(self, other: float) -> "Objective":
        return -self + other

    @property
    def wanted(self) -> "Objective":
        """The objective such that more is better."""
        return self if self.sense > 0 else -self

    def at_least(self, bound: float, scale: float = 1.0) -> "Constraint":
        """The constraint that the value is `bound` or more; `scale` as in `Constraint`."""
        return Constraint(self, bound, 1, scale)

    def at_most(self, bound: float, scale: float = 1.0) -> "Constraint":
        """The constraint that the value is `bound` or less."""
        return Constraint(self, bound, -1, scale)


@dataclass(frozen=True)
class Constraint:
    """An inequality that a solution has to meet.

    Args:
        objective: what is constrained.
        bound: in its unit.
        side: 1 for at least, -1 for at most.
        scale: a violation that weighs as much as one unit of what is optimised.

    Raises:
        ValueError: the bound is not finite or the scale not above 0.
    """

    objective: Objective
    bound: float
    side: int
    scale: float

    def __post_init__(self):
        if not isinstance(self.objective, Objective):
            raise TypeError(f"{self.objective!r} is not an Objective: it cannot be constrained")
        if self.side not in (1, -1):
            raise ValueError(f"side = {self.side!r} is neither 1 (at least) nor -1 (at most)")
        check_range(f"scale of {self.objective.name}", self.scale, "", 0, low_open=True)
        for name in ("bound", "scale"):
            value, unit = getattr(self, name), self.objective.unit
            check_range(f"{name} of {self.objective.name}", value, unit)
            if np.ndim(value):
                raise ValueError(f"{name} of {self.objective.name} is {value}, not one number")
            object.__setattr__(self, name, float(value))

    def __str__(self) -> str:
        return f"{self.objective.name} {'>=' if self.side > 0 else '<='} {plain(self.bound)}"

    def slack(self, trial: Trial) -> Scalar:
        """How far inside the bound the value lies, over the scale; negative outside."""
        return self.side * (self.objective.value(trial) - self.bound) / self.scale
