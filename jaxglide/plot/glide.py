"""Pictures of one glide: where it went, how the body moved, how it was oriented."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from .._lib.checks import check_integer, check_range
from ..body.sections import discretise, surface_nodes
from ..flight.dynamics import ANGLES, POSITION
from ..flight.ends import AngleLimit, Ground, Outcome
from ..flight.trajectory import AbstractTrajectory, reconstruct
from ._labels import axis_label
from ._style import (
    BODY,
    COLUMN_WIDTH,
    FAINT,
    HEAD,
    INK,
    PITCH,
    ROLL,
    YAW,
    new_axes,
    new_figure,
    place,
    style,
)

Frames = int | Sequence[float] | np.ndarray

_SAMPLES = 400  # points of a path or a curve
_NEAR_LIMIT = 60.0  # deg; beyond this the limit of an angle is drawn
_HEAD = {"ls": "", "marker": "o", "ms": 1.7, "mew": 0.0, "color": HEAD}
_LAUNCH = {"ls": "", "marker": "o", "ms": 2.6, "mew": 0.6, "mfc": "white"}
_LANDED = {"ls": "", "marker": "s", "ms": 2.6, "mew": 0.0}
_STOPPED = {"ls": "", "marker": "X", "ms": 3.6, "mew": 0.0}


def _check_drawable(glide: AbstractTrajectory) -> None:
    """Refuse what has no picture; `Glide.at` refuses a glide without a trajectory."""
    if glide.time.ndim:
        raise ValueError(
            f"this is a batch of glides of shape {glide.time.shape}: pass one glide"
        )
    if not np.isfinite(np.append(glide.state, glide.time)).all():
        raise ValueError("this glide's state is not finite: there is nothing to draw")


def _path(glide: AbstractTrajectory) -> tuple[np.ndarray, np.ndarray]:
    """Times [s] and states along the glide, (T,) and (T, 13); the last is the end state."""
    times = glide.sample_times(_SAMPLES)
    states = np.array(glide.at(times))
    states[-1] = glide.state
    return np.asarray(times), states


def _bodies(glide: AbstractTrajectory, frames: Frames) -> np.ndarray:
    """Positions of the nodes in inertial axes [m] at the frames, (F, 3, n)."""
    begin, end = float(glide.start_time), float(glide.time)
    if np.ndim(frames) == 0:
        check_integer("frames", frames, 0, 1000)
        times = np.linspace(begin, end, int(frames))  # type: ignore
    else:
        times = np.asarray(frames, float)
        check_range("frames", times, "s", begin, end)
        if times.ndim != 1:
            raise ValueError(f"frames has shape {times.shape}: it must be a number or (F,)")
    if times.size == 0:
        return np.zeros((0, 3, 1))
    return bodies_at(glide, times)[1]


def bodies_at(glide: AbstractTrajectory, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of the nodes with area, front to rear, in body and inertial axes [m],
    (F, 3, n)."""
    now = reconstruct(glide, times)
    nodes = surface_nodes(discretise(glide.glider.body))
    own = np.asarray(now.body.position)[:, :, nodes]
    centre = np.asarray(glide.at(times))[:, POSITION, None]
    return own, np.einsum("fji,fjn->fin", np.asarray(now.R_BI), own) + centre


def _widened(limits: tuple[float, float], least: float) -> tuple[float, float]:
    """The limits, moved to be at least `least` apart."""
    more = max(0.0, least - (limits[1] - limits[0])) / 2
    return limits[0] - more, limits[1] + more


def _limits(values: np.ndarray, pad: float, least: float) -> tuple[float, float]:
    """Limits around values, with a margin, at least `least` apart."""
    return _widened((float(values.min()) - pad, float(values.max()) + pad), least)


def _end_mark(glide: AbstractTrajectory) -> dict:
    return _LANDED if glide.outcome == Outcome.LANDED else _STOPPED


def _end_word(glide: AbstractTrajectory) -> str:
    return "landing" if glide.outcome == Outcome.LANDED else "end of the glide"


