"""Filling gaps: a constant-acceleration Kalman filter and Rauch-Tung-Striebel smoother.

H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic
systems", AIAA Journal 3, 1445-1450 (1965), doi:10.2514/3.3166. The published study used an
unscented filter of an old library, whose gain leaves out the process noise and whose
backward covariance holds an extra term; the textbook smoother here gives other values in
long gaps, and the same gait in the median flight.
"""

import numpy as np

GRAVITY = 9.81
MEASUREMENT_NOISE = 0.005
"""Standard deviation of a marker's position in the filter [m]."""
PROCESS_NOISE = GRAVITY / 2
"""Standard deviation of the change of acceleration in the filter [m/s^2]."""
START_VELOCITY = (0.0, 0.5, 1.0)
START_ACCELERATION = (0.1 * GRAVITY, 0.1 * GRAVITY, -0.5 * GRAVITY)
START_DEVIATION = (0.001, 0.5, 2 * GRAVITY)
"""Standard deviations at the start: position [m], velocity [m/s], acceleration [m/s^2]."""


def fill_gaps(markers: np.ndarray, rate: float) -> np.ndarray:
    """Positions with every missing value replaced by the smoother's; the others untouched.

    Args:
        markers: every marker seen in the first frame, NaN where missing later,
            (frames, n, 3) [m].
        rate: frames a second [Hz].
    """
    return np.where(np.isnan(markers), smooth_states(markers, rate)[..., 0, :], markers)


def smooth_states(markers: np.ndarray, rate: float) -> np.ndarray:
    """Smoothed position, velocity and acceleration of every marker, (frames, n, 3, axis).

    The axes of a marker share their covariance, which the positions do not enter: it is
    found once a marker, and a state holds the three axes side by side.

    Args:
        markers: as in `fill_gaps`.
        rate: frames a second [Hz].
    """
    frames, count, _ = markers.shape
    step = 1 / rate
    F = np.array([[1, step, step**2 / 2], [0, 1, step], [0, 0, 1]])
    G = np.array([step**2 / 2, step, 1])
    Q = PROCESS_NOISE**2 * np.outer(G, G)
    seen = np.asarray(np.isfinite(markers).all(axis=-1))

    x = np.zeros((count, 3, 3))
    x[:, 0], x[:, 1], x[:, 2] = markers[0], START_VELOCITY, START_ACCELERATION
    P = np.tile(np.diag(np.square(START_DEVIATION)), (count, 1, 1))
    states, covariances = np.empty((frames, *x.shape)), np.empty((frames, *P.shape))
    for frame in range(frames):
        if frame:
            x, P = F @ x, F @ P @ F.T + Q
        gain = P[:, :, :1] / (P[:, :1, :1] + MEASUREMENT_NOISE**2)
        gain = np.where(seen[frame, :, None, None], gain, 0.0)
        surprise = np.nan_to_num(markers[frame])[:, None, :] - x[:, :1]
        x, P = x + gain * surprise, P - gain * P[:, :1, :]
        states[frame], covariances[frame] = x, P
    for frame in reversed(range(frames - 1)):
        forecast = F @ states[frame]
        spread = F @ covariances[frame] @ F.T + Q
        back = np.linalg.solve(spread, F @ covariances[frame]).swapaxes(-1, -2)
        states[frame] += back @ (states[frame + 1] - forecast)
    return states
