"""Any variable of a dataset over one or two of its dimensions, or over its cases."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap

from ..flight.ends import Outcome
from ._labels import label_of, part_of, plain
from ._style import INK, YAW, new_axes, style, zero_line
from .shapes import _MARK, _UNSTABLE, _edges

# Okabe and Ito's, for what has names and no order.
_KINDS = ("#0072B2", "#E69F00", "#D55E00", "#CC79A7", "#F0E442", "#56B4E9", "#222222")
_SIGNED = 0.2  # least share of the smaller side for a map of colours with a middle
_FEW = 5  # steps of an axis that are all numbered
_LOST = Outcome.OUT_OF_TIME, Outcome.OUT_OF_STEPS, Outcome.NON_FINITE
_TUMBLES, _NOT_FINISHED, _NOT_COMPUTED = _MARKS = "tumbles", "not finished", "not computed"


def colours_of(values: np.ndarray) -> dict[str, Any]:
    """Colour map and its limits: diverging, white at zero, for values of both signs."""
    finite = values[np.isfinite(values)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
    if min(-low, high) > _SIGNED * max(-low, high):
        most = max(-low, high)
        return {"cmap": "RdBu_r", "vmin": -most, "vmax": most}
    return {"cmap": "viridis", "vmin": low, "vmax": high}


def numeric(data: xr.Dataset) -> list[str]:
    """Names of the variables that can be drawn."""
    return [
        str(name) for name, v in data.data_vars.items() if v.ndim and v.dtype.kind in "fiub"
    ]


def varied(values: xr.DataArray) -> list[str]:
    """Dimensions with more than one entry, all numbers."""
    names = [str(name) for name in values.dims if values.sizes[name] > 1]
    return [name for name in names if _steps(values, name).dtype.kind in "fiu"]


def _steps(values: xr.DataArray, name: str) -> np.ndarray:
    """The numbers along a dimension: its coordinate, or 0, 1, 2 ... where it has none."""
    return values[name].values if name in values.coords else np.arange(values.sizes[name])


def variable_of(data: xr.Dataset, name: str) -> xr.DataArray:
    """A variable of numbers; `ValueError` names those there are."""
    if name not in numeric(data):
        raise ValueError(f"there is no variable {name!r} to draw: {', '.join(numeric(data))}")
    return data[name]


def selected(values: xr.DataArray, at: Mapping[str, Any]) -> xr.DataArray:
    """The part of `values` at given coordinates.

    Raises:
        ValueError: it is not over that dimension, or has no such coordinate.
    """
    for name, wanted in at.items():
        if name not in values.dims:
            over = ", ".join(map(str, values.dims)) or "nothing more"
            raise ValueError(f"{values.name} is not over {name!r}: it is over {over}")
        steps = _steps(values, name)
        if steps.dtype.kind in "fiu" and isinstance(wanted, int | float):
            near = int(np.argmin(np.abs(steps - wanted)))
            slack = 1e-6 * max(float(np.ptp(steps)), abs(float(steps[near])), 1e-9)
            found = abs(float(steps[near]) - wanted) <= slack
        else:
            hits = np.flatnonzero(steps.astype(str) == str(wanted))
            found, near = bool(hits.size), int(hits[0]) if hits.size else 0
        if not found:
            said = f"{wanted:g}" if isinstance(wanted, float) else wanted
            raise ValueError(f"{name} = {said} is not there: {_listed(steps)}")
        values = values.isel({name: near})
    return values


def _listed(steps: np.ndarray) -> str:
    words = [f"{s:.6g}" if steps.dtype.kind in "fiu" else str(s) for s in steps]
    return ", ".join(words if len(words) < 13 else [*words[:6], "...", *words[-3:]])


def _left(values: xr.DataArray, keep: tuple[str, ...]) -> xr.DataArray:
    """Over `keep` alone, dimensions of one entry dropped; the others are refused."""
    for name in keep:
        if name not in values.dims:
            over = ", ".join(map(str, values.dims))
            raise ValueError(f"{values.name} is not over {name!r}: it is over {over}")
        if _steps(values, name).dtype.kind not in "fiu":
            raise ValueError(f"{name} are names, not numbers: choose one of them instead")
    rest = [str(name) for name in values.dims if name not in keep]
    values = values.isel({name: 0 for name in rest if values.sizes[name] == 1})
    for name in (name for name in rest if name in values.dims):
        steps = _listed(_steps(values, name))
        raise ValueError(f"{values.name} is also over {name}: choose one of {steps}")
    return values.transpose(*keep)


def _ends(data: xr.Dataset, values: xr.DataArray, at, keep) -> dict[str, np.ndarray]:
    """Where glides tumble, are not finished or not computed, by name, like `values`."""
    if "outcome" not in data or not set(keep) <= set(data["outcome"].dims):
        return {}
    here = {n: v for n, v in at.items() if n in data["outcome"].dims}
    outcome = _left(selected(data["outcome"], here), keep).values
    tumbles = np.isin(outcome, _UNSTABLE)
    missing = outcome < 0
    other = np.isin(outcome, _LOST)  # any other end is one that was asked for
    return {_TUMBLES: tumbles, _NOT_FINISHED: other, _NOT_COMPUTED: missing}


@style()
def heatmap(
    data: xr.Dataset,
    variable: str,
    x: str,
    y: str,
    ax: Axes | None = None,
    *,
    at: Mapping[str, Any] | None = None,
) -> Axes:
    """A variable over any two dimensions of a dataset, such as two swept parameters.

    Args:
        data: results over a grid (`sweep.sweep`, `survey.survey`, ...); units come from
            the variables' attributes.
        variable: what the colours show.
        x, y: dimensions across and up.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        at: coordinates, by name, of the other dimensions; those of one entry need none.

    Returns:
        The axes with a colour bar beside them, diverging where the values have both signs.
        A ring marks a glide that tumbles, a cross one that was not finished; what was not
        computed is grey.

    Raises:
        ValueError: no such variable, dimension or coordinate, or a dimension is left over.
    """
    at = {} if at is None else at
    if x == y:
        raise ValueError(f"x and y are both {x!r}")
    values = _left(selected(variable_of(data, variable), at), (y, x))
    ends = _ends(data, values, at, (y, x))
    across, up = _steps(values, x).astype(float), _steps(values, y).astype(float)
    order = np.ix_(np.argsort(up), np.argsort(across))
    across, up = np.sort(across), np.sort(up)
    shown = values.values.astype(float)
    if ends:
        shown = np.where(ends[_NOT_COMPUTED], np.nan, shown)
    ax = new_axes(height=72.0) if ax is None else ax
    ax.set_facecolor("0.8")
    ax.spines[:].set_visible(True)
    look, ticks = _look(values, shown)
    edges = _edges(across), _edges(up)
    mesh = ax.pcolormesh(*edges, shown[order], edgecolors="face", linewidth=0.2, **look)
    bar = ax.figure.colorbar(mesh, ax=ax, label=part_of(values, dict(at)), **ticks)
    bar.outline.set_visible(False)  # type: ignore
    if ticks:
        bar.ax.set_yticks(ticks["ticks"], _meanings(values), fontsize=6.5)
    if not ticks:  # where the colours do not say it
        _mark(ax, {name: mask[order] for name, mask in ends.items()}, across, up)
    for axis, steps in ((ax.xaxis, across), (ax.yaxis, up)):
        if steps.size <= _FEW:
            axis.set_ticks(steps)
    ax.set_xlabel(_axis(values, x))
    ax.set_ylabel(_axis(values, y))
    return ax


def _axis(values: xr.DataArray, name: str) -> str:
    return label_of(values[name]) if name in values.coords else plain(name)


def _meanings(values: xr.DataArray) -> list[str]:
    words = str(values.attrs["flag_meanings"]).split()
    return [plain(word.replace("_", " ")) for word in words]


def _look(values: xr.DataArray, shown: np.ndarray) -> tuple[dict, dict]:
    """Colours of a mesh, and ticks of its bar where the values are names."""
    if "flag_meanings" not in values.attrs:
        return colours_of(shown), {}
    count = len(_meanings(values))
    norm = BoundaryNorm(np.arange(count + 1) - 0.5, count)
    return {"cmap": ListedColormap(_KINDS[:count]), "norm": norm}, {"ticks": range(count)}


def _mark(ax: Axes, ends: Mapping[str, np.ndarray], across, up) -> None:
    """Rings and crosses, and what they mean."""
    size = float(np.clip(40.0 / max(across.size, up.size), 0.8, 2.0))
    for (name, mask), marker in zip(ends.items(), "ox", strict=False):
        if mask.any():
            rows, columns = np.nonzero(mask)
            look = {**_MARK, "ms": size, "marker": marker, "zorder": 4}
            ax.plot(across[columns], up[rows], label=name, **look)
    if ends and ends[_NOT_COMPUTED].any():
        ax.plot([], [], ls="", marker="s", ms=4.5, color="0.8", label=_NOT_COMPUTED)
    _legend_above(ax)


def _legend_above(ax: Axes) -> None:
    """What the marks mean, above the upper right corner, where there are any."""
    marks = [line for line in ax.lines if line.get_label() in _MARKS]
    if marks:
        where = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        ax.legend(handles=marks, ncols=3, handletextpad=0.2, columnspacing=1.0, **where)


@style()
def curve(
    data: xr.Dataset,
    variable: str,
    x: str,
    ax: Axes | None = None,
    *,
    at: Mapping[str, Any] | None = None,
) -> Axes:
    """A variable over one dimension of a dataset, such as a single swept parameter.

    Args:
        data, variable, ax, at: as in `heatmap`.
        x: the dimension across.

    Returns:
        The axes: one line, rings where a glide tumbles, crosses where it is not finished.

    Raises:
        ValueError: as `heatmap`.
    """
    at = {} if at is None else at
    values = _left(selected(variable_of(data, variable), at), (x,))
    ends = _ends(data, values, at, (x,))
    order = np.argsort(_steps(values, x))
    across, shown = _steps(values, x)[order], values.values.astype(float)[order]
    if ends:
        shown = np.where(ends[_NOT_COMPUTED][order], np.nan, shown)
    ax = new_axes(height=55.0) if ax is None else ax
    dots = {"marker": "o", "ms": 2.2, "mew": 0.0} if across.size < 60 else {}
    ax.plot(across, shown, color=YAW, label=plain(variable), **dots)
    for (name, mask), marker in zip(ends.items(), "ox", strict=False):
        if mask.any():
            chosen = mask[order]
            look = {**_MARK, "ms": 4.0, "marker": marker, "zorder": 4}
            ax.plot(across[chosen], shown[chosen], label=name, **look)
    _legend_above(ax)
    if "flag_meanings" in values.attrs:
        words = _meanings(values)
        ax.set_yticks(range(len(words)), words)
    ax.set_xlabel(_axis(values, x))
    ax.set_ylabel("" if "flag_meanings" in values.attrs else part_of(values, dict(at)))
    if min(ax.get_ylim()) < 0 < max(ax.get_ylim()):
        zero_line(ax)
    return ax


@style()
def case_scatter(
    data: xr.Dataset,
    variable: str,
    x: str,
    y: str | None = None,
    ax: Axes | None = None,
    *,
    at: Mapping[str, Any] | None = None,
) -> Axes:
    """A variable of a list of cases over one or two of their parameters.

    Args:
        data: results over `case`, with coordinates along it.
        variable: drawn upwards, or in colours where `y` is given.
        x, y: coordinates of the cases.
        ax, at: as in `heatmap`.

    Returns:
        The axes: a disc a case, a cross where the glide did not land.

    Raises:
        ValueError: as `heatmap`.
    """
    at = {} if at is None else at
    values = _left(selected(variable_of(data, variable), at), ("case",))
    for name in (x, *([] if y is None else [y])):
        if name not in data.coords or data[name].dims != ("case",):
            known = [str(n) for n, c in data.coords.items() if c.dims == ("case",)]
            raise ValueError(f"the cases have no {name!r}: they have {', '.join(known)}")
    ax = new_axes(height=62.0) if ax is None else ax
    shown = values.values.astype(float)
    label = part_of(values, dict(at))
    landed, other = np.ones(shown.size, bool), np.zeros(shown.size, bool)
    if "outcome" in data and data["outcome"].dims == ("case",):
        landed = data["outcome"].values == Outcome.LANDED
        other = ~landed & (data["outcome"].values >= 0)
    up = shown if y is None else data[y].values
    colours = {} if y is None else colours_of(shown)
    shades = np.full(shown.size, YAW) if y is None else shown
    for which, marker, name in ((landed, "o", "lands"), (other, "X", "does not land")):
        look: dict[str, Any] = {"s": 16.0, "lw": 0.3, "edgecolors": INK, "marker": marker}
        look |= {"c": shades[which], "label": name, **colours}
        dots = ax.scatter(data[x].values[which], up[which], **look)
    if y is not None:
        bar = ax.figure.colorbar(dots, ax=ax, label=label)
        bar.outline.set_visible(False)  # type: ignore
    if other.any():
        where = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0), "borderaxespad": 0.2}
        ax.legend(ncols=2, **where)
    ax.set_xlabel(label_of(data[x]))
    ax.set_ylabel(label if y is None else label_of(data[y]))
    return ax
