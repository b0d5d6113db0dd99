"""Attitude: 2-1-3 Euler angles, rotation matrix, angle rates (eq. 22).

Angles are ordered (yaw, pitch, roll). Positive yaw turns the nose left, positive pitch
raises the nose, positive roll banks right.
"""

import jax.numpy as jnp

from .._lib.numerics import arctan2, safe_sqrt, sincos
from .._lib.types import Mat3, Vec3


def rotation_matrix(angles: Vec3) -> Mat3:
    """Matrix R_BI taking inertial to body components, C2(roll) C1(pitch) C3(yaw).

    Args:
        angles: yaw, pitch, roll [rad], shape (3,).
    """
    (s3, s1, s2), (c3, c1, c2) = sincos(angles)
    return jnp.stack(
        [
            jnp.stack([c2 * c3 - s2 * s1 * s3, c2 * s3 + s2 * s1 * c3, -s2 * c1]),
            jnp.stack([-c1 * s3, c1 * c3, s1]),
            jnp.stack([s2 * c3 + c2 * s1 * s3, s2 * s3 - c2 * s1 * c3, c2 * c1]),
        ]
    )


def euler_angles(R_BI: Mat3) -> Vec3:
    """Yaw, pitch, roll [rad], shape (3,), of a rotation matrix; pitch in +-90 degrees."""
    horizontal = safe_sqrt(R_BI[1, 0] ** 2 + R_BI[1, 1] ** 2)
    return jnp.stack(
        [
            arctan2(-R_BI[1, 0], R_BI[1, 1]),
            arctan2(R_BI[1, 2], horizontal),
            arctan2(-R_BI[0, 2], R_BI[2, 2]),
        ]
    )


def angle_rates(angles: Vec3, omega_B: Vec3) -> Vec3:
    """Rates of yaw, pitch, roll [rad/s], shape (3,) (eqs 21-22).

    Args:
        angles: yaw, pitch, roll [rad], shape (3,); singular at pitch = +-90 degrees.
        omega_B: angular velocity in body axes [rad/s], shape (3,).
    """
    (_, s1, s2), (_, c1, c2) = sincos(angles)
    yaw_rate = (c2 * omega_B[2] - s2 * omega_B[0]) / c1
    pitch_rate = c2 * omega_B[0] + s2 * omega_B[2]
    roll_rate = omega_B[1] - s1 * yaw_rate
    return jnp.stack([yaw_rate, pitch_rate, roll_rate])
