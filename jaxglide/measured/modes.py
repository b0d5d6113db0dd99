"""Complex orthogonal decomposition of a travelling wave.

B. F. Feeny, U. Feeny, "Complex modal analysis of the swimming motion of a whiting", Journal
of Vibration and Acoustics 135, 021004 (2013), doi:10.1115/1.4023051.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.signal import hilbert

ENOUGH = 0.95
"""Share of the variance that the modes kept for the amplitude explain."""


@dataclass(frozen=True)
class Modes:
    """Modes of a wave, those with the most variance first.

    Args:
        shapes: unit vectors, their largest component real and positive,
            (modes, stations), complex.
        activity: of each in time, (modes, frames), complex, unit of the wave.
        variance: share of the whole variance that each explains, (modes,).
        wave_number: spatial periods per SVL, (modes,).
        frequency: (modes,) [Hz].
        kept: number of modes that explain 95 % of the variance.
        amplitude: mean over the frames of half the peak-to-peak over the body, of the wave
            reanimated from those modes, unit of the wave.
    """

    shapes: np.ndarray
    activity: np.ndarray
    variance: np.ndarray
    wave_number: np.ndarray
    frequency: np.ndarray
    kept: int
    amplitude: float


def half_range(wave: np.ndarray) -> float:
    """Mean over the frames of half the peak-to-peak over the body; wave (frames, stations)."""
    return float(np.mean(np.ptp(wave, axis=1)) / 2)


def _revolutions(values: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Turns in the complex plane per unit of `along`, of each row of `values`."""
    return np.polyfit(along, np.unwrap(np.angle(values), axis=1).T, 1)[0] / (2 * np.pi)


def decompose(
    wave: np.ndarray, times: np.ndarray, fraction: np.ndarray, count: int = 6
) -> Modes:
    """Complex orthogonal decomposition of a real wave.

    Args:
        wave: (frames, stations).
        times: of the frames, (frames,) [s].
        fraction: arc length over SVL of the stations, (stations,).
        count: modes to return at least; all that explain 95 % are returned.
    """
    signal = np.asarray(hilbert(wave, axis=0)).T
    values, vectors = eigh(signal @ signal.conj().T / len(times))
    values, vectors = np.maximum(values[::-1], 0), vectors[:, ::-1]
    variance = values / values.sum()
    kept = int(np.searchsorted(np.cumsum(variance), ENOUGH)) + 1
    count = max(kept, count)
    shapes = vectors[:, :count].T
    largest = np.take_along_axis(shapes, np.abs(shapes).argmax(axis=1)[:, None], axis=1)
    shapes = shapes * largest.conj() / np.abs(largest)
    activity = shapes.conj() @ signal
    frequency = _revolutions(activity, times)
    turning = np.exp(2j * np.pi * np.outer(times, frequency[:kept]))
    again = ((turning * np.sqrt(values[:kept])) @ shapes[:kept]).real
    return Modes(
        shapes,
        activity,
        variance[:count],
        np.abs(_revolutions(shapes, fraction)),
        frequency,
        kept,
        half_range(again),
    )
