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

from .._lib.parameters import PARAMETERS
from .._lib.units import labelled
from ..body.sections import discretise
from ..flight.dynamics import ANGLES, OMEGA, PATH, POSITION, VELOCITY
from ..flight.ends import Outcome
from ..flight.glide import Glide
from ..flight.trajectory import reconstruct
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


def about(name: str) -> dict[str, str]:
    """Attributes of a parameter's coordinate."""
    return labelled(PARAMETERS[name].unit, PARAMETERS[name].meaning)


def study_coordinates(study: Study) -> dict[str, Any]:
    """The parameters of a study: dimensions of a grid, coordinates along `case` of a list, and
    single numbers where they are fixed."""
    dim = {name: "case" if study.cases is not None else name for name in study.varied}
    varied = {name: (dim[name], values, about(name)) for name, values in study.varied.items()}
    return varied | {name: ((), value, about(name)) for name, value in study.fixed.items()}


def _outcome_attributes() -> dict[str, Any]:
    return {
        "flag_values": np.array([int(o) for o in Outcome], dtype=np.int32),
        "flag_meanings": " ".join(str(o).replace(" ", "_") for o in Outcome),
    }


def study_dataset(study: Study, flown: Mapping[str, np.ndarray]) -> xr.Dataset:
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
    dims = tuple(study.varied) if study.cases is None else ("case",)
    variables = {}
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
    for name, values in flown.items():
        trailing, unit, long_name, radians = _VARIABLES[name]
        values = values.reshape(*study.shape, *values.shape[1:])
        attributes = labelled(unit, long_name)
        if name == "outcome":
            attributes |= _outcome_attributes()
        values = np.rad2deg(values) if radians else values
        variables[name] = ((*dims, *trailing), values, attributes)
    settings = {**study.setup, "rtol": study.rtol, "atol": study.atol}
    record = {"study": study.to_json(), **settings, "max_steps": study.max_steps}
    return stamp(xr.Dataset(variables, coords=coordinates), record)


# of a glide beside `PARAMETERS`, where given: (unit, meaning)
_GIVEN = {
    "spacing": ("m", "spacing of the nodes"),
    "phi_theta": ("rad", "phase of the horizontal wave that the launch was given"),
    "launch_attitude": ("deg", "yaw, pitch, roll that the launch was given"),
    "step": ("s", "fixed step of the solver"),
    "max_time": ("s", "longest flight"),
}


def _parameters(glide: Glide) -> dict[str, Any]:
    """Every number with a unit that went into a glide, as a coordinate, in people's units."""
    glider, launch, settings = glide.glider, glide.launch, glide.settings
    parts = (
        glider,
        glider.body,
        glider.gait,
        glider.aerodynamics.polar,
        glider.air,
        launch,
        settings,
    )
    given: dict[str, Any] = {name: v for part in parts for name, v in vars(part).items()}
    given |= {"svl": glider.body.length, "launch_attitude": launch.angles}
    found = {}
    for name in (*PARAMETERS, *_GIVEN):
        if given.get(name) is None:
            continue
        p = PARAMETERS.get(name)
        unit, meaning = _GIVEN[name] if p is None else (p.unit, p.meaning)
        value = np.asarray(given[name], float)
        value = np.rad2deg(value) if unit.startswith("deg") else value
        found[name] = (("turn",) if value.ndim else (), value, labelled(unit, meaning))
    return found


def _node_coordinates(glide: Glide) -> dict[str, Any]:
    """Where the nodes are along the body, and what they stand for."""
    snake, sections = glide.glider.body, discretise(glide.glider.body)
    return {
        "arc_length": ("node", sections.fraction * snake.length, labelled("m", "arc length")),
        "node_chord": ("node", sections.chord, labelled("m", "chord at the node")),
        "node_mass": ("node", sections.mass, labelled("kg", "mass of the element")),
    }


def _settings(glide: Glide) -> dict[str, Any]:
    """Names, counts, tolerances and coefficients that went into a glide."""
    snake, settings = glide.glider.body, glide.settings
    degree = glide.glider.aerodynamics.polar.cells.shape[-1] - 1
    coefficients = ["chord", "head_density", "body_density"]
    coefficients += [] if snake.gyration is None else ["gyration"]
    return {
        "nodes": snake.nodes,
        "node_set": snake.node_set,
        "head_fraction": float(snake.head_fraction),
        **{name: np.asarray(getattr(snake, name)).tolist() for name in coefficients},
        "polar": "published" if degree == 1 else "smooth",
        "solver": type(settings.solver).__name__,
        "rtol": float(settings.rtol),
        "atol": float(settings.atol),
        "max_steps": settings.max_steps,
        "dense": int(settings.dense),
    }


def glide_dataset(glide: Glide, frames: int = 201) -> xr.Dataset:
    """A glide as a labelled dataset: trajectory, body and forces, outcome, settings.

    Args:
        glide: one glide, simulated with `dense=True`.
        frames: number of equally spaced times from launch to the end.

    Returns:
        Dataset over time [s], node, axis and turn; angles in degrees; what went into the
        glide in coordinates that are single numbers, each with its unit.

    Raises:
        ValueError: the glide kept no trajectory, or is a batch.
    """
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
    turns, take_off = ("turn",), glide.take_off
    results = {
        "max_angles": (turns, np.rad2deg(glide.max_angles), "deg", _VARIABLES["max_angles"][2]),
        "launch_angles": (turns, np.rad2deg(take_off.angles), "deg", "attitude at launch"),
        "launch_phase": ((), take_off.phi_theta, "rad", "phase of the wave at launch"),
        "launch_speed": ((), take_off.speed, "m/s", "speed at launch"),
    }
    variables = {
        name: (dims, np.asarray(values), labelled(unit, long_name))
        for name, (dims, values, unit, long_name) in (sections | results).items()
    }
    coordinates = {
        "time": ("time", np.asarray(times), labelled("s", "time since launch")),
        "axis": list(_AXES),
        "turn": list(_TURNS),
    }
    coordinates |= _node_coordinates(glide) | _parameters(glide)
    data = xr.Dataset(variables, coords=coordinates)
    ending = {
        "outcome": str(Outcome(int(glide.outcome))),
        "accepted": int(glide.accepted),
        "rejected": int(glide.rejected),
    }
    return stamp(data, {**_settings(glide), **ending})
