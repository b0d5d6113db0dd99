"""How much of a glide leans on force coefficients that nobody measured."""

from typing import NamedTuple

import numpy as np

from ..body.snake import discretise
from ..loads.polar import MEASURED_ANGLES, REYNOLDS
from .glide import Glide, reconstruct


class Extrapolation(NamedTuple):
    """Shares of body length and time beyond the measurements, 0 to 1.

    Attributes:
        angle_of_attack: below -10 or above 60 degrees.
        reynolds: below 3000 or above 15000.
        either: one of them or both.
    """

    angle_of_attack: float
    reynolds: float
    either: float

    def __str__(self) -> str:
        low, high = MEASURED_ANGLES
        return (
            f"{100 * self.either:.0f} % of body and flight lies beyond the measured force "
            f"coefficients: {100 * self.angle_of_attack:.0f} % outside angles of attack of "
            f"{low:g} to {high:g} deg, {100 * self.reynolds:.0f} % outside Re of "
            f"{REYNOLDS[0]:g} to {REYNOLDS[-1]:g}"
        )


def extrapolation(glide: Glide, count: int = 400) -> Extrapolation:
    """How much of a glide lies beyond the measured force coefficients.

    Args:
        glide: one glide, simulated with `dense=True`.
        count: number of times it is looked at, equally spaced from launch to end.

    Raises:
        ValueError: the glide kept no trajectory.
    """
    seen = reconstruct(glide, np.linspace(0.0, float(glide.time), count)).aerodynamics
    angle, reynolds = np.rad2deg(seen.angle_of_attack), np.asarray(seen.reynolds)
    low, high = MEASURED_ANGLES
    beyond_angle = (angle < low) | (angle > high)
    beyond_reynolds = (reynolds < REYNOLDS[0]) | (reynolds > REYNOLDS[-1])
    sections = discretise(glide.glider.snake)
    length = np.asarray(sections.area / sections.chord)
    share = length / length.sum() / count
    both = beyond_angle | beyond_reynolds
    parts = (float(np.sum(out * share)) for out in (beyond_angle, beyond_reynolds, both))
    return Extrapolation(*parts)
