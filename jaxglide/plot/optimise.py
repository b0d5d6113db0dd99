"""Pictures of optimisations: how the search went, and what it found.

They take the history of an `Optimum`: a dataset over step, start and parameter.
"""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..ensemble.base import published_case
from ..flight.ends import Outcome
from ..search.ascent import FEASIBLE
from ._labels import SYMBOLS, parameter_label, plain, shown, with_unit
from ._style import FAINT, HEAD, INK, PITCH, YAW, new_figure, style
from .shapes import _MAP, _MARK, _check, _edges, _sorted

_PAGE = 180.0  # width of two columns [mm]
_BEST = {"ls": "", "marker": "*", "ms": 9.0, "mfc": HEAD, "mec": "white", "mew": 0.7}
_NOT_LANDED = {"label": "tumbles", "marker": "o", **_MARK}


class _Climb(NamedTuple):
    """How a search went, step by step.

    Attributes:
        best: best feasible value so far, NaN before the first, (step, start).
        gradients, glides: computed so far, and glides flown without them, (step,).
        sampled: steps that were rounds of sampling, (step,).
    """

    best: np.ndarray
    gradients: np.ndarray
    glides: np.ndarray
    sampled: np.ndarray


def _climb(history: xr.Dataset) -> _Climb:
    needed = ("value", "violation", "point", "best_point", "best_value", "best_violation")
    for name in needed:
        if name not in history.variables:
            raise ValueError(f"the history has no {name}: give the history of an Optimum")
    if not history.sizes["step"]:
        raise ValueError("the history has no steps: there is nothing to draw")
    value = history["value"].transpose("step", "start").values
    violation = history["violation"].transpose("step", "start").values
    met = np.where(violation <= FEASIBLE, value, np.nan)
    if "gradients" in history:
        gradients, glides = history["gradients"].values, history["glides"].values
    else:  # kept before sampling was part of it
        tried = np.isfinite(history["point"].transpose("step", "start", ...).values)
        gradients = tried.all(axis=2).sum(axis=1)
        glides = np.zeros_like(gradients)
    best = np.fmax.accumulate(met, axis=0)
    return _Climb(best, np.cumsum(gradients), np.cumsum(glides), glides > 0)


@style()
def convergence(history: xr.Dataset, *, glides_per_gradient: float | None = None) -> Figure:
    """Best feasible value so far of every start, against step and against cost.

    Args:
        history: of an `Optimum`.
        glides_per_gradient: what a gradient costs in glides, to count the cost in glides;
            by default it is counted in gradients.

    Returns:
        A figure of a page's width (180 mm). Left: the starts (thin), their quartiles (band),
        median and best, against step; rounds of sampling at the end are shaded. Right: the
        best against cost, and how many of the starts are within the constraints.

    Raises:
        ValueError: the dataset is not a history, or has no steps.
    """
    climb = _climb(history)
    best, found = climb.best, np.isfinite(climb.best)
    steps = np.arange(1, len(best) + 1)
    cost = climb.gradients
    if glides_per_gradient is not None:
        cost = glides_per_gradient * climb.gradients + climb.glides
    figure = new_figure(width=_PAGE, height=62.0)
    figure.set_layout_engine("constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    lines = [
        np.column_stack([steps[ok], line[ok]]) for line, ok in zip(best.T, found.T, strict=True)
    ]
    thin = {"colors": FAINT, "linewidths": 0.4, "alpha": 0.7, "zorder": 1}
    left.add_collection(LineCollection(lines, label="one start", **thin))
    some = found.any(axis=1)
    if some.any():
        quartile, median, upper = np.nanpercentile(best[some], (25, 50, 75), axis=1)
        leader = np.nanmax(best[some], axis=1)
        band = {"color": YAW, "alpha": 0.18, "lw": 0, "zorder": 2}
        left.fill_between(steps[some], quartile, upper, label="middle half of starts", **band)
        left.plot(steps[some], median, color=YAW, label="median start", zorder=3)
        left.plot(steps[some], leader, color=PITCH, lw=1.4, label="best start", zorder=4)
        right.plot(cost[some], leader, color=PITCH, lw=1.4, label="best", zorder=3)
        _name_end(right, cost[some][-1], leader[-1], history["value"].attrs)
        left.set_ylim(*_most(best[some]))
    left.set_xlim(1, max(len(best), 2))
    left.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    left.set_xlabel("step")
    if climb.sampled.any():
        first = max(int(steps[climb.sampled][0]) - 0.5, 1.0)
        shade = {"color": FAINT, "alpha": 0.15, "lw": 0, "zorder": 0}
        left.axvspan(first, len(best), label="sampling", **shade)
        left.set_xlabel("step, then round of sampling around the best")
    left.set_ylabel(_quantity(history["value"].attrs))
    _count(right, cost, found)
    right.set_xlabel("gradients" if glides_per_gradient is None else "cost (glides)")
    right.set_ylabel("best " + _quantity(history["value"].attrs))
    keys = [*left.collections, *left.patches, *left.lines, *figure.axes[2].lines]
    figure.legend(handles=keys, loc="outside lower center", ncols=6, columnspacing=1.2)
    return figure


