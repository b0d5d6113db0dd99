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
    "steady-certainty": "steady_certainty.py",
    "steady-map": "steady_map.py",
    "steady-optimum": "steady_optimum.py",
    "steady-branches": "steady_branches.py",
    "turning": "turning.py",
    "train-control": "train_control.py",
    "control": "control.py",
    "long-programme": "long_programme.py",
    "program-cost": "program_cost.py",
    "validation": "validation.py",
}


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    figure = new(
        description="Run one of the scripts in experiments/.",
    )
    figure.add_argument(
        "name", metavar="NAME", choices=tuple(_FIGURES), help=", ".join(_FIGURES)
    )
    group = figure.add_argument_group("output")
    text = "where tables and figures go (default: results/ and the name of the script)"
    group.add_argument("--out", metavar="FOLDER", help=text)
    text = "replace the results in the default folder"
    group.add_argument("--force", action="store_true", help=text)
    group = figure.add_argument_group("run")
    group.add_argument("--resume", action="store_true", help="keep stores, go on if killed")
    text = "size, where it can be chosen (at least 32; default: the script's)"
    group.add_argument("--size", type=whole, metavar="N", help=text)
    figure.set_defaults(run=_run, save=None, plot=None)


def _run(args) -> int:
    if args.size is not None and args.size < 32:
        raise UsageError(f"--size {args.size} is not at least 32")
    options = [] if args.out is None else ["--out", args.out]
    options += [f"--{name}" for name in ("resume", "force") if getattr(args, name)]
    options += [] if args.size is None else ["--size", str(args.size)]
    script = _scripts() / _FIGURES[args.name]
    return subprocess.run([sys.executable, str(script), *options]).returncode


def _scripts() -> Path:
    """The folder of the scripts: inside the package where installed, beside it in a clone."""
    package = Path(__file__).parents[1]
    inside = package / "experiments"
    return inside if inside.is_dir() else package.with_name("experiments")
