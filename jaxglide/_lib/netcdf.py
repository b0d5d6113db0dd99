"""NetCDF files read within bounds: their table of contents first, values after."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import xarray as xr

MOST_BYTES = 2**33
"""Most bytes that the variables of a file may take in memory."""
DENSEST = 1100
"""Most bytes of values for a byte of file: deflation packs zeros 1032 to 1."""


def load_netcdf(path: str | Path) -> xr.Dataset:
    """A NetCDF 4 file in memory.

    Only a flat file is read, of numbers and texts that it holds itself: no groups, no links
    to elsewhere, no references. Times stay numbers in their `units`.

    Raises:
        FileNotFoundError: there is none.
        ValueError: it is damaged, of another kind, or too large; one sentence names it.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no {path}")
    try:
        with h5py.File(path, "r") as file:
            said = _problem(file, path.stat().st_size)
        if said is None:
            with xr.open_dataset(
                path, engine="h5netcdf", decode_times=False, decode_timedelta=False
            ) as data:
                data.load()
                data.encoding["source"] = str(path)  # as the user calls it, for messages
                return data
    except Exception as error:  # HDF5 and its readers have an error for every kind of damage
        first = (str(error).splitlines() or [type(error).__name__])[0]
        said = f"it is damaged, or no NetCDF 4 file ({first[:200]})"
    raise ValueError(f"cannot read {path}: {said}")


def _problem(file: h5py.File, size: int) -> str | None:
    """What keeps a file from being read, from its table of contents alone."""
    total, most = 0, min(DENSEST * size, MOST_BYTES)
    for name in file:
        link = file.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            return f"{name!r} is a link to elsewhere, not a variable"
        entry: Any = file.get(name, getclass=True)
        if entry is not h5py.Dataset:
            return f"{name!r} is a {entry.__name__.lower()}, where only variables may be"
        variable: Any = file[name]
        if variable.is_virtual or variable.external:
            return f"the values of {name!r} are in another file"
        if not (variable.dtype.kind in "iufbSU" or h5py.check_string_dtype(variable.dtype)):
            return f"{name!r} holds neither numbers nor texts"
        total += int(np.prod(variable.shape, dtype=object)) * variable.dtype.itemsize
        if total > most:
            return (
                f"its variables, up to {name!r} of shape {variable.shape}, take {total:.3g} "
                f"bytes, where a file of {size} bytes may hold {most}"
            )
    return None
