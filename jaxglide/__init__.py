"""jaxglide: the flight dynamics of flying snakes, differentiable.

Set `jax.config.update("jax_enable_x64", True)` before use: results are quoted in float64.
"""

from .dynamics import Elements, Flight, Glider, elements, six_degrees_of_freedom
from .environment import Environment
from .gait import Gait, shape_line
from .glide import Glide, Outcome, reconstruct, simulate
from .launch import Launch, TakeOff, take_off
from .polar import Polar
from .snake import Sections, Snake, discretise

__all__ = [
    "Elements",
    "Environment",
    "Flight",
    "Gait",
    "Glide",
    "Glider",
    "Launch",
    "Outcome",
    "Polar",
    "Sections",
    "Snake",
    "TakeOff",
    "discretise",
    "elements",
    "reconstruct",
    "shape_line",
    "simulate",
    "six_degrees_of_freedom",
    "take_off",
]
