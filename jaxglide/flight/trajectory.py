"""What a flight leaves behind: where it went, at any time of it."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import (
    all_known,
    check_integer,
    check_kind,
    check_range,
    check_shape,
    in_numpy,
    number,
)
from .._lib.report import Report, Reported
from .._lib.types import Array, Float, Integer, Scalar, State, Vec3
from ..body.sections import discretise
from .dynamics import ANGLES, PATH, POSITION, VELOCITY, Elements, Flight, Glider, elements
from .ends import outcome_words
from .solve import Settings, within


class AbstractTrajectory(eqx.Module, Reported):
    """A flight from a start to its end; see `Trajectory` and `Glide`.

    Attributes:
        glider: what flew.
        settings: how it was solved.
        phase: launch phase of the motion [rad].
        start_time: [s].
        start: the state there (see `dynamics`), (s,).
        outcome: how it ended, as an integer (see `ending`).
        time: of its end [s].
        state: there, (s,).
        max_angles: largest |yaw|, |pitch|, |roll| on the way [rad], (3,).
        accepted, rejected: steps of the solver.
        states: states at `times`, (T, s), NaN outside the flight, or None.
        interpolation: dense solution if one was asked for, or None.
    """

    glider: eqx.AbstractVar[Glider]
    settings: eqx.AbstractVar[Settings]
    phase: eqx.AbstractVar[Scalar]
    start_time: eqx.AbstractVar[Scalar]
    start: eqx.AbstractVar[State]
    outcome: eqx.AbstractVar[Integer]
    time: eqx.AbstractVar[Scalar]
    state: eqx.AbstractVar[State]
    max_angles: eqx.AbstractVar[Vec3]
    accepted: eqx.AbstractVar[Integer]
    rejected: eqx.AbstractVar[Integer]
    states: eqx.AbstractVar[Float[Array, "T s"] | None]
    interpolation: eqx.AbstractVar[diffrax.DenseInterpolation | None]

    @property
    def times(self) -> Float[Array, "... T"] | None:
        """Requested times [s], (T,), or None."""
        return self.settings.times

    @property
    def ending(self) -> str:
        """How one flight ended, in words."""
        check_single(self)
        return outcome_words(self.settings.ends)[int(self.outcome)]

    @property
    def landing_point(self) -> Float[Array, "... 3"]:
        """Position of the centre of mass at the end [m], (3,)."""
        return self.state[..., POSITION]

    @property
    def velocity(self) -> Float[Array, "... 3"]:
        """Velocity over the ground at the end, inertial axes [m/s], (3,)."""
        return self.state[..., VELOCITY]

    @property
    def end_angles(self) -> Float[Array, "... 3"]:
        """Yaw, pitch, roll at the end [rad], (3,)."""
        return self.state[..., ANGLES]

    @property
    def path_length(self) -> Float[Array, "..."]:
        """Horizontal path length over the ground, the published "glide distance" [m]."""
        return self.state[..., PATH]

    @property
    def height_lost(self) -> Float[Array, "..."]:
        """Height lost, the published "vertical distance" [m]."""
        return self.start[..., 2] - self.state[..., 2]

    @property
    def glide_angle(self) -> Float[Array, "..."]:
        """Angle of the path over the ground below the horizontal at the end [rad]."""
        v = self.velocity
        xp: Any = np if isinstance(v, np.ndarray) else jnp
        return xp.arctan2(-v[..., 2], xp.hypot(v[..., 0], v[..., 1]))

    def at(self, times) -> Float[Array, "T s"]:
        """States at `times` [s], (T,) to (T, s), NaN outside; needs a dense trajectory."""
        check_single(self)
        if self.interpolation is None:
            raise ValueError("this glide kept no trajectory: simulate it with dense=True")
        times = jnp.asarray(number("times")(times), self.time.dtype)
        check_shape("times", times, ("T",))
        return _states_at(self, times)

    def sample_times(self, count: int = 200) -> Float[Array, "... T"]:
        """`count` equally spaced times [s] from start to end, (count,)."""
        check_integer("count", count, 1, 10**7)
        first, last = in_numpy(self.start_time)[..., None], in_numpy(self.time)[..., None]
        return jnp.asarray(first + (last - first) * np.linspace(0.0, 1.0, count))


@eqx.filter_jit
def _states_at(flight: AbstractTrajectory, times) -> Float[Array, "T s"]:
    first = jnp.asarray(flight.start_time, flight.time.dtype)
    inside = (times >= first) & (times <= flight.time)
    assert flight.interpolation is not None
    states = jax.vmap(flight.interpolation.evaluate)(jnp.where(inside, times, first))
    return within(times, first, flight.time, flight.start, states)


class Trajectory(AbstractTrajectory):
    """A piece of flight from a given state; see `integrate`."""

    glider: Glider
    settings: Settings
    phase: Scalar
    start_time: Scalar
    start: State
    outcome: Integer
    time: Scalar
    state: State
    max_angles: Vec3
    accepted: Integer
    rejected: Integer
    states: Float[Array, "T s"] | None
    interpolation: diffrax.DenseInterpolation | None

    def report(self) -> Report:
        check_single(self)
        x, y, z = jax.device_get(self).landing_point
        return Report(
            f"Flight from {float(self.start_time):.4f} s: {self.ending} at "
            f"{float(self.time):.4f} s",
            (("end point", f"x {x:.4f}   y {y:.4f}   z {z:.4f} m"), steps_row(self)),
        )


def steps_row(flown: AbstractTrajectory) -> tuple[str, str]:
    """The solver's steps as a row of a report."""
    accepted, rejected = int(flown.accepted), int(flown.rejected)
    return "solver steps", f"{accepted} accepted, {rejected} rejected"


