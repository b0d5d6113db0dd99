"""The rotationally invariant glide: a fall with the attitude held.

The snake keeps undulating while it falls, but does not turn: only its centre of mass moves,
under the force averaged over the phases of its waves. Lateral motion is left out, as
published.
"""

import math
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import (
    check_integer,
    check_kind,
    check_range,
    check_shape,
    is_traced,
    warn_float32,
)
from .._lib.either_mode import either_mode
from .._lib.fields import recheck
from .._lib.report import Report, Reported
from .._lib.types import Array, Float, Int, Integer, Scalar, Vec3
from ..body.sections import Sections, discretise
from ..flight.dynamics import POSITION, VELOCITY, Glider, check_glider
from ..flight.ends import TURNS, Ground, Outcome
from ..flight.lane import Pilot
from ..flight.launch import Launch, launch_velocity, published_speed
from ..flight.pool import Task
from ..flight.solve import Posed, Settings, Solved, settings_of, solve
from ..loads.inertia import over_nodes
from .loads import (
    MOMENT_PHASES,
    PHASES,
    Loads,
    by_phase,
    check_angles,
    held_elements,
    phases_of,
)

FORCE_PHASES = 10
"""Phases over which the force that moves the centre of mass is averaged, as published."""
PUBLISHED_LAUNCH = (10.0, 1.7)
"""Height [m] and forward speed [m/s] of the published held glides."""

_FIRST_STEP = 1e-2  # s
_MAX_STEP = 0.2  # s; the ground shows as a sign change between steps only
_MAX_STEPS = 4096
_IN_PLANE = np.array([0.0, 1.0, 1.0])  # x is left out
_PLANE = np.array([1, 2, 4, 5])  # y, z, v_y, v_z of position and velocity


class Fall(eqx.Module, Reported):
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

    def report(self) -> Report:
        if self.time.ndim:
            landed = np.asarray(self.outcome) == Outcome.LANDED
            rows = ((str(Outcome.LANDED), f"  {landed.sum()}"),)
            return Report(f"{landed.size} held glides", rows)
        y, z, v_y, v_z = map(float, self.state)
        slope = math.degrees(math.atan2(-v_z, v_y))
        turns = "   ".join(
            f"{name} {math.degrees(float(angle)):.3f}"
            for name, angle in zip(TURNS, self.angles, strict=True)
        )
        return Report(
            f"Held glide from {float(self.launch.height):g} m: {Outcome(int(self.outcome))} "
            f"after {float(self.time):.4f} s",
            (
                ("held", f"{turns} deg"),
                ("end", f"y {y:.4f}   z {z:.4f} m"),
                (
                    "velocity",
                    f"v_y {v_y:.4f}   v_z {v_z:.4f} m/s, {slope:.2f} deg below the horizontal",
                ),
            ),
        )

    @property
    def times(self) -> Float[Array, "... S"]:
        """Times of the records [s], (S,)."""
        return self.interval[..., None] * jnp.arange(self.states.shape[-2])

    @property
    def last(self) -> Int[Array, "..."]:
        """Index of the first record past the ground (or the last there is)."""
        return jnp.sum(jnp.isfinite(self.states[..., 0]), axis=-1) - 1


class Tunnel(NamedTuple):
    """What the vector field of a held glide needs."""

    glider: Glider
    sections: Sections
    angles: Vec3
    phases: int


def mean_acceleration(velocity: Vec3, tunnel: Tunnel, place: Any = 0.0) -> Vec3:
    """Acceleration by phase-averaged force and weight (eq. 4), inertial axes [m/s^2], (3,)."""
    glider, sections, angles, phases = tunnel
    launched = jnp.zeros_like(velocity[0])

    def force(phase):
        now = held_elements(glider, sections, velocity, angles, launched, phase, place)
        total = over_nodes(now.aerodynamics.force)
        return jnp.sum(now.R_BI * total[:, None], axis=0)

    mean = jnp.mean(jax.vmap(force)(phases_of(phases)), axis=0)
    return mean / sections.total_mass - jnp.zeros(3).at[2].set(glider.gravity)


def _translation(time, state, tunnel: Tunnel):
    """Rate of position and velocity, (6,), in the plane y, z."""
    acceleration = mean_acceleration(state[VELOCITY], tunnel, state[POSITION])
    return jnp.concatenate([state[VELOCITY], _IN_PLANE * acceleration])


def _past(state, tunnel: Tunnel, duration, adjoint):
    """Where it would be a moment after the landing: one step."""
    beyond = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: duration * _translation(t, y, args)),  # type: ignore
        diffrax.Dopri5(),
        t0=0.0,
        t1=1.0,
        dt0=1.0,
        y0=state,
        args=tunnel,
        adjoint=adjoint,
        max_steps=4,
        throw=False,
    )
    assert beyond.ys is not None
    return beyond.ys[0]


class _Fallen(eqx.Module):
    outcome: Integer
    time: Scalar
    state: Float[Array, "4"]
    states: Float[Array, "S 4"]


def _start(tunnel: Tunnel, launch: Launch) -> Float[Array, "6"]:
    """Position and velocity at launch, in the plane."""
    speed = launch.speed
    if speed is None:
        speed = published_speed(tunnel.glider, tunnel.sections)
    position = jnp.zeros(3).at[2].set(launch.height)
    return jnp.concatenate([position, _IN_PLANE * launch_velocity(launch, speed)])


