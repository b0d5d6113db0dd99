"""What flies, from flags: numbers, each described by the field that owns it, and parts."""

import argparse
import inspect
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np

from .._lib.checks import check_integer
from .._lib.fields import Parameter, parameters_of
from ..air.air import Gust, ShearWind, Turbulence, UniformWind
from ..body.sections import NODES_RANGE, NodeSet
from ..ensemble import parts
from ..ensemble.base import check_setup, published_case
from ..flight.case import Case
from ..flight.dynamics import Glider
from ..flight.ends import Outcome
from ..flight.glide import simulate
from ..flight.launch import Launch
from ..loads.aerodynamics import LaggingCirculation
from ._help import number_help
from ._options import UsageError, a_number, by_name, pair, three, whole

TOLERANCE: float = inspect.signature(simulate).parameters["rtol"].default
"""Relative and absolute tolerance of a glide."""

_GROUPS = {
    "gait": ("nu_theta", "theta_m", "psi_m", "d_psi", "d_theta", "f_theta"),
    "body": ("svl", "mass", "neck_fraction", "gyration"),
    "launch": ("height", "speed", "elevation", "heading"),
    "air": ("lift_scale", "drag_scale", "gravity", "air_density", "kinematic_viscosity"),
}
_FOLLOWS = {
    "theta_m": "on the shape line",
    "mass": "from the length",
    "speed": "from wing loading",
    "gyration": "none, all mass lies on the backbone",
}
_SOLVER = {
    name: Parameter("", f"{kind} tolerance", low=0, high=0.1, low_open=True)
    for name, kind in (("rtol", "relative"), ("atol", "absolute"))
}
_WINDS = {"wind": "uniform", "shear": "shear", "gust": "gust", "turbulence": "turbulence"}
# by flag: what owns it, and which of its fields it is
_PARTS: dict[str, tuple[type, str]] = {
    "wind": (UniformWind, "velocity"),
    "shear": (ShearWind, "velocity"),
    "shear_height": (ShearWind, "reference_height"),
    "shear_exponent": (ShearWind, "shear_exponent"),
    "gust": (Gust, "velocity"),
    "gust_start": (Gust, "gust_start"),
    "gust_length": (Gust, "gust_length"),
    "turbulence": (Turbulence, "intensity"),
    "turbulence_length": (Turbulence, "length_scale"),
    "lag": (LaggingCirculation, "lag"),
    "lag_share": (LaggingCirculation, "share"),
    "omega": (Launch, "omega"),
}
_VECTORS = ("wind", "shear", "gust", "omega")
SETUP = ("polar", "node_set", "nodes")
PARTS = ("body", *_PARTS, "turbulence_seed", "end")
"""Flags of parts, by the name of their value."""
_ENDS = "ground=Z, angle=LIMIT, angle=LIMIT:pitch,roll, plane=NX,NY,NZ,D nor time=T"


# Numbers


def add_number(
    group,
    name: str,
    known: Parameter,
    default: float | None = None,
    *,
    told: str | float | None = None,
    kind=a_number,
) -> None:
    """An option for one number, or for three.

    Args:
        group: of options.
        name: of the value.
        known: what is known of it.
        default: what it is where it is not given.
        told: the same in words, for the help.
        kind: `a_number`, `whole` or `three`.
    """
    group.add_argument(
        f"--{name.replace('_', '-')}",
        type=kind,
        metavar={whole: "N", three: "X,Y,Z"}.get(kind, "X"),
        default=default,
        help=number_help(known, default if told is None else told, kind is three),
    )
    checks = group.get_default("checks")
    group.set_defaults(checks={**checks, name: partial(check_number, known=known)})


def check_number(option: str, value: Any, known: Any) -> Any:
    """The value of an option; `ValueError` where it is out of range."""
    if isinstance(value, int):
        check_integer(option, value, int(known.low), int(known.high))
    else:
        known.check(option, value)
    return value


def add_tolerances(parser: argparse.ArgumentParser, default: float = TOLERANCE) -> Any:
    """How a glide is solved; returns the group of options."""
    group = parser.add_argument_group("solver")
    for name, known in _SOLVER.items():
        add_number(group, name, known, default)
    return group


def add_glider(
    parser: argparse.ArgumentParser,
    held: float | None = None,
    *,
    launched: bool = True,
    usual: Mapping[str, str] | None = None,
) -> None:
    """Glider and launch; a glide held, from a speed [m/s], stays in a plane without heading.

    Args:
        parser: of the command.
        held: the speed.
        launched: whether there is a launch at all.
        usual: as in `add_setup`.
    """
    base = published_case()
    for title, names in _GROUPS.items():
        if title == "launch" and not launched:
            continue
        group = parser.add_argument_group(title)
        for name in names:
            if held is not None and name == "heading":
                continue
            told = held if name == "speed" and held else _FOLLOWS.get(name)
            told = float(base.value(name)) if told is None else told
            add_number(group, name, base.parameter(name), told=told)
    add_setup(parser, usual, held=held is not None or not launched)


