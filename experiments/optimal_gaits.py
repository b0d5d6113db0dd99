"""Gaits that glide farthest from 10 m and 75 m without coming near a tumble.

Gradient search over three or five variables of the gait, within the ranges observed in
flight and within wide ones, beside the best of the 121 published shapes flown alike. Each
optimum is solved again at 1e-9 and its neighbourhood sampled. The last columns say what
share of the body and flight lies beyond the measured force coefficients. Bodies that would
touch themselves are ruled out: the model does not know that they cannot.
"""

import time
from typing import Any

from common import arguments, save_dataset, save_figure, write_table  # first: it sets up JAX

# isort: split
import numpy as np
import xarray as xr

from jaxglide import Outcome, simulate
from jaxglide.ensemble.base import published_case
from jaxglide.ensemble.published import NU_THETA, THETA_M
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.flight.extrapolation import extrapolation
from jaxglide.plot import before_and_after, convergence, paths
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.objectives import clearance, landing_distance, stability_margin
from jaxglide.search.optimum import Optimum, optimise, verify
from jaxglide.search.problem import SETUP, Problem

SHAPE = ("theta_m", "nu_theta", "d_psi")
GAIT = ("nu_theta", "theta_m", "psi_m", "d_psi", "f_theta")
OBSERVED = Problem(landing_distance, GAIT).free  # ranges in flight
WIDE = {
    "nu_theta": (0.7, 2.0),
    "theta_m": (60.0, 150.0),
    "psi_m": (0.0, 60.0),
    "d_psi": (-40.0, 60.0),
    "f_theta": (0.3, 3.0),
}
RANGES = {"observed": OBSERVED, "wide": WIDE}
USUAL = {"psi_m": 20.0, "f_theta": 1.2}  # of the published shapes
EFFORT: dict[float, dict[str, Any]] = {
    10.0: {"starts": 32, "screen": 512, "steps": 100},
    75.0: {"starts": 12, "screen": 512, "steps": 24},
}
TOLERANCE = {10.0: 1e-6, 75.0: 1e-7}  # of the search; a longer glide magnifies errors more
MARGIN = 10.0  # deg left to a tumble
SAMPLES = 256  # around an optimum
CLEARANCE = 1.0  # greatest chords between parts of the body: below, it would touch itself
MAP_BEND = 5.0  # deg per SVL: where the broadest optimum lies
FINE = {"theta_m": np.linspace(80, 120, 41), "nu_theta": np.linspace(1, 1.5, 41)}


def problem_of(height: float = 10.0, names=SHAPE, ranges: str = "observed") -> Problem:
    """The farthest landing at least `MARGIN` short of a tumble, without touching oneself."""
    free = {name: RANGES[ranges][name] for name in names}
    margin = stability_margin.at_least(MARGIN, scale=10.0)
    tolerance: dict[str, Any] = {"rtol": TOLERANCE[height], "atol": TOLERANCE[height]}
    limits = margin, clearance.at_least(CLEARANCE)
    return Problem(landing_distance, free, limits, {"height": height}, **tolerance)


def best_published(height: float) -> tuple[dict[str, float], float, bool]:
    """Of the 121 shapes at the published bend: the farthest that keeps the margin.

    Returns:
        The gait, its distance [m], and whether any kept the margin (if none, the farthest).
    """
    theta, nu = np.meshgrid(THETA_M, NU_THETA, indexing="ij")
    points = np.stack([theta.ravel(), nu.ravel(), np.full(theta.size, 10.0)], axis=1)
    found = Evaluator(problem_of(height), gradients=False)(points).values
    kept = (found[:, 1:] >= 0).all(axis=1)
    best = int(np.argmax(np.where(kept | ~kept.any(), found[:, 0], -np.inf)))
    gait: dict[str, float] = dict(zip(SHAPE, points[best].tolist(), strict=True))
    return gait, float(found[best, 0]), bool(kept.any())


def fly(gait, height: float):
    """The glide of a gait with its trajectory, at 1e-9."""
    case = published_case(SETUP).replace({**gait, "height": height})
    return simulate(case.glider, case.launch, rtol=1e-9, atol=1e-9, dense=True)


def unmeasured(glide) -> list[float]:
    """Shares of body length and time beyond the measured angles of attack and Re [%]."""
    beyond = extrapolation(glide)
    return [100 * x for x in (beyond.angle_of_attack, beyond.reynolds, beyond.either)]


