"""Sweeps: many glides in batches, with progress, kept and resumed (floor 5)."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .batch import default_width, solve, template
from .records import study_dataset
from .store import Store
from .study import Study


def progress_bar(total: int, unit: str, show: bool | None, done: int = 0):
    """A bar with rate and time left: on a terminal and in a notebook, silent when piped."""
    from tqdm.auto import tqdm

    notebook = "notebook" in tqdm.__module__
    disable = None if show is None and not notebook else show is False
    return tqdm(total=total, initial=done, unit=unit, disable=disable, smoothing=0.1)


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
        store: folder for the results (Zarr), written batch by batch. If it holds part of
            the same study, only the rest is computed. Without one all stays in memory.
        width: glides per batch; by default chosen for the devices.
        progress: show a progress bar; by default where somebody can see it.
        cluster: a `dask.distributed.Client`, or a scheduler's address, on whose workers to
            compute; they must see `store` at the same path. Needs `jaxglide[cluster]`.

    Returns:
        Dataset over the grid's dimensions, or over `case`; see `records.study_dataset`.

    Raises:
        ValueError: a wrong argument, or a store that is not this study's (`StoreError`).
    """
    width = min(width or default_width(study), len(study))
    order = study.order()
    chunks = -(-len(study) // width)
    kept = None if store is None else Store(store, study, width, template(study))
    done = np.zeros(chunks, bool) if kept is None else kept.finished()
    todo = np.flatnonzero(~done)
    sizes = np.minimum(width, len(study) - width * np.arange(chunks))
    pieces: dict[int, Mapping[str, np.ndarray]] = {}
    with progress_bar(len(study), "glide", progress, int(sizes[done].sum())) as bar:
        if cluster is not None:
            from .cluster import solve_on_cluster

            if store is None:
                raise ValueError("a sweep on a cluster needs a store")
            finished: Iterator = solve_on_cluster(study, Path(store), width, todo, cluster)
        else:
            finished = _solve_here(study, kept, width, order, todo, pieces)
        for chunk in finished:
            bar.update(int(sizes[chunk]))
    if kept is not None:
        flown = kept.read()
    else:
        flown = {n: np.concatenate([pieces[c][n] for c in range(chunks)]) for n in pieces[0]}
    back = np.argsort(order)
    return study_dataset(study, {name: values[back] for name, values in flown.items()})


def _solve_here(study, kept, width, order, todo, pieces) -> Iterator[int]:
    for chunk in map(int, todo):
        values = solve(study, order[chunk * width : (chunk + 1) * width], width)
        if kept is None:
            pieces[chunk] = values
        else:
            kept.write(chunk, values)
        yield chunk
