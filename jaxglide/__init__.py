"""jaxglide: the flight dynamics of flying snakes, differentiable.

Set `jax.config.update("jax_enable_x64", True)` before use: results are quoted in float64.

Names are imported on first use, so that the command line can answer `--help` at once and
set up JAX before anything loads it.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .air.environment import Environment
    from .body.snake import Sections, Snake, discretise
    from .flight.dynamics import Elements, Flight, Glider, elements, six_degrees_of_freedom
    from .flight.glide import Glide, Outcome, Settings, reconstruct, simulate
    from .flight.launch import Launch, TakeOff, take_off
    from .loads.polar import Polar
    from .shape.gait import Gait, shape_line

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
    "Settings",
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

_HOME = {
    "flight.dynamics": ("Elements", "Flight", "Glider", "elements", "six_degrees_of_freedom"),
    "air.environment": ("Environment",),
    "shape.gait": ("Gait", "shape_line"),
    "flight.glide": ("Glide", "Outcome", "Settings", "reconstruct", "simulate"),
    "flight.launch": ("Launch", "TakeOff", "take_off"),
    "loads.polar": ("Polar",),
    "body.snake": ("Sections", "Snake", "discretise"),
}


def __getattr__(name: str):
    for module, names in _HOME.items():
        if name in names:
            value = getattr(import_module(f".{module}", __name__), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
