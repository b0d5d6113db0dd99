"""From named values in the units people read to a glider and its launch."""

import reprlib
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_range
from .._lib.parameters import PARAMETERS
from ..air.air import StillAir
from ..body.snake import Snake
from ..flight.dynamics import Glider
from ..flight.launch import Launch
from ..loads.polar import Polar
from ..shape.gait import Gait, shape_line
from .base import check_setup as check_setup


def check_parameters(values: Mapping[str, Any]) -> None:
    """Raise `ValueError` for an unknown name or a value out of range."""
    for name, value in values.items():
        if name not in PARAMETERS:
            known = ", ".join(PARAMETERS)
            raise ValueError(f"there is no parameter {name!r}: known are {known}")
        p = PARAMETERS[name]
        check_range(
            name, value, p.unit, p.low, p.high, low_open=p.low_open, high_open=p.high_open
        )


def full_case(case: Mapping[str, Any]) -> dict[str, Any]:
    """The case with defaults filled in; the amplitude on the shape line."""
    given: dict[str, Any] = {name: p.default for name, p in PARAMETERS.items()} | dict(case)
    if given["theta_m"] is None:
        given["theta_m"] = shape_line(given["nu_theta"])
    return given


def build(case: Mapping[str, Any], setup: Mapping[str, Any]) -> tuple[Glider, Launch]:
    """The glider and launch of one case; may be traced.

    Args:
        case: values of `PARAMETERS` by name, in their units; the others take defaults.
        setup: "polar", "node_set" and "nodes", all given (see `check_setup`).
    """
    given = full_case(case)
    angles = {name: given[name] for name in ("theta_m", "psi_m", "d_psi", "d_theta")}
    gait = Gait.from_degrees(nu_theta=given["nu_theta"], f_theta=given["f_theta"], **angles)
    snake = Snake.from_svl(
        given["svl"],
        given["mass"],
        neck_fraction=given["neck_fraction"],
        nodes=setup["nodes"],
        node_set=setup["node_set"],
    )
    polar = Polar.from_name(setup["polar"], given["lift_scale"], given["drag_scale"])
    air = StillAir(**{name: given[name] for name in ("air_density", "kinematic_viscosity")})
    glider = Glider(snake, gait, polar, air, given["gravity"])
    elevation, heading = (
        jnp.deg2rad(jnp.asarray(given[name], float)) for name in ("elevation", "heading")
    )
    launch = Launch(given["height"], given["speed"], elevation=elevation, heading=heading)
    return glider, launch


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