def _fallen(tunnel: Tunnel, solved: Solved, settings, interval, adjoint) -> _Fallen:
    """What has come of a fall, with the first record past the ground."""
    time, state, times = solved.time, solved.state, settings.times
    past = jnp.floor(time / interval).astype(int) + 1
    beyond = _past(state, tunnel, past * interval - time, adjoint)
    assert solved.states is not None
    after = (jnp.arange(times.shape[0]) == past) & (solved.outcome == Outcome.LANDED)
    states = jnp.where(after[:, None], beyond, solved.states)
    return _Fallen(solved.outcome, time, state[_PLANE], states[:, _PLANE])


_STEPS = {"turns": False, "longest": _MAX_STEP, "first": _FIRST_STEP}


def _fall(glider, launch, angles, settings, interval, *, adjoint, phases) -> _Fallen:
    """Translate until the ground, and on to the first record past it."""
    tunnel = Tunnel(glider, discretise(glider.body), angles, phases)
    start = _start(tunnel, launch)
    time = jnp.zeros_like(start[0])
    solved = solve(_translation, start, time, tunnel, settings, adjoint, **_STEPS)
    return _fallen(tunnel, solved, settings, interval, adjoint)


_fall_either_mode = either_mode(_fall)


@eqx.filter_jit
def _dropped(glider, launch, angles, settings, interval, phases) -> Fall:
    given = glider, launch, angles, settings, interval
    fallen = _fall_either_mode(*given, phases=phases)
    return Fall(glider, launch, angles, interval=interval, **vars(fallen))


FALLER = Pilot(_translation)
"""How a lane of a pool falls with its attitude held."""


def ready(glider: Glider, launch: Launch, **options) -> Task:
    """A held glide as a task of a pool; options as in `fall`, none left out."""
    phases = options.pop("phases", FORCE_PHASES)
    launch, angles, settings, interval = _checked(glider, launch, phases=phases, **options)
    tunnel = Tunnel(glider, discretise(glider.body), angles, phases)
    start = _start(tunnel, launch)
    posed = Posed.of(start, jnp.zeros_like(start[0]), settings, **_STEPS)
    return Task(posed, tunnel, (glider, launch, angles, interval, phases))


def landed(task: Task, solved: Solved) -> Fall:
    """The held glide that has come of a task."""
    glider, launch, angles, interval, phases = task.kept
    tunnel = Tunnel(glider, discretise(glider.body), angles, phases)
    settings, adjoint = task.posed.settings, diffrax.ForwardMode()
    fallen = _fallen(tunnel, solved, settings, interval, adjoint)
    return Fall(glider, launch, angles, interval=interval, **vars(fallen))


def _check_launch(launch: Launch) -> None:
    """Raise `ValueError` for what has no effect on a held glide."""
    for name in ("phi_theta", "angles", "omega"):
        if getattr(launch, name) is not None:
            raise ValueError(
                f"{name} of the launch has no effect on a held glide: leave it out"
            )
    if not is_traced(launch.heading) and np.any(np.asarray(launch.heading)):
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

    Pure and compiled, and differentiable in both modes, as `simulate` is. The wind is
    that at its place, at the time of the launch.

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

    Examples:
        >>> from jaxglide import Gait, Glider, Launch, Polar, Snake, fall
        >>> body, gait = Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.4)
        >>> glider = Glider(body, gait, Polar.smooth())
        >>> held = fall(glider, Launch(height=2.0))
        >>> print(f"{held.time:.3f} s, {held.state[0]:.3f} m forward")
        0.713 s, 1.302 m forward
    """
    given = {"interval": interval, "max_time": max_time, "rtol": rtol, "atol": atol}
    checked = _checked(glider, launch, angles, phases, **given)
    return _dropped(glider, *checked, phases)


def _checked(
    glider, launch, angles, phases, *, interval, max_time, rtol, atol
) -> tuple[Launch, Vec3, Settings, Scalar]:
    """Launch, angles, settings and interval of a held glide, checked; see `fall`."""
    launch = Launch(*PUBLISHED_LAUNCH) if launch is None else launch
    check_glider(glider)
    recheck(check_kind("launch", launch, Launch))
    _check_launch(launch)
    angles = check_angles(angles, phases)
    check_range("interval", interval, "s", 1e-4, 10, shape=())
    check_range("max_time", max_time, "s", 0, 1e4 * interval, low_open=True, shape=())
    settings = settings_of(
        rtol=rtol,
        atol=atol,
        max_time=max_time,
        times=interval * np.arange(math.ceil(max_time / interval) + 1),
        ends=Ground(),
        solver=None,
        step=None,
        max_steps=_MAX_STEPS,
        dense=False,
    )
    warn_float32(rtol, atol, angles.dtype)
    return launch, angles, settings, jnp.asarray(interval, angles.dtype)


def _in_space(state) -> tuple[Vec3, Vec3]:
    """Place and velocity, (3,) each, of y, z, v_y, v_z."""
    y, z, v_y, v_z = state
    none = jnp.zeros_like(y)
    return jnp.stack([none, y, z]), jnp.stack([none, v_y, v_z])


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
    sections = discretise(glider.body)

    def at(record):
        time, state = record
        valid = jnp.all(jnp.isfinite(state))
        place, velocity = _in_space(jnp.where(valid, state, 1.0))
        read = by_phase(glider, sections, velocity, angles, time, phases, place=place)
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
    place, velocity = _in_space(fallen.state)
    held = fallen.glider, discretise(fallen.glider.body), velocity, fallen.angles
    return by_phase(*held, fallen.time, phases, place=place)


def loads_at_end(fallen: Fall, phases: int = MOMENT_PHASES) -> Loads:
    """Forces and moments by phase at the end of a held glide, (P, 3).

    Args:
        fallen, phases: as in `loads_along`.

    Raises:
        TypeError, ValueError: as `loads_along`.
    """
    _check_fallen(fallen, phases)
    return _loads_at_end(fallen, phases)
