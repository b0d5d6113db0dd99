"""Pictures of the waves of bending along the body (the paper's figures 2 a, c, d)."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .._lib.checks import check_choice, check_range
from ..body.snake import Snake
from ..shape.gait import Gait, waves
from ._style import PITCH, YAW, new_axes, new_figure, style, zero_line

_WAVES = {"theta": (r"horizontal, $\theta$", YAW), "psi": (r"vertical, $\psi$", PITCH)}
_POINTS, _TIMES = 201, 301  # of a line along the body, and of a map in time
_BODY = "arc length, $s$ (fraction of SVL)"


def angles_along(gait: Gait, snake: Snake, phases) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Bending angles of both waves along the body.

    Args:
        gait, snake: whose waves; of the snake only the neck matters.
        phases: of the horizontal wave [rad], (P,).

    Returns:
        Arc length (fraction of SVL, (S,)), and "theta" and "psi" [deg], each (P, S).
    """
    fraction = np.linspace(0.0, 1.0, _POINTS)
    phase = jnp.asarray(phases, float)[:, None]
    wave = waves(gait, snake.neck_fraction, jnp.asarray(fraction), phase, 0.0)
    return fraction, {name: np.rad2deg(getattr(wave, name)) for name in _WAVES}


@style()
def bending_waves(
    gait: Gait,
    snake: Snake | None = None,
    ax: Axes | None = None,
    *,
    phases: Sequence[float] | np.ndarray = (0.0,),
) -> Axes:
    """Horizontal and vertical bending angle along the body (2a).

    Args:
        gait: whose waves.
        snake: whose body; by default one of 70 cm. Only its neck matters.
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
    gait: Gait,
    snake: Snake | None = None,
    ax: Axes | None = None,
    *,
    wave: str = "theta",
    duration: float | None = None,
    phi_theta: float = 0.0,
) -> Axes:
    """A wave of bending travelling down the body, over time and arc length (2 c, d).

    Args:
        gait, snake, ax: as in `bending_waves`.
        wave: "theta", the horizontal wave, or "psi", the vertical one.
        duration: time shown [s], above 0; by default two cycles, or 1 s of a frozen body.
        phi_theta: phase of the horizontal wave at time 0 [rad].

    Returns:
        The axes: time [s] across, arc length (fraction of SVL) up, the angle [deg] in
        colours, white at zero, with their bar beside it.

    Raises:
        ValueError: another wave, or a duration or phase that is not allowed.
    """
    check_choice("wave", wave, tuple(_WAVES))
    f_theta = float(gait.f_theta)
    duration = duration or (2.0 / f_theta if f_theta else 1.0)
    check_range("duration", duration, "s", 0, 1e4, low_open=True)
    check_range("phi_theta", phi_theta, "rad")
    ax = new_axes(height=48.0) if ax is None else ax
    time = np.linspace(0.0, duration, _TIMES)
    phases = phi_theta - 2 * np.pi * f_theta * time
    fraction, waves = angles_along(gait, Snake.from_svl() if snake is None else snake, phases)
    most = max(float(np.abs(waves[wave]).max()), 1e-6)
    colours = {"cmap": "RdBu_r", "vmin": -most, "vmax": most, "shading": "gouraud"}
    mesh = ax.pcolormesh(time, fraction, waves[wave].T, rasterized=True, **colours)
    bar = ax.figure.colorbar(mesh, ax=ax, label=f"{_WAVES[wave][0]} (°)")
    bar.outline.set_visible(False)  # type: ignore
    ax.set_xlabel("time, t (s)")
    ax.set_ylabel(_BODY.replace("fraction of ", ""))
    return ax


@style()
def wave_maps(
    gait: Gait,
    snake: Snake | None = None,
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
