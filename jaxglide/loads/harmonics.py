"""The measured coefficients as waves of the angle of attack, and how sure these are.

With gamma = 90 degrees - beta the fold's symmetry is that of the waves themselves:

    C_L = sum_k a_k sin(k gamma)      C_D = sum_k b_k cos(k gamma)

A regression by weighted least squares, every Reynolds number by itself. The measured angles
are its data. At the other angles, every 5 degrees, nothing was measured: there the values
that the smooth polar has (see `faded_tables`) count as data of a tenth of the weight.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .coefficients import ALPHA, BELOW, MEASURED_ANGLES, faded_tables

FEWEST_HARMONICS, MOST_HARMONICS = 2, 24
"""With fewer drag falls below 0; with more, too few residuals are left from which the errors
could be known."""
MADE_UP = 0.1
"""Weight of a value where nothing was measured, whose standard deviation is then 3.2 times
that of a measured one."""

_ANGLES = np.concatenate([BELOW, ALPHA])  # deg
_LOW, _HIGH = MEASURED_ANGLES
_MEASURED = (_LOW <= _ANGLES) & (_ANGLES <= _HIGH)


class Waves(NamedTuple):
    """A coefficient as waves, with the covariance of their amplitudes.

    The covariance of the amplitudes of orders k and l at Reynolds numbers i and j is
    `by_order[k, l] by_reynolds[i, j]`.

    Attributes:
        amplitudes: by order and Reynolds number, (K, 7); sines from order 1, cosines from 0.
        by_order: (K, K).
        by_reynolds: covariance of the errors at a measured angle, from the residuals, (7, 7).
        freedom: degrees of freedom that the residuals have.
    """

    amplitudes: np.ndarray
    by_order: np.ndarray
    by_reynolds: np.ndarray
    freedom: float


def waves_at(beta: np.ndarray, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Sines for lift, (A, K), and cosines for drag, (A, K + 1), at angles [deg], (A,)."""
    gamma = np.deg2rad(90 - np.asarray(beta))[:, None]
    order = np.arange(harmonics + 1)
    return np.sin(order[1:] * gamma), np.cos(order * gamma)


def _weights() -> np.ndarray:
    return np.where(_MEASURED, 1.0, MADE_UP)


def _regressed(waves, values, weights) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes, and the inverse of the normal equations' matrix."""
    inverse = np.linalg.inv(waves.T @ (weights[:, None] * waves))
    return inverse @ waves.T @ (weights[:, None] * values), inverse


@lru_cache
def regression(harmonics: int) -> tuple[Waves, Waves]:
    """Lift and drag as waves up to an order of 2 to 24."""
    found = []
    for waves, values in zip(waves_at(_ANGLES, harmonics), faded_tables(), strict=True):
        weights = _weights()
        amplitudes, inverse = _regressed(waves, values, weights)
        residuals = (values - waves @ amplitudes)[_MEASURED]
        data = waves[_MEASURED]
        freedom = len(data) - np.sum((data @ inverse) * data)
        found.append(
            Waves(amplitudes, inverse, residuals.T @ residuals / freedom, float(freedom))
        )
    return found[0], found[1]


@lru_cache
def cross_validation(harmonics: int) -> tuple[float, float]:
    """Root mean square errors of C_L and C_D at measured angles that were left out.

    One after the other, with its mirror images and at all Reynolds numbers. The lowest and the
    highest stay: what is made up beyond hangs on them.
    """
    errors = []
    for waves, values in zip(waves_at(_ANGLES, harmonics), faded_tables(), strict=True):
        missed = []
        for left_out in np.flatnonzero(_MEASURED)[1:-1]:
            weights = _weights()
            weights[left_out] = 0
            amplitudes, _ = _regressed(waves, values, weights)
            missed.append(values[left_out] - waves[left_out] @ amplitudes)
        errors.append(float(np.sqrt(np.mean(np.square(missed)))))
    return errors[0], errors[1]


@lru_cache
def best_harmonics() -> int:
    """The order with the least error of cross-validation, lift and drag together."""
    orders = range(FEWEST_HARMONICS, MOST_HARMONICS + 1)
    return min(orders, key=lambda order: np.hypot(*cross_validation(order)))


def deviations(waves: Waves) -> np.ndarray:
    """Amplitudes' independent standard deviations, (7 K, K, 7): the sum of their outer
    products is the covariance."""
    orders, numbers = (np.linalg.cholesky(c) for c in (waves.by_order, waves.by_reynolds))
    product = orders.T[:, None, :, None] * numbers.T[None, :, None, :]
    return product.reshape(-1, *waves.amplitudes.shape)
