"""Defaults that the command line tells before anything is loaded, and choices by name.

What a float of a part is, its range and its default, stands at the field that owns it (see
`fields`); here is what belongs to no part: how flights are solved and held glides are read.
"""

from typing import NamedTuple


class Limits(NamedTuple):
    """A number that is no part's.

    Attributes:
        unit: unit in which it is given ("" for none).
        default: value where it is not given.
        meaning: in words.
        low, high: range; `low` itself is excluded where `low_open`, `high` where `high_open`.
    """

    unit: str
    default: float
    meaning: str
    low: float
    high: float
    low_open: bool = False
    high_open: bool = False


TOLERANCE = 1e-6
"""Relative and absolute tolerance of a glide."""

MAX_TIME = 60.0
"""Longest flight [s]."""

MAX_STEPS = 100_000
"""Most steps of the solver, rejected ones included."""

SOLVER: dict[str, Limits] = {
    "rtol": Limits("", TOLERANCE, "relative tolerance", 0, 0.1, True),
    "atol": Limits("", TOLERANCE, "absolute tolerance", 0, 0.1, True),
}
"""How a glide is solved."""

SEARCH_TOLERANCE = 1e-7
"""Of the glides that an optimisation flies, relative and absolute."""

HELD_SPEED = 1.7
"""Forward speed at which the published held glides start [m/s]."""

HELD_TOLERANCE = 1e-8
"""Relative and absolute tolerance of a held glide, whose end is differentiated."""

TUNNEL: dict[str, Limits] = {
    "yaw": Limits("deg", 0.0, "held yaw", -85, 85, True, True),
    "pitch": Limits("deg", 0.0, "held pitch", -85, 85, True, True),
    "roll": Limits("deg", 0.0, "held roll", -85, 85, True, True),
    "phases": Limits("", 60, "phases at which moments are read", 4, 3600),
    "interval": Limits("s", 0.025, "between records", 1e-4, 10),
    "max_time": Limits("s", 10.0, "longest fall", 0, 1e4, True),
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