def _view(
    glide: AbstractTrajectory,
    ax: Axes,
    frames: Frames,
    across: int,
    up: int,
    ground: float | None,
) -> Axes:
    """Draw the path and the body on two of the axes x (0), y (1), z (2), to scale."""
    path, bodies = _path(glide)[1][:, POSITION], _bodies(glide, frames)
    ax.plot(path[:, across], path[:, up], color=FAINT, lw=0.7, zorder=2, label="path")
    shapes = list(bodies[:, [across, up]].transpose(0, 2, 1))
    ax.add_collection(
        LineCollection(shapes, colors=BODY, linewidths=0.8, zorder=3, label="body"),
        autolim=False,
    )
    heads = bodies[:, :, 0]
    ax.plot(heads[:, across], heads[:, up], zorder=4, label="head", **_HEAD)
    for row, mark, label in ((0, _LAUNCH, "launch"), (-1, _end_mark(glide), _end_word(glide))):
        ax.plot(path[row, across], path[row, up], color=INK, zorder=5, label=label, **mark)
    drawn = np.concatenate([path, *bodies.transpose(0, 2, 1)])
    length = float(discretise(glide.glider.body).length)
    pad = max(0.2 * length, 0.02 * float(np.ptp(drawn, axis=0).max()))
    if ground is not None:
        drawn = np.append(drawn, [[*path[-1, :2], ground]], axis=0)
    ax.set_xlim(_limits(drawn[:, across], pad, 1.6 * length))
    ax.set_ylim(_limits(drawn[:, up], pad, 1.6 * length))
    ax.set_aspect("equal")
    return ax


@style()
def side_view(glide: AbstractTrajectory, ax: Axes | None = None, *, frames: Frames = 9) -> Axes:
    """The glide from its right side: height against forward distance, to scale.

    Args:
        glide: one glide, simulated with `dense=True`.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        frames: how many snapshots of the body, equally spaced in time from launch to the
            end, 0 to 1000; or their times [s], (F,), within the glide.

    Returns:
        The axes: y [m] across, z [m] up, and the ground.

    Raises:
        ValueError: the glide kept no trajectory, is a batch or is not finite, or a frame
            is out of range.
    """
    _check_drawable(glide)
    ax = new_axes(height=130.0) if ax is None else ax
    ground = ground_of(glide)
    _view(glide, ax, frames, across=1, up=2, ground=ground)
    if ground is not None:
        ax.axhspan(ax.get_ylim()[0], ground, color="0.9", lw=0, zorder=0, label="ground")
        ax.axhline(ground, color=FAINT, lw=0.6, zorder=1)
    ax.set_xlabel(axis_label("y"))
    ax.set_ylabel(axis_label("z"))
    return ax


@style()
def top_view(glide: AbstractTrajectory, ax: Axes | None = None, *, frames: Frames = 9) -> Axes:
    """The glide from above: forward distance against sideways distance, to scale.

    Args:
        glide: one glide, simulated with `dense=True`.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        frames: as in `side_view`.

    Returns:
        The axes: x [m] across, right is right of the launch direction; y [m] up.

    Raises:
        ValueError: as `side_view`.
    """
    _check_drawable(glide)
    ax = new_axes(height=130.0) if ax is None else ax
    _view(glide, ax, frames, across=0, up=1, ground=None)
    ax.set_xlabel(axis_label("x"))
    ax.set_ylabel(axis_label("y"))
    return ax


def _spread(values: Sequence[float], gap: float) -> np.ndarray:
    """Three or so numbers moved apart to at least `gap`, in the same order."""
    order = np.argsort(values)
    placed = np.array(values, float)[order]
    for _ in range(20):
        overlap = np.maximum(0.0, gap - np.diff(placed)) / 2
        placed[:-1] -= overlap
        placed[1:] += overlap
    return placed[np.argsort(order)]


