"""Pictures of flights under control: what was told, what answered, who landed."""

from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .._lib.checks import check_choice, check_integer, check_kind
from ..body.sections import discretise
from ..control import Target, actuator_power, histories, target_of
from ..control.trace import History
from ..flight.attitude import angle_rates
from ..flight.dynamics import ANGLES, OMEGA, Flight
from ..flight.trajectory import AbstractTrajectory
from ._labels import SYMBOLS, parameter_label, plain, shown
from ._style import (
    COLUMN_WIDTH,
    FAINT,
    INK,
    PAGE_WIDTH,
    PITCH,
    ROLL,
    YAW,
    new_axes,
    new_figure,
    place,
    style,
    zero_line,
)
from .glide import START_MARK, angles, check_drawable, end_mark, side_view, top_view, widened
from .overview import entitle, legend_of

_SAMPLES = 401  # points of a curve
_TURNS = {"yaw": (0, YAW), "pitch": (1, PITCH), "roll": (2, ROLL)}
_LAWS = (YAW, PITCH, ROLL, "#CC79A7", "#56B4E9", "#E69F00", INK)
# Response: margins, room of the views, places of the curves [mm].
_LEFT, _BETWEEN, _VIEWS, _CURVES, _NAMES, _TOP, _BOTTOM = (
    12.0,
    12.5,
    88.0,
    106.0,
    12.0,
    8.0,
    9.0,
)
_ROW, _GAP = 25.0, 5.5


@style()
def response(flight: AbstractTrajectory, policy: Any = None) -> Figure:
    """A flight under control on one page: path, angles, inputs told and reached, power.

    Args:
        flight: one that was traced; see `retrace`.
        policy: what steered; its heading is drawn among the angles, its points in the view
            from above.

    Returns:
        A figure of two columns' width (180 mm): the path from the side and from above on the
        left; on the right angles, every input that was set, dashed what was told, with the
        limits of its range, and the power of the actuators.

    Raises:
        ValueError: the flight was not traced, is a batch or is not finite.
    """
    times, told = _told(flight)
    figure, rows = new_figure(), 2 + len(told)
    names = "side", "top", "angles", *(one.name for one in told), "power"
    side, top, turns, *inputs, power = (
        figure.add_axes((0, 0, 1, 1), label=name) for name in names
    )
    side_view(flight, side)
    top_view(flight, top)
    target = target_of(policy)
    _draw_points(top, target)
    angles(flight, turns)
    _draw_heading(turns, target)
    for ax, one in zip(inputs, told, strict=True):
        _draw_input(ax, times, one)
    _draw_power(power, flight, times)
    height = _TOP + rows * (_ROW + _GAP) - _GAP + _BOTTOM
    figure.set_size_inches(PAGE_WIDTH / 25.4, height / 25.4)
    _place_views(figure, flight, side, top, height)
    curves = turns, *inputs, power
    width = PAGE_WIDTH - _CURVES - _NAMES
    for k, ax in enumerate(reversed(curves)):
        place(figure, ax, _CURVES, _BOTTOM + k * (_ROW + _GAP), width, _ROW)
        ax.yaxis.set_label_coords(-8.5 / width, 0.5)
        ax.set_xlim(times[0], times[-1])
        if k:
            ax.set_xlabel("")
            ax.tick_params(labelbottom=False)
    said = f"{flight.ending.capitalize()} after {float(flight.time):.2f} s"
    entitle(figure, f"{said}, path length {float(flight.path_length):.2f} m")
    return figure


def _told(flight: AbstractTrajectory) -> tuple[np.ndarray, list[History]]:
    """Times [s], and the inputs that were set at them."""
    check_kind("flight", flight, AbstractTrajectory)
    check_drawable(flight)
    times = np.asarray(flight.sample_times(_SAMPLES))
    told = histories(flight, times)
    if not told:
        raise ValueError("this flight was not under control: trace one with `retrace`")
    return times, told


def _draw_heading(ax: Axes, target: Target) -> None:
    if target.heading is None:
        return
    wanted = np.rad2deg(target.heading)
    ax.axhline(wanted, color=YAW, lw=0.8, ls=(0, (4, 2)), label="heading", zorder=1)
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, wanted - 3), max(high, wanted + 3))
    offset: Any = {"xytext": (3, 1), "textcoords": "offset points", "va": "bottom"}
    ax.annotate("heading", (ax.get_xlim()[0], wanted), color=YAW, fontsize=6.5, **offset)


