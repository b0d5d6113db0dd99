"""What can be varied, by name, in the units people read.

One table serves sweeps, study files and the command line; the defaults of all of them stand
here. It loads nothing.
"""

from typing import NamedTuple

PUBLISHED_NECK = 0.055 / 0.70
"""Fraction of SVL at which the published model's neck ends (its node at 5.5 cm)."""


class Parameter(NamedTuple):
    """A number that a study may vary.

    Attributes:
        unit: unit in which it is given ("" for none).
        default: value where it is not given; None where it follows from others.
        meaning: in words.
        low, high: range; `low` itself is excluded where `low_open`, `high` where `high_open`.
    """

    unit: str
    default: float | None
    meaning: str
    low: float
    high: float
    low_open: bool = False
    high_open: bool = False


PARAMETERS: dict[str, Parameter] = {
    "nu_theta": Parameter("", 1.4, "spatial periods of the horizontal wave", 0, 10),
    "theta_m": Parameter("deg", None, "horizontal amplitude (on the shape line)", 0, 180),
    "psi_m": Parameter("deg", 20.0, "vertical amplitude", 0, 180),
    "d_psi": Parameter("deg/SVL", 10.0, "dorsoventral bending", -180, 180),
    "d_theta": Parameter("deg/SVL", 0.0, "lateral bias, a turn", -180, 180),
    "f_theta": Parameter("Hz", 1.2, "undulation frequency, 0 frozen", 0, 50),
    "svl": Parameter("m", 0.70, "snout-vent length", 0, 100, True),
    "mass": Parameter("kg", None, "mass (from the length)", 0, 1e5, True),
    "neck_fraction": Parameter(
        "", PUBLISHED_NECK, "end of the neck, of SVL", 0, 0.5, True, True
    ),
    "height": Parameter("m", 10.0, "launch height", 0, 1e5, True),
    "speed": Parameter("m/s", None, "launch speed (from wing loading)", 0, 200),
    "elevation": Parameter("deg", 0.0, "launch direction above the horizontal", -90, 90),
    "heading": Parameter("deg", 0.0, "launch direction to the left of forward", -180, 180),
    "lift_scale": Parameter("", 1.0, "multiplier on the lift coefficient", 0, 100),
    "drag_scale": Parameter("", 1.0, "multiplier on the drag coefficient", 0, 100),
    "gravity": Parameter("m/s^2", 9.81, "gravitational acceleration", 0, 100),
    "air_density": Parameter("kg/m^3", 1.165, "density of the air", 0, 2000, True),
    "kinematic_viscosity": Parameter("m^2/s", 1.568e-5, "viscosity of the air", 0, 1, True),
}

OBSERVED: dict[str, tuple[float, float]] = {
    "nu_theta": (1.0, 1.5),
    "theta_m": (80.0, 120.0),
    "psi_m": (20.0, 45.0),
    "d_psi": (-20.0, 30.0),
    "f_theta": (1.0, 1.7),
}
"""Range of each variable of the gait observed in flight, in its unit."""

TOLERANCE = 1e-6
"""Relative and absolute tolerance of a glide."""

MAX_TIME = 60.0
"""Longest flight [s]."""

MAX_STEPS = 100_000
"""Most steps of the solver, rejected ones included."""

SOLVER: dict[str, Parameter] = {
    "rtol": Parameter("", TOLERANCE, "relative tolerance", 0, 0.1, True),
    "atol": Parameter("", TOLERANCE, "absolute tolerance", 0, 0.1, True),
}
"""How a glide is solved."""

SEARCH_TOLERANCE = 1e-7
"""Of the glides that an optimisation flies, relative and absolute."""

HELD_SPEED = 1.7
"""Forward speed at which the published held glides start [m/s]."""

HELD_TOLERANCE = 1e-8
"""Relative and absolute tolerance of a held glide, whose end is differentiated."""

TUNNEL: dict[str, Parameter] = {
    "yaw": Parameter("deg", 0.0, "held yaw", -85, 85, True, True),
    "pitch": Parameter("deg", 0.0, "held pitch", -85, 85, True, True),
    "roll": Parameter("deg", 0.0, "held roll", -85, 85, True, True),
    "phases": Parameter("", 60, "phases at which moments are read", 4, 3600),
    "interval": Parameter("s", 0.025, "between records", 1e-4, 10),
    "max_time": Parameter("s", 10.0, "longest fall", 0, 1e4, True),
}
"""How a held glide falls and is read; fewer than four phases compare left and right only."""

CHOICES: dict[str, tuple[str, ...]] = {
    "polar": ("published", "smooth"),
    "node_set": ("published", "gauss"),
}
"""Settings that are names; the first is the default, but where gradients are taken."""

GRADIENT_SETUP = {"polar": "smooth", "node_set": "gauss"}
"""The setup where gradients are taken: the published polar's slopes jump."""

NODES = {"published": 70, "gauss": 60}
"""Default number of nodes by node set."""

NODES_RANGE = (8, 2000)
"""Fewest and most nodes."""

OBJECTIVES = (
    "landing_distance",
    "path_length",
    "glide_ratio",
    "sink_rate",
    "glide_angle",
    "stability_margin",
    "squared_pitch_moment",
    "curvature",
    "undulation_power",
    "clearance",
)
"""Names of the objectives in `objectives`."""
