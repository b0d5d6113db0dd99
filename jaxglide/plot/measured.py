"""Pictures of measured flights: bending in space and time, modes, the paper's figure 2 e-h."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import linregress

from ..measured import MeasuredFlight
from ._labels import plain
from ._style import FAINT, INK, PAGE_WIDTH, PITCH, YAW, new_figure, style, zero_line

_WAVES = {
    "horizontal": (r"horizontal angle, $\theta$", "theta", YAW),
    "vertical": (r"vertical angle, $\psi$", "psi", PITCH),
}
_BODY = "arc length, $s$ (SVL)"
_SHOWN = 3  # modes
_MINUS = "\N{MINUS SIGN}"


def _map(ax: Axes, flight: MeasuredFlight, wave: str) -> None:
    """A bending angle over time and arc length."""
    label, name, _ = _WAVES[wave]
    bending = flight.bending
    angle = np.rad2deg(getattr(bending, name)).T
    most = float(np.abs(angle).max())
    colours = {"cmap": "RdBu_r", "vmin": -most, "vmax": most, "shading": "gouraud"}
    mesh = ax.pcolormesh(bending.times, bending.fraction, angle, rasterized=True, **colours)
    bar = ax.figure.colorbar(mesh, ax=ax, label=f"{label} (°)")
    bar.outline.set_visible(False)  # type: ignore[operator]
    ax.set_xlabel("time, $t$ (s)")
    ax.set_ylabel(_BODY)


def _first_mode(ax: Axes, flight: MeasuredFlight, wave: str) -> None:
    """Shape of the first mode along the body, at two phases a quarter turn apart."""
    _, _, colour = _WAVES[wave]
    modes = getattr(flight, wave)
    shape = modes.shapes[0]
    zero_line(ax)
    size = np.abs(shape)
    ax.fill_between(flight.bending.fraction, -size, size, color="0.93", lw=0, label="modulus")
    ax.plot(flight.bending.fraction, shape.real, color=colour, label="real")
    ax.plot(flight.bending.fraction, shape.imag, color=colour, ls=(0, (3, 1.5)), label="imag.")
    ax.set_xlabel(_BODY)
    ax.set_ylabel("first mode")
    ax.set_ylim(-1.25 * size.max(), 1.6 * size.max())
    look = {"handlelength": 1.1, "columnspacing": 0.8, "handletextpad": 0.4}
    ax.legend(loc="upper center", ncols=3, **look)


def _activity(ax: Axes, flight: MeasuredFlight, wave: str) -> None:
    """Turns of the first modes in time; the line behind is the frequency quoted."""
    _, _, colour = _WAVES[wave]
    modes, times = getattr(flight, wave), flight.bending.times
    for mode in reversed(range(_SHOWN)):
        turns = np.unwrap(np.angle(modes.activity[mode])) / (2 * np.pi)
        turns -= turns[0]
        shade = (colour, "0.55", "0.75")[mode]
        told = f"{mode + 1}: {modes.frequency[mode]:.2f} Hz, {modes.variance[mode]:.0%}"
        ax.plot(times, turns, color=shade, label=told.replace("-", _MINUS), zorder=3 - mode)
    ax.set_xlabel("time, $t$ (s)")
    ax.set_ylabel("turns of the mode")
    handles, labels = ax.get_legend_handles_labels()
    where = {"loc": "upper left", "handlelength": 1.2, "borderaxespad": 0.2}
    ax.legend(handles[::-1], labels[::-1], title="mode: frequency, variance", **where)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.45 * (high - low))


@style()
def measured_bending(flight: MeasuredFlight) -> Figure:
    """Bending of one flight: angles over time and body, and their modes.

    Args:
        flight: from `jaxglide.measured.measure`.

    Returns:
        The figure, a page wide: a row each for the horizontal and the vertical wave, with
        the angle in space and time, the first mode's shape along the body, and how the
        first three modes turn in time.
    """
    figure = new_figure(width=PAGE_WIDTH, height=100.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, 3, width_ratios=(1.5, 1, 1))
    for row, wave in zip(axes, _WAVES, strict=True):
        for ax, draw in zip(row, (_map, _first_mode, _activity), strict=True):
            draw(ax, flight, wave)
    figure.suptitle(
        f"trial {plain(flight.trial)}, snake {plain(flight.snake)}: "
        rf"$\nu_\theta$ {flight.nu_theta:.2f}, $f_\theta$ {flight.f_theta:.2f} Hz, "
        rf"$\theta_m$ {np.rad2deg(flight.theta_m):.0f}°, "
        rf"$\psi_m$ {np.rad2deg(flight.psi_m):.0f}°, "
        rf"$d_\psi$ {np.rad2deg(flight.d_psi):.0f}°",
        fontsize=7.5,
    )
    return figure


def regression(data: xr.Dataset, x: str, y: str) -> Any:
    """Straight line of `y` against `x` through the snakes' averages, as the paper draws.

    Args:
        data: from `jaxglide.measured.flights_dataset`, of three snakes or more.
        x, y: names of variables over trial.

    Returns:
        SciPy's result: slope, intercept, rvalue, pvalue, ....
    """
    means = data[[x, y]].groupby(data.snake).mean()
    return linregress(means[x], means[y])


def _snakes(data: xr.Dataset) -> dict[str, tuple]:
    """Colour of each snake, heaviest first in the scale, and the area of its marker."""
    mass = data.mass.groupby(data.snake).mean()
    order = mass.snake.values[np.argsort(mass.values)]
    shades = colormaps["viridis"](np.linspace(0.0, 0.92, len(order)))
    return {
        str(snake): (shade, 500 * float(mass.sel(snake=snake)))
        for snake, shade in zip(order, shades, strict=True)
    }


def _scatter(ax: Axes, data: xr.Dataset, x, y, snakes: Mapping[str, tuple]) -> None:
    """Glides as open markers, each snake's average solid with its standard deviation."""
    for snake, (colour, area) in snakes.items():
        own = (data.snake == snake).values
        a, b = x.values[own], y.values[own]
        ax.scatter(a, b, s=7, facecolors="none", edgecolors=[colour], linewidths=0.6, alpha=0.8)
        spread = {"xerr": a.std(), "yerr": b.std(), "ecolor": colour, "elinewidth": 0.7}
        ax.errorbar(a.mean(), b.mean(), fmt="none", zorder=3, **spread)
        look = {"color": [colour], "edgecolors": "white", "linewidths": 0.4, "zorder": 4}
        ax.scatter(a.mean(), b.mean(), s=area, label=plain(snake), **look)


