"""What the figures of flights need of a dataset from a file."""

from .._lib.datasets import Schema, Variable

_TRIAL = ("trial",)
_NAMES = {"trial": Variable(_TRIAL, None), "snake": Variable(_TRIAL, None)}
_UNITS = {
    "mass": "kg",
    "nu_theta": "",
    "nu_psi": "",
    "f_theta": "Hz",
    "f_psi": "Hz",
    "theta_m": "deg",
    "psi_m": "deg",
    "d_psi": "deg/SVL",
}

MEASURED = Schema(
    "the measured flights",
    {**_NAMES, **{name: Variable(_TRIAL, unit) for name, unit in _UNITS.items()}},
    sizes={"trial": 10_000},
)
"""Of `measured.measured_gaits`."""

BRANCH = Schema(
    "a branch's variables",
    {
        "glide_angle": Variable(("point",), "rad"),
        "spectral_radius": Variable(("point",), "", 0.0),
        "kind": Variable(("point",), None),
    },
    sizes={"point": 1_000_000},
)
"""Of `branch.branch`, beside the parameter, which has a unit of its own."""

COMPARED = Schema(
    "the compared flights",
    {
        **_NAMES,
        "position": Variable(("trial", "frame", "axis"), "m", gaps=True),
        "path": Variable(("trial", "time_simulated", "axis"), "m", gaps=True),
        "end": Variable(("trial", "axis"), "m", gaps=True),
    },
    sizes={"trial": 10_000, "frame": 100_000, "time_simulated": 100_000},
    labels={"axis": ("x", "y", "z")},
)
"""Of `flights.measured_and_simulated`."""
