"""Picture of a steady glide followed along a number: how steep it is, and where it stays."""

from itertools import groupby, pairwise
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .._lib.datasets import Variable, checked
from ..steady import Branch
from ._labels import parameter_label, plain
from ._schemas import BRANCH
from ._style import FAINT, INK, PITCH, ROLL, YAW, new_figure, style

_STABLE: dict[str, Any] = {"ls": "-"}
_UNSTABLE: dict[str, Any] = {"ls": (0, (3, 1.5))}
_KINDS = {  # of special points: mark, colour, in words
    "fold": ("D", PITCH, "fold"),
    "+1": ("^", ROLL, "others branch off"),
    "-1": ("s", "#CC79A7", "pairs branch off"),
    "pair": ("v", "#E69F00", "starts to swing"),
    "start": ("o", INK, "start"),
}
_WIDE = 10.0  # ratio of radii from which they are drawn on a logarithmic scale


@style()
def branch(branch: Branch | xr.Dataset) -> Figure:
    """A bifurcation diagram: glide angle and spectral radius along the number.

    Stable steady glides are solid, unstable ones dashed. Folds, where the number turns back,
    and the other points about which something is special are marked.

    Args:
        branch: what `steady_branch` found, or its Dataset.

    Returns:
        A figure of one column's width (90 mm) with two axes above each other: glide angle
        [deg], and spectral radius with the border of stability.

    Raises:
        ValueError: there is no point in it, or the Dataset lacks a variable.
    """
    if isinstance(branch, Branch) and not branch.found:
        raise ValueError(f"there is no branch to draw: {branch.ends[0]}")
    data = _checked(branch if isinstance(branch, xr.Dataset) else branch.dataset())
    figure = new_figure(height=95.0)
    figure.set_layout_engine("constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    radius = data["spectral_radius"].values
    _draw(upper, data, np.rad2deg(data["glide_angle"].values))
    _draw(lower, data, radius)
    lower.axhline(1.0, color=FAINT, lw=0.6, zorder=0)
    if radius.max() > _WIDE * max(radius.min(), 1e-12):
        lower.set_yscale("log")
    attributes = data["parameter"].attrs
    name, unit = str(data.attrs["parameter"]), str(attributes.get("units", ""))
    lower.set_xlabel(parameter_label(name, unit))
    upper.set_ylabel("glide angle (°)")
    lower.set_ylabel("spectral radius")
    lengths = {"handlelength": 1.8, "handletextpad": 0.5, "columnspacing": 1.2}
    figure.legend(handles=_legend(data), loc="outside upper center", ncols=4, **lengths)
    return figure


def _checked(data: xr.Dataset) -> xr.Dataset:
    unit = data["parameter"].attrs.get("units", "") if "parameter" in data else ""
    known = {**BRANCH.variables, "parameter": Variable(("point",), str(unit))}
    return checked(data, BRANCH._replace(variables=known))


def _runs(stable: np.ndarray) -> list[tuple[int, int, bool]]:
    """First and last point of every piece of a branch, and whether both its ends and all
    between are stable; a piece starts where the one before ends."""
    whole = [bool(a and b) for a, b in pairwise(stable)]
    found, at = [], 0
    for kind, run in groupby(whole):
        count = len(list(run))
        found.append((at, at + count, kind))
        at += count
    return found


def _draw(ax: Axes, data: xr.Dataset, values: np.ndarray) -> None:
    along, kinds = data["parameter"].values, data["kind"].values.astype(str)
    for first, last, stable in _runs(data["spectral_radius"].values < 1):
        part = slice(first, last + 1)
        look = _STABLE if stable else _UNSTABLE
        name = "stable" if stable else "unstable"
        ax.plot(along[part], values[part], color=YAW, lw=1.2, label=name, **look)
    for kind, (mark, colour, _) in _KINDS.items():
        at = kinds == kind
        face = {"mfc": "white"} if kind == "start" else {"mew": 0}
        look = {"color": colour, "ls": "", "marker": mark, "ms": 4, "zorder": 4, **face}
        if at.any():
            ax.plot(along[at], values[at], label=kind, **look)


def _legend(data: xr.Dataset) -> list[Line2D]:
    stable = data["spectral_radius"].values < 1
    runs = {kind for *_, kind in _runs(stable)} or {bool(stable[0])}
    lines = [(True, _STABLE, "stable"), (False, _UNSTABLE, "unstable")]
    shown = [(look, name) for kind, look, name in lines if kind in runs]
    found = [Line2D([], [], color=YAW, label=name, **look) for look, name in shown]
    kinds = set(data["kind"].values.astype(str))
    for kind, (mark, colour, said) in _KINDS.items():
        if kind in kinds:
            face = {"mfc": "white"} if kind == "start" else {"mew": 0}
            look = {"color": colour, "ls": "", "marker": mark, "ms": 4, **face}
            found.append(Line2D([], [], label=plain(said), **look))
    return found
