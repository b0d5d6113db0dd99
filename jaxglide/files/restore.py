"""A saved flight made whole again: what flew and its trajectory from its dataset."""

import dataclasses
from collections.abc import Callable
from typing import Any, TypeVar

import diffrax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from .._lib.datasets import Schema, Variable, checked
from .._lib.formats import kind_of
from .._lib.records import OwnPartError
from ..flight.dynamics import RIGID, Glider
from ..flight.ends import outcome_words
from ..flight.glide import Glide
from ..flight.integrate import own_states
from ..flight.launch import Launch, TakeOff
from ..flight.parts import from_text
from ..flight.solve import Settings
from ..flight.trajectory import AbstractTrajectory, Trajectory
from .glides import AXES, TURNS

_Made = TypeVar("_Made")
_STATE = ("position", "velocity", "omega", "angles", "path_length")
_OWN = {"motion_states": "motion_state", "air_states": "air_state"}
_MOVING, _TURN = ("time", "axis"), ("turn",)
_FLIGHT = Schema(
    "a saved flight's variables",
    {
        "time": Variable(("time",), "s", 0.0, 1e4),
        "position": Variable(_MOVING, "m"),
        "velocity": Variable(_MOVING, "m/s"),
        "omega": Variable(_MOVING, "rad/s"),
        "angles": Variable(("time", "turn"), "rad"),
        "path_length": Variable(("time",), "m"),
        "max_angles": Variable(_TURN, "rad"),
        "launch_phase": Variable((), "rad"),
    },
    sizes={"time": 10**6},
    labels={"axis": AXES, "turn": TURNS},
)
_GLIDE = {"launch_angles": Variable(_TURN, "rad"), "launch_speed": Variable((), "m/s")}


def flight_of(data: xr.Dataset) -> AbstractTrajectory:
    """The glide or trajectory that `glides.glide_dataset` made the dataset of.

    Between the saved times its trajectory is interpolated linearly.

    Args:
        data: over time [s], with what flew in its attribute `parts`.

    Raises:
        OwnPartError: a part that flew is the user's own; the message names it.
        ValueError: the dataset lacks a variable or an attribute, or holds a wrong one; one
            sentence names it.
    """
    return or_refuse(lambda: _flight(data), data, "flight")


def or_refuse(make: Callable[[], _Made], data: xr.Dataset, what: str) -> _Made:
    """What is made of a dataset; where that fails, an error in one sentence names its file.

    Args:
        make: from nothing to the result.
        data: of which it is made.
        what: it should be, in words.
    """
    source = str(data.encoding.get("source", "the dataset"))
    try:
        return make()
    except OwnPartError as error:
        raise OwnPartError(f"{source}: {error}") from None
    except KeyError as error:
        raise ValueError(f"{source}: this is not a whole {what}: it lacks {error}") from None
    except (TypeError, ValueError) as error:
        said = str(error).removeprefix(f"{source}: ")
        raise ValueError(f"{source}: this is not a whole {what}: {said}") from None


def _flight(data: xr.Dataset) -> AbstractTrajectory:
    kind = kind_of(data)
    if kind not in ("glide", "trajectory"):
        what = "says no format" if kind is None else f"is of the kind {kind!r}"
        raise ValueError(f"it {what}")
    parts = from_text(str(data.attrs["parts"]))
    glider, settings = part_of(parts, "glider", Glider), part_of(parts, "settings", Settings)
    more = _GLIDE if kind == "glide" else {}
    more = more | {n: Variable(("time", d), "") for n, d in _OWN.items() if n in data}
    data = checked(data, _FLIGHT._replace(variables={**_FLIGHT.variables, **more}))
    times, states = _path(data, glider)
    flown = {
        "glider": glider,
        "settings": dataclasses.replace(settings, times=None),
        "outcome": jnp.asarray(_code(data, settings)),
        "time": jnp.asarray(times[-1]),
        "state": jnp.asarray(states[-1]),
        "max_angles": jnp.asarray(data["max_angles"].values),
        "accepted": jnp.asarray(int(data.attrs["accepted"])),
        "rejected": jnp.asarray(int(data.attrs["rejected"])),
        "states": None,
        "interpolation": diffrax.LinearInterpolation(*map(jnp.asarray, (times, states))),
    }
    phase, start = jnp.asarray(data["launch_phase"].item()), jnp.asarray(states[0])
    if kind == "trajectory":
        begin = jnp.asarray(times[0])
        return Trajectory(phase=phase, start_time=begin, start=start, **flown)
    angles, speed = (jnp.asarray(data[name].values) for name in _GLIDE)
    take_off = TakeOff(phase, angles, speed, start)
    return Glide(launch=part_of(parts, "launch", Launch), take_off=take_off, **flown)


def part_of(parts: dict[str, Any], name: str, kind: type[_Made]) -> _Made:
    """A part by its name, which must be of a kind."""
    found = parts[name]
    if not isinstance(found, kind):
        raise ValueError(f"its {name} is no {kind.__name__} but {type(found).__name__}")
    return found


def _path(data: xr.Dataset, glider: Glider) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and states, (T,) and (T, s)."""
    names = [*_STATE, *(name for name in _OWN if name in data)]
    columns = [data[name].values.reshape(data.sizes["time"], -1) for name in names]
    states, times = np.concatenate(columns, axis=1), data["time"].values
    if not (len(times) > 1 and (np.diff(times) > 0).all()):
        raise ValueError("time does not rise from entry to entry")
    wanted = RIGID + own_states(glider)
    if states.shape[1] != wanted:
        raise ValueError(
            f"its states are {states.shape[1]} numbers, where what flew has {wanted}"
        )
    return times, states


def _code(data: xr.Dataset, settings: Settings) -> int:
    code, words = int(data.attrs["outcome_code"]), outcome_words(settings.ends)
    if words.get(code) != data.attrs["outcome"]:
        raise ValueError(
            f"outcome = {data.attrs['outcome']!r} with the code {code} is no end of this flight"
        )
    return code
