"""What a case is, as a record: so that a store is never continued by another model."""

import hashlib
import inspect
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.fingerprint import fingerprint
from ..body.sections import discretise
from ..flight.case import Case
from ..flight.dynamics import Flight, six_degrees_of_freedom, with_own_states
from ..flight.ends import clearance
from ..flight.launch import take_off

_PACKAGE = __name__.split(".")[0]
_FEW = 64  # numbers of an array that are told one by one


def floats_as_arrays(case: Case) -> Case:
    """The case with every float in it as an array: what is traced."""

    def one(leaf):
        return jnp.asarray(leaf, float) if isinstance(leaf, float) else leaf

    return jax.tree.map(one, case)


def own_parts(case: Case) -> list[str]:
    """Names of the classes and functions in a case that are not the package's."""
    found: dict[str, None] = {}

    def look(value: Any) -> None:
        if isinstance(value, eqx.Module):
            kind = type(value)
            if kind.__module__.split(".")[0] != _PACKAGE:
                found[kind.__qualname__] = None
            for inner in vars(value).values():
                look(inner)
        elif isinstance(value, tuple | list):
            for inner in value:
                look(inner)
        elif inspect.isroutine(value) or inspect.isclass(value):
            found[value.__qualname__] = None

    look(case)
    return list(found)


def _computed(arrays: Case, static: Case, time):
    """What a flight of a case computes, but for the solver: launch, rates, ends."""
    case = eqx.combine(arrays, static)
    sections = discretise(case.glider.body)
    start = take_off(case.glider, case.launch, sections, diffrax.ForwardMode())
    flight = Flight(case.glider, sections, start.phi_theta)
    rates = six_degrees_of_freedom(time, start.state, flight)
    return start, rates, clearance(case.ends, time, start.state)


def _numbers(array) -> Any:
    """The numbers of an array, or a digest of many."""
    array = np.asarray(array)
    if array.size <= _FEW:
        return array.tolist()
    return hashlib.sha256(array.astype(float).tobytes()).hexdigest()[:32]


def case_record(case: Case) -> dict[str, Any]:
    """A case as plain values: equal for cases that fly alike, to the last bit.

    Of the package's own parts the case can be made again, see `case_of_record`; parts of a
    user's own are told by the names of their classes, their floats, and a digest of what
    is computed.
    """
    arrays, static = eqx.partition(floats_as_arrays(case), eqx.is_array)
    leaves, _ = jax.tree_util.tree_flatten_with_path(arrays)
    time = jnp.zeros(())
    return {
        "own": own_parts(case),
        "follow": list(case.follow),
        "floats": {jax.tree_util.keystr(path): _numbers(leaf) for path, leaf in leaves},
        "computed": fingerprint(lambda a, t: _computed(a, static, t), arrays, time),
    }


def case_of_record(record: dict[str, Any]) -> Case:
    """The case of a record.

    Raises:
        ValueError: it has parts of a user's own.
    """
    own = ", ".join(map(str, record.get("own", ()))) or "its own"
    raise ValueError(
        f"the study flies parts that only its program knows ({own}): give its case"
    )


def state_size(case: Case) -> int:
    """How many numbers the state of a flight has."""
    arrays, static = eqx.partition(floats_as_arrays(case), eqx.is_array)

    def start(arrays):
        glider = eqx.combine(arrays, static).glider
        zero = jnp.zeros(())
        flight = Flight(glider, discretise(glider.body), zero)
        return with_own_states(zero, jnp.zeros(13), flight)

    return jax.eval_shape(start, arrays).shape[0]
