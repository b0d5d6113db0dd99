"""What acts on the body: the air's forces, and its own changing inertia."""

from .aerodynamics import (
    AbstractAerodynamics,
    Aerodynamics,
    Flow,
    LaggingCirculation,
    SweepTheory,
)
from .inertia import Inertia, inertia
from .polar import AbstractPolar, Polar
from .table import TabulatedPolar

__all__ = [
    "AbstractAerodynamics",
    "AbstractPolar",
    "Aerodynamics",
    "Flow",
    "Inertia",
    "LaggingCirculation",
    "Polar",
    "SweepTheory",
    "TabulatedPolar",
    "inertia",
]