def numbers_of(args) -> dict[str, float]:
    """The glider's and launch's numbers given on the command line, by name."""
    names = [name for group in _GROUPS.values() for name in group]
    return {name: getattr(args, name) for name in names if name in args.given}


# Parts


def _polar(text: str) -> str | Path:
    if text in parts.POLARS:
        return text
    if not text.endswith(".csv"):
        known = ", ".join(parts.POLARS)
        raise argparse.ArgumentTypeError(
            f"{text!r} is not one of {known}, nor a file whose name ends in .csv"
        )
    return Path(text)


def add_setup(
    parser: argparse.ArgumentParser, usual: Mapping[str, str] | None = None, held: bool = False
) -> None:
    """Polar, nodes, and parts other than the published snake's.

    Args:
        parser: of the command.
        usual: defaults, by name.
        held: whether only a uniform wind has a place, and no end.
    """
    group = parser.add_argument_group("setup")
    usual, sets = usual or {}, get_args(NodeSet)
    polar, node_set = usual.get("polar", parts.POLARS[0]), usual.get("node_set", sets[0])
    text = f"{', '.join(parts.POLARS)}, or a table (.csv) of angle_of_attack [deg], lift, drag"
    group.add_argument(
        "--polar", type=_polar, default=polar, metavar="NAME", help=f"{text} (default: {polar})"
    )
    text = f"places of the nodes (default: {node_set})"
    group.add_argument("--node-set", choices=sets, default=node_set, help=text)
    low, high = NODES_RANGE
    nodes = Parameter("", "nodes along the body", low=low, high=high)
    add_number(group, "nodes", nodes, told="70, gauss: 60", kind=whole)
    _add_parts(parser, held)


def _add_parts(parser: argparse.ArgumentParser, held: bool) -> None:
    """Parts; a held glide has no place for a wind that changes, and ends at the ground."""
    axes = "X is to the right, Y forward, Z up"
    axes += "" if held else "; --turbulence may drift with a --wind"
    group = parser.add_argument_group("parts", axes)
    text = (
        "a body by its table (.csv): position [m], chord [m], density [kg/m], point_mass [kg]"
    )
    group.add_argument("--body", type=Path, metavar="FILE", help=text)
    for name, (kind, field) in _PARTS.items():
        if held and name != "wind":
            continue
        known = parameters_of(kind)[field]
        of_number = three if name in _VECTORS else a_number
        told = known.default if "_" in name else "none"
        add_number(group, name, known, told=told, kind=of_number)
    if held:
        return
    seed = Parameter("", "which turbulence", low=0, high=2**63 - 1)
    add_number(group, "turbulence_seed", seed, told="0", kind=whole)
    text = f"what ends the flight: {_ENDS.replace('nor', 'or')}; may be repeated. Beside the "
    text += "default, ground=0 and angle=85, or in place of these; ground=none takes it away"
    group.add_argument("--end", action="append", default=[], metavar="KIND=VALUE", help=text)


def air_of(args) -> dict[str, Any]:
    """The table of the air."""
    given = args.given
    for name in given:
        owner = name.partition("_")[0]
        if name in (*_PARTS, "turbulence_seed") and owner != name and owner not in given:
            raise UsageError(f"{given[name]} does not apply: give --{owner} too")
    kinds = [name for name in _WINDS if name in given]
    drifting = kinds == ["wind", "turbulence"]
    if len(kinds) > 1 and not drifting:
        raise UsageError(f"{given[kinds[0]]} and {given[kinds[1]]} are two winds: give one")
    if not kinds:
        return {}
    kind = kinds[-1]
    owner = _PARTS[kind][0]
    table = {f: getattr(args, n) for n, (o, f) in _PARTS.items() if o is owner and n in given}
    if drifting:
        table["velocity"] = args.wind
    if "turbulence_seed" in given:
        table["seed"] = args.turbulence_seed
    return {"kind": _WINDS[kind], **table}


