"""How robust the farthest gait from 10 m is, and gaits made to be robust.

The optimum over theta_m, nu_theta and d_psi within the ranges observed, beside the best of
the published shapes and the optima of the mean and of the worst distance where the force
coefficients, the launch speed and the mass are each 10 % higher or lower. Elasticities are
gradients; the shares are of sampled circumstances, and of gaits sampled around each.
"""

from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure
from optimal_gaits import (
    CLEARANCE,
    MARGIN,
    OBSERVED,
    SHAPE,
    TOLERANCE,
    USUAL,
    WIDE,
    best_published,
    clearance,
    fly,
    problem_of,
)

from jaxglide import discretise
from jaxglide.plot import style
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.objectives import landing_distance, stability_margin, varied
from jaxglide.search.optimum import optimise
from jaxglide.search.problem import Problem

SPREAD = 0.1
CHANGED = ("lift_scale", "drag_scale", "speed", "mass")
SAMPLES = 256
FEWER = 64  # from 75 m
AROUND = 0.02  # of the ranges of the gait, for samples around it
# of the robust searches
EFFORT: dict[str, Any] = {"starts": 12, "screen": 96, "steps": 14, "polish": 4}


def corners() -> dict[str, Any]:
    """Factors of the eight corners; lift and drag change together."""
    force, speed, mass = (1 + SPREAD * np.array(list(product((-1, 1), repeat=3)))).T
    return dict(zip(CHANGED, (force, force, speed, mass), strict=True))


def robust(how: str) -> dict[str, float]:
    """The gait whose mean or worst distance is largest, with the margin in every corner."""
    worst = varied(stability_margin, corners(), "worst").at_least(MARGIN, scale=10.0)
    free = {name: OBSERVED[name] for name in SHAPE}
    tolerance: dict[str, Any] = {"rtol": TOLERANCE[10.0], "atol": TOLERANCE[10.0]}
    objective = varied(landing_distance, corners(), how)
    limits = worst, clearance.at_least(CLEARANCE)
    problem = Problem(objective, free, limits, **tolerance)
    found = optimise(problem, **EFFORT)
    print(f"{found}\n", flush=True)
    return found.best


def kept(options, label: str) -> dict[str, float] | None:
    """The optimum that `optimal_gaits` kept under a label, if it did."""
    path = options.out / f"optimal_{label}.nc"
    if not path.exists():
        return None
    history = xr.load_dataset(path, engine="h5netcdf")
    value = history.best_value.where(history.best_violation < 1e-3).values
    best = history.best_point.isel(start=int(np.nanargmax(value)))
    return {str(name): float(best.sel(parameter=name)) for name in history.parameter.values}


def nominal(options) -> dict[str, float]:
    """The optimum for fixed circumstances; that of `optimal_gaits` where it was kept."""
    found = kept(options, "10m_3_observed")
    if found is None:
        return optimise(problem_of(), starts=32, screen=512).best
    return {name: found[name] for name in SHAPE}


def problem_around(speed: float, mass: float, ranges=None, height: float = 10.0) -> Problem:
    """Distance and margin with gait and circumstances free, all in one compiled function."""
    usual = dict(zip(CHANGED, (1.0, 1.0, speed, mass), strict=True))
    free = {name: OBSERVED[name] for name in SHAPE} if ranges is None else dict(ranges)
    free |= {n: (value * (1 - SPREAD), value * (1 + SPREAD)) for n, value in usual.items()}
    margin = stability_margin.at_least(MARGIN, scale=10.0)
    tolerance: dict[str, Any] = {"rtol": TOLERANCE[height], "atol": TOLERANCE[height]}
    return Problem(landing_distance, free, (margin,), {"height": height}, **tolerance)


def long_glides(options, speed: float, mass: float) -> None:
    """Under the same changes, the gaits that land from 75 m, where they were kept."""
    usual = np.array([1.0, 1.0, speed, mass])
    drawn = usual * (1 + SPREAD * np.random.default_rng(0).uniform(-1, 1, (FEWER, 4)))
    fast, rows = Evaluator(problem_around(speed, mass, WIDE, 75.0), gradients=False), []
    for label in ("3_observed", "3_wide", "5_observed", "5_wide"):
        gait = kept(options, f"75m_{label}")
        if gait is None:
            continue
        whole = [{**USUAL, **gait}[name] for name in WIDE]
        points = np.column_stack([np.tile(whole, (FEWER, 1)), drawn])
        values = fast(np.vstack([[*whole, *usual], points])).values
        rows.append((label, float(values[0, 0]), *shares(values[1:])))
    header = ("gait", "distance (m)", "mean (m)", "10th %ile", "least", "kept (%)")
    if rows:
        write_table(options.out / "robustness_75m", header, rows)


