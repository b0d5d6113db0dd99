"""The 36 measured flights, their gaits (figure 2) and their simulations (figure 3).

Each is flown from its measured start with its measured gait. The folder of the study's public
recordings is named by JAXGLIDE_FLIGHTS.
"""

import time
from typing import Any

from common import arguments, flights, save_figure, write_table  # first: it sets up JAX

# isort: split
import numpy as np

from jaxglide import Outcome
from jaxglide.flights.agreement import compare_paths, summary
from jaxglide.flights.flights import fly_flights
from jaxglide.plot.flights import distances, every_flight, measured_and_simulated
from jaxglide.plot.measured import measured_gaits, regression

MODELS: dict[str, Any] = {
    "published polar, nodes 1 cm apart": {"polar": "published", "node_set": "published"},
    "published polar, converged nodes": {"polar": "published", "node_set": "gauss"},
    "smooth polar, converged nodes": {"polar": "smooth", "node_set": "gauss"},
}


OBSERVED = {
    "nu_theta": (1.0, 1.5),
    "f_theta": (1.0, 1.7),
    "theta_m": (80.0, 120.0),
    "psi_m": (20.0, 45.0),
    "d_psi": (-20.0, 30.0),
}
"""Ranges of the gaits that the paper states."""


SHARES = {"horizontal": 88.0, "vertical": 66.0}
"""Of the variance in the first mode, as the paper states [%]."""


def gaits(data) -> list[tuple[str, float, float]]:
    """What the paper says of its measured gaits: quantity, ours, published."""
    rows = []
    for name, of, mean, deviation in (
        ("spatial", "nu", 1.87, 0.35),
        ("temporal", "f", 1.98, 0.21),
    ):
        ratio = (data[f"{of}_psi"] / data[f"{of}_theta"]).values
        rows.append((f"{name} frequency, vertical over horizontal", ratio.mean(), mean))
        rows.append((f"{name} ratio, its standard deviation", spread(ratio), deviation))
    line = regression(data, "nu_theta", "theta_m")
    rows += [("theta_m by nu_theta (deg)", line.slope, -66.0)]
    rows += [("theta_m where nu_theta is 0 (deg)", line.intercept, 188.0)]
    first = 100 * data.variance.isel(mode=0).mean("trial")
    rows += [(f"first mode, {w} (%)", first.sel(wave=w), s) for w, s in SHARES.items()]
    kept = data.modes_kept.sel(wave="vertical").median()
    rows += [("modes for 95 %, vertical, median", kept, 4.0)]
    for name, (low, high) in OBSERVED.items():
        rows.append((f"{name}, lowest", data[name].min(), low))
        rows.append((f"{name}, highest", data[name].max(), high))
    return [(name, float(ours), published) for name, ours, published in rows]


def spread(distances: np.ndarray) -> float:
    """Standard deviation of a sample."""
    return float(np.std(distances, ddof=1))


def main() -> None:
    options = arguments(__doc__)
    begin = time.perf_counter()
    data = flights()
    write_table(options.out / "figure_2", ("quantity", "jaxglide", "published"), gaits(data))
    print(f"{data.sizes['trial']} flights measured in {time.perf_counter() - begin:.1f} s")
    rows = []
    for name, model in MODELS.items():
        flown = fly_flights(data, **model)
        begin = time.perf_counter()
        flown = fly_flights(data, **model)
        took, compared = time.perf_counter() - begin, compare_paths(flown)
        measured, simulated = (
            compared[f"distance_{of}"].values for of in ("measured", "simulated")
        )
        error, turned = compared.path_error.values, compared.turned_simulated.values
        correlation = float(np.corrcoef(measured, simulated)[0, 1])
        rows.append(
            [
                name,
                *(float(f(x)) for x in (measured, simulated) for f in (np.mean, spread)),
                *(float(simulated.mean() / measured.mean()), correlation),
                *(int((simulated > measured).sum()), int(turned.sum())),
                *(float(error.mean()), float(np.median(error)), took),
            ]
        )
        if name.startswith("published polar, nodes"):
            report(options, data, flown, compared)
    header = ("model", "measured (m)", "its sd", "simulated (m)", "sd", "ratio", "correlation")
    header += ("farther", "did not shallow", "paths apart (m)", "median (m)", "seconds")
    write_table(options.out / "measured_flights", header, rows)


def report(options, data, flown, compared) -> None:
    """Table and figures of the published model."""
    print(summary(compared))
    rows = [
        [
            str(one.trial.item()),
            str(one.snake.item()),
            *(float(one[f"distance_{of}"]) for of in ("measured", "simulated")),
            float(one.path_error),
            str(Outcome(int(flown.outcome.sel(trial=one.trial)))),
            "no" if one.turned_simulated else "yes",
            1e3 * float(data.longest_gap.sel(trial=one.trial)),
        ]
        for one in (compared.sel(trial=trial) for trial in compared.trial)
    ]
    header = ("trial", "snake", "measured (m)", "simulated (m)", "paths apart (m)")
    header += ("simulation", "shallows", "longest gap (ms)")
    write_table(options.out / "every_flight", header, rows)
    save_figure(measured_gaits(data), options.out / "figure_2eh.png")
    save_figure(measured_and_simulated(flown), options.out / "figure_3.png")
    save_figure(every_flight(flown), options.out / "every_flight.png")
    save_figure(distances(flown).figure, options.out / "distances.png")


if __name__ == "__main__":
    main()