def binding(slacks) -> str:
    """Which constraints bind, in words."""
    names = ("margin", "clearance")
    return ", ".join(n for n, s in zip(names, slacks, strict=True) if s < 0.05) or "none"


def at_bounds(problem: Problem, best) -> str:
    """Which parameters lie within 1 % of their range of a bound, in words."""
    ends = []
    for name, (low, high) in problem.free.items():
        near = 0.01 * (high - low)
        if best[name] < low + near or best[name] > high - near:
            ends.append(f"{name} {'low' if best[name] < low + near else 'high'}")
    return ", ".join(ends) or "none"


def search(
    options, height: float, names, ranges: str, published, guesses=()
) -> tuple[list, Optimum]:
    """One row of the table, and the optimum."""
    label = f"optimal_{height:g}m_{len(names)}_{ranges}"
    problem, effort = problem_of(height, names, ranges), dict(EFFORT[height])
    effort["starts"] = options.size or effort["starts"]
    log = options.out / f"{label}.jsonl" if options.resume else None
    begin = time.perf_counter()
    screener = Evaluator(problem, gradients=False)
    found = optimise(problem, **effort, guesses=guesses, log=log, screener=screener)
    took = time.perf_counter() - begin
    checked = verify(problem, found.best, samples=SAMPLES, screener=screener)
    print(f"{label}: {found}\n", flush=True)
    old, old_distance, kept = published
    glide = fly(found.best, height)
    gain = 100 * (found.value / old_distance - 1)
    margin = 10 * float(found.slacks[0]) + MARGIN
    row = [
        *(f"{height:g}", len(names), ranges),
        *(float(found.best.get(name, np.nan)) for name in (*SHAPE, "psi_m", "f_theta")),
        *(found.value, gain if kept else np.nan, str(Outcome(int(glide.outcome)))),
        *(margin, binding(found.slacks), at_bounds(problem, found.best)),
        *(checked.value, 100 * checked.gain, *unmeasured(glide)),
        float(found.slacks[1]) + CLEARANCE,
        *(found.evaluations, int((found.status == 0).sum()), effort["starts"], took),
    ]
    save_figure(convergence(found.history), options.out / f"{label}_convergence.png")
    names_ = "best published shape", "optimised gait"
    both = before_and_after(fly(old, height), glide, names_)
    save_figure(both, options.out / f"{label}_glide.png")
    save_dataset(found.history, options.out / f"{label}.nc")
    return row, found


HEADER = (
    *("height (m)", "variables", "ranges", "theta_m (deg)", "nu_theta", "d_psi (deg)"),
    *("psi_m (deg)", "f_theta (Hz)", "distance (m)", "gain (%)", "outcome"),
    *("margin (deg)", "binds", "at bounds", "at 1e-9 (m)", "best nearby (%)"),
    *("angles beyond (%)", "Re beyond (%)", "either (%)"),
    "clearance (chords)",
    *("gradients", "converged", "starts", "seconds"),
)


def main() -> None:
    options = arguments(__doc__)
    rows, published = [], {height: best_published(height) for height in EFFORT}
    for height, (gait, distance, kept) in published.items():
        glide = fly(gait, height)
        outcome, shares = str(Outcome(int(glide.outcome))), unmeasured(glide)
        margin = 85.0 - float(np.rad2deg(glide.max_angles).max())
        rows.append(
            [
                *(f"{height:g}", 0, "published" if kept else "published, none in the margin"),
                *(*(float(v) for v in gait.values()), 20.0, 1.2, distance, 0.0, outcome),
                *(margin, "", "", float(glide.landing_point[1]), np.nan, *shares),
                float(clearance(glide.glider)),
                *(0, 0, 0, 0.0),
            ]
        )
    for height in EFFORT:
        for ranges in RANGES:
            row, three = search(options, height, SHAPE, ranges, published[height])
            rows.append(row)
            # more freedom is never worse: the search over five starts from this one too
            wider = [{**USUAL, **three.best}]
            row, _ = search(options, height, GAIT, ranges, published[height], wider)
            rows.append(row)
            write_table(options.out / "optimal_gaits", HEADER, rows)
            if (height, ranges) == (10.0, "observed"):
                draw_paths(options, three.history)


def draw_paths(options, history: xr.Dataset) -> None:
    """Paths of the starts over the distance at one bend."""
    fixed = {"height": 10.0, "d_psi": MAP_BEND}
    data = sweep(Study(FINE, fixed=fixed, setup=SETUP))
    save_figure(paths(history, data), options.out / "optimal_10m_3_observed_paths.png")


if __name__ == "__main__":
    main()