def _quantity(about: dict) -> str:
    name = plain(str(about.get("long_name", "value")).replace("_", " "))
    return with_unit(name, str(about.get("units", "")))


def _most(values: np.ndarray) -> tuple[float, float]:
    """Limits that show the upper nine tenths of the final values, and the climb to them."""
    low, high = float(np.nanpercentile(values, 10)), float(np.nanmax(values))
    pad = 0.06 * max(high - low, 1e-6 * abs(high), 1e-12)
    return low - pad, high + pad


def _name_end(ax: Axes, x: float, y: float, about: dict) -> None:
    unit = shown(about.get("units", "")).removesuffix("1")
    text = f"{y:.4g} {plain(unit)}".strip()
    ax.annotate(text, (x, y), (-2, 3), textcoords="offset points", ha="right", fontsize=6.5)


def _count(ax: Axes, cost: np.ndarray, found: np.ndarray) -> None:
    """Share of the starts that have met the constraints, on an axis of its own."""
    other = ax.twinx()
    other.spines["right"].set_visible(True)
    share = {"color": FAINT, "lw": 0.9, "ls": (0, (4, 2)), "label": "met the constraints"}
    other.plot(cost, 100.0 * found.mean(axis=1), **share)
    other.set_ylim(0, 118)
    other.set_yticks([0, 25, 50, 75, 100])
    other.set_ylabel("starts that met the constraints (%)", color="0.4")
    ax.set_zorder(other.get_zorder() + 1)
    ax.patch.set_visible(False)


def _pair(names: list[str], wanted: tuple[str, str] | None) -> tuple[str, str]:
    if wanted is None:
        usual = "nu_theta", "theta_m"
        wanted = usual if set(usual) <= set(names) else (names[0], names[-1])
    for name in wanted:
        if name not in names:
            raise ValueError(f"{name!r} is none of the free parameters, {', '.join(names)}")
    return wanted


