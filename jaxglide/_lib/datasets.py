"""Datasets from outside: variables, dimensions, units and ranges declared once."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from .units import factor, in_file


class Variable(NamedTuple):
    """What a dataset must hold under a name.

    Attributes:
        dims: dimensions, in this order; values over the same ones in another are transposed.
        unit: of the numbers, as people read it; None for names (texts).
        low, high: range, in that unit; `low` itself is excluded where `low_open`.
        gaps: whether NaN may stand where there is no value.
    """

    dims: tuple[str, ...] = ()
    unit: str | None = ""
    low: float = -np.inf
    high: float = np.inf
    low_open: bool = False
    gaps: bool = False


class Schema(NamedTuple):
    """What a dataset must hold.

    Attributes:
        what: the dataset is, for messages, such as "the flights".
        variables: by name; coordinates too.
        sizes: most entries by dimension.
        labels: of dimensions whose entries are known by name, in this order.
    """

    what: str
    variables: Mapping[str, Variable]
    sizes: Mapping[str, int]
    labels: Mapping[str, tuple[str, ...]] = {}


def checked(data: xr.Dataset, schema: Schema) -> xr.Dataset:
    """The dataset with its declared variables in their dimensions and units.

    A variable without the attribute `units` is taken to be in the declared unit.

    Args:
        data: from a file, or made by hand; what is not declared stays as it is.
        schema: what it must hold.

    Raises:
        ValueError: a variable is missing, over other dimensions, no number, in a unit that
            cannot be converted, not finite or out of range; the message names the file,
            the variable, the entry, the value and what is allowed.
    """
    if not isinstance(data, xr.Dataset):
        raise ValueError(f"{schema.what} are no xarray Dataset but a {type(data).__name__}")
    source = data.encoding.get("source")
    where = f"{source}: " if source else ""
    for name in schema.variables:
        if name not in data.variables:
            raise ValueError(f"{where}{schema.what} have no variable {name!r}")
    for dim, most in schema.sizes.items():
        size = data.sizes.get(dim, 0)
        if not 1 <= size <= most:
            raise ValueError(
                f"{where}{schema.what} have {size} entries over {dim!r}, where 1 to {most} are "
                "allowed"
            )
    try:
        data = _in_order(data, schema.labels)
        # without coordinates, lest one that is converted realign the others
        found = {n: _variable(data[n], v).variable for n, v in schema.variables.items()}
    except ValueError as error:
        raise ValueError(f"{where}{error}") from None
    return data.assign_coords({n: v for n, v in found.items() if n in data.coords}).assign(
        {n: v for n, v in found.items() if n not in data.coords}
    )


def _in_order(data: xr.Dataset, labels: Mapping[str, tuple[str, ...]]) -> xr.Dataset:
    """The dataset with labelled dimensions in the declared order."""
    for dim, wanted in labels.items():
        if dim not in data.sizes:
            continue  # the variables that should be over it are told
        have = [str(label) for label in data[dim].values] if dim in data.coords else wanted
        if sorted(have) != sorted(wanted) or data.sizes[dim] != len(wanted):
            raise ValueError(f"{dim!r} has entries {', '.join(have)}, not {', '.join(wanted)}")
        data = data.isel({dim: [have.index(label) for label in wanted]})
    return data


def _variable(values: xr.DataArray, declared: Variable) -> xr.DataArray:
    name = str(values.name)
    if set(values.dims) != set(declared.dims) or len(values.dims) != len(declared.dims):
        have, want = (", ".join(map(str, d)) or "nothing" for d in (values.dims, declared.dims))
        raise ValueError(f"{name!r} is over {have}, where it must be over {want}")
    values = values.transpose(*declared.dims)
    if declared.unit is None:
        if not _texts(values.values):
            raise ValueError(
                f"{name!r} holds {values.dtype.name} values, where names are needed"
            )
        return values
    if values.dtype.kind not in "iuf":
        raise ValueError(f"{name!r} holds {values.dtype.name} values, where numbers are needed")
    given = str(values.attrs.get("units", declared.unit))
    try:
        times = factor(given, declared.unit)
    except ValueError as error:
        raise ValueError(f"unit of {name!r}: {error}") from None
    if times != 1.0:
        attributes = {**values.attrs, "units": in_file(declared.unit)}
        values = (values * times).assign_attrs(attributes)
    _check_range(values, declared)
    return values


def _texts(values: np.ndarray) -> bool:
    if values.dtype.kind == "O":
        return all(isinstance(value, str) for value in values.ravel())
    return values.dtype.kind in "UT"


def _check_range(values: xr.DataArray, declared: Variable) -> None:
    numbers, low, high = values.values, declared.low, declared.high
    good = np.isfinite(numbers)
    good &= (numbers > low) if declared.low_open else (numbers >= low)
    good &= numbers <= high
    if declared.gaps:
        good |= np.isnan(numbers)
    if good.all():
        return
    worst = np.unravel_index(int(np.argmin(good)), good.shape)
    entries = [_entry(values, str(dim), at) for dim, at in zip(values.dims, worst, strict=True)]
    there = f" at {', '.join(entries)}" if entries else ""
    unit = f" {declared.unit}" if declared.unit else ""
    allowed = "finite"
    if np.isfinite([low, high]).any():
        left = "(" if declared.low_open or np.isinf(low) else "["
        right = ")" if np.isinf(high) else "]"
        allowed += f" and in {left}{low:g}, {high:g}{right}{unit}"
    raise ValueError(
        f"{values.name} = {numbers[worst]:g}{unit}{there} is not allowed: it must be {allowed}"
    )


def _entry(values: xr.DataArray, dim: str, at: np.intp) -> str:
    """An entry of a dimension by its label, else by its number from 1."""
    return f"{dim} {values[dim].values[at]}" if dim in values.coords else f"{dim} {at + 1}"
