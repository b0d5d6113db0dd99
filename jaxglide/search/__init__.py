"""Objectives, problems and the search for the best gait or body."""

from .evaluator import Evaluator
from .objective import Constraint, Objective, Trial
from .objectives import (
    OBJECTIVES,
    clearance,
    curvature,
    evaluate,
    glide_angle,
    glide_ratio,
    landing_distance,
    path_length,
    sink_rate,
    spectral_radius,
    squared_pitch_moment,
    stability_margin,
    steady_glide_angle,
    steady_sink_rate,
    undulation_power,
    varied,
)
from .optimum import Optimum, Status, Verification, optimise, verify
from .problem import Evaluation, Problem

__all__ = [
    "OBJECTIVES",
    "Constraint",
    "Evaluation",
    "Evaluator",
    "Objective",
    "Optimum",
    "Problem",
    "Status",
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
    "spectral_radius",
    "squared_pitch_moment",
    "stability_margin",
    "steady_glide_angle",
    "steady_sink_rate",
    "undulation_power",
    "varied",
    "verify",
]
