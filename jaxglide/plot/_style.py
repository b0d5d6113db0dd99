"""One look for every figure: sizes, fonts and colours."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLUMN_WIDTH = 90.0
"""Width of a figure that fills one column of a journal page [mm]."""
PAGE_WIDTH = 180.0
"""Width of a figure that fills both."""

# Okabe and Ito's colours, distinct under every common kind of colour blindness.
YAW, PITCH, ROLL = "#0072B2", "#D55E00", "#009E73"
INK, BODY, HEAD, FAINT = "#222222", "#0072B2", "#D55E00", "#999999"

FONT = "DejaVu Sans"
"""Matplotlib's own: the same layout everywhere."""

_SETTINGS: dict[Any, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": [FONT],
    "text.usetex": False,
    "text.parse_math": True,
    "font.size": 7.0,
    "axes.titlesize": 7.5,
    "axes.labelsize": 7.0,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "legend.fontsize": 6.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.labelpad": 2.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.pad": 2.0,
    "ytick.major.pad": 2.0,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "pdf.fonttype": 42,  # text stays text in an editor
    "svg.fonttype": "none",
}


@contextmanager
def style() -> Iterator[None]:
    """The look of this package's figures, for a `with` block or as a decorator.

    Text of 6.5 to 7.5 points, thin axes, no frame: legible at one column's width, 90 mm.
    Matplotlib's settings are as before afterwards.
    """
    with matplotlib.rc_context(_SETTINGS):
        yield


def new_figure(width: float = COLUMN_WIDTH, height: float = 70.0) -> Figure:
    """An empty figure of the given size [mm], 300 dots per inch."""
    return Figure(figsize=(width / 25.4, height / 25.4), dpi=300)


def place(
    figure: Figure, ax: Axes, left: float, bottom: float, width: float, height: float
) -> None:
    """Put axes at a place in their figure [mm], from its lower left corner."""
    across, up = (25.4 * size for size in figure.get_size_inches())
    ax.set_position((left / across, bottom / up, width / across, height / up))


def new_axes(height: float = 70.0) -> Axes:
    """Axes alone in a figure of one column's width [mm] that makes room for their labels."""
    figure = new_figure(height=height)
    figure.set_layout_engine("constrained")
    return figure.add_subplot()


def zero_line(ax: Axes, *, across: bool = False) -> None:
    (ax.axvline if across else ax.axhline)(0.0, color="0.8", lw=0.6, zorder=0)
