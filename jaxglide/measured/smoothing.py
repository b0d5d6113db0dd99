"""Smoothing: a zero-phase Butterworth low-pass whose cutoff the data decide.

D. A. Winter, "Biomechanics and Motor Control of Human Movement", residual analysis: what
the filter takes away is plotted against its cutoff; where it takes only noise the plot is a
straight line, whose intercept is the noise, and the cutoff is chosen where the filter takes
as much of the signal as it leaves of the noise.
"""

import numpy as np
from scipy.signal import butter, sosfiltfilt

CUTOFFS = np.linspace(1, 35, 69)
"""Cutoffs tried [Hz]."""
STRAIGHT = 0.95
"""Least R^2 of the straight line."""


def low_pass(data: np.ndarray, cutoff: float, rate: float) -> np.ndarray:
    """Second-order Butterworth low-pass, forward and backward along the first axis.

    Args:
        data: (frames, ...).
        cutoff: [Hz].
        rate: frames a second [Hz].
    """
    sections = np.asarray(butter(2, cutoff / (rate / 2), output="sos"))
    return sosfiltfilt(sections, data, axis=0, padtype="odd", padlen=len(data) - 1)


def residuals(data: np.ndarray, rate: float) -> np.ndarray:
    """RMS of what the filter takes away at each of `CUTOFFS`, (69, ...), unit of `data`."""
    removed = [np.square(data - low_pass(data, cutoff, rate)) for cutoff in CUTOFFS]
    return np.sqrt(np.mean(removed, axis=1))


def noise_level(residual: np.ndarray) -> np.ndarray:
    """Intercept of the straight part at the top of the residuals, per column.

    The line is fitted to the last m points, m growing from 2 while R^2 is at least 0.95.

    Args:
        residual: at each of `CUTOFFS`, (69, columns).
    """
    level = np.zeros(residual.shape[1])
    straight = np.ones(residual.shape[1], bool)
    for count in range(2, len(CUTOFFS) + 1):
        x, y = CUTOFFS[-count:], residual[-count:]
        line = np.polyfit(x, y, 1)
        left = np.square(y - np.outer(x, line[0]) - line[1]).sum(axis=0)
        straight &= left <= (1 - STRAIGHT) * np.square(y - y.mean(axis=0)).sum(axis=0) + 1e-30
        level = np.where(straight, line[1], level)
    return level


def choose_cutoffs(data: np.ndarray, rate: float) -> np.ndarray:
    """Cutoff of each column by residual analysis, (columns,) [Hz].

    Args:
        data: (frames, columns).
        rate: frames a second [Hz].
    """
    residual = residuals(data, rate)
    chosen = []
    for column, level in zip(residual.T, noise_level(residual), strict=True):
        below = np.flatnonzero(column <= level)
        if below.size == 0:
            chosen.append(CUTOFFS[-1])
            continue
        last = max(below[0], 1)
        pair = slice(last, last - 2 if last > 1 else None, -1)
        chosen.append(np.interp(level, column[pair], CUTOFFS[pair]))
    return np.array(chosen)


def smooth(data: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed data and the cutoffs used [Hz], each coordinate by its own.

    Args:
        data: (frames, ...).
        rate: frames a second [Hz].
    """
    columns = data.reshape(len(data), -1)
    cutoffs = choose_cutoffs(columns, rate)
    pairs = zip(columns.T, cutoffs, strict=True)
    smoothed = np.stack([low_pass(column, cutoff, rate) for column, cutoff in pairs], axis=1)
    return smoothed.reshape(data.shape), cutoffs.reshape(data.shape[1:])
