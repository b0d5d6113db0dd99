"""Flight under control: inputs set sample by sample, by what is sensed."""

from .controller import Controller
from .environment import Environment, Flown, Moved, Senses, Situation, controlled_flight
from .plant import Held, Plant, actuated
from .policy import AbstractPolicy, Constant, Sensed
from .regulator import Regulator, linear_quadratic
from .trace import History, Target, histories, retrace, target_of
from .work import actuator_power

__all__ = [
    "AbstractPolicy",
    "Constant",
    "Controller",
    "Environment",
    "Flown",
    "Held",
    "History",
    "Moved",
    "Plant",
    "Regulator",
    "Sensed",
    "Senses",
    "Situation",
    "Target",
    "actuated",
    "actuator_power",
    "controlled_flight",
    "histories",
    "linear_quadratic",
    "retrace",
    "target_of",
]
