"""The backbone: a spline through the markers, and the centre of mass on it."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

SAMPLES = 200


class MeasuredBackbone(NamedTuple):
    """The body's curve in every frame, head first.

    Args:
        arc: arc length from the head's marker, (samples,) [m].
        position: (frames, samples, 3) [m].
        tangent: unit vectors towards the tail, (frames, samples, 3).
        knots: arc length of the markers and of the neck point, (n+1,) [m].
    """

    arc: np.ndarray
    position: np.ndarray
    tangent: np.ndarray
    knots: np.ndarray


def neck_point(markers: np.ndarray, rate: float) -> np.ndarray:
    """A virtual marker behind the head, as the neck does not bend, (frames, 3) [m].

    It lies behind the head in its horizontal direction of motion, half the horizontal
    distance of the first two markers away, at their mean height.

    Args:
        markers: smoothed, (frames, n, 3) [m].
        rate: frames a second [Hz].
    """
    head, second = markers[:, 0], markers[:, 1]
    velocity = np.gradient(head[:, :2], 1 / rate, axis=0, edge_order=2)
    forward = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    away = np.linalg.norm((second - head)[:, :2], axis=1, keepdims=True)
    level = head[:, :2] - away / 2 * forward
    return np.column_stack([level, (head[:, 2] + second[:, 2]) / 2])


def stations(knots: np.ndarray) -> np.ndarray:
    """Arc length of the samples, (200,) [m].

    They are shared among the intervals in proportion to length, the last taking what
    rounding leaves; every interval begins with a sample and the last also ends with one.
    """
    shares = np.rint(SAMPLES * np.diff(knots) / knots[-1]).astype(int)
    shares[-1] += SAMPLES - shares.sum()
    last = len(shares) - 1
    pieces = [
        np.linspace(knots[i], knots[i + 1], share, endpoint=i == last)
        for i, share in enumerate(shares)
    ]
    return np.concatenate(pieces)


def fit_backbone(markers: np.ndarray, tape: np.ndarray, rate: float) -> MeasuredBackbone:
    """Natural cubic spline through the markers and the neck point.

    Args:
        markers: smoothed, (frames, n, 3) [m].
        tape: distance along the body from each marker to the next, (n-1,) [m].
        rate: frames a second [Hz].
    """
    points = np.insert(markers, 1, neck_point(markers, rate), axis=1)
    knots = np.cumsum([0, tape[0] / 2, tape[0] / 2, *tape[1:]])
    spline = CubicSpline(knots, points, axis=1, bc_type="natural")
    arc = stations(knots)
    along = spline(arc, 1)
    tangent = along / np.linalg.norm(along, axis=-1, keepdims=True)
    return MeasuredBackbone(arc, spline(arc), tangent, knots)


def centre_of_mass(backbone: MeasuredBackbone, density: np.ndarray, svl: float) -> np.ndarray:
    """Mean position of the samples weighted by the body's density there, (frames, 3) [m].

    Args:
        backbone: the body.
        density: rows of (arc length / SVL, relative linear density), (k, 2).
        svl: snout-vent length [m].
    """
    weights = np.interp(backbone.arc / svl, *density.T)
    return np.average(backbone.position, axis=1, weights=weights)
