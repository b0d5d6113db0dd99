"""Flight under control: inputs set sample by sample, by what is sensed."""

from .controller import Controller
from .environment import Environment, Flown, Moved, Senses, Situation, controlled_flight
from .evaluation import evaluate_policy
from .laws import GainScheduled, NeuralPolicy
from .plant import Held, Plant, actuated
from .policy import AbstractPolicy, Constant, Sensed
from .regulator import Regulator, linear_quadratic
from .sampled import SampledPath
from .trace import History, Target, histories, retrace, target_of
from .training import Trained, train_policy
from .turning import CoordinatedTurn
from .waypoints import Waypoints
from .work import actuator_power

__all__ = [
    "AbstractPolicy",
    "Constant",
    "Controller",
    "CoordinatedTurn",
    "Environment",
    "Flown",
    "GainScheduled",
    "Held",
    "History",
    "Moved",
    "NeuralPolicy",
    "Plant",
    "Regulator",
    "SampledPath",
    "Sensed",
    "Senses",
    "Situation",
    "Target",
    "Trained",
    "Waypoints",
    "actuated",
    "actuator_power",
    "controlled_flight",
    "evaluate_policy",
    "histories",
    "linear_quadratic",
    "retrace",
    "target_of",
    "train_policy",
]
