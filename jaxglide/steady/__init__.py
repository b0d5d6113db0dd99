"""Periodic glides: where a gait settles, and whether it stays there."""

from .averaged import averaged_glide
from .branch import Branch
from .continuation import steady_branch
from .glide import steady_glide, steady_glides
from .modes import Mode
from .reduced import COMPONENTS
from .result import Reason, SteadyGlide
from .uncertainty import Uncertainty

__all__ = [
    "COMPONENTS",
    "Branch",
    "Mode",
    "Reason",
    "SteadyGlide",
    "Uncertainty",
    "averaged_glide",
    "steady_branch",
    "steady_glide",
    "steady_glides",
]
