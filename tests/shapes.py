"""Shapes and kinds of arrays in the package's annotations, checked at every call.

Only those: what else an argument may be, the package tells in words of its own. NumPy's arrays
and plain numbers stand for JAX's, as they do for JAX.
"""

from inspect import isclass
from types import UnionType
from typing import Any, Union, get_args, get_origin

import numpy as np
from beartype import beartype
from jaxtyping import AbstractArray


def of_arrays(hint):
    """An annotation of arrays as it is checked; None for one that says nothing of any."""
    if isclass(hint) and issubclass(hint, AbstractArray):
        kinds = (hint.dtype[kind, hint.dim_str] for kind in (hint.array_type, np.ndarray))
        return Union[*kinds, *((np.generic, float, int) if hint.dim_str in ("", "...") else ())]
    outer, parts = get_origin(hint), get_args(hint)
    told = [of_arrays(part) for part in parts] if outer in (Union, UnionType, tuple) else []
    if not any(told):
        return None
    other = (part if part is ... else Any for part in parts) if outer is tuple else parts
    parts = tuple(one or part for one, part in zip(told, other, strict=True))
    return tuple[parts] if outer is tuple else Union[*parts]


def checked(function):
    """A function whose arguments and result are checked where they are arrays."""
    hints = function.__annotations__
    told = {name: of_arrays(hint) for name, hint in hints.items()}
    function.__annotations__ = {name: hint or Any for name, hint in told.items()}
    return beartype(function) if any(told.values()) else function
