"""The virtual wind tunnel: the attitude is held, the air's moments are read.

The paper's rotationally invariant model (figures 5 and 6). The snake keeps undulating while
it falls, but does not turn: only its centre of mass moves, under the force averaged over the
phases of its waves. Body axes are x (pitch), y (roll) and z (yaw); with all angles 0 they are
the inertial axes. Lateral motion is left out, as published.
"""

import math
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import (
    check_integer,
    check_kind,
    check_range,
    check_shape,
    is_traced,
    number,
    warn_float32,
)
from .._lib.modes import either_mode
from .._lib.numerics import cross, sincos
from .._lib.parameters import TUNNEL
from .._lib.types import Array, Float, Integer, Scalar, Vec3
from ..body.snake import Sections, discretise
from ..flight.dynamics import ANGLES, VELOCITY, Elements, Flight, Glider, check_glider, elements
from ..flight.glide import ANGLE_LIMIT, Outcome
from ..flight.launch import Launch, published_speed
from ..loads.inertia import moment_of, over_nodes, shape_moment

PITCH, ROLL, YAW = 0, 1, 2  # components of a moment in body axes

FORCE_PHASES = 10
"""Phases over which the force that moves the centre of mass is averaged, as published."""
MOMENT_PHASES = 60
"""Phases at which moments are read, as published."""
PUBLISHED_LAUNCH = (10.0, 1.7)
"""Height [m] and forward speed [m/s] of the published held glides."""

PHASES = int(TUNNEL["phases"].low), int(TUNNEL["phases"].high)
"""Fewest and most phases: with fewer than four, left and right alone are compared."""

_FIRST_STEP = 1e-2  # s
_MAX_STEP = 0.2  # s; the ground shows as a sign change between steps only
_MAX_STEPS = 4096
_GROUND = {8: (1e-13, 1e-11), 4: (1e-6, 1e-5)}  # tolerances of the landing, by float size


def phases_of(count: int) -> Float[Array, " P"]:
    """`count` equally spaced phases phi_theta from 0 [rad], (P,)."""
    return 2 * jnp.pi / count * jnp.arange(count)


def _held(glider, sections, velocity, angles, time, phase) -> Elements:
    """The body's elements at a held attitude, moving at `velocity` [m/s], (3,)."""
    state = jnp.zeros((13,), velocity.dtype).at[VELOCITY].set(velocity).at[ANGLES].set(angles)
    return elements(time, state, Flight(glider, sections, phase))


class Loads(eqx.Module):
    """Forces and moments by phase in body axes, of the whole body or of each element.

    Leading dimensions `...` are those of times or cases; per element there is a trailing
    dimension n.

    Attributes:
        force: force of the air [N], (..., P, 3) or (..., P, 3, n).
        aerodynamic: its moment about the centre of mass [N m], same shape.
        inertial: rate [h'] of the shape change's angular momentum [N m], same shape.
    """

    force: Float[Array, "..."]
    aerodynamic: Float[Array, "..."]
    inertial: Float[Array, "..."]

    @property
    def inertial_ratio(self) -> Float[Array, "... 3"]:
        """Peak-to-peak of the inertial over that of the aerodynamic moment, (..., 3).

        NaN, for undefined, where the air's moment is the same at all phases: without air, or
        for a straight body.
        """
        air = over_phases(self.aerodynamic).peak_to_peak
        return jnp.where(
            air == 0,
            jnp.nan,
            over_phases(self.inertial).peak_to_peak / jnp.where(air == 0, 1.0, air),
        )


class OverPhases(NamedTuple):
    """Statistics over phases, each (..., 3)."""

    mean: Float[Array, "... 3"]
    lowest: Float[Array, "... 3"]
    highest: Float[Array, "... 3"]
    peak_to_peak: Float[Array, "... 3"]


def over_phases(values: Float[Array, "... P 3"]) -> OverPhases:
    """Mean, extremes and peak-to-peak of (..., P, 3) over its phases."""
    lowest, highest = values.min(-2), values.max(-2)
    return OverPhases(values.mean(-2), lowest, highest, highest - lowest)


def _by_phase(glider, sections, velocity, angles, time, phases, per_element=False) -> Loads:
    """Loads at every phase, (P, 3), or of every element, (P, 3, n)."""

    def at(phase):
        now = _held(glider, sections, velocity, angles, time, phase)
        r, force = now.body.position, now.aerodynamics.force
        inertial = shape_moment(sections, now.body)
        if per_element:
            return Loads(force, cross(r, force), inertial)
        return Loads(over_nodes(force), moment_of(r, force), over_nodes(inertial))

    return jax.vmap(at)(phases_of(phases))


