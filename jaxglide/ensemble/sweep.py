"""Sweeps: many glides, with progress, kept and resumed."""

import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .._lib.checks import check_integer, check_kind, warn_float32
from .._lib.progress import progress_bar
from .batch import flown, width_of
from .layout import GLIDES, Contents, blank, bytes_of
from .records import study_dataset
from .store import Store, check_memory, opened, precision
from .study import Study


def sweep(
    study: Study,
    store: str | Path | None = None,
    *,
    width: int | None = None,
    progress: bool | None = None,
    cluster: Any = None,
) -> xr.Dataset:
    """Fly all cases of a study.

    Args:
        study: what to fly.
        store: folder for the results (Zarr), written as they come. If it holds part of the
            same study, only the rest is computed; if another process is at work on it, this
            one waits. Without one all stays in memory.
        width: glides that fly at the same time; by default chosen for the devices. The results
            do not depend on it.
        progress: show a progress bar; by default where somebody can see it.
        cluster: a `dask.distributed.Client`, or a scheduler's address, on whose workers to
            compute. Needs `jaxglide[cluster]`.

    Returns:
        Dataset over the grid's dimensions, or over `case`; see `records.study_dataset`.

    Raises:
        ValueError: a wrong argument, or a store that is not this study's (`StoreError`).
        OSError: the store cannot be read or written, or the cluster fails.

    Examples:
        >>> from jaxglide import Study, sweep
        >>> study = Study({"nu_theta": [1.0, 1.4], "d_psi": [0, 10]}, fixed={"height": 2})
        >>> data = sweep(study)
        >>> print(data.landing_point.sel(axis="y").values.round(3))
        [[1.325 1.291]
         [1.319 1.298]]
    """
    check_kind("study", study, Study)
    warn_float32(study.rtol, study.atol)
    if width is not None:
        check_integer("width", width, 1, 10**7)
    check_memory("the study", bytes_of(study, precision()))
    order, tell = study.order(), progress is not False
    with contextlib.ExitStack() as stack:
        if cluster is None:
            fly = partial(_solve_here, study, order, width or width_of(study))
        else:
            from .cluster import connected, solve_on_cluster

            client = stack.enter_context(connected(cluster, tell))
            fly = partial(solve_on_cluster, client, study, order, width=width)
        kept = None if store is None else stack.enter_context(opened(store, study, tell))
        found = fill(study, kept, fly, progress)
    back = np.argsort(order)
    return study_dataset(study, {name: values[back] for name, values in found.items()})


def _solve_here(study, order, width, rows) -> Iterator[tuple[np.ndarray, Mapping]]:
    for places, values in flown(study, order[rows], width):
        yield rows[places], values


def fill(
    study: Study,
    kept: Store | None,
    fly: Callable[[np.ndarray], Iterable[tuple[np.ndarray, Mapping]]],
    progress: bool | None,
    contents: Contents = GLIDES,
    unit: str = "glide",
) -> dict[str, np.ndarray]:
    """Results in solving order: what the store has, and the rest computed and kept there.

    Args:
        study: the study.
        kept: its store, or None.
        fly: gives places in the solving order and results there, of places that are missing.
        progress: show a bar.
        contents: what is kept of every case.
        unit: what the bar counts.
    """
    if kept is None:
        flown, missing = blank(study, precision(), contents), np.ones(len(study), bool)
    else:
        flown, done = kept.read()
        missing = ~np.repeat(done, kept.chunk)[: len(study)]
    with progress_bar(len(study), unit, progress, int((~missing).sum())) as bar:
        for rows, values in fly(np.flatnonzero(missing)) if missing.any() else ():
            for name, value in flown.items():
                value[rows] = values[name]
            missing[rows] = False
            if kept is not None:
                for chunk in map(int, np.unique(rows // kept.chunk)):
                    here = kept.rows(chunk)
                    if not missing[here].any():
                        kept.write(chunk, {name: v[here] for name, v in flown.items()})
            bar.update(len(rows))
    return flown
