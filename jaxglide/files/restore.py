"""A saved glide made whole again: glider, launch and trajectory from its dataset."""

from collections.abc import Callable
from typing import Any, TypeVar

import diffrax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from .._lib.datasets import Schema, Variable, checked
from .._lib.parameters import PARAMETERS
from ..air.air import StillAir
from ..body.snake import Snake
from ..flight.dynamics import Glider
from ..flight.ends import Outcome, default_ends
from ..flight.glide import Glide
from ..flight.launch import Launch, TakeOff
from ..flight.solve import Settings
from ..loads.polar import Polar
from ..shape.gait import Gait

_Made = TypeVar("_Made")
_STATE = ("position", "velocity", "omega", "angles", "path_length")
_SI = {"deg": "rad", "deg/SVL": "rad"}
_GAIT = ("theta_m", "psi_m", "nu_theta", "f_theta", "d_psi", "d_theta")
_AIR = ("gravity", "air_density", "kinematic_viscosity")
_COEFFICIENTS = ("chord", "head_density", "body_density")


def _parameters(*names: str) -> dict[str, Variable]:
    """Single numbers in SI units and radians; what is made of them checks their range."""
    units = {name: PARAMETERS[name].unit for name in names}
    return {name: Variable((), _SI.get(unit, unit)) for name, unit in units.items()}


_MOVING, _TURN = ("time", "axis"), ("turn",)
_SNAKE = Schema("a glide's dimensions", _parameters("svl", "mass", "neck_fraction"), {})
_GLIDE = Schema(
    "a saved glide's variables",
    {
        **_SNAKE.variables,
        **_parameters(*_GAIT, *_AIR, "lift_scale", "drag_scale"),
        **_parameters("height", "elevation", "heading"),
        "time": Variable(("time",), "s", 0.0, 1e4),
        "position": Variable(_MOVING, "m"),
        "velocity": Variable(_MOVING, "m/s"),
        "omega": Variable(_MOVING, "rad/s"),
        "angles": Variable(("time", "turn"), "rad"),
        "path_length": Variable(("time",), "m"),
        "max_time": Variable((), "s", 0.0, 1e4, True),
        "max_angles": Variable(_TURN, "rad"),
        "launch_angles": Variable(_TURN, "rad"),
        "launch_phase": Variable((), "rad"),
        "launch_speed": Variable((), "m/s"),
    },
    sizes={"time": 10**6},
    labels={"axis": ("x", "y", "z"), "turn": ("yaw", "pitch", "roll")},
)
_SOMETIMES = {  # what a launch and a solver may have been given
    "speed": Variable((), "m/s"),
    "phi_theta": Variable((), "rad"),
    "launch_attitude": Variable(_TURN, "rad"),
    "spacing": Variable((), "m"),
    "step": Variable((), "s", 0.0, 1.0, True),
}


def snake_of(data: xr.Dataset) -> Snake:
    """The snake of a saved glide; `ValueError` where the dataset does not say."""
    return _or_refuse(lambda: _snake(_checked(data, _SNAKE)), data)


def glide_of(data: xr.Dataset) -> Glide:
    """The glide that `records.glide_dataset` made the dataset of.

    Between the saved times its trajectory is interpolated linearly.

    Args:
        data: over time [s], with what went into the glide in its coordinates.

    Raises:
        ValueError: the dataset lacks a variable or an attribute, or holds a wrong one; one
            sentence names it.
    """
    return _or_refuse(lambda: _glide(_checked(data, _GLIDE)), data)


def _checked(data: xr.Dataset, schema: Schema) -> xr.Dataset:
    if "svl" not in data.variables and "length" in data.attrs:
        raise ValueError(
            "this glide was saved by an older jaxglide, without units: fly it anew"
        )
    more = {name: v for name, v in _SOMETIMES.items() if name in data.variables}
    return checked(data, schema._replace(variables={**schema.variables, **more}))


def _or_refuse(make: Callable[[], _Made], data: xr.Dataset) -> _Made:
    source = str(data.encoding.get("source", "the dataset"))
    try:
        return make()
    except KeyError as error:
        raise ValueError(f"{source}: this is not a whole glide: it lacks {error}") from None
    except (TypeError, ValueError) as error:
        said = str(error).removeprefix(f"{source}: ")
        raise ValueError(f"{source}: this is not a whole glide: {said}") from None


def _numbers(data: xr.Dataset, *names: str) -> dict[str, float]:
    return {name: data[name].item() for name in names}


def _given(data: xr.Dataset, name: str) -> Any:
    """A number or an array, or None where there is none."""
    return data[name].values if name in data.variables else None


def _snake(data: xr.Dataset) -> Snake:
    attrs, spacing = data.attrs, _given(data, "spacing")
    return Snake(
        length=data["svl"].item(),
        **_numbers(data, "mass", "neck_fraction"),
        **{name: np.asarray(attrs[name], float) for name in _COEFFICIENTS},
        head_fraction=float(attrs["head_fraction"]),
        gyration=attrs.get("gyration"),
        nodes=int(attrs["nodes"]),
        node_set=str(attrs["node_set"]),  # type: ignore[arg-type]
        spacing=None if spacing is None else float(spacing),
    )


def _glide(data: xr.Dataset) -> Glide:
    attrs, step = data.attrs, _given(data, "step")
    polar = Polar.from_name(
        str(attrs["polar"]), *_numbers(data, "lift_scale", "drag_scale").values()
    )
    columns = [data[name].values.reshape(data.sizes["time"], -1) for name in _STATE]
    states, times = np.concatenate(columns, axis=1), data["time"].values
    if not (len(times) > 1 and (np.diff(times) > 0).all()):
        raise ValueError("time does not rise from entry to entry")
    outcomes = {str(outcome): outcome for outcome in Outcome}
    if attrs["outcome"] not in outcomes:
        raise ValueError(f"outcome = {attrs['outcome']!r} is no end of a glide")
    start = TakeOff(
        jnp.asarray(data["launch_phase"].item()),
        jnp.asarray(data["launch_angles"].values),
        jnp.asarray(data["launch_speed"].item()),
        jnp.asarray(states[0]),
    )
    launch = Launch(
        **_numbers(data, "height", "elevation", "heading"),
        **{name: _given(data, name) for name in ("speed", "phi_theta")},
        angles=_given(data, "launch_attitude"),
    )
    settings = Settings(
        rtol=jnp.asarray(float(attrs["rtol"])),
        atol=jnp.asarray(float(attrs["atol"])),
        times=None,
        ends=default_ends(),
        solver=diffrax.Dopri5(),
        step=None if step is None else float(step),
        max_time=jnp.asarray(data["max_time"].item()),
        max_steps=int(attrs["max_steps"]),
        dense=bool(attrs["dense"]),
    )
    gait, air = Gait(**_numbers(data, *_GAIT)), StillAir(**_numbers(data, *_AIR[1:]))
    return Glide(
        glider=Glider(_snake(data), gait, polar, air, data["gravity"].item()),
        launch=launch,
        settings=settings,
        take_off=start,
        outcome=jnp.asarray(int(outcomes[attrs["outcome"]])),
        time=jnp.asarray(times[-1]),
        state=jnp.asarray(states[-1]),
        max_angles=jnp.asarray(data["max_angles"].values),
        accepted=jnp.asarray(int(attrs["accepted"])),
        rejected=jnp.asarray(int(attrs["rejected"])),
        states=None,
        interpolation=diffrax.LinearInterpolation(times, states),  # type: ignore
    )
