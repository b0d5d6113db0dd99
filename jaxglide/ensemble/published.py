"""The published shape space, its regions and its numbers (figures 4 and 5, table S1).

I. J. Yeaton, S. D. Ross, G. A. Baumgardner, J. J. Socha, "Undulation enables gliding in
flying snakes", Nature Physics 16, 974-982 (2020), doi:10.1038/s41567-020-0935-4.
"""

import numpy as np
import xarray as xr

from .._lib.defaults import TOLERANCE
from .._lib.formats import marked
from ..flight.ends import Outcome
from ..shape.gait import shape_line
from .study import Study
from .sweep import sweep

NU_THETA = np.round(np.linspace(1.0, 1.5, 11), 2)
"""Wave numbers of the eleven published shapes, (11,)."""
THETA_M = shape_line(NU_THETA)
"""Horizontal amplitudes of the eleven shapes [deg], (11,), falling with `NU_THETA`."""
BENDS = np.array([-20.0, -10.0, 0.0, 10.0, 20.0])
"""Dorsoventral bends of figure 5 [deg per SVL], (5,)."""
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


HEIGHT_INCREASE = dict(zip(REGIONS, (10.48119, 12.46063, 13.80932, 4.45882), strict=True))
"""Published mean increase of height lost in 75 m glides, 1.2 Hz minus 0 [m], by region."""
PATH_INCREASE = dict(zip(REGIONS, (5.04456, 6.85885, 5.86851, 1.75118), strict=True))
"""Published mean increase of path length in 75 m glides, 1.2 Hz minus 0 [m], by region."""
HEIGHT_SHARE = {"all": 85.95, "observed": 100.0}
"""Published share of shapes whose height lost in 75 m glides undulation increases [%]."""
PATH_SHARE = {"all": 85.95, "observed": 91.84}
"""The same for path length [%]."""


def regions() -> np.ndarray:
    """Region of every shape, "observed", "open" or "closed", (11, 11).

    Rows are `THETA_M` (highest first), columns `NU_THETA` (lowest first).
    """
    offset = np.subtract.outer(np.arange(11), np.arange(11))
    names = np.where(offset > 2, "open", "closed")
    return np.where(np.abs(offset) <= 2, "observed", names)


def shape_study(height: float = 10.0, *, rtol=TOLERANCE, atol=TOLERANCE) -> Study:
    """The 121 published shapes, frozen (0 Hz) and undulating (1.2 Hz).

    Args:
        height: launch height [m]; published at 10 and 75.
        rtol, atol: tolerances, as in `simulate`.
    """
    grid = {"f_theta": [0.0, 1.2], "theta_m": THETA_M, "nu_theta": NU_THETA}
    return Study(grid, fixed={"height": height}, rtol=rtol, atol=atol)


def shape_space(
    height: float = 10.0, *, rtol=TOLERANCE, atol=TOLERANCE, **options
) -> xr.Dataset:
    """Fly the published shape space.

    Args:
        height, rtol, atol: as in `shape_study`.
        **options: keyword arguments of `sweep.sweep`.

    Returns:
        Dataset over f_theta [Hz], theta_m [deg] and nu_theta, with `region` as a
        coordinate and angles in degrees.
    """
    data = sweep(shape_study(height, rtol=rtol, atol=atol), **options)
    regional = data.assign_coords(region=(("theta_m", "nu_theta"), regions()))
    return marked(regional, "shape space")


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


def long_summary(data: xr.Dataset) -> list[tuple[str, str, float, float]]:
    """Rows (quantity, region, ours, published) for 75 m glides of `shape_space`."""
    rows = []
    for label, name, means, shares in (
        ("height lost", "height_lost", HEIGHT_INCREASE, HEIGHT_SHARE),
        ("path length", "path_length", PATH_INCREASE, PATH_SHARE),
    ):
        increase = data[name].sel(f_theta=1.2) - data[name].sel(f_theta=0.0)
        for region, published in means.items():
            ours = _mean(increase, region)
            rows.append((f"mean increase of {label} (m)", region, ours, published))
        for region, published in shares.items():
            ours = _mean(100.0 * (increase > 0), region)
            rows.append((f"shapes that increase {label} (%)", region, ours, published))
    return rows


def bending_study(psi_m=(0.0, 10.0, 20.0), **options) -> Study:
    """Figure 5: the eleven shapes of the line, bent and flat, from 10 m, with trajectories.

    Args:
        psi_m: vertical amplitudes [deg].
        **options: other arguments of `Study`.

    Returns:
        Cases ordered by psi_m, then d_psi (-20 to 20 deg), then nu_theta: reshape them to
        (psi_m, 5, 11).
    """
    columns = np.meshgrid(psi_m, BENDS, np.arange(11), indexing="ij")
    vertical, bend, shape = (column.ravel() for column in columns)
    cases = {
        "psi_m": vertical,
        "d_psi": bend,
        "nu_theta": NU_THETA[shape],
        "theta_m": THETA_M[shape],
    }
    return Study(cases=cases, **{"times": np.arange(0, 4, 0.02), **options})


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
