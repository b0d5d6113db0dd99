"""Section force coefficients as measured, and their extension beyond the measured angles.

Measured on an aerofoil with the snake's cross-section (Holden et al. 2014,
doi:10.1242/jeb.090902), at every 5 degrees from -10 to 60 and at seven Reynolds numbers.
"""

import numpy as np

MEASURED_ANGLES = (-10.0, 60.0)
"""Angles of attack within which coefficients were measured [deg]."""
REYNOLDS = np.arange(3000.0, 15001.0, 2000.0)
"""Reynolds numbers of the measurements, (7,)."""
ALPHA = np.arange(-10.0, 91.0, 5.0)
"""Angles of attack of the extended table [deg], (21,); measured to 60."""

_LIFT = np.array(
    [
        [-0.22675, -0.41202, -0.46889, -0.54330, -0.45011, -0.45119, -0.54118],
        [-0.28298, -0.58908, -0.65507, -0.78313, -0.69828, -0.73020, -0.92629],
        [-0.50933, -0.66243, -0.69804, -0.76275, -0.71451, -0.74524, -0.76698],
        [-0.51737, -0.53187, -0.48373, -0.55708, -0.48915, -0.46366, -0.47324],
        [0.04247, 0.13458, 0.19880, 0.23990, 0.24323, 0.24669, 0.27402],
        [0.56881, 0.55304, 0.60312, 0.70459, 0.65080, 0.68263, 0.73989],
        [0.83848, 0.83108, 0.91241, 1.02776, 0.96539, 0.99228, 1.07329],
        [0.92120, 0.98066, 1.05762, 1.21100, 1.12271, 1.15238, 1.24631],
        [1.13018, 1.15955, 1.22699, 1.39943, 1.30234, 1.34523, 1.45209],
        [1.14460, 1.22730, 1.34801, 1.79514, 1.73560, 1.80036, 1.91365],
        [1.09770, 1.26810, 1.32193, 1.50009, 1.38071, 1.42236, 1.51284],
        [1.04975, 1.21980, 1.31015, 1.44548, 1.34351, 1.40294, 1.50492],
        [1.02167, 1.12453, 1.18085, 1.34688, 1.26836, 1.27007, 1.38877],
        [0.95800, 1.03505, 1.08048, 1.20607, 1.13650, 1.14238, 1.23793],
        [0.88767, 0.97602, 0.99975, 1.14078, 1.04725, 1.07043, 1.14229],
    ]
)
_DRAG = np.array(
    [
        [0.43486, 0.46409, 0.47499, 0.52687, 0.49011, 0.50208, 0.54158],
        [0.37349, 0.37154, 0.38539, 0.43595, 0.40435, 0.41815, 0.46085],
        [0.33250, 0.33696, 0.34938, 0.39917, 0.37505, 0.38733, 0.43753],
        [0.31892, 0.32235, 0.34590, 0.37964, 0.36553, 0.40662, 0.43803],
        [0.32600, 0.38289, 0.40988, 0.46106, 0.43600, 0.44391, 0.46885],
        [0.40892, 0.43359, 0.45770, 0.52281, 0.47954, 0.49743, 0.53203],
        [0.46275, 0.49317, 0.53012, 0.59040, 0.55208, 0.56553, 0.60831],
        [0.49986, 0.54059, 0.57099, 0.64719, 0.59826, 0.61209, 0.65836],
        [0.55810, 0.59711, 0.62550, 0.71002, 0.66035, 0.68131, 0.73402],
        [0.60098, 0.67866, 0.70442, 0.70741, 0.66079, 0.66094, 0.71938],
        [0.87052, 1.03343, 1.03499, 1.13054, 1.04045, 1.05944, 1.08919],
        [0.98144, 1.14088, 1.19927, 1.30150, 1.21728, 1.25929, 1.33044],
        [1.12651, 1.27981, 1.33685, 1.50217, 1.42195, 1.41345, 1.53178],
        [1.28611, 1.42883, 1.47262, 1.62623, 1.54021, 1.53506, 1.65131],
        [1.36197, 1.55138, 1.57948, 1.77548, 1.63220, 1.65856, 1.75309],
    ]
)


def extended_tables() -> tuple[np.ndarray, np.ndarray]:
    """C_L and C_D on (`ALPHA`, `REYNOLDS`), (21, 7): measured, continued to 90 degrees."""
    alpha = ALPHA[15:]
    # Drag: a parabola with its vertex at 90 degrees through the measured value at 60.
    top = np.linspace(2.0, 2.1, REYNOLDS.size)
    drag = top + (_DRAG[-1] - top) * ((90 - alpha[:, None]) / 30) ** 2
    # Lift: the minimum-norm cubic with C_L(90) = 0, C_L(60) and a slope at 60. As
    # published, the slope is per 5-degree step and its row lacks the linear term.
    powers = np.array([3, 2, 1, 0])
    rows = np.stack([90.0**powers, 60.0**powers, np.array([3 * 60.0**2, 2 * 60.0, 0, 0])])
    slope = 1.5 * _LIFT[-1] - 2 * _LIFT[-2] + 0.5 * _LIFT[-3]
    cubic = np.linalg.lstsq(rows, np.stack([0 * slope, _LIFT[-1], slope]), rcond=None)[0]
    lift = alpha[:, None] ** powers @ cubic
    return np.vstack([_LIFT, lift]), np.vstack([_DRAG, drag])


BELOW = np.arange(-90.0, -10.0, 5.0)
"""Angles of attack below the table [deg], (16,)."""
SIGN = {"lift": -1.0, "drag": 1.0}
"""Sign behind the section, in C(180 - beta) = sign C(beta)."""


def faded_tables() -> tuple[np.ndarray, np.ndarray]:
    """C_L and C_D at every 5 degrees from -90 to 90, (37, 7), without a jump.

    Below -10 degrees drag stays what it is there, and lift fades to zero: an assumption, as
    the published clamp is, for nothing was measured there.
    """
    lift, drag = extended_tables()
    fade = np.sin(np.deg2rad(90 * (BELOW + 90) / 80))[:, None]
    return np.vstack([fade * lift[0], lift]), np.vstack([0 * fade + drag[0], drag])


def circle(front: np.ndarray, sign: float) -> np.ndarray:
    """Values at every 5 degrees from -180 to 180, (73, ...), from those of -90 to 90."""
    behind = sign * front[::-1]  # 90 to 270
    return np.concatenate([behind[18:], front[1:], behind[1:19]])