def _draw_points(ax: Axes, target: Target) -> None:
    if target.points is None:
        return
    across, along = target.points.T
    mark: dict[str, Any] = {"marker": "P", "ms": 4, "mew": 0, "ls": "", "color": ROLL}
    ax.plot(across, along, label="points", zorder=6, **mark)
    for set_limits, limits, values in (
        (ax.set_xlim, ax.get_xlim(), across),
        (ax.set_ylim, ax.get_ylim(), along),
    ):
        set_limits(min(limits[0], values.min() - 2), max(limits[1], values.max() + 2))


def _draw_input(ax: Axes, times: np.ndarray, one: History) -> None:
    """What an input was told and where its actuator was, between its limits."""
    for limit in (one.low, one.high):
        ax.axhline(limit, color=FAINT, lw=0.6, ls=(0, (1, 2)), label="limit", zorder=0)
    look: dict[str, Any] = {"color": FAINT, "lw": 0.8, "drawstyle": "steps-post"}
    ax.plot(times, one.told, label="told", zorder=2, **look)
    ax.plot(times, one.position, color=INK, label="reached", zorder=3)
    most = max(abs(one.low), abs(one.high))
    room = 0.06 * (one.high - one.low) if most < 1e3 else 0.0
    ax.set_ylim(one.low - room, one.high + room)
    offset: Any = {"xytext": (5, 0), "textcoords": "offset points", "annotation_clip": False}
    step = 0.07 * (one.high - one.low)
    first, last = one.position[-1], one.told[-1]
    apart = max(0.0, 2 * step - abs(last - first)) / 2 * (1 if last >= first else -1)
    names = ("reached", INK, first - apart), ("told", "0.45", last + apart)
    for name, colour, where in names:
        ax.annotate(name, (times[-1], where), color=colour, va="center", **offset)
    ax.set_ylabel(f"{SYMBOLS[one.name]} ({shown(one.unit)})" if one.unit else SYMBOLS[one.name])


@eqx.filter_jit
def _watts(glider, phase, times, states):
    flight = Flight(glider, discretise(glider.body), phase)
    return jax.vmap(lambda t, y: actuator_power(t, y, flight))(times, states)


def _draw_power(ax: Axes, flight: AbstractTrajectory, times: np.ndarray) -> None:
    """Power of the actuators, and in words its mean."""
    watts = 1e3 * np.asarray(
        _watts(flight.glider, flight.phase, jnp.asarray(times), flight.at(times))
    )
    zero_line(ax)
    ax.plot(times, watts, color=INK, lw=0.8, label="power")
    mean = float(np.mean(watts))
    ax.axhline(mean, color=PITCH, lw=0.8, label="mean")
    offset: Any = {"xytext": (5, 0), "textcoords": "offset points", "annotation_clip": False}
    ax.annotate("mean", (times[-1], mean), color=PITCH, va="center", **offset)
    ax.set_ylabel("power (mW)")
    ax.set_xlabel("time, t (s)")


def _place_views(figure: Figure, flight, side: Axes, top: Axes, height: float) -> None:
    """Both views at one scale beside each other, the legend below them."""
    (forward, high), (across, along) = (
        (float(np.ptp(ax.get_xlim())), float(np.ptp(ax.get_ylim()))) for ax in (side, top)
    )
    width, tall = _VIEWS - _LEFT - _BETWEEN, height - _TOP - _BOTTOM - 2 * _BOTTOM
    across = max(across, 0.25 * forward)
    scale = min(width / (forward + across), tall / max(high, along))  # mm/m
    across = width / scale - forward
    top.set_xlim(widened(top.get_xlim(), across))
    up = height - _TOP
    place(figure, side, _LEFT, up - scale * high, scale * forward, scale * high)
    left = _LEFT + scale * forward + _BETWEEN
    place(figure, top, left, up - scale * along, scale * across, scale * along)
    where = (_LEFT / PAGE_WIDTH, 1.5 / height)
    legend_of(figure, flight, loc="lower left", bbox_to_anchor=where, ncols=3)