def check_angles(angles, phases) -> Vec3:
    """Held angles [rad] as an array; `ValueError` where they or the phases are not allowed."""
    angles = number("angles")(angles)
    check_shape("angles", angles, (3,))
    limit = ANGLE_LIMIT
    check_range("angles", angles, "rad", -limit, limit, low_open=True, high_open=True)
    check_integer("phases", phases, *PHASES)
    return angles


def check_held(velocity, angles, phases) -> tuple[Vec3, Vec3]:
    """Velocity [m/s] and angles [rad] as arrays; `ValueError` where they are not (3,)."""
    angles = check_angles(angles, phases)
    velocity = number("velocity")(velocity)
    check_shape("velocity", velocity, (3,))
    check_range("velocity", velocity, "m/s", -1e3, 1e3)
    return velocity, angles


@eqx.filter_jit
def _read(glider, velocity, angles, time, phases, per_element):
    sections = discretise(glider.snake)
    return _by_phase(glider, sections, velocity, angles, time, phases, per_element)


def loads(
    glider: Glider,
    velocity,
    angles=(0.0, 0.0, 0.0),
    *,
    time=0.0,
    phases: int = MOMENT_PHASES,
    per_element: bool = False,
) -> Loads:
    """Forces and moments by phase at a velocity and attitude.

    Args:
        glider: what is in the tunnel.
        velocity: of the centre of mass, inertial axes [m/s], (3,).
        angles: yaw, pitch, roll [rad], (3,), below 85 degrees.
        time: in the waves' phase phi_theta - 2 pi f_theta t [s].
        phases: number of phases phi_theta, equally spaced from 0, 4 to 3600.
        per_element: keep every element apart, (P, 3, n), instead of their sum, (P, 3).

    Raises:
        ValueError: an argument is not finite or out of range.
    """
    check_glider(glider)
    velocity, angles = check_held(velocity, angles, phases)
    check_shape("time", time, ())
    check_range("time", time, "s", -1e4, 1e4)
    return _read(glider, velocity, angles, jnp.asarray(time, angles.dtype), phases, per_element)


class Fall(eqx.Module):
    """A held glide: the fall of a body that does not turn.

    Attributes:
        glider, launch: what fell, and from where.
        angles: held yaw, pitch, roll [rad], (3,).
        outcome: an `Outcome`: landed, out of time, out of steps or not finite.
        time: end of the fall [s].
        state: y, z [m], v_y, v_z [m/s] there, (4,).
        interval: between records [s].
        states: the same every `interval` from 0 on, through the first record past the
            ground, NaN after it, (S, 4).
    """

    glider: Glider
    launch: Launch
    angles: Vec3
    outcome: Integer
    time: Scalar
    state: Float[Array, "4"]
    interval: Scalar
    states: Float[Array, "S 4"]

    @property
    def times(self) -> Float[Array, " S"]:
        """Times of the records [s], (S,)."""
        return self.interval[..., None] * jnp.arange(self.states.shape[-2])

    @property
    def last(self) -> Integer:
        """Index of the first record past the ground (or the last there is)."""
        return jnp.sum(jnp.isfinite(self.states[..., 0]), axis=-1) - 1


class Tunnel(NamedTuple):
    """What the vector field of a held glide needs."""

    glider: Glider
    sections: Sections
    angles: Vec3
    phases: int


def mean_acceleration(velocity: Vec3, tunnel: Tunnel) -> Vec3:
    """Acceleration by the phase-averaged force and weight, inertial axes [m/s^2], (3,)."""
    glider, sections, angles, phases = tunnel

    def force(phase):
        now = _held(glider, sections, velocity, angles, jnp.zeros_like(velocity[0]), phase)
        total = over_nodes(now.aerodynamics.force)
        return jnp.sum(now.R_BI * total[:, None], axis=0)

    mean = jnp.mean(jax.vmap(force)(phases_of(phases)), axis=0)
    return mean / glider.snake.mass - jnp.zeros(3).at[2].set(glider.environment.gravity)


