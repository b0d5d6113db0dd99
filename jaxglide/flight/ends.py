"""What ends a flight.

An end is positive in flight and zero where the flight is over. Which of them ended it is told
by a code: those of `Outcome`, and from 7 on the other ends in the order in which they were
given.
"""

import abc
import enum
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_given, check_kind, is_traced, radians, result_of
from .._lib.fields import Part, about, as_names, floats, recheck
from .._lib.types import Array, Float, Scalar, State, Vec3
from ..shape.shapes import as_module
from .dynamics import ANGLES, POSITION

ANGLE_LIMIT = np.deg2rad(85.0)
"""A glide whose |yaw|, |pitch| or |roll| reaches this is unstable, by default [rad]."""
TURNS = ("yaw", "pitch", "roll")


class Outcome(enum.IntEnum):
    """How a flight ended; `str()` gives the words. See `outcome_words` for other ends."""

    LANDED = 0
    UNSTABLE_YAW = 1
    UNSTABLE_PITCH = 2
    UNSTABLE_ROLL = 3
    OUT_OF_TIME = 4
    OUT_OF_STEPS = 5
    NON_FINITE = 6

    def __str__(self) -> str:
        return _WORDS[self]


_WORDS = {
    Outcome.LANDED: "landed",
    Outcome.UNSTABLE_YAW: "unstable in yaw",
    Outcome.UNSTABLE_PITCH: "unstable in pitch",
    Outcome.UNSTABLE_ROLL: "unstable in roll",
    Outcome.OUT_OF_TIME: "ran out of time",
    Outcome.OUT_OF_STEPS: "ran out of steps",
    Outcome.NON_FINITE: "not finite",
}
_OTHERS = len(Outcome)  # the first code of an end without one


class AbstractEnd(Part):
    """What ends a flight: the seam for an end of one's own.

    Attributes:
        steady: whether it depends on place and attitude alone (class variable). Then a step
            in whose midst it is passed and left again is cut short to see it; of others only
            changes of sign from step to step, at most 0.05 s long, are seen.
    """

    steady: ClassVar[bool] = False

    @property
    @abc.abstractmethod
    def words(self) -> tuple[str, ...]:
        """How a flight ended that each of the k numbers ended, such as "landed"."""

    @abc.abstractmethod
    def __call__(self, time: Scalar, state: State) -> Float[Array, " k"]:
        """k numbers, positive in flight, the end where one of them is zero.

        Once differentiable where they are zero. Everything may be traced.

        Args:
            time: since launch [s].
            state: as described in `dynamics`, (13 or more,).
        """

    @property
    def codes(self) -> tuple[int, ...] | None:
        """Codes of `Outcome`, k of them; None for what has none."""
        return None


class Ground(AbstractEnd):
    """The ground: z = 0, or another height.

    Args:
        level: its height [m].
    """

    level: Scalar = eqx.field(
        converter=floats,
        default=0.0,
        metadata=about("m", "height of the ground", low=-1e5, high=1e5),
    )
    steady: ClassVar[bool] = True

    @property
    def words(self):
        return (str(Outcome.LANDED),)

    @property
    def codes(self):
        return (int(Outcome.LANDED),)

    def __call__(self, time, state):
        return state[2:3] - self.level


class AngleLimit(AbstractEnd):
    """A limit of yaw, pitch and roll, beyond which a glide counts as unstable.

    Args:
        limit: [rad], above 0; the pitch never gets beyond 90 degrees, yaw and roll count
            whole turns.
        angles: which of "yaw", "pitch", "roll" it holds for (static); a flight that is to
            turn has none for yaw.

    Raises:
        ValueError: a limit out of range, or another name.

    Examples:
        >>> from jaxglide import AngleLimit, Ground
        >>> ends = Ground(), AngleLimit.degrees(60, ("pitch", "roll"))
        >>> print([word for end in ends for word in end.words])
        ['landed', 'unstable in pitch', 'unstable in roll']
    """

    limit: Scalar = eqx.field(
        converter=floats,
        default=ANGLE_LIMIT,
        metadata=about("deg", "limit of the angles", low=0, high=1e4, low_open=True),
    )
    angles: tuple[str, ...] = eqx.field(static=True, converter=as_names, default=TURNS)
    steady: ClassVar[bool] = True

    def _check(self):
        given = self.angles if isinstance(self.angles, tuple) else ()
        if not given or any(given.count(n) > 1 or n not in TURNS for n in given):
            raise ValueError(
                f"angles = {self.angles} is not allowed: it must name yaw, pitch or roll, each "
                "once"
            )

    @classmethod
    def degrees(cls, limit=85.0, angles: str | Sequence[str] = TURNS) -> "AngleLimit":
        """The same with the limit in degrees."""
        return cls(radians(limit), angles)

    @property
    def words(self):
        return tuple(f"unstable in {name}" for name in self.angles)

    @property
    def codes(self):
        return tuple(1 + TURNS.index(name) for name in self.angles)

    def __call__(self, time, state):
        index = np.array([TURNS.index(name) for name in self.angles])
        found = state[ANGLES] if self.angles == TURNS else state[ANGLES][index]
        return self.limit - jnp.abs(found)


