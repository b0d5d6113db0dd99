"""`jaxglide optimise`."""

import math
import sys
from pathlib import Path
from typing import Any

from .._lib.defaults import GRADIENT_SETUP, SEARCH_TOLERANCE
from .._lib.fields import Parameter
from ._case import (
    add_number,
    add_objective,
    add_setup,
    add_tolerances,
    base_of,
    case_of,
    fixed_of,
    free_of,
)
from ._options import (
    UsageError,
    add_output,
    announce,
    by_name,
    drawn_files,
    pair,
    print_json,
    say_where,
    whole,
    write,
    write_drawing,
)

# as `optimum.optimise` has them, which takes a second to load
EFFORT = {
    name: Parameter("", text, low=low, high=high, default=default)
    for name, text, low, high, default in (
        ("starts", "starts", 1, 100_000, 64),
        ("screen", "gaits flown first, the best are the starts; 0: none", 0, 10_000_000, 512),
        ("steps", "most steps", 1, 1_000_000, 100),
        ("polish", "most rounds of sampling around the best three", 0, 1_000_000, 20),
        ("seed", "which starts", 0, 2**63 - 1, 0),
    )
}
"""How much is done: the numbers of a search."""


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    parser = new(
        description="Make an objective as good as it can be, from many starts at once, under a "
        "margin of stability. Ctrl-C ends with the best so far.",
        epilog="Example: jaxglide optimise --free theta_m,nu_theta,d_psi --bounds "
        "d_psi=-10:40 --log best.jsonl --save best.nc --plot best.png",
    )
    add_objective(parser)
    group = parser.add_argument_group("search")
    group.add_argument(
        "--bounds",
        action="append",
        default=[],
        metavar="NAME=LOW:HIGH",
        help="bounds of a free parameter (within its range; default: as observed in animals); "
        "may be repeated",
    )
    text = "least margin to 85 degrees in yaw, pitch and roll [deg] (any number, or none; "
    text += "default: 10)"
    group.add_argument("--margin", default="10", metavar="X", help=text)
    text = "least distance between parts of the body [greatest chords] (any number, or none; "
    group.add_argument("--clearance", default="1", metavar="X", help=f"{text}default: 1)")
    group.add_argument(
        "--guess",
        action="append",
        default=[],
        metavar="NAME=X,...",
        help="a point to start from too, of all free parameters; may be repeated",
    )
    for name, known in EFFORT.items():
        add_number(group, name, known, told=known.default, kind=whole)
    text = "rule of the steps (default: adam)"
    group.add_argument("--optimiser", choices=("adam", "lbfgs"), help=text)
    add_tolerances(parser, SEARCH_TOLERANCE)
    add_setup(parser, GRADIENT_SETUP)
    output = add_output(parser, endings=("", "_paths", "_glides"))
    text = "keep evaluations here; the same command goes on from them"
    output.add_argument("--log", type=Path, metavar="FILE", help=text)
    parser.set_defaults(run=_run)


def _bounds(args) -> dict[str, tuple[float, float]]:
    """Bounds by name of the free parameters."""

    def named(text: str) -> tuple[str, tuple[float, float]]:
        name, _, ends = text.partition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            raise UsageError(f"{text!r} is not NAME=LOW:HIGH") from None
        return name, (low, high)

    given, names = by_name("--bounds", map(named, args.bounds)), free_of(args)
    for name in given:
        if name not in names:
            raise UsageError(f"--bounds {name}: it is not free")
    case, bounds = case_of(args), {}
    for name in names:
        found = given.get(name, case.parameter(name).observed)
        if found is None:
            raise UsageError(f"give --bounds of {name}")
        bounds[name] = found
    return bounds


def _guesses(args) -> list[dict[str, float]]:
    """Points by name of the free parameters."""
    return [
        by_name("--guess", (pair("--guess", part) for part in text.split(",")))
        for text in args.guess
    ]


