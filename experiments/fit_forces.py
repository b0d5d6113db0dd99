"""Force multipliers that bring the model's flights closest to the measured ones.

Two multipliers, on lift and drag, fitted to the paths of all 36 flights, with and without
corrections of each flight's gait within its measured uncertainty; how well they are known,
how they predict animals they were not fitted to; and what they do to the published shape
space and to the best bend. JAXGLIDE_FLIGHTS names the folder of recordings; `--size` is the
number of resamplings of the animals.
"""

import numpy as np
import xarray as xr
from common import arguments, flights, save_dataset, save_figure, write_table
from matplotlib.figure import Figure

from jaxglide.ensemble.published import NU_THETA, THETA_M
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.flights.agreement import compare_paths
from jaxglide.flights.fitter import SCALES, Fit, Fitter, fitted_dataset
from jaxglide.flights.flights import fly_flights
from jaxglide.plot import style
from jaxglide.plot.flights import measured_and_simulated
from jaxglide.search.problem import SETUP

UNCERTAINTY = {"theta_m": 5.0, "psi_m": 4.0, "d_psi": 4.0}
"""Of a measured gait [deg]: how far amplitudes by modes and by range differ, and the bias of
the bend in a synthetic flight, rounded up."""
LATER = {"lift_scale": 1.35, "drag_scale": 1 / 1.4}
"""Quasi-steady theory was later reported to give 35 % too little lift, 40 % too much drag."""
BENDS = np.linspace(-20.0, 20.0, 21)  # deg per SVL


def main() -> None:
    options = arguments(__doc__)
    data = flights()
    fitter = Fitter(data)
    found = fitter.fit()
    print(found, flush=True)
    best = fitter.start(tuple(found.scales.values()))
    drawn = fitter.resample(options.size or 100, start=best)
    low, high = np.percentile(drawn, (2.5, 97.5), axis=0)
    animals = fitter.leave_out(start=best)
    header = ("animal", "flights", *SCALES, "predicted (m)", "unfitted (m)")
    write_table(options.out / "fit_animals", header, [list(row.values()) for row in animals])
    corrected = Fitter(data, UNCERTAINTY)
    gaits = corrected.fit()
    print(gaits, flush=True)
    rows = [
        row_of("published forces", (1.0, 1.0), found.misfit_before),
        [*row_of("fitted", found.scales.values(), found.misfit)],
        [*row_of("fitted, gaits corrected", gaits.scales.values(), gaits.misfit)],
        row_of("as later reported", LATER.values(), misfit_of(fitter, LATER.values())),
    ]
    header = ("model", "lift", "drag", "lift/drag", "paths apart (m)")
    write_table(options.out / "fit_forces", header, rows)
    sd, sd_corrected = (
        one.relative_errors * np.array(list(one.scales.values())) for one in (found, gaits)
    )
    rows = []
    for k, (name, value) in enumerate(found.scales.items()):
        own = value, sd[k], low[k], high[k], gaits.scales[name], sd_corrected[k]
        rows.append([name, *map(float, own)])
    header = ("multiplier", "fitted", "sd (Gauss-Newton)", "2.5 % of animals", "97.5 %")
    header = (*header, "gaits corrected", "sd")
    write_table(options.out / "fit_uncertainty", header, rows)
    for name, one, of in (("fit", found, fitter), ("fit_corrected", gaits, corrected)):
        save_dataset(fitted_dataset(of, one), options.out / f"{name}.nc")
    rows = []
    for (name, given), changes in zip(UNCERTAINTY.items(), gaits.changes.T, strict=True):
        one = np.rad2deg(changes)
        rows.append([name, *map(float, (given, one.mean(), one.std(ddof=1), abs(one).max()))])
    header = ("angle", "uncertainty (deg)", "mean correction", "sd", "largest")
    write_table(options.out / "fit_corrections", header, rows)
    closer = corrected_gaits(data, corrected, gaits)
    distances(options, (data, found.scales), (closer, gaits.scales))
    conclusions(options, found.scales)
    save_figure(draw(found, drawn, gaits, animals), options.out / "fit_forces.png")


def row_of(name, scales, misfit) -> list:
    lift, drag = map(float, scales)
    return [name, lift, drag, lift / drag, float(misfit)]


def misfit_of(fitter: Fitter, scales) -> float:
    return float(np.sqrt(np.mean(fitter.errors(fitter.start(tuple(scales))) ** 2)))