class Plane(AbstractEnd):
    """A plane: normal . position = offset, flown towards from where it is less.

    Args:
        normal: inertial axes, (3,), of any length but 0.
        offset: [m], times the length of `normal`.
    """

    normal: Vec3 = eqx.field(
        converter=floats, metadata=about("", "normal of the plane", low=-1e5, high=1e5)
    )
    offset: Scalar = eqx.field(
        converter=floats, metadata=about("m", "place of the plane", low=-1e6, high=1e6)
    )
    steady: ClassVar[bool] = True

    def _check(self):
        if not is_traced(self.normal) and not np.any(np.asarray(self.normal)):
            raise ValueError("normal = (0, 0, 0) is not allowed: it has no direction")

    @property
    def words(self):
        return ("reached the plane",)

    def __call__(self, time, state):
        return (self.offset - jnp.sum(self.normal * state[POSITION]))[None]


class TimeLimit(AbstractEnd):
    """A time.

    Args:
        end_time: since launch [s].
    """

    end_time: Scalar = eqx.field(
        converter=floats, metadata=about("s", "time at which the flight ends", low=0, high=1e4)
    )

    @property
    def words(self):
        return ("reached its time",)

    def __call__(self, time, state):
        return jnp.asarray(self.end_time - time)[None]


class End(AbstractEnd):
    """An end from one function.

    Args:
        function: of time [s] and state, (13 or more,), to one number, positive in flight,
            zero where it ends: pure, once differentiable. If it is a module its floats are
            parameters. Give a plain function once, not a new one every time.
        word: how a flight ended that it ended, such as "reached the tree" (static).

    Raises:
        TypeError: that is no function.
        ValueError: it gives another shape than one number.

    Examples:
        >>> import jax.numpy as jnp
        >>> from jaxglide import End
        >>> def above_the_pond(time, state):
        ...     return state[2] - 0.5
        ...
        >>> pond = End(above_the_pond, "reached the pond")
        >>> print(pond(0.0, jnp.arange(13.0)), pond.words)
        [1.5] ('reached the pond',)
    """

    function: Callable[..., Any] = eqx.field(converter=as_module)
    word: str = eqx.field(static=True)

    def _check(self):
        if not callable(self.function):
            raise TypeError(f"function = {self.function!r} is not a function")
        if not isinstance(self.word, str) or not self.word:
            raise TypeError(f"word = {self.word!r} is not a text")
        state = jax.ShapeDtypeStruct((13,), float)
        found = result_of("function", self.function, jnp.zeros(()), state)
        if getattr(found, "shape", None) != ():
            shape = getattr(found, "shape", None)
            raise ValueError(
                f"function of the end {self.word!r} gives shape {shape}: it must be one number"
            )

    @property
    def words(self):
        return (self.word,)

    def __call__(self, time, state):
        return jnp.asarray(self.function(time, state))[None]


def default_ends() -> tuple[AbstractEnd, ...]:
    """The ground, and 85 degrees of yaw, pitch or roll, as published."""
    return Ground(), AngleLimit()


def check_ends(ends: Any) -> tuple[AbstractEnd, ...]:
    """Ends as a tuple; one alone will do.

    Raises:
        TypeError: what is no end.
    """
    if not isinstance(ends, tuple | list):
        ends = (ends,)
    ends = tuple(ends)
    for k, end in enumerate(ends):
        recheck(check_kind(f"ends[{k}]", end, AbstractEnd))
    return ends


def outcome_codes(ends: Sequence[AbstractEnd]) -> np.ndarray:
    """Codes of all numbers of all ends, one after the other."""
    codes, other = [], _OTHERS
    for end in ends:
        own = end.codes
        if own is None:
            own = tuple(range(other, other + len(end.words)))
            other += len(own)
        codes.extend(own)
    return np.array(codes, int)


def outcome_words(ends: Sequence[AbstractEnd]) -> dict[int, str]:
    """How a flight ended, by code: those of `Outcome`, and the other ends'."""
    words = [word for end in ends for word in end.words]
    return {int(o): str(o) for o in Outcome} | dict(
        zip(outcome_codes(ends).tolist(), words, strict=True)
    )


def clearance(ends: Sequence[AbstractEnd], time: Scalar, state: State) -> Float[Array, " k"]:
    """The numbers of all ends, one after the other: positive in flight."""
    numbers = [end(time, state) for end in ends]
    for end, found in zip(ends, numbers, strict=True):
        check_given(f"what {type(end).__name__} gives", found, (len(end.words),))
    return jnp.concatenate(numbers)
