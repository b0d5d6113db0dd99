"""Results as labelled datasets with units, settings and versions (floor 5)."""

import platform
from collections.abc import Mapping
from importlib import metadata
from typing import Any

import equinox as eqx
import jax
import numpy as np
import xarray as xr

from .dynamics import ANGLES, OMEGA, PATH, POSITION, VELOCITY
from .glide import Glide, Outcome, reconstruct
from .parameters import PARAMETERS
from .study import Study

# name: (part of the state, trailing dimensions, unit, long name, radians inside)
_STATES: dict[str, tuple[Any, tuple[str, ...], str, str, bool]] = {
    "position": (POSITION, ("axis",), "m", "centre of mass, inertial axes", False),
    "trajectory_velocity": (VELOCITY, ("axis",), "m/s", "its velocity", False),
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
    "velocity": (("axis",), "m/s", "velocity of the centre of mass at the end", False),
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
    names = ("jaxglide", "jax", "jaxlib", "diffrax", "equinox", "optimistix", "numpy")
    found = {f"version_{name}": metadata.version(name) for name in names}
    return {**found, "version_python": platform.python_version()}


def stamp(data: xr.Dataset, settings: Mapping[str, Any]) -> xr.Dataset:
    """The dataset with settings, versions and device recorded in its attributes."""
    device = jax.devices()[0]
    return data.assign_attrs(
        **{name: "none" if value is None else value for name, value in settings.items()},
        device=f"{device.platform} {device.device_kind}",
        **versions(),
    )


def _outcome_attributes() -> dict[str, Any]:
    return {
        "flag_values": np.array([int(o) for o in Outcome], dtype=np.int32),
        "flag_meanings": " ".join(str(o).replace(" ", "_") for o in Outcome),
    }


def study_dataset(study: Study, flown: Mapping[str, np.ndarray]) -> xr.Dataset:
    """Results of a study as a dataset in the units people read.

    Args:
        study: the study; its parameters become dimensions (a grid) or coordinates along
            `case` (a list), what it fixes becomes attributes.
        flown: results by name as `sweep.results` keeps them, in case order, each (N, ...).

    Returns:
        Dataset with angles in degrees; the trajectories, if kept, over `sample`.
    """
    coordinates: dict[str, Any] = {"axis": list(_AXES), "turn": list(_TURNS)}
    dims = tuple(study.varied) if study.cases is None else ("case",)
    for name, values in study.varied.items():
        about = {"units": PARAMETERS[name].unit, "long_name": PARAMETERS[name].meaning}
        coordinates[name] = (name if study.cases is None else "case", values, about)
    variables = {}
    flown = dict(flown)
    states = flown.pop("states", None)
    if states is not None:
        coordinates["sample"] = ("sample", np.asarray(study.times), {"units": "s"})
        for name, (part, trailing, unit, long_name, radians) in _STATES.items():
            values = states[..., part].reshape(*study.shape, *states[..., part].shape[1:])
            values = np.rad2deg(values) if radians else values
            about = {"units": unit, "long_name": long_name}
            variables[name] = ((*dims, "sample", *trailing), values, about)
    for name, values in flown.items():
        trailing, unit, long_name, radians = _VARIABLES[name]
        values = values.reshape(*study.shape, *values.shape[1:])
        about = {"units": unit, "long_name": long_name}
        if name == "outcome":
            about |= _outcome_attributes()
        values = np.rad2deg(values) if radians else values
        variables[name] = ((*dims, *trailing), values, about)
    settings = {**study.fixed, **study.setup, "rtol": study.rtol, "atol": study.atol}
    limits = {"max_time": study.max_time, "max_steps": study.max_steps}
    record = {"study": study.to_json(), **settings, **limits}
    return stamp(xr.Dataset(variables, coords=coordinates), record)


def _settings(glide: Glide) -> dict[str, Any]:
    """Every number and choice that went into a glide, SI and radians, by name."""
    found: dict[str, Any] = {}
    for module in (
        glide.glider.snake,
        glide.glider.gait,
        glide.glider.polar,
        glide.glider.environment,
        glide.launch,
        glide.settings,
    ):
        for name, value in vars(module).items():
            if name in ("cells", "times"):
                continue
            if eqx.is_array(value):
                value = np.asarray(value).tolist()
            elif isinstance(value, eqx.Module):
                value = type(value).__name__
            elif isinstance(value, bool):
                value = int(value)
            found[name] = value
    degree = glide.glider.polar.cells.shape[-1] - 1
    found["polar"] = "published" if degree == 1 else "smooth"
    return found


def glide_dataset(glide: Glide, frames: int = 201) -> xr.Dataset:
    """A glide as a labelled dataset: trajectory, body and forces, outcome, settings.

    Args:
        glide: one glide, simulated with `dense=True`.
        frames: number of equally spaced times from launch to the end.

    Returns:
        Dataset over time [s], node, axis and turn; angles in degrees; the settings in its
        attributes are in SI units and radians.

    Raises:
        ValueError: the glide kept no trajectory, or is a batch.
    """
    if np.ndim(glide.time):
        raise ValueError(
            f"this is a batch of glides of shape {np.shape(glide.time)}: give one of them, "
            "such as `jax.tree.map(lambda values: values[0], glides)`"
        )
    times = glide.sample_times(frames)
    states = np.asarray(glide.at(times))
    now = reconstruct(glide, times)
    air = now.aerodynamics
    rotation = np.asarray(now.R_BI)  # to inertial: r_I = R^T r_B

    def inertial(vectors):
        return np.einsum("tji,tjn->tin", rotation, np.asarray(vectors))

    placed = inertial(now.body.position) + states[:, POSITION, None]
    moving = ("time", "axis")
    along = ("time", "node")
    vector = ("time", "axis", "node")
    sections = {
        "position": (moving, states[:, POSITION], "m", "centre of mass, inertial axes"),
        "velocity": (moving, states[:, VELOCITY], "m/s", "its velocity, inertial axes"),
        "omega": (moving, states[:, OMEGA], "rad/s", "angular velocity, body axes"),
        "angles": (("time", "turn"), np.rad2deg(states[:, ANGLES]), "deg", "yaw, pitch, roll"),
        "path_length": (("time",), states[:, PATH], "m", "horizontal path length so far"),
        "body": (vector, placed, "m", "position of the nodes, inertial axes"),
        "force": (vector, inertial(air.force), "N", "force on the elements, inertial axes"),
        "moment": (vector, np.asarray(now.moment), "N m", "moment of the force, body axes"),
        "lift": (along, np.asarray(air.lift), "N", "lift of the elements"),
        "drag": (along, np.asarray(air.drag), "N", "drag of the elements"),
        "angle_of_attack": (along, np.rad2deg(air.angle_of_attack), "deg", "angle of attack"),
        "sweep_angle": (along, np.rad2deg(air.sweep_angle), "deg", "sweep angle"),
        "reynolds": (along, np.asarray(air.reynolds), "", "Reynolds number on the chord"),
        "dynamic_pressure": (
            along,
            np.asarray(air.dynamic_pressure),
            "Pa",
            "dynamic pressure normal to the body",
        ),
        "lift_coefficient": (
            along,
            np.asarray(air.lift_coefficient),
            "",
            "C_L, with fold sign",
        ),
        "drag_coefficient": (along, np.asarray(air.drag_coefficient), "", "C_D"),
    }
    variables = {
        name: (dims, values, {"units": unit, "long_name": long_name})
        for name, (dims, values, unit, long_name) in sections.items()
    }
    coordinates = {
        "time": ("time", np.asarray(times), {"units": "s", "long_name": "time since launch"}),
        "axis": list(_AXES),
        "turn": list(_TURNS),
    }
    data = xr.Dataset(variables, coords=coordinates)
    ending = {
        "outcome": str(Outcome(int(glide.outcome))),
        "launch_phase": float(glide.take_off.phi_theta),
        "launch_angles": np.asarray(glide.take_off.angles).tolist(),
        "launch_speed": float(glide.take_off.speed),
        "max_angles": np.asarray(glide.max_angles).tolist(),
        "accepted": int(glide.accepted),
        "rejected": int(glide.rejected),
    }
    return stamp(data, {**_settings(glide), **ending})
