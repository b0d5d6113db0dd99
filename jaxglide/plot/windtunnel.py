"""Pictures of the moments of held glides by bend and shape (the paper's figure 5 d-f)."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..flight.ends import Outcome
from ._labels import degrees
from ._style import (
    INK,
    PAGE_WIDTH,
    new_axes,
    new_figure,
    style,
    zero_line,
)

_INNER = {"record", "phase", "about", "forward_up", "sample", "axis", "turn"}
# Okabe and Ito's blues and oranges either side of grey: tail down, straight, tail up.
_BENDS = LinearSegmentedColormap.from_list(
    "bends", ["#0072B2", "#56B4E9", "#8A8A8A", "#E69F00", "#D55E00"], N=257
)
_SHAPES = LinearSegmentedColormap.from_list(
    "shapes", colormaps["viridis"](np.linspace(0, 0.9, 64))
)
_NU, _BEND = r"waves $\nu_\theta$ (per SVL)", r"bend $d_\psi$ (° per SVL)"
_PITCH_MOMENT = "mean pitch moment (N mm)"


def _cases(data: xr.Dataset, names: Sequence[str]) -> xr.Dataset:
    """The dataset over `case`, a grid too; `ValueError` where it lacks one of the names."""
    for name in names:
        if name not in data.variables:
            raise ValueError(f"the dataset has no {name}: it needs {', '.join(names)}")
    dims = [str(name) for name in data[names[0]].dims if name not in _INNER]
    if dims != ["case"]:
        data = data.stack(case=dims, create_index=False) if dims else data.expand_dims("case")
    fixed = {n: c for n, c in data.coords.items() if not c.dims and c.dtype.kind in "fi"}
    every = np.ones(data.sizes["case"])
    data = data.assign_coords(
        {n: ("case", every * c.item(), c.attrs) for n, c in fixed.items()}
    )
    return data.transpose("case", ...)


def _level(data: xr.Dataset, names: Sequence[str], psi_m: float | None) -> xr.Dataset:
    """The cases of one psi_m [deg], by d_psi, then nu_theta."""
    cases = _cases(data, (*names, "d_psi", "nu_theta"))
    vertical = np.unique(cases["psi_m"]) if "psi_m" in cases.coords else np.array([])
    if psi_m is None and vertical.size > 1:
        raise ValueError(f"the cases have {vertical.size} values of psi_m: say which to draw")
    if psi_m is not None and vertical.size:
        cases = cases.isel(case=np.flatnonzero(np.isclose(cases["psi_m"], psi_m)))
        if not cases.sizes["case"]:
            raise ValueError(f"psi_m = {psi_m:g} is none of {', '.join(map(str, vertical))}")
    cases = cases.isel(case=np.lexsort((cases["nu_theta"], cases["d_psi"])))
    pairs = np.stack([cases["d_psi"].values, cases["nu_theta"].values], axis=1)
    if len(np.unique(pairs, axis=0)) < len(pairs):
        raise ValueError("cases have the same d_psi and nu_theta: choose among them first")
    return cases


def _bent(moments: xr.Dataset, psi_m: float | None) -> tuple[xr.Dataset, np.ndarray]:
    """Cases of a survey and their mean pitch moment at the last record [N mm], (case,)."""
    cases = _level(moments, ("mean_moment", "last"), psi_m)
    ends = cases["mean_moment"].sel(about="pitch").isel(record=cases["last"])
    return cases, ends.values


def _groups(values: xr.DataArray) -> Iterator[tuple[float, np.ndarray]]:
    """Every value there is, and where it is."""
    for value in np.unique(values):
        yield float(value), np.flatnonzero(values.values == value)


def _bend_colour(cases: xr.Dataset) -> Callable[[float], Any]:
    most = max(float(np.abs(cases["d_psi"]).max()), 1e-9)
    return lambda bend: _BENDS(0.5 + 0.5 * bend / most)


def _shape_scale(cases: xr.Dataset) -> ScalarMappable:
    low, high = float(cases["nu_theta"].min()), float(cases["nu_theta"].max())
    return ScalarMappable(Normalize(low, max(high, low + 1e-9)), _SHAPES)


def _shape_bar(figure, axes, cases: xr.Dataset, **options) -> None:
    bar = figure.colorbar(_shape_scale(cases), ax=axes, label=_NU, **options)
    bar.outline.set_visible(False)


def _bend_key(cases: xr.Dataset) -> list[Line2D]:
    colour = _bend_colour(cases)
    return [
        Line2D([], [], color=colour(bend), marker="o", ms=3, lw=1.1, label=_bend_name(bend))
        for bend, _ in _groups(cases["d_psi"])
    ]


def _bend_name(bend: float) -> str:
    return rf"$d_\psi$ = {degrees(bend)}"


def _size(nu: np.ndarray, cases: xr.Dataset) -> np.ndarray:
    """Area of a mark [pt^2], growing with the number of waves."""
    return 4.0 + 22.0 * _shape_scale(cases).norm(nu)  # type: ignore


@style()
def landing_against_moment(
    glides: xr.Dataset,
    moments: xr.Dataset,
    ax: Axes | None = None,
    *,
    psi_m: float | None = None,
    key: bool = True,
) -> Axes:
    """Where free glides end against the pitch moment of the same gaits when held (5d).

    Args:
        glides: free glides (`sweep.sweep`), with `landing_point` [m] and `outcome`, and
            d_psi [deg] and nu_theta varied.
        moments: held glides of the same cases (`survey.survey`).
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        psi_m: vertical amplitude of the cases drawn [deg], where several are there.
        key: whether to say what colours and marks mean.

    Returns:
        The axes: the mean over phases at the last record [N mm] across, y [m] up. One
        colour a bend, marks larger with nu_theta, a cross where the glide did not land, an
        open circle at the average of a bend.

    Raises:
        ValueError: a variable is missing, the cases of the two differ, or psi_m is not
            given or not there.
    """
    cases, pitch = _bent(moments, psi_m)
    free = _level(glides, ("outcome", "landing_point"), psi_m)
    for name in ("d_psi", "nu_theta"):
        a, b = free[name].values, cases[name].values
        if a.shape != b.shape or not np.allclose(a, b):
            raise ValueError(f"glides and moments are of different cases: {name} differs")
    forward = free["landing_point"].sel(axis="y").values
    landed = free["outcome"].values == Outcome.LANDED
    ax = new_axes(height=66.0) if ax is None else ax
    zero_line(ax)
    zero_line(ax, across=True)
    colour, size = _bend_colour(cases), _size(cases["nu_theta"].values, cases)
    for bend, at in _groups(cases["d_psi"]):
        shade = colour(bend)
        ax.plot(pitch[at], forward[at], color=shade, lw=0.5, alpha=0.6, label=degrees(bend))
        for mark, which in (("o", landed[at]), ("X", ~landed[at])):
            chosen = at[which]
            points = {"c": [shade], "marker": mark, "lw": 0, "zorder": 3}
            ax.scatter(pitch[chosen], forward[chosen], size[chosen], **points)
        middle = pitch[at].mean(), forward[at].mean()
        ring = {"marker": "o", "ms": 6.0, "mfc": "none", "mec": "k", "mew": 1.0, "zorder": 4}
        ax.plot(*middle, ls="", label="average", **ring)
    ax.set_xlabel(_PITCH_MOMENT)
    ax.set_ylabel("forward at the end, y (m)")
    if key:
        ax.legend(handles=_landing_key(cases), **_BESIDE)
    return ax


_BESIDE = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.02), "borderaxespad": 0.0}


def _landing_key(cases: xr.Dataset) -> list[Line2D]:
    """What the marks mean."""
    grey = {"ls": "", "mew": 0.0, "mfc": "0.45"}
    shapes = [float(f(cases["nu_theta"])) for f in (np.min, np.max)]
    sizes = [
        Line2D([], [], marker="o", ms=float(_size(np.asarray(nu), cases)) ** 0.5, **grey)
        for nu in shapes
    ]
    for nu, line in zip(shapes, sizes, strict=True):
        line.set_label(rf"$\nu_\theta$ = {nu:g}")
    ring = Line2D([], [], ls="", marker="o", ms=6.0, mfc="none", mec="k", label="average")
    cross = Line2D([], [], marker="X", ms=4.0, label="does not land", **grey)
    return [*_bend_key(cases), *sizes, cross, ring]


@style()
def moment_by_shape(
    moments: xr.Dataset, ax: Axes | None = None, *, psi_m: float | None = None, key: bool = True
) -> Axes:
    """Mean pitch moment against the number of waves, one line a bend (5e).

    Args:
        moments: held glides (`survey.survey`) with d_psi [deg] and nu_theta varied.
        ax, psi_m, key: as in `landing_against_moment`.

    Returns:
        The axes: nu_theta across, the mean over phases at the last record [N mm] up.

    Raises:
        ValueError: a variable is missing, or psi_m is not given or not there.
    """
    cases, pitch = _bent(moments, psi_m)
    ax = new_axes(height=58.0) if ax is None else ax
    zero_line(ax)
    colour, nu = _bend_colour(cases), cases["nu_theta"].values
    for bend, at in _groups(cases["d_psi"]):
        shade = {"color": colour(bend), "marker": "o", "ms": 2.6, "mew": 0.0}
        ax.plot(nu[at], pitch[at], label=degrees(bend), **shade)
    ax.set_xlabel(_NU)
    ax.set_ylabel(_PITCH_MOMENT)
    if key:  # the uppermost line first
        ax.legend(handles=_bend_key(cases)[::-1], **_BESIDE)
    return ax


def _crossings(x: np.ndarray, y: np.ndarray) -> list[float]:
    """Where straight lines between points cross zero."""
    before = np.flatnonzero(np.diff(np.signbit(y)))
    return [float(x[i] - y[i] * (x[i + 1] - x[i]) / (y[i + 1] - y[i])) for i in before]


@style()
def moment_by_bend(
    moments: xr.Dataset, ax: Axes | None = None, *, psi_m: float | None = None, key: bool = True
) -> Axes:
    """Mean pitch moment against the bend, one line a shape (5f).

    Args:
        moments: held glides (`survey.survey`) with d_psi [deg] and nu_theta varied.
        ax, psi_m, key: as in `landing_against_moment`.

    Returns:
        The axes: d_psi [deg] across, the mean over phases at the last record [N mm] up;
        open circles where a line crosses zero, and a band over them all.

    Raises:
        ValueError: a variable is missing, or psi_m is not given or not there.
    """
    cases, pitch = _bent(moments, psi_m)
    ax = new_axes(height=58.0) if ax is None else ax
    zero_line(ax)
    scale, bend, trims = _shape_scale(cases), cases["d_psi"].values, []
    line = {"lw": 0.9, "marker": "o", "ms": 1.6, "mew": 0.0}
    for nu, at in _groups(cases["nu_theta"]):
        ax.plot(bend[at], pitch[at], label=f"{nu:g}", color=scale.to_rgba(nu), **line)  # type: ignore
        trims += _crossings(bend[at], pitch[at])
    if trims:
        ax.axvspan(min(trims), max(trims), color="0.92", lw=0, zorder=-1, label="zero moment")
        ring = {"marker": "o", "ms": 3.2, "mfc": "white", "mec": INK, "mew": 0.7, "zorder": 4}
        ax.plot(trims, np.zeros(len(trims)), ls="", label="crossings", **ring)
    ax.set_xticks(np.unique(bend))
    ax.set_xlabel(_BEND)
    ax.set_ylabel(_PITCH_MOMENT)
    if key:
        _shape_bar(ax.figure, ax, cases)
    return ax


@style()
def bending_moments(
    glides: xr.Dataset, moments: xr.Dataset, *, psi_m: float | None = None
) -> Figure:
    """What the bend does to the pitch moment, and that to the glide: figure 5 d-f.

    Args:
        glides, moments, psi_m: as in `landing_against_moment`.

    Returns:
        A figure of a page's width (180 mm) with the axes of `landing_against_moment`,
        `moment_by_shape` and `moment_by_bend`.

    Raises:
        ValueError: as `landing_against_moment`.
    """
    cases, _ = _bent(moments, psi_m)
    figure = new_figure(width=PAGE_WIDTH, height=66.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, 3)
    axes[2].sharey(axes[1])
    landing_against_moment(glides, moments, axes[0], psi_m=psi_m, key=False)
    moment_by_shape(moments, axes[1], psi_m=psi_m, key=False)
    moment_by_bend(moments, axes[2], psi_m=psi_m, key=False)
    axes[2].set_ylabel("")
    axes[2].tick_params(labelleft=False)
    _shape_bar(figure, axes[2], cases, shrink=0.9)
    above = {"loc": "outside upper left", "handlelength": 1.4, "columnspacing": 1.3}
    figure.legend(handles=_landing_key(cases), ncols=12, **above)
    return figure
