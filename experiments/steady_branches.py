"""Steady glides of two gaits followed along six numbers of the gait, with their stability."""

from common import arguments, save_dataset, save_figure, write_table  # first: it sets up JAX

# isort: split
import dataclasses
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from jaxglide import (
    Branch,
    Gait,
    Glider,
    Polar,
    Snake,
    SteadyGlide,
    steady_branch,
    steady_glide,
)
from jaxglide.plot._labels import SYMBOLS
from jaxglide.plot._style import FAINT, INK, PAGE_WIDTH, PITCH, ROLL, YAW, new_figure, style

GAITS = {
    "published": Gait.from_degrees(),
    "long": Gait.from_degrees(60, 0.0, 1.738, 1.30, 5.5),
}
RANGES = {
    "f_theta": (0.3, 3.0),
    "d_psi": (-20, 30),
    "psi_m": (0, 45),
    "nu_theta": (0.8, 2.2),
    "theta_m": (40, 140),
}
BIAS = (-10, 10)  # of d_theta [deg per SVL]
FREQUENCIES = (0.6, 0.9, 1.2, 1.5, 2.0, 2.5, 3.0)
FROZEN = (0.0, 2 * np.pi)  # phases [rad]
POINTS = 100


_MARKS = {"fold": ("o", INK), "+1": ("D", PITCH), "-1": ("s", ROLL), "pair": ("^", YAW)}
_MEANING = {
    "fold": "fold",
    "+1": "multiplier 1",
    "-1": "multiplier -1 of the map",
    "pair": "pair of multipliers",
    "start": "start",
}
_UNITS = {"deg": "°", "deg/SVL": "° per SVL"}
_LOWEST, _HIGHEST = -3.0, 4.0  # 1/s; what decays or grows faster is out of the picture


def glider_of(gait: Gait) -> Glider:
    return Glider(Snake.from_svl(0.70, nodes=60, node_set="gauss"), gait, Polar.smooth())


def at(glider: Glider, branch: Branch, f: float) -> SteadyGlide | None:
    """The glide of a branch in f_theta at a frequency, on its part before any fold."""
    start = list(branch.kinds).index("start")
    folds = np.flatnonzero(branch.kinds == "fold")
    low, high = [0, *folds[folds < start]][-1], [*folds[folds > start], None][0]
    part = slice(low, high)
    known = branch.parameter[part]
    if not known.min() <= f <= known.max():
        return None
    guess = [np.interp(f, known, column) for column in branch.state[part].T]
    gait = dataclasses.replace(glider.gait, f_theta=f)
    return steady_glide(dataclasses.replace(glider, gait=gait), guess)


def modes(name: str, glider: Glider, branch: Branch) -> list[tuple]:
    """Rows of the modes at some frequencies, the least stable first."""
    rows = []
    for f in FREQUENCIES:
        glide = at(glider, branch, f)
        if glide is None or not bool(glide.found):
            continue
        angle = float(np.rad2deg(glide.glide_angle))
        for mode in glide.modes[:4]:
            leading = max(mode.shares, key=lambda part, mode=mode: mode.shares[part])
            row = (name, f, angle, mode.name or "unnamed", leading, mode.growth, mode.frequency)
            rows.append(row)
    return rows


def marked(name: str, branch: Branch) -> list[tuple]:
    """Rows of the special points, the ends and the flattest point of a branch."""
    rows = []
    kinds = {k: str(branch.kinds[k]) for k in branch.special}
    kinds[int(np.argmin(branch.glide_angle))] = "flattest"
    kinds |= {0: branch.ends[0], len(branch.parameter) - 1: branch.ends[1]}
    for k, kind in sorted(kinds.items()):
        angle, turn = np.rad2deg(branch.glide_angle[k]), np.rad2deg(branch.turn_rate[k])
        figures = (branch.parameter[k], angle, branch.speed[k], turn, branch.spectral_radius[k])
        rows.append((name, branch.name, kind, *map(float, figures)))
    return rows


def frozen_rows(name: str, glider: Glider) -> list[tuple]:
    """Frozen steady glides followed over the phases of the waves, as far as they go."""
    still = dataclasses.replace(glider, gait=dataclasses.replace(glider.gait, f_theta=0.0))
    branch = steady_branch(still, "phi_theta", *FROZEN, points=POINTS)
    return marked(name, branch) if branch.found else []


