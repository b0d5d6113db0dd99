"""Steady sweeps: the steady glides of many cases, kept and resumed."""

import contextlib
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from .._lib.checks import check_integer, check_kind
from ..flight.case import Case
from ..steady.closure import Kind
from ..steady.glide import STEP, sought
from .layout import Contents, bytes_of
from .seeker import Found, Seeker
from .steady_records import steady_contents
from .store import check_memory, opened, precision
from .study import Study
from .sweep import fill


def steady_sweep(
    study: Study,
    store: str | Path | None = None,
    *,
    starts: int = 5,
    most: int = 4,
    step: float = STEP,
    progress: bool | None = None,
) -> xr.Dataset:
    """Find the steady glides of all cases of a study.

    From the five starts that `steady_glide` tries first and some of its Sobol set, for every
    case all of them: a gait may have several steady glides, and the first is rarely the
    stable one. The most stable are kept. It cannot promise that there are no more.

    Args:
        study: the gliders; their launch and their ends have no part in it.
        store: folder for the results, written as they come, as in `sweep`: killed and called
            again, it goes on there.
        starts: points of the Sobol set, 0 to 4096.
        most: how many steady glides are kept of a case, 1 to 64.
        step: longest step of the solver [s], as in `steady_glide`.
        progress: show a progress bar; by default where somebody can see it.

    Returns:
        Dataset over the grid's dimensions, or over `case`, and over `solution`, the most
        stable first. `found` says whether there is one, `count` how many were found, and
        `reason` why there is none; of each, among others, glide_angle [deg], speed [m/s],
        sink_rate [m/s], turn_rate [deg/s], spectral_radius and multipliers (their real and
        imaginary parts, the largest first). NaN where there is none.

    Raises:
        TypeError: a glider that has no steady glide, as in `steady_glide`.
        ValueError: a wrong argument, or a store that is not this sweep's (`StoreError`).
        OSError: the store cannot be read or written.

    Examples:
        >>> from jaxglide import Study, steady_sweep
        >>> setup = {"polar": "smooth", "node_set": "gauss", "nodes": 40}
        >>> data = steady_sweep(Study({"nu_theta": [1.3, 1.4]}, setup=setup), starts=0)
        >>> print(data.found.values)
        [False  True]
    """
    check_kind("study", study, Study)
    check_integer("starts", starts, 0, 4096)
    check_integer("most", most, 1, 64)
    sought(study.base.glider, 0.0, step)  # which checks them
    contents = steady_contents(starts, most, step)
    check_memory("the study", bytes_of(study, precision(), contents))
    order = study.order()
    solve = partial(_solved, study, contents, order)
    with contextlib.ExitStack() as stack:
        tell, kept = progress is not False, None
        if store is not None:
            kept = stack.enter_context(opened(store, study, tell, contents))
        found = fill(study, kept, solve, progress, contents, "case")
    back = np.argsort(order)
    return contents.dataset(study, {name: values[back] for name, values in found.items()})


def kinds(base: Case, varied: Mapping[str, np.ndarray], count: int) -> dict[Kind, np.ndarray]:
    """Places of cases by the equation that the steady glides there fulfil.

    Args:
        base: the case with what is fixed.
        varied: values by path, each (N,).
        count: N.
    """

    def zero(path: str) -> np.ndarray:
        return np.broadcast_to(varied.get(path, base.value(path)) == 0, count)

    frozen, mirrored = zero("gait.f_theta"), zero("gait.d_theta")
    parts = {
        Kind(True, False): frozen,
        Kind(False, True): ~frozen & mirrored,
        Kind(False, False): ~frozen & ~mirrored,
    }
    return {kind: np.flatnonzero(these) for kind, these in parts.items() if these.any()}


def _solved(
    study: Study, contents: Contents, order: np.ndarray, rows: np.ndarray
) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Places in the solving order, and results there, as they come."""
    settings = contents.settings
    blank = contents.layout(study, precision())
    base, lanes = study.base, study.lanes(order[rows])
    varied = {base.path(name): values for name, values in lanes.items()}
    for kind, places in kinds(base, varied, len(rows)).items():
        seeker = Seeker(base, kind, settings["step"])
        values = {name: value[places] for name, value in lanes.items()}

        def starts(some, seeker=seeker, values=values):
            here = {name: value[some] for name, value in values.items()}
            return seeker.starts(here, int(settings["starts"]))

        for place, found in seeker.search(values, starts):
            yield rows[places[[place]]], _row(found, blank)


def _row(found: Found, layout: Any) -> dict[str, np.ndarray]:
    """Results of one case, by name, each (1, ...)."""
    row = {name: array.blank(1) for name, array in layout.items()}
    row["count"][0], row["reason"][0] = len(found.roots), found.reason
    row["coarse"][0], row["full"][0] = found.coarse, found.full
    for name, values in found.values.items():
        some = values[: row[name].shape[1]]
        row[name][0, : len(some)] = some
    return row
