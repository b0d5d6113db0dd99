"""The log of an optimisation as a dataset."""

import json
from pathlib import Path

import numpy as np
import xarray as xr

from .._lib.formats import marked
from ..search.journal import read_log


def log_dataset(path: str | Path) -> xr.Dataset:
    """What the log of an optimisation holds, whether that has ended or not.

    Args:
        path: the log (.jsonl).

    Returns:
        Dataset over `row`, a point of a start that was evaluated, `parameter` and `quantity`
        (the objective, then the slacks of the constraints): `evaluation` and `start` say which,
        `point` where, `value` and `gradient` what was found, in the parameters' own units; NaN
        where no gradient was asked for. The attribute `asked` is the search, as JSON.

    Raises:
        ValueError: it is no log, or a line of it is damaged.
        OSError: it cannot be read.
    """
    asked, lines = read_log(path)
    names = [str(name) for name in asked["order"]]
    rows = [
        (line.number, *row)
        for line in lines
        for row in zip(line.starts, line.points, line.values, line.gradients, strict=True)
    ]
    quantities = len(rows[0][3]) if rows else 1
    values = np.full((len(rows), quantities), np.nan)
    gradients = np.full((len(rows), quantities, len(names)), np.nan)
    for k, (_, _, _, value, gradient) in enumerate(rows):
        values[k] = np.asarray(value, float)
        slopes = np.asarray(gradient, float)
        if slopes.size:
            gradients[k] = slopes
    points = np.array([row[2] for row in rows], float).reshape(-1, len(names))
    said = ["objective", *(f"constraint {k}" for k in range(1, quantities))]
    table = {
        "evaluation": (("row",), [row[0] for row in rows], "number of the evaluation"),
        "start": (("row",), [row[1] for row in rows], "start of the search"),
        "point": (("row", "parameter"), points, "parameters, in their units"),
        "value": (("row", "quantity"), values, "value of the objective, slack of a constraint"),
        "gradient": (
            ("row", "quantity", "parameter"),
            gradients,
            "its derivative by each parameter",
        ),
    }
    data = xr.Dataset(
        {
            name: (dims, np.asarray(found), {"units": "1", "long_name": long_name})
            for name, (dims, found, long_name) in table.items()
        },
        coords={"parameter": names, "quantity": said},
        attrs={"asked": json.dumps(asked)},
    )
    return marked(data, "search log")