def _drawn(ax: Axes, one: Branch, values: np.ndarray) -> None:
    """Values along a branch: bold where it is stable."""
    ax.plot(one.parameter, values, color=INK, linewidth=0.7)
    stable = np.where(one.stable, values, np.nan)
    ax.plot(one.parameter, stable, color=ROLL, linewidth=2.2)
    for kind, (mark, colour) in _MARKS.items():
        at = np.flatnonzero(one.kinds == kind)
        ax.plot(one.parameter[at], values[at], mark, color=colour, markersize=2.8)
    at = np.flatnonzero(one.kinds == "start")
    ax.plot(one.parameter[at], values[at], "*", color=PITCH, markersize=6)


def _growth(ax: Axes, one: Branch) -> None:
    """Growth rates of all modes, those that turn in another colour."""
    rates, turns = np.real(one.exponents), np.abs(np.imag(one.multipliers)) > 1e-12
    for k in range(rates.shape[1]):
        ax.plot(one.parameter, rates[:, k], ".", color=INK, markersize=1.2)
        turning = np.where(turns[:, k], rates[:, k], np.nan)
        ax.plot(one.parameter, turning, ".", color=YAW, markersize=1.2)
    ax.axhline(0.0, color=FAINT, linewidth=0.6)
    ax.set_ylim(_LOWEST, min(_HIGHEST, max(1.0, 1.1 * float(rates.max()))))


def _legend(figure: Figure, branches: Sequence[Branch]) -> None:
    there = {str(kind) for one in branches for kind in one.kinds}
    handles = [
        Line2D([], [], color=ROLL, linewidth=2.2, label="stable"),
        Line2D([], [], color=INK, linewidth=0.7, label="unstable"),
    ]
    marks = {**_MARKS, "start": ("*", PITCH)}
    for kind, (mark, colour) in marks.items():
        if kind in there:
            text = _MEANING[kind]
            handles.append(
                Line2D(
                    [], [], marker=mark, color=colour, linestyle="", markersize=4, label=text
                )
            )
    for colour, text in ((INK, "mode that does not turn"), (YAW, "mode that turns")):
        handles.append(Line2D([], [], marker=".", color=colour, linestyle="", label=text))
    figure.legend(handles=handles, loc="outside lower center", ncols=5)


@style()
def diagrams(branches: Sequence[Branch]) -> Figure:
    """Glide angle, and growth rates of all modes, along branches of steady glides.

    A column for each branch; above, what is stable is bold and what is special marked.
    """
    figure = new_figure(PAGE_WIDTH, 92.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, len(branches), squeeze=False, sharex="col")
    for (above, below), one in zip(axes.T, branches, strict=True):
        _drawn(above, one, np.rad2deg(one.glide_angle))
        _growth(below, one)
        name = SYMBOLS[one.name]
        unit = _UNITS.get(one.unit, one.unit)
        below.set_xlabel(f"{name} ({unit})" if unit else name)
    axes[0, 0].set_ylabel("glide angle (°)")
    axes[1, 0].set_ylabel("growth of the modes (1/s)")
    _legend(figure, branches)
    return figure


def main() -> None:
    options = arguments(__doc__)
    points, changing, held = [], [], []
    for name, gait in GAITS.items():
        glider = glider_of(gait)
        start = steady_glide(glider)
        branches = [
            steady_branch(glider, number, *ends, start=start, points=POINTS)
            for number, ends in RANGES.items()
        ]
        branches.append(steady_branch(glider, "d_theta", *BIAS, start=start, points=POINTS))
        for branch in branches:
            points += marked(name, branch)
            save_dataset(branch.dataset(), options.out / f"{name}_{branch.name}.nc")
        changing += modes(name, glider, branches[0])
        held += frozen_rows(name, glider)
        figure = diagrams(branches)
        save_figure(figure, options.out / f"steady_branches_{name}.png")
    figures = ("path (deg)", "speed (m/s)", "turning (deg/s)", "spectral radius")
    header = ("gait", "along", "what", "value", *figures)
    write_table(options.out / "steady_branches", header, points)
    write_table(options.out / "steady_branches_frozen", header, held)
    header = ("gait", "f (Hz)", "path (deg)", "mode", "most in", "growth (1/s)", "turns (Hz)")
    write_table(options.out / "steady_branches_modes", header, changing)


if __name__ == "__main__":
    main()
