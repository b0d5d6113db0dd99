"""What a case is, as a record: so that a store is never continued by another model."""

from collections.abc import Mapping
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.fingerprint import fingerprint
from .._lib.records import OwnPartError, decode, encode, own_parts
from ..body.sections import discretise
from ..flight.case import Case
from ..flight.dynamics import RIGID, Flight, six_degrees_of_freedom, with_own_states
from ..flight.ends import clearance
from ..flight.launch import take_off
from ..flight.parts import PARTS


def floats_as_arrays(case: Case) -> Case:
    """The case with every float in it as an array: what is traced."""

    def one(leaf):
        return jnp.asarray(leaf, float) if isinstance(leaf, float) else leaf

    return jax.tree.map(one, case)


def own_parts_of(case: Case) -> list[str]:
    """Names of the classes and functions in a case that no file brings back."""
    return list(own_parts(encode(case), PARTS))


def case_record(case: Case) -> dict[str, Any]:
    """A case as plain values: equal for cases that fly alike, to the last bit.

    Returns:
        `parts`, the record of all its parts, and `computed`, where some are a user's own, a
        digest of what is computed; else None.
    """
    computed, parts = None, encode(case)
    if list(own_parts(parts, PARTS)):
        arrays, static = eqx.partition(floats_as_arrays(case), eqx.is_array)
        now = jnp.zeros(())
        computed = fingerprint(lambda a, t: _computed(a, static, t), arrays, now)
    return {"parts": parts, "computed": computed}


def case_of_record(record: Mapping[str, Any]) -> Case:
    """The case of a record.

    Raises:
        ValueError: it has parts of a user's own, or is no such record.
    """
    try:
        case = decode(record.get("parts"), PARTS)
    except OwnPartError as error:
        raise ValueError(f"{error}: give the study's case") from None
    if not isinstance(case, Case):
        raise ValueError("the base of the study is no Case")
    return case


def _computed(arrays: Case, static: Case, time):
    """What a flight of a case computes, but for the solver: launch, rates, ends."""
    case = eqx.combine(arrays, static)
    sections = discretise(case.glider.body)
    start = take_off(case.glider, case.launch, sections, diffrax.ForwardMode())
    flight = Flight(case.glider, sections, start.phi_theta)
    rates = six_degrees_of_freedom(time, start.state, flight)
    return start, rates, clearance(case.ends, time, start.state) if case.ends else None


def state_size(case: Case) -> int:
    """How many numbers the state of a flight has."""
    arrays, static = eqx.partition(floats_as_arrays(case), eqx.is_array)

    def start(arrays):
        glider, zero = eqx.combine(arrays, static).glider, jnp.zeros(())
        return with_own_states(
            zero, jnp.zeros(RIGID), Flight(glider, discretise(glider.body), zero)
        )

    return jax.eval_shape(start, arrays).shape[0]
