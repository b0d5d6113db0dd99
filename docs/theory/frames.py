"""Draws frames.svg, with the rotations and the backbone of the package: python frames.py"""

import pathlib

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import Arc, FancyArrowPatch

from jaxglide import Gait, Snake, discretise
from jaxglide.flight.attitude import rotation_matrix
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

BODY, INERTIAL, AIR, FORCE = "#1b7837", "#555555", "#2166ac", "#b2182b"
STYLE = {
    "svg.hashsalt": "frames",
    "font.size": 9,
    "mathtext.fontset": "dejavusans",
    "savefig.facecolor": "white",
}


def snake():
    """Nodes of the published shape, the tail bent up, (3, n) [m]."""
    sections = discretise(Snake.from_svl(0.70, nodes=200))
    gait = Gait.from_degrees(d_psi=20)
    bent = waves(gait, sections.neck_fraction, sections.fraction, 0.0, 0.0)
    return np.asarray(backbone(sections, bent).position)


def turned(points, yaw=0.0, pitch=0.0, roll=0.0):
    """Points in body axes, (3, n), in inertial axes, at angles in degrees."""
    return np.asarray(rotation_matrix(np.deg2rad([yaw, pitch, roll]))).T @ points


def arrow(axes, start, end, colour, label="", shift=(0.0, 0.0), **style):
    look = {"arrowstyle": "-|>", "mutation_scale": 11, "shrinkA": 0, "shrinkB": 0}
    axes.add_patch(FancyArrowPatch(start, end, color=colour, **look, **style))
    axes.text(*np.add(end, shift), label, color=colour, ha="center", va="center")


def arc(axes, radius, first, last, colour, label=""):
    """An arc about the origin from one angle to another [deg], with an arrow at its end."""
    ends = {"theta1": min(first, last), "theta2": max(first, last)}
    axes.add_patch(Arc((0, 0), 2 * radius, 2 * radius, color=colour, lw=1.3, **ends))

    def place(angle):
        return radius * np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])

    arrow(axes, place(last - 0.12 * (last - first)), place(last), colour, lw=0)
    middle = 1.25 * place((first + last) / 2)
    axes.text(*middle, label, color=colour, ha="center", va="center")


def bare(axes, title, limits):
    axes.set(xlim=limits[:2], ylim=limits[2:], aspect="equal")
    axes.set_title(title, fontsize=9)
    axes.axis("off")


def draw_frames(axes):
    """Inertial axes on the ground, body axes in the snake, from behind, right and above."""
    right, up = np.array([0.88, 0.47, 0.0]), np.array([-0.27, 0.50, 0.82])

    def seen(points):
        return np.array([right @ points, up @ points])

    angles, centre = {"yaw": 12, "pitch": -12, "roll": 10}, np.array([0.75, 0.75, 0.80])
    body = seen(turned(3.0 * snake(), **angles) + centre[:, None])
    axes.plot(*body, color=BODY, lw=5, alpha=0.35, solid_capstyle="round")
    axes.plot(*body[:, :1], "o", color=BODY, ms=6)
    axes.text(*(body[:, 0] + [0.20, -0.03]), "head", color=BODY, ha="center")
    origin, middle = seen(np.zeros(3)), seen(centre)
    words = ("right", (0.14, -0.08)), ("forward", (0.40, -0.08)), ("up", (0.05, 0.1))
    for axis, name, (what, shift) in zip(0.62 * np.eye(3), "xyz", words, strict=True):
        arrow(axes, origin, seen(axis), INERTIAL, f"${name}_I$ {what}", shift, lw=1.3)
    for axis, name in zip(np.diag([0.75, 0.95, 0.60]), "xyz", strict=True):
        tip = seen(turned(axis, **angles) + centre)
        arrow(axes, middle, tip, BODY, f"${name}_B$", 0.13 * (tip - middle), lw=1.3)
    arrow(axes, origin, middle, INERTIAL, lw=0.9, linestyle="--")
    axes.text(*(0.5 * middle + [-0.15, 0.03]), "$R_0$", color=INERTIAL)
    arrow(axes, middle, middle - [0, 0.5], FORCE, "$m g$", (0.13, 0.0), lw=1.3)
    bare(axes, "inertial axes I and body axes B", (-0.30, 2.10, -0.40, 1.85))


