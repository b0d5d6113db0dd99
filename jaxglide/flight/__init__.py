"""One flight: equations of motion, launch, ends, the glide."""

from .case import Case
from .dynamics import Elements, Flight, Glider, elements, six_degrees_of_freedom
from .ends import (
    AbstractEnd,
    AngleLimit,
    End,
    Ground,
    Outcome,
    Plane,
    TimeLimit,
    outcome_words,
)
from .glide import Glide, simulate
from .integrate import integrate
from .launch import Launch, TakeOff, take_off
from .solve import Settings
from .trajectory import Trajectory, reconstruct
from .uncertainty import standard_deviation

__all__ = [
    "AbstractEnd",
    "AngleLimit",
    "Case",
    "Elements",
    "End",
    "Flight",
    "Glide",
    "Glider",
    "Ground",
    "Launch",
    "Outcome",
    "Plane",
    "Settings",
    "TakeOff",
    "TimeLimit",
    "Trajectory",
    "elements",
    "integrate",
    "outcome_words",
    "reconstruct",
    "simulate",
    "six_degrees_of_freedom",
    "standard_deviation",
    "take_off",
]
