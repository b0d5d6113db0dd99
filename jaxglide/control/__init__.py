"""Flight under control: inputs set sample by sample, by what is sensed."""

from .environment import Environment, Flown, Moved, Senses, Situation, controlled_flight
from .plant import Held, Plant, actuated
from .policy import AbstractPolicy, Constant, Sensed
from .regulator import Regulator, linear_quadratic
from .work import actuator_power

__all__ = [
    "AbstractPolicy",
    "Constant",
    "Environment",
    "Flown",
    "Held",
    "Moved",
    "Plant",
    "Regulator",
    "Sensed",
    "Senses",
    "Situation",
    "actuated",
    "actuator_power",
    "controlled_flight",
    "linear_quadratic",
]
