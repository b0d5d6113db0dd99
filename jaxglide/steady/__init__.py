"""Periodic glides: where a gait settles, and whether it stays there."""

from .averaged import averaged_glide
from .glide import steady_glide, steady_glides
from .modes import Mode
from .reduced import COMPONENTS
from .result import Reason, SteadyGlide
from .uncertainty import Uncertainty

__all__ = [
    "COMPONENTS",
    "Mode",
    "Reason",
    "SteadyGlide",
    "Uncertainty",
    "averaged_glide",
    "steady_glide",
    "steady_glides",
]
