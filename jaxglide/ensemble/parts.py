"""Parts from plain tables: those of a study file, and of the command line's flags.

A table holds the fields of a part by name, in the units that people read; what it leaves out
has its default, which is the published snake's. A name of a kind is looked up in the tables
here, a file is read as numbers: nothing is imported or evaluated by name.
"""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.checks import check_choice
from .._lib.documents import shown
from .._lib.fields import parameters_of
from ..air.air import AbstractAir, Gust, ShearWind, StillAir, Turbulence, UniformWind
from ..body.sections import AbstractBody
from ..body.snake import Snake
from ..body.tabulated import TabulatedBody
from ..flight.case import Case
from ..flight.dynamics import Glider
from ..flight.ends import (
    AbstractEnd,
    AngleLimit,
    Ground,
    Plane,
    TimeLimit,
    default_ends,
)
from ..flight.launch import Launch
from ..loads.aerodynamics import AbstractAerodynamics, LaggingCirculation, SweepTheory
from ..loads.polar import AbstractPolar, Polar
from ..loads.table import TabulatedPolar
from ..shape.gait import Gait

AIRS: dict[str, type[AbstractAir]] = {
    "still": StillAir,
    "uniform": UniformWind,
    "shear": ShearWind,
    "gust": Gust,
    "turbulence": Turbulence,
}
AERODYNAMICS: dict[str, type[AbstractAerodynamics]] = {
    "sweep": SweepTheory,
    "lagging": LaggingCirculation,
}
ENDS: dict[str, type[AbstractEnd]] = {
    "ground": Ground,
    "angle": AngleLimit,
    "plane": Plane,
    "time": TimeLimit,
}
POLARS = ("published", "smooth", "band-limited")
TABLES = ("body", "gait", "polar", "aerodynamics", "air", "launch", "ends", "gravity")
"""What `case_of` takes."""

_TEXTS = ("node_set", "kind", "name", "file")
_WHOLE = ("nodes", "seed", "modes", "harmonics")


def case_of(tables: Mapping[str, Any], folder: str | Path = ".") -> Case:
    """The case that tables describe.

    Args:
        tables: by name,

            - `body`: fields of `Snake`, where `svl` may stand for `length` and the mass
              follows from it; or `file`, a CSV file of `TabulatedBody.from_csv`, and the
              fields that it leaves open;
            - `gait`: fields of `Gait`, its amplitude theta_m by default on the shape line;
            - `polar`: `name` ("published", "smooth" or "band-limited", then with
              `harmonics`) or `file` (a CSV file of `TabulatedPolar.from_csv`), and its
              scales;
            - `aerodynamics`: `kind` ("sweep" or "lagging") and fields of that class;
            - `air`: `kind` ("still", "uniform", "shear", "gust" or "turbulence") and fields;
            - `launch`: fields of `Launch`;
            - `ends`: a list of tables with `kind` ("ground", "angle", "plane" or "time") and
              fields; without it the ground and 85 degrees of yaw, pitch or roll;
            - `gravity`: a number.
        folder: from where names of files count.

    Raises:
        TypeError: a value of another kind.
        ValueError: an unknown name, a value out of range, or a file's content; the message
            names it.
        OSError: a file cannot be read.
    """
    _known("", tables, TABLES)
    given = {name: _table(name, tables.get(name, {})) for name in TABLES[:6]}
    follow = []
    if given["gait"].get("theta_m") is None:
        follow.append("gait.theta_m")
    if "file" not in given["body"] and "mass" not in given["body"]:
        follow.append("body.mass")
    gravity = tables.get("gravity", 9.81)
    parameters_of(Glider)["gravity"].check("gravity", gravity)
    glider = Glider(
        _body(given["body"], folder),
        _gait(given["gait"]),
        _aerodynamics(given["aerodynamics"], _polar(given["polar"], folder)),
        _one_of("air", AIRS, given["air"], "still"),
        gravity,
    )
    launch = Launch(**_fields("launch", Launch, given["launch"]))
    return Case(glider, launch, _ends(tables.get("ends")), tuple(follow))


def _known(table: str, entries: Mapping[str, Any], names: Sequence[str]) -> None:
    for name in entries:
        if name not in names:
            place = f" in {table}" if table else ""
            raise ValueError(f"there is no entry {name!r}{place}: known are {', '.join(names)}")


def _table(name: str, found: Any) -> dict[str, Any]:
    if not isinstance(found, Mapping):
        raise TypeError(f"{name} = {shown(found)} is not a table")
    return dict(found)


