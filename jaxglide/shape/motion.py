"""How a body bends in time: the seams of shape, drive and law."""

import abc
from typing import NamedTuple

import jax.numpy as jnp

from .._lib.checks import check_given, check_kind, result_of
from .._lib.fields import Part
from .._lib.types import Array, Float, Nodes, Scalar, Vec3


class Bending(NamedTuple):
    """Bending angles at the nodes [rad] and their first two time derivatives, all (n,)."""

    theta: Nodes
    theta_dot: Nodes
    theta_ddot: Nodes
    psi: Nodes
    psi_dot: Nodes
    psi_ddot: Nodes


class Observation(NamedTuple):
    """What a drive may see of the flight, without noise or delay.

    Attributes:
        position: centre of mass, inertial axes [m], (3,).
        velocity: its velocity, inertial axes [m/s], (3,).
        omega: angular velocity, body axes [rad/s], (3,).
        angles: yaw, pitch, roll [rad], (3,).
    """

    position: Vec3
    velocity: Vec3
    omega: Vec3
    angles: Vec3


def at_rest() -> Observation:
    """An observation of a level body at rest at the origin."""
    zero = jnp.zeros(3)
    return Observation(zero, zero, zero, zero)


class Coordinates(NamedTuple):
    """Coordinates of a shape and their first two time derivatives, all (m,)."""

    q: Float[Array, " m"]
    q_dot: Float[Array, " m"]
    q_ddot: Float[Array, " m"]


class AbstractShape(Part):
    """Bending angles along the body from a few coordinates: the seam for another waveform.

    See `Serpenoid` and `Waveform`. What the coordinates do in time is a drive's affair.
    """

    @property
    @abc.abstractmethod
    def coordinates(self) -> tuple[str, ...]:
        """Names of the m coordinates. The last of a shape with a cycle is `phase` [rad]: the
        shape repeats where it grows by 2 pi."""

    @abc.abstractmethod
    def bending(
        self, fraction: Nodes, neck_fraction: Scalar, coordinates: Coordinates
    ) -> Bending:
        """Angles at the nodes, with their exact time derivatives.

        Twice differentiable in the coordinates. Everything may be traced.

        Args:
            fraction: arc length over the length at the nodes, (n,).
            neck_fraction: end of the neck; 0 for a body without one (see `in_neck`).
            coordinates: q, its rate and the rate of that, each (m,).
        """


class AbstractDrive(Part):
    """What the coordinates of a shape do in time: the seam for another drive.

    See `Running`, `Programme` and `Actuated`. It may have k states of its own, which stand
    in the state of the flight. q'' may depend on time, states and observation, not on the
    angular acceleration; q' and q'' are the exact derivatives of q along the flight.
    """

    def start(self, phase: Scalar) -> Float[Array, " k"]:
        """Own states at launch, (k,); by default none.

        Args:
            phase: launch phase [rad].
        """
        return jnp.zeros(0)

    @abc.abstractmethod
    def __call__(
        self,
        time: Scalar,
        phase: Scalar,
        states: Float[Array, " k"],
        observation: Observation,
    ) -> tuple[Coordinates, Float[Array, " k"]]:
        """Coordinates, and the rates of the own states, (k,).

        Args:
            time: since launch [s].
            phase: launch phase [rad], which a shape without a cycle has no use for.
            states: own states, (k,).
            observation: of the flight.
        """


class AbstractMotion(Part):
    """How a body bends in time. See `Gait`, `Driven` (a shape and its drive) and
    `TabulatedMotion`."""

    def start(self, phase: Scalar) -> Float[Array, " k"]:
        """Own states at launch, (k,); by default none (see `AbstractDrive.start`)."""
        return jnp.zeros(0)

    @abc.abstractmethod
    def bending(
        self,
        fraction: Nodes,
        neck_fraction: Scalar,
        time: Scalar,
        phase: Scalar,
        states: Float[Array, " k"],
        observation: Observation,
    ) -> tuple[Bending, Float[Array, " k"]]:
        """Bending at the nodes, and rates of the own states; arguments as of
        `AbstractShape.bending` and `AbstractDrive.__call__`."""

    def cycle(self, fraction: Nodes, neck_fraction: Scalar, phase: Scalar) -> Bending | None:
        """Bending at a phase [rad] of the cycle, derivatives by phase, all else at rest.

        None for a motion without a cycle: its launch has no phase to choose, and starts
        level.
        """
        return None

    @property
    def straight(self) -> bool:
        """Whether it is known never to bend the body."""
        return False


def in_neck(fraction: Nodes, neck_fraction: Scalar) -> tuple[Nodes, Nodes]:
    """Where along the wave a node bends, and how much of it (eqs 9-12), each (n,).

    In the neck, the angles at its end ramp linearly to zero at the snout: the wave is taken
    at max(s, s_neck) and scaled by min(s/s_neck, 1). Without a neck it is taken as it is.
    """
    there = neck_fraction > 0
    scale = fraction / jnp.where(there, neck_fraction, 1.0)
    return (
        jnp.maximum(fraction, neck_fraction),
        jnp.where(there, jnp.minimum(scale, 1.0), 1.0),
    )


class Driven(AbstractMotion):
    """A shape and what drives it.

    Args:
        shape: bending angles from coordinates.
        drive: the coordinates in time.

    Raises:
        TypeError: a part is of another type.
        ValueError: the drive's coordinates are not as many as the shape's, its states and
            their rates do not match, or it runs a phase that the shape does not have.
    """

    shape: AbstractShape
    drive: AbstractDrive

    def _check(self):
        check_kind("shape", self.shape, AbstractShape)
        check_kind("drive", self.drive, AbstractDrive)
        names, kind = self.shape.coordinates, type(self.drive).__name__
        states = result_of(f"start of {kind}", self.drive.start, jnp.zeros(()))
        check_given(f"start of {kind}", states, ("k",))
        given = result_of(
            kind, lambda y: self.drive(jnp.zeros(()), jnp.zeros(()), y, at_rest()), states
        )
        if not isinstance(given, tuple) or list(map(type, given[:-1])) != [Coordinates]:
            raise TypeError(f"{kind} must give Coordinates and the rates of its own states")
        found, rates = given
        for what, values in zip(Coordinates._fields, found, strict=True):
            shape = getattr(values, "shape", None)
            if shape != (len(names),):
                raise ValueError(
                    f"{kind} gives {what} of shape {shape}: the shape's coordinates are "
                    f"{len(names)} ({', '.join(names)})"
                )
        check_given(f"{kind}'s rates of its states", rates, states.shape)
        if getattr(self.drive, "cyclic", False) and names[-1] != "phase":
            raise ValueError(
                f"cyclic = True of {kind} is not allowed: the shape's last coordinate is "
                f"{names[-1]}, no phase that a frequency could run"
            )

    def start(self, phase):
        return self.drive.start(phase)

    def bending(self, fraction, neck_fraction, time, phase, states, observation):
        coordinates, rates = self.drive(time, phase, states, observation)
        return self.shape.bending(fraction, neck_fraction, coordinates), rates

    def cycle(self, fraction, neck_fraction, phase):
        if self.shape.coordinates[-1] != "phase":
            return None
        none = jnp.zeros_like(phase)
        now, _ = self.drive(none, none, self.drive.start(none), at_rest())
        rest = jnp.zeros_like(now.q)
        here = Coordinates(now.q.at[-1].set(phase), rest.at[-1].set(1.0), rest)
        return self.shape.bending(fraction, neck_fraction, here)