def _end(text: str) -> dict[str, Any]:
    """The table of an end; only its kind where there is to be none."""
    kind, _, value = text.partition("=")
    if kind in ("ground", "angle") and value == "none":
        return {"kind": kind}
    table: dict[str, Any] = {"kind": kind}
    try:
        if kind == "angle":
            limit, colon, names = value.partition(":")
            table |= {"limit": float(limit)} | ({"angles": names.split(",")} if colon else {})
        elif kind == "plane":
            *normal, offset = map(float, value.split(","))
            if len(normal) != 3:
                raise ValueError
            table |= {"normal": normal, "offset": offset}
        else:
            table[{"ground": "level", "time": "end_time"}[kind]] = float(value)
    except (KeyError, ValueError):
        raise UsageError(f"--end {text!r} is not {_ENDS}") from None
    for name, known in parameters_of(parts.ENDS[kind]).items():
        if name in table:
            known.check(f"--end {kind}", table[name])
    return table


def _ends(args) -> list[dict[str, Any]]:
    """Tables of all ends: those given, and the usual ones of kinds that are not."""
    given = [_end(text) for text in args.end]
    usual = [{"kind": kind} for kind in ("ground", "angle")]
    kinds = [table["kind"] for table in given]
    left = [table for table in usual if table["kind"] not in kinds]
    return left + [table for table in given if len(table) > 1]


def tables_of(args) -> dict[str, Any]:
    """The parts of the flags as tables; see `parts.case_of`."""
    nodes = check_setup({"node_set": args.node_set, "nodes": args.nodes})
    polar = args.polar
    tables: dict[str, Any] = {
        "body": {"node_set": nodes["node_set"], "nodes": nodes["nodes"]},
        "polar": {"file": polar} if isinstance(polar, Path) else {"name": polar},
        "air": air_of(args),
    }
    if getattr(args, "body", None) is not None:
        tables["body"]["file"] = args.body
    if "lag" in args.given:
        lagging = {
            f: getattr(args, n) for n, (o, f) in _PARTS.items() if o is LaggingCirculation
        }
        given = {name: value for name, value in lagging.items() if value is not None}
        tables["aerodynamics"] = {"kind": "lagging", **given}
    if "omega" in args.given:
        tables["launch"] = {"omega": args.omega}
    if "end" in args.given:
        tables["ends"] = _ends(args)
    return tables


# What they come to


def setup_of(args) -> dict:
    """The setup given on the command line."""
    return {name: getattr(args, name) for name in SETUP}


def base_of(args) -> dict[str, Any]:
    """What a study or a problem varies, as its argument: a setup, or a case with parts."""
    plain = args.polar in parts.POLARS[:2] and not any(name in args.given for name in PARTS)
    return {"setup": setup_of(args)} if plain else {"case": parts.case_of(tables_of(args))}


def case_of(args, **defaults: float) -> Case:
    """The case given on the command line; `defaults` for numbers that are not given."""
    case, numbers = parts.case_of(tables_of(args)), numbers_of(args)
    for name in numbers:
        try:
            case.path(name)
        except ValueError:
            raise UsageError(
                f"{args.given[name]} does not apply: {args.body} decides it"
            ) from None
    return replaced(case, defaults | numbers)


def replaced(case: Case, values: Mapping[str, float]) -> Case:
    """The case with other numbers; `ValueError` where one that follows is out of range."""
    if not values:
        return case
    case = case.replace(values)
    case.check({path: case.value(path) for path in case.follow})
    return case


def build_from(args, **defaults: float) -> tuple[Glider, Launch]:
    """Glider and launch of `case_of`."""
    case = case_of(args, **defaults)
    return case.glider, case.launch


def computed(codes) -> Any:
    """Whether flights that ended with these codes were computed to their end."""
    lost = Outcome.OUT_OF_TIME, Outcome.OUT_OF_STEPS, Outcome.NON_FINITE
    return ~np.isin(codes, lost)


# Problems


def add_objective(parser: argparse.ArgumentParser) -> None:
    """The objective, the free parameters and the fixed ones."""
    from ..search.objectives import OBJECTIVES

    group = parser.add_argument_group("problem")
    names, usual = tuple(OBJECTIVES), "landing_distance"
    text = f"what is to become better (default: {usual})"
    group.add_argument("--objective", choices=names, default=usual, help=text)
    text = "parameters, separated by commas (default: theta_m,nu_theta,d_psi)"
    group.add_argument("--free", default="theta_m,nu_theta,d_psi", metavar="NAMES", help=text)
    text = "another parameter's value; may be repeated"
    group.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE", help=text)


def free_of(args) -> list[str]:
    """Names given with --free."""
    return list(by_name("--free", ((name.strip(), None) for name in args.free.split(","))))


def fixed_of(args) -> Mapping[str, float]:
    """Values given with --fix, by name."""
    return by_name("--fix", (pair("--fix", text) for text in args.fix))