def _fields(
    table: str, kind: type, entries: Mapping[str, Any], beside: Sequence[str] = ()
) -> dict[str, Any]:
    """Fields of a class from a table: its parameters from the units that people read.

    Args:
        table: its name, for messages.
        kind: the class.
        entries: the table.
        beside: entries that are no fields, which are left out of what is returned.
    """
    described = parameters_of(kind)
    names = {p.short: name for name, p in described.items() if p.short}
    other = ("polar", "cells", "spacing")  # a module, and what no table holds
    allowed = [f.name for f in dataclasses.fields(kind) if f.name not in other]
    _known(table, entries, [*beside, *names, *allowed])
    found = {}
    for name, value in entries.items():
        field, path = names.get(name, name), f"{table}.{name}"
        if name not in beside and field in found:
            raise ValueError(f"{table} gives {field} twice")
        if field in described:
            described[field].check(path, value)
            found[field] = described[field].factor * np.asarray(value, float)
        else:
            value = _static(path, name, value)
            if name not in beside:
                found[field] = value
    return found


def _static(path: str, name: str, value: Any) -> Any:
    """An entry that is no float: a text, a whole number, or a list of texts."""
    if name in _WHOLE:
        if isinstance(value, bool) or not isinstance(value, int | np.integer):
            raise TypeError(f"{path} = {shown(value)} is not a whole number")
        return int(value)
    if name in _TEXTS:
        if not isinstance(value, str | os.PathLike):
            raise TypeError(f"{path} = {shown(value)} is not a text")
        return value
    if not isinstance(value, list | tuple) or not all(isinstance(v, str) for v in value):
        raise TypeError(f"{path} = {shown(value)} is not a list of texts")
    return tuple(value)


def _made(kind: type, fields: Mapping[str, Any], table: str) -> Any:
    """A part; `ValueError` names what it lacks."""
    for field in dataclasses.fields(kind):
        plain = field.default is field.default_factory is dataclasses.MISSING
        if plain and field.name not in fields:
            raise ValueError(f"{table} lacks {field.name}")
    return kind(**fields)


def _one_of(table: str, kinds: Mapping[str, type], entries: dict, usual: str, **more) -> Any:
    """The part of one of several kinds, which `kind` names."""
    name = _static(f"{table}.kind", "kind", entries.get("kind", usual))
    check_choice(f"{table}.kind", name, tuple(kinds))
    fields = _fields(table, kinds[name], entries, ("kind",))
    return _made(kinds[name], {**more, **fields}, f"{table} of kind {name!r}")


def _body(entries: dict, folder: str | Path) -> AbstractBody:
    if "file" not in entries:
        fields = _fields("body", Snake, entries)
        return Snake.from_svl(fields.pop("length", 0.70), fields.pop("mass", None), **fields)
    of_file = ("position", "chord", "density", "point_position", "point_mass")
    for name in entries:
        if name in (*of_file, "svl", "length", "mass"):
            raise ValueError(f"body.{name} does not apply: {entries['file']} decides it")
    fields = _fields("body", TabulatedBody, entries, ("file",))
    return TabulatedBody.from_csv(Path(folder) / entries["file"], **fields)


def _gait(entries: dict) -> Gait:
    _fields("gait", Gait, entries)
    return Gait.from_degrees(**entries)


def _polar(entries: dict, folder: str | Path) -> AbstractPolar:
    beside = ("name", "file", "harmonics")
    _known("polar", entries, (*beside, "lift_scale", "drag_scale"))
    scales = _fields("polar", Polar, entries, beside)
    if "file" in entries:
        for name in ("name", "harmonics"):
            if name in entries:
                raise ValueError(f"polar.{name} does not apply: {entries['file']} decides it")
        return TabulatedPolar.from_csv(Path(folder) / entries["file"], **scales)
    name = str(entries.get("name", POLARS[0]))
    check_choice("polar.name", name, POLARS)
    if name == "band-limited":
        return Polar.band_limited(entries.get("harmonics"), **scales)
    if "harmonics" in entries:
        raise ValueError(f"polar.harmonics does not apply: it is for {POLARS[2]!r} only")
    return Polar.from_name(name, **scales)


def _aerodynamics(entries: dict, polar: AbstractPolar) -> AbstractAerodynamics:
    return _one_of("aerodynamics", AERODYNAMICS, entries, "sweep", polar=polar)


def _ends(tables: Any) -> tuple[AbstractEnd, ...]:
    if tables is None:
        return default_ends()
    if not isinstance(tables, list | tuple):
        raise TypeError(f"ends = {shown(tables)} is not a list of tables")
    found = []
    for k, entries in enumerate(tables):
        table = _table(f"ends[{k}]", entries)
        if "kind" not in table:
            raise ValueError(f"ends[{k}] lacks kind: {', '.join(ENDS)}")
        found.append(_one_of(f"ends[{k}]", ENDS, table, "ground"))
    return tuple(found)
