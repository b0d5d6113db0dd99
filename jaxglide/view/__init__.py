"""Glides to look at: an interactive page, an animation, a still.

Imported only when asked for (`import jaxglide.view`, `jaxglide view`).
`view` makes one HTML file that plays in any browser, `animate` a GIF or MP4 for talks and
`still` a picture, all of the same `Scene`. Units are metres, seconds, degrees and newtons.
"""

from typing import TYPE_CHECKING

from .html import Page, view
from .scene import Scene

if TYPE_CHECKING:
    from .animation import animate, check_path, still

__all__ = ["Page", "Scene", "animate", "check_path", "still", "view"]


def __getattr__(name: str):
    """Matplotlib takes a second to import: only the pictures need it, the page does not."""
    if name not in ("animate", "check_path", "still"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import animation

    return getattr(animation, name)
