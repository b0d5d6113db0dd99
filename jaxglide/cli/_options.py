"""What the commands share: options, checks of output files, writing."""

import argparse
import os
import sys
from pathlib import Path

from .._files import write_figure, write_netcdf
from ..parameters import CHOICES, OBJECTIVES, PARAMETERS


class UsageError(Exception):
    """A mistake of the user's: message on standard error, exit code 2."""


def a_number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def add_tolerances(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("solver")
    group.add_argument("--rtol", type=a_number, default=1e-6, help="relative tolerance (1e-6)")
    group.add_argument("--atol", type=a_number, default=1e-6, help="absolute tolerance (1e-6)")


def add_output(parser: argparse.ArgumentParser, save: bool = True, plot: bool = True) -> None:
    group = parser.add_argument_group("output")
    if save:
        text = "write a NetCDF file (.nc)"
        group.add_argument("--save", metavar="FILE", type=Path, help=text)
    else:
        parser.set_defaults(save=None)
    if plot:
        text = "write a figure (.png, .pdf, .svg)"
        group.add_argument("--plot", metavar="FILE", type=Path, help=text)
    else:
        parser.set_defaults(plot=None)
    group.add_argument("--json", action="store_true", help="print one JSON object instead")


_GROUPS = {
    "gait": ("nu_theta", "theta_m", "psi_m", "d_psi", "d_theta", "f_theta"),
    "snake": ("svl", "mass", "neck_fraction"),
    "launch": ("height", "speed", "elevation", "heading"),
    "air": ("lift_scale", "drag_scale", "gravity", "air_density", "kinematic_viscosity"),
}


def add_setup(parser: argparse.ArgumentParser, **defaults: str) -> None:
    group = parser.add_argument_group("setup")
    for name, choices in CHOICES.items():
        flag, default = f"--{name.replace('_', '-')}", defaults.get(name, choices[0])
        group.add_argument(flag, choices=choices, default=default, help=f"({default})")
    group.add_argument("--nodes", type=whole, metavar="N", help="nodes (70; gauss: 60)")


def add_glider(parser: argparse.ArgumentParser, **defaults: str) -> None:
    for title, names in _GROUPS.items():
        group = parser.add_argument_group(title)
        for name in names:
            p = PARAMETERS[name]
            unit = f" [{p.unit}]" if p.unit else ""
            default = "" if p.default is None else f" ({p.default:.4g})"
            group.add_argument(
                f"--{name.replace('_', '-')}",
                type=a_number,
                metavar="X",
                help=f"{p.meaning}{unit}{default}",
            )
    add_setup(parser, **defaults)


def add_objective(parser: argparse.ArgumentParser) -> None:
    """The objective, the free parameters and the fixed ones."""
    group = parser.add_argument_group("problem")
    group.add_argument(
        "--objective", choices=OBJECTIVES, default="landing_distance", help="(landing_distance)"
    )
    text = "parameters, separated by commas (theta_m,nu_theta,d_psi)"
    group.add_argument("--free", default="theta_m,nu_theta,d_psi", metavar="NAMES", help=text)
    text = "another parameter's value; may be repeated"
    group.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE", help=text)


def fixed_of(args) -> dict[str, float]:
    """Values given with --fix, by name."""
    fixed = {}
    for text in args.fix:
        name, _, value = text.partition("=")
        try:
            fixed[name] = float(value)
        except ValueError:
            raise UsageError(f"--fix {text!r} is not NAME=VALUE") from None
    return fixed


def case_of(args) -> dict[str, float]:
    """The glider's and launch's parameters given on the command line, by name."""
    given = {name: getattr(args, name) for name in PARAMETERS}
    return {name: value for name, value in given.items() if value is not None}


def setup_of(args) -> dict:
    """The setup given on the command line."""
    return {name: getattr(args, name) for name in (*CHOICES, "nodes")}


def build_from(args):
    """Glider and launch given on the command line, checked."""
    from ..cases import build, check_parameters, check_setup

    case = case_of(args)
    check_parameters(case)
    return build(case, check_setup(setup_of(args)))


def build_held(args):
    """The same for a held glide, which starts at the published speed unless told otherwise."""
    import equinox as eqx
    import jax.numpy as jnp

    from ..windtunnel import PUBLISHED_LAUNCH

    glider, launch = build_from(args)
    if args.speed is None:
        speed = jnp.asarray(PUBLISHED_LAUNCH[1])
        launch = eqx.tree_at(lambda x: x.speed, launch, speed, is_leaf=lambda x: x is None)
    return glider, launch


def writable(*paths: Path | None) -> None:
    """Fail before the work, not after it."""
    for path in paths:
        if path is None:
            continue
        if not path.parent.is_dir():
            raise UsageError(f"cannot write {path}: there is no folder {path.parent}")
        if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
            raise UsageError(f"cannot write {path}")


def _suffix(path: Path | None, option: str, allowed: tuple[str, ...]) -> None:
    if path is not None and path.suffix not in allowed:
        raise UsageError(f"{option} {path}: the name must end in {' or '.join(allowed)}")


def check_output(args) -> None:
    _suffix(args.save, "--save", (".nc",))
    _suffix(args.plot, "--plot", (".png", ".pdf", ".svg"))
    writable(args.save, args.plot)


def write(data, figure, args) -> None:
    """Write what --save and --plot ask for, and say so."""
    if args.save is not None:
        write_netcdf(args.save, data())
        announce(args.save, args)
    if args.plot is not None and figure is not None:
        write_drawing(args.plot, figure(), args)


def write_drawing(path: Path, figure, args) -> None:
    """Write a figure and say so."""
    write_figure(path, figure, dpi=200)
    announce(path, args)


def announce(path: Path, args) -> None:
    """Say that a file is written: on standard error where the output is one JSON object."""
    print(f"wrote {path}", file=sys.stderr if args.json else sys.stdout)
