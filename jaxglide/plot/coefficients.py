"""Pictures of force coefficients, morphology and the whole body's glide polar."""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import jax.numpy as jnp
import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from .._lib.checks import check_range
from ..body.sections import AbstractBody, discretise, surface_nodes
from ..loads.coefficients import ALPHA, REYNOLDS, extended_tables
from ..loads.polar import AbstractPolar, Polar
from ..tunnel.fall import Fall
from ..tunnel.glide_polar import BodyPolar, Equilibrium
from ._labels import plain
from ._style import FAINT, INK, PAGE_WIDTH, PITCH, YAW, new_figure, style, zero_line

_EQUAL = {"color": INK, "lw": 0.6, "ls": (0, (4, 2))}


@style()
def force_coefficients(
    polars: Mapping[str, AbstractPolar] | None = None,
    reynolds: Sequence[float] = (3000.0, 7000.0, 11000.0, 15000.0),
) -> Figure:
    """Lift, drag and their ratio of a body section against its angle of attack (S7).

    Args:
        polars: polars by name, one a column; by default the published and the smooth one.
        reynolds: Reynolds numbers on the chord, one a line.

    Returns:
        A figure of one column's width (90 mm) for two polars: C_L, C_D and their ratio
        against angle of attack [deg]. Dots are the snake's measurements; where nothing was
        measured the ground is grey.

    Raises:
        ValueError: no polar, or a Reynolds number that is not finite and above 0.
    """
    if polars is None:
        polars = {"published": Polar.published(), "smooth": Polar.smooth()}
    numbers = np.atleast_1d(np.asarray(reynolds, float))
    if not polars or not numbers.size:
        raise ValueError("there is nothing to draw: give a polar and a Reynolds number")
    check_range("reynolds", numbers, "", 0, low_open=True)
    alpha = np.append(np.arange(-89.75, 90.0, 0.25), 90.0)  # lift jumps at -90
    figure = new_figure(width=14.0 + 38.0 * len(polars), height=118.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(3, len(polars), sharex=True, sharey="row", squeeze=False)
    shades = colormaps["viridis"](np.linspace(0, 0.9, numbers.size))
    for column, (name, polar) in enumerate(polars.items()):
        for number, shade in zip(numbers, shades, strict=True):
            angle = jnp.deg2rad(alpha)
            lift, drag = (np.asarray(c) for c in polar(angle, jnp.full(alpha.shape, number)))
            for row, values in enumerate((lift, drag, lift / drag)):
                ax = axes[row, column]
                ax.plot(alpha, values, color=shade, lw=0.9, label=f"{number:g}")
        _measurements(axes[:, column], polar, numbers, shades)
        axes[0, column].set_title(f"{plain(name)} polar")
        axes[2, column].set_xlabel("angle of attack (°)")
    for row, label in enumerate(("lift, $C_L$", "drag, $C_D$", "lift to drag, $C_L/C_D$")):
        axes[row, 0].set_ylabel(label)
    axes[0, 0].set_xlim(-90, 90)
    axes[0, 0].xaxis.set_major_locator(MultipleLocator(45))
    figure.align_ylabels(axes)
    corner = {"xycoords": "axes fraction", "va": "top", "fontsize": 6.5}
    axes[0, 0].annotate("not\nmeasured", (0.03, 0.97), **corner)
    below = {"loc": "outside lower center", "columnspacing": 1.2, "handlelength": 1.4}
    title = {"title": "Reynolds number; dots: measured", "title_fontsize": 6.5}
    figure.legend(handles=axes[0, 0].lines[: numbers.size], ncols=4, **title, **below)
    return figure


def _measurements(
    axes: np.ndarray, polar: AbstractPolar, numbers: np.ndarray, shades: np.ndarray
) -> None:
    """Dots on C_L, C_D and C_L/C_D at the points measured of the snake, and grey where a
    polar is not known."""
    low, high = np.clip(polar.measured_angles, -90.0, 90.0)
    numbers = numbers if isinstance(polar, Polar) else np.zeros(0)
    lift, drag = (table[high >= ALPHA] for table in extended_tables())
    for ax, table in zip(axes, (lift, drag, lift / drag), strict=True):
        zero_line(ax)
        for span in ((-90.0, low), (high, 90.0)):
            ax.axvspan(*span, color="0.94", lw=0, zorder=-1, label="not measured")
        for number, shade in zip(numbers, shades, strict=False):
            for index in np.flatnonzero(number == REYNOLDS):
                dot = {"ls": "", "marker": "o", "ms": 1.8, "mew": 0.0, "color": shade}
                ax.plot(ALPHA[high >= ALPHA], table[:, index], label="measured", **dot)


@style()
def morphology(body: AbstractBody) -> Figure:
    """Chord and linear mass density along the body (S8).

    Args:
        body: a snake or another body; dots are its nodes.

    Returns:
        A figure of one column's width (90 mm) with two axes over arc length (fraction of
        SVL): chord [mm] and linear mass density [g/cm]; dashed, the middle of the wing area
        and of the mass of the straight body, its point masses included.
    """
    sections = discretise(body)
    names = ("fraction", "chord", "area", "mass")
    everything = {name: np.asarray(getattr(sections, name)) for name in names}
    nodes = surface_nodes(sections)
    x, chord, area, mass = (everything[name][nodes] for name in names)
    figure = new_figure(height=82.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, 1, sharex=True)
    dots = {"marker": "o", "ms": 1.8, "mew": 0.0, "lw": 0.7, "color": YAW}
    density = 10.0 * mass * chord / area  # kg/m to g/cm
    names = ("chord, $c$ (mm)", "mass per length (g/cm)")
    middles = (("area", "middle of the area"), ("mass", "middle of the mass"))
    for ax, values, name, (what, said) in zip(
        axes, (1e3 * chord, density), names, middles, strict=True
    ):
        ax.plot(x, values, label="nodes", **dots)
        ax.fill_between(x, values, color=YAW, alpha=0.12, lw=0)
        weight = everything[what]
        middle = float(np.sum(weight * everything["fraction"]) / np.sum(weight))
        ax.axvline(middle, color=INK, lw=0.7, ls=(0, (4, 2)), zorder=1, label=said)
        place = {"xytext": (3, 3), "textcoords": "offset points", "fontsize": 6.5}
        ax.annotate(f"{said}, {middle:.3f}", (middle, 0.0), **place)
        ax.set_ylim(0.0, 1.12 * values.max())
        ax.set_ylabel(name)
    axes[1].set_xlim(0, 1)
    axes[1].set_xlabel("arc length, $s$ (fraction of SVL)")
    figure.align_ylabels(axes)
    length, total = 100 * float(sections.length), 1e3 * everything["mass"].sum()
    figure.suptitle(
        f"length {length:.3g} cm, {total:.3g} g, wing area {1e4 * area.sum():.3g} cm²",
        fontsize=7.5,
    )
    return figure


Field: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]


