"""Checks of what a user passes in.

Checks of values look at concrete ones only: inside `jit`, `grad` or `vmap` the values are
not known yet and every check passes, so the same constructors serve the front door and
traced code. Shapes are known there too, under `vmap` those of one lane, and always checked.
"""

import dataclasses
import reprlib
import sys
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from .types import Array


def is_traced(value: Any) -> bool:
    """Whether `value` is not known yet, inside `jit`, `grad` or `vmap`."""
    return isinstance(value, Tracer)


def all_known(*trees: Any) -> bool:
    """Whether nothing in `trees` is traced, nor what is computed of constants here."""
    return not any(map(is_traced, [*jax.tree.leaves(trees), jnp.add(0, 0)]))


def floating(value: Any) -> Array:
    """A float array of JAX. What is known is converted by NumPy: JAX would compile for it."""
    known = isinstance(value, Tracer | jax.Array)
    return jnp.asarray(value if known else np.asarray(value, jnp.result_type(float)), float)


def in_numpy(value: Any) -> Any:
    """The same in NumPy, whose arithmetic compiles nothing, unless it is traced."""
    return value if is_traced(value) else np.asarray(value)


def radians(degrees: Any) -> Any:
    """Degrees as radians, in NumPy unless they are traced."""
    return jnp.deg2rad(degrees) if is_traced(degrees) else np.deg2rad(np.asarray(degrees))


def number(name: str) -> Callable[[Any], Array]:
    """Converter of a field to a float array; `TypeError` names what is no number."""

    def convert(value: Any) -> Array:
        try:
            if not is_traced(value) and np.asarray(value).dtype.kind in "bcSU":
                raise TypeError
            return floating(value)
        except (TypeError, ValueError, OverflowError):
            raise TypeError(f"{name} = {value!r} is not a number") from None

    return convert


def optional_number(name: str) -> Callable[[Any], Array | None]:
    """The same for a field that may be None."""
    return lambda value: None if value is None else number(name)(value)


def _numeric(name: str, values: Any, kind: str) -> np.ndarray:
    """A float array of its own; `ValueError` for texts, booleans and uneven lists."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        array = np.asarray(None)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name} = {reprlib.repr(values)} is not {kind}")
    return array.astype(float)


def as_array(name: str, values: Any) -> np.ndarray:
    """Values as a float array (N,); `ValueError` where they are not a list of numbers."""
    array = _numeric(name, values, "a list of numbers")
    if array.ndim > 1 or array.size == 0:
        raise ValueError(f"{name} must be a list of numbers, not empty")
    return np.atleast_1d(array)


def as_number(name: str, value: Any) -> float:
    """A value as Python's float; `ValueError` where it is not one number."""
    array = _numeric(name, value, "a number")
    if array.ndim:
        raise ValueError(f"{name} = {reprlib.repr(value)} is not one number")
    return float(array)


def check_range(
    name: str,
    value: Any,
    unit: str,
    low: float = -np.inf,
    high: float = np.inf,
    *,
    low_open: bool = False,
    high_open: bool = False,
    shape: tuple | None = None,
) -> None:
    """Raise `ValueError` unless every element of `value` is finite and in range.

    Args:
        name: what the user calls the argument.
        value: a number or array of any shape; traced values are let through.
        unit: unit of `value` and of the bounds, for the message ("" for none).
        low, high: allowed range.
        low_open, high_open: whether the bound itself is excluded.
        shape: as in `check_shape`, where it matters.
    """
    if is_traced(value):
        if shape is not None:
            check_shape(name, value, shape)
        return
    try:
        array = np.asarray(value)
        if array.dtype.kind in "bcSU":
            raise TypeError
        array = array if array.dtype.kind == "f" else array.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"{name} = {value!r} is not a number") from None
    if shape is not None:
        check_shape(name, array, shape)
    # In the value's own precision: 180 degrees in float32 are a little more than pi.
    low, high = array.dtype.type(low), array.dtype.type(high)
    good = np.isfinite(array)
    good &= (array > low) if low_open else (array >= low)
    good &= (array < high) if high_open else (array <= high)
    if good.all():
        return
    worst = array[~good].flat[0]
    left = "(" if low_open or np.isinf(low) else "["
    right = ")" if high_open or np.isinf(high) else "]"
    suffix = f" {unit}" if unit else ""
    raise ValueError(
        f"{name} = {worst:g}{suffix} is not allowed: it must be finite and in "
        f"{left}{low:g}, {high:g}{right}{suffix}"
    )


