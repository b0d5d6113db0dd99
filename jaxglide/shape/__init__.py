"""How a body bends: waves, what drives them, and the kinematics of the backbone."""

from .drives import (
    AbstractLaw,
    Actuated,
    AttitudeLaw,
    Planned,
    Programme,
    Repeated,
    Running,
    Stepped,
    inputs_of,
)
from .gait import Gait, shape_line, wave_phase, waves
from .kinematics import Backbone, backbone
from .motion import (
    AbstractDrive,
    AbstractMotion,
    AbstractShape,
    Bending,
    Coordinates,
    Driven,
    Observation,
    in_neck,
)
from .shapes import Serpenoid, Waveform
from .tabulated import TabulatedMotion

__all__ = [
    "AbstractDrive",
    "AbstractLaw",
    "AbstractMotion",
    "AbstractShape",
    "Actuated",
    "AttitudeLaw",
    "Backbone",
    "Bending",
    "Coordinates",
    "Driven",
    "Gait",
    "Observation",
    "Planned",
    "Programme",
    "Repeated",
    "Running",
    "Serpenoid",
    "Stepped",
    "TabulatedMotion",
    "Waveform",
    "backbone",
    "in_neck",
    "inputs_of",
    "shape_line",
    "wave_phase",
    "waves",
]