def draw_turn(axes, name, title, rows, first, last, labels):
    """The snake before and after a positive turn of 25 degrees, in a plane of two axes."""
    body = 1.9 * snake()
    before, after = body[rows], turned(body, **{name: 25})[rows]
    axes.plot(*before, color=INERTIAL, lw=1, ls=":")
    axes.plot(*after, color=BODY, lw=4, alpha=0.4, solid_capstyle="round")
    axes.plot(*after[:, :1], "o", color=BODY, ms=5)
    for row, label in zip(rows, labels, strict=True):
        axis = np.zeros(3)
        axis[row] = 0.75
        arrow(axes, (0, 0), axis[rows], INERTIAL, f"${label}_I$", 0.14 * axis[rows], lw=0.9)
        tip = turned(axis, **{name: 25})[rows]
        arrow(axes, (0, 0), tip, BODY, f"${label}_B$", 0.14 * tip, lw=1.2)
    arc(axes, 0.5, first, last, FORCE)
    bare(axes, title, (-0.95, 0.95, -0.75, 0.98))


def draw_section(axes):
    """The plane normal to the body, seen from the tail: velocity, angles, lift and drag."""
    x = np.linspace(-1, 1, 101)
    back = 0.24 * (1 - np.abs(x) ** 1.6)
    belly = -0.05 * (1 - x**8) - 0.10 * (1 - x**4) * x**2
    axes.fill_between(0.45 * x, 0.45 * belly, 0.45 * back, color=BODY, alpha=0.35, lw=0)
    arrow(axes, (0, 0), (0.95, 0), BODY, r"$\hat c$", (0.07, 0.0), lw=1.2)
    arrow(axes, (0, 0), (0, 0.85), BODY, r"$\hat b$", (0.0, 0.08), lw=1.2)
    axes.plot(0, 0, "o", mfc="white", color=BODY, ms=7)
    axes.plot(0, 0, ".", color=BODY, ms=3)
    axes.text(-0.09, -0.16, r"$\hat t$", color=BODY)
    beta = np.deg2rad(35)
    way = np.array([np.cos(beta), -np.sin(beta)])
    across = np.array([np.sin(beta), np.cos(beta)])
    arrow(axes, (0, 0), 0.95 * way, AIR, r"$v_c\hat c + v_b\hat b$", (0.10, -0.09), lw=1.5)
    arc(axes, 0.62, 0, -35, AIR, r"$\beta$")
    arrow(axes, (0, 0), 0.75 * across, FORCE, "lift", (0.09, 0.06), lw=1.5)
    arrow(axes, (0, 0), -0.55 * way, FORCE, "drag", (-0.10, 0.05), lw=1.5)
    bare(axes, "a section, seen from the tail", (-0.85, 1.2, -0.8, 1.0))


def draw_fold(axes):
    """The folded angle of attack over the angle on the full circle."""
    beta = np.array([-180, -90, 90, 180.0])
    axes.plot(beta, [0, -90, 90, 0], color=AIR, lw=2)
    for low in (-180, 90):
        axes.axvspan(low, low + 90, color=INERTIAL, alpha=0.12, lw=0)
    for middle, sign in ((-135, "-1"), (0, "+1"), (135, "-1")):
        axes.text(middle, -82, rf"$\sigma = {sign}$", ha="center")
    axes.axhspan(-10, 60, xmin=0, xmax=1, color=BODY, alpha=0.12, lw=0)
    axes.text(-172, 46, "measured", color=BODY)
    ticks = np.arange(-180, 181, 90)
    axes.set(xlim=(-180, 180), ylim=(-95, 95), xticks=ticks, yticks=ticks[1:4])
    axes.set(xlabel=r"$\beta$ (deg)", ylabel=r"$\alpha$ (deg)")
    axes.set_title("the fold: air from behind is air from ahead", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)


def draw(path):
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(2, 3, figsize=(9.6, 6.6), layout="constrained")
        draw_frames(axes[0, 0])
        for place, name, title, rows, first, last, labels in (
            (axes[0, 1], "yaw", "nose left\n(from above)", [0, 1], 90, 115, "xy"),
            (axes[0, 2], "pitch", "nose up\n(from the right)", [1, 2], 0, 25, "yz"),
            (axes[1, 0], "roll", "right flank down\n(from behind)", [0, 2], 0, -25, "xz"),
        ):
            draw_turn(place, name, f"positive {name}: {title}", rows, first, last, labels)
        draw_section(axes[1, 1])
        draw_fold(axes[1, 2])
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)


if __name__ == "__main__":
    draw(pathlib.Path(__file__).with_suffix(".svg"))