def corrected_gaits(data: xr.Dataset, fitter: Fitter, gaits: Fit) -> xr.Dataset:
    """The flights with the gaits that were fitted."""
    changed = {}
    for name, change in zip(fitter.corrected, np.rad2deg(gaits.changes).T, strict=True):
        changed[name] = data[name] + xr.DataArray(change, dims="trial")
    return data.assign(changed)


def distances(options, measured: tuple, corrected: tuple) -> None:
    """How far the flights go with measured and corrected gaits, and their pictures.

    Each is given as the flights and the scales fitted to them.
    """
    rows = []
    for name, (data, scales), picture in (
        ("published forces, measured gaits", (measured[0], {}), None),
        ("fitted forces, measured gaits", measured, "fit_flights"),
        ("published forces, corrected gaits", (corrected[0], {}), None),
        ("fitted forces, corrected gaits", corrected, "fit_flights_corrected"),
    ):
        flown = fly_flights(data, polar="smooth", node_set="gauss", **scales)
        found = compare_paths(flown)
        far, true = found.distance_simulated.values, found.distance_measured.values
        own = far.mean(), far.std(ddof=1), far.mean() / true.mean()
        own += np.corrcoef(far, true)[0, 1], found.path_error.values.mean()
        rows.append([name, *map(float, own), int(found.turned_simulated.sum())])
        if picture is not None:
            save_figure(measured_and_simulated(flown), options.out / f"{picture}.png")
    header = ("model", "distance (m)", "sd", "of the measured", "correlation")
    header += ("apart at equal heights (m)", "turn back")
    write_table(options.out / "fit_distances", header, rows)


def conclusions(options, scales) -> None:
    """Shape space at 10 m and best bend, with the published and with the fitted forces."""
    rows = []
    for name, fixed in (("published forces", {}), ("fitted forces", dict(scales))):
        grid = {"theta_m": np.asarray(THETA_M), "nu_theta": np.asarray(NU_THETA)}
        cells: list = [name]
        for frequency in (0.0, 1.2):
            case = {"f_theta": frequency, "height": 10.0, **fixed}
            data = sweep(Study(grid, fixed=case, setup=SETUP))
            stable = data.outcome.values == 0
            y = data.landing_point.sel(axis="y").values
            cells += [int(stable.sum()), float(data.path_length.values[stable].mean())]
            if frequency:
                cells.append(float(y[stable].max()))
        study = Study({"d_psi": BENDS}, fixed={"height": 10.0, **fixed}, setup=SETUP)
        bends = sweep(study)
        landed = bends.outcome.values == 0
        y = np.where(landed, bends.landing_point.sel(axis="y").values, -np.inf)
        k = int(np.argmax(y))
        rows.append([*cells, float(BENDS[k]), float(y[k]), int(landed.sum())])
    header = ("forces", "frozen: stable of 121", "mean path (m)", "undulating: stable")
    header += ("mean path then (m)", "farthest (m)", "best bend (deg)", "distance there (m)")
    write_table(options.out / "fit_conclusions", (*header, f"landed of {BENDS.size}"), rows)


@style()
def draw(found, drawn: np.ndarray, gaits, animals) -> Figure:
    """The multipliers with their uncertainty, and the misfit of each flight."""
    figure = Figure(figsize=(180 / 25.4, 70 / 25.4), dpi=300, layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(*drawn.T, ".", ms=2.5, color="#999999", mew=0, label="animals drawn anew")
    out = np.array([[row[name] for name in SCALES] for row in animals])
    left.plot(*out.T, "s", ms=3, color="#0072B2", mew=0, label="one animal left out")
    left.plot(*found.scales.values(), "*", ms=9, color="#D55E00", mec="white", label="fitted")
    left.plot(*gaits.scales.values(), "D", ms=4, color="#009E73", label="gaits corrected")
    left.plot(1, 1, "o", ms=4, mfc="white", mec="#222222", label="published")
    left.plot(*LATER.values(), "P", ms=5, color="#222222", mew=0, label="as later reported")
    left.set_xlabel("multiplier on lift")
    left.set_ylabel("multiplier on drag")
    left.legend(loc="best")
    most = 1.08 * max(found.errors.max(), found.errors_before.max())
    right.plot([0, most], [0, most], color="#999999", lw=0.7, zorder=0)
    right.plot(found.errors_before, found.errors, "o", ms=3.2, color="#0072B2", mec="white")
    right.set_xlim(0, most)
    right.set_ylim(0, most)
    right.set_aspect("equal")
    right.set_xlabel("paths apart with published forces (m)")
    right.set_ylabel("with fitted forces (m)")
    return figure


if __name__ == "__main__":
    main()