@style()
def paths(
    history: xr.Dataset,
    data: xr.Dataset | None = None,
    *,
    parameters: tuple[str, str] | None = None,
) -> Figure:
    """Paths of the starts over two of the free parameters.

    Args:
        history: of an `Optimum`.
        data: a sweep over the same two parameters (others of one value), whose landing
            distance is drawn below the paths, grey where it does not land.
        parameters: which, across and up; by default nu_theta and theta_m where both are
            free, else the first and the last.

    Returns:
        A figure of one column's width (90 mm): from every start (ring) to its best point
        (disc, coloured by its value as the map is), faint where it did not meet the
        constraints; a star at the best of all.

    Raises:
        ValueError: the dataset is not a history, a parameter is not free, or the sweep is
            over others.
    """
    _climb(history)
    names = [str(name) for name in history["parameter"].values]
    across, up = _pair(names, parameters)
    at = [names.index(across), names.index(up)]
    points = history["point"].transpose("step", "start", "parameter").values[..., at]
    ends = history["best_point"].transpose("start", "parameter").values[:, at]
    met = history["best_violation"].values <= FEASIBLE
    values = history["best_value"].values
    figure = new_figure(height=84.0)
    figure.set_layout_engine("constrained")
    ax = figure.add_subplot()
    mesh = None if data is None else _ground(ax, data, across, up)
    for ok, alpha in ((True, 0.9), (False, 0.3)):
        chosen = np.flatnonzero(met == ok)
        lines = [p[np.isfinite(p).all(axis=1)] for p in points[:, chosen].transpose(1, 0, 2)]
        drawn = {"colors": INK, "linewidths": 0.45, "alpha": alpha, "zorder": 3}
        kind = "within the constraints" if ok else "outside"
        ax.add_collection(LineCollection(lines, label=f"path, {kind}", **drawn))
    first = points[0]
    ring = {"marker": "o", "ms": 2.4, "mfc": "white", "mec": INK, "mew": 0.5, "zorder": 4}
    ax.plot(*first.T, ls="", label="start", **ring)
    if met.any():
        leader = int(np.argmax(np.where(met, values, -np.inf)))
        norm = mesh.norm if mesh else Normalize(*np.percentile(values[met], (5, 100)))
        disc = {"s": 16, "cmap": "viridis", "edgecolors": "white", "linewidths": 0.6}
        colour = {"c": values[met], "norm": norm, "zorder": 5}
        dots = ax.scatter(*ends[met].T, label="end", **colour, **disc)
        ax.plot(*ends[leader], label="best", zorder=6, **_BEST)
        mesh = dots if mesh is None else mesh
    if mesh is not None:
        label = _quantity(history["value"].attrs)
        above = {"location": "top", "aspect": 40, "extend": "both"}
        bar = figure.colorbar(mesh, ax=ax, label=label, **above)
        bar.outline.set_visible(False)  # type: ignore
    for axis, name in ((ax.xaxis, across), (ax.yaxis, up)):
        low, high = (float(history[end].sel(parameter=name)) for end in ("low", "high"))
        pad = 0.02 * (high - low)
        (ax.set_xlim if axis is ax.xaxis else ax.set_ylim)(low - pad, high + pad)
    for name, label in ((across, ax.set_xlabel), (up, ax.set_ylabel)):
        unit = history["unit"].sel(parameter=name).item() if "unit" in history.coords else ""
        label(parameter_label(name, str(unit)))
    keys = [line for line in ax.lines if line.get_label() in ("start", "best")]
    disc = {"ls": "", "marker": "o", "ms": 4.0, "mfc": "0.5", "mec": "white"}
    keys.insert(1, Line2D([], [], label="best of its start", **disc))
    if data is not None:
        keys.append(Line2D([], [], ls="", marker="s", ms=4.5, color="0.85", label="tumbles"))
    below = {"loc": "outside lower center", "ncols": 4}
    figure.legend(handles=keys, handletextpad=0.2, columnspacing=1.0, **below)
    return figure


def _ground(ax: Axes, data: xr.Dataset, across: str, up: str) -> QuadMesh:
    """Heat map of the landing distance of a sweep; grey where it did not land."""
    if "landing_point" not in data or not {across, up} <= set(data["landing_point"].dims):
        raise ValueError(f"the sweep is not over {across} and {up}, with landing_point")
    one = data[["landing_point", "outcome"]].squeeze(drop=True)
    distance = one["landing_point"].sel(axis="y").transpose(up, across)
    landed = (one["outcome"] == Outcome.LANDED).transpose(up, across).values
    x, y = distance[across].values, distance[up].values
    shown = np.where(landed, distance.values, np.nan)
    ax.set_facecolor("0.85")
    return ax.pcolormesh(_edges(x), _edges(y), shown, zorder=1, **_MAP)


