"""`jaxglide control`."""

import math
from functools import partial
from pathlib import Path
from typing import Any

from .._lib.defaults import GRADIENT_SETUP
from .._lib.fields import Parameter
from ..ensemble import parts
from ._case import (
    add_glider,
    add_number,
    air_of,
    case_of,
    numbers_of,
    replaced,
    tables_of,
)
from ._options import (
    Parser,
    UsageError,
    add_output,
    announce,
    by_name,
    drawn_files,
    print_json,
    refuse,
    say_where,
    whole,
    write,
    write_drawing,
)

_INPUTS = "d_psi,d_theta"
_LAWS = {
    "none": "holds the gait",
    "lqr": "linear-quadratic feedback about the steady glide",
}
_SAMPLES = Parameter("", "samples in a cycle of the waves", low=1, high=64)
_LAUNCH = Parameter("", "cycles over which the launch is planned; 0: none", low=0, high=20)
_PRICE = Parameter("", "price of the inputs of lqr", low=0, high=1e6, low_open=True)
_TOWARDS = Parameter("deg", "heading to fly at, positive to the left", low=-1e4, high=1e4)
_MOST = Parameter("s", "longest flight", low=0, high=1e4, low_open=True)
_SEED = Parameter("", "which flights", low=0, high=2**31 - 1)
_FLIGHTS = Parameter("", "random flights", low=1, high=1_000_000)
# by flag: field of `Senses`, what it is, and what the field is in that unit
_SENSES = {
    "angle_noise": Parameter("deg", "noise of the angles that are sensed", low=0, high=57),
    "omega_noise": Parameter("deg/s", "noise of the angular velocity", low=0, high=5700),
    "resolution": Parameter("deg", "angles are rounded to it", low=0, high=57),
    "delay": Parameter("s", "between a sample and its command", low=0, high=1),
}
_DESIGN = ("inputs", "samples", "price", "launch_cycles", "towards")
_BODY = ("node_set", "nodes", "body")


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    control = new(
        description="Fly a snake that steers its own glide, and compare what steers it.",
        epilog="jaxglide control ACTION --help lists the options of an action.",
    )
    actions = control.add_subparsers(
        title="actions", dest="action", required=True, metavar="ACTION", parser_class=Parser
    )
    _add_fly(partial(actions.add_parser, "fly", help="fly once, and show what was told"))
    _add_compare(partial(actions.add_parser, "compare", help="which laws land, how often"))


def _add_fly(new) -> None:
    fly = new(
        description="Fly once under control, to the ground or until an angle reaches 85 "
        "degrees.",
        epilog="Example: jaxglide control fly --height 75 --see-velocity --plot flight.png. "
        "Exit code: 0 for a flight, landed or not; 2 for wrong input.",
    )
    _add_law(fly, several=False)
    _add_flight(fly)
    output = add_output(fly, endings=("", "_portrait"))
    text = "write a page (.html) that shows the flight in 3D, and what was told"
    output.add_argument("--view", metavar="FILE", type=Path, help=text)
    text = "write the law and what it flies (.nc), for --law"
    output.add_argument("--keep", metavar="FILE", type=Path, help=text)
    fly.set_defaults(run=_fly)


def _add_compare(new) -> None:
    compare = new(
        description="Fly the same random flights under several laws, and count who lands.",
        epilog="Example: jaxglide control compare --law none --law lqr --height 75 "
        "--see-velocity --vary speed=1.5:2 --plot landed.png",
    )
    _add_law(compare, several=True)
    _add_flight(compare)
    group = compare.add_argument_group("flights")
    add_number(group, "flights", _FLIGHTS, 100, kind=whole)
    text = "which random number the figure is drawn over (default: the first of --vary)"
    group.add_argument("--over", metavar="NAME", help=text)
    add_output(compare)
    compare.set_defaults(run=_compare)


def _add_law(parser, several: bool) -> None:
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


def _add_flight(parser) -> None:
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
    import dataclasses

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


def _environment(args, laws: list[str]):
    """What flies: as given, or that of the first file with what is given besides."""
    from ..control import Environment, Senses
    from ..control.controller import arguments_of

    files = [law for law in laws if _is_file(law)]
    if not files:
        names = [name.strip() for name in args.inputs.split(",")]
        given = {"samples": args.samples} if "samples" in args.given else {}
        case = case_of(args)
        return Environment(
            case, names, vary=_vary(args), senses=_senses(args, Senses()), **given
        )
    own = _DESIGN if len(files) == len(laws) else ("inputs", "samples")
    refuse(args, (*own, *_BODY), f"{files[0]} decides it")
    known = arguments_of(_opened(files[0]).environment)
    known["case"] = _changed(args, known["case"])
    known["senses"] = _senses(args, known["senses"])
    known["vary"] = _vary(args) or known["vary"]
    return Environment(known.pop("case"), known.pop("inputs"), **known)


def _changed(args, case):
    """The case of a file with the numbers, the air and the polar given besides."""
    import dataclasses

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


