"""What the commands share: options, checks of output files, writing."""

import argparse
import json
import math
import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

from .._lib.parameters import (
    CHOICES,
    HELD_SPEED,
    NODES_RANGE,
    OBJECTIVES,
    PARAMETERS,
    SOLVER,
    TOLERANCE,
    TUNNEL,
    Parameter,
)
from .._lib.writing import write_figure, write_netcdf

_RANGES = {
    **PARAMETERS,
    **SOLVER,
    **TUNNEL,
    "nodes": Parameter("", None, "nodes", *NODES_RANGE),
    "width": Parameter("", None, "glides per batch", 1, 10**6),
}


class UsageError(Exception):
    """A mistake of the user's: message on standard error, exit code 2."""


class _Once(argparse.Action):
    """Store a value; an option given twice is refused, for the first would be lost.

    `args.given` holds the options given, as typed, by the name of their value.
    """

    def __call__(self, parser, namespace, values, option_string=None):
        if option_string is not None:
            if self.dest in namespace.given:
                raise argparse.ArgumentError(self, "given twice")
            namespace.given = {**namespace.given, self.dest: option_string}
        setattr(namespace, self.dest, values)


class Parser(argparse.ArgumentParser):
    """A parser that takes every option once, by its full name, and fails in one sentence."""

    def __init__(self, **options):
        super().__init__(**options, allow_abbrev=False)
        for action in (None, "store"):
            self.register("action", action, _Once)
        self.set_defaults(given={})

    def error(self, message: str) -> NoReturn:
        raise UsageError(f"{message} ({self.prog} --help lists all options)")


def refuse(args, names: tuple[str, ...], why: str) -> None:
    """Fail where one of the named options was given, for it would have no effect."""
    for name in names:
        if name in args.given:
            raise UsageError(f"{args.given[name]} does not apply: {why}")


