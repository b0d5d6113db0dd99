"""Every kind of result, saved and opened again; nothing here loads Matplotlib.

`open` makes of a file what was saved in it. A file is data alone: it runs no code, names no
module to import, and takes no more memory than there is.
"""

import warnings
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from ..control import Controller
    from ..flight.trajectory import AbstractTrajectory
    from ..steady import SteadyGlide
    from .controllers import controlled_dataset, controller_dataset, controller_of
    from .glides import glide_dataset
    from .logs import log_dataset
    from .restore import flight_of
    from .saved import open_dataset
    from .steady import steady_dataset, steady_of

__all__ = [
    "controlled_dataset",
    "controller_dataset",
    "controller_of",
    "flight_of",
    "glide_dataset",
    "log_dataset",
    "open",
    "open_dataset",
    "save",
    "steady_dataset",
    "steady_of",
]
_WHERE = {
    "controller_dataset": "controllers",
    "controller_of": "controllers",
    "flight_of": "restore",
    "controlled_dataset": "controllers",
    "glide_dataset": "glides",
    "log_dataset": "logs",
    "open_dataset": "saved",
    "steady_dataset": "steady",
    "steady_of": "steady",
}


def __getattr__(name: str):
    """Names are imported on first use: what they need takes a second to load."""
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_WHERE[name]}", __name__), name)


def open(path: str | Path) -> Any:
    """What was saved in a file.

    Args:
        path: a NetCDF file (.nc) of any result, the store of a sweep (a folder), a study file
            (.toml), or the log of an optimisation (.jsonl).

    Returns:
        A saved glide as a `Glide`, a piece of flight as a `Trajectory`; between its saved
        times it is interpolated linearly. A `SteadyGlide`, or a tuple of them, and a
        `Controller`, to the bit. A study file as a `Study`. Every other result as the Dataset
        that it was; of a store that is partly filled, cases that were not computed have
        outcome -1 and NaN everywhere else. A flight with a part of the user's own, whose
        class no file holds, comes back as a Dataset, and a warning says so.

    Raises:
        FileNotFoundError: there is nothing of that name.
        ValueError: it is damaged, of version 0.1, or no result of jaxglide; one sentence says
            which.

    Examples:
        >>> import jaxglide
        >>> from jaxglide import Study, sweep
        >>> study = Study({"nu_theta": [1.0, 1.4], "d_psi": [0, 10]}, fixed={"height": 2})
        >>> data = sweep(study, "map.zarr")
        >>> jaxglide.open("map.zarr").equals(data)
        True
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"there is no {path}")
    if path.suffix == ".toml":
        from ..ensemble.study import Study

        return Study.from_file(path)
    if path.suffix == ".jsonl":
        from .logs import log_dataset

        return log_dataset(path)
    from .._lib.formats import kind_of
    from .._lib.records import OwnPartError
    from .controllers import controller_of
    from .restore import flight_of
    from .saved import open_dataset
    from .steady import steady_of

    data = open_dataset(path)
    made = {"glide": flight_of, "trajectory": flight_of, "steady glide": steady_of}
    made |= {"controller": controller_of}
    make = made.get(kind_of(data) or "")
    if make is None:
        return data
    try:
        return make(data)
    except OwnPartError as error:
        warnings.warn(f"{error}: this is its Dataset", stacklevel=2)
        return data


def save(
    result: "xr.Dataset | AbstractTrajectory | Controller | SteadyGlide | tuple",
    path: str | Path,
) -> Path:
    """Write a result as a NetCDF file, for `open`.

    Args:
        result: a glide or trajectory that kept its path (`dense=True`), a `Controller`, a
            `SteadyGlide` or the tuple that `steady_glides` gives, or the Dataset of any other
            result.
        path: the file (.nc).

    Returns:
        The path.

    Raises:
        TypeError: it is another thing.
        ValueError: a flight kept no trajectory or is a batch, steady glides are of different
            gliders, a Dataset says no format, or the name does not end in .nc.
        OSError: the file cannot be written.

    Examples:
        >>> import jaxglide
        >>> from jaxglide import Study, sweep
        >>> data = sweep(Study({"nu_theta": [1.0, 1.4], "d_psi": [0, 10]}, fixed={"height": 2}))
        >>> print(jaxglide.save(data, "map.nc"))
        map.nc
    """
    import xarray as xr

    from .._lib.formats import kind_of
    from .._lib.writing import write_netcdf
    from ..control import Controller
    from ..flight.trajectory import AbstractTrajectory
    from ..steady import SteadyGlide
    from .controllers import controller_dataset
    from .glides import glide_dataset
    from .steady import steady_dataset

    path = Path(path)
    if path.suffix != ".nc":
        raise ValueError(f"path = {str(path)!r}: the name must end in .nc")
    if isinstance(result, AbstractTrajectory):
        result = glide_dataset(result)
    elif isinstance(result, Controller):
        result = controller_dataset(result)
    elif isinstance(result, SteadyGlide | tuple):
        result = steady_dataset(result)
    if not isinstance(result, xr.Dataset):
        raise TypeError(f"result = {type(result).__name__} is no flight and no Dataset")
    if kind_of(result) is None:
        raise ValueError("result says no format: it is no result of jaxglide")
    write_netcdf(path, result)
    return path
