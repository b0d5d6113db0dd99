"""What decays and what grows about a steady glide: its modes, and their names."""

import math
from typing import NamedTuple

import numpy as np

from .reduced import COMPONENTS

_GROUPS = {
    "speed": ("v_forward", "v_up"),
    "pitch": ("omega_x", "pitch"),
    "roll": ("omega_y", "roll"),
    "yaw and sideslip": ("v_right", "omega_z"),
}
_CLEAR = 0.6  # share of a group from which a mode has its name
_LATERAL = ("roll", "yaw and sideslip")
_SLOW = 0.5  # 1/s; a lateral mode slower than that is a spiral


class Mode(NamedTuple):
    """One mode: a real multiplier, or a pair of complex ones.

    Attributes:
        name: in the words of flight mechanics where one group of components clearly leads,
            otherwise empty.
        multiplier: of a cycle; of a frozen body, of a second. Of a pair, that of positive
            imaginary part.
        growth: rate at which it grows [1/s], below 0 if it decays.
        frequency: at which it turns [Hz], up to half of the gait's.
        doubling: time in which it doubles [s], below 0 the time in which it halves.
        cycles: the same in cycles.
        shares: of the eight components, by name, of the squares of the scaled eigenvector at
            the start of a cycle; they add up to 1.
    """

    name: str
    multiplier: complex
    growth: float
    frequency: float
    doubling: float
    cycles: float
    shares: dict[str, float]


def _name(shares: dict[str, float], growth: float, turns: bool) -> str:
    """What a mode is called; empty where no group of components leads."""
    groups = {name: sum(shares[c] for c in parts) for name, parts in _GROUPS.items()}
    lateral = sum(groups[name] for name in _LATERAL)
    if lateral > 0.9 and turns and min(groups[name] for name in _LATERAL) > 0.2:
        return "dutch roll"
    if lateral > 0.9 and not turns and abs(growth) < _SLOW:
        return "spiral"
    leading, share = max(groups.items(), key=lambda item: item[1])
    if share < _CLEAR:
        return ""
    return f"oscillation of {leading}" if turns else leading


def modes_of(slopes: np.ndarray, period: float, frozen: bool) -> tuple[Mode, ...]:
    """The modes of a steady glide, the least stable first.

    Args:
        slopes: derivative of the return map by the scaled state, (8, 8); of a frozen body,
            of the rates.
        period: of a cycle [s].
        frozen: whether the body is.
    """
    values, vectors = np.linalg.eig(np.asarray(slopes))
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag < 0:
            continue
        exponent = value if frozen else _exponent(value, period)
        multiplier = np.exp(value) if frozen else value
        squares = np.abs(vector) ** 2
        parts = (squares / squares.sum()).tolist()
        shares = {str(name): float(part) for name, part in zip(COMPONENTS, parts, strict=True)}
        doubling = math.log(2) / exponent.real if exponent.real else math.inf
        turns = abs(exponent.imag) > 0
        name = _name(shares, exponent.real, turns)
        mode = Mode(
            name,
            complex(multiplier),
            float(exponent.real),
            float(abs(exponent.imag) / (2 * math.pi)),
            float(doubling),
            float(doubling / period),
            shares,
        )
        found.append(mode)
    return tuple(sorted(found, key=lambda mode: -mode.growth))


def _exponent(multiplier: complex, period: float) -> complex:
    """log(multiplier)/period; of none at all, minus infinity."""
    size = abs(multiplier)
    growth = math.log(size) if size else -math.inf
    return complex(growth, math.atan2(multiplier.imag, multiplier.real)) / period
