"""The air and gravity."""

import equinox as eqx

from .._lib.checks import check_range, check_shapes, number
from .._lib.types import Scalar


class Environment(eqx.Module):
    """Gravity and air. Defaults: air at 30 degrees C, as published.

    Args:
        gravity: gravitational acceleration [m/s^2], 0 to 100.
        air_density: density of the air [kg/m^3], above 0.
        kinematic_viscosity: kinematic viscosity of the air [m^2/s], above 0.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    gravity: Scalar = eqx.field(converter=number("gravity"), default=9.81)
    air_density: Scalar = eqx.field(converter=number("air_density"), default=1.165)
    kinematic_viscosity: Scalar = eqx.field(
        converter=number("kinematic_viscosity"), default=1.568e-5
    )

    def __check_init__(self):
        check_shapes(self)
        check_range("gravity", self.gravity, "m/s^2", 0, 100)
        check_range("air_density", self.air_density, "kg/m^3", 0, 2000, low_open=True)
        check_range(
            "kinematic_viscosity", self.kinematic_viscosity, "m^2/s", 0, 1, low_open=True
        )
