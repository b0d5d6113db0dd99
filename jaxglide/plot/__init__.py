"""Matplotlib figures of glides and of the shape space (floor 6).

Imported only when asked for (`import jaxglide.plot`). Figures are made with Matplotlib's
object-oriented interface: no window opens and no global state changes; save one with
`figure.savefig(path)`. Units are metres, seconds and degrees.
"""

from ._style import style
from .atlas import stable_atlas
from .bending import bending_grid
from .glide import angles, glide_overview, side_view, top_view
from .shapes import region_outlines, shape_heatmaps

__all__ = [
    "angles",
    "bending_grid",
    "glide_overview",
    "region_outlines",
    "shape_heatmaps",
    "side_view",
    "stable_atlas",
    "style",
    "top_view",
]
