"""Steady glides as a labelled dataset, and made whole again, to the bit."""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
import xarray as xr

from .._lib.checks import check_kind
from .._lib.datasets import Schema, Variable, checked
from .._lib.formats import kind_of
from .._lib.units import labelled
from ..ensemble.records import outcome_flags, stamp
from ..flight.case import Case
from ..flight.dynamics import ANGLES, OMEGA, PATH, POSITION, VELOCITY, Glider
from ..flight.parts import from_text, to_text
from ..steady import COMPONENTS, Reason, SteadyGlide
from .glides import AXES, TURNS, classes_of, parameters_of
from .restore import or_refuse, part_of

_ONE, _EACH = ("glide",), ("glide", "component")
_MOVING, _TURNING = ("glide", "time", "axis"), ("glide", "time", "turn")

# name: (dimensions, unit, long name); those of single numbers are fields of a `SteadyGlide`
_NUMBERS = {
    "phase": ("rad", "phase of the waves at the start of a cycle"),
    "residual": ("", "largest scaled number by which a cycle misses its start"),
    "period": ("s", "of a cycle; of a frozen body a second"),
    "speed": ("m/s", "speed through the air at the start of a cycle"),
    "glide_angle": ("rad", "angle of the mean path below the horizontal"),
    "forward_speed": ("m/s", "horizontal speed along the mean path"),
    "sink_rate": ("m/s", "speed downwards along the mean path"),
    "turn_rate": ("rad/s", "rate at which the mean path turns to the left"),
    "spectral_radius": ("", "largest modulus of the multipliers"),
    "step": ("s", "longest step of the solver"),
}
_ARRAYS = {
    "state": (_EACH, "mixed", "reduced state at the start of a cycle"),
    "multiplier_real": (("glide", "mode"), "", "real part of the multipliers"),
    "multiplier_imaginary": (("glide", "mode"), "", "imaginary part of the multipliers"),
    "slopes": ((*_EACH, "by"), "", "derivative of the return map by the scaled state"),
    "position": (_MOVING, "m", "position of the centre of mass from the start, inertial axes"),
    "velocity": (_MOVING, "m/s", "velocity through the air, inertial axes"),
    "omega": (_MOVING, "rad/s", "angular velocity, body axes"),
    "angles": (_TURNING, "rad", "yaw, pitch, roll"),
    "path_length": ((*_ONE, "time"), "m", "horizontal path length through the air so far"),
}
_COUNTS = {"reason": "whether one was found, or why not", "iterations": "derivatives taken"}
_STEADY = Schema(
    "a steady glide's variables",
    {
        **{name: Variable(_ONE, unit, gaps=True) for name, (unit, _) in _NUMBERS.items()},
        **{
            name: Variable(dims, "" if unit == "mixed" else unit, gaps=True)
            for name, (dims, unit, _) in _ARRAYS.items()
        },
        "reason": Variable(_ONE, "", 0, len(Reason) - 1),
        "iterations": Variable(_ONE, "", 0, 2**31 - 1),
    },
    sizes={"glide": 10_000, "time": 100_000, "component": 8, "by": 8, "mode": 8},
    labels={"axis": AXES, "turn": TURNS, "component": COMPONENTS, "by": COMPONENTS},
)
_STATES = {"position": POSITION, "velocity": VELOCITY, "omega": OMEGA, "angles": ANGLES}


def steady_dataset(glides: SteadyGlide | Sequence[SteadyGlide]) -> xr.Dataset:
    """A steady glide, or several of one glider, as a labelled dataset.

    Args:
        glides: one, or several as `steady_glides` finds them.

    Returns:
        Dataset over component of the reduced state, mode and time [s]; of several, `glide`
        comes first. Angles are in radians, lest they change by a rounding: `files.open` makes
        the same of it, to the bit.

    Raises:
        ValueError: there is none, one is a batch, or they are of different gliders.
    """
    several = [glides] if isinstance(glides, SteadyGlide) else list(glides)
    for glide in several:
        check_kind("result", glide, SteadyGlide)
        if glide.found.ndim:
            raise ValueError(f"result is a batch of steady glides of shape {glide.found.shape}")
    records = [to_text({"glider": glide.glider}) for glide in several]
    if len({(record, one.averaged) for record, one in zip(records, several, strict=True)}) != 1:
        said = "of different gliders or models" if several else "empty"
        raise ValueError(f"result = {len(several)} steady glides: it is {said}")
    values = [_values(glide) for glide in several]
    rows = {name: (_ONE, *about) for name, about in _NUMBERS.items()} | _ARRAYS
    rows |= {name: (_ONE, "", said) for name, said in _COUNTS.items()}
    variables = {
        name: (dims, np.stack([one[name] for one in values]), labelled(unit, said))
        for name, (dims, unit, said) in rows.items()
    }
    data = xr.Dataset(variables, coords=_coordinates(several[0], set(variables)))
    data["reason"].attrs |= outcome_flags({int(one): one.name.lower() for one in Reason})
    first = several[0]
    kind = {"frozen": int(first.frozen), "averaged": int(first.averaged)}
    settings = {**classes_of(first.glider), **kind, "parts": records[0]}
    data = stamp(data, settings, "steady glide")
    return data.isel(glide=0) if isinstance(glides, SteadyGlide) else data