@style()
def sensitivity_map(data: xr.Dataset) -> Figure:
    """Gradient of the landing distance over the shape space.

    Args:
        data: with dimensions theta_m [deg] and nu_theta, `distance` [m], `outcome`, and
            `gradient` over `parameter` too, in m per unit of the parameter: theta_m,
            nu_theta, and others that get a map of their own.

    Returns:
        A figure: the distance, with arrows along the steepest ascent (in ranges of the two
        axes, the longer the steeper), beside maps of the derivatives with respect to
        the other parameters. Dots mark shapes that tumble.

    Raises:
        ValueError: a variable or coordinate is missing, or has other dimensions.
    """
    shape = ("theta_m", "nu_theta")
    needed: dict[str, Any] = dict.fromkeys(("distance", "outcome"), shape)
    needed |= {"gradient": (*shape, "parameter"), **{name: (name,) for name in shape}}
    _check(data, needed)
    data = _sorted(data)
    names = [str(name) for name in data["parameter"].values]
    others = [name for name in names if name not in shape]
    tumbles = data["outcome"].values != Outcome.LANDED
    width = 72.0 * (1 + len(others)) + 8
    figure = new_figure(width=min(_PAGE, width), height=72.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, 1 + len(others), sharey=True, squeeze=False)[0]
    x, y = data["nu_theta"].values, data["theta_m"].values
    mesh = axes[0].pcolormesh(_edges(x), _edges(y), data["distance"].values, **_MAP)
    bar = figure.colorbar(mesh, ax=axes[0], label="landing distance (m)", location="top")
    bar.outline.set_visible(False)  # type: ignore
    _arrows(axes[0], data, tumbles)
    for ax, name in zip(axes[1:], others, strict=True):
        slope = data["gradient"].sel(parameter=name).transpose(*shape).values
        most = float(np.percentile(np.abs(slope[~tumbles]), 98)) if (~tumbles).any() else 1.0
        norm = TwoSlopeNorm(0.0, -max(most, 1e-12), max(most, 1e-12))
        look = {**_MAP, "cmap": "RdBu_r", "norm": norm}
        mesh = ax.pcolormesh(_edges(x), _edges(y), slope, **look)
        unit = published_case().parameter(name).unit
        unit = {"deg/SVL": "°"}.get(unit, unit)
        label = f"slope with {SYMBOLS.get(name, name)} (m per {unit or 'unit'})"
        bar = figure.colorbar(mesh, ax=ax, label=label, location="top", extend="both")
        bar.outline.set_visible(False)  # type: ignore
    for ax in axes:
        ax.spines[:].set_visible(True)
        ax.set_xlabel(r"waves $\nu_\theta$ (per SVL)")
        rows, columns = np.nonzero(tumbles)
        if rows.size:
            ax.plot(x[columns], y[rows], zorder=4, **_NOT_LANDED)
    axes[0].set_ylabel(r"amplitude $\theta_m$ (°)")
    if tumbles.any():
        keys = [line for line in axes[0].lines if line.get_label() == "tumbles"]
        figure.legend(handles=keys, loc="outside lower center", handletextpad=0.2)
    return figure


def _arrows(ax: Axes, data: xr.Dataset, tumbles: np.ndarray) -> None:
    """Steepest ascent, in the ranges of the axes; none where it tumbles."""
    slopes = []
    for name in ("nu_theta", "theta_m"):
        reach = float(np.ptp(data[name].values)) or 1.0
        slope = data["gradient"].sel(parameter=name).transpose("theta_m", "nu_theta").values
        slopes.append(reach * slope)
    size = np.hypot(*slopes)
    kept = ~tumbles & np.isfinite(size) & (size > 0)
    if not kept.any():
        return
    # Half a cell where it is least steep, more than one where it is steepest.
    length = np.clip((size / np.percentile(size[kept], 90)) ** (1 / 3), 0.4, 1.2)
    x, y = np.meshgrid(data["nu_theta"].values, data["theta_m"].values)
    arrows = [(length * slope / np.where(kept, size, 1.0))[kept] for slope in slopes]
    look = {"color": INK, "edgecolor": "white", "linewidth": 0.35, "width": 0.009, "zorder": 3}
    head = {"headwidth": 3.4, "headlength": 3.4, "headaxislength": 3.0, "pivot": "middle"}
    scale = {"scale": float(data.sizes["nu_theta"]), "scale_units": "width"}
    ax.quiver(x[kept], y[kept], *arrows, label="ascent", **look, **head, **scale)