def _against_nu(ax: Axes, data: xr.Dataset, name: str, label: str, snakes) -> None:
    """A gait parameter against the wave number, with the regression line."""
    _scatter(ax, data, data.nu_theta, data[name], snakes)
    ax.set_xlabel(r"spatial periods, $\nu_\theta$")
    ax.set_ylabel(label)
    if len(snakes) < 3:
        return
    line = regression(data, "nu_theta", name)
    ends = np.array([data.nu_theta.min(), data.nu_theta.max()])
    ax.plot(ends, line.slope * ends + line.intercept, color=FAINT, zorder=1)
    told = rf"{line.slope:.1f}°$\,\nu_\theta$ {line.intercept:+.0f}°, p = {line.pvalue:.1g}"
    ax.set_title(told.replace("-", _MINUS), color="0.35", loc="right")


@style()
def measured_gaits(data: xr.Dataset) -> Figure:
    """Gaits of all flights (the paper's figure 2 e-h).

    Args:
        data: from `jaxglide.measured.flights_dataset`.

    Returns:
        The figure, a page wide: ratios of the waves' frequencies and wave numbers; theta_m,
        psi_m and d_psi against nu_theta. Open markers are glides, solid ones the snakes'
        averages, as large as their mass; bars are one standard deviation. Grey lines are
        regressions through the snakes' averages.
    """
    snakes = _snakes(data)
    figure = new_figure(width=PAGE_WIDTH, height=118.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, 2)
    ratios = axes[0, 0]
    for draw in (ratios.axhline, ratios.axvline):
        draw(2, color="0.8", lw=0.6, zorder=0)
    across, up = data.nu_psi / data.nu_theta, data.f_psi / data.f_theta
    _scatter(ratios, data, across, up, snakes)
    ratios.plot(across.mean(), up.mean(), "+", color=INK, ms=8, mew=1.2, zorder=5)
    ratios.set_xlabel(r"wave numbers, $\nu_\psi / \nu_\theta$")
    ratios.set_ylabel(r"frequencies, $f_\psi / f_\theta$")
    _against_nu(axes[0, 1], data, "theta_m", r"horizontal amplitude, $\theta_m$ (°)", snakes)
    _against_nu(axes[1, 0], data, "psi_m", r"vertical amplitude, $\psi_m$ (°)", snakes)
    _against_nu(axes[1, 1], data, "d_psi", r"dorsoventral bending, $d_\psi$ (°)", snakes)
    zero_line(axes[1, 1])
    for ax, letter in zip(axes.flat, "efgh", strict=True):
        ax.set_title(letter, loc="left", fontweight="bold")
    handles, _ = ratios.get_legend_handles_labels()
    masses = data.mass.groupby(data.snake).mean()
    told = [f"{plain(name)} ({1000 * float(masses.sel(snake=name)):.0f} g)" for name in snakes]
    figure.legend(handles, told, loc="outside right upper", title="snake", labelspacing=0.9)
    return figure
