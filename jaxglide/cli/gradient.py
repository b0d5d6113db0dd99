"""`jaxglide gradient`."""

import math
import sys
from typing import Any

from .._lib.defaults import GRADIENT_SETUP
from ._case import add_objective, add_setup, base_of, case_of, fixed_of, free_of
from ._options import add_output, print_json

_ONE_SIDED = (-25 / 12, 4.0, -3.0, 4 / 3, -1 / 4)
"""Weights of the differences of fourth order at 0 to 4 steps."""


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    parser = new(
        description="The exact gradient of an objective with respect to chosen parameters, in "
        "their units, beside differences of glides solved at 1e-11.",
    )
    add_objective(parser)
    add_setup(parser, GRADIENT_SETUP)
    add_output(parser, save=False, plot=False)
    parser.set_defaults(run=_run)


def _point(names: list[str], base) -> dict[str, float]:
    """Where the gradient is taken: the values of the free parameters by name, checked."""
    point: dict[str, Any] = {name: base.value(name) for name in names}
    for name, value in point.items():
        if value is None:
            raise ValueError(f"{name} follows from other parameters: give its value too")
    base.check(point)
    return {name: float(value) for name, value in point.items()}


def _stencil(p, value: float) -> tuple[float, tuple[int, ...], tuple[float, ...]]:
    """Step, places in steps, and weights of differences of fourth order about a value of a
    `Parameter`; on one side of it where its range ends on the other."""
    step = 1e-4 * max(abs(value), min(0.1, p.default or 0.1))
    if value - 2 * step <= p.low:
        return step, (0, 1, 2, 3, 4), _ONE_SIDED
    if value + 2 * step >= p.high:
        return step, (0, -1, -2, -3, -4), tuple(-weight for weight in _ONE_SIDED)
    return step, (-2, -1, 1, 2), (1 / 12, -2 / 3, 2 / 3, -1 / 12)


def _found(args) -> tuple[float, dict[str, dict[str, Any]]]:
    """The value of the objective, and the rows of the table by name."""
    import numpy as np

    from ..search.evaluator import Evaluator
    from ..search.objectives import OBJECTIVES
    from ..search.problem import Problem

    fixed, base = fixed_of(args), case_of(args)
    base.check(fixed)
    at = _point(free_of(args), base.replace(fixed))
    about = {name: base.parameter(name) for name in at}
    stencils = {name: _stencil(about[name], value) for name, value in at.items()}
    free = {
        name: (at[name] + step * min(0, *places), at[name] + step * max(0, *places))
        for name, (step, places, _) in stencils.items()
    }
    rest = {name: value for name, value in fixed.items() if name not in at}
    problem = Problem(OBJECTIVES[args.objective], free, fixed=rest, **base_of(args))
    here = np.array(list(at.values()))
    found = Evaluator(problem)(here[None], rtol=1e-11, atol=1e-11)
    moves = [
        place * step * np.eye(len(at))[k]
        for k, (step, places, _) in enumerate(stencils.values())
        for place in places
    ]
    near = Evaluator(problem, gradients=False)(here + np.array(moves), rtol=1e-11, atol=1e-11)
    rows, taken = {}, 0
    for k, (name, (step, places, weights)) in enumerate(stencils.items()):
        values = near.values[taken : taken + len(places), 0]
        taken += len(places)
        rows[name] = {
            "at": float(at[name]),
            "gradient": float(found.gradients[0, 0, k]),
            "difference": float(np.dot(weights, values) / step),
            "unit": about[name].unit or "1",
        }
    return float(found.values[0, 0]), rows


def _run(args) -> int:
    from ..search.objectives import OBJECTIVES

    value, rows = _found(args)
    unit = OBJECTIVES[args.objective].unit
    if args.json:
        result = {"objective": args.objective, "value": value, "unit": unit}
        print_json({**result, "gradient": rows})
    else:
        print(f"{args.objective} {value:.8g} {unit}".rstrip())
        print(f"{'':14}{'at':>12}{'gradient':>16}{'by differences':>16}{'apart':>10}  unit")
        for name, row in rows.items():
            gradient, difference = row["gradient"], row["difference"]
            apart = abs(gradient - difference) / max(abs(difference), 1e-300)
            print(
                f"{name:14}{row['at']:12.6g}{gradient:16.8g}{difference:16.8g}{apart:10.1e}"
                f"  {unit or '1'} per {row['unit']}"
            )
    lost = [name for name, row in rows.items() if not math.isfinite(row["gradient"])]
    if not math.isfinite(value):
        print(f"jaxglide: {args.objective} is not a number there", file=sys.stderr)
    elif lost:
        by = ", ".join(lost)
        print(f"jaxglide: the gradient by {by} is not a number there", file=sys.stderr)
    return int(bool(lost) or not math.isfinite(value))