def by_name(option: str, pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """What a repeatable option gives, by name; `UsageError` where it names one twice."""
    found = {}
    for name, value in pairs:
        if name in found:
            raise UsageError(f"{option} gives {name} twice")
        found[name] = value
    return found


def print_json(result: dict) -> None:
    """Print one JSON object, with null for what is not a number (JSON has no NaN)."""
    print(json.dumps(_with_nulls(result), allow_nan=False))


def missing(result: dict) -> int:
    """Exit code: 1, with a sentence on standard error, where a number asked for is none."""
    names = [name for name, value in result.items() if value != _with_nulls(value)]
    if names:
        print(f"jaxglide: not a number: {', '.join(names)}", file=sys.stderr)
    return int(bool(names))


def _with_nulls(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _with_nulls(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [_with_nulls(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def a_number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return value


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def add_number(group, name: str, p: Parameter, default: float | None = None) -> None:
    """An option for a number of `parameters`."""
    unit = f" [{p.unit}]" if p.unit else ""
    told = "" if p.default is None else f" ({p.default:.4g})"
    group.add_argument(
        f"--{name.replace('_', '-')}",
        type=whole if isinstance(p.default, int) else a_number,
        metavar="N" if isinstance(p.default, int) else "X",
        default=default,
        help=f"{p.meaning}{unit}{told}",
    )


def check_number(option: str, value: float, p: Parameter) -> float:
    """The value of an option; `ValueError` where it is out of range."""
    from .._lib.checks import check_integer, check_range

    if isinstance(value, int):
        check_integer(option, value, int(p.low), int(p.high))
    else:
        check_range(
            option, value, p.unit, p.low, p.high, low_open=p.low_open, high_open=p.high_open
        )
    return value


def check_ranges(args) -> None:
    """Raise `ValueError` for a number given out of range, by its option as typed."""
    for name, option in args.given.items():
        if name in _RANGES:
            check_number(option, getattr(args, name), _RANGES[name])


def add_tolerances(parser: argparse.ArgumentParser, default: float = TOLERANCE) -> None:
    group = parser.add_argument_group("solver")
    for name, p in SOLVER.items():
        add_number(group, name, p._replace(default=default), default=default)


def add_output(
    parser: argparse.ArgumentParser,
    save: bool = True,
    plot: bool = True,
    endings: tuple[str, ...] = ("",),
) -> None:
    """Options of files and JSON; `endings` tell the figures of --plot apart, if several."""
    group = parser.add_argument_group("output")
    if save:
        text = "write a NetCDF file (.nc)"
        group.add_argument("--save", metavar="FILE", type=Path, help=text)
    else:
        parser.set_defaults(save=None)
    if plot:
        text = "write a figure (.png, .pdf, .svg)"
        if endings[1:]:
            more = " and ".join(endings[1:])
            text = f"write figures (.png, .pdf, .svg): FILE, and beside it FILE with {more}"
        group.add_argument("--plot", metavar="FILE", type=Path, help=text)
    else:
        parser.set_defaults(plot=None)
    group.add_argument("--json", action="store_true", help="print one JSON object instead")
    parser.set_defaults(plot_endings=endings)


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


def add_glider(parser: argparse.ArgumentParser, held: bool = False) -> None:
    """Glider and launch; a held glide stays in the plane y, z and has no heading."""
    for title, names in _GROUPS.items():
        group = parser.add_argument_group(title)
        for name in names:
            p = PARAMETERS[name]
            if held and name == "heading":
                continue
            if held and name == "speed":
                p = p._replace(default=HELD_SPEED, meaning="launch speed")
            add_number(group, name, p)
    add_setup(parser)


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


def free_of(args) -> list[str]:
    """Names given with --free."""
    return list(by_name("--free", ((name.strip(), None) for name in args.free.split(","))))


def fixed_of(args) -> dict[str, float]:
    """Values given with --fix, by name."""
    return by_name("--fix", (pair("--fix", text) for text in args.fix))


def pair(option: str, text: str) -> tuple[str, float]:
    """Name and number of NAME=VALUE."""
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise UsageError(f"{option} {text!r} is not NAME=VALUE") from None


def case_of(args) -> dict[str, float]:
    """The glider's and launch's parameters given on the command line, by name."""
    given = {name: getattr(args, name, None) for name in PARAMETERS}
    return {name: value for name, value in given.items() if value is not None}


def setup_of(args) -> dict:
    """The setup given on the command line."""
    return {name: getattr(args, name) for name in (*CHOICES, "nodes")}


def build_from(args, **defaults: float):
    """Glider and launch given on the command line, checked; `defaults` where not given."""
    from ..ensemble.cases import build, check_parameters, check_setup

    case = defaults | case_of(args)
    check_parameters(case)
    return build(case, check_setup(setup_of(args)))


def writable(*paths: Path | None) -> None:
    """Fail before the work, not after it."""
    for path in paths:
        if path is None:
            continue
        folder = Path(os.path.realpath(path)).parent  # where a link leads
        if not folder.is_dir():
            raise UsageError(f"cannot write {path}: there is no folder {path.parent}")
        if path.is_dir():
            raise UsageError(f"cannot write {path}: it is a folder")
        if not os.access(folder, os.W_OK):
            raise UsageError(f"cannot write {path}: the folder {path.parent} is read-only")
        if path.exists() and not os.access(path, os.W_OK):
            raise UsageError(f"cannot write {path}: it is read-only")


def add_force(parser) -> None:
    """For commands that choose a name themselves where none is given."""
    text = "replace a file that stands there, where --out is not given"
    parser.add_argument("--force", action="store_true", help=text)


def out_of(args, default: Path) -> Path:
    """The file of --out, or the default one, which replaces nothing unless told to."""
    if args.out is None and default.exists() and not args.force:
        raise UsageError(f"{default} exists: give a name with --out, or --force to replace it")
    return args.out or default


def _suffix(path: Path | None, option: str, allowed: tuple[str, ...]) -> None:
    if path is not None and path.suffix not in allowed:
        raise UsageError(f"{option} {path}: the name must end in {' or '.join(allowed)}")


_OUTPUTS = ("store", "save", "plot", "out", "log", "plots")


def check_output(args) -> None:
    """Files to write: kinds known, places writable, none named twice."""
    _suffix(args.save, "--save", (".nc",))
    _suffix(args.plot, "--plot", (".png", ".pdf", ".svg"))
    drawn = drawn_files(args)
    writable(args.save, getattr(args, "log", None), *drawn)
    given = [(f"--{name}", getattr(args, name, None)) for name in _OUTPUTS if name != "plot"]
    given += [("--plot", path) for path in drawn]
    options: dict[Path, str] = {}
    for option, path in given:
        if path is None:
            continue
        place = Path(os.path.realpath(path))
        for other, taken in options.items():
            if other == place and taken != option:
                raise UsageError(f"{taken} and {option} both name {path}")
            if taken == "--store" and place.is_relative_to(other):
                raise UsageError(f"{option} {path} lies in the folder of --store")
        options[place] = option
    for name in ("file", "data"):
        read = getattr(args, name, None)
        if read is not None and (place := Path(os.path.realpath(read))) in options:
            raise UsageError(f"{options[place]} {read} is the file to be read")


def drawn_files(args) -> list[Path]:
    """The files of --plot: one, or one for every ending that the command adds to its name."""
    if args.plot is None:
        return []
    return [args.plot.with_stem(args.plot.stem + end) for end in args.plot_endings]


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
