"""The parts that a file brings back, by the names in its records.

Nothing else is ever made from a file.
"""

import json
from typing import Any

import diffrax

from .. import air, body, loads, shape
from .._lib.records import Registry, decode, encode
from . import ends
from .case import Case
from .dynamics import Glider
from .launch import Launch
from .solve import settings_of

_BODIES = (body.Snake, body.TabulatedBody)
_MOTIONS = (
    shape.Gait,
    shape.Driven,
    shape.Serpenoid,
    shape.Waveform,
    shape.Running,
    shape.Programme,
    shape.Actuated,
    shape.AttitudeLaw,
    shape.Planned,
    shape.Repeated,
    shape.Stepped,
    shape.TabulatedMotion,
)
_AIRS = (air.StillAir, air.UniformWind, air.ShearWind, air.Gust, air.Turbulence)
_LOADS = (loads.SweepTheory, loads.LaggingCirculation, loads.Polar, loads.TabulatedPolar)
_ENDS = (ends.Ground, ends.AngleLimit, ends.Plane, ends.TimeLimit, ends.End)
_WHOLE = (Glider, Launch, Case)
_SOLVERS = (
    diffrax.Euler,
    diffrax.Heun,
    diffrax.Midpoint,
    diffrax.Ralston,
    diffrax.Bosh3,
    diffrax.Tsit5,
    diffrax.Dopri5,
    diffrax.Dopri8,
)

PARTS: Registry = {
    **{k.__name__: k for k in (*_BODIES, *_MOTIONS, *_AIRS, *_LOADS, *_ENDS, *_WHOLE)},
    **{f"diffrax.{kind.__name__}": kind for kind in _SOLVERS},
    "Settings": settings_of,
}
"""What is made of a record, by name. A part with a function in it, a `Waveform` or an `End`,
is not: no file holds a function."""


def to_text(parts: dict[str, Any]) -> str:
    """Parts by name as one JSON text."""
    return json.dumps({name: encode(part) for name, part in parts.items()})


def from_text(text: str) -> dict[str, Any]:
    """Parts by name from a JSON text.

    Raises:
        OwnPartError: one is the user's own.
        ValueError: it is no such text, or a value in it is not allowed.
    """
    try:
        record = json.loads(text)
    except (RecursionError, ValueError):
        raise ValueError("the parts that flew are no JSON text") from None
    if not isinstance(record, dict):
        raise ValueError("the parts that flew are no table")
    return {str(name): decode(one, PARTS) for name, one in record.items()}