def check_integer(name: str, value: Any, low: int, high: int) -> None:
    """Raise unless `value` is an integer in `[low, high]`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{name} = {value!r} is not a whole number")
    if not low <= value <= high:
        raise ValueError(f"{name} = {value} is not allowed: it must be in [{low}, {high}]")


def check_shape(name: str, value: Any, shape: tuple) -> None:
    """Raise `ValueError` unless an array has a shape, of sizes and of letters for any size."""
    found, sizes = np.shape(value), {}
    if len(found) == len(shape) and all(
        size == (sizes.setdefault(wanted, size) if isinstance(wanted, str) else wanted)
        for size, wanted in zip(found, shape, strict=True)
    ):
        return
    words = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)})"
    raise ValueError(f"{name} has shape {found}: it must be {words if shape else 'one number'}")


def check_given(what: str, value: Any, shape: tuple) -> None:
    """Raise unless what a part of a user's own gives is an array of a shape.

    Called where a function is traced, and only there: what is compiled pays nothing for it.
    """
    if getattr(value, "dtype", None) is None:
        raise TypeError(f"{what} is no array but of type {type(value).__name__}")
    check_shape(what, value, shape)


def result_of(what: str, function: Callable[..., Any], *given: Any) -> Any:
    """Shapes of what a function of a user's own will give, by `jax.eval_shape`.

    Raises:
        ValueError: it fails; the message says how.
    """
    try:
        return jax.eval_shape(function, *given)
    except Exception as error:
        said = str(error).strip().partition("\n")[0]
        raise ValueError(
            f"{what} cannot be used: it fails with {type(error).__name__}"
            + (f": {said}" if said else "")
        ) from error


@lru_cache
def _declared(kind: type) -> list[tuple[str, tuple]]:
    """Names of a module's array fields with the shapes that their annotations declare."""
    found = []
    for field in dataclasses.fields(kind):
        for hint in get_args(field.type) or (field.type,):
            declared = getattr(hint, "dim_str", None)
            if declared is not None:
                dims = (int(d) if d.isdecimal() else d for d in declared.split())
                found.append((field.name, tuple(dims)))
    return found


def check_shapes(module: Any) -> None:
    """Raise `ValueError` unless every array of a module has its field's annotated shape."""
    for name, shape in _declared(type(module)):
        value = getattr(module, name)
        if value is not None:
            check_shape(name, value, shape)


Kind = TypeVar("Kind")


def check_kind(name: str, value: Any, kind: type[Kind]) -> Kind:
    """`value`; `TypeError` unless it is a `kind`."""
    if isinstance(value, kind):
        return value
    given = "None" if value is None else type(value).__name__
    raise TypeError(f"{name} must be of type {kind.__name__}, not {given}")


def check_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Raise `ValueError` unless `value` is one of `choices`."""
    if value not in choices:
        raise ValueError(f"{name} = {value!r} is not one of {', '.join(choices)}")


def warn_float32(rtol: Any, atol: Any, dtype: Any = None) -> bool:
    """Warn, at the line that first called the package, of tolerances too tight for float32.

    Python shows a warning of one text and line once, however often it is given.

    Args:
        rtol, atol: tolerances of the solver; traced ones are let through.
        dtype: what is computed in; by default what JAX makes of a float.

    Returns:
        Whether they are.
    """
    dtype = jnp.result_type(float) if dtype is None else dtype
    if dtype != jnp.float32 or is_traced(rtol) or is_traced(atol) or min(rtol, atol) >= 1e-5:
        return False
    # JAX's own frames may stand between two of the package's.
    package, frame, depth, level = Path(__file__).parents[1], sys._getframe(), 1, 2
    while frame:
        if package in Path(frame.f_code.co_filename).parents:
            level = depth + 1
        frame, depth = frame.f_back, depth + 1
    warnings.warn(
        f"rtol = {rtol:g}, atol = {atol:g} are too tight for float32, whose steps cannot "
        "be that exact: call jax.config.update('jax_enable_x64', True) first, or use "
        "tolerances of 1e-5 or more",
        stacklevel=level,
    )
    return True
