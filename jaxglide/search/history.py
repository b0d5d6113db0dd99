"""The history of an optimisation: what every step tried, and what came of it."""

import json
from typing import Any

import numpy as np
import xarray as xr

from .._lib.units import in_file
from .._lib.units import labelled as with_unit
from ..ensemble.records import stamp
from .ascent import Best
from .problem import Evaluation, Problem


def row(starts: int, index, points, found: Evaluation, slope) -> dict[str, np.ndarray]:
    """What a step tried at points (k, n) of the starts `index` (k,); the others are NaN."""
    rows = {
        "point": points,
        "value": found.values[:, 0],
        "violation": np.maximum(-found.slacks, 0).max(axis=1, initial=0.0),
        "slope": slope,
    }
    full = {name: np.full((starts, *part.shape[1:]), np.nan) for name, part in rows.items()}
    for name, part in rows.items():
        full[name][index] = part
    return full


def labelled(
    problem: Problem,
    record: list[dict[str, np.ndarray]],
    flown: list[tuple[int, int]],
    best: Best,
    status: np.ndarray,
    meanings: dict[int, str],
    settings: dict[str, Any],
) -> xr.Dataset:
    """Steps and results of an optimisation, labelled.

    Args:
        problem: what was maximised.
        record: rows of the steps that followed gradients, then of the rounds of sampling.
        flown: gradients and other glides that each of them took.
        best: the best of every start.
        status, meanings: how each start ended, (S,), and what that means.
        settings: kept as attributes.
    """
    unit, name = problem.objective.unit, problem.objective.name
    # name: (dimensions, values, unit, long name)
    shapes = {"point": (len(problem.names),), "value": (), "violation": (), "slope": ()}
    steps = {
        key: np.array([step[key] for step in record]).reshape(len(record), len(status), *shape)
        for key, shape in shapes.items()
    }
    each, at = ("step", "start"), "parameter"
    about = [problem.base.parameter(name) for name in problem.names]
    table = {
        "point": ((*each, at), steps["point"], "", "free parameters, in their units"),
        "value": (each, steps["value"], unit, name),
        "violation": (each, steps["violation"], "", "largest violation over its scale"),
        "slope": (each, steps["slope"], "", "norm of the ascent direction"),
        "gradients": ("step", [n for n, _ in flown], "", "gradients that the step took"),
        "glides": ("step", [n for _, n in flown], "", "glides without gradients it took"),
        "best_point": (("start", at), best.points, "", "best point of the start"),
        "best_value": ("start", best.values, unit, f"{name} there"),
        "best_violation": ("start", best.violation, "", "largest violation there"),
        "status": ("start", status.astype(np.int32), "", "how the start ended"),
    }
    data = xr.Dataset(
        {
            key: (dims, values, with_unit(unit, long_name))
            for key, (dims, values, unit, long_name) in table.items()
        },
        coords={
            "parameter": list(problem.names),
            "unit": (at, [in_file(p.unit) or "1" for p in about]),
            "low": (at, problem.low, with_unit("mixed", "lower bound")),
            "high": (at, problem.high, with_unit("mixed", "upper bound")),
        },
    )
    data["status"].attrs |= {
        "flag_values": np.array(list(meanings), np.int32),
        "flag_meanings": " ".join(text.replace(" ", "_") for text in meanings.values()),
    }
    settings = {"problem": json.dumps(problem.describe()), **settings}
    return stamp(data, settings, "optimisation")
