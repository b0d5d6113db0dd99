"""The published shape space, its regions and its numbers (floor 5, MODEL section 12).

I. J. Yeaton, S. D. Ross, G. A. Baumgardner, J. J. Socha, "Undulation enables gliding in
flying snakes", Nature Physics 16, 974-982 (2020), doi:10.1038/s41567-020-0935-4.
"""

import numpy as np
import xarray as xr

from .gait import shape_line
from .glide import Outcome
from .study import Study
from .sweep import sweep

NU_THETA = np.round(np.linspace(1.0, 1.5, 11), 2)
"""Wave numbers of the eleven published shapes, (11,)."""
THETA_M = shape_line(NU_THETA)
"""Horizontal amplitudes of the eleven shapes [deg], (11,), falling with `NU_THETA`."""
REGIONS = ("all", "observed", "open", "closed")

STABLE = {
    1.2: dict(zip(REGIONS, (94.21488, 100.0, 100.0, 80.55556), strict=True)),
    0.0: dict(zip(REGIONS, (49.58678, 34.69388, 83.33333, 36.11111), strict=True)),
}
"""Published share of stable 10 m glides [%] by frequency [Hz] and region."""
PATH_LENGTH = {
    1.2: dict(zip(REGIONS, (4.25101, 4.91298, 3.36140, 4.23961), strict=True)),
    0.0: dict(zip(REGIONS, (3.96429, 3.97908, 4.24204, 3.66642), strict=True)),
}
"""Published mean path length of 10 m glides [m] by frequency [Hz] and region."""


def regions() -> np.ndarray:
    """Region of every shape, "observed", "open" or "closed", (11, 11).

    Rows are `THETA_M` (highest first), columns `NU_THETA` (lowest first).
    """
    offset = np.subtract.outer(np.arange(11), np.arange(11))
    names = np.where(offset > 2, "open", "closed")
    return np.where(np.abs(offset) <= 2, "observed", names)


def shape_study(height: float = 10.0, *, rtol: float = 1e-6, atol: float = 1e-6) -> Study:
    """The 121 published shapes, frozen (0 Hz) and undulating (1.2 Hz).

    Args:
        height: launch height [m]; published at 10 and 75.
        rtol, atol: tolerances, as in `simulate`.
    """
    grid = {"f_theta": [0.0, 1.2], "theta_m": THETA_M, "nu_theta": NU_THETA}
    return Study(grid, fixed={"height": height}, rtol=rtol, atol=atol)


def shape_space(height: float = 10.0, *, rtol=1e-6, atol=1e-6, **options) -> xr.Dataset:
    """Fly the published shape space.

    Args:
        height, rtol, atol: as in `shape_study`.
        **options: keyword arguments of `sweep.sweep`.

    Returns:
        Dataset over f_theta [Hz], theta_m [deg] and nu_theta, with `region` as a
        coordinate and angles in degrees.
    """
    data = sweep(shape_study(height, rtol=rtol, atol=atol), **options)
    return data.assign_coords(region=(("theta_m", "nu_theta"), regions()))


def _mean(values: xr.DataArray, region: str) -> float:
    chosen = values if region == "all" else values.where(values.region == region)
    return float(chosen.mean())


def summary(data: xr.Dataset) -> list[tuple[str, float, str, float, float]]:
    """Rows (quantity, f_theta, region, ours, published) for 10 m glides of `shape_space`."""
    rows = []
    stable = 100.0 * (data.outcome == Outcome.LANDED)
    for label, values, published in (
        ("stable (%)", stable, STABLE),
        ("mean path length (m)", data.path_length, PATH_LENGTH),
    ):
        for f_theta in (1.2, 0.0):
            for region in REGIONS:
                ours = _mean(values.sel(f_theta=f_theta), region)
                rows.append((label, f_theta, region, ours, published[f_theta][region]))
    return rows


def borderline(data: xr.Dataset, finer: xr.Dataset) -> list[tuple[float, float, float]]:
    """Shapes (f_theta, theta_m [deg], nu_theta) stable in only one of two solutions."""
    differs = (data.outcome == Outcome.LANDED) != (finer.outcome == Outcome.LANDED)
    where = np.argwhere(differs.values)
    return [
        (
            float(data.f_theta[i]),
            float(data.theta_m[j]),
            float(data.nu_theta[k]),
        )
        for i, j, k in where
    ]
