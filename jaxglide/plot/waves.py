"""Pictures of the waves of bending along the body (the paper's figures 2 a, c, d)."""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .._lib.checks import check_choice, check_range
from .._lib.types import ArrayLike
from ..body.sections import AbstractBody, discretise
from ..body.snake import Snake
from ..flight.dynamics import RIGID, observation
from ..flight.trajectory import AbstractTrajectory
from ..shape.gait import Gait
from ..shape.motion import AbstractMotion, at_rest
from ._style import PITCH, YAW, new_axes, new_figure, style, zero_line

_WAVES = {"theta": (r"horizontal, $\theta$", YAW), "psi": (r"vertical, $\psi$", PITCH)}
_POINTS, _TIMES = 201, 301  # of a line along the body, and of a map in time
_BODY = "arc length, $s$ (fraction of SVL)"


@eqx.filter_jit
def _bent(motion: AbstractMotion, neck_fraction, fraction, times, phases, states, seen):
    """Angles theta and psi [rad], (2, T, S), at times and phases, (T,), in a flight."""

    def at(time, phase, own, observed):
        wave, _ = motion.bending(fraction, neck_fraction, time, phase, own, observed)
        return jnp.stack([wave.theta, wave.psi])

    return jnp.swapaxes(jax.vmap(at)(times, phases, states, seen), 0, 1)


def _in_degrees(angles) -> dict[str, np.ndarray]:
    return {name: np.rad2deg(a) for name, a in zip(_WAVES, np.asarray(angles), strict=True)}


def angles_along(
    motion: AbstractMotion, body: AbstractBody, phases, times: ArrayLike = 0.0
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Bending angles along the body, as a motion without states of its own makes them.

    Args:
        motion, body: whose bending; of the body only the neck matters.
        phases: launch phases [rad], (P,).
        times: since launch [s], (P,); by default at launch.

    Returns:
        Arc length (fraction of the length, (S,)), and "theta" and "psi" [deg], each (P, S).
    """
    fraction = jnp.linspace(0.0, 1.0, _POINTS)
    phases, times = jnp.broadcast_arrays(*(jnp.asarray(v, float) for v in (phases, times)))
    own, seen = jax.vmap(lambda phase: (motion.start(phase), at_rest()))(phases)
    neck = discretise(body).neck_fraction
    angles = _bent(motion, neck, fraction, times, phases, own, seen)
    return np.asarray(fraction), _in_degrees(angles)


def angles_in_flight(
    glide: AbstractTrajectory, times
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Bending angles along the body in a flight, whatever drives it.

    Args:
        glide: simulated with `dense=True`.
        times: [s], (T,).

    Returns:
        As `angles_along`, each (T, S).
    """
    motion, states = glide.glider.gait, glide.at(times)
    fraction = jnp.linspace(0.0, 1.0, _POINTS)
    count = motion.start(glide.phase).shape[0]
    own, seen = states[:, RIGID : RIGID + count], jax.vmap(observation)(states)
    neck = discretise(glide.glider.body).neck_fraction
    phases = jnp.full(len(times), glide.phase)
    angles = _bent(motion, neck, fraction, jnp.asarray(times), phases, own, seen)
    return np.asarray(fraction), _in_degrees(angles)


@style()
def bending_waves(
    gait: AbstractMotion,
    snake: AbstractBody | None = None,
    ax: Axes | None = None,
    *,
    phases: Sequence[float] | np.ndarray = (0.0,),
) -> Axes:
    """Horizontal and vertical bending angle along the body (2a).

    Args:
        gait: whose waves; of a motion that changes, as it starts.
        snake: whose body; by default a snake of 70 cm. Only its neck matters.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        phases: of the horizontal wave [rad], (P,), one line each and wave; the first is
            drawn strongest. Snapshots of one cycle are phases falling by 2 pi.

    Returns:
        The axes: arc length (fraction of SVL) across, angle [deg] up.

    Raises:
        ValueError: no phase, or one that is not finite.
    """
    phases = np.atleast_1d(np.asarray(phases, float))
    check_range("phases", phases, "rad")
    if phases.ndim != 1 or not phases.size:
        raise ValueError(f"phases has shape {phases.shape}: it must be (P,), not empty")
    ax = new_axes(height=52.0) if ax is None else ax
    fraction, waves = angles_along(gait, Snake.from_svl() if snake is None else snake, phases)
    zero_line(ax)
    faded = np.linspace(1.0, 0.25, max(phases.size, 2))
    for name, (label, colour) in _WAVES.items():
        for row, curve in enumerate(waves[name]):
            look = {"lw": 1.3 if row == 0 else 0.8, "alpha": faded[row], "zorder": 3 - row / 99}
            ax.plot(fraction, curve, color=colour, label=label, **look)
    keys = [Line2D([], [], color=colour, label=label) for label, colour in _WAVES.values()]
    where = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98), "borderaxespad": 0.0}
    ax.legend(handles=keys, ncols=2, handlelength=1.4, columnspacing=1.2, **where)
    ax.set_xlim(0.0, 1.0)
    ax.set_xlabel(_BODY)
    ax.set_ylabel("bending angle (°)")
    return ax


