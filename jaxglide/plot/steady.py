"""Picture of a steady glide: what repeats itself."""

import math

from matplotlib.figure import Figure

from .._lib.checks import check_integer, check_kind
from ..steady import SteadyGlide
from ..steady.repeat import repeated
from ._style import new_figure, style
from .glide import Frames, angles, side_view, speeds, top_view
from .overview import entitle, lay_out


def check_found(glide: SteadyGlide) -> None:
    """Refuse what is no steady glide, a batch, or one that was not found."""
    check_kind("glide", glide, SteadyGlide)
    if glide.found.ndim:
        raise ValueError(f"this is a batch of steady glides of shape {glide.found.shape}")
    if not bool(glide.found):
        raise ValueError(f"there is no steady glide to draw: {glide.why}")


@style()
def steady(glide: SteadyGlide, cycles: int = 2, frames: Frames | None = None) -> Figure:
    """Some cycles of a steady glide from the side and from above, its angles and speeds.

    The flight is that through the air, its mean path starting forward. The title says how
    steep it is, and whether it stays.

    Args:
        glide: one that was found.
        cycles: how many, 1 to 100; of a frozen body, seconds.
        frames: snapshots of the body, as in `side_view`; by default four a cycle and one.

    Returns:
        A figure of one column's width (90 mm) with four axes: side view, top view, angles,
        speeds.

    Raises:
        ValueError: it was not found, is a batch, or a number is out of range.
    """
    check_found(glide)
    check_integer("cycles", cycles, 1, 100)
    frames = 4 * cycles + 1 if frames is None else frames
    flown, figure = repeated(glide, cycles), new_figure()
    side, top, turns, fast = (
        figure.add_axes((0, 0, 1, 1), label=name)
        for name in ("side", "top", "angles", "speeds")
    )
    side_view(flown, side, frames=frames)
    top_view(flown, top, frames=frames)
    angles(flown, turns)
    speeds(flown, fast)
    lay_out(figure, flown, side, top, turns, fast)
    every = "second" if glide.frozen else "cycle"
    path = f"{math.degrees(glide.glide_angle):.1f}° below the horizontal"
    entitle(figure, f"{path}, spectral radius {float(glide.spectral_radius):.3f} a {every}")
    return figure
