"""Results read back from disk: NetCDF files and Zarr stores, even unfinished.

A file from a stranger can run no code and takes no more memory than there is: what it declares
is looked at before a library opens it. Only Zarr 3 with the codecs below is opened, nothing
that names others (Zarr 2 may ask for `pickle`).
"""

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .._lib.formats import kind_of
from .._lib.netcdf import load_netcdf
from ..ensemble.store import StoreError, check_memory, is_store, load

_CODECS = {"bytes", "vlen-utf8", "zstd", "gzip", "blosc", "crc32c"}
_TYPES = {"bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"}
_TYPES |= {"float32", "float64", "string"}
_NODE = 2**28  # bytes of a description: its attributes may hold the text of a study
_OF_ZARR_2 = {".zarray", ".zgroup", ".zattrs", ".zmetadata"}


def open_dataset(path: str | Path) -> xr.Dataset:
    """A saved result as a dataset in memory.

    Args:
        path: a NetCDF file, the store of a sweep or of a steady sweep, or a dataset written
            as Zarr 3.

    Returns:
        The dataset. Of a store that is partly filled, cases that were not computed have
        outcome or count -1 and NaN everywhere else; the attributes `computed` and `total`
        count.

    Raises:
        FileNotFoundError: there is nothing of that name.
        ValueError: it is damaged, not finished at all, or no result of jaxglide.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no {path}")
    data = _opened_zarr(path) if path.is_dir() else load_netcdf(path)
    try:
        kind = kind_of(data)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if kind is None and {"version_jaxglide", "jaxglide"} & set(data.attrs):
        raise ValueError(
            f"{path} was written by jaxglide 0.1, which said no format: compute it anew"
        )
    if kind is None:
        raise ValueError(f"{path} is not a result of jaxglide")
    if data.attrs.get("computed") == 0:
        raise ValueError(f"{path} holds no finished batch yet")
    return data


def _opened_zarr(path: Path) -> xr.Dataset:
    try:
        return _from_store(path) if is_store(path) else _open_zarr(path)
    except StoreError:
        raise
    except Exception as error:
        said = str(error).split("\n")[0]
        raise ValueError(f"cannot read {path}: damaged, or no Zarr store ({said})") from error


def _open_zarr(path: Path) -> xr.Dataset:
    _check_zarr(path)
    with xr.open_zarr(path, consolidated=False, zarr_format=3) as data:
        return data.load()


def _check_zarr(path: Path) -> None:
    """Raise `StoreError` unless every group and array below is one that may be opened."""
    size = 0
    for folder, folders, files in os.walk(path):
        for name in (*folders, *files):
            if (Path(folder) / name).is_symlink():
                raise StoreError(f"cannot read {path}: it holds a link, {name}")
        if _OF_ZARR_2.intersection(files):
            raise StoreError(f"cannot read {path}: it holds Zarr 2; only Zarr 3 is opened")
        if "zarr.json" in files:
            file = Path(folder) / "zarr.json"
            if file.stat().st_size > _NODE:
                raise StoreError(f"cannot read {path}: {file} is larger than {_NODE} bytes")
            size += _check_node(path, json.loads(file.read_bytes()))
    check_memory(path, size)


def _check_node(path: Path, node: dict[str, Any]) -> int:
    """Check a group's or an array's description; returns the bytes that an array takes."""
    copies = (node.get("consolidated_metadata") or {}).get("metadata", {})
    for copy in copies.values():
        _check_node(path, copy)
    if node["node_type"] == "group":
        return 0
    names = {c if isinstance(c, str) else c["name"] for c in node["codecs"]}
    if not names <= _CODECS or node.get("storage_transformers"):
        other = ", ".join(sorted(names - _CODECS)) or "a storage transformer"
        raise StoreError(f"cannot read {path}: it needs {other}, which is not opened")
    kind, each = node["data_type"], 8
    if isinstance(kind, dict) and kind["name"] == "fixed_length_utf32":
        each = int(kind["configuration"]["length_bytes"])
    elif kind not in _TYPES:
        raise StoreError(f"cannot read {path}: it holds {kind}, which is not opened")
    chunk = node["chunk_grid"]["configuration"]["chunk_shape"]
    return each * max(math.prod(map(int, node["shape"])), math.prod(map(int, chunk)))


def _from_store(path: Path) -> xr.Dataset:
    """Finished chunks of a sweep's store, each verified by its digest."""
    store = load(path)
    flown, done = store.read()
    computed = int(np.repeat(done, store.chunk)[: store.size].sum())
    back = np.argsort(store.study.order())
    values = {name: value[back] for name, value in flown.items()}
    data = store.contents.dataset(store.study, values)
    own = {name: str(v) for name, v in store.attributes.items() if name.startswith("version_")}
    return data.assign_attrs(**own, computed=computed, total=store.size)
