"""Picture of a trim."""

import numpy as np
from matplotlib.axes import Axes

from ..tunnel.trim import Trim
from ._labels import parameter_label, shown
from ._style import FAINT, HEAD, YAW, new_axes, style


def trim_curve(trim: Trim, ax: Axes | None = None) -> Axes:
    """Mean pitch moment over the scanned values, with the trim marked.

    Args:
        trim: a result of `trim.trim`.
        ax: axes to draw on; by default new ones of one column's width.
    """
    unit = trim.unit
    factor = 180 / np.pi if unit.startswith("deg") else 1.0
    with style():
        ax = new_axes(55.0) if ax is None else ax
        ax.axhline(0, color=FAINT, lw=0.6)
        values, moments = factor * np.asarray(trim.scanned), 1e3 * np.asarray(trim.moments)
        ax.plot(values, moments, "o-", color=YAW, ms=3)
        if bool(trim.found):
            value = factor * float(trim.value)
            ax.plot([value], [0], "o", color=HEAD, ms=5)
            text = f"{value:.2f} {shown(unit)}".replace(" °", "°").rstrip()
            ax.annotate(text, (value, 0), (0, 6), textcoords="offset points", ha="right")
        ax.set_xlabel(parameter_label(trim.parameter, unit))
        ax.set_ylabel("mean pitch moment (N mm)")
    return ax
