"""The air: density, viscosity, and where it moves."""

import abc
from functools import lru_cache
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_integer
from .._lib.fields import Part, about, floats
from .._lib.numerics import sincos
from .._lib.types import Nodes3, Scalar, Vec3

_LIMIT = 100.0  # m/s that any wind may have


class AbstractAir(Part):
    """The air that is flown in: the seam for a wind of one's own.

    Args:
        air_density: density of the air [kg/m^3], above 0.
        kinematic_viscosity: kinematic viscosity of the air [m^2/s], above 0.
    """

    air_density: Scalar = eqx.field(
        converter=floats,
        default=1.165,
        kw_only=True,
        metadata=about(
            "kg/m^3", "density of the air", symbol=r"\rho", low=0, high=2000, low_open=True
        ),
    )
    kinematic_viscosity: Scalar = eqx.field(
        converter=floats,
        default=1.568e-5,
        kw_only=True,
        metadata=about(
            "m^2/s", "viscosity of the air", symbol=r"\nu", low=0, high=1, low_open=True
        ),
    )

    @abc.abstractmethod
    def wind(self, position: Nodes3, time: Scalar) -> Nodes3 | None:
        """Velocity of the air [m/s], inertial axes, (3, n); None where it rests.

        Finite everywhere and once differentiable; below the ground and before the launch
        too, where a solver may look. Everything may be traced.

        Args:
            position: where, inertial axes [m], (3, n).
            time: since launch [s].
        """


class StillAir(AbstractAir):
    """Air at rest. Defaults: at 30 degrees C, as published.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    def wind(self, position, time):
        return None


def _wind(meaning: str) -> dict:
    return about("m/s", meaning, low=-_LIMIT, high=_LIMIT)


class UniformWind(AbstractAir):
    """The same wind everywhere, always.

    Args:
        velocity: of the air, inertial axes [m/s], (3,): x to the right, y forward, z up.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    velocity: Vec3 = eqx.field(converter=floats, metadata=_wind("velocity of the wind"))

    def wind(self, position, time):
        return jnp.broadcast_to(self.velocity[:, None], position.shape)