def shares(values: np.ndarray) -> list[float]:
    """Of samples (S, 2): mean, tenth percentile and least [m]; kept the margin [%]."""
    distance = values[:, 0]
    kept = 100.0 * float((values[:, 1] >= 0).mean())
    return [*map(float, (distance.mean(), np.percentile(distance, 10), distance.min())), kept]


def main() -> None:
    options = arguments(__doc__)
    gaits = {"best published": best_published(10.0)[0], "optimum": nominal(options)}
    gaits |= {f"optimum of the {how}": robust(how) for how in ("mean", "worst")}
    glide = fly(gaits["best published"], 10.0)
    speed, mass = float(glide.take_off.speed), float(discretise(glide.glider.body).total_mass)
    problem = problem_around(speed, mass)
    exact, fast = Evaluator(problem), Evaluator(problem, gradients=False)
    middle = np.array([[*gait.values(), 1.0, 1.0, speed, mass] for gait in gaits.values()])
    found = exact(middle)
    elastic = found.gradients[:, 0, 3:] * middle[:, 3:] / found.values[:, :1]
    reach, rng = problem.high - problem.low, np.random.default_rng(0)
    unit = rng.uniform(-1, 1, (SAMPLES, 7))
    rows, drawn = [], {}
    for k, (name, gait) in enumerate(gaits.items()):
        outside = np.repeat(middle[k : k + 1], SAMPLES, axis=0)
        beside = outside.copy()
        outside[:, 3:] *= 1 + SPREAD * unit[:, 3:]
        near = beside[:, :3] + AROUND * unit[:, :3] * reach[:3]
        beside[:, :3] = np.clip(near, problem.low[:3], problem.high[:3])
        values, around = fast(outside).values, fast(beside).values
        value, slack = found.values[k]
        force = float(elastic[k, 0] + elastic[k, 1])
        row = (name, *gait.values(), float(value), MARGIN + 10 * float(slack))
        row += (*map(float, elastic[k]), force)
        rows.append((*row, *shares(values), *shares(around)))
        drawn[name] = values[:, 0], around[:, 0], float(value)
    header = (
        "gait",
        "theta_m (deg)",
        "nu_theta",
        "d_psi (deg)",
        "distance (m)",
        "margin (deg)",
    )
    header += tuple(f"% per % of {name}" for name in ("C_L", "C_D", "speed", "mass", "both C"))
    for what in ("circumstances", "gaits nearby"):
        header += tuple(f"{what}: {x}" for x in ("mean (m)", "10th %ile", "least", "kept (%)"))
    write_table(options.out / "robustness", header, rows)
    save_figure(draw(drawn), options.out / "robustness.png")
    long_glides(options, speed, mass)


@style()
def draw(drawn: dict) -> Figure:
    """Distributions of the distance under changed circumstances, and of gaits nearby."""
    figure = Figure(figsize=(180 / 25.4, 62 / 25.4), dpi=300, layout="constrained")
    axes = figure.subplots(1, 2, sharex=True, sharey=True)
    titles = "circumstances \N{PLUS-MINUS SIGN}10 %", "gaits within 2 % of the ranges"
    for column, (ax, title) in enumerate(zip(axes, titles, strict=True)):
        for row, samples in enumerate(drawn.values()):
            values = samples[column]
            jitter = np.random.default_rng(1).uniform(-0.28, 0.28, values.size)
            ax.plot(values, row + jitter, ".", ms=1.8, color="#0072B2", alpha=0.55, mew=0)
            low, middle, high = np.percentile(values, (10, 50, 90))
            ax.plot([low, high], [row, row], color="#222222", lw=1.0, label="10 to 90 %")
            ax.plot(middle, row, "o", ms=3.5, color="#222222", label="median")
            ax.plot(samples[2], row, "*", ms=8, color="#D55E00", mec="white", mew=0.5)
        ax.set_title(title)
        ax.set_xlabel("landing distance (m)")
    axes[0].set_yticks(range(len(drawn)), list(drawn))
    axes[0].invert_yaxis()
    bar, disc = axes[0].lines[1], axes[0].lines[2]
    figure.legend(
        handles=[axes[0].lines[3], disc, bar],
        labels=["as it is", "median", "10 to 90 %"],
        loc="outside lower center",
        ncols=3,
    )
    return figure


if __name__ == "__main__":
    main()