def _translation(tunnel: Tunnel):
    """Vector field of y, z, v_y, v_z: time and state to rate, scaled by a duration."""

    def field(time, state, duration):
        velocity = jnp.concatenate([jnp.zeros(1), state[2:]])
        rate = jnp.concatenate([state[2:], mean_acceleration(velocity, tunnel)[1:]])
        return duration * rate

    return field


class _Fallen(eqx.Module):
    outcome: Integer
    time: Scalar
    state: Float[Array, "4"]
    states: Float[Array, "S 4"]


def _fall(glider, launch, angles, tolerances, interval, *, adjoint, phases, samples, max_time):
    """Translate until the ground, and on to the first record past it."""
    sections = discretise(glider.snake)
    term = diffrax.ODETerm(_translation(Tunnel(glider, sections, angles, phases)))  # type: ignore
    speed = published_speed(glider, sections) if launch.speed is None else launch.speed
    sine, cosine = sincos(launch.elevation)
    start = jnp.stack([0 * speed, launch.height + 0 * speed, speed * cosine, speed * sine])
    times = interval * jnp.arange(samples)
    rtol, atol = tolerances
    finder = optx.Bisection(*_GROUND[start.dtype.itemsize], flip=True)
    solution = diffrax.diffeqsolve(
        term,
        diffrax.Dopri5(),
        t0=0.0,
        t1=max_time,
        dt0=min(_FIRST_STEP, max_time),
        y0=start,
        args=1.0,
        saveat=diffrax.SaveAt(
            subs={
                "end": diffrax.SubSaveAt(t1=True),
                "times": diffrax.SubSaveAt(ts=jnp.minimum(times, max_time)),
            }
        ),
        stepsize_controller=diffrax.PIDController(rtol, atol, dtmax=_MAX_STEP, dtmin=1e-12),
        event=diffrax.Event(lambda t, y, args, **_: y[1], finder, direction=False),
        adjoint=adjoint,
        max_steps=_MAX_STEPS,
        throw=False,
    )
    ts, ys = solution.ts, solution.ys
    assert ts is not None
    assert ys is not None
    time, state = ts["end"][0], ys["end"][0]
    landed = solution.result == diffrax.RESULTS.event_occurred
    past = jnp.floor(time / interval).astype(int) + 1
    # One step from the landing to the first record past it, in a unit of time.
    beyond = diffrax.diffeqsolve(
        term,
        diffrax.Dopri5(),
        t0=0.0,
        t1=1.0,
        dt0=1.0,
        y0=state,
        args=past * interval - time,
        adjoint=adjoint,
        max_steps=4,
        throw=False,
    )
    assert beyond.ys is not None
    flying = (times <= time)[:, None]
    states = jnp.where(flying, jnp.where(flying, ys["times"], 0.0), jnp.nan).at[0].set(start)
    after = (jnp.arange(samples) == past)[:, None] & landed
    states = jnp.where(after, beyond.ys[0], states)
    outcome = jnp.where(landed, Outcome.LANDED, Outcome.OUT_OF_TIME)
    stopped = solution.result == diffrax.RESULTS.max_steps_reached
    outcome = jnp.where(stopped, Outcome.OUT_OF_STEPS, outcome)
    finite = jnp.all(jnp.isfinite(state)) & (solution.result != diffrax.RESULTS.dt_min_reached)
    outcome = jnp.where(finite, outcome, Outcome.NON_FINITE).astype(jnp.int32)
    return _Fallen(outcome, time, state, states)


_fall_either_mode = either_mode(_fall)


@eqx.filter_jit
def _dropped(glider, launch, angles, tolerances, interval, phases, samples, max_time) -> Fall:
    fallen = _fall_either_mode(
        glider,
        launch,
        angles,
        tolerances,
        interval,
        phases=phases,
        samples=samples,
        max_time=max_time,
    )
    return Fall(
        glider,
        launch,
        angles,
        fallen.outcome,
        fallen.time,
        fallen.state,
        interval,
        fallen.states,
    )


def _check_launch(launch: Launch) -> None:
    """Raise `ValueError` for what has no effect on a held glide."""
    for name in ("phi_theta", "angles"):
        if getattr(launch, name) is not None:
            raise ValueError(
                f"{name} of the launch has no effect on a held glide: leave it out"
            )
    if not is_traced(launch.heading) and np.any(launch.heading != 0):
        raise ValueError("heading has no effect on a held glide, which stays in a plane")


