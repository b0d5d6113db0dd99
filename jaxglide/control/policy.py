"""What sets the inputs of a plant: the seam for a controller that is sampled."""

import abc
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from .._lib.types import Array, Float, Integer, Scalar


class Sensed(NamedTuple):
    """What a policy is told at a sample, as it is sensed: late, rounded, with noise.

    Attributes:
        sample: number of the sample since launch.
        phase: of the waves [rad].
        angles: yaw, pitch, roll [rad], (3,).
        omega: angular velocity in body axes [rad/s], (3,).
        velocity: in heading axes: right, forward, up [m/s], (3,); NaN if it is not sensed.
        height: [m]; NaN if it is not sensed.
        positions, rates: of the actuators, (6,).
        told: inputs told at the sample before, (6,).
        place: horizontal position [m], (2,); None if it is not sensed.
    """

    sample: Integer
    phase: Scalar
    angles: Float[Array, "3"]
    omega: Float[Array, "3"]
    velocity: Float[Array, "3"]
    height: Scalar
    positions: Float[Array, "6"]
    rates: Float[Array, "6"]
    told: Float[Array, "6"]
    place: Float[Array, "2"] | None


class AbstractPolicy(eqx.Module):
    """Inputs from what is sensed, sample by sample. Pure; everything may be traced.

    Attributes:
        learns: names of the fields that `train_policy` changes (class variable).
    """

    learns: ClassVar[tuple[str, ...]] = ()

    def start(self) -> Any:
        """What it remembers at launch, a tree of arrays; by default nothing."""
        return ()

    @abc.abstractmethod
    def __call__(self, memory: Any, sensed: Sensed) -> tuple[Float[Array, "6"], Any]:
        """Inputs wanted until the next sample, (6,), and what it remembers then."""


class Constant(AbstractPolicy):
    """The same inputs always.

    Args:
        inputs: (6,).
    """

    inputs: Float[Array, "6"] = eqx.field(converter=jnp.asarray)

    def __call__(self, memory, sensed):
        return self.inputs, memory


def turned(angle):
    """An angle the short way round [rad]."""
    return jnp.mod(angle + jnp.pi, 2 * jnp.pi) - jnp.pi


def sensed_state(sensed: Sensed, chosen: tuple[int, ...]) -> Float[Array, " n"]:
    """What is sensed as a controlled state: velocity in heading axes, angular velocity,
    pitch, roll, yaw, positions and rates of the chosen actuators and what they
    were told, (9 + 3 c,)."""
    index = jnp.array(chosen)
    turns = jnp.roll(sensed.angles, -1)  # pitch, roll, yaw
    own = sensed.positions[index], sensed.rates[index], sensed.told[index]
    return jnp.concatenate([sensed.velocity, sensed.omega, turns, *own])


def deviation(sensed: Sensed, state, chosen: tuple[int, ...]) -> Float[Array, " n"]:
    """How far what is sensed is from a controlled state, the yaw the short way round."""
    apart = sensed_state(sensed, chosen) - state
    return apart.at[8].set(turned(apart[8]))


_TURNING = 0.1  # by which angular velocities and rates of actuators come to about one


def observed(sensed: Sensed, chosen: tuple[int, ...]) -> Float[Array, " o"]:
    """What is sensed, but for velocity and height, as numbers of order one, (8 + 2 c,).

    Sine and cosine of the waves' phase, yaw, pitch, roll [rad], angular velocity [10 rad/s],
    positions and rates [10 a second] of the actuators.
    """
    index = jnp.array(chosen)
    parts = [
        jnp.stack([jnp.sin(sensed.phase), jnp.cos(sensed.phase)]),
        sensed.angles,
        _TURNING * sensed.omega,
        sensed.positions[index],
        _TURNING * sensed.rates[index],
    ]
    return jnp.concatenate(parts)