def _constraints(args):
    """Margin and clearance, where they are asked for."""
    from ..search.objectives import clearance, stability_margin

    asked = []
    for objective, text, scale in (
        (stability_margin, args.margin, 10.0),
        (clearance, args.clearance, 1.0),
    ):
        if text == "none":
            continue
        try:
            asked.append(objective.at_least(float(text), scale))
        except ValueError:
            option = objective.name.removeprefix("stability_")
            raise UsageError(f"--{option} {text!r} is not a number nor 'none'") from None
    return tuple(asked)


def _fly(problem, case):
    """The glide of a case with its trajectory, solved as the problem says."""
    from ..flight.glide import simulate

    options = {"rtol": problem.rtol, "atol": problem.atol, "max_time": problem.max_time}
    return simulate(case.glider, case.launch, ends=case.ends, **options, dense=True)


def _draw(args, problem, found, best) -> None:
    """Convergence, paths of the starts, and the best glide beside the published one."""
    from ..plot import before_and_after, convergence, paths

    progress, across, glides = drawn_files(args)
    write_drawing(progress, convergence(found.history), args)
    if len(problem.names) > 1:
        write_drawing(across, paths(found.history), args)
    if best is None:
        print("jaxglide: no picture of the best glide: there is none", file=sys.stderr)
        return
    kept = ("launch.height", "launch.speed")
    fixed = {name: x for name, x in problem.fixed.items() if problem.case.path(name) in kept}
    usual = _fly(problem, problem.case.replace(fixed))
    write_drawing(glides, before_and_after(usual, best, ("published", "best")), args)


def _problem(args):
    """What is asked for."""
    from ..search.objectives import OBJECTIVES
    from ..search.problem import Problem

    return Problem(
        OBJECTIVES[args.objective].wanted,
        _bounds(args),
        _constraints(args),
        fixed=fixed_of(args),
        **base_of(args),
        rtol=args.rtol,
        atol=args.atol,
    )


def _plain(args, found, sense: int) -> dict[str, Any]:
    """What was found as one JSON object."""
    from ..search.optimum import Status

    return {
        "objective": args.objective,
        "value": sense * found.value,
        "feasible": found.feasible,
        "best": found.best,
        "slacks": found.slacks.tolist(),
        "reason": found.reason,
        "gradients": found.evaluations,
        "not_finite": found.skipped,
        "status": {str(s): int((found.status == s).sum()) for s in Status},
    }


def _run(args) -> int:
    from ..flight.extrapolation import extrapolation
    from ..search.evaluator import Evaluator
    from ..search.objectives import OBJECTIVES
    from ..search.optimum import optimise, verify

    problem, sense = _problem(args), OBJECTIVES[args.objective].sense
    say_where(args, "log", "save", "plot")
    screener = Evaluator(problem, gradients=False)
    effort = {
        name: getattr(args, name) for name in (*EFFORT, "optimiser") if name in args.given
    }
    try:
        found = optimise(
            problem, **effort, guesses=_guesses(args), log=args.log, screener=screener
        )
    except KeyboardInterrupt:
        print("jaxglide: interrupted before anything was found", file=sys.stderr)
        return 1
    if not math.isfinite(found.value):
        if args.json:
            print_json(_plain(args, found, sense))
        print(f"jaxglide: {found.reason}: there is nothing to write", file=sys.stderr)
        return 1
    write(lambda: found.history, None, args)
    if args.log is not None:
        announce(args.log, args)
    if not args.json:
        print(found)
    checked = best = beyond = None
    if found.feasible:
        best = _fly(problem, problem.at(found.best))
        checked, beyond = verify(problem, found.best, screener=screener), extrapolation(best)
    if args.plot is not None:
        _draw(args, problem, found, best)
    if args.json:
        result = _plain(args, found, sense)
        if checked is not None and beyond is not None:
            result["value_at_1e-9"] = sense * checked.value
            result["gain_nearby"] = checked.gain
            result["beyond_measured"] = beyond._asdict()
        print_json(result)
        return int(not found.feasible)
    if checked is not None and beyond is not None:
        print(checked)
        if beyond.either > 0:
            print(f"  note: {beyond}")
    return int(not found.feasible)
