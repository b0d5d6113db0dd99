"""Pictures of what the air does along the body."""

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .._lib.checks import check_integer, check_range
from ..files.glides import glide_dataset
from ..flight.glide import Glide
from ._labels import label_of, with_unit
from ._style import new_axes, new_figure, style, zero_line
from .heatmap import colours_of

_BODY = "arc length, $s$ (fraction of SVL)"
_SHOWN = 1.0, 99.0  # percentiles between which colours differ: a launch has few extremes
_OVERVIEW = ("lift", "drag", "angle_of_attack", "reynolds")


def along_body(source: Glide | xr.Dataset, name: str) -> xr.DataArray:
    """A quantity of the elements over time [s] and arc length, `fraction` of the length.

    Args:
        source: a glide simulated with `dense=True`, or its `files.glide_dataset`.
        name: a variable over time and node, such as lift, drag, angle_of_attack, reynolds,
            sweep_angle, dynamic_pressure, lift_coefficient, drag_coefficient.

    Returns:
        Values (T, n); forces of elements, in N, are given per length of the body, in N/m,
        so that they do not depend on the nodes.

    Raises:
        ValueError: there is no such variable, it is not over time and node, or the dataset
            does not say where its nodes are.
    """
    data = source if isinstance(source, xr.Dataset) else glide_dataset(source)
    known = [str(n) for n, v in data.data_vars.items() if set(v.dims) == {"time", "node"}]
    if name not in known:
        raise ValueError(f"{name!r} is not along the body: known are {', '.join(known)}")
    for needed in ("fraction", "node_chord", "node_area"):
        if needed not in data.coords:
            raise ValueError(f"the glide has no coordinate {needed!r} of its nodes")
    nodes = np.argsort(data["fraction"].values, kind="stable")
    nodes = nodes[data["node_area"].values[nodes] > 0]  # no point masses
    data = data.isel(node=nodes)
    values = data[name].transpose("time", "node")
    if values.attrs.get("units") == "N":
        length = data["node_area"].values / data["node_chord"].values
        said = str(values.attrs["long_name"]).replace(" of the elements", " per length")
        values = (values / length).assign_attrs(units="N/m", long_name=said)
    return values


@style()
def along_body_lines(
    source: Glide | xr.Dataset,
    name: str = "lift",
    ax: Axes | None = None,
    *,
    times: int | Sequence[float] | np.ndarray = 5,
) -> Axes:
    """Lift, drag, angle of attack or another quantity along the body at chosen times.

    Args:
        source, name: as in `along_body`.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        times: how many, equally spaced from launch to the end; or times [s], (F,), of
            which the nearest saved ones are drawn.

    Returns:
        The axes: arc length (fraction of SVL) across, one line a time, darkest first.

    Raises:
        ValueError: as `along_body`, or a time outside the glide.
    """
    values = along_body(source, name)
    end = float(values["time"][-1])
    if np.ndim(times) == 0:
        check_integer("times", times, 1, 100)
        times = np.linspace(0.0, end, int(times))  # type: ignore
    check_range("times", times, "s", 0, end)
    chosen = values.sel(time=np.asarray(times, float), method="nearest")
    ax = new_axes(height=56.0) if ax is None else ax
    zero_line(ax)
    shades = colormaps["viridis"](np.linspace(0, 0.9, chosen.sizes["time"]))
    for line, shade in zip(chosen, shades, strict=True):
        said = f"{float(line['time']):.2f} s"
        ax.plot(values["fraction"], line, color=shade, lw=1.0, label=said)
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel(_BODY)
    ax.set_ylabel(label_of(values))
    where = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "borderaxespad": 0.0}
    ax.legend(ncols=6, handlelength=1.0, columnspacing=1.0, handletextpad=0.4, **where)
    return ax


@style()
def along_body_map(
    source: Glide | xr.Dataset, name: str = "lift", ax: Axes | None = None
) -> Axes:
    """Lift, drag, angle of attack or another quantity over time and arc length.

    Args:
        source, name: as in `along_body`.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).

    Returns:
        The axes: time [s] across, arc length (fraction of SVL, head below) up, the
        quantity in colours, white at zero where it has both signs, with their bar; the
        last hundredth at either end has the colour of the end.

    Raises:
        ValueError: as `along_body`.
    """
    values = along_body(source, name)
    ax = new_axes(height=50.0) if ax is None else ax
    most = np.clip(values.values, *np.nanpercentile(values.values, _SHOWN))
    look = {"shading": "nearest", "rasterized": True, **colours_of(most)}
    mesh = ax.pcolormesh(values["time"], values["fraction"], values.values.T, **look)
    bar = ax.figure.colorbar(mesh, ax=ax, label=label_of(values), extend="both")
    bar.outline.set_visible(False)  # type: ignore
    ax.set_xlabel(with_unit("time, t", "s"))
    ax.set_ylabel("arc length, $s$ (SVL)")
    return ax


@style()
def forces(source: Glide | xr.Dataset) -> Figure:
    """Lift, drag, angle of attack and Reynolds number over time and along the body.

    Args:
        source: as in `along_body`.

    Returns:
        A figure of one column's width (90 mm), one `along_body_map` below the other.

    Raises:
        ValueError: as `along_body`.
    """
    data = source if isinstance(source, xr.Dataset) else glide_dataset(source)
    figure = new_figure(height=132.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(_OVERVIEW), 1, sharex=True, sharey=True)
    for ax, name in zip(axes, _OVERVIEW, strict=True):
        along_body_map(data, name, ax)
    for ax in axes[:-1]:
        ax.set_xlabel("")
    return figure
