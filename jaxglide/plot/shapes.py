"""Pictures of the shape space: amplitude and wave number of the body's wave."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from ..flight.ends import Outcome
from ._labels import plain
from ._style import COLUMN_WIDTH, INK, new_figure, place, style

_COLUMNS = {"height_lost": "height lost (m)", "path_length": "path length (m)"}
_UNSTABLE = (Outcome.UNSTABLE_YAW, Outcome.UNSTABLE_PITCH, Outcome.UNSTABLE_ROLL)
_SHAPE = ("theta_m", "nu_theta")
_NAME = {
    "ha": "center",
    "va": "center_baseline",
    "fontsize": 6.5,
    "path_effects": [withStroke(linewidth=1.6, foreground="white")],
}
_MAP = {"cmap": "viridis", "edgecolors": "face", "linewidth": 0.2}  # no gaps in vector files
_MARKS = {"unstable": "o", "not finished": "x"}
_MARK = {"ls": "", "ms": 2.0, "mfc": "white", "mec": INK, "mew": 0.5}


def _check(dataset: xr.Dataset, variables: dict[str, tuple[str, ...]]) -> None:
    for name, dims in variables.items():
        if name not in dataset.variables:
            raise ValueError(f"the dataset has no {name}: it needs {', '.join(variables)}")
        if set(dataset[name].dims) != set(dims):
            raise ValueError(
                f"{name} has dimensions {dataset[name].dims}: they must be {', '.join(dims)}"
            )


def _sorted(values):
    """A data array or data set with amplitude and wave number increasing."""
    return values.transpose(..., *_SHAPE).sortby(list(_SHAPE))


def _edges(centres: np.ndarray) -> np.ndarray:
    """Edges of cells halfway between their centres, (n,) -> (n + 1,)."""
    if centres.size == 1:
        return centres[0] + np.array([-0.5, 0.5])
    middle = (centres[1:] + centres[:-1]) / 2
    return np.concatenate(
        [[2 * centres[0] - middle[0]], middle, [2 * centres[-1] - middle[-1]]]
    )


def _outline(mask: np.ndarray, x: np.ndarray, y: np.ndarray, outermost: bool = True) -> list:
    """Segments around the cells where mask, (rows, columns), is set; x, y are the edges.

    With or without those on the outermost edges.
    """
    framed = np.pad(mask, 1, mode="constant" if outermost else "edge")
    segments = []
    for row, column in np.argwhere(framed[1:, 1:-1] != framed[:-1, 1:-1]):
        segments.append([(x[column], y[row]), (x[column + 1], y[row])])
    for row, column in np.argwhere(framed[1:-1, 1:] != framed[1:-1, :-1]):
        segments.append([(x[column], y[row]), (x[column], y[row + 1])])
    return segments


@style()
def region_outlines(
    ax: Axes,
    dataset: xr.Dataset,
    *,
    labels: bool = True,
    keep_clear: xr.DataArray | None = None,
) -> Axes:
    """Outline the regions of the shape space on axes of nu_theta across, theta_m [deg] up.

    Args:
        ax: axes to draw on.
        dataset: with `region`, names of regions such as "observed", "open" and "closed",
            dimensions theta_m [deg] and nu_theta, as `shape_heatmaps` takes it.
        labels: whether to write the name of each region in it.
        keep_clear: shapes that a name should not cover, booleans of the same dimensions;
            by default none.

    Returns:
        The axes, with one line collection for each region, labelled with its name.

    Raises:
        ValueError: the dataset has no `region`, or its dimensions are others.
    """
    _check(dataset, {"region": _SHAPE, **{name: (name,) for name in _SHAPE}})
    region = _sorted(dataset["region"])
    free = np.ones(region.shape, bool) if keep_clear is None else ~_sorted(keep_clear).values
    nu, theta = region["nu_theta"].values, region["theta_m"].values
    for name in np.unique(region.values):
        mask = region.values == name
        inner = _outline(mask, _edges(nu), _edges(theta), outermost=False)
        whole = _outline(mask, _edges(nu), _edges(theta))
        halo = LineCollection(inner, colors="white", linewidths=1.8, zorder=3)
        line = LineCollection(whole, colors=INK, linewidths=0.8, zorder=3.1, label=plain(name))
        for lines in (halo, line):
            lines.set_capstyle("projecting")  # closes the corners
            ax.add_collection(lines, autolim=False)
        if labels:
            row, column = _roomiest(mask & free if (mask & free).any() else mask)
            x = np.interp(column, np.arange(nu.size), nu)
            ax.text(x, theta[row], plain(name), zorder=5, **_NAME)
    return ax


def _roomiest(mask: np.ndarray) -> tuple[int, float]:
    """Row and middle column of a run of set cells, along a row, where a name fits.

    The longest run, up to five cells; of those, the one closest to the middle of the set
    cells. At least one cell is set.
    """
    middle = np.argwhere(mask).mean(axis=0)
    runs = []
    for row, cells in enumerate(mask):
        ends = np.flatnonzero(np.diff(np.pad(cells, 1).astype(int)))
        for start, stop in ends.reshape(-1, 2):
            centre = (start + stop - 1) / 2
            off = float(np.hypot(row - middle[0], centre - middle[1]))
            runs.append((min(stop - start, 5), -off, row, centre))
    return max(runs)[2:]


def _heatmap(ax: Axes, values: xr.DataArray, outcome: xr.DataArray, span) -> QuadMesh:
    """One map, (theta_m, nu_theta), with a mark on every shape that did not land."""
    nu, theta = values["nu_theta"].values, values["theta_m"].values
    ax.set_facecolor("0.8")  # where there is no value
    ax.spines[:].set_visible(True)
    mesh = ax.pcolormesh(
        _edges(nu), _edges(theta), values.values, vmin=span[0], vmax=span[1], **_MAP
    )
    unstable = np.isin(outcome.values, _UNSTABLE)
    failed = ~unstable & (outcome.values != Outcome.LANDED)
    for (label, marker), mask in zip(_MARKS.items(), (unstable, failed), strict=True):
        if mask.any():
            rows, columns = np.nonzero(mask)
            ax.plot(nu[columns], theta[rows], marker=marker, label=label, zorder=4, **_MARK)
    return mesh


# Layout of the heat maps [mm].
_LEFT, _PANEL, _GAP, _BELOW, _ABOVE, _BAR = 12.5, 33.5, 3.5, 13.0, 12.5, 2.2


@style()
def shape_heatmaps(dataset: xr.Dataset) -> Figure:
    """Height lost and path length over the shape space, one row for each frequency.

    Args:
        dataset: with dimensions f_theta [Hz], theta_m [deg] and nu_theta, coordinates of
            the same names, variables `height_lost` [m], `path_length` [m] and `outcome`
            (`Outcome` as integers), and `region`, names of regions, dimensions theta_m
            and nu_theta. The order of theta_m and nu_theta does not matter.

    Returns:
        A figure of one column's width (90 mm): the maps row by row, then a colour bar for
        each column. A dot marks a shape that is unstable.

    Raises:
        ValueError: a variable or coordinate is missing, or has other dimensions.
    """
    cube = ("f_theta", *_SHAPE)
    needed = dict.fromkeys([*_COLUMNS, "outcome"], cube)
    _check(dataset, {**needed, "region": _SHAPE, **{name: (name,) for name in cube}})
    dataset = _sorted(dataset)
    marked = dataset["outcome"] != Outcome.LANDED
    clearest = int(np.argmin(marked.sum(_SHAPE).values))  # the row whose map names the regions
    rows = dataset.sizes["f_theta"]
    figure = new_figure(height=_BELOW + rows * _PANEL + (rows - 1) * _GAP + _ABOVE)
    axes = [
        [figure.add_axes((0, 0, 1, 1), label=f"{r}{c}") for c in (0, 1)] for r in range(rows)
    ]
    for column, (name, label) in enumerate(_COLUMNS.items()):
        span = float(dataset[name].min()), float(dataset[name].max())
        left = _LEFT + column * (_PANEL + _GAP)
        for row, frequency in enumerate(dataset["f_theta"].values):
            ax = axes[row][column]
            bottom = _BELOW + (rows - 1 - row) * (_PANEL + _GAP)
            place(figure, ax, left, bottom, _PANEL, _PANEL)
            at = {"f_theta": row}
            mesh = _heatmap(ax, dataset[name].isel(at), dataset["outcome"].isel(at), span)
            region_outlines(
                ax, dataset, labels=(row, column) == (clearest, 0), keep_clear=marked[row]
            )
            _label(ax, row == rows - 1, column, frequency)
        _colour_bar(figure, mesh, label, left)
    _legend(figure, [ax for line in axes for ax in line])
    return figure


def _label(ax: Axes, last: bool, column: int, frequency: float) -> None:
    ax.tick_params(labelbottom=last, labelleft=column == 0)
    if last:
        ax.set_xlabel(r"waves $\nu_\theta$ (per SVL)")
    if column == 0:
        ax.set_ylabel(r"amplitude $\theta_m$ (°)")
    else:
        name = rf"$f_\theta$ = {frequency:g} Hz"
        beside = {"transform": ax.transAxes, "rotation": -90, "va": "center"}
        ax.text(1.04, 0.5, name, fontsize=7.5, **beside)


def _colour_bar(figure: Figure, mesh: QuadMesh, label: str, left: float) -> None:
    """A colour bar above a column, in place of the column's title."""
    ax = figure.add_axes((0, 0, 1, 1), label=label)
    top = 25.4 * figure.get_size_inches()[1]
    place(figure, ax, left, top - _ABOVE + 2.0, _PANEL, _BAR)
    bar = figure.colorbar(mesh, cax=ax, orientation="horizontal", ticklocation="top")
    bar.set_label(label, fontsize=7.5)
    bar.locator = MaxNLocator(4, steps=[1, 2, 5, 10])
    bar.outline.set_visible(False)  # type: ignore


def _legend(figure: Figure, axes: list[Axes]) -> None:
    marks = {line.get_label(): line for ax in axes for line in ax.lines}
    if marks:
        middle = (_LEFT + _PANEL + _GAP / 2) / COLUMN_WIDTH
        where = {"loc": "lower center", "bbox_to_anchor": (middle, 0.0), "borderaxespad": 0.2}
        figure.legend(handles=list(marks.values()), ncols=2, handletextpad=0.2, **where)