def check_single(flown: AbstractTrajectory) -> None:
    """Raise `ValueError` for a batch of flights."""
    if flown.time.ndim:
        raise ValueError(
            f"this holds glides of shape {flown.time.shape}: take one, as "
            "jax.tree.map(lambda x: x[0], glides), or use vmap"
        )


@eqx.filter_jit
def _reconstruct(glider, phase, times, states):
    flight = Flight(glider, discretise(glider.body), phase)
    return jax.vmap(lambda t, y: elements(t, y, flight))(times, states)


def reconstruct(glide: AbstractTrajectory, times=None) -> Elements:
    """Every element's motion and force at times of a glide.

    Args:
        glide: one glide, simulated with `dense=True` or with `times`.
        times: [s], (T,), within the glide; by default the times it was simulated for.
            Inside `jit`, `vmap` or `grad` those outside it give NaN.

    Returns:
        `Elements` with a leading time axis: positions, velocities, angle of attack, Re,
        sweep angle, dynamic pressure, C_L, C_D, lift, drag, force and moment of every
        element.

    Raises:
        ValueError: the glide kept no trajectory, or a time lies outside it.

    Examples:
        >>> from jaxglide import Gait, Glider, Launch, Polar, Snake, reconstruct, simulate
        >>> body, gait = Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.4)
        >>> glider = Glider(body, gait, Polar.smooth())
        >>> glide = simulate(glider, Launch(height=2.0), times=[0.2, 0.4])
        >>> elements = reconstruct(glide)
        >>> elements.aerodynamics.lift.shape  # times, elements
        (2, 70)
        >>> print(elements.aerodynamics.lift.sum(axis=1).round(4))  # N
        [0.0355 0.0642]
    """
    check_single(check_kind("glide", glide, AbstractTrajectory))
    if times is None:
        if glide.times is None:
            raise ValueError("give times, or simulate the glide with times")
        times, states = glide.times, glide.states
    else:
        times = number("times")(times)
        states = glide.at(times)
        if all_known(glide.time):
            check_range("times", times, "s", float(glide.start_time), float(glide.time))
    return _reconstruct(glide.glider, glide.phase, times, states)
