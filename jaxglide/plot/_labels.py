"""What axes say: symbols of parameters, names of variables, units (floor 6)."""

import xarray as xr

from ..parameters import PARAMETERS

SYMBOLS = {
    "theta_m": r"$\theta_m$",
    "nu_theta": r"$\nu_\theta$",
    "d_psi": r"$d_\psi$",
    "psi_m": r"$\psi_m$",
    "f_theta": r"$f_\theta$",
    "d_theta": r"$d_\theta$",
}
_UNITS = {
    "deg": "°",
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
_FORWARD = {"x": "right, x", "y": "forward, y", "z": "height, z"}


def shown(unit: str) -> str:
    """A unit as people write it."""
    return _UNITS.get(unit, unit)


def with_unit(name: str, unit: str) -> str:
    """A name and, in brackets, its unit as people write it."""
    return f"{name} ({shown(unit)})" if unit and unit != "1" else name


def parameter_label(name: str) -> str:
    """Label of an axis over a parameter."""
    if name == "nu_theta":
        return rf"waves {SYMBOLS[name]} (per SVL)"
    return with_unit(SYMBOLS.get(name, name.replace("_", " ")), PARAMETERS[name].unit)


def label_of(values: xr.DataArray) -> str:
    """Label of an axis that shows `values`: name and unit, from its attributes."""
    name = str(values.name)
    if name in PARAMETERS:
        return parameter_label(name)
    return with_unit(_said(values), str(values.attrs.get("units", "")))


def _said(values: xr.DataArray) -> str:
    name = str(values.name)
    return _SHORT.get(name, str(values.attrs.get("long_name", name))).replace("_", " ")


def part_of(values: xr.DataArray, chosen: dict) -> str:
    """Label of `values` where a component, such as `axis` y or `turn` pitch, was chosen."""
    name, unit = str(values.name), str(values.attrs.get("units", ""))
    axis = str(chosen.get("axis", chosen.get("forward_up", "")))
    if axis in _FORWARD and name in ("landing_point", "position"):
        where = " at the end" if name == "landing_point" else ""
        return with_unit(_FORWARD[axis] + where, unit)
    if name in _ANGLES and "turn" in chosen:
        return with_unit(_ANGLES[name].format(chosen["turn"]), unit)
    if "about" in chosen:
        return with_unit(f"{chosen['about']} {_said(values)}", unit)
    return with_unit(f"{_said(values)}, {axis}", unit) if axis else label_of(values)
