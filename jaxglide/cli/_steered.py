"""Flights under control from flags: what flies, what it senses, what steers."""

import argparse
import dataclasses
import math
from typing import Any

from .._lib.defaults import GRADIENT_SETUP
from .._lib.fields import Parameter
from ..ensemble import parts
from ..flight.ends import AngleLimit, Ground
from ._case import (
    add_glider,
    add_number,
    air_of,
    case_of,
    numbers_of,
    replaced,
    tables_of,
)
from ._options import UsageError, by_name, refuse, whole

_INPUTS = "d_psi,d_theta"
_LAWS = {
    "none": "holds the gait",
    "lqr": "linear-quadratic feedback about the steady glide",
}
_SAMPLES = Parameter("", "samples in a cycle of the waves", low=1, high=64)
_LAUNCH = Parameter("", "cycles over which the launch is planned; 0: none", low=0, high=20)
_PRICE = Parameter("", "price of the inputs of lqr", low=0, high=1e6, low_open=True)
_TOWARDS = Parameter("deg", "heading to fly at, positive to the left", low=-1e4, high=1e4)
_PACE = Parameter("deg", "largest turn in a cycle, coordinated, of --towards", low=0, high=57)
_MOST = Parameter("s", "longest flight", low=0, high=1e4, low_open=True)
_SEED = Parameter("", "which flights", low=0, high=2**31 - 1)
# by flag: field of `Senses`, what it is, and what the field is in that unit
_SENSES = {
    "angle_noise": Parameter("deg", "noise of the angles that are sensed", low=0, high=57),
    "omega_noise": Parameter("deg/s", "noise of the angular velocity", low=0, high=5700),
    "resolution": Parameter("deg", "angles are rounded to it", low=0, high=57),
    "delay": Parameter("s", "between a sample and its command", low=0, high=1),
}
_DESIGN = ("price", "launch_cycles", "towards", "pace", "to")
_BODY = ("node_set", "nodes", "body")


def add_law(parser, several: bool) -> None:
    """What steers, and how it is designed."""
    group = parser.add_argument_group("law")
    known = ", ".join(f"{name} ({said})" for name, said in _LAWS.items())
    text = f"{known}, or a file (.nc) of a controller"
    if several:
        text += "; may be repeated (default: none and lqr)"
        group.add_argument("--law", action="append", default=[], metavar="NAME", help=text)
    else:
        text += " (default: lqr)"
        group.add_argument("--law", default="lqr", metavar="NAME", help=text)
    text = f"which inputs are set, separated by commas (default: {_INPUTS})"
    group.add_argument("--inputs", default=_INPUTS, metavar="NAMES", help=text)
    add_number(group, "samples", _SAMPLES, told=8, kind=whole)
    add_number(group, "launch_cycles", _LAUNCH, 0, kind=whole)
    add_number(group, "price", _PRICE, 1.0)
    add_number(group, "towards", _TOWARDS, 0.0)
    add_number(group, "pace", _PACE, told="none; of --to 5.7")
    text = "point to fly to, to the right of the launch and forward of it [m]; may be repeated"
    group.add_argument(
        "--to", action="append", default=[], type=_point, metavar="RIGHT,FORWARD", help=text
    )


