"""Which gaits have a steady glide, how flat, how stable, and what that says of long flights.

Three maps by `jaxglide.steady_sweep`, smooth polar, Gauss nodes: the 121 published shapes,
frozen and undulating (60 nodes); a Sobol set of 512 gaits over wide ranges of five variables,
and one of 256 in the ranges that are observed (40 nodes). And the 121 shapes launched from
75 m, with the same polar: does the spectral radius of a shape's steady glide say whether and
when it tumbles? `--size` is the number of gaits in the wide ranges; half as many are drawn in
those observed.
"""

import itertools
import time
from typing import Any

import numpy as np
import xarray as xr
from common import arguments, save_dataset, save_figure, write_table
from matplotlib.figure import Figure
from scipy.stats import qmc, spearmanr

from jaxglide.ensemble.published import NU_THETA, THETA_M
from jaxglide.ensemble.steady import steady_sweep
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.flight.ends import Outcome
from jaxglide.plot import style

SMOOTH = {"polar": "smooth", "node_set": "gauss"}
WIDE = {
    "theta_m": (40.0, 140.0),
    "nu_theta": (0.8, 2.2),
    "d_psi": (-20.0, 30.0),
    "psi_m": (0.0, 45.0),
    "f_theta": (0.6, 3.0),
}
OBSERVED = {
    "theta_m": (80.0, 120.0),
    "nu_theta": (1.0, 1.5),
    "d_psi": (-20.0, 30.0),
    "psi_m": (0.0, 45.0),
    "f_theta": (1.0, 1.7),
}
SEED = 0


def shapes(**fixed) -> Study:
    """The 121 published shapes, frozen and undulating."""
    grid = {"f_theta": [0.0, 1.2], "theta_m": THETA_M, "nu_theta": NU_THETA}
    return Study(grid, fixed=fixed, setup={**SMOOTH, "nodes": 60})


def gaits(ranges: dict[str, tuple[float, float]], count: int) -> Study:
    """A Sobol set of gaits."""
    low, high = np.array(list(ranges.values())).T
    drawn = low + (high - low) * qmc.Sobol(len(ranges), rng=SEED).random(count)
    return Study(cases=dict(zip(ranges, drawn.T, strict=True)), setup={**SMOOTH, "nodes": 40})


def summary(name: str, data: xr.Dataset) -> tuple:
    """A row of the table of maps."""
    radius, angle = data.spectral_radius.values, data.glide_angle.values
    least = np.fmin.reduce(radius, axis=-1)
    flattest = np.nanmin(angle)
    stable, firm = (np.where(radius < bound, angle, np.nan) for bound in (1.0, 0.95))
    return (
        name,
        int(data.found.size),
        int(data.found.sum()),
        int(data["count"].sum()),
        int((least < 1).sum()),
        int((least < 0.95).sum()),
        float(np.nanmedian(least)),
        float(flattest),
        float(np.fmin.reduce(stable, axis=None)),
        float(np.fmin.reduce(firm, axis=None)),
    )


HEADER = (
    "map",
    "gaits",
    "with a steady glide",
    "steady glides",
    "gaits with a stable one",
    "with a radius below 0.95",
    "median of the least radius",
    "flattest (deg)",
    "flattest stable (deg)",
    "flattest below 0.95 (deg)",
)


def stable_rows(data: xr.Dataset, most: int = 12) -> list[tuple]:
    """The stable gaits, the flattest first."""
    names = [name for name in WIDE if name in data.coords]
    stable = data.glide_angle.where(data.spectral_radius < 1)
    flat = stable.min("solution")
    rows = []
    for case in np.argsort(flat.values)[: min(most, int(flat.notnull().sum()))]:
        here = data.isel(case=int(case))
        here = here.isel(solution=int(stable.isel(case=int(case)).argmin("solution")))
        gait = [float(here[name]) for name in names]
        rows.append((*gait, *(float(here[n]) for n in ("glide_angle", "speed", "sink_rate"))))
        rows[-1] += (float(here.spectral_radius),)
    return rows


