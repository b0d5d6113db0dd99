"""Measured flights, flown by the model.

Each flight is a measured path with the gait, length, mass and start of the animal, as in the
dataset of `jaxglide.measured` (read from its file, or made there; this module only needs its
variables). All of them fly in pools of lanes.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import xarray as xr

from .._lib.checks import check_choice, check_range, warn_float32
from .._lib.datasets import Schema, Variable, checked
from .._lib.defaults import CHOICES, MAX_STEPS
from .._lib.fields import parameters_of
from .._lib.types import Array, Float
from .._lib.units import labelled
from ..body.snake import Snake
from ..ensemble.batch import Fleet, default_width, fly_all
from ..ensemble.records import stamp
from ..flight.dynamics import ANGLES, POSITION, RIGID, VELOCITY, Glider
from ..flight.ends import Outcome
from ..flight.glide import PILOT, landed, ready
from ..flight.launch import Launch
from ..flight.pool import Program, Task
from ..loads.polar import Polar
from ..shape.gait import Gait

SPACING = 0.01
"""Distance between nodes of the published simulations of measured flights [m]."""
NECK = 0.075
"""End of the neck over SVL there, rounded down to a node."""
GAUSS_NODES = 60

_GAIT = ("nu_theta", "theta_m", "psi_m", "d_psi", "f_theta")
_KNOWN = {name: parameters_of(Gait)[name] for name in _GAIT}
_FARTHEST = 100.0  # m, as for recordings
_TRIAL, _VECTOR = ("trial",), ("trial", "frame", "axis")
FLIGHTS = Schema(
    "the flights",
    {
        "trial": Variable(_TRIAL, None),
        "snake": Variable(_TRIAL, None),
        **{n: Variable(_TRIAL, p.unit, p.low, p.high) for n, p in _KNOWN.items()},
        "svl": Variable(_TRIAL, "m", 0.1, 1.5),
        "mass": Variable(_TRIAL, "kg", 1e-4, 5.0),
        "start_position": Variable(("trial", "axis"), "m", -_FARTHEST, _FARTHEST),
        "start_velocity": Variable(("trial", "axis"), "m/s", -30.0, 30.0),
        "time": Variable(("trial", "frame"), "s", 0.0, 60.0, gaps=True),
        "position": Variable(_VECTOR, "m", -_FARTHEST, _FARTHEST, gaps=True),
    },
    sizes={"trial": 10_000, "frame": 100_000},
    labels={"axis": ("x", "y", "z")},
)
"""What `jaxglide.measured.flights_dataset` makes and the simulations of flights need."""
_LONGEST = 4.0  # s
_TIMES = np.linspace(0.0, _LONGEST, 401)  # of a simulated path


class Measured(eqx.Module):
    """N measured flights as arrays, in SI units and radians; inside `vmap` one of them.

    Attributes:
        nu_theta, theta_m, psi_m, d_psi, f_theta: the gait, (N,).
        svl, mass, neck_fraction: of the animals [m, kg, of SVL], (N,).
        height, speed, elevation, heading: of the launch [m, m/s, rad, rad], (N,).
    """

    nu_theta: Float[Array, "..."]
    theta_m: Float[Array, "..."]
    psi_m: Float[Array, "..."]
    d_psi: Float[Array, "..."]
    f_theta: Float[Array, "..."]
    svl: Float[Array, "..."]
    mass: Float[Array, "..."]
    neck_fraction: Float[Array, "..."]
    height: Float[Array, "..."]
    speed: Float[Array, "..."]
    elevation: Float[Array, "..."]
    heading: Float[Array, "..."]


def check_flights(data: xr.Dataset) -> xr.Dataset:
    """The flights in the units and the order of dimensions that simulations take.

    Raises:
        ValueError: a variable is missing, or holds what no measured flight can; the message
            names the variable, the trial, the value and what is allowed.
    """
    data = checked(data, FLIGHTS)
    trials = data["trial"].values
    for trial, count in zip(*np.unique(trials, return_counts=True), strict=True):
        if count > 1:
            raise ValueError(f"trial {trial} is there {count} times")
    height = data["start_position"].values[:, 2]
    seen = np.isfinite(np.sum(data["position"].values, axis=2))
    for trial, up, known, times in zip(trials, height, seen, data["time"].values, strict=True):
        if up <= 0:
            raise ValueError(
                f"start_position of trial {trial} is {up:g} m above the ground: it must be in "
                f"(0, {_FARTHEST:g}] m"
            )
        if known.sum() < 2:
            raise ValueError(f"position of trial {trial} is known in {known.sum()} frames of 2")
        if not (np.diff(times[known]) > 0).all():
            raise ValueError(f"time of trial {trial} does not rise from frame to frame")
    return data


def measured_of(data: xr.Dataset) -> Measured:
    """The flights of a dataset.

    Args:
        data: as `jaxglide.measured.flights_dataset` makes it, over trial.

    Raises:
        ValueError: see `check_flights`.
    """
    data = check_flights(data)
    svl = data["svl"].values
    velocity = data["start_velocity"].values
    x, y, z = velocity.T
    angles = {name: np.deg2rad(data[name].values) for name in ("theta_m", "psi_m", "d_psi")}
    return Measured(
        nu_theta=jnp.asarray(data["nu_theta"].values),
        f_theta=jnp.asarray(data["f_theta"].values),
        **{name: jnp.asarray(values) for name, values in angles.items()},
        svl=jnp.asarray(svl),
        mass=jnp.asarray(data["mass"].values),
        neck_fraction=jnp.asarray((np.floor(NECK * svl / SPACING) + 0.5) * SPACING / svl),
        height=jnp.asarray(data["start_position"].values[:, 2]),
        speed=jnp.asarray(np.linalg.norm(velocity, axis=1)),
        elevation=jnp.asarray(np.arctan2(z, np.hypot(x, y))),
        heading=jnp.asarray(np.arctan2(-x, y)),
    )


def node_count(svl: np.ndarray) -> int:
    """Nodes of the published set that serve all lengths [m]."""
    return int(np.ceil(np.max(svl) / SPACING - 1e-6))


def build_flight(flight: Measured, polar: Polar, nodes: int | None) -> tuple[Glider, Launch]:
    """Glider and launch of one flight (fields without N); may be traced.

    Args:
        flight: one of `Measured`.
        polar: the force coefficients.
        nodes: of the published set at 1 cm (see `node_count`), or None for 60 Gauss nodes.
    """
    fields: dict[str, Any] = {"nodes": GAUSS_NODES, "node_set": "gauss"}
    if nodes is not None:
        fields = {"nodes": nodes, "node_set": "published", "spacing": SPACING}
    snake = Snake(flight.svl, flight.mass, flight.neck_fraction, **fields)
    waves = {name: getattr(flight, name) for name in _GAIT}
    launch = Launch(
        flight.height, flight.speed, elevation=flight.elevation, heading=flight.heading
    )
    return Glider(snake, Gait(**waves), polar), launch


@lru_cache(maxsize=8)
def _flier(polar: str, nodes: int | None, block: int) -> Program:
    """Program that flies all flights."""

    def prepare(fields, lift_scale, drag_scale, tolerance) -> Task:
        air = Polar.from_name(polar, lift_scale, drag_scale)
        glider, launch = build_flight(Measured(**fields), air, nodes)
        options: dict[str, Any] = {"ends": None, "rtol": tolerance, "atol": tolerance}
        return ready(
            glider, launch, times=_TIMES, max_time=_LONGEST, max_steps=MAX_STEPS, **options
        )

    def conclude(task: Task, solved):
        glide = landed(task, solved)
        return {
            "states": glide.states,
            "end": glide.state,
            "time": glide.time,
            "outcome": glide.outcome,
            "phi_theta": glide.take_off.phi_theta,
            "angles": glide.take_off.angles,
        }

    return Program(PILOT, prepare, conclude, block)


def _flown_dataset(data: xr.Dataset, flown: Mapping[str, np.ndarray]) -> xr.Dataset:
    """Paths and attitudes simulated, labelled, in the axes of the recording."""
    states, end = flown["states"], flown["end"]
    across = data["start_position"].values * np.array([1.0, 1.0, 0.0])
    vector, angles = ("trial", "time_simulated", "axis"), ["yaw", "pitch", "roll"]
    variables = {
        "path": (vector, states[..., POSITION] + across[:, None], "m", "simulated path"),
        "simulated_velocity": (
            vector,
            states[..., VELOCITY],
            "m/s",
            "its velocity over the ground",
        ),
        "attitude": (
            ("trial", "time_simulated", "angle"),
            np.rad2deg(states[..., ANGLES]),
            "deg",
            "simulated attitude",
        ),
        "end": (("trial", "axis"), end[:, POSITION] + across, "m", "end of the simulation"),
        "end_attitude": (
            ("trial", "angle"),
            np.rad2deg(end[:, ANGLES]),
            "deg",
            "attitude there",
        ),
        "end_time": (("trial",), flown["time"], "s", "duration of the simulation"),
        "outcome": (("trial",), flown["outcome"].astype(np.int32), "", "how it ended"),
        "phi_theta": (("trial",), flown["phi_theta"], "rad", "launch phase"),
        "launch_attitude": (
            ("trial", "angle"),
            np.rad2deg(flown["angles"]),
            "deg",
            "launch attitude",
        ),
    }
    clock = labelled("s", "time since the start of the simulation")
    found = xr.Dataset(
        {
            name: (dims, values, labelled(unit, long_name))
            for name, (dims, values, unit, long_name) in variables.items()
        },
        coords={"time_simulated": ("time_simulated", _TIMES, clock)}
        | {"angle": angles, "axis": ["x", "y", "z"]}
        | {name: data[name] for name in ("trial", "snake")},
    )
    found["outcome"].attrs |= {
        "flag_values": np.array([int(o) for o in Outcome], np.int32),
        "flag_meanings": " ".join(str(o).replace(" ", "_") for o in Outcome),
    }
    return found


def fly_flights(
    data: xr.Dataset,
    *,
    polar: str = "published",
    node_set: str = "published",
    lift_scale: float = 1.0,
    drag_scale: float = 1.0,
    tolerance: float = 1e-8,
) -> xr.Dataset:
    """Simulate measured flights from their measured start with their measured gait.

    Args:
        data: the measured flights, over trial.
        polar: "published" or "smooth".
        node_set: "published" (1 cm apart, as the paper) or "gauss".
        lift_scale, drag_scale: multipliers of the force coefficients.
        tolerance: of a step.

    Returns:
        Dataset over trial: simulated path and attitude in time, the end, the launch, beside
        the measured path, in the axes of the recording.

    Raises:
        ValueError: see `check_flights`, or an argument out of range.
    """
    check_choice("node_set", node_set, CHOICES["node_set"])
    check_range("tolerance", tolerance, "", 0, 0.1, low_open=True, shape=())
    warn_float32(tolerance, tolerance)
    data = check_flights(data)
    flights = measured_of(data)
    nodes = node_count(data["svl"].values) if node_set == "published" else None
    check_choice("polar", polar, CHOICES["polar"])
    for name, scale in (("lift_scale", lift_scale), ("drag_scale", drag_scale)):
        check_range(name, scale, "", 0, 100, shape=())
    fields = {name: np.asarray(values) for name, values in vars(flights).items()}
    fleet = Fleet.of(
        default_width(len(data["trial"]), lambda: nodes or GAUSS_NODES, RIGID * len(_TIMES))
    )
    fly = _flier(polar, nodes, fleet.block)
    given = tuple(np.asarray(float(x)) for x in (lift_scale, drag_scale, tolerance))
    flown = fly_all(fly, fields, fleet, given)
    found = _flown_dataset(data, flown)
    about = {"polar": polar, "node_set": node_set, "tolerance": tolerance}
    about |= {"lift_scale": lift_scale, "drag_scale": drag_scale}
    return stamp(found.merge(data[["time", "position", "svl"]]), about, "compared flights")