@style()
def phase_portrait(
    flight: AbstractTrajectory, turns: Sequence[str] = ("pitch", "roll")
) -> Figure:
    """Angles against their rates, with a dot once a cycle of the waves.

    The dots are the return map: towards a steady glide they close in on one place.

    Args:
        flight: one that kept its path, such as `retrace` gives.
        turns: which of yaw, pitch and roll.

    Returns:
        A figure of one column's width (90 mm), an axes for each: angle [deg] across, its rate
        [deg/s] up; dots darken with time.

    Raises:
        ValueError: another turn, or the flight kept no trajectory, is a batch or not finite.
    """
    check_kind("flight", flight, AbstractTrajectory)
    check_drawable(flight)
    if not turns:
        raise ValueError("turns is empty: name yaw, pitch or roll")
    for name in turns:
        check_choice("turns", name, tuple(_TURNS))
    times = np.asarray(flight.sample_times(4 * _SAMPLES))
    portrait, dots = _portrait(flight, times), _portrait(flight, _cycles(flight, times))
    figure = new_figure(COLUMN_WIDTH, 48.0 if len(turns) > 1 else 62.0)
    figure.set_layout_engine("constrained")
    for ax, name in zip(np.ravel(figure.subplots(1, len(turns))), turns, strict=True):
        row, colour = _TURNS[name]
        angle, rate = portrait[:, :, row]
        ax.plot(angle, rate, color="0.75", lw=0.5, label="path", zorder=1)
        ax.plot(angle[0], rate[0], color=colour, zorder=4, label="start", **START_MARK)
        ax.plot(angle[-1], rate[-1], color=colour, zorder=4, label="end", **end_mark(flight))
        shade = np.linspace(0.25, 1.0, dots.shape[1])
        look: dict[str, Any] = {
            "color": colour,
            "s": 9,
            "lw": 0,
            "zorder": 3,
            "label": "cycles",
        }
        ax.plot(*dots[:, :, row], color=colour, lw=0.4, zorder=2, label="return map")
        ax.scatter(*dots[:, :, row], alpha=shade, **look)
        ax.set_xlabel(f"{name} (°)")
        ax.set_ylabel(f"rate of {name} (°/s)")
    return figure


def _portrait(flight: AbstractTrajectory, times: np.ndarray) -> np.ndarray:
    """Angles [deg] and their rates [deg/s], (2, T, 3)."""
    states = flight.at(times)
    rates = jax.vmap(angle_rates)(states[:, ANGLES], states[:, OMEGA])
    return np.rad2deg(np.stack([np.asarray(states[:, ANGLES]), np.asarray(rates)]))


def _cycles(flight: AbstractTrajectory, times: np.ndarray) -> np.ndarray:
    """Times at which a cycle of the waves begins [s]: of the frequency at launch."""
    gait: Any = flight.glider.gait
    drive = getattr(gait, "drive", None)
    frequency = gait.f_theta if drive is None else drive.initial[-1]
    if not float(frequency) > 0:
        raise ValueError("f_theta = 0 Hz is not allowed: the dots are once a cycle")
    return np.arange(times[0], times[-1], 1 / float(frequency))


@style()
def share_landed(data: xr.Dataset, by: str, ax: Axes | None = None, *, bins: int = 8) -> Axes:
    """Share of the flights that landed, against what was random in them.

    Args:
        data: random flights, of one law or several; see `evaluate_policy`.
        by: which number that was drawn, such as "launch.speed".
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        bins: of that number, as many flights in each, 1 to 100.

    Returns:
        The axes: the number across, the share [%] up, a curve for every law, with the bounds
        within which nineteen of twenty such shares are.

    Raises:
        ValueError: there is no such number.
    """
    check_integer("bins", bins, 1, 100)
    drawn = drawn_names(data)
    if by not in drawn:
        raise ValueError(f"by = {by!r} was not drawn: known are {', '.join(drawn) or 'none'}")
    ax = new_axes(height=62.0) if ax is None else ax
    laws = [str(name) for name in data["law"].values] if "law" in data.dims else [""]
    for k, law in enumerate(laws):
        one = data.sel(law=law) if law else data
        number = np.asarray(one[by].values, float)
        order = np.array_split(np.argsort(number), min(bins, number.size))
        middle = [number[own].mean() for own in order]
        share = np.array([_share(one["landed"].values[own]) for own in order])
        low, mean, high = 100 * share.T
        colour = _LAWS[k % len(_LAWS)]
        ax.fill_between(middle, low, high, color=colour, alpha=0.15, lw=0)
        total = 100 * float(np.mean(one["landed"].values))
        label = f"{plain(law)}, {total:.3g} % in all" if law else f"{total:.3g} % in all"
        ax.plot(middle, mean, "o-", ms=2.6, color=colour, label=label)
    ax.set_ylim(-4, 104)
    ax.set_xlabel(parameter_label(by, str(data[by].attrs.get("units", ""))))
    ax.set_ylabel("flights that land (%)")
    ax.legend(loc="best")
    return ax


def drawn_names(data: xr.Dataset) -> list[str]:
    """Names of the numbers that were drawn for random flights."""
    known = {"outcome", "landed", "time", "position", "angles"}
    return [str(name) for name in data.data_vars if name not in known]


def _share(landed: np.ndarray) -> tuple[float, float, float]:
    """A share and its bounds, by Wilson's rule, of nineteen cases in twenty."""
    n, share, z = landed.size, float(np.mean(landed)), 1.96
    middle = (share + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(share * (1 - share) / n + z**2 / (4 * n**2))
    return max(middle - half, 0.0), share, min(middle + half, 1.0)