def angle_limit(glide: AbstractTrajectory) -> float:
    """The least limit of the angles that would have ended a glide [deg], or infinity."""
    limits = [float(e.limit) for e in glide.settings.ends if isinstance(e, AngleLimit)]
    return float(np.rad2deg(min(limits, default=np.inf)))


def ground_of(glide: AbstractTrajectory) -> float | None:
    """Height of the ground that a glide would have ended on [m]; None if there was none."""
    grounds = [float(e.level) for e in glide.settings.ends if isinstance(e, Ground)]
    return max(grounds, default=None)


def _draw_limits(ax: Axes, first: float, degrees: np.ndarray, limit: float) -> list[float]:
    """Draw the limit of the angles on each side that a curve comes near, named at the first
    time; those drawn [deg]."""
    drawn = []
    if not np.isfinite(limit):
        return drawn
    for sign, most in ((1, degrees.max()), (-1, -degrees.min())):
        if most > _NEAR_LIMIT:
            drawn.append(sign * limit)
            ax.axhline(drawn[-1], color=INK, lw=0.7, ls=(0, (4, 2)), label="limit")
            ax.annotate(
                f"limit {drawn[-1]:+.0f}°".replace("-", "\N{MINUS SIGN}"),
                (first, drawn[-1]),
                xytext=(3, -2 * sign),
                textcoords="offset points",
                va="top" if sign > 0 else "bottom",
                fontsize=6.5,
            )
    return drawn


@style()
def angles(glide: AbstractTrajectory, ax: Axes | None = None) -> Axes:
    """Yaw, pitch and roll [deg] against time, with their limit if one comes near it.

    Args:
        glide: one glide, simulated with `dense=True`.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).

    Returns:
        The axes: time [s] across, angles [deg] up.

    Raises:
        ValueError: the glide kept no trajectory, is a batch or is not finite.
    """
    _check_drawable(glide)
    ax = new_axes(height=50.0) if ax is None else ax
    times, states = _path(glide)
    degrees = np.rad2deg(states[:, ANGLES])
    ax.axhline(0.0, color="0.85", lw=0.6, zorder=0)
    shown = np.append(
        degrees.ravel(), [0.0, *_draw_limits(ax, times[0], degrees, angle_limit(glide))]
    )
    low, high = _limits(shown, 0.06 * float(np.ptp(shown)), 20.0)
    heights = _spread(list(degrees[-1]), 0.11 * (high - low))
    colours = {"yaw": YAW, "pitch": PITCH, "roll": ROLL}
    for column, (name, colour) in enumerate(colours.items()):
        curve = degrees[:, column]
        ax.plot(times, curve, color=colour, label=name)
        for row, mark in ((0, _LAUNCH), (-1, _end_mark(glide))):
            ax.plot(times[row], curve[row], color=colour, clip_on=False, **mark)
        end = times[-1], heights[column]
        offset = {"xytext": (5, 0), "textcoords": "offset points", "annotation_clip": False}
        ax.annotate(name, end, color=colour, va="center", **offset)
    ax.set_xlim(times[0], max(times[-1], times[0] + 1e-6))
    ax.set_ylim(low, high)
    step = next(step for step in (5, 10, 30) if high - low < 6 * step or step == 30)
    ax.yaxis.set_major_locator(MultipleLocator(step))
    ax.set_xlabel("time, t (s)")
    ax.set_ylabel("angle (°)")
    return ax


# Margins of the overview and height of its lowest axes [mm].
_LEFT, _BETWEEN, _RIGHT, _TITLE, _LABEL, _ANGLES = 12.0, 12.5, 2.5, 8.0, 9.0, 32.0
_LEAST, _TALLEST = 15.0, 100.0  # of the views [mm]
_LEGEND_COLUMN, _LEGEND_ROW = 23.0, 5.0  # heights of the legend [mm]