def _values(glide: SteadyGlide) -> dict[str, np.ndarray]:
    """What differs from glide to glide, by the names in a file."""
    names = (*_NUMBERS, *_COUNTS, "state", "slopes")
    found = {name: np.asarray(getattr(glide, name)) for name in names}
    states, multipliers = np.asarray(glide.states), np.asarray(glide.multipliers)
    found |= {name: states[:, part] for name, part in _STATES.items()}
    found["path_length"] = states[:, PATH]
    return found | {
        "multiplier_real": np.real(multipliers),
        "multiplier_imaginary": np.imag(multipliers),
    }


def _coordinates(glide: SteadyGlide, taken: set[str]) -> dict[str, Any]:
    times = np.asarray(glide.times), labelled("s", "time since the start of the cycle")
    found: dict[str, Any] = {"time": ("time", *times)}
    found |= {"axis": list(AXES), "turn": list(TURNS)}
    found |= {"component": list(COMPONENTS), "by": list(COMPONENTS)}
    return found | parameters_of(Case(glide.glider, ends=()), {*taken, *found}, launched=False)


def steady_of(data: xr.Dataset) -> SteadyGlide | tuple[SteadyGlide, ...]:
    """The steady glide, or several, that `steady_dataset` made the dataset of.

    Raises:
        OwnPartError: a part that flew is the user's own; the message names it.
        ValueError: the dataset lacks a variable or an attribute, or holds a wrong one; one
            sentence names it.
    """
    several = "glide" in data.dims
    found = or_refuse(lambda: _glides(data if several else _listed(data)), data, "steady glide")
    return found if several else found[0]


def _listed(data: xr.Dataset) -> xr.Dataset:
    """A dataset of one as one of several."""
    names = [name for name in _STEADY.variables if name in data]
    return data.assign({name: data[name].expand_dims("glide") for name in names})


def _glides(data: xr.Dataset) -> tuple[SteadyGlide, ...]:
    kind = kind_of(data)
    if kind != "steady glide":
        raise ValueError("it says no format" if kind is None else f"it is of the kind {kind!r}")
    glider = part_of(from_text(str(data.attrs["parts"])), "glider", Glider)
    model = {name: bool(int(data.attrs[name])) for name in ("frozen", "averaged")}
    data = checked(data, _STEADY)
    if data.sizes["mode"] != len(COMPONENTS):
        raise ValueError(f"it has {data.sizes['mode']} multipliers, not {len(COMPONENTS)}")
    return tuple(_glide(data.isel(glide=k), glider, model) for k in range(data.sizes["glide"]))


def _glide(data: xr.Dataset, glider: Glider, model: dict[str, bool]) -> SteadyGlide:
    found = int(data["reason"]) == Reason.FOUND
    names = (*_NUMBERS, *_COUNTS, "state", "slopes")
    values = {name: data[name].values for name in names}
    parts = [data[name].values for name in _STATES] + [data["path_length"].values[:, None]]
    multipliers = np.empty(data.sizes["mode"], np.result_type(values["state"], np.complex64))
    multipliers.real, multipliers.imag = (
        data[f"multiplier_{part}"].values for part in ("real", "imaginary")
    )
    values |= {"states": np.concatenate(parts, axis=1), "multipliers": multipliers}
    for name, value in values.items():
        if found and np.isnan(value).any():
            raise ValueError(f"{name} is not a number, though it says that one was found")
    arrays: dict[str, Any] = {name: jnp.asarray(value) for name, value in values.items()}
    return SteadyGlide(glider=glider, found=jnp.asarray(found), **model, **arrays)
