"""Periodic glides: where a gait settles, and whether it stays there."""

from .glide import steady_glide, steady_glides
from .modes import Mode
from .reduced import COMPONENTS
from .result import Reason, SteadyGlide

__all__ = ["COMPONENTS", "Mode", "Reason", "SteadyGlide", "steady_glide", "steady_glides"]
