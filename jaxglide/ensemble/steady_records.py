"""What a steady sweep keeps of every case, and its results as a dataset."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from .._lib.units import labelled
from ..steady.reduced import COMPONENTS
from ..steady.result import Reason
from .layout import Contents, Layout
from .plan import AbstractPlan
from .records import stamp, study_coordinates

STEADY = "jaxglide steady sweep 1"
"""Format of a steady sweep's store."""

# name: (dimensions after the cases', unit people read, long name, radians inside)
_VARIABLES: dict[str, tuple[tuple[str, ...], str, str, bool]] = {
    "count": ((), "", "different steady glides that were found", False),
    "reason": ((), "", "whether there is one, or why not", False),
    "coarse": ((), "", "derivatives of the map with a quarter of the steps", False),
    "full": ((), "", "derivatives of the map with all steps", False),
    "speed": (("solution",), "m/s", "speed at the start of a cycle", False),
    "glide_angle": (("solution",), "deg", "mean path below the horizontal", True),
    "forward_speed": (("solution",), "m/s", "horizontally along the mean path", False),
    "sink_rate": (("solution",), "m/s", "downwards along the mean path", False),
    "turn_rate": (("solution",), "deg/s", "turning of the mean path, to the left", True),
    "spectral_radius": (("solution",), "", "largest modulus of the multipliers", False),
    "multipliers": (("solution", "mode", "part"), "", "of a small change, per cycle", False),
    "state": (("solution", "component"), "mixed", "at the start of a cycle, SI, rad", False),
    "residual": (("solution",), "", "largest scaled miss of a cycle", False),
}
_WHOLE = ("count", "reason", "coarse", "full")


def _layout(most: int, study: AbstractPlan, kind: str) -> dict[str, Layout]:
    sizes = {"solution": most, "mode": 8, "part": 2, "component": len(COMPONENTS)}
    found = {}
    for name, (dims, unit, long_name, radians) in sorted(_VARIABLES.items()):
        inside = {"deg": "rad", "deg/s": "rad/s"}[unit] if radians else unit
        dtype = np.dtype("int32" if name in _WHOLE else kind)
        about = {"units": inside, "long_name": long_name}
        found[name] = Layout(dims, tuple(sizes[d] for d in dims), dtype, about)
    return found


def steady_contents(starts: int, most: int, step: float) -> Contents:
    """What a steady sweep keeps; arguments as there."""
    settings = {"starts": int(starts), "most": int(most), "step": float(step)}
    dataset = partial(_dataset, settings)
    return Contents(STEADY, partial(_layout, settings["most"]), dataset, settings)


def _dataset(
    settings: Mapping[str, int | float], study: AbstractPlan, found: Mapping[str, np.ndarray]
) -> xr.Dataset:
    coordinates: dict[str, Any] = {"component": list(COMPONENTS), "part": ["real", "imaginary"]}
    coordinates |= study_coordinates(study)
    variables = {}
    for name, (trailing, unit, long_name, radians) in _VARIABLES.items():
        values = np.asarray(found[name])
        values = values.reshape(*study.shape, *values.shape[1:])
        values = np.rad2deg(values) if radians else values
        variables[name] = ((*study.dims, *trailing), values, labelled(unit, long_name))
    variables["reason"][2].update(
        flag_values=np.array([int(reason) for reason in Reason], dtype=np.int32),
        flag_meanings=" ".join(reason.name.lower() for reason in Reason),
    )
    known = labelled("", "whether a steady glide was found")
    variables["found"] = (study.dims, variables["count"][1] > 0, known)
    record = {"study": study.to_json(), **study.setup, **settings}
    return stamp(xr.Dataset(variables, coords=coordinates), record, "steady glides")
