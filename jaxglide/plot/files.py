"""Results read back from disk: NetCDF files and Zarr stores, even unfinished (floor 6)."""

from pathlib import Path

import numpy as np
import xarray as xr
import zarr

from .._netcdf import load_netcdf
from ..records import study_dataset
from ..store import _FORMAT, _digest
from ..study import Study


def open_result(path: str | Path) -> xr.Dataset:
    """A saved result as a dataset in memory.

    Args:
        path: a NetCDF file, the store of a sweep, or a dataset written as Zarr.

    Returns:
        The dataset. Of a store that is partly filled, cases that were not computed have
        outcome -1 and NaN everywhere else; the attributes `computed` and `total` count.

    Raises:
        FileNotFoundError: there is nothing of that name.
        ValueError: it is damaged, not finished at all, or no result of jaxglide.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no {path}")
    data = _opened_zarr(path) if path.is_dir() else load_netcdf(path)
    if not {"version_jaxglide", "jaxglide"} & set(data.attrs):
        raise ValueError(f"{path} is not a result of jaxglide")
    if data.attrs.get("computed") == 0:
        raise ValueError(f"{path} holds no finished batch yet")
    return data


def _opened_zarr(path: Path) -> xr.Dataset:
    try:
        return _open_zarr(path)
    except Exception as error:
        said = str(error).split("\n")[0]
        raise ValueError(f"cannot read {path}: damaged, or no Zarr store ({said})") from error


def _open_zarr(path: Path) -> xr.Dataset:
    group = zarr.open_group(str(path), mode="r")
    if group.attrs.get("format") == _FORMAT:
        return _from_store(group)
    with xr.open_zarr(path, consolidated=False) as data:
        return data.load()


def _from_store(group: zarr.Group) -> xr.Dataset:
    """Finished chunks of a sweep's store, each verified by its digest."""
    study = Study.from_json(str(group.attrs["study"]))
    width = int(group.attrs["width"])  # type: ignore[arg-type]
    digests = np.asarray(group["digest"][:])  # type: ignore[index]
    names = sorted(set(group.array_keys()) - {"digest"})
    flown = {name: np.asarray(group[name][:]) for name in names}  # type: ignore[index]
    missing = np.ones(len(study), bool)
    for chunk in np.flatnonzero(digests.any(axis=1)):
        rows = slice(chunk * width, (chunk + 1) * width)
        if not np.array_equal(_digest({n: v[rows] for n, v in flown.items()}), digests[chunk]):
            raise ValueError(f"chunk {chunk} does not match its digest")
        missing[rows] = False
    for values in flown.values():
        values[missing] = np.nan if values.dtype.kind == "f" else -1
    back = np.argsort(study.order())
    data = study_dataset(study, {name: values[back] for name, values in flown.items()})
    own = {name: str(v) for name, v in group.attrs.items() if name.startswith("version_")}
    return data.assign_attrs(**own, computed=int((~missing).sum()), total=len(study))