def _point(text: str) -> tuple[float, float]:
    try:
        right, forward = map(float, text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not RIGHT,FORWARD") from None
    return right, forward


def add_flight(parser) -> None:
    """What flies, what it senses, and what is random."""
    add_glider(parser, usual=GRADIENT_SETUP)
    group = parser.add_argument_group("senses")
    for name, known in _SENSES.items():
        add_number(group, name, known, told=0.0)
    text = "velocity and height are sensed; without it they are estimated"
    group.add_argument("--see-velocity", action="store_true", help=text)
    group = parser.add_argument_group("chance")
    text = "range from which a number is drawn; may be repeated"
    group.add_argument(
        "--vary", action="append", default=[], metavar="NAME=LOW:HIGH", help=text
    )
    add_number(group, "seed", _SEED, 0, kind=whole)
    add_number(group, "max_time", _MOST, 30.0)


# What is asked for


def _vary(args) -> dict[str, tuple[float, float]]:
    def named(text: str) -> tuple[str, tuple[float, float]]:
        name, _, ends = text.partition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            raise UsageError(f"--vary {text!r} is not NAME=LOW:HIGH") from None
        return name, (low, high)

    return by_name("--vary", map(named, args.vary))


def _senses(args, known):
    """Senses as given, the others as known."""
    given: dict[str, Any] = {}
    for name, about in _SENSES.items():
        if name in args.given:
            factor = math.pi / 180 if about.unit.startswith("deg") else 1.0
            given[name] = factor * getattr(args, name)
    if args.see_velocity:
        given["velocity"] = True
    return dataclasses.replace(known, **given)


def _opened(path: str):
    """The controller in a file."""
    from ..control import Controller
    from ..files import open

    found = open(path)
    if not isinstance(found, Controller):
        raise ValueError(f"{path} holds no controller but a {type(found).__name__}")
    return found


def _is_file(law: str) -> bool:
    if law in _LAWS:
        return False
    if not law.endswith(".nc"):
        known = ", ".join(_LAWS)
        raise UsageError(f"--law {law!r} is not one of {known}, nor a file (.nc)")
    return True


def environment_of(args, laws: list[str]):
    """What flies: as given, or that of the first file with what is given besides."""
    from ..control import Environment, Senses
    from ..control.controller import arguments_of

    files = [law for law in laws if _is_file(law)]
    if "lqr" not in laws:
        refuse(args, _DESIGN, f"it designs lqr, and what flies is {', '.join(laws)}")
    if not files:
        names = [name.strip() for name in args.inputs.split(",")]
        given = {"samples": args.samples} if "samples" in args.given else {}
        case, senses = case_of(args), _senses(args, Senses())
        if args.to:
            senses = dataclasses.replace(senses, place=True)
            upright = Ground(), AngleLimit(angles=("pitch", "roll"))
            case = case if "end" in args.given else dataclasses.replace(case, ends=upright)
        return Environment(case, names, vary=_vary(args), senses=senses, **given)
    refuse(args, ("inputs", "samples", *_BODY), f"{files[0]} decides it")
    known = arguments_of(_opened(files[0]).environment)
    known["case"] = _changed(args, known["case"])
    known["senses"] = _senses(args, known["senses"])
    known["vary"] = _vary(args) or known["vary"]
    return Environment(known.pop("case"), known.pop("inputs"), **known)


def _changed(args, case):
    """The case of a file with the numbers, the air and the polar given besides."""
    made, given = parts.case_of(tables_of(args)), args.given
    glider, launch, ends = case.glider, case.launch, case.ends
    if air_of(args):
        glider = dataclasses.replace(glider, air=made.glider.air)
    if {"polar", "lag"} & set(given):
        glider = dataclasses.replace(glider, aerodynamics=made.glider.aerodynamics)
    if "omega" in given:
        launch = dataclasses.replace(launch, omega=made.launch.omega)
    if "end" in given:
        ends = made.ends
    return replaced(type(case)(glider, launch, ends), numbers_of(args))


def law_of(args, law: str, environment):
    """A policy by name, or from a file, checked to fit."""
    from ..control import Constant, Controller, CoordinatedTurn, Waypoints, linear_quadratic

    if law == "none":
        policy = Constant(environment.plant.inputs)
    elif law == "lqr":
        heading, launch = math.radians(args.towards), args.launch_cycles
        policy = linear_quadratic(environment, price=args.price, heading=heading, launch=launch)
        pace = {} if args.pace is None else {"pace": math.radians(args.pace)}
        if args.to:
            policy = Waypoints(CoordinatedTurn(policy, **pace), args.to)
        elif pace:
            policy = CoordinatedTurn(policy, **pace)
    else:
        policy = _opened(law).policy
        try:
            return Controller(policy, environment)
        except ValueError as error:
            raise ValueError(f"{law}: {error}") from None
    return Controller(policy, environment)


def most_of(args, environment) -> int:
    """Samples after which a flight is cut off."""
    return math.ceil(args.max_time / float(environment.plant.interval))
