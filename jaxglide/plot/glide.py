"""Views of one glide, and its angles and speeds in time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.ticker import MultipleLocator

from .._lib.checks import check_integer, check_range
from ..body.sections import discretise, surface_nodes
from ..flight.dynamics import ANGLES, POSITION, VELOCITY
from ..flight.ends import TURNS, AngleLimit, Ground, Outcome
from ..flight.glide import Glide
from ..flight.trajectory import AbstractTrajectory, reconstruct
from ._labels import axis_label
from ._style import (
    BODY,
    FAINT,
    HEAD,
    INK,
    PITCH,
    ROLL,
    YAW,
    new_axes,
    style,
)

Frames = int | Sequence[float] | np.ndarray

_SAMPLES = 400  # points of a path or a curve
_NEAR_LIMIT = 60.0  # deg; beyond this the limit of an angle is drawn
HEAD_MARK = {"ls": "", "marker": "o", "ms": 1.7, "mew": 0.0, "color": HEAD}
START_MARK = {"ls": "", "marker": "o", "ms": 2.6, "mew": 0.6, "mfc": "white"}
_LANDED = {"ls": "", "marker": "s", "ms": 2.6, "mew": 0.0}
_STOPPED = {"ls": "", "marker": "X", "ms": 3.6, "mew": 0.0}


def check_drawable(glide: AbstractTrajectory) -> None:
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


def widened(limits: tuple[float, float], least: float) -> tuple[float, float]:
    """The limits, moved to be at least `least` apart."""
    more = max(0.0, least - (limits[1] - limits[0])) / 2
    return limits[0] - more, limits[1] + more


def _limits(values: np.ndarray, pad: float, least: float) -> tuple[float, float]:
    """Limits around values, with a margin, at least `least` apart."""
    return widened((float(values.min()) - pad, float(values.max()) + pad), least)


def _whole(glide: AbstractTrajectory) -> bool:
    """Whether it is a piece of flight that was to be no longer."""
    return not isinstance(glide, Glide) and int(glide.outcome) == Outcome.OUT_OF_TIME


def start_word(glide: AbstractTrajectory) -> str:
    return "launch" if isinstance(glide, Glide) else "start"


def end_mark(glide: AbstractTrajectory) -> dict:
    return _LANDED if glide.outcome == Outcome.LANDED or _whole(glide) else _STOPPED


def end_word(glide: AbstractTrajectory) -> str:
    if _whole(glide):
        return "end"
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
    ax.plot(heads[:, across], heads[:, up], zorder=4, label="head", **HEAD_MARK)
    ends = (0, START_MARK, start_word(glide)), (-1, end_mark(glide), end_word(glide))
    for row, mark, label in ends:
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
    check_drawable(glide)
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
    check_drawable(glide)
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


def angle_limits(glide: AbstractTrajectory) -> np.ndarray:
    """Limits of yaw, pitch and roll that would have ended a glide [deg], or infinity, (3,)."""
    least = np.full(len(TURNS), np.inf)
    for end in glide.settings.ends:
        if isinstance(end, AngleLimit):
            limited = np.isin(TURNS, end.angles)
            least[limited] = np.minimum(least[limited], float(end.limit))
    return np.rad2deg(least)


def ground_of(glide: AbstractTrajectory) -> float | None:
    """Height of the ground that a glide would have ended on [m]; None if there was none."""
    grounds = [float(e.level) for e in glide.settings.ends if isinstance(e, Ground)]
    return max(grounds, default=None)


def _draw_limits(ax: Axes, first: float, degrees: np.ndarray, limits) -> list[float]:
    """Draw the least limit (3,) on each side that a curve with one comes near, named at the
    first time; those drawn [deg]."""
    drawn = []
    for sign in (1, -1):
        near = np.isfinite(limits) & ((sign * degrees).max(axis=0) > _NEAR_LIMIT)
        if near.any():
            drawn.append(sign * limits[near].min())
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
    check_drawable(glide)
    ax = new_axes(height=50.0) if ax is None else ax
    times, states = _path(glide)
    degrees = np.rad2deg(states[:, ANGLES])
    ax.axhline(0.0, color="0.85", lw=0.6, zorder=0)
    limits = _draw_limits(ax, times[0], degrees, angle_limits(glide))
    curves = dict(zip(("yaw", "pitch", "roll"), degrees.T, strict=True))
    low, high = _curves(ax, glide, times, curves, [0.0, *limits], 20.0)
    step = next(step for step in (5, 10, 20, 30) if high - low < 6 * step or step == 30)
    ax.yaxis.set_major_locator(MultipleLocator(step))
    ax.set_ylabel("angle (°)")
    return ax


@style()
def speeds(glide: AbstractTrajectory, ax: Axes | None = None) -> Axes:
    """Speed over the ground against time, and its parts: forward, horizontally, and sinking.

    Args:
        glide: one glide, simulated with `dense=True`.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).

    Returns:
        The axes: time [s] across, speeds [m/s] up.

    Raises:
        ValueError: as `angles`.
    """
    check_drawable(glide)
    ax = new_axes(height=50.0) if ax is None else ax
    times, states = _path(glide)
    x, y, z = states[:, VELOCITY].T
    curves = {"speed": np.sqrt(x**2 + y**2 + z**2), "forward": np.hypot(x, y), "sinking": -z}
    _curves(ax, glide, times, curves, [], 0.5)
    ax.set_ylabel("speed (m/s)")
    return ax


def _curves(
    ax: Axes, glide: AbstractTrajectory, times, curves: dict, also: list[float], least: float
) -> tuple[float, float]:
    """Three curves against time, named at their ends; the axes' limits, which hold `also`."""
    shown = np.append(np.concatenate(list(curves.values())), also)
    low, high = _limits(shown, 0.06 * float(np.ptp(shown)), least)
    heights = _spread([curve[-1] for curve in curves.values()], 0.11 * (high - low))
    colours = YAW, PITCH, ROLL
    for (name, curve), colour, height in zip(curves.items(), colours, heights, strict=True):
        ax.plot(times, curve, color=colour, label=name)
        for row, mark in ((0, START_MARK), (-1, end_mark(glide))):
            ax.plot(times[row], curve[row], color=colour, clip_on=False, **mark)
        offset = {"xytext": (5, 0), "textcoords": "offset points", "annotation_clip": False}
        ax.annotate(name, (times[-1], height), color=colour, va="center", **offset)
    ax.set_xlim(times[0], max(times[-1], times[0] + 1e-6))
    ax.set_ylim(low, high)
    ax.set_xlabel("time, t (s)")
    return low, high
