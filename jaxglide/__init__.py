"""jaxglide: the flight dynamics of flying snakes, differentiable.

Set `jax.config.update("jax_enable_x64", True)` before use: results are quoted in float64.

Names are imported on first use, so that the command line can answer `--help` at once and
set up JAX before anything loads it.
"""

from importlib import import_module

_ROOMS = {
    "body": (
        "AbstractBody",
        "Sections",
        "Snake",
        "TabulatedBody",
        "discretise",
        "mass_from_length",
    ),
    "shape": (
        "AbstractDrive",
        "AbstractLaw",
        "AbstractMotion",
        "AbstractShape",
        "Actuated",
        "AttitudeLaw",
        "Bending",
        "Coordinates",
        "Driven",
        "Gait",
        "Observation",
        "Planned",
        "Programme",
        "Running",
        "Serpenoid",
        "TabulatedMotion",
        "Waveform",
        "shape_line",
    ),
    "air": ("AbstractAir", "Gust", "ShearWind", "StillAir", "Turbulence", "UniformWind"),
    "loads": (
        "AbstractAerodynamics",
        "AbstractPolar",
        "Aerodynamics",
        "Flow",
        "LaggingCirculation",
        "Polar",
        "SweepTheory",
        "TabulatedPolar",
    ),
    "flight": (
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
        "reconstruct",
        "simulate",
        "six_degrees_of_freedom",
        "take_off",
    ),
    "tunnel": (
        "body_polar",
        "derivatives",
        "equilibrium",
        "fall",
        "loads_at_end",
        "pitch_moment",
        "trim",
        "velocity_polar",
    ),
    "ensemble.study": ("Study",),
    "ensemble.sweep": ("sweep",),
    "ensemble.survey": ("survey",),
    "search": (
        "Constraint",
        "Evaluator",
        "Objective",
        "Optimum",
        "Problem",
        "Trial",
        "Verification",
        "clearance",
        "curvature",
        "evaluate",
        "glide_angle",
        "glide_ratio",
        "landing_distance",
        "optimise",
        "path_length",
        "sink_rate",
        "squared_pitch_moment",
        "stability_margin",
        "undulation_power",
        "varied",
        "verify",
    ),
    "flights": ("Fit", "Fitter", "compare_paths", "fit", "fly_flights"),
    "files": ("open", "save"),
}
__all__ = sorted(name for names in _ROOMS.values() for name in names)


def __getattr__(name: str):
    for room, names in _ROOMS.items():
        if name in names:
            value = getattr(import_module(f".{room}", __name__), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(__all__))