def fall(
    glider: Glider,
    launch: Launch | None = None,
    *,
    angles=(0.0, 0.0, 0.0),
    phases: int = FORCE_PHASES,
    interval: float = 0.025,
    max_time: float = 10.0,
    rtol: float = 1e-8,
    atol: float = 1e-8,
) -> Fall:
    """The rotationally invariant glide: fall to the ground with the attitude held.

    Pure and compiled, and differentiable in both modes, as `simulate` is.

    Args:
        glider: what falls.
        launch: height, speed and elevation, and nothing else; by default the published
            10 m and 1.7 m/s.
        angles: held yaw, pitch, roll [rad], (3,), below 85 degrees.
        phases: number of phases over which the force is averaged, 4 to 3600.
        interval: between records [s], 1e-4 to 10; published 0.025.
        max_time: longest fall [s], at most 10,000 intervals.
        rtol, atol: tolerances of a step.

    Raises:
        ValueError: an argument is not finite or out of range; the message names it.
    """
    launch = Launch(*PUBLISHED_LAUNCH) if launch is None else launch
    check_glider(glider)
    check_kind("launch", launch, Launch).__check_init__()
    _check_launch(launch)
    angles = check_angles(angles, phases)
    check_range("interval", interval, "s", 1e-4, 10, shape=())
    check_range("max_time", max_time, "s", 0, 1e4 * interval, low_open=True, shape=())
    for name, value in (("rtol", rtol), ("atol", atol)):
        check_range(name, value, "", 0, 0.1, low_open=True, shape=())
    warn_float32(rtol, atol, angles.dtype)
    samples = math.ceil(max_time / interval) + 1
    tolerances = (jnp.asarray(rtol, angles.dtype), jnp.asarray(atol, angles.dtype))
    step = jnp.asarray(interval, angles.dtype)
    return _dropped(glider, launch, angles, tolerances, step, phases, samples, float(max_time))


def _velocity(state) -> Vec3:
    return jnp.concatenate([jnp.zeros(1), state[2:]])


def read_records(glider: Glider, angles: Vec3, times, states, phases: int) -> Loads:
    """Loads of the whole body at records of a held glide, NaN where a record is NaN.

    Record after record, each with all its phases in one batch: all at once would not fit
    a cache.

    Args:
        glider: what fell.
        angles: held yaw, pitch, roll [rad], (3,).
        times, states: records [s], (S,), and y, z, v_y, v_z, (S, 4).
        phases: number of phases phi_theta.
    """
    sections = discretise(glider.snake)

    def at(record):
        time, state = record
        valid = jnp.all(jnp.isfinite(state))
        velocity = _velocity(jnp.where(valid, state, 1.0))
        read = _by_phase(glider, sections, velocity, angles, time, phases)
        return jax.tree.map(lambda values: jnp.where(valid, values, jnp.nan), read)

    return jax.lax.map(at, (times, states))


def _check_fallen(fallen, phases) -> None:
    check_kind("fallen", fallen, Fall)
    check_shape("fallen", fallen.time, ())
    check_integer("phases", phases, *PHASES)


@eqx.filter_jit
def _loads_along(fallen: Fall, phases: int) -> Loads:
    given = fallen.times, fallen.states
    return read_records(fallen.glider, fallen.angles, *given, phases)


def loads_along(fallen: Fall, phases: int = MOMENT_PHASES) -> Loads:
    """Forces and moments by phase at every record of a held glide, NaN after its end.

    Args:
        fallen: one held glide.
        phases: number of phases phi_theta; the waves' time runs on as in free flight.

    Returns:
        `Loads` of the whole body, (S, P, 3).

    Raises:
        TypeError, ValueError: no held glide, or a batch of them; phases out of range.
    """
    _check_fallen(fallen, phases)
    return _loads_along(fallen, phases)


@eqx.filter_jit
def _loads_at_end(fallen: Fall, phases: int) -> Loads:
    velocity = _velocity(fallen.state)
    sections = discretise(fallen.glider.snake)
    return _by_phase(fallen.glider, sections, velocity, fallen.angles, fallen.time, phases)


def loads_at_end(fallen: Fall, phases: int = MOMENT_PHASES) -> Loads:
    """Forces and moments by phase at the end of a held glide, (P, 3).

    Args:
        fallen, phases: as in `loads_along`.

    Raises:
        TypeError, ValueError: as `loads_along`.
    """
    _check_fallen(fallen, phases)
    return _loads_at_end(fallen, phases)
