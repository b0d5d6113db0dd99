"""Pictures of what dorsoventral bending does to the glide (the paper's figure 5)."""

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..flight.ends import Outcome
from ._labels import axis_label, degrees
from ._style import new_figure, style

_CROSS = {"ls": "", "marker": "x", "ms": 3, "mew": 0.8}


def bending_grid(data: xr.Dataset, quantity: str = "path") -> Figure:
    """Side views, or pitch against time, of glides by bend (columns) and psi_m (rows).

    Args:
        data: over `case` and `sample`, with coordinates psi_m, d_psi and nu_theta along
            `case`, and with `position` [m], `angles` [deg], and `outcome`.
        quantity: "path" for the path of the centre of mass, forward against height, or
            "pitch" for pitch against time.

    Returns:
        The figure: one line a glide, coloured by nu_theta, a cross where it did not land.

    Raises:
        ValueError: an unknown quantity, or a dataset without trajectories.
    """
    if quantity not in ("path", "pitch"):
        raise ValueError(f"quantity = {quantity!r} is not one of path, pitch")
    if "sample" not in data.dims:
        raise ValueError("the dataset has no trajectories: give the study times")
    rows, columns = np.unique(data.psi_m), np.unique(data.d_psi)
    shades = colormaps["viridis"]
    low, high = float(data.nu_theta.min()), float(data.nu_theta.max())
    with style():
        figure = new_figure(width=180.0, height=22 + 38 * len(rows))
        figure.set_layout_engine("constrained")
        axes = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
        for i, psi_m in enumerate(rows):
            for j, d_psi in enumerate(columns):
                ax = axes[i, j]
                here = (data.psi_m == psi_m) & (data.d_psi == d_psi)
                for case in np.flatnonzero(here.broadcast_like(data.case)):
                    one = data.isel(case=case)
                    place = (float(one.nu_theta) - low) / max(high - low, 1e-9)
                    _draw(ax, one, quantity, shades(0.9 * place))
                if i == 0:
                    ax.set_title(rf"$d_\psi$ = {degrees(d_psi)}")
                if j == 0:
                    name = axis_label("z") if quantity == "path" else "pitch (°)"
                    ax.set_ylabel(rf"$\psi_m$ = {psi_m:g}°" + f"\n{name}")
                if i == len(rows) - 1:
                    ax.set_xlabel(axis_label("y") if quantity == "path" else "time, t (s)")
                if quantity == "path":
                    ax.set_aspect("equal")
                else:
                    ax.set_ylim(-95, 95)
        bar = figure.colorbar(
            _scale(low, high, shades),
            ax=axes,
            shrink=0.6,
            label=r"$\nu_\theta$ (per SVL)",
        )
        bar.outline.set_visible(False)  # type: ignore[operator]
        if (data.outcome != Outcome.LANDED).any():
            cross = Line2D([], [], color="0.35", label="does not land", **_CROSS)
            figure.legend(handles=[cross], loc="outside lower center", handletextpad=0.2)
    return figure


def _scale(low, high, shades):
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    part = LinearSegmentedColormap.from_list("part", shades(np.linspace(0, 0.9, 64)))
    return ScalarMappable(Normalize(low, high), part)


def _draw(ax, one: xr.Dataset, quantity: str, colour) -> None:
    if quantity == "path":
        x, y = one.position.sel(axis="y").values, one.position.sel(axis="z").values
        end = one.landing_point.sel(axis="y").item(), one.landing_point.sel(axis="z").item()
    else:
        x, y = one.sample.values, one.angles.sel(turn="pitch").values
        end = one.time.item(), one.end_angles.sel(turn="pitch").item()
    flying = np.isfinite(x) & np.isfinite(y)
    ax.plot(np.append(x[flying], end[0]), np.append(y[flying], end[1]), color=colour, lw=0.8)
    if one.outcome.item() != Outcome.LANDED:
        ax.plot(*end, color=colour, **_CROSS)
