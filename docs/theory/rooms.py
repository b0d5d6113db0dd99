"""Draws rooms.svg, what the rooms hand on to each other: python rooms.py"""

import pathlib

import matplotlib.pyplot as plt
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

# room, what it holds, where its middle is
ROOMS = (
    ("body", "chord, mass, nodes", (0.0, 2.0)),
    ("shape", "waves, drives, backbone", (0.0, 1.0)),
    ("air", "wind, density, viscosity", (0.0, 0.0)),
    ("loads", "polars, sweep theory, inertia", (2.2, 1.0)),
    ("flight", "launch, equations of motion, ends", (4.4, 1.0)),
    ("tunnel", "held attitude: moments, trim", (4.4, 0.0)),
)
WIDE, HIGH = 1.55, 0.5
# from, to, what is handed on, where it is written from the arrow's middle
HANDED = (
    ("body", "shape", "sections", (0.30, 0.0)),
    ("body", "loads", "masses, areas", (0.38, 0.12)),
    ("shape", "loads", "backbone", (0.0, 0.08)),
    ("air", "loads", "wind", (0.15, -0.12)),
    ("loads", "flight", "forces", (0.0, 0.08)),
    ("loads", "tunnel", "forces", (-0.15, -0.12)),
)
STYLE = {"svg.hashsalt": "rooms", "font.size": 9, "savefig.facecolor": "white"}


def edges(start, end):
    """Where an arrow from one box to another leaves and arrives."""
    (x, y), (u, v) = start, end
    if x == u:
        side = HIGH / 2 if v > y else -HIGH / 2
        return (x, y + side), (u, v - side)
    return (x + WIDE / 2, y + (v - y) * 0.15), (u - WIDE / 2, v - (v - y) * 0.15)


def arrow(axes, start, end, label, shift, **look):
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, **look))
    middle = (start[0] + end[0]) / 2 + shift[0], (start[1] + end[1]) / 2 + shift[1]
    axes.text(*middle, label, ha="center", va="center", color="#2166ac")


def draw(path):
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8.2, 3.6), layout="constrained")
        middles = {name: middle for name, _, middle in ROOMS}
        for name, holds, (x, y) in ROOMS:
            corner = x - WIDE / 2, y - HIGH / 2
            axes.add_patch(
                FancyBboxPatch(corner, WIDE, HIGH, "round,pad=0.02", fc="#e8f2ea", ec="#1b7837")
            )
            axes.text(x, y + 0.09, name, ha="center", va="center", weight="bold")
            axes.text(x, y - 0.10, holds, ha="center", va="center", fontsize=7)
        for start, end, label, shift in HANDED:
            arrow(axes, *edges(middles[start], middles[end]), label, shift, color="#555555")
        # the state of the flight comes back
        x, y = middles["flight"]
        back = (x, y + HIGH / 2), (middles["loads"][0], y + HIGH / 2)
        bent = {"color": "#b2182b", "connectionstyle": "arc3,rad=0.35"}
        arrow(axes, *back, "state: velocity, attitude, turning", (0.0, 0.52), **bent)
        axes.set(xlim=(-0.9, 5.3), ylim=(-0.4, 2.4), aspect="equal")
        axes.axis("off")
        figure.savefig(path, metadata={"Date": None})
        plt.close(figure)


if __name__ == "__main__":
    draw(pathlib.Path(__file__).with_suffix(".svg"))
