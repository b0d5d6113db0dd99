"""`jaxglide optimise`."""

from pathlib import Path

from ..parameters import GRADIENT_SETUP, OBSERVED, PARAMETERS
from ._options import (
    UsageError,
    a_number,
    add_objective,
    add_output,
    add_setup,
    announce,
    drawn_files,
    fixed_of,
    print_json,
    setup_of,
    whole,
    write,
    write_drawing,
)


def add(commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "optimise",
        help="search for the best gait by gradients",
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
        help="bounds of a free parameter (the observed range)",
    )
    text = "least margin to 85 degrees in yaw, pitch and roll [deg] (10); 'none' for none"
    group.add_argument("--margin", default="10", metavar="X", help=text)
    text = "least distance between parts of the body, in its greatest chords (1); 'none'"
    group.add_argument("--clearance", default="1", metavar="X", help=text)
    group.add_argument("--starts", type=whole, default=64, metavar="N", help="starts (64)")
    group.add_argument(
        "--guess",
        action="append",
        default=[],
        metavar="NAME=X,...",
        help="a point to start from too, of all free parameters; may be given again",
    )
    text = "gaits flown first, of which the best are the starts (512)"
    group.add_argument("--screen", type=whole, default=512, metavar="N", help=text)
    group.add_argument("--steps", type=whole, default=100, metavar="N", help="most steps (100)")
    text = "most rounds of sampling around the best three at the end (20)"
    group.add_argument("--polish", type=whole, default=20, metavar="N", help=text)
    group.add_argument("--optimiser", choices=("adam", "lbfgs"), default="adam", help="(adam)")
    group.add_argument("--seed", type=whole, default=0, metavar="N", help="of the starts (0)")
    text = "keep evaluations here; the same command goes on from them"
    group.add_argument("--log", type=Path, metavar="FILE", help=text)
    group.add_argument("--rtol", type=a_number, default=1e-7, help="tolerance of a step (1e-7)")
    add_setup(parser, **GRADIENT_SETUP)
    add_output(parser, endings=("", "_paths", "_glides"))
    parser.set_defaults(run=_run)


def _bounds(args) -> dict[str, tuple[float, float]]:
    """Bounds by name of the free parameters."""
    given = {}
    for text in args.bounds:
        name, _, ends = text.partition("=")
        try:
            low, high = map(float, ends.split(":"))
        except ValueError:
            raise UsageError(f"{text!r} is not NAME=LOW:HIGH") from None
        given[name] = low, high
    names = args.free.split(",")
    for name in given:
        if name not in names:
            raise UsageError(f"--bounds {name}: it is not free")
    for name in names:
        if name not in given and name not in OBSERVED:
            raise UsageError(f"give --bounds of {name}")
    return {name: given.get(name, OBSERVED.get(name, (0.0, 0.0))) for name in names}


def _guesses(args) -> list[dict[str, float]]:
    """Points by name of the free parameters."""
    given = []
    for text in args.guess:
        try:
            pairs = [part.split("=") for part in text.split(",")]
            given.append({name: float(value) for name, value in pairs})
        except ValueError:
            raise UsageError(f"{text!r} is not NAME=X,...") from None
    return given


def _constraints(args):
    """Margin and clearance, where they are asked for."""
    from ..objectives import clearance, stability_margin

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
    """The glide of a case with its trajectory."""
    from ..cases import build
    from ..glide import simulate

    return simulate(*build(case, problem.setup), dense=True)


def _pictures(args, problem, found, best) -> None:
    """Convergence, paths of the starts, and the best glide beside the published one."""
    from ..plot import before_and_after, convergence, paths

    fixed = {name: x for name, x in problem.fixed.items() if name in ("height", "speed")}
    progress, across, glides = drawn_files(args)
    write_drawing(progress, convergence(found.history), args)
    if len(problem.names) > 1:
        write_drawing(across, paths(found.history), args)
    usual = _fly(problem, fixed)
    write_drawing(glides, before_and_after(usual, best, ("published", "best")), args)


def _run(args) -> int:
    import numpy as np

    from .._ascent import FEASIBLE
    from ..extrapolation import extrapolation
    from ..objectives import OBJECTIVES
    from ..optimise import Status, optimise, verify
    from ..problem import Evaluator, Problem

    problem = Problem(
        OBJECTIVES[args.objective].wanted,
        _bounds(args),
        _constraints(args),
        fixed=fixed_of(args),
        setup=setup_of(args),
        rtol=args.rtol,
        atol=args.rtol,
    )
    screener = Evaluator(problem, gradients=False)
    found = optimise(
        problem,
        starts=args.starts,
        guesses=_guesses(args),
        screen=args.screen,
        steps=args.steps,
        polish=args.polish,
        optimiser=args.optimiser,
        seed=args.seed,
        log=args.log,
        screener=screener,
    )
    write(lambda: found.history, None, args)
    if args.log is not None:
        announce(args.log, args)
    checked = beyond = None
    if found.feasible:
        checked = verify(problem, found.best, screener=screener)
        best = _fly(problem, {**(problem.fixed or {}), **found.best})
        beyond = extrapolation(best)
        if args.plot is not None:
            _pictures(args, problem, found, best)
    sense = OBJECTIVES[args.objective].sense
    unmet = found.history.best_violation.values > FEASIBLE
    order = np.lexsort((-found.values, unmet))
    if args.json:
        result = {
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
        if checked is not None and beyond is not None:
            result["value_at_1e-9"] = sense * checked.value
            result["gain_nearby"] = checked.gain
            result["beyond_measured"] = beyond._asdict()
        print_json(result)
        return int(not found.feasible)
    unit = OBJECTIVES[args.objective].unit
    heads = [f"{args.objective} ({unit})" if unit else args.objective]
    heads += [f"{n} ({PARAMETERS[n].unit})" if PARAMETERS[n].unit else n for n in problem.names]
    print("  ".join(f"{head:>18}" for head in (*heads, "start")))
    for k in order[:10]:
        cells = (sense * found.values[k], *found.points[k])
        row = "  ".join(f"{value:18.4f}" for value in cells)
        print(f"{row}  {Status(int(found.status[k]))!s:>18}")
    print(found)
    if beyond is not None and beyond.either > 0:
        print(f"  note: {beyond}")
    if checked is not None:
        print(
            f"  at 1e-9 {sense * checked.value:.6g} {unit}; of {checked.samples} gaits nearby "
            f"the best is {100 * checked.gain:+.3f} % better"
        )
    print(f"  {found.evaluations} gradients, {found.skipped} not finite")
    return int(not found.feasible)
