"""A flight as a labelled dataset: trajectory, body and forces, outcome, and what flew.

What flew is kept whole in the attribute `parts`, as plain records (see `records`); its single
numbers stand as coordinates beside it, in the units that people read.
"""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from .._lib.units import labelled
from ..body.sections import Sections, discretise
from ..control import histories
from ..ensemble.records import stamp
from ..flight.case import Case
from ..flight.dynamics import (
    ANGLES,
    OMEGA,
    PATH,
    POSITION,
    RIGID,
    VELOCITY,
    Elements,
    Glider,
)
from ..flight.glide import Glide
from ..flight.parts import to_text
from ..flight.trajectory import AbstractTrajectory, reconstruct
from ..loads.polar import Polar, name_of_cells

AXES, TURNS = ("x", "y", "z"), ("yaw", "pitch", "roll")

_MOVING, _TURNING, _ALONG = ("time", "axis"), ("time", "turn"), ("time", "node")
_VECTOR = ("time", "axis", "node")


class _Row(NamedTuple):
    """A variable: its dimensions, values, unit as people read it, and long name."""

    dims: tuple[str, ...]
    values: Any
    unit: str
    long_name: str


def glide_dataset(flown: AbstractTrajectory, frames: int = 201) -> xr.Dataset:
    """A flight as a labelled dataset: trajectory, body and forces, outcome, what flew.

    Args:
        flown: one glide or trajectory that kept its path (`dense=True`, `save="dense"`).
        frames: number of equally spaced times from start to end.

    Returns:
        Dataset over time [s], node, axis and turn; angles in degrees. Velocities are over the
        ground where they say no other; where there is wind, the wind at the centre of mass
        and the velocity through the air stand beside it. `files.open` makes the flight of it
        again.

    Raises:
        ValueError: the flight kept no trajectory, or is a batch.
    """
    times = flown.sample_times(frames)
    states, now = np.asarray(flown.at(times)), reconstruct(flown, times)
    rows = _trajectory(flown, states, now) | _wind(flown, times, states)
    rows |= _elements(states, now) | _start(flown) | _inputs(flown, times)
    variables = {
        name: (row.dims, np.asarray(row.values), labelled(row.unit, row.long_name))
        for name, row in rows.items()
    }
    coordinates = {
        "time": ("time", np.asarray(times), labelled("s", "time since launch")),
        "axis": list(AXES),
        "turn": list(TURNS),
    }
    coordinates |= _nodes(discretise(flown.glider.body))
    coordinates |= _settings(flown, {*variables, *coordinates})
    kind = "glide" if isinstance(flown, Glide) else "trajectory"
    return stamp(xr.Dataset(variables, coords=coordinates), _attributes(flown), kind)


def _inertial(now: Elements, vectors) -> np.ndarray:
    """Vectors of the elements from body to inertial axes, (T, 3, n)."""
    return np.einsum("tji,tjn->tin", np.asarray(now.R_BI), np.asarray(vectors))


def _trajectory(flown: AbstractTrajectory, states: np.ndarray, now: Elements):
    angles = np.rad2deg(states[:, ANGLES])
    placed = _inertial(now, now.body.position) + states[:, POSITION, None]
    rows = {
        "position": _Row(
            _MOVING, states[:, POSITION], "m", "position of the centre of mass, inertial axes"
        ),
        "velocity": _Row(
            _MOVING,
            states[:, VELOCITY],
            "m/s",
            "velocity of the centre of mass over the ground, inertial axes",
        ),
        "omega": _Row(_MOVING, states[:, OMEGA], "rad/s", "angular velocity, body axes"),
        "angles": _Row(_TURNING, angles, "deg", "yaw, pitch, roll"),
        "path_length": _Row(
            ("time",), states[:, PATH], "m", "horizontal path length over the ground so far"
        ),
        "body": _Row(_VECTOR, placed, "m", "position of the nodes, inertial axes"),
    }
    if states.shape[1] == RIGID:
        return rows
    bending = flown.glider.gait.start(flown.phase).shape[0]
    own = {"motion": states[:, RIGID : RIGID + bending], "air": states[:, RIGID + bending :]}
    whose = {"motion": "the motion", "air": "the aerodynamics"}
    for name, values in own.items():
        if values.shape[1]:
            dims = "time", f"{name}_state"
            rows[f"{name}_states"] = _Row(dims, values, "", f"own states of {whose[name]}")
    return rows


def _wind(flown: AbstractTrajectory, times, states: np.ndarray) -> dict[str, _Row]:
    """Wind and velocity through the air at the centre of mass; none in air at rest."""
    at = [
        flown.glider.air.wind(state[POSITION, None], time)
        for time, state in zip(times, states, strict=True)
    ]
    if at[0] is None:
        return {}
    wind = np.stack([np.asarray(one)[:, 0] for one in at])
    through = states[:, VELOCITY] - wind
    return {
        "wind": _Row(
            _MOVING, wind, "m/s", "velocity of the air at the centre of mass, inertial axes"
        ),
        "velocity_through_air": _Row(
            _MOVING,
            through,
            "m/s",
            "velocity of the centre of mass through the air there, inertial axes",
        ),
    }


