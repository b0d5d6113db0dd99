"""Bending angles of the measured body, from the second marker to the vent (fig. 2)."""

from typing import NamedTuple

import numpy as np

from .backbone import MeasuredBackbone

CEILING = 7.25
"""Height of the centre of mass above which the waves are still forming [m]."""


class MeasuredBending(NamedTuple):
    """Bending angles in space and time.

    Args:
        times: since the first processed frame, (frames,) [s].
        fraction: arc length over SVL from the head's marker, (stations,).
        theta: horizontal angle, less the body's mean of the frame, (frames, stations) [rad].
        psi: vertical angle, less a straight line fitted to the frame, (frames, stations)
            [rad].
        slope: of that line: the dorsoventral bending in each frame, (frames,) [rad per SVL].
    """

    times: np.ndarray
    fraction: np.ndarray
    theta: np.ndarray
    psi: np.ndarray
    slope: np.ndarray


def bending_angles(
    backbone: MeasuredBackbone, times: np.ndarray, frames: np.ndarray, vent: int, svl: float
) -> MeasuredBending:
    """Bending angles in inertial axes (eq. 1), less the mean attitude of each frame.

    Args:
        backbone: the body.
        times: of its frames, (N,) [s].
        frames: which of them to use, (N,) of bool.
        vent: index of the vent among the markers.
        svl: length that arc length is divided by [m].
    """
    second, last = backbone.knots[2], backbone.knots[vent + 1]
    rounding = 1e-9 * last
    along = (backbone.arc >= second - rounding) & (backbone.arc <= last + rounding)
    fraction = backbone.arc[along] / svl
    x, y, z = np.moveaxis(backbone.tangent[frames][:, along], -1, 0)
    theta = np.unwrap(np.arctan2(x, -y), axis=1)
    psi = np.arcsin(np.clip(z, -1, 1))
    theta -= theta.mean(axis=1, keepdims=True)
    slope, offset = np.polyfit(fraction, psi.T, 1)
    psi = psi - np.outer(slope, fraction) - offset[:, None]
    return MeasuredBending(times[frames], fraction, theta, psi, slope)
