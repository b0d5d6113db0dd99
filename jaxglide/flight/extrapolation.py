"""How much of a glide leans on force coefficients that nobody measured."""

from typing import NamedTuple

import numpy as np

from ..body.sections import discretise
from ..loads.polar import AbstractPolar
from .glide import Glide
from .trajectory import reconstruct


class Extrapolation(NamedTuple):
    """Shares of body length and time beyond the measurements, 0 to 1.

    Attributes:
        angle_of_attack: outside the measured ones (of the snake -10 to 60 degrees).
        reynolds: outside the measured ones (of the snake 3000 to 15000).
        either: one of them or both.
        angles: angles of attack that were measured, lowest and highest [deg].
        numbers: Reynolds numbers that were, lowest and highest.
    """

    angle_of_attack: float
    reynolds: float
    either: float
    angles: tuple[float, float]
    numbers: tuple[float, float]

    def __str__(self) -> str:
        (low, high), (least, most) = self.angles, self.numbers
        return (
            f"{100 * self.either:.0f} % of body and flight lies beyond the measured force "
            f"coefficients: {100 * self.angle_of_attack:.0f} % outside angles of attack of "
            f"{low:g} to {high:g} deg, {100 * self.reynolds:.0f} % outside Re of "
            f"{least:g} to {most:g}"
        )


def extrapolation(glide: Glide, count: int = 400) -> Extrapolation:
    """How much of a glide lies beyond the measured force coefficients.

    Args:
        glide: one glide, simulated with `dense=True`.
        count: number of times it is looked at, equally spaced from launch to end.

    Raises:
        ValueError: the glide kept no trajectory, or its aerodynamics has no polar.
    """
    seen = reconstruct(glide, np.linspace(0.0, float(glide.time), count)).aerodynamics
    angle, reynolds = np.rad2deg(seen.angle_of_attack), np.asarray(seen.reynolds)
    polar = getattr(glide.glider.aerodynamics, "polar", None)
    if not isinstance(polar, AbstractPolar):
        raise ValueError("the aerodynamics of this glide has no polar that was measured")
    (low, high), (least, most) = polar.measured_angles, polar.measured_reynolds
    beyond_angle = (angle < low) | (angle > high)
    beyond_reynolds = (reynolds < least) | (reynolds > most)
    sections = discretise(glide.glider.body)
    length = np.asarray(sections.area / sections.chord)
    share = length / length.sum() / count
    both = beyond_angle | beyond_reynolds
    shares = [float(np.sum(out * share)) for out in (beyond_angle, beyond_reynolds, both)]
    return Extrapolation(shares[0], shares[1], shares[2], (low, high), (least, most))