@style()
def wave_map(
    gait: AbstractMotion | AbstractTrajectory,
    snake: AbstractBody | None = None,
    ax: Axes | None = None,
    *,
    wave: str = "theta",
    duration: float | None = None,
    phi_theta: float = 0.0,
) -> Axes:
    """A wave of bending travelling down the body, over time and arc length (2 c, d).

    Args:
        gait: whose waves; or a glide, simulated with `dense=True`, from its launch to its
            end: then what is said of snake, duration and phase is the glide's.
        snake, ax: as in `bending_waves`.
        wave: "theta", the horizontal wave, or "psi", the vertical one.
        duration: time shown [s], above 0; by default two cycles, or 1 s of what has none.
        phi_theta: phase of the horizontal wave at time 0 [rad].

    Returns:
        The axes: time [s] across, arc length (fraction of SVL) up, the angle [deg] in
        colours, white at zero, with their bar beside it.

    Raises:
        ValueError: another wave, a duration or phase that is not allowed, or a motion with
            states of its own, which moves in a glide only.
    """
    check_choice("wave", wave, tuple(_WAVES))
    if isinstance(gait, AbstractTrajectory):
        time = np.asarray(gait.sample_times(_TIMES))
        fraction, waves = angles_in_flight(gait, time)
    else:
        body = Snake.from_svl() if snake is None else snake
        time, fraction, waves = _cycling(gait, body, duration, phi_theta)
    ax = new_axes(height=48.0) if ax is None else ax
    most = max(float(np.abs(waves[wave]).max()), 1e-6)
    colours = {"cmap": "RdBu_r", "vmin": -most, "vmax": most, "shading": "gouraud"}
    mesh = ax.pcolormesh(time, fraction, waves[wave].T, rasterized=True, **colours)
    bar = ax.figure.colorbar(mesh, ax=ax, label=f"{_WAVES[wave][0]} (°)")
    bar.outline.set_visible(False)  # type: ignore
    ax.set_xlabel("time, t (s)")
    ax.set_ylabel(_BODY.replace("fraction of ", ""))
    return ax


def _cycling(motion: AbstractMotion, body: AbstractBody, duration, phi_theta):
    """Times, arc length, and angles over both, of a motion that needs no flight."""
    check_range("phi_theta", phi_theta, "rad")
    if jax.eval_shape(motion.start, jnp.zeros(())).shape[0]:
        raise ValueError(
            f"{type(motion).__name__} has states of its own: draw its waves from a glide"
        )
    rate = float(motion.f_theta) if isinstance(motion, Gait) else 0.0
    duration = duration or (2.0 / rate if rate else 1.0)
    check_range("duration", duration, "s", 0, 1e4, low_open=True)
    time = np.linspace(0.0, duration, _TIMES)
    return time, *angles_along(motion, body, phi_theta, time)


@style()
def wave_maps(
    gait: AbstractMotion | AbstractTrajectory,
    snake: AbstractBody | None = None,
    *,
    duration: float | None = None,
    phi_theta: float = 0.0,
) -> Figure:
    """Both waves over time and arc length, one above the other (2 c, d).

    Args:
        gait, snake, duration, phi_theta: as in `wave_map`.

    Returns:
        A figure of one column's width (90 mm).

    Raises:
        ValueError: as `wave_map`.
    """
    figure = new_figure(height=84.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, 1, sharex=True, sharey=True)
    for ax, wave in zip(axes, _WAVES, strict=True):
        wave_map(gait, snake, ax, wave=wave, duration=duration, phi_theta=phi_theta)
    axes[0].set_xlabel("")
    return figure
