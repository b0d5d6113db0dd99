"""Flights as one labelled dataset, in the units people read."""

from collections.abc import Sequence
from importlib import metadata
from typing import Any

import numpy as np
import xarray as xr

from .._lib.formats import marked
from .._lib.units import labelled
from .flight import MeasuredFlight

# name: (unit, long name, radians inside)
NUMBERS: dict[str, tuple[str, str, bool]] = {
    "mass": ("kg", "mass", False),
    "svl": ("m", "snout-vent length", False),
    "nu_theta": ("", "spatial periods of the horizontal wave", False),
    "f_theta": ("Hz", "frequency of the horizontal wave", False),
    "theta_m": ("deg", "amplitude of the horizontal wave, from its modes", True),
    "psi_m": ("deg", "amplitude of the vertical wave, from its modes", True),
    "d_psi": ("deg/SVL", "dorsoventral bending", True),
    "nu_psi": ("", "spatial periods of the vertical wave", False),
    "f_psi": ("Hz", "frequency of the vertical wave", False),
    "theta_range": ("deg", "half the peak-to-peak of the horizontal angle", True),
    "psi_range": ("deg", "half the peak-to-peak of the vertical angle", True),
    "markers": ("", "number of markers", False),
    "missing": ("", "positions of markers filled in", False),
    "longest_gap": ("s", "longest time that a marker was not seen", False),
}
WAVES = ("horizontal", "vertical")
MODES = 6
"""Modes of each wave in the dataset."""


def _padded(pieces: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays of different lengths side by side, NaN past their ends."""
    padded = np.full((len(pieces), max(map(len, pieces)), *pieces[0].shape[1:]), np.nan)
    for row, piece in zip(padded, pieces, strict=True):
        row[: len(piece)] = piece
    return padded


def _of_modes(flights: Sequence[MeasuredFlight], name: str) -> np.ndarray:
    """A field of the modes of both waves, (trial, wave, mode, ...)."""
    return np.array([[getattr(getattr(f, w), name)[:MODES] for w in WAVES] for f in flights])


def _shapes(flights: Sequence[MeasuredFlight]) -> np.ndarray:
    """Shapes of the modes, (trial, station, wave, mode, part)."""
    pieces = []
    for flight in flights:
        shapes = np.array([getattr(flight, wave).shapes[:MODES].T for wave in WAVES])
        pieces.append(np.stack([np.real(shapes), np.imag(shapes)], axis=-1).swapaxes(0, 1))
    return _padded(pieces)


def _variables(flights: Sequence[MeasuredFlight]) -> dict[str, tuple]:
    """Dimensions, values, unit and long name of each variable."""
    of_modes, vector = ("trial", "wave", "mode"), ("trial", "frame", "axis")
    variables: dict[str, tuple] = {}
    for name, (unit, long_name, radians) in NUMBERS.items():
        values = np.array([getattr(flight, name) for flight in flights])
        values = np.rad2deg(values) if radians else values
        variables[name] = (("trial",), values, unit, long_name)
    kept = [[getattr(flight, wave).kept for wave in WAVES] for flight in flights]
    return variables | {
        "modes_kept": (of_modes[:2], kept, "", "modes that explain 95 % of the variance"),
        "variance": (of_modes, _of_modes(flights, "variance"), "", "explained variance"),
        "wave_number": (of_modes, _of_modes(flights, "wave_number"), "", "periods per SVL"),
        "frequency": (of_modes, _of_modes(flights, "frequency"), "Hz", "frequency of the mode"),
        "shape": (
            ("trial", "station", *of_modes[1:], "part"),
            _shapes(flights),
            "",
            "shape of the mode, a unit vector",
        ),
        "fraction": (
            ("trial", "station"),
            _padded([flight.bending.fraction for flight in flights]),
            "",
            "arc length over SVL from the head's marker",
        ),
        "start_position": (
            ("trial", "axis"),
            [flight.start_position for flight in flights],
            "m",
            "centre of mass in the first processed frame",
        ),
        "start_velocity": (
            ("trial", "axis"),
            [flight.start_velocity for flight in flights],
            "m/s",
            "its velocity then",
        ),
        "time": (
            ("trial", "frame"),
            _padded([flight.times for flight in flights]),
            "s",
            "time since the first processed frame",
        ),
        "position": (
            vector,
            _padded([flight.position for flight in flights]),
            "m",
            "centre of mass",
        ),
        "velocity": (
            vector,
            _padded([flight.velocity for flight in flights]),
            "m/s",
            "velocity of the centre of mass over the ground",
        ),
    }


def flights_dataset(flights: Sequence[MeasuredFlight]) -> xr.Dataset:
    """Gaits, modes, paths and launch states of flights.

    Args:
        flights: at least one.

    Returns:
        Dataset over trial, axis (x right, y forward, z up), wave and mode; frame and station
        end with NaN in flights that have fewer. Angles in degrees, all else in SI units.
    """
    coordinates: dict[str, Any] = {
        "trial": [flight.trial for flight in flights],
        "snake": ("trial", [flight.snake for flight in flights]),
        "axis": ["x", "y", "z"],
        "wave": list(WAVES),
        "mode": ("mode", np.arange(1, MODES + 1), labelled("", "number of the mode")),
        "part": ["real", "imaginary"],
    }
    variables = {
        name: (dims, values, labelled(unit, long_name))
        for name, (dims, values, unit, long_name) in _variables(flights).items()
    }
    about = {"jaxglide": metadata.version("jaxglide"), "axes": "x right, y forward, z up"}
    data = xr.Dataset(variables, coords=coordinates, attrs=about)
    return marked(data, "measured flights")
