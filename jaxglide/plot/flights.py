"""Measured flights beside their simulations (the paper's figure 3)."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..flights.agreement import compare_paths
from ._labels import axis_label, plain
from ._style import BODY, FAINT, HEAD, INK, PAGE_WIDTH, new_axes, new_figure, place, style

_MEASURED, _SIMULATED = INK, BODY
# Margins and the gaps between the views of figure 3, and its views' greatest height [mm].
_LEFT, _BETWEEN, _RIGHT, _BELOW, _GAP, _ABOVE, _TALLEST = 13.0, 8.0, 3.0, 17.0, 6.0, 7.0, 140.0


def _path(flown: xr.Dataset, row: int, name: str) -> np.ndarray:
    """Path of a flight to its end, started over the origin, (T, 3)."""
    path = flown[name].values[row]
    path = path[np.isfinite(path).all(axis=1)]
    if name == "path":
        path = np.vstack([path, flown["end"].values[row]])
    return path - [*path[0, :2], 0.0]


def _draw_all(ax: Axes, flown: xr.Dataset, name: str, up: str, turned: np.ndarray) -> None:
    """All flights seen from the side (up "z") or from above (up "x")."""
    k = "xyz".index(up)
    for row, back in enumerate(turned):
        path = _path(flown, row, name)
        colour = HEAD if back else _MEASURED if name == "position" else _SIMULATED
        ax.plot(path[:, 1], path[:, k], color=colour, lw=0.7, zorder=3 if back else 2)
        ax.plot(*path[-1, [1, k]], ".", color=colour, ms=2.5, zorder=4)
    ax.set_aspect("equal")
    ax.set_xlabel(axis_label("y"))
    ax.set_ylabel(axis_label(up))


def _lay_out(figure: Figure, axes: np.ndarray) -> None:
    """All views at one scale, those from above exactly below those from the side."""
    width = (PAGE_WIDTH - _LEFT - _BETWEEN - _RIGHT) / 2
    low, high = axes[0, 0].get_xlim()
    tall = [abs(float(np.ptp(ax.get_ylim()))) for ax in axes[:, 0]]  # metres
    scale = min(width / (high - low), _TALLEST / sum(tall))  # mm/m
    spare = (width / scale - (high - low)) / 2
    axes[0, 0].set_xlim(low - spare, high + spare)
    height = _BELOW + scale * sum(tall) + _GAP + _ABOVE
    figure.set_size_inches(PAGE_WIDTH / 25.4, height / 25.4)
    bottoms = (_BELOW + scale * tall[1] + _GAP, _BELOW)
    for row, (bottom, metres) in enumerate(zip(bottoms, tall, strict=True)):
        for column, ax in enumerate(axes[row]):
            left = _LEFT + column * (width + _BETWEEN)
            place(figure, ax, left, bottom, width, scale * metres)
    figure.align_ylabels(axes)


@style()
def measured_and_simulated(flown: xr.Dataset) -> Figure:
    """All flights, measured and simulated, from the side and from above (figure 3).

    Args:
        flown: from `jaxglide.flights.flights.fly_flights`.

    Returns:
        The figure, a page wide. All start over the origin; those that end behind their
        farthest forward point, which did not shallow, are orange.
    """
    compared = compare_paths(flown)
    figure = new_figure(width=PAGE_WIDTH)
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, (name, told) in enumerate((("position", "measured"), ("path", "simulated"))):
        turned = compared[f"turned_{told}"].values
        for row, up in enumerate("zx"):
            _draw_all(axes[row, column], flown, name, up, turned)
        mean = float(compared[f"distance_{told}"].mean())
        axes[0, column].set_title(f"{told}: {mean:.2f} m on average")
    axes[1, 0].invert_yaxis()  # seen from above, right is to the right of forward
    for ax in axes[:, 1]:
        ax.set_ylabel("")
    for ax in axes[0]:
        ax.set_xlabel("")
    shown = {"measured": _MEASURED, "simulated": _SIMULATED, "did not shallow": HEAD}
    handles = [Line2D([], [], color=colour, label=name) for name, colour in shown.items()]
    figure.legend(handles=handles, loc="lower center", ncols=3)
    # one scale for both views: no path is lost, and slopes can be compared
    _lay_out(figure, axes)
    return figure


@style()
def distances(flown: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Simulated against measured distance of each flight, to their common end height.

    Args:
        flown: from `jaxglide.flights.flights.fly_flights`.
        ax: where to draw; by default on a figure of its own.
    """
    compared = compare_paths(flown)
    ax = new_axes() if ax is None else ax
    measured, simulated = (
        compared[f"distance_{name}"].values for name in ("measured", "simulated")
    )
    turned = compared["turned_simulated"].values
    most = 1.08 * max(measured.max(), simulated.max())
    ax.plot([0, most], [0, most], color=FAINT, lw=0.7, zorder=0)
    look = {"ls": "", "marker": "o", "ms": 3.2, "mew": 0.4, "mec": "white"}
    for chosen, colour, label in (
        (~turned, _SIMULATED, "shallows"),
        (turned, HEAD, "simulation does not shallow"),
    ):
        ax.plot(measured[chosen], simulated[chosen], color=colour, label=label, **look)
    ax.set_xlim(0, most)
    ax.set_ylim(0, most)
    ax.set_aspect("equal")
    ax.set_xlabel("horizontal distance measured (m)")
    ax.set_ylabel("simulated (m)")
    ax.legend(loc="upper left")
    return ax


@style()
def every_flight(flown: xr.Dataset) -> Figure:
    """Each flight from the side, measured and simulated, a small panel each.

    Args:
        flown: from `jaxglide.flights.flights.fly_flights`.
    """
    count = flown.sizes["trial"]
    columns = min(6, count)
    rows = -(-count // columns)
    figure = new_figure(width=PAGE_WIDTH, height=14.0 + 30.0 * rows)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for row, ax in enumerate(axes.flat):
        if row >= count:
            ax.set_visible(False)
            continue
        for name, colour in (("position", _MEASURED), ("path", _SIMULATED)):
            path = _path(flown, row, name)
            ax.plot(path[:, 1], path[:, 2], color=colour, lw=0.9)
        trial, snake = (plain(flown[name].values[row]) for name in ("trial", "snake"))
        ax.set_title(f"{trial} (snake {snake})", fontsize=6.0, pad=2.0)
    for ax in axes[-1]:
        ax.set_xlabel(axis_label("y"))
    for ax in axes[:, 0]:
        ax.set_ylabel(axis_label("z"))
    shown = {"measured": _MEASURED, "simulated": _SIMULATED}
    handles = [Line2D([], [], color=colour, label=name) for name, colour in shown.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure
