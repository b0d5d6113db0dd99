"""The air: where it moves and how, its density and viscosity."""

from .air import AbstractAir, Gust, ShearWind, StillAir, Turbulence, UniformWind

__all__ = ["AbstractAir", "Gust", "ShearWind", "StillAir", "Turbulence", "UniformWind"]
