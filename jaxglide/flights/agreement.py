"""Measured and simulated paths beside each other."""

import numpy as np
import xarray as xr

from .._lib.units import labelled
from ..flight.ends import Outcome

_HEIGHTS = 100  # at which paths are compared


def _finite(path: np.ndarray) -> np.ndarray:
    return path[np.isfinite(path).all(axis=1)]


def at_heights(path: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Where a path first comes down to each height, linearly between its points.

    Args:
        path: (T, 3) [m].
        heights: [m], (K,), within the path's.

    Returns:
        Points, (K, 3).
    """
    lowest = np.minimum.accumulate(path[:, 2])
    # Where the path climbs, its lowest height so far stays: np.interp takes the first.
    falling = np.concatenate([[True], np.diff(lowest) < 0])
    down = path[falling]
    return np.stack(
        [np.interp(-heights, -down[:, 2], coordinate) for coordinate in down.T], axis=1
    )


def _broke_down(one: xr.Dataset) -> bool:
    outcome = int(one["outcome"]) if "outcome" in one else Outcome.LANDED
    whole = outcome not in (Outcome.OUT_OF_STEPS, Outcome.NON_FINITE)
    return not (whole and np.isfinite(one["end"].values).all())


def _compared(one: xr.Dataset) -> tuple:
    """End height, both distances, path error, and whether each turned, of one flight."""
    paths = [_finite(one[name].values) for name in ("position", "path")]
    paths[1] = np.vstack([paths[1], one["end"].values])
    end = max(path[:, 2].min() for path in paths)
    heights = np.linspace(paths[0][0, 2], end, _HEIGHTS)
    measured, simulated = (at_heights(path, heights) for path in paths)
    apart = np.linalg.norm(measured - simulated, axis=1)
    lengths = [np.linalg.norm((p[-1] - p[0])[:2]) for p in (measured, simulated)]
    turned = [path[-1, 1] < path[:, 1].max() - 1e-6 for path in paths]
    return end, *lengths, np.sqrt(np.mean(apart**2)), *turned


def compare_paths(flown: xr.Dataset) -> xr.Dataset:
    """Distances and path errors of measured flights and their simulations.

    Both paths are followed from their common start to the height where the first of them
    ends, and compared at equal heights. A simulation that broke down has NaN.

    Args:
        flown: from `fly_flights`, over trial.

    Returns:
        Dataset over trial: the end height, the horizontal distance from start to there,
        measured and simulated [m], the root mean square horizontal distance between the
        paths at equal heights [m], and whether each ends behind its farthest forward point
        (it "did not shallow").
    """
    rows = []
    for trial in flown["trial"].values:
        one = flown.sel(trial=trial)
        if not len(_finite(one["position"].values)):
            raise ValueError(f"position of trial {trial} is known in no frame")
        rows.append((*[np.nan] * 4, False, False) if _broke_down(one) else _compared(one))
    names = {
        "end_height": ("m", "height down to which the paths are compared"),
        "distance_measured": ("m", "horizontal distance measured"),
        "distance_simulated": ("m", "horizontal distance simulated"),
        "path_error": ("m", "root mean square distance at equal heights"),
        "turned_measured": ("", "measured flight ends behind its farthest point"),
        "turned_simulated": ("", "simulated flight ends behind its farthest point"),
    }
    columns = zip(*rows, strict=True)
    return xr.Dataset(
        {
            name: (("trial",), np.array(values), labelled(unit, long_name))
            for (name, (unit, long_name)), values in zip(names.items(), columns, strict=True)
        },
        coords={name: flown[name] for name in ("trial", "snake")},
    )


def summary(compared: xr.Dataset) -> str:
    """What a comparison shows, in a few lines, without the simulations that broke down."""
    lost = np.isnan(compared["path_error"].values)
    said = [f"{lost.sum()} of {lost.size} simulations broke down: they are left out"]
    compared = compared.isel(trial=~lost)
    if lost.all():
        return said[0]
    measured, simulated = (
        compared[f"distance_{name}"].values for name in ("measured", "simulated")
    )
    error = compared["path_error"].values
    turned = compared["trial"].values[compared["turned_simulated"].values]
    spread = ["", ""]
    if len(measured) > 1:
        spread = [f" +- {x.std(ddof=1):.2f}" for x in (measured, simulated)]
    together = ""
    if min(measured.std(), simulated.std()) > 0:
        together = f", correlation {np.corrcoef(measured, simulated)[0, 1]:.2f}"
    return "\n".join(
        [
            *(said if lost.any() else []),
            f"{len(measured)} flights; horizontal distance to a common end height:",
            f"  measured   {measured.mean():.2f}{spread[0]} m",
            f"  simulated  {simulated.mean():.2f}{spread[1]} m, "
            f"{simulated.mean() / measured.mean():.2f} of it{together}, "
            f"farther in {int((simulated > measured).sum())}",
            f"  paths apart at equal heights {error.mean():.2f} m (median "
            f"{np.median(error):.2f} m)",
            f"  did not shallow: measured {int(compared['turned_measured'].sum())}, "
            f"simulated {len(turned)}" + (f" ({', '.join(turned)})" if len(turned) else ""),
        ]
    )
