"""The gait: two travelling waves of bending (eqs 2-3, 6-7, 9-12).

The horizontal wave bends the body left and right, the vertical wave up and down at twice
the wave number and frequency. Both depend on time only through the phase
`a = 2 pi nu_theta s/L + phase`, with `phase = phi_theta - 2 pi f_theta t`.
"""

import equinox as eqx
import jax.numpy as jnp

from .._lib.checks import check_range, in_numpy, is_traced, number, radians
from .._lib.fields import about, floats, parameters_of
from .._lib.numerics import sincos
from .._lib.types import ArrayLike, Nodes, Scalar
from .motion import AbstractMotion, Bending, in_neck

_ANGLES = ("theta_m", "psi_m", "d_psi", "d_theta")


def shape_line(nu_theta):
    """Horizontal amplitude [deg] of the published shape line at `nu_theta`."""
    return 175.72823 - 56.6005 * nu_theta


def _on_the_line(gait: "Gait") -> Scalar:
    return radians(shape_line(in_numpy(gait.nu_theta)))


class Gait(AbstractMotion):
    """An aerial serpenoid gait (eqs 2-3, 6-7), angles in radians; see `from_degrees`.

    Its waves run at a constant rate, in closed form. Where they are to change in flight, see
    `Driven`.

    Args:
        theta_m: amplitude of the horizontal wave [rad], 0 to pi.
        psi_m: amplitude of the vertical wave [rad], 0 to pi.
        nu_theta: spatial periods of the horizontal wave along the body, 0 to 10.
        f_theta: undulation frequency [Hz], 0 (frozen) to 50.
        d_psi: dorsoventral bending [rad per SVL], -pi to pi.
        d_theta: lateral bias, a turn [rad per SVL], -pi to pi.

    Observed in flight: nu_theta 1 to 1.5, theta_m 80 to 120 deg, psi_m 20 to 45 deg,
    d_psi -20 to 30 deg, f_theta 1 to 1.7 Hz.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    theta_m: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "deg",
            "horizontal amplitude",
            symbol=r"\theta_m",
            low=0,
            high=180,
            observed=(80, 120),
            rule=_on_the_line,
        ),
    )
    psi_m: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "deg", "vertical amplitude", symbol=r"\psi_m", low=0, high=180, observed=(20, 45)
        ),
    )
    nu_theta: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "",
            "spatial periods of the horizontal wave",
            symbol=r"\nu_\theta",
            low=0,
            high=10,
            observed=(1.0, 1.5),
        ),
    )
    f_theta: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "Hz",
            "undulation frequency, 0 frozen",
            symbol=r"f_\theta",
            low=0,
            high=50,
            observed=(1.0, 1.7),
        ),
    )
    d_psi: Scalar = eqx.field(
        converter=floats,
        default=0.0,
        metadata=about(
            "deg/SVL",
            "dorsoventral bending",
            symbol=r"d_\psi",
            low=-180,
            high=180,
            observed=(-20, 30),
        ),
    )
    d_theta: Scalar = eqx.field(
        converter=floats,
        default=0.0,
        metadata=about(
            "deg/SVL", "lateral bias, a turn", symbol=r"d_\theta", low=-180, high=180
        ),
    )

    @classmethod
    def from_degrees(
        cls, theta_m=None, psi_m=20.0, nu_theta=1.4, f_theta=1.2, d_psi=10.0, d_theta=0.0
    ) -> "Gait":
        """A gait with its angles in degrees; the defaults are the published gait.

        Args:
            theta_m: horizontal amplitude [deg]; by default on the published shape line.
            psi_m, d_psi, d_theta: [deg].
            nu_theta, f_theta: as in `Gait`.

        Examples:
            >>> from jaxglide import Gait
            >>> gait = Gait.from_degrees(nu_theta=1.2, d_psi=0)
            >>> print(f"{gait.theta_m:.4f} rad, on the shape line")
            1.8816 rad, on the shape line
        """
        if theta_m is None:
            check_range("nu_theta", nu_theta, "", 0, 10, shape=())
            theta_m = shape_line(nu_theta)
        degrees = {"theta_m": theta_m, "psi_m": psi_m, "d_psi": d_psi, "d_theta": d_theta}
        for name, value in degrees.items():
            known = parameters_of(cls)[name]
            check_range(name, value, "deg", known.low, known.high, shape=())
        angles = {name: radians(number(name)(value)) for name, value in degrees.items()}
        return cls(nu_theta=nu_theta, f_theta=f_theta, **angles)

    @property
    def straight(self) -> bool:
        bends = [getattr(self, name) for name in _ANGLES]
        return not any(is_traced(bend) or float(bend) for bend in bends)

    def bending(self, fraction, neck_fraction, time, phase, states, observation):
        return waves(self, neck_fraction, fraction, *wave_phase(self, phase, time)), states

    def cycle(self, fraction, neck_fraction, phase):
        return waves(self, neck_fraction, fraction, phase, 1.0)


def wave_phase(gait: Gait, phi_theta, time) -> tuple[Scalar, Scalar]:
    """Phase of the waves and its rate at a time: phi_theta - 2 pi f_theta t [rad, rad/s]."""
    rate = -2 * jnp.pi * gait.f_theta
    return phi_theta + rate * time, rate


def waves(
    gait: Gait, neck_fraction: Scalar, fraction: Nodes, phase: ArrayLike, phase_rate: ArrayLike
) -> Bending:
    """Bending angles of both waves (eqs 2-3, 6-7), with exact time derivatives.

    In the neck, the angles of the wave at its end ramp linearly to zero at the snout
    (eqs 9-12): the wave is taken at max(s, s_neck) and scaled by min(s/s_neck, 1).

    Args:
        gait: the gait; its `f_theta` is not used here.
        neck_fraction: end of the neck, fraction of SVL.
        fraction: arc length over SVL at the nodes, (n,).
        phase: phi_theta - 2 pi f_theta t [rad].
        phase_rate: its rate, -2 pi f_theta [rad/s].
    """
    x, ramp = in_neck(fraction, neck_fraction)
    sin_a, cos_a = sincos(2 * jnp.pi * gait.nu_theta * x + phase)

    # theta = theta_m sin u + d_theta s/L with u = (pi/2) cos a (eqs 2, 6)
    u, u_dot = jnp.pi / 2 * cos_a, -jnp.pi / 2 * sin_a * phase_rate
    u_ddot = -u * phase_rate**2
    sin_u, cos_u = sincos(u)
    theta_m, psi_m = ramp * gait.theta_m, ramp * gait.psi_m

    # psi = psi_m cos(2a - pi) + d_psi s/L, by double angles (eqs 3, 7)
    sin_2a, cos_2a = 2 * sin_a * cos_a, 2 * cos_a * cos_a - 1
    return Bending(
        theta=theta_m * sin_u + ramp * gait.d_theta * x,
        theta_dot=theta_m * cos_u * u_dot,
        theta_ddot=theta_m * (cos_u * u_ddot - sin_u * u_dot**2),
        psi=-psi_m * cos_2a + ramp * gait.d_psi * x,
        psi_dot=2 * psi_m * sin_2a * phase_rate,
        psi_ddot=4 * psi_m * cos_2a * phase_rate**2,
    )