def _law(args, law: str, environment):
    """A policy by name, or from a file, checked to fit."""
    from ..control import Constant, Controller, linear_quadratic

    if law == "none":
        policy = Constant(environment.plant.inputs)
    elif law == "lqr":
        heading, launch = math.radians(args.towards), args.launch_cycles
        policy = linear_quadratic(environment, price=args.price, heading=heading, launch=launch)
    else:
        policy = _opened(law).policy
        try:
            return Controller(policy, environment)
        except ValueError as error:
            raise ValueError(f"{law}: {error}") from None
    return Controller(policy, environment)


def _most(args, environment) -> int:
    """Samples after which a flight is cut off."""
    return math.ceil(args.max_time / float(environment.plant.interval))


# One flight


def _fly(args) -> int:
    import jax

    from ..control import controlled_flight, retrace

    environment = _environment(args, [args.law])
    controller = _law(args, args.law, environment)
    key = jax.random.key(args.seed)
    flown = controlled_flight(environment, controller.policy, key, _most(args, environment))
    flight = retrace(environment, flown, key)
    _write_flight(args, controller, flight)
    if args.json:
        print_json(_plain(flight, controller))
    else:
        print(flight)
        print(_said(flight))
    return 0


def _write_flight(args, controller, flight) -> None:
    """What --save, --plot, --view and --keep ask for."""

    def data():
        from ..files.glides import glide_dataset

        return glide_dataset(flight)

    write(data, None, args)
    if args.keep is not None:
        from ..files import save

        save(controller, args.keep)
        announce(args.keep, args)
    if args.plot is not None:
        from .. import plot

        response, portrait = drawn_files(args)
        write_drawing(response, plot.response(flight, controller.policy), args)
        write_drawing(portrait, plot.phase_portrait(flight, ("yaw", "pitch", "roll")), args)
    if args.view is not None:
        from .. import view

        title = f"{args.law}: {flight.ending}"
        view.view(flight, args.view, title=title, policies=[controller.policy])
        announce(args.view, args)


def _said(flight) -> str:
    """What its inputs did, in a line each."""
    from ..control import histories

    lines = []
    for one in histories(flight, flight.sample_times(401)):
        low, high = one.position.min(), one.position.max()
        unit = f" {one.unit}" if one.unit else ""
        lines.append(
            f"  {one.name:<14} {low:.2f} to {high:.2f}{unit}, of {one.low:g} to {one.high:g}"
        )
    return "\n".join(lines)


def _plain(flight, controller) -> dict[str, Any]:
    """What `--json` prints of a flight."""
    import numpy as np

    from ..control import histories, target_of

    told = histories(flight, flight.sample_times(401))
    target = target_of(controller.policy)
    turns = zip(("yaw", "pitch", "roll"), np.rad2deg(flight.max_angles), strict=True)
    return {
        "outcome": flight.ending,
        "time": float(flight.time),
        "landing_point": np.asarray(flight.landing_point).tolist(),
        "path_length": float(flight.path_length),
        "max_angles_deg": {name: float(value) for name, value in turns},
        "heading_deg": None if target.heading is None else math.degrees(target.heading),
        "inputs": {
            one.name: {
                "unit": one.unit,
                "lowest": float(one.position.min()),
                "highest": float(one.position.max()),
            }
            for one in told
        },
    }


# Many flights


def _compare(args) -> int:
    from ..files.controllers import flights_dataset

    laws = list(by_name("--law", ((law, None) for law in args.law or ("none", "lqr"))))
    environment = _environment(args, laws)
    drawn = list(environment.bounds)
    if args.over is not None and environment.case.path(args.over) not in drawn:
        raise UsageError(f"--over {args.over}: it is not in --vary")
    if args.plot is not None and not drawn:
        raise UsageError("--plot draws over a number of --vary: give one")
    say_where(args, "save", "plot")
    from ..control import evaluate_policy

    tables = {}
    for law in laws:
        policy = _law(args, law, environment).policy
        options = {"seed": args.seed, "samples": _most(args, environment)}
        tables[law] = evaluate_policy(environment, policy, args.flights, **options)
        if not args.json:
            print(_line(law, tables[law]), flush=True)
    data = flights_dataset(tables)

    def figure():
        from ..plot import share_landed

        over = drawn[0] if args.over is None else environment.case.path(args.over)
        return share_landed(data, over).figure

    write(lambda: data, figure, args)
    if args.json:
        print_json({law: _counted(table) for law, table in tables.items()})
    return 0


def _counted(table) -> dict[str, Any]:
    """What many flights of one law come to."""
    import numpy as np

    landed = np.asarray(table["landed"].values, bool)
    far = np.hypot(*table["position"].values[landed, :2].T) if landed.any() else np.array([])
    return {
        "flights": int(landed.size),
        "landed": int(landed.sum()),
        "distance": float(np.median(far)) if far.size else math.nan,
        "time": float(np.median(table["time"].values)),
    }


def _line(law: str, table) -> str:
    """The same in words."""
    found = _counted(table)
    share = 100 * found["landed"] / found["flights"]
    said = f"{law}: {found['landed']} of {found['flights']} flights land ({share:.3g} %)"
    if found["landed"]:
        said += f", {found['distance']:.1f} m from the launch (median)"
    return said
