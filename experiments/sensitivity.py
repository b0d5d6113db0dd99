"""Gradient of the landing distance over the 121 shapes: what would carry each farther.

Smooth polar and Gauss nodes; with respect to the amplitude, the number of waves and the
bend. Central differences of a few shapes beside it.
"""

import time

import numpy as np
import xarray as xr
from common import arguments, save_figure, write_table
from optimal_gaits import OBSERVED, SHAPE

from jaxglide import Outcome
from jaxglide.ensemble.published import NU_THETA, THETA_M, regions
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.plot import sensitivity_map
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.objectives import landing_distance
from jaxglide.search.problem import SETUP, Problem

WIDER = {**OBSERVED, "theta_m": (80.0, 125.0)}
STEP = 1e-4  # of central differences, in ranges of the parameters
TOLERANCE = 1e-8
FINE = {"rtol": 1e-11, "atol": 1e-11}  # of the differences, whose noise the step divides


def gradients() -> tuple[xr.Dataset, float]:
    """Distance, outcome and gradient over the shapes; largest error of the differences.

    The error is that of the gradient from central differences of six shapes, relative to
    the gradient's norm (in ranges of the parameters).
    """
    grid = {"theta_m": THETA_M, "nu_theta": NU_THETA}
    data = sweep(Study(grid, setup=SETUP, rtol=TOLERANCE, atol=TOLERANCE))
    free = {name: WIDER[name] for name in SHAPE}
    problem = Problem(landing_distance, free, rtol=TOLERANCE, atol=TOLERANCE)
    theta, nu = np.meshgrid(THETA_M, NU_THETA, indexing="ij")
    points = np.stack([theta.ravel(), nu.ravel(), np.full(theta.size, 10.0)], axis=1)
    evaluate = Evaluator(problem)
    found = evaluate(points)
    reach = problem.high - problem.low
    landed = np.flatnonzero(data.outcome.values.ravel() == Outcome.LANDED)
    some = landed[:: max(1, len(landed) // 6)][:6]
    moves = STEP * np.concatenate([np.diag(reach), -np.diag(reach)])
    beside = (points[some, None] + moves).reshape(-1, 3)
    values = evaluate(beside, **FINE).values[:, 0].reshape(len(some), 2, 3)
    slope = (values[:, 0] - values[:, 1]) / (2 * STEP)
    exact = evaluate(points[some], **FINE).gradients[:, 0] * reach
    error = np.linalg.norm(slope - exact, axis=1) / np.linalg.norm(exact, axis=1)
    dims = "theta_m", "nu_theta"
    shape = theta.shape
    data["distance"] = (dims, found.values[:, 0].reshape(shape), {"units": "m"})
    data["gradient"] = ((*dims, "parameter"), found.gradients[:, 0].reshape(*shape, 3))
    coordinates = {"parameter": list(SHAPE), "region": (dims, regions())}
    return data.assign_coords(coordinates), float(error.max())


def main() -> None:
    options = arguments(__doc__)
    begin = time.perf_counter()
    data, error = gradients()
    print(f"{time.perf_counter() - begin:.0f} s; central differences differ by {error:.1e}")
    landed = data.outcome == Outcome.LANDED
    rows = []
    for region in ("all", "observed", "open", "closed"):
        inside = landed & ((data.region == region) | (region == "all"))
        slopes = data.gradient.where(inside)
        for name in SHAPE:
            one = slopes.sel(parameter=name).values
            one = one[np.isfinite(one)]
            width = OBSERVED[name][1] - OBSERVED[name][0]
            quartiles = np.percentile(one, (25, 50, 75))
            share = 100.0 * float((one > 0).mean())
            row = (region, int(inside.sum()), name, *map(float, quartiles))
            rows.append((*row, float(quartiles[1] * width / 100), share))
    header = ("region", "landed", "parameter", "lower quartile (m per unit)", "median")
    more = ("upper quartile", "median, m per 1 % of its range", "positive (%)")
    write_table(options.out / "sensitivity", (*header, *more), rows)
    save_figure(sensitivity_map(data), options.out / "sensitivity.png")


if __name__ == "__main__":
    main()
