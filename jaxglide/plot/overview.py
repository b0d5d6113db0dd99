"""One glide on a page: where it went, how the body moved, how it was oriented."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..flight.trajectory import AbstractTrajectory
from ._style import BODY, COLUMN_WIDTH, FAINT, INK, new_figure, place, style
from .glide import (
    HEAD_MARK,
    START_MARK,
    Frames,
    angles,
    check_drawable,
    end_mark,
    end_word,
    side_view,
    start_word,
    top_view,
    widened,
)

# Margins of the overview and height of its lowest axes [mm].
_LEFT, _BETWEEN, _RIGHT, _TITLE, _LABEL, _ANGLES = 12.0, 12.5, 2.5, 8.0, 9.0, 32.0
_NAMES = 12.0  # of curves, to their right [mm]
_LEAST, _TALLEST = 15.0, 100.0  # of the views [mm]
_LEGEND_COLUMN, _LEGEND_ROW = 23.0, 5.0  # heights of the legend [mm]


def legend_of(figure: Figure, glide: AbstractTrajectory, **where) -> None:
    """What the lines and marks of both views mean."""
    handles = [
        Line2D([], [], color=FAINT, lw=0.7, label="centre of mass"),
        Line2D([], [], color=BODY, lw=0.8, label="body"),
        Line2D([], [], label="head", **HEAD_MARK),
        Line2D([], [], color=INK, label=start_word(glide), **START_MARK),
        Line2D([], [], color=INK, label=end_word(glide), **end_mark(glide)),
    ]
    lengths = {"handlelength": 1.2, "handletextpad": 0.4, "columnspacing": 1.2}
    figure.legend(handles=handles, borderaxespad=0, borderpad=0, **lengths, **where)


def lay_out(
    figure: Figure, glide: AbstractTrajectory, side: Axes, top: Axes, *lower: Axes
) -> None:
    """Both views at one scale next to each other, curves in time below them, and the legend."""
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
    side.set_xlim(widened(side.get_xlim(), forward))
    top.set_xlim(widened(top.get_xlim(), across))
    top.set_ylim(widened(top.get_ylim(), along))
    each = _ANGLES + _LABEL + 2.0  # of the curves
    tall, base = scale * max(high, along), len(lower) * each + _LABEL
    # The legend goes below the top view if there is room, else between title and views.
    below = scale * (high - along) > _LABEL + _LEGEND_COLUMN
    height = base + tall + (0.0 if below else _LEGEND_ROW) + _TITLE
    figure.set_size_inches(COLUMN_WIDTH / 25.4, height / 25.4)
    place(figure, side, _LEFT, base + tall - scale * high, scale * forward, scale * high)
    left = _LEFT + scale * forward + _BETWEEN
    place(figure, top, left, base + tall - scale * along, scale * across, scale * along)
    for k, ax in enumerate(reversed(lower)):
        place(figure, ax, _LEFT, _LABEL + k * each, COLUMN_WIDTH - _LEFT - _NAMES, _ANGLES)
    for ax in (side, *lower):  # their labels one below the other
        ax.yaxis.set_label_coords(-7.4 / (ax.get_position().width * COLUMN_WIDTH), 0.5)
    if below:
        corner = (1 - _RIGHT / COLUMN_WIDTH, base / height)
        legend_of(figure, glide, loc="lower right", bbox_to_anchor=corner)
    else:
        above = (0.5, 1 - 7.0 / height)
        legend_of(figure, glide, loc="upper center", bbox_to_anchor=above, ncols=5)


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
    check_drawable(glide)
    figure = new_figure()
    side, top, lower = (
        figure.add_axes((0, 0, 1, 1), label=name) for name in ("side", "top", "angles")
    )
    side_view(glide, side, frames=frames)
    top_view(glide, top, frames=frames)
    angles(glide, lower)
    lay_out(figure, glide, side, top, lower)
    entitle(
        figure,
        f"{glide.ending.capitalize()} after {float(glide.time):.2f} s, "
        f"path length {float(glide.path_length):.2f} m",
    )
    return figure


def entitle(figure: Figure, title: str) -> None:
    """Put a title in the room that `lay_out` leaves for it."""
    up = 25.4 * figure.get_size_inches()[1]
    figure.suptitle(title, y=1 - 2.0 / up, va="top", fontsize=7.5)
