"""What axes say: symbols of parameters, names of variables, units."""

from functools import cache
from typing import Any

import xarray as xr
from matplotlib.font_manager import FontProperties, findfont, get_font

from .._lib.fields import Parameter, parameters_of
from ..ensemble.base import published_case
from ..shape.gait import Gait
from ._style import FONT

SYMBOLS = {name: f"${known.symbol}$" for name, known in parameters_of(Gait).items()}
"""Of the gait's numbers."""
_UNITS = {
    "deg": "°",
    "degree": "°",
    "degree/s": "°/s",
    "deg/SVL": "° per SVL",
    "m/s^2": "m/s²",
    "m^2/s": "m²/s",
    "kg/m^3": "kg/m³",
}
_SHORT = {  # long names that say more than an axis has room for, or less
    "landing_point": "centre of mass at the end",
    "angle_of_attack": "angle of attack",
    "reynolds": "Reynolds number",
    "time": "time, t",
    "record": "time, t",
    "velocity": "velocity",
    "trajectory_velocity": "velocity",
    "aerodynamic_range": "moment of the air, peak to peak",
    "inertial": "inertial moment, body axes",
    "inertial_range": "inertial moment, peak to peak",
}
_ANGLES = {
    "angles": "{}",
    "end_angles": "{} at the end",
    "max_angles": "largest {}",
    "launch_angles": "{} at launch",
}
AXES = {"x": "right, x", "y": "forward, y", "z": "height, z"}
_LONGEST = 60  # characters of a text from outside


@cache
def _glyphs() -> frozenset[int]:
    """Code points that the figures' font has."""
    font: Any = get_font(findfont(FontProperties(family=FONT)))
    return frozenset(font.get_charmap())


def plain(text: object) -> str:
    """Text from outside, such as a name in a file, for Matplotlib to draw as it stands.

    Dollars are no mathematics in it and an underscore at its head does not hide it from a
    legend. A character that the font lacks stands as its code point, such as U+1F40D; of
    a text too long for a figure the beginning stands.
    """
    words = " ".join(str(text).split())
    words = words if len(words) <= _LONGEST else words[: _LONGEST - 1] + "…"
    drawn = "".join(c if ord(c) in _glyphs() else f"U+{ord(c):04X}" for c in words)
    return (" " if drawn.startswith("_") else "") + drawn.replace("$", r"\$")


def shown(unit: str) -> str:
    """A unit as people write it."""
    return _UNITS.get(unit) or plain(unit)


def degrees(value: float) -> str:
    """An angle [deg] as people write it."""
    return f"{value:g}°".replace("-", "\N{MINUS SIGN}")


def axis_label(axis: str) -> str:
    """Label of an axis of the inertial frame, x, y or z, in metres."""
    return f"{AXES[axis]} (m)"


def with_unit(name: str, unit: str) -> str:
    """A name and, in brackets, its unit as people write it."""
    return f"{name} ({shown(unit)})" if unit and unit != "1" else name


@cache
def _published() -> dict[str, Parameter]:
    """What is known of the published snake's parameters, by path and by brief name."""
    case = published_case()
    return case.parameters | {case.name(path): p for path, p in case.parameters.items()}


def parameter_label(name: str, unit: str = "") -> str:
    """Label of an axis over a parameter.

    Args:
        name: of the parameter.
        unit: of one that the published snake does not have.
    """
    known, last = _published().get(name), name.rpartition(".")[2]
    if known is None:
        return with_unit(plain(name), unit)
    if last == "nu_theta":
        return rf"waves {SYMBOLS[last]} (per SVL)"
    return with_unit(SYMBOLS.get(last, last.replace("_", " ")), known.unit)


def label_of(values: xr.DataArray) -> str:
    """Label of an axis that shows `values`: name and unit, from its attributes."""
    name = str(values.name)
    if name in values.coords and name in _published():
        return parameter_label(name)
    return with_unit(_said(values), str(values.attrs.get("units", "")))


def _said(values: xr.DataArray) -> str:
    name = str(values.name)
    words = _SHORT.get(name, str(values.attrs.get("long_name", name))).replace("_", " ")
    return plain(words)


def part_of(values: xr.DataArray, chosen: dict) -> str:
    """Label of `values` where a component, such as `axis` y or `turn` pitch, was chosen."""
    name, unit = str(values.name), str(values.attrs.get("units", ""))
    axis = str(chosen.get("axis", chosen.get("forward_up", "")))
    if axis in AXES and name in ("landing_point", "position"):
        where = " at the end" if name == "landing_point" else ""
        return with_unit(AXES[axis] + where, unit)
    if name in _ANGLES and "turn" in chosen:
        return with_unit(_ANGLES[name].format(plain(chosen["turn"])), unit)
    if "about" in chosen:
        return with_unit(f"{plain(chosen['about'])} {_said(values)}", unit)
    return with_unit(f"{_said(values)}, {plain(axis)}", unit) if axis else label_of(values)