def _inputs(flown: AbstractTrajectory, times) -> dict[str, _Row]:
    """Of a flight under control, where actuators were, what they were told, their ranges."""
    rows = {}
    for one in histories(flown, times):
        said = f"actuator of {one.name} ({one.meaning})"
        rows[one.name] = _Row(("time",), one.position, one.unit, f"position of the {said}")
        rows[f"{one.name}_told"] = _Row(("time",), one.told, one.unit, f"told to the {said}")
        for end in ("low", "high"):
            limit = f"{end}est position of the {said}"
            rows[f"{one.name}_{end}"] = _Row((), getattr(one, end), one.unit, limit)
    return rows


def _elements(states: np.ndarray, now: Elements) -> dict[str, _Row]:
    air = now.aerodynamics
    return {
        "force": _Row(
            _VECTOR, _inertial(now, air.force), "N", "force on the elements, inertial axes"
        ),
        "moment": _Row(_VECTOR, now.moment, "N m", "moment of the force, body axes"),
        "lift": _Row(_ALONG, air.lift, "N", "lift of the elements"),
        "drag": _Row(_ALONG, air.drag, "N", "drag of the elements"),
        "angle_of_attack": _Row(
            _ALONG, np.rad2deg(air.angle_of_attack), "deg", "angle of attack"
        ),
        "sweep_angle": _Row(_ALONG, np.rad2deg(air.sweep_angle), "deg", "sweep angle"),
        "reynolds": _Row(
            _ALONG, air.reynolds, "", "Reynolds number on chord and speed through the air"
        ),
        "dynamic_pressure": _Row(
            _ALONG,
            air.dynamic_pressure,
            "Pa",
            "dynamic pressure of the velocity through the air normal to the body",
        ),
        "lift_coefficient": _Row(_ALONG, air.lift_coefficient, "", "C_L, with fold sign"),
        "drag_coefficient": _Row(_ALONG, air.drag_coefficient, "", "C_D"),
    }


def _start(flown: AbstractTrajectory) -> dict[str, _Row]:
    most = np.rad2deg(flown.max_angles)
    rows = {
        "max_angles": _Row(("turn",), most, "deg", "largest |yaw|, |pitch|, |roll|"),
        "launch_phase": _Row((), flown.phase, "rad", "phase of the motion at launch"),
    }
    if isinstance(flown, Glide):
        angles = np.rad2deg(flown.take_off.angles)
        rows["launch_angles"] = _Row(("turn",), angles, "deg", "attitude at launch")
        rows["launch_speed"] = _Row(
            (), flown.take_off.speed, "m/s", "speed over the ground at launch"
        )
    return rows


def _nodes(sections: Sections) -> dict[str, Any]:
    """Where the nodes are along the body, and what they stand for."""
    rows = {
        "fraction": (sections.fraction, "", "arc length over the body's length"),
        "arc_length": (sections.fraction * sections.length, "m", "arc length"),
        "node_chord": (sections.chord, "m", "chord at the node"),
        "node_area": (sections.area, "m^2", "planform area of the element"),
        "node_mass": (sections.mass, "kg", "mass of the element"),
    }
    return {n: ("node", np.asarray(v), labelled(u, said)) for n, (v, u, said) in rows.items()}


def _settings(flown: AbstractTrajectory, taken: set[str]) -> dict[str, Any]:
    """Every single number with a name that went in, as a coordinate."""
    more = (flown.launch,) if isinstance(flown, Glide) else ()
    case = Case(flown.glider, *more, ends=flown.settings.ends)
    found = parameters_of(case, taken, launched=bool(more))
    limit = labelled("s", "longest flight" if more else "time up to which it was to fly")
    found["max_time"] = ((), np.asarray(flown.settings.max_time, float), limit)
    return found


def parameters_of(case: Case, taken: set[str], launched: bool) -> dict[str, Any]:
    """Every single number of a case as a coordinate, in people's units.

    Args:
        case: what flew.
        taken: names that others have.
        launched: whether those of its launch count.
    """
    found = {}
    for path, known in case.parameters.items():
        if not launched and path.startswith("launch."):
            continue
        value = case.value(path)
        if value is None or np.ndim(value):
            continue
        name = case.name(path)
        name = path if name in taken or "." in name else name
        name = name.replace("[", "_").replace("]", "").replace(".", "_")
        found[name] = ((), np.asarray(value, float), labelled(known.unit, known.meaning))
    return found


def _attributes(flown: AbstractTrajectory) -> dict[str, Any]:
    """How it ended and was solved, the classes of what flew, and all of that as records."""
    settings = flown.settings
    parts: dict[str, Any] = {"glider": flown.glider}
    if isinstance(flown, Glide):
        parts["launch"] = flown.launch
    return {
        "outcome": flown.ending,
        "outcome_code": int(flown.outcome),
        "accepted": int(flown.accepted),
        "rejected": int(flown.rejected),
        **classes_of(flown.glider),
        "ends": ", ".join(type(end).__name__ for end in settings.ends),
        "solver": type(settings.solver).__name__,
        "rtol": float(settings.rtol),
        "atol": float(settings.atol),
        "parts": to_text({**parts, "settings": settings}),
    }


def classes_of(glider: Glider) -> dict[str, str]:
    """Classes of a glider's parts, and the name of its polar."""
    names = "body", "gait", "aerodynamics", "air"
    return {name: type(getattr(glider, name)).__name__ for name in names} | _polar(glider)


def _polar(glider: Glider) -> dict[str, str]:
    """Name of the polar, or of its class; none where the aerodynamics have none."""
    polar = getattr(glider.aerodynamics, "polar", None)
    if polar is None:
        return {}
    named = name_of_cells(polar.cells) if isinstance(polar, Polar) else None
    return {"polar": named or type(polar).__name__}
