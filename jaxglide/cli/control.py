"""`jaxglide control`."""

import math
from functools import partial
from pathlib import Path
from typing import Any

from .._lib.fields import Parameter
from ._case import add_number
from ._options import (
    Parser,
    UsageError,
    a_number,
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
from ._steered import add_flight, add_law, environment_of, law_of, most_of

_FLIGHTS = Parameter("", "random flights", low=1, high=1_000_000)
_EFFORT = {
    "updates": Parameter("", "steps of Adam", low=1, high=1_000_000, default=100),
    "flights": Parameter("", "random flights side by side", low=1, high=100_000, default=32),
    "window": Parameter("", "samples of each in an update", low=1, high=100_000, default=16),
    "rate": Parameter("", "rate of learning", low=0, high=10, low_open=True, default=3e-4),
}


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
    _add_train(partial(actions.add_parser, "train", help="make a law better by gradients"))


def _add_fly(new) -> None:
    fly = new(
        description="Fly once under control, to the ground or until an angle reaches 85 "
        "degrees.",
        epilog="Example: jaxglide control fly --height 75 --see-velocity --plot flight.png. "
        "Exit code: 0 for a flight, landed or not; 2 for wrong input.",
    )
    add_law(fly, several=False)
    add_flight(fly)
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
    add_law(compare, several=True)
    add_flight(compare)
    group = compare.add_argument_group("flights")
    add_number(group, "flights", _FLIGHTS, 100, kind=whole)
    text = "which random number the figure is drawn over (default: the first of --vary)"
    group.add_argument("--over", metavar="NAME", help=text)
    add_output(compare)
    compare.set_defaults(run=_compare)


def _add_train(new) -> None:
    train = new(
        description="Make a law better by gradients through random flights.",
        epilog="Example: jaxglide control train --height 75 --vary speed=1.5:2 --log "
        "training.log --save trained.nc; the same command goes on from the log. Then jaxglide "
        "control compare --law lqr --law trained.nc",
    )
    add_law(train, several=False)
    group = train.add_argument_group("training")
    text = "what learns: gains that change with time since launch, or a network that adds to "
    text += "the law (default: gains; of a law from a file what it has)"
    group.add_argument("--learns", choices=("gains", "network"), help=text)
    for name, known in _EFFORT.items():
        kind = a_number if name == "rate" else whole
        add_number(group, name, known, told=known.default, kind=kind)
    add_flight(train)
    output = add_output(train, plot=False)
    text = "keep the training here; the same command goes on from it"
    output.add_argument("--log", type=Path, metavar="FILE", help=text)
    train.set_defaults(run=_train)


# One flight


def _fly(args) -> int:
    import jax

    from ..control import controlled_flight, retrace

    environment = environment_of(args, [args.law])
    controller = law_of(args, args.law, environment)
    key = jax.random.key(args.seed)
    flown = controlled_flight(environment, controller.policy, key, most_of(args, environment))
    flight = retrace(environment, flown, key)
    _write_flight(args, controller, flight)
    if args.json:
        print_json(_plain(flight, controller))
    else:
        print(flight)
        print(_said(flight, controller.policy))
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


def _passed(flight, policy) -> list[tuple[float, float, float]]:
    """The points of a policy, and how near the flight came to each, seen from above [m]."""
    import numpy as np

    from ..control import target_of

    points = target_of(policy).points
    if points is None:
        return []
    path = np.asarray(flight.at(flight.sample_times(2001)))[:, :2]
    return [
        (*point.tolist(), float(np.linalg.norm(path - point, axis=1).min())) for point in points
    ]


def _said(flight, policy) -> str:
    """How near it came to its points, and what its inputs did, in a line each."""
    from ..control import histories

    lines = []
    for right, forward, distance in _passed(flight, policy):
        lines.append(f"  {f'to {right:g},{forward:g}':<14} passed {distance:.2f} m from it")
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
        "points": [
            {"right": right, "forward": forward, "distance": distance}
            for right, forward, distance in _passed(flight, controller.policy)
        ],
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
    from ..files.controllers import controlled_dataset, drawn_as

    laws = list(by_name("--law", ((law, None) for law in args.law or ("none", "lqr"))))
    environment = environment_of(args, laws)
    drawn = list(environment.bounds)
    if args.over is not None and environment.case.path(args.over) not in drawn:
        raise UsageError(f"--over {args.over}: it is not in --vary")
    if args.plot is not None and not drawn:
        raise UsageError("--plot draws over a number of --vary: give one")
    say_where(args, "save", "plot")
    from ..control import evaluate_policy

    tables = {}
    for law in laws:
        policy = law_of(args, law, environment).policy
        options = {"seed": args.seed, "samples": most_of(args, environment)}
        tables[law] = evaluate_policy(environment, policy, args.flights, **options)
        if not args.json:
            print(_line(law, tables[law]), flush=True)
    data = controlled_dataset(tables)

    def figure():
        from ..plot import share_landed

        over = drawn[0] if args.over is None else environment.case.path(args.over)
        return share_landed(data, drawn_as(drawn)[over]).figure

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


# Training


def _learner(args, environment):
    """The law that learns: gains or a network around the law asked for."""
    from ..control import GainScheduled, NeuralPolicy, Regulator

    policy = law_of(args, args.law, environment).policy
    if policy.learns:
        refuse(args, ("learns",), f"{args.law} holds a {type(policy).__name__}, which goes on")
        return policy
    if args.learns == "network":
        return NeuralPolicy.of(environment, policy, seed=args.seed)
    if not isinstance(policy, Regulator):
        raise UsageError(f"--learns gains needs the law lqr, not {args.law}: it has no gains")
    return GainScheduled.of(environment, policy)


def _train(args) -> int:
    from ..control import Controller, train_policy

    environment = environment_of(args, [args.law])
    say_where(args, "log", "save")
    effort = {name: getattr(args, name) for name in _EFFORT if name in args.given}
    learner = _learner(args, environment)
    options = {"samples": most_of(args, environment), "seed": args.seed, "log": args.log}
    found = train_policy(learner, environment, **effort, **options)

    def data():
        from ..files.controllers import controller_dataset

        return controller_dataset(Controller(found.policy, environment))

    write(data, None, args)
    if args.log is not None:
        announce(args.log, args)
    if args.json:
        print_json(_learnt(found))
    else:
        print(_progress(found))
    return 0


def _learnt(found) -> dict[str, Any]:
    """What a training came to: means over its first and its last tenth."""
    import numpy as np

    updates = len(found.losses)
    tenth = max(1, updates // 10)
    result: dict[str, Any] = {"updates": updates, "cost": {}, "landed": {}}
    for name, part in (("first", slice(tenth)), ("last", slice(-tenth, None))):
        ended = found.landed[part][np.isfinite(found.landed[part])]
        result["cost"][name] = float(np.mean(found.losses[part]))
        result["landed"][name] = float(np.mean(ended)) if ended.size else math.nan
    return result


def _progress(found) -> str:
    """The same in words."""
    said = _learnt(found)
    cost, landed = said["cost"], said["landed"]
    return (
        f"{said['updates']} updates, at first and at last:\n"
        f"  cost of a sample   {cost['first']:.4g}   {cost['last']:.4g}\n"
        f"  flights that land  {landed['first']:.3g}   {landed['last']:.3g}, of those that end"
    )
