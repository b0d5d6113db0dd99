"""Results as labelled datasets with units, settings and versions.

Whatever has a unit is a variable or a coordinate that says it, in names that UDUNITS and
pint read; attributes are names, counts, tolerances and pure coefficients.
"""

import platform
from collections.abc import Mapping
from importlib import metadata
from typing import Any

import jax
import numpy as np
import xarray as xr

from .._lib.formats import marked
from .._lib.units import labelled
from .._lib.version import VERSION
from ..flight.dynamics import ANGLES, OMEGA, POSITION, RIGID, VELOCITY
from .plan import AbstractPlan

# name: (part of the state, trailing dimensions, unit, long name, radians inside)
_STATES: dict[str, tuple[Any, tuple[str, ...], str, str, bool]] = {
    "position": (POSITION, ("axis",), "m", "centre of mass, inertial axes", False),
    "trajectory_velocity": (VELOCITY, ("axis",), "m/s", "its velocity over the ground", False),
    "omega": (OMEGA, ("axis",), "rad/s", "angular velocity, body axes", False),
    "angles": (ANGLES, ("turn",), "deg", "yaw, pitch, roll", True),
}
_AXES = ("x", "y", "z")
_TURNS = ("yaw", "pitch", "roll")

# name: (trailing dimensions, unit people read, long name, radians inside)
_VARIABLES: dict[str, tuple[tuple[str, ...], str, str, bool]] = {
    "outcome": ((), "", "how the glide ended", False),
    "time": ((), "s", "duration of the glide", False),
    "landing_point": (("axis",), "m", "centre of mass at the end", False),
    "path_length": ((), "m", "horizontal path length", False),
    "height_lost": ((), "m", "height lost", False),
    "glide_angle": ((), "deg", "angle of the path below the horizontal at the end", True),
    "velocity": (("axis",), "m/s", "velocity over the ground at the end", False),
    "end_angles": (("turn",), "deg", "yaw, pitch, roll at the end", True),
    "max_angles": (("turn",), "deg", "largest |yaw|, |pitch|, |roll|", True),
    "launch_phase": ((), "rad", "phase of the horizontal wave at launch", False),
    "launch_angles": (("turn",), "deg", "yaw, pitch, roll at launch", True),
    "launch_speed": ((), "m/s", "forward speed at launch", False),
    "accepted": ((), "", "accepted solver steps", False),
    "rejected": ((), "", "rejected solver steps", False),
}


def versions() -> dict[str, str]:
    """Versions of this package, of what it computes with, and of Python."""
    names = ("jax", "jaxlib", "diffrax", "equinox", "optimistix", "numpy")
    found = {f"version_{name}": metadata.version(name) for name in names}
    return {"version_jaxglide": VERSION, **found, "version_python": platform.python_version()}


def stamp(data: xr.Dataset, settings: Mapping[str, Any], kind: str) -> xr.Dataset:
    """The dataset with its kind, settings, versions and device recorded in its attributes.

    Args:
        data: variables with `units` and `long_name`.
        settings: by name, texts and numbers.
        kind: what it is, one of `formats.TITLES`.
    """
    device = jax.devices()[0]
    return marked(data, kind).assign_attrs(
        **{name: "none" if value is None else value for name, value in settings.items()},
        device=f"{device.platform} {device.device_kind}",
        **versions(),
    )


def study_coordinates(study: AbstractPlan) -> dict[str, Any]:
    """The parameters of a study: dimensions of a grid, coordinates along `case` of a list, and
    single numbers where they are fixed."""
    dim = {name: "case" if study.cases is not None else name for name in study.varied}
    given = {name: (dim[name], values) for name, values in study.varied.items()}
    given |= {name: ((), value) for name, value in study.fixed.items()}
    return {name: (*value, labelled(*study.about(name))) for name, value in given.items()}


def outcome_flags(outcomes: Mapping[int, str]) -> dict[str, Any]:
    """Attributes of outcomes, int32, by CF's flags."""
    return {
        "flag_values": np.array(list(outcomes), dtype=np.int32),
        "flag_meanings": " ".join(word.replace(" ", "_") for word in outcomes.values()),
    }


def study_dataset(study: AbstractPlan, flown: Mapping[str, np.ndarray]) -> xr.Dataset:
    """Results of a study as a dataset in the units people read.

    Args:
        study: the study; see `study_coordinates`.
        flown: results by name as `sweep.results` keeps them, in case order, each (N, ...).

    Returns:
        Dataset with angles in degrees; the trajectories, if kept, over `sample`.
    """
    coordinates: dict[str, Any] = {"axis": list(_AXES), "turn": list(_TURNS)}
    coordinates |= study_coordinates(study)
    coordinates["max_time"] = ((), study.max_time, labelled("s", "longest flight"))
    dims, variables = study.dims, {}
    flown = dict(flown)
    states = flown.pop("states", None)
    if states is not None:
        coordinates["sample"] = (
            "sample",
            np.asarray(study.times),
            labelled("s", "time since launch"),
        )
        for name, (part, trailing, unit, long_name, radians) in _STATES.items():
            values = states[..., part].reshape(*study.shape, *states[..., part].shape[1:])
            values = np.rad2deg(values) if radians else values
            variables[name] = ((*dims, "sample", *trailing), values, labelled(unit, long_name))
        if study.state_size > RIGID:
            own = states[..., RIGID:].reshape(*study.shape, *states[..., RIGID:].shape[1:])
            said = labelled("mixed", "own states of motion and aerodynamics")
            variables["own_states"] = ((*dims, "sample", "own_state"), own, said)
    for name, values in flown.items():
        trailing, unit, long_name, radians = _VARIABLES[name]
        values = values.reshape(*study.shape, *values.shape[1:])
        attributes = labelled(unit, long_name)
        if name == "outcome":
            attributes |= outcome_flags(study.outcomes)
        values = np.rad2deg(values) if radians else values
        variables[name] = ((*dims, *trailing), values, attributes)
    settings = {**study.setup, "rtol": study.rtol, "atol": study.atol}
    record = {"study": study.to_json(), **settings, "max_steps": study.max_steps}
    return stamp(xr.Dataset(variables, coords=coordinates), record, "glides")
