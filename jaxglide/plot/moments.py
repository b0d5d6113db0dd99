"""Pictures of the moments of held glides in time (the paper's figure 6)."""

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from .._lib.checks import check_integer
from ..ensemble.survey import ABOUT
from ._style import INK, PAGE_WIDTH, PITCH, ROLL, YAW, new_figure, style, zero_line
from .windtunnel import _bend_name, _cases, _groups, _level, _shape_bar, _shape_scale

Case: TypeAlias = int | Mapping[str, float]

_TURNS = dict(zip(ABOUT, (PITCH, ROLL, YAW), strict=True))
_EQUAL = {"color": INK, "lw": 0.6, "ls": (0, (4, 2))}


def _pick(cases: xr.Dataset, case: Case) -> int:
    """Number of a case; of values given by name, the nearest case."""
    count = cases.sizes["case"]
    if not isinstance(case, Mapping):
        check_integer("case", case, 0, count - 1)
        return case
    off = np.zeros(count)
    for name, value in case.items():
        if name not in cases.coords:
            raise ValueError(f"the cases have no {name} to choose by")
        values = cases[name].values
        off += ((values - value) / max(float(np.ptp(values)), 1e-9)) ** 2
    return int(np.argmin(off))


def _name(one: xr.Dataset) -> str:
    """A case in words."""
    signs = {"psi_m": r"\psi_m", "d_psi": r"d_\psi", "nu_theta": r"\nu_\theta"}
    units = {"nu_theta": ""}
    known = [name for name in signs if name in one.coords]
    return ", ".join(f"${signs[n]}$ = {float(one[n]):g}{units.get(n, '°')}" for n in known)


@style()
def moments_in_time(moments: xr.Dataset, case: Case = 0) -> Figure:
    """Moments of the air and of the body's inertia during one held glide (6 a-b).

    Args:
        moments: held glides (`survey.survey`).
        case: number of the case, or values of its parameters, such as
            `{"psi_m": 20, "d_psi": 10, "nu_theta": 1.4}`: the nearest case is drawn, and
            the title says which.

    Returns:
        A figure of a page's width (180 mm): moments [N mm] of the air (left) and of
        inertia (right) about pitch, roll and yaw against time [s]. The coloured line is
        one phase, the grey band reaches from the lowest to the highest of all phases,
        the black line is their mean.

    Raises:
        ValueError: a variable is missing, or there is no such case.
    """
    cases = _cases(moments, ("last", "aerodynamic", "inertial"))
    one = cases.isel(case=_pick(cases, case))
    time = one["record"].values[: int(one["last"]) + 1]
    figure = new_figure(width=PAGE_WIDTH, height=96.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(3, 2, sharex=True, sharey="row")
    for column, name in enumerate(("aerodynamic", "inertial")):
        for row, (turn, colour) in enumerate(_TURNS.items()):
            ax = axes[row, column]
            values = one[name].sel(about=turn).values[: time.size]
            zero_line(ax)
            low, high = values.min(axis=-1), values.max(axis=-1)
            ax.fill_between(time, low, high, color="0.85", lw=0, label="range over phases")
            ax.plot(time, values[:, 0], color=colour, lw=0.9, label="one phase")
            ax.plot(time, values.mean(axis=-1), color="k", lw=1.1, label="mean over phases")
            if column == 0:
                ax.set_ylabel(f"{turn} (N mm)")
        axes[0, column].set_title(f"{name} moment")
        axes[2, column].set_xlabel("time, t (s)")
    axes[0, 0].set_xlim(0.0, max(float(time[-1]), 1e-6))
    figure.align_ylabels(axes)
    figure.suptitle(_name(one), fontsize=7.5)
    traces = [ax.lines[1] for ax in axes[:, 0]]
    band, mean = axes[0, 0].collections[0], axes[0, 0].lines[2]
    keys: list[Any] = [band, tuple(traces), mean]
    figure.legend(
        keys,
        ["range over phases", "one phase", "mean over phases"],
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.3)},
        handlelength=2.4,
        loc="outside lower center",
        ncols=3,
    )
    return figure


@style()
def moment_ratio(
    moments: xr.Dataset, psi_m: float | None = None, *, case: Mapping[str, float] | None = None
) -> Figure:
    """Peak-to-peak of the inertial over that of the aerodynamic moment in time (6c).

    Args:
        moments: held glides (`survey.survey`) with d_psi [deg] and nu_theta varied.
        psi_m: vertical amplitude of the cases drawn [deg], where several are there.
        case: a case to draw in black, as in `moments_in_time`.

    Returns:
        A figure of a page's width (180 mm): rows pitch, roll and yaw, columns d_psi, one
        line a shape, coloured by nu_theta; above 1 inertia dominates.

    Raises:
        ValueError: a variable is missing, or psi_m is not given or not there.
    """
    cases = _level(moments, ("inertial_ratio",), psi_m)
    bends = list(_groups(cases["d_psi"]))
    chosen = None if case is None else _pick(cases, case)
    scale, time = _shape_scale(cases), cases["record"].values
    figure = new_figure(width=PAGE_WIDTH, height=110.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(3, len(bends), sharex=True, sharey=True, squeeze=False)
    for row, turn in enumerate(ABOUT):
        ratio = cases["inertial_ratio"].sel(about=turn).values
        for column, (bend, at) in enumerate(bends):
            ax = axes[row, column]
            ax.axhline(1.0, zorder=1, label="equal", **_EQUAL)
            for i in at:
                nu = float(cases["nu_theta"][i])
                line = {"color": scale.to_rgba(nu), "lw": 0.8, "zorder": 2}  # type: ignore
                line |= {"color": "k", "lw": 1.3, "zorder": 3} if i == chosen else {}
                ax.plot(time, np.where(ratio[i] > 0, ratio[i], np.nan), label=f"{nu:g}", **line)
            if row == 0:
                ax.set_title(_bend_name(bend))
            if row == len(ABOUT) - 1:
                ax.set_xlabel("time, t (s)")
        axes[row, 0].set_ylabel(turn)
    axes[0, 0].set_yscale("log")
    axes[0, 0].set_xlim(0.0, max(float(time[-1]), 1e-6))
    axes[0, 0].xaxis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5, 10]))
    figure.supylabel("inertial over aerodynamic moment, peak to peak", fontsize=7.0)
    _shape_bar(figure, axes, cases, shrink=0.6, aspect=30, pad=0.02)
    keys = [Line2D([], [], label="equal", **_EQUAL)]
    if chosen is not None:
        keys.append(Line2D([], [], color="k", lw=1.3, label=_name(cases.isel(case=chosen))))
    figure.legend(handles=keys, loc="outside lower center", ncols=2)
    return figure
