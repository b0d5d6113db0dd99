"""Two glides beside each other, such as before and after an optimisation."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..body.sections import discretise
from ..flight.dynamics import ANGLES, POSITION
from ..flight.ends import TURNS, Outcome
from ..flight.glide import Glide
from ..shape.gait import Gait
from ..shape.motion import AbstractMotion
from ._labels import axis_label, plain
from ._style import FAINT, INK, PITCH, new_figure, style
from .glide import (
    _LANDED,
    _STOPPED,
    START_MARK,
    _path,
    angle_limits,
    bodies_at,
    check_drawable,
    end_mark,
    ground_of,
)

_PAGE = 180.0  # width of two columns [mm]
_PAIR = (FAINT, PITCH)  # of the first and the second glide
_FRAMES, _PHASES = 7, 6  # snapshots along the path, and of a cycle


@style()
def before_and_after(
    before: Glide, after: Glide, names: tuple[str, str] = ("before", "after")
) -> Figure:
    """Two glides beside each other: path, attitude, and the shape of the body.

    Args:
        before, after: glides simulated with `dense=True`.
        names: of the two.

    Returns:
        A figure of a page's width (180 mm). Left: side views, to one scale, with snapshots
        of the body. Middle: yaw, pitch and roll against time. Right: the body at launch in
        its own axes from above and from the right, the head (disc) to the right, and as thin
        lines at other phases of its cycle.

    Raises:
        ValueError: a glide kept no trajectory, is a batch or is not finite.
    """
    glides, names = (before, after), (plain(names[0]), plain(names[1]))
    for glide in glides:
        check_drawable(glide)
    figure = new_figure(width=_PAGE, height=100.0)
    figure.set_layout_engine("constrained")
    left, middle, right = figure.subfigures(1, 3, width_ratios=(1.1, 1.0, 1.0))  # type: ignore
    side = left.add_subplot()
    turns = list(middle.subplots(3, 1, sharex=True))
    bodies = list(right.subplots(2, 1, sharex=True, sharey=True))
    for glide, ax, colour, name in zip(glides, bodies, _PAIR, names, strict=True):
        flying, cycle = _when(glide)
        own, there = bodies_at(glide, np.concatenate([flying, cycle]))  # one compilation
        _draw_side(side, glide, there[:_FRAMES], colour, name)
        _draw_turns(turns, glide, colour, name)
        _draw_body(ax, glide, own[_FRAMES:], colour, name)
    for ground in {ground_of(glide) for glide in glides} - {None}:
        side.axhline(ground, color=FAINT, lw=0.6, zorder=1)
    side.set_aspect("equal")
    side.set_xlabel(axis_label("y"))
    side.set_ylabel(axis_label("z"))
    limits = np.min([angle_limits(glide) for glide in glides], axis=0)
    for ax, name, limit in zip(turns, TURNS, limits, strict=True):
        _bound(ax, limit)
        ax.set_ylabel(f"{name} (°)")
    turns[0].set_xlim(0.0, 1.02 * max(float(glide.time) for glide in glides))
    turns[-1].set_xlabel("time, t (s)")
    middle.align_ylabels(turns)
    bodies[-1].set_xlabel("forward in body axes (cm)")
    where = {"loc": "outside lower center", "ncols": 5, "columnspacing": 1.4}
    figure.legend(handles=_keys(glides, names), **where)
    return figure


def _keys(glides, names) -> list[Line2D]:
    keys = []
    for glide, colour, name in zip(glides, _PAIR, names, strict=True):
        distance = float(glide.landing_point[1])
        keys.append(Line2D([], [], color=colour, label=f"{name}, {distance:.2f} m"))
    keys.append(Line2D([], [], color=INK, label="launch", **START_MARK))
    if any(glide.outcome == Outcome.LANDED for glide in glides):
        keys.append(Line2D([], [], color=INK, label="landing", **_LANDED))
    if any(glide.outcome != Outcome.LANDED for glide in glides):
        keys.append(Line2D([], [], color=INK, label="end of the glide", **_STOPPED))
    return keys


def _when(glide: Glide) -> tuple[np.ndarray, np.ndarray]:
    """Times of the snapshots [s]: over the glide, and over a cycle from launch (of a motion
    without a frequency, the first second)."""
    end = float(glide.time)
    gait = glide.glider.gait
    cycle = min(1.0 / max(float(gait.f_theta), 1e-6) if isinstance(gait, Gait) else 1.0, end)
    return np.linspace(0.0, end, _FRAMES), np.linspace(0.0, cycle, _PHASES, endpoint=False)


def _draw_side(ax: Axes, glide: Glide, there: np.ndarray, colour, name: str) -> None:
    path = _path(glide)[1][:, POSITION]
    ax.plot(path[:, 1], path[:, 2], color=colour, lw=1.2, label=name, zorder=3)
    shapes = list(there[:, 1:].transpose(0, 2, 1))
    drawn = {"colors": colour, "linewidths": 0.9, "zorder": 4, "label": f"body, {name}"}
    ax.add_collection(LineCollection(shapes, **drawn), autolim=False)
    for row, mark in ((0, START_MARK), (-1, end_mark(glide))):
        ax.plot(*path[row, 1:], color=INK if row == 0 else colour, zorder=5, **mark)
    reach = np.concatenate([there[:, 1:].transpose(0, 2, 1).reshape(-1, 2), [[0.0, 0.0]]])
    ax.update_datalim(reach)
    ax.autoscale_view()


def _draw_turns(axes: list[Axes], glide: Glide, colour, name: str) -> None:
    times, states = _path(glide)
    degrees = np.rad2deg(states[:, ANGLES])
    for ax, curve in zip(axes, degrees.T, strict=True):
        ax.plot(times, curve, color=colour, lw=1.0, label=name)
        ax.plot(times[-1], curve[-1], color=colour, clip_on=False, **end_mark(glide))


def _bound(ax: Axes, limit: float) -> None:
    """Zero, and the limit of the angles [deg] where a curve comes near it."""
    ax.axhline(0.0, color="0.85", lw=0.6, zorder=0)
    low, high = ax.get_ylim()
    for sign, most in ((1, high), (-1, -low)):
        if most > 0.8 * limit:
            ax.axhline(sign * limit, color=INK, lw=0.7, ls=(0, (4, 2)), label="limit")
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 3, 5, 6, 10]))


def _draw_body(ax: Axes, glide: Glide, body: np.ndarray, colour, name: str) -> None:
    """The body (frames, 3, n) in its own axes [cm]: from above, and below it from the right."""
    x, y, z = 100.0 * body.transpose(1, 0, 2)
    drop = 100.0 * 0.32 * float(discretise(glide.glider.body).length)
    for sideways, label, shift in ((-x, "above", 0.0), (z, "right", -drop)):
        lines = [np.column_stack([a, b + shift]) for a, b in zip(y, sideways, strict=True)]
        thin = {"colors": colour, "linewidths": 0.5, "alpha": 0.45}
        ax.add_collection(LineCollection(lines[1:], **thin))
        ax.plot(*lines[0].T, color=colour, lw=1.8, label=label)
        ax.plot(*lines[0][0], ls="", marker="o", ms=3.0, mew=0, color=INK, label="head")
        ax.annotate(
            label,
            (0.0, float(np.mean(lines[0][:, 1]))),
            xycoords=("axes fraction", "data"),
            fontsize=6.0,
            color="0.35",
            rotation=90,
            va="center",
            ha="right",
        )
    ax.set_aspect("equal")
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    said = _gait_in_words(glide.glider.gait).replace("-", "\N{MINUS SIGN}")
    ax.set_title(f"{name}\n{said}", fontsize=6.5, color=INK)


def _gait_in_words(gait: AbstractMotion) -> str:
    """The numbers of a gait in two lines; of another motion the name of its class."""
    if not isinstance(gait, Gait):
        return plain(type(gait).__name__)
    said = {
        r"\theta_m": f"{np.rad2deg(float(gait.theta_m)):.1f}°",
        r"\nu_\theta": f"{float(gait.nu_theta):.2f}",
        r"d_\psi": f"{np.rad2deg(float(gait.d_psi)):.1f}°",
        r"\psi_m": f"{np.rad2deg(float(gait.psi_m)):.1f}°",
        r"f": f"{float(gait.f_theta):.2f} Hz",
    }
    parts = [f"${symbol}$ {value}" for symbol, value in said.items()]
    return "  ".join(parts[:3]) + "\n" + "  ".join(parts[3:])
