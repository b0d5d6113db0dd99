"""A float described once, at the field that owns it.

`about` makes a module's field remember its unit, range, symbol and meaning, as metadata.
Checks, options of the command line, study files, bounds of searches, labels of axes and
attributes of files are all derived from that. A float is described in the unit that people
read; the module holds it in SI units and radians.
"""

import dataclasses
import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import equinox as eqx
import numpy as np

from .checks import check_range, check_shapes, floating, is_traced
from .documents import shown

_METADATA = "parameter"


@dataclasses.dataclass(frozen=True)
class Parameter:
    """What is known of a float before it has a value.

    Attributes:
        unit: unit in which people read it ("" for none).
        meaning: in words.
        symbol: in formulas and on axes, as LaTeX without dollars; "" for none.
        low, high: range, in that unit; excluded itself where `low_open`, `high_open`.
        observed: range observed in flying snakes, in that unit, or None.
        default: in that unit; None where it has none, or follows from others.
        optional: whether it may be None, and then follows from others.
        short: another unique name, or None.
        rule: what it follows from where it is not given: function of the module that owns it
            to its value in SI units and radians; None where it follows from nothing.
    """

    unit: str
    meaning: str
    symbol: str = ""
    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    high_open: bool = False
    observed: tuple[float, float] | None = None
    default: float | None = None
    optional: bool = False
    short: str | None = None
    rule: Callable[[Any], Any] | None = None

    @property
    def factor(self) -> float:
        """What a value in `unit` is multiplied by inside."""
        return math.pi / 180 if self.unit.startswith("deg") else 1.0

    @property
    def inner_unit(self) -> str:
        """Unit inside."""
        return "rad" if self.unit.startswith("deg") else self.unit

    def check(self, name: str, value: Any) -> None:
        """Raise `ValueError` unless a value in `unit`, or an array of them, is in range."""
        self._check(name, value, self.unit, self.low, self.high)

    def check_inside(self, name: str, value: Any) -> None:
        """The same of a value in SI units and radians."""
        ends = (self.factor * end for end in (self.low, self.high))
        self._check(name, value, self.inner_unit, *ends)

    def _check(self, name, value, unit, low, high):
        check_range(
            name, value, unit, low, high, low_open=self.low_open, high_open=self.high_open
        )


def floats(value: Any) -> Any:
    """Converter of a field: a float array, or what cannot be one unchanged, for
    `check_fields` to name."""
    if value is None:
        return None
    try:
        if not is_traced(value) and np.asarray(value).dtype.kind in "bcSU":
            return value
        return floating(value)
    except (TypeError, ValueError, OverflowError):
        return value


def as_names(value: Any) -> Any:
    """Converter of a field to a tuple of names, one alone too; else unchanged, to be named."""
    if isinstance(value, str):
        return (value,)
    return tuple(value) if isinstance(value, tuple | list) else value


def about(unit: str, meaning: str, **more: Any) -> dict[str, Parameter]:
    """Metadata of a field that holds a float, or an array of floats; see `Parameter`.

    The field's own default, in SI units and radians, is the parameter's too.
    """
    return {_METADATA: Parameter(unit, meaning, **more)}


@lru_cache
def parameters_of(kind: type) -> dict[str, Parameter]:
    """The parameters among the fields of a module's class, by name."""
    found = {}
    for field in dataclasses.fields(kind):
        known = field.metadata.get(_METADATA)
        if known is None:
            continue
        default = field.default
        if default is None:
            known = dataclasses.replace(known, optional=True)
        elif default is not dataclasses.MISSING and np.ndim(default) == 0:
            known = dataclasses.replace(known, default=float(default) / known.factor)
        found[field.name] = known
    return found


def check_fields(module: Any) -> None:
    """Raise unless every parameter of a module is a finite number in range, of its shape.

    Raises:
        TypeError: what is no number; the message names it.
        ValueError: a value out of range, or an array of another shape than annotated.
    """
    for name, known in parameters_of(type(module)).items():
        value = getattr(module, name)
        if value is None and known.optional:
            continue
        if value is None or getattr(value, "dtype", None) is None or value.dtype.kind != "f":
            raise TypeError(f"{name} = {shown(value)} is not a number")
    check_shapes(module)
    for name, known in parameters_of(type(module)).items():
        value = getattr(module, name)
        if value is not None:
            known.check_inside(name, value)


class Part(eqx.Module):
    """A module whose parameters are checked when it is made; see `recheck`."""

    def __check_init__(self):
        check_fields(self)
        self._check()

    def _check(self) -> None:
        """What is to be checked beyond single fields; called when these are right."""


def recheck(module: eqx.Module) -> None:
    """Check a module and all modules in it as when they were made.

    Their values may have been exchanged since.
    """
    for kind in reversed(type(module).__mro__):
        check = vars(kind).get("__check_init__")
        if check is not None:
            check(module)
    for field in dataclasses.fields(module):  # type: ignore[arg-type]
        inner = getattr(module, field.name, None)
        for one in inner if isinstance(inner, tuple | list) else (inner,):
            if isinstance(one, eqx.Module):
                recheck(one)
