"""What flies: a body along its length, and its division into nodes."""

from .sections import AbstractBody, Sections, discretise, wing_area
from .snake import Snake, mass_from_length
from .tabulated import TabulatedBody

__all__ = [
    "AbstractBody",
    "Sections",
    "Snake",
    "TabulatedBody",
    "discretise",
    "mass_from_length",
    "wing_area",
]
