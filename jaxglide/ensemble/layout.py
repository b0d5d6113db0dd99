"""What a sweep keeps of every glide: names, shapes and types."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from .plan import AbstractPlan
from .records import _VARIABLES, study_dataset

_SIZES = {"axis": 3, "turn": 3}
_WHOLE = ("outcome", "accepted", "rejected")


class Layout(NamedTuple):
    """One result of every glide: its dimensions after the first, their sizes, its type."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    about: dict[str, str]

    def blank(self, count: int) -> np.ndarray:
        """Results of glides that were not flown, (count, ...)."""
        return np.full((count, *self.shape), self.fill, self.dtype)

    @property
    def fill(self) -> float:
        """What stands where nothing was computed."""
        return math.nan if self.dtype.kind == "f" else -1


def layout(study: AbstractPlan, kind: str) -> dict[str, Layout]:
    """What a sweep keeps of every glide (see `batch.results`), by name.

    Args:
        study: the study.
        kind: float32 or float64.
    """
    sizes = {**_SIZES, "sample": len(study.times or ())}
    if study.times is not None:
        sizes["state"] = study.state_size
    found = {}
    for name, (dims, unit, long_name, radians) in _VARIABLES.items():
        about = {"units": "rad" if radians else unit, "long_name": long_name}
        found[name] = (dims, "int32" if name in _WHOLE else kind, about)
    if study.times is not None:
        found["states"] = (("sample", "state"), kind, {"long_name": "states at the samples"})
    return {
        name: Layout(dims, tuple(sizes[d] for d in dims), np.dtype(dtype), about)
        for name, (dims, dtype, about) in sorted(found.items())
    }


class Contents(NamedTuple):
    """What is computed and kept of every case of a study.

    Attributes:
        format: of a store of that, its name and version.
        layout: results by name, of a study and float32 or float64.
        dataset: of a study and its results by name in case order, in the units people read.
        settings: by name, on which the results depend beside the study.
    """

    format: str
    layout: Callable[[AbstractPlan, str], dict[str, Layout]]
    dataset: Callable[[AbstractPlan, Mapping[str, np.ndarray]], xr.Dataset]
    settings: Mapping[str, int | float]


GLIDES = Contents("jaxglide sweep 3", layout, study_dataset, {})
"""What a sweep keeps."""


def blank(study: AbstractPlan, kind: str, contents: Contents = GLIDES) -> dict[str, np.ndarray]:
    """Results of no case yet, by name, (N, ...): -1 and NaN."""
    found = contents.layout(study, kind)
    return {name: array.blank(len(study)) for name, array in found.items()}


def bytes_of(study: AbstractPlan, kind: str, contents: Contents = GLIDES) -> int:
    """Size of all results."""
    found = contents.layout(study, kind).values()
    return math.prod(study.shape) * sum(math.prod(a.shape) * a.dtype.itemsize for a in found)
