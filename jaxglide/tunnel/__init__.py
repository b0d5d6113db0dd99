"""The virtual wind tunnel: a held attitude, its loads, trim and glide polar."""

from .fall import FORCE_PHASES, PUBLISHED_LAUNCH, Fall, fall, loads_along, loads_at_end
from .glide_polar import BodyPolar, Equilibrium, body_polar, equilibrium, velocity_polar
from .loads import MOMENT_PHASES, PITCH, ROLL, YAW, Loads, loads, over_phases
from .trim import Derivatives, Trim, derivatives, pitch_moment, trim

__all__ = [
    "FORCE_PHASES",
    "MOMENT_PHASES",
    "PITCH",
    "PUBLISHED_LAUNCH",
    "ROLL",
    "YAW",
    "BodyPolar",
    "Derivatives",
    "Equilibrium",
    "Fall",
    "Loads",
    "Trim",
    "body_polar",
    "derivatives",
    "equilibrium",
    "fall",
    "loads",
    "loads_along",
    "loads_at_end",
    "over_phases",
    "pitch_moment",
    "trim",
    "velocity_polar",
]