def predicted(steady: xr.Dataset, flown: xr.Dataset) -> tuple[list[tuple], dict]:
    """Rank correlations of growth with how long flights from 75 m last; by frequency."""
    rows, points = [], {}
    for f_theta, period in ((0.0, 1.0), (1.2, 1 / 1.2)):
        here, flight = steady.sel(f_theta=f_theta), flown.sel(f_theta=f_theta)
        growth = np.log(here.spectral_radius.isel(solution=0).values) / period
        lasting, tumbles = flight.time.values, flight.outcome.values != Outcome.LANDED
        some = np.isfinite(growth)
        stable = growth < 0
        points[f_theta] = growth[some], lasting[some], tumbles[some]
        rank: Any = spearmanr(growth[some], lasting[some])
        row = (f_theta, int(some.sum()), int(stable.sum()), int(tumbles.sum()))
        row += (int((tumbles & stable).sum()), float(np.nanmedian(growth)))
        row += tuple(
            float(np.median(lasting[these])) if these.any() else np.nan
            for these in (some, stable, ~some)
        )
        rows.append((*row, float(rank.statistic), float(rank.pvalue)))
    return rows, points


PREDICTED = (
    "f_theta (Hz)",
    "shapes with a steady glide",
    "with a stable one",
    "tumble from 75 m",
    "of the stable ones",
    "median growth rate (1/s)",
    "median time of those with one (s)",
    "of the stable ones (s)",
    "of those without (s)",
    "rank correlation of growth and time",
    "p",
)


def leaning(name: str, data: xr.Dataset) -> tuple:
    """Rank correlation of the least growth rate with each variable of the gait."""
    growth = np.log(data.spectral_radius.isel(solution=0).values) * data.f_theta.values
    some = np.isfinite(growth)
    ranks: list[Any] = [spearmanr(data[n].values[some], growth[some]) for n in WIDE]
    return (name, int(some.sum()), *(float(rank.statistic) for rank in ranks))


PARTS = {
    "theta_m": (40, 80, 120, 140),
    "nu_theta": (0.8, 1.0, 1.5, 2.2),
    "f_theta": (0.6, 1.0, 1.7, 3.0),
    "d_psi": (-20, 0, 20, 30),
    "psi_m": (0, 15, 30, 45),
}
SHALLOW = 45.0  # degrees


def by_part(data: xr.Dataset) -> list[tuple]:
    """How many gaits have a stable steady glide, and a stable shallow one, in parts of each
    range: of the first three below, within and above what is observed."""
    stable = data.spectral_radius < 1
    shallow = (stable & (data.glide_angle < SHALLOW)).any("solution").values
    stable, rows = stable.any("solution").values, []
    for name, edges in PARTS.items():
        for low, high in itertools.pairwise(edges):
            here = (low <= data[name].values) & (data[name].values < high)
            counts = (int(x[here].sum()) for x in (stable, shallow))
            rows.append((name, float(low), float(high), int(here.sum()), *counts))
    return rows


def by_frequency(data: xr.Dataset, parts: int = 4) -> list[tuple]:
    """How many glide steadily, and stably, in each part of the range of frequencies."""
    f_theta, rows = data.f_theta.values, []
    least = data.spectral_radius.isel(solution=0).values
    growth = np.log(least) * f_theta
    edges = np.linspace(*WIDE["f_theta"], parts + 1)
    for low, high in itertools.pairwise(edges):
        here = (low <= f_theta) & (f_theta < high)
        found, stable = (int(x[here].sum()) for x in (data.found.values, least < 1))
        rows.append((float(low), float(high), int(here.sum()), found, stable))
        rows[-1] += (float(np.nanmedian(growth[here])),)
    return rows