def _legend(figure: Figure, glide: AbstractTrajectory, **where) -> None:
    """What the lines and marks of both views mean."""
    handles = [
        Line2D([], [], color=FAINT, lw=0.7, label="centre of mass"),
        Line2D([], [], color=BODY, lw=0.8, label="body"),
        Line2D([], [], label="head", **_HEAD),
        Line2D([], [], color=INK, label="launch", **_LAUNCH),
        Line2D([], [], color=INK, label=_end_word(glide), **_end_mark(glide)),
    ]
    lengths = {"handlelength": 1.2, "handletextpad": 0.4, "columnspacing": 1.2}
    figure.legend(handles=handles, borderaxespad=0, borderpad=0, **lengths, **where)


def _lay_out(
    figure: Figure, glide: AbstractTrajectory, side: Axes, top: Axes, lower: Axes
) -> None:
    """Both views at one scale next to each other, the angles below them, and the legend."""
    (forward, high), (across, along) = (
        (float(np.ptp(ax.get_xlim())), float(np.ptp(ax.get_ylim()))) for ax in (side, top)
    )
    width = COLUMN_WIDTH - _LEFT - _BETWEEN - _RIGHT  # of both views together
    scale = min(  # mm/m
        width / (forward + across),
        (width - _LEAST) / max(forward, across),
        _TALLEST / max(high, along),
    )
    # Room that is left goes to the top view.
    forward, along = max(forward, _LEAST / scale), max(along, _LEAST / scale)
    across = width / scale - forward
    side.set_xlim(_widened(side.get_xlim(), forward))
    top.set_xlim(_widened(top.get_xlim(), across))
    top.set_ylim(_widened(top.get_ylim(), along))
    tall, base = scale * max(high, along), 2 * _LABEL + _ANGLES + 2.0
    # The legend goes below the top view if there is room, else between title and views.
    below = scale * (high - along) > _LABEL + _LEGEND_COLUMN
    height = base + tall + (0.0 if below else _LEGEND_ROW) + _TITLE
    figure.set_size_inches(COLUMN_WIDTH / 25.4, height / 25.4)
    place(figure, side, _LEFT, base + tall - scale * high, scale * forward, scale * high)
    left = _LEFT + scale * forward + _BETWEEN
    place(figure, top, left, base + tall - scale * along, scale * across, scale * along)
    place(figure, lower, _LEFT, _LABEL, COLUMN_WIDTH - _LEFT - 11.0, _ANGLES)
    for ax in (side, lower):  # their labels one below the other
        ax.yaxis.set_label_coords(-7.4 / (ax.get_position().width * COLUMN_WIDTH), 0.5)
    if below:
        corner = (1 - _RIGHT / COLUMN_WIDTH, base / height)
        _legend(figure, glide, loc="lower right", bbox_to_anchor=corner)
    else:
        above = (0.5, 1 - 7.0 / height)
        _legend(figure, glide, loc="upper center", bbox_to_anchor=above, ncols=5)


@style()
def glide_overview(glide: AbstractTrajectory, frames: Frames = 9) -> Figure:
    """A glide on one page: from the side, from above, and its angles against time.

    Both views have the same scale, and the body in them too. The title says how the glide
    ended, when, and after how much horizontal path.

    Args:
        glide: one glide, simulated with `dense=True`.
        frames: snapshots of the body, as in `side_view`.

    Returns:
        A figure of one column's width (90 mm) with three axes: side view, top view, angles.

    Raises:
        ValueError: as `side_view`.
    """
    _check_drawable(glide)
    figure = new_figure()
    side, top, lower = (
        figure.add_axes((0, 0, 1, 1), label=name) for name in ("side", "top", "angles")
    )
    side_view(glide, side, frames=frames)
    top_view(glide, top, frames=frames)
    angles(glide, lower)
    _lay_out(figure, glide, side, top, lower)
    figure.suptitle(
        f"{glide.ending.capitalize()} after {float(glide.time):.2f} s, "
        f"path length {float(glide.path_length):.2f} m",
        y=1 - 2.0 / (25.4 * figure.get_size_inches()[1]),
        va="top",
        fontsize=7.5,
    )
    return figure
