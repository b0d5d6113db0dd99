"""`jaxglide gradient`."""

from ..parameters import GRADIENT_SETUP, PARAMETERS
from ._options import add_objective, add_output, add_setup, fixed_of, print_json, setup_of


def add(commands) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "gradient",
        help="the gradient of an objective, with its check",
        description="The exact gradient of an objective with respect to chosen parameters, in "
        "their units, beside central differences of glides solved at 1e-11.",
    )
    add_objective(parser)
    add_setup(parser, **GRADIENT_SETUP)
    add_output(parser, save=False, plot=False)
    parser.set_defaults(run=_run)


def _run(args) -> int:
    import numpy as np

    from ..cases import full_case
    from ..objectives import OBJECTIVES
    from ..problem import Evaluator, Problem

    objective = OBJECTIVES[args.objective]
    names = args.free.split(",")
    fixed = fixed_of(args)
    case = full_case(fixed)
    for name in names:
        if name not in PARAMETERS:
            raise ValueError(
                f"there is no parameter {name!r}: known are {', '.join(PARAMETERS)}"
            )
        if case[name] is None:
            raise ValueError(f"{name} follows from other parameters: give its value too")
    point = np.array([case[name] for name in names])
    steps = 1e-4 * np.maximum(np.abs(point), 0.1)
    free = {
        name: (value - 3 * step, value + 3 * step)
        for name, value, step in zip(names, point, steps, strict=True)
    }
    rest = {name: value for name, value in fixed.items() if name not in names}
    problem = Problem(objective, free, fixed=rest, setup=setup_of(args))
    found = Evaluator(problem)(point[None], rtol=1e-11, atol=1e-11)
    value, gradient = float(found.values[0, 0]), found.gradients[0, 0]
    moves = np.concatenate([k * np.diag(steps) for k in (-2, -1, 1, 2)])
    near = Evaluator(problem, gradients=False)(point + moves, rtol=1e-11, atol=1e-11)
    far_left, left, right, far_right = near.values[:, 0].reshape(4, -1)
    differences = (8 * (right - left) - (far_right - far_left)) / (12 * steps)
    failed = int(not np.isfinite([value, *gradient]).all())
    units = [PARAMETERS[name].unit or "1" for name in names]
    if args.json:
        rows = {
            name: {"at": float(x), "gradient": float(g), "difference": float(d), "unit": unit}
            for name, x, g, d, unit in zip(
                names, point, gradient, differences, units, strict=True
            )
        }
        result = {"objective": args.objective, "value": value, "unit": objective.unit}
        print_json({**result, "gradient": rows})
        return failed
    print(f"{args.objective} {value:.8g} {objective.unit}".rstrip())
    print(f"{'':14}{'at':>12}{'gradient':>16}{'by differences':>16}{'apart':>10}  unit")
    for name, x, g, d, unit in zip(names, point, gradient, differences, units, strict=True):
        apart = abs(g - d) / max(abs(d), 1e-300)
        over = f"{objective.unit or '1'} per {unit}"
        print(f"{name:14}{x:12.6g}{g:16.8g}{d:16.8g}{apart:10.1e}  {over}")
    return failed
