"""`jaxglide figure`."""

import subprocess
import sys
from pathlib import Path

from ._options import UsageError, whole

_FIGURES = {
    "4": "figure_4.py",
    "5": "figure_5.py",
    "6": "figure_6.py",
    "s7": "figure_s7.py",
    "s8": "figure_s8.py",
    "glide-polar": "glide_polar.py",
    "force-coefficients": "force_coefficients.py",
    "atlas": "atlas.py",
    "sensitivity": "sensitivity.py",
    "optimal-gaits": "optimal_gaits.py",
    "trim-and-distance": "trim_and_distance.py",
    "robustness": "robustness.py",
    "search-cost": "search_cost.py",
    "measured-flights": "measured_flights.py",
    "fit-forces": "fit_forces.py",
    "gallery": "gallery.py",
}


def add(commands) -> None:
    """Add the command to the parser."""
    figure = commands.add_parser(
        "figure",
        help="make a published figure with its table",
        description="Run one of the scripts in experiments/.",
    )
    figure.add_argument("name", choices=_FIGURES, help=", ".join(_FIGURES))
    figure.add_argument("--out", default="results", metavar="FOLDER", help="(results)")
    figure.add_argument("--resume", action="store_true", help="keep stores, go on if killed")
    figure.add_argument("--size", type=whole, metavar="N", help="size, where it can be chosen")
    figure.set_defaults(run=_run, save=None, plot=None)


def _run(args) -> int:
    folder = Path(__file__).parents[2] / "experiments"
    script = folder / _FIGURES[args.name]
    if not script.exists():
        raise UsageError("the figures' scripts are in a clone of the repository, not here")
    if args.size is not None and args.size < 32:
        raise UsageError(f"--size {args.size} is not at least 32")
    options = ["--out", args.out, *(["--resume"] if args.resume else [])]
    options += [] if args.size is None else ["--size", str(args.size)]
    return subprocess.run([sys.executable, str(script), *options]).returncode
