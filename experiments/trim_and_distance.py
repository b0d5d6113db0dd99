"""Does trim predict the best bend? Eleven shapes of the line, from 10 m, smooth polar.

The bend at which the held glide has no mean pitch moment at its end, beside the bend of the
farthest free glide that lands, among bends half a degree apart.
"""

from typing import Any

import numpy as np
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure

from jaxglide import Gait, Glider, Outcome, Polar, Snake
from jaxglide.ensemble.published import NU_THETA, THETA_M
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.plot import style
from jaxglide.search.problem import SETUP
from jaxglide.tunnel.trim import trim

BENDS = np.arange(-20.0, 30.25, 0.5)  # deg
NEAR = 0.99  # of the farthest: the range of bends as good as the best
TOLERANCES: dict[str, Any] = {"rtol": 1e-6, "atol": 1e-6}


def trim_bend(nu_theta: float) -> tuple[float, int]:
    """The d_psi without mean pitch moment [deg], NaN where there is none; how many."""
    snake = Snake.from_svl(nodes=60, node_set="gauss")
    glider = Glider(snake, Gait.from_degrees(nu_theta=nu_theta), Polar.smooth())
    bounds = np.deg2rad(BENDS[[0, -1]])
    found = trim(glider, "d_psi", bounds, points=6, tolerance=1e-6, **TOLERANCES)
    return float(np.rad2deg(found.value)), int(found.crossings)


def main() -> None:
    options = arguments(__doc__)
    nu, bend = (column.ravel() for column in np.meshgrid(NU_THETA, BENDS, indexing="ij"))
    theta = np.repeat(THETA_M, BENDS.size)
    cases = {"nu_theta": nu, "theta_m": theta, "d_psi": bend}
    data = sweep(Study(cases=cases, setup=SETUP, **TOLERANCES))
    landed = data.outcome.values.reshape(11, -1) == Outcome.LANDED
    distance = data.landing_point.sel(axis="y").values.reshape(11, -1)
    distance = np.where(landed, distance, np.nan)
    rows = []
    for k, nu_theta in enumerate(NU_THETA):
        trimmed, crossings = trim_bend(float(nu_theta))
        at = int(np.nanargmax(distance[k]))
        most, flat = distance[k, at], distance[k, int(np.argmin(np.abs(BENDS)))]
        good = BENDS[distance[k] >= NEAR * most]
        there = float(np.interp(trimmed, BENDS, distance[k]))
        row = (float(nu_theta), float(THETA_M[k]), trimmed, crossings, float(BENDS[at]))
        row += float(good.min()), float(good.max()), float(BENDS[at] - trimmed)
        rows.append((*row, float(most), there, 100 * (there / most - 1), float(flat)))
    header = ("nu_theta", "theta_m (deg)", "trim d_psi (deg)", "changes of sign")
    header += ("farthest d_psi (deg)", "within 1 % from", "to", "farthest minus trim (deg)")
    header += ("farthest (m)", "at trim (m)", "loss at trim (%)", "unbent (m)")
    write_table(options.out / "trim_and_distance", header, rows)
    table = np.array(rows, float)
    both = np.isfinite(table[:, 2])
    for name, chosen in (("all", both), ("nu_theta from 1.25", both & (table[:, 0] > 1.24))):
        r = np.corrcoef(table[chosen, 2], table[chosen, 4])[0, 1]
        mean = table[chosen, 7].mean()
        print(f"{name}: farthest minus trim {mean:.1f} deg on average, correlation {r:.2f}")
    save_figure(draw(table, distance), options.out / "trim_and_distance.png")


@style()
def draw(table: np.ndarray, distance: np.ndarray) -> Figure:
    """Distance over wave number and bend, with the trim and the farthest of every shape."""
    figure = Figure(figsize=(90 / 25.4, 72 / 25.4), dpi=300, layout="constrained")
    ax = figure.add_subplot()
    ax.set_facecolor("0.85")
    grid = {"cmap": "viridis", "shading": "nearest", "rasterized": True}
    mesh = ax.pcolormesh(NU_THETA, BENDS, distance.T, **grid)
    bar = figure.colorbar(mesh, ax=ax, label="landing distance (m)")
    bar.outline.set_visible(False)  # type: ignore
    dot = {"ls": "", "ms": 3.8, "mec": "white", "mew": 0.5}
    ax.plot(table[:, 0], table[:, 2], color="#D55E00", lw=0.8, zorder=2)
    ax.plot(table[:, 0], table[:, 2], "o", color="#D55E00", label="trim", **dot)
    ax.plot(table[:, 0], table[:, 4], "s", color="#222222", label="farthest", **dot)
    ax.plot([], [], "s", color="0.85", label="does not land")
    ax.set_xlabel(r"waves $\nu_\theta$ (per SVL), along the line of shapes")
    ax.set_ylabel(r"bend $d_\psi$ (° per SVL)")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


if __name__ == "__main__":
    main()