@style()
def draw_shapes(steady: xr.Dataset) -> Figure:
    """Glide angle and growth over the shape space, frozen and undulating."""
    figure = Figure(figsize=(150 / 25.4, 130 / 25.4), dpi=300, layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    looks = (
        ("glide_angle", "steepness of the steady glide (deg)", "viridis_r"),
        ("growth", "growth of the worst mode (1/s)", "magma_r"),
    )
    period = xr.DataArray([1.0, 1 / 1.2], dims="f_theta", coords={"f_theta": [0.0, 1.2]})
    first = steady.isel(solution=0)
    shown = {"glide_angle": first.glide_angle, "growth": np.log(first.spectral_radius) / period}
    for row, (name, label, colours) in zip(axes, looks, strict=True):
        low, high = (float(f(shown[name])) for f in (np.nanmin, np.nanmax))
        for ax, f_theta in zip(row, (0.0, 1.2), strict=True):
            values = shown[name].sel(f_theta=f_theta)
            picture = ax.pcolormesh(
                NU_THETA, THETA_M, values, cmap=colours, vmin=low, vmax=high, rasterized=True
            )
            ax.set_facecolor("#dddddd")
            if name == "glide_angle":
                ax.set_title("frozen" if f_theta == 0 else f"{f_theta} Hz")
            else:
                ax.set_xlabel("nu_theta")
        row[0].set_ylabel("theta_m (deg)")
        figure.colorbar(picture, ax=list(row), label=label)
    return figure


@style()
def draw_gaits(maps: dict[str, xr.Dataset]) -> Figure:
    """Every steady glide found: how steep against how stable."""
    figure = Figure(figsize=(120 / 25.4, 80 / 25.4), dpi=300, layout="constrained")
    ax = figure.add_subplot()
    for (name, data), colour in zip(maps.items(), ("#0072B2", "#D55E00"), strict=True):
        radius, angle = data.spectral_radius.values.ravel(), data.glide_angle.values.ravel()
        ax.scatter(radius, angle, s=6, color=colour, alpha=0.6, lw=0, label=f"{name} ranges")
    ax.axvline(1.0, color="#222222", lw=0.7)
    ax.set_xscale("log")
    ax.set_xlabel("spectral radius per cycle")
    ax.set_ylabel("glide angle (deg)")
    ax.invert_yaxis()
    ax.legend(loc="lower right")
    return figure


@style()
def draw_predicted(points: dict) -> Figure:
    """Time to the tumble from 75 m against the growth rate of the steady glide."""
    figure = Figure(figsize=(120 / 25.4, 75 / 25.4), dpi=300, layout="constrained")
    ax = figure.add_subplot()
    for (f_theta, (growth, lasting, _)), colour in zip(
        points.items(), ("#999999", "#0072B2"), strict=True
    ):
        label = "frozen" if f_theta == 0 else f"{f_theta} Hz"
        ax.scatter(growth, lasting, s=9, color=colour, lw=0, label=label)
    ax.set_xlabel("growth of the worst mode of the steady glide (1/s)")
    ax.set_ylabel("flight from 75 m until it tumbles (s)")
    ax.legend()
    return figure


def main() -> None:
    options = arguments(__doc__)
    count = options.size or 512
    begin = time.perf_counter()
    steady = steady_sweep(shapes(), options.store("shapes"))
    print(f"121 shapes, frozen and undulating: {time.perf_counter() - begin:.0f} s")
    flown = sweep(shapes(height=75.0), options.store("flown"))
    maps = {
        "wide": steady_sweep(gaits(WIDE, count), options.store(f"wide_{count}")),
        "observed": steady_sweep(
            gaits(OBSERVED, count // 2), options.store(f"observed_{count // 2}")
        ),
    }
    rows = [
        summary("121 shapes, frozen", steady.sel(f_theta=0.0)),
        summary("121 shapes, 1.2 Hz", steady.sel(f_theta=1.2)),
        *(summary(f"Sobol set, {name}", data) for name, data in maps.items()),
    ]
    write_table(options.out / "maps", HEADER, rows)
    header = ("theta_m", "nu_theta", "d_psi", "psi_m", "f_theta")
    header += ("glide angle (deg)", "speed (m/s)", "sink rate (m/s)", "spectral radius")
    for name, data in maps.items():
        write_table(options.out / f"stable_{name}", header, stable_rows(data))
    rows = [leaning(name, data) for name, data in maps.items()]
    write_table(options.out / "leaning", ("ranges", "gaits", *WIDE), rows)
    header = ("from (Hz)", "to (Hz)", "gaits", "with a steady glide", "with a stable one")
    header += ("median growth rate (1/s)",)
    write_table(options.out / "by_frequency", header, by_frequency(maps["wide"]))
    header = ("variable", "low", "high", "gaits", "with a stable one", "below 45 deg")
    write_table(options.out / "by_part", header, by_part(maps["wide"]))
    rows, points = predicted(steady, flown)
    write_table(options.out / "predicted", PREDICTED, rows)
    save_dataset(steady, options.out / "shapes.nc")
    save_figure(draw_shapes(steady), options.out / "steady_shapes.png")
    save_figure(draw_gaits(maps), options.out / "steady_gaits.png")
    save_figure(draw_predicted(points), options.out / "steady_tumble.png")


if __name__ == "__main__":
    main()