class ShearWind(AbstractAir):
    """Wind that grows with height, by a power law: velocity (z/z_ref)^exponent.

    Below a hundredth of the reference height it falls to none linearly, at the ground.

    Args:
        velocity: of the air at the reference height, inertial axes [m/s], (3,).
        reference_height: [m], above 0.
        shear_exponent: 0 to 1; a seventh over open ground.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    velocity: Vec3 = eqx.field(
        converter=floats, metadata=_wind("velocity of the wind at the reference height")
    )
    reference_height: Scalar = eqx.field(
        converter=floats,
        default=10.0,
        metadata=about("m", "reference height of the wind", low=0, high=1e5, low_open=True),
    )
    shear_exponent: Scalar = eqx.field(
        converter=floats,
        default=1 / 7,
        metadata=about("", "exponent of the wind by height", low=0, high=1),
    )

    def wind(self, position, time):
        z, least = position[2] / self.reference_height, 0.01
        low = jnp.clip(z, 0.0, least) / least
        return self.velocity[:, None] * low * jnp.maximum(z, least) ** self.shear_exponent


class Gust(AbstractAir):
    """A one-minus-cosine gust that stands in the way: half of v (1 - cos(2 pi x/length)).

    x is the forward distance y from its start; before and behind it the air rests. The
    discrete gust of flying qualities (MIL-F-8785C has half of it, and a plateau).

    Args:
        velocity: at its peak, inertial axes [m/s], (3,).
        gust_start: forward distance y where it starts [m].
        gust_length: [m], above 0.

    Raises:
        ValueError: a value is not finite or out of range.

    Examples:
        >>> import jax.numpy as jnp
        >>> from jaxglide import Gust
        >>> gust = Gust([0, 0, 2], gust_start=1.0, gust_length=2.0)  # it rises
        >>> places = jnp.array([[0, 0], [1.5, 2.0], [5, 5]])  # x, y, z of two elements
        >>> print(gust.wind(places, 0.0)[2])
        [1. 2.]
    """

    velocity: Vec3 = eqx.field(
        converter=floats, metadata=_wind("velocity at the peak of the gust")
    )
    gust_start: Scalar = eqx.field(
        converter=floats,
        default=1.0,
        metadata=about("m", "forward distance where the gust starts", low=-1e5, high=1e5),
    )
    gust_length: Scalar = eqx.field(
        converter=floats,
        default=2.0,
        metadata=about("m", "length of the gust", low=0, high=1e5, low_open=True),
    )

    def wind(self, position, time):
        inside = jnp.clip((position[1] - self.gust_start) / self.gust_length, 0.0, 1.0)
        _, cosine = sincos(2 * jnp.pi * inside)
        return self.velocity[:, None] * (1 - cosine) / 2


class Turbulence(AbstractAir):
    """Frozen isotropic turbulence with von Karman's spectrum, made of plane waves.

    E(k) = (55/9) Gamma(5/6)/(sqrt(pi) Gamma(1/3)) sigma^2 l (k l)^4/(1 + (k l)^2)^(17/6),
    with l = 1.339 times the integral length of the velocity along the path. The waves are
    divergence-free, equally many in equal parts of log k, with directions, phases and
    polarisations drawn from a seed (Kraichnan 1970, doi:10.1063/1.1692799): one seed is one
    field, smooth to every order.

    Args:
        intensity: standard deviation of each component [m/s], 0 to 100.
        length_scale: integral length L [m], above 0.
        velocity: mean wind, inertial axes [m/s], with which the field drifts, (3,); by
            default none.
        seed: of the field, 0 or more (static).
        modes: number of plane waves, 8 to 4096 (static). Their wave numbers run from 0.05/l
            to 200/l; the variance of what is left out (4 %) is given to them.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    intensity: Scalar = eqx.field(
        converter=floats,
        metadata=about("m/s", "standard deviation of the turbulence", low=0, high=_LIMIT),
    )
    length_scale: Scalar = eqx.field(
        converter=floats,
        default=5.0,
        metadata=about(
            "m", "integral length of the turbulence", low=0, high=1e5, low_open=True
        ),
    )
    velocity: Vec3 = eqx.field(
        converter=floats,
        default=(0.0, 0.0, 0.0),
        metadata=about("m/s", "mean wind", low=-_LIMIT, high=_LIMIT),
    )
    seed: int = eqx.field(static=True, default=0)
    modes: int = eqx.field(static=True, default=128)

    def _check(self):
        check_integer("seed", self.seed, 0, 2**63 - 1)
        check_integer("modes", self.modes, 8, 4096)

    def wind(self, position, time):
        waves = _plane_waves(self.seed, self.modes)
        number = waves.number / (_KARMAN * self.length_scale)
        place = position - self.velocity[:, None] * time
        angle = number @ place + waves.phase[:, None]
        _, cosine = sincos(angle)
        return self.velocity[:, None] + self.intensity * (waves.amplitude.T @ cosine)


_KARMAN = 1.339  # l over the integral length
_ENDS = (0.05, 200.0)  # of k l


class _PlaneWaves(NamedTuple):
    """Wave vectors times l, (M, 3), amplitudes over sigma, (M, 3), phases, (M,)."""

    number: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray


@lru_cache(maxsize=16)
def _plane_waves(seed: int, modes: int) -> _PlaneWaves:
    """Plane waves of one seed: each stands for an equal part of log k."""
    rng = np.random.default_rng(seed)
    edges = np.geomspace(*_ENDS, modes + 1)
    within = np.geomspace(edges[:-1], edges[1:], 33)
    energy = np.trapezoid(within**4 / (1 + within**2) ** (17 / 6), within, axis=0)
    k = edges[:-1] * (edges[1:] / edges[:-1]) ** rng.uniform(size=modes)
    direction, other = rng.normal(size=(2, modes, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.cross(direction, other)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    # all three components together have a variance of 3 sigma^2, a wave half its square
    size = np.sqrt(6 * energy / energy.sum())
    phase = rng.uniform(0, 2 * np.pi, modes)
    return _PlaneWaves(k[:, None] * direction, size[:, None] * across, phase)