@style()
def glide_polar_figure(
    polar: BodyPolar, field: Field, rest: Equilibrium, fallen: Fall | None = None
) -> Figure:
    """Glide polar of the whole body beside its velocity polar diagram.

    Args:
        polar: lift and drag against angle of attack (`glide_polar.body_polar`).
        field: v_y (Y,), v_z (Z,), each in equal steps [m/s], and `velocity_polar` of them,
            (Y, Z, 2) [m/s^2].
        rest: the steady glide (`glide_polar.equilibrium`).
        fallen: a held glide (`windtunnel.fall`) whose velocity is drawn, or None.

    Returns:
        A figure of a page's width (180 mm). Left: lift to drag against angle of attack
        [deg] and, dashed, what a level body needs to glide steadily (the cotangent of that
        angle). Right: where the acceleration takes the velocity [m/s], on the size of the
        acceleration [m/s^2]; a disc at the equilibrium, a ring every 0.5 s of the fall.

    Raises:
        ValueError: the shapes of the field differ.
    """
    v_y, v_z, rate = (np.asarray(values) for values in field)
    if rate.shape != (v_y.size, v_z.size, 2):
        raise ValueError(f"the field has shape {rate.shape}, not {(v_y.size, v_z.size, 2)}")
    tall = 81.0 * float(np.ptp(v_z) / np.ptp(v_y))  # the right axes, 81 mm wide [mm]
    figure = new_figure(width=PAGE_WIDTH, height=float(np.clip(tall + 11.0, 50.0, 150.0)))
    figure.set_layout_engine("constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.25))
    _draw_polar(left, polar, rest)
    size = np.hypot(*rate.T)  # (Z, Y)
    steps = np.linspace(0.0, np.ceil(min(size.max(), 2 * 9.81)), 11)
    map_ = right.contourf(v_y, v_z, size, steps, cmap="Blues", extend="max", alpha=0.8)
    right.streamplot(
        v_y, v_z, *rate.T, color="0.35", linewidth=0.5, arrowsize=0.6, density=1.1, zorder=2
    )
    bar = figure.colorbar(map_, ax=right, label="acceleration (m/s²)", shrink=0.8)
    bar.outline.set_visible(False)  # type: ignore
    if fallen is not None:
        _draw_fall(right, fallen)
    if bool(rest.found):
        name = f"equilibrium, {np.rad2deg(float(rest.glide_angle)):.1f}° down"
        right.plot(*np.asarray(rest.velocity), ls="", label=name, **_DISC)
    right.set_aspect("equal")
    right.set_xlim(v_y.min(), v_y.max())
    right.set_ylim(v_z.min(), v_z.max())
    right.set_xlabel("forward velocity, $v_y$ (m/s)")
    right.set_ylabel("vertical velocity, $v_z$ (m/s)")
    if right.lines:
        right.legend(loc="lower right", frameon=True, framealpha=0.85, edgecolor="none")
    return figure


_DISC = {"marker": "o", "ms": 5.0, "mfc": "k", "mec": "white", "mew": 0.8, "zorder": 6}


def _draw_polar(ax: Axes, polar: BodyPolar, rest: Equilibrium) -> None:
    """Lift to drag of the body, and the line of steady level glides."""
    alpha, ratio = np.rad2deg(polar.angle_of_attack), np.asarray(polar.lift_to_drag)
    zero_line(ax)
    ax.plot(alpha, ratio, color=YAW, label="undulating body, level")
    top = int(np.argmax(ratio))
    ax.annotate(
        f"best {ratio[top]:.2f} at {alpha[top]:.0f}°",
        (alpha[top], ratio[top]),
        xytext=(4, 3),
        textcoords="offset points",
        fontsize=6.5,
    )
    steep, dash = np.linspace(1.0, 90.0, 357), {"color": FAINT, "ls": "--", "lw": 0.8}
    ax.plot(steep, 1 / np.tan(np.deg2rad(steep)), label=r"steady glide: cot $\alpha$", **dash)
    if bool(rest.found):
        angle = float(rest.glide_angle)
        ax.plot(np.rad2deg(angle), 1 / np.tan(angle), ls="", label="equilibrium", **_DISC)
    ax.set_xlim(alpha.min(), alpha.max())
    ax.set_ylim(min(ratio.min(), 0.0) - 0.2, 1.25 * ratio[top])
    ax.set_xlabel(r"angle of attack, $\alpha$ (°)")
    ax.set_ylabel("lift to drag of the body")
    ax.legend(loc="lower right")


def _draw_fall(ax: Axes, fallen: Fall) -> None:
    """The velocity of a held glide, from launch to ground."""
    last = int(fallen.last)
    until = np.asarray(fallen.times[: last + 1]) < float(fallen.time)
    time = np.append(np.asarray(fallen.times[: last + 1])[until], fallen.time)
    velocity = np.vstack([np.asarray(fallen.states)[: last + 1][until, 2:], fallen.state[2:]])
    ax.plot(*velocity.T, color=PITCH, lw=1.4, zorder=4, label="held glide")
    marks = np.arange(0.0, time[-1], 0.5)
    at = np.stack([np.interp(marks, time, part) for part in velocity.T])
    ring = {"marker": "o", "ms": 3.0, "mfc": "white", "mec": PITCH, "mew": 0.8, "zorder": 5}
    ax.plot(*at, ls="", label="every 0.5 s", **ring)
