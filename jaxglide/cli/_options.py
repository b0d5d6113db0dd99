"""What the commands share: options, checks of output files, writing.

Nothing here loads JAX, which half of the commands can do without.
"""

import argparse
import json
import math
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

from .._lib.writing import write_figure, write_netcdf


class UsageError(Exception):
    """A mistake of the user's: message on standard error, exit code 2."""


class _Once(argparse.Action):
    """Store a value; an option given twice is refused, for the first would be lost.

    `args.given` holds the options given, as typed, by the name of their value; `args.checks`
    functions of option and value that check those that are numbers.
    """

    def __call__(self, parser, namespace, values, option_string=None):
        if option_string is not None:
            if self.dest in namespace.given:
                raise argparse.ArgumentError(self, "given twice")
            namespace.given = {**namespace.given, self.dest: option_string}
        setattr(namespace, self.dest, values)


class _Append(argparse._AppendAction):
    """Add a value to those given before; `args.given` knows of it too."""

    def __call__(self, parser, namespace, values, option_string=None):
        namespace.given = {**namespace.given, self.dest: option_string}
        super().__call__(parser, namespace, values, option_string)


_NEGATIVE = re.compile(r"-\.?\d")  # -1,0,0 is a value too, as -1 is


class Parser(argparse.ArgumentParser):
    """A parser that takes every option once, by its full name, and fails in one sentence."""

    def __init__(self, **options):
        super().__init__(**options, allow_abbrev=False)
        for action in (None, "store"):
            self.register("action", action, _Once)
        self.register("action", "append", _Append)
        self._negative_number_matcher = _NEGATIVE
        self.set_defaults(given={}, checks={})

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


def three(text: str) -> tuple[float, ...]:
    parts = text.split(",")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"{text!r} is not three numbers X,Y,Z")
    return tuple(map(a_number, parts))


def add_output(
    parser: argparse.ArgumentParser,
    save: bool = True,
    plot: bool = True,
    endings: tuple[str, ...] = ("",),
) -> Any:
    """Options of files and JSON; `endings` tell the figures of --plot apart, if several.

    Returns the group of options.
    """
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
    return group


def check_ranges(args) -> None:
    """Raise `ValueError` for a number given out of range, by its option as typed."""
    for name, option in args.given.items():
        if name in args.checks:
            args.checks[name](option, getattr(args, name))


def pair(option: str, text: str) -> tuple[str, float]:
    """Name and number of NAME=VALUE."""
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise UsageError(f"{option} {text!r} is not NAME=VALUE") from None


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


_OUTPUTS = ("store", "save", "plot", "out", "log", "plots", "view", "keep")


def check_output(args) -> None:
    """Files to write: kinds known, places writable, none named twice."""
    _suffix(args.save, "--save", (".nc",))
    _suffix(args.plot, "--plot", (".png", ".pdf", ".svg"))
    drawn, view, keep = drawn_files(args), *(getattr(args, n, None) for n in ("view", "keep"))
    _suffix(view, "--view", (".html",))
    _suffix(keep, "--keep", (".nc",))
    writable(args.save, getattr(args, "log", None), view, keep, *drawn)
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


def say_where(args, *options: str) -> None:
    """Say where the results of a long run will be, before it starts.

    On standard error, and like its progress only where somebody can see it.

    Args:
        args: of the command line.
        options: those that name files, `store` or `save`.
    """
    if not sys.stderr.isatty():
        return
    places = [getattr(args, name) for name in options if name != "plot"]
    found = [str(path) for path in (*places, *drawn_files(args)) if path is not None]
    ways = " or ".join(f"--{name}" for name in options)
    told = f"results go to {', '.join(found)}" if found else f"nothing is kept without {ways}"
    print(f"jaxglide: {told}", file=sys.stderr)


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
