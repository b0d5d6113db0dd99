"""`simulate`: one glide from launch to its end."""

import dataclasses
import enum

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import (
    all_known,
    check_integer,
    check_kind,
    check_range,
    check_shape,
    is_traced,
    number,
    warn_float32,
)
from .._lib.modes import either_mode
from .._lib.types import Array, Flag, Float, Integer, Scalar, State, Vec3
from ..body.snake import discretise
from .dynamics import ANGLE_LIMIT as ANGLE_LIMIT
from .dynamics import (
    ANGLES,
    PATH,
    POSITION,
    VELOCITY,
    Elements,
    Flight,
    Glider,
    check_glider,
    elements,
    six_degrees_of_freedom,
)
from .launch import Launch, TakeOff, take_off
from .peaks import PeakController, beyond

_EVENT_TOLERANCE = {8: (1e-13, 1e-11), 4: (1e-6, 1e-5)}  # relative and absolute
_MAX_STEP = 0.05  # s; events show as sign changes between steps only
# With Diffrax's 0.9 a quarter of the steps across the published polar's kinks is rejected;
# 0.7 takes as many in all and lands three times closer (3.7 against 0.8 mm at 1e-6).
_SAFETY = 0.7
_FIRST_STEP = 2e-3  # s
_ROOM = 1024  # steps of a dense trajectory that are provided for at first
_MIN_STEP = 1e-12  # s; below this the vector field is not finite


class Outcome(enum.IntEnum):
    """How a glide ended; `str()` gives the words."""

    LANDED = 0
    UNSTABLE_YAW = 1
    UNSTABLE_PITCH = 2
    UNSTABLE_ROLL = 3
    OUT_OF_TIME = 4
    OUT_OF_STEPS = 5
    NON_FINITE = 6

    def __str__(self) -> str:
        return _WORDS[self]


_WORDS = {
    Outcome.LANDED: "landed",
    Outcome.UNSTABLE_YAW: "unstable in yaw",
    Outcome.UNSTABLE_PITCH: "unstable in pitch",
    Outcome.UNSTABLE_ROLL: "unstable in roll",
    Outcome.OUT_OF_TIME: "ran out of time",
    Outcome.OUT_OF_STEPS: "ran out of steps",
    Outcome.NON_FINITE: "not finite",
}


class Settings(eqx.Module):
    """How a glide was solved; see `simulate`.

    Tolerances are traced, so that changing them compiles nothing; the longest flight, a
    fixed step and the numbers of steps are part of the compiled function.

    Attributes:
        rtol, atol: tolerances of a step.
        times: times at which the state was kept [s], (T,), or None.
        solver: the Diffrax solver.
        step: fixed step [s], or None (static).
        max_time: longest flight [s] (static).
        max_steps: most steps (static).
        dense: whether a continuous trajectory was kept (static).
    """

    rtol: Scalar
    atol: Scalar
    times: Array | None
    solver: diffrax.AbstractSolver
    step: float | None = eqx.field(static=True)
    max_time: float = eqx.field(static=True)
    max_steps: int = eqx.field(static=True)
    dense: bool = eqx.field(static=True)

    def controller(self) -> diffrax.AbstractStepSizeController:
        """The step size controller: PID on the tolerances, or the fixed step."""
        if self.step is not None:
            return diffrax.ConstantStepSize()
        return diffrax.PIDController(
            self.rtol,
            self.atol,
            safety=_SAFETY,
            dtmin=_MIN_STEP,
            dtmax=_MAX_STEP,
            force_dtmin=False,
        )


class Glide(eqx.Module):
    """A glide: how it went, and its trajectory where one was asked for.

    Attributes:
        glider, launch: what flew and how it was launched.
        settings: how it was solved.
        take_off: phase, angles, speed and state at t = 0.
        outcome: an `Outcome` as an integer.
        time: end of the glide [s].
        state: the 13 numbers of the state at the end (see `dynamics`).
        max_angles: largest |yaw|, |pitch|, |roll| on the way [rad], (3,).
        accepted, rejected: steps of the solver.
        states: states at `times`, (T, 13), NaN after the end, or None.
        interpolation: dense solution if `dense=True` was asked for, or None.
    """

    glider: Glider
    launch: Launch
    settings: Settings
    take_off: TakeOff
    outcome: Integer
    time: Scalar
    state: State
    max_angles: Vec3
    accepted: Integer
    rejected: Integer
    states: Float[Array, "T 13"] | None
    interpolation: diffrax.DenseInterpolation | None

    @property
    def times(self) -> Float[Array, " T"] | None:
        """Requested times [s], (T,), or None."""
        return self.settings.times

    @property
    def landing_point(self) -> Float[Array, "... 3"]:
        """Position of the centre of mass at the end [m], (3,)."""
        return self.state[..., POSITION]

    @property
    def velocity(self) -> Float[Array, "... 3"]:
        """Velocity of the centre of mass at the end, inertial axes [m/s], (3,)."""
        return self.state[..., VELOCITY]

    @property
    def end_angles(self) -> Float[Array, "... 3"]:
        """Yaw, pitch, roll at the end [rad], (3,)."""
        return self.state[..., ANGLES]

    @property
    def path_length(self) -> Float[Array, "..."]:
        """Horizontal path length, the published "glide distance" [m]."""
        return self.state[..., PATH]

    @property
    def height_lost(self) -> Float[Array, "..."]:
        """Height lost, the published "vertical distance" [m]."""
        return self.launch.height - self.state[..., 2]

    @property
    def glide_angle(self) -> Float[Array, "..."]:
        """Angle of the path below the horizontal at the end [rad]."""
        v = self.velocity
        return jnp.arctan2(-v[..., 2], jnp.hypot(v[..., 0], v[..., 1]))

    @property
    def stable(self) -> Flag:
        """Whether the glide reached the ground."""
        return self.outcome == Outcome.LANDED

    def at(self, times) -> Float[Array, "T 13"]:
        """States at `times` [s], (T,) to (T, 13), NaN outside; needs `dense=True`."""
        _check_single(self)
        if self.interpolation is None:
            raise ValueError("this glide kept no trajectory: simulate it with dense=True")
        times = jnp.asarray(number("times")(times), self.time.dtype)
        check_shape("times", times, ("T",))
        inside = (times >= 0) & (times <= self.time)
        states = jax.vmap(self.interpolation.evaluate)(jnp.where(inside, times, 0.0))
        return _within(times, self.time, self.take_off.state, states)

    def sample_times(self, count: int = 200) -> Float[Array, "... T"]:
        """`count` equally spaced times [s] from launch to the end, (count,)."""
        check_integer("count", count, 1, 10**7)
        return self.time[..., None] * jnp.linspace(0.0, 1.0, count)

    def view(self, path=None, **options):
        """An interactive view of this glide, one HTML file; needs `dense=True`.

        Args:
            path: where to write the file; by default nowhere.
            **options: as `jaxglide.view.view`.

        Returns:
            A `jaxglide.view.Page`, which shows itself in a notebook.

        Raises:
            ValueError, OSError: as `jaxglide.view.view`.
        """
        from ..view import view  # the front door to a floor above, only when called

        return view(self, path, **options)

    def __str__(self) -> str:
        if self.time.ndim:
            outcomes, counts = np.unique(np.asarray(self.outcome), return_counts=True)
            lines = [f"{np.asarray(self.time).size} glides"]
            lines += [
                f"  {Outcome(code)!s:18} {count}"
                for code, count in zip(outcomes, counts, strict=True)
            ]
            return "\n".join(lines)
        x, y, z = np.asarray(self.landing_point)
        end, most, start = (
            np.rad2deg(np.asarray(a))
            for a in (self.end_angles, self.max_angles, self.take_off.angles)
        )

        def triple(a):
            return f"yaw {a[0]:8.3f}   pitch {a[1]:8.3f}   roll {a[2]:8.3f} deg"

        return "\n".join(
            [
                f"Glide from {float(self.launch.height):g} m: {Outcome(int(self.outcome))} "
                f"after {float(self.time):.4f} s",
                f"  end point        x {x:.4f}   y {y:.4f}   z {z:.4f} m",
                f"  path length      {float(self.path_length):.4f} m horizontally",
                f"  height lost      {float(self.height_lost):.4f} m",
                f"  glide angle      {float(np.rad2deg(self.glide_angle)):.2f} deg at the end",
                f"  launch           {float(self.take_off.speed):.4f} m/s, "
                f"phase {float(self.take_off.phi_theta):.6f} rad",
                f"  launch angles    {triple(start)}",
                f"  end angles       {triple(end)}",
                f"  largest angles   {triple(most)}",
                f"  solver steps     {int(self.accepted)} accepted, "
                f"{int(self.rejected)} rejected",
            ]
        )


def _check_single(glide: Glide) -> None:
    if glide.time.ndim:
        raise ValueError(
            f"this holds glides of shape {glide.time.shape}: take one, as "
            "jax.tree.map(lambda x: x[0], glides), or use vmap"
        )


def _within(times, end, start: State, states):
    """States (T, 13): the launch at time 0, NaN outside the glide."""
    states = jnp.where((times == 0)[:, None], start, states)
    return jnp.where(((times >= 0) & (times <= end))[:, None], states, jnp.nan)


def _clearance(t, y, args=None, **_):
    """Positive in flight, zero at the first of ground contact or an angle's limit."""
    return -jnp.max(_beyond(y))


def _beyond(y: State):
    return beyond(jnp.concatenate([y[2:3], y[ANGLES]]))


def _outcome(solution, upright, end: State) -> Integer:
    """Why the glide ended: of all limits at the end point, the one it is closest to."""
    result, results = solution.result, diffrax.RESULTS
    ended = (result == results.event_occurred) | ~upright
    outcome = jnp.where(ended, jnp.argmax(_beyond(end)), Outcome.OUT_OF_TIME)
    outcome = jnp.where(result == results.max_steps_reached, Outcome.OUT_OF_STEPS, outcome)
    # A vector field that is not finite has every step rejected, down to the smallest.
    finite = jnp.all(jnp.isfinite(end)) & (result != results.dt_min_reached)
    return jnp.where(finite, outcome, Outcome.NON_FINITE).astype(jnp.int32)


class _Flown(eqx.Module):
    """What `_fly` computes: the computed part of a `Glide`."""

    take_off: TakeOff
    outcome: Integer
    time: Scalar
    state: State
    max_angles: Vec3
    accepted: Integer
    rejected: Integer
    states: Float[Array, "T 13"] | None
    interpolation: diffrax.DenseInterpolation | None


def _fly(glider: Glider, launch: Launch, *, settings: Settings, adjoint) -> _Flown:
    """Launch, integrate, classify. Pure; nothing raises here."""
    sections = discretise(glider.snake)
    start = take_off(glider, launch, sections, adjoint)
    flight = Flight(glider, sections, start.phi_theta)
    upright = (_clearance(0.0, start.state) > 0) & jnp.all(jnp.isfinite(start.state))
    # A launch beyond the limit, or not finite, is over at once. Its lane must not keep a
    # batch waiting: it falls from just above the ground, and what it did is thrown away.
    state = jnp.where(upright, start.state, jnp.zeros_like(start.state).at[2].set(1e-6))
    times = settings.times
    saved = {"end": diffrax.SubSaveAt(t1=True)}
    if times is not None:
        saved["times"] = diffrax.SubSaveAt(ts=jnp.minimum(times, settings.max_time))
    # The bracket's signs are known: positive in flight, negative after the event.
    finder = optx.Bisection(*_EVENT_TOLERANCE[state.dtype.itemsize], flip=True)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(six_degrees_of_freedom),  # type: ignore
        settings.solver,
        t0=0.0,
        t1=settings.max_time,
        dt0=min(settings.step or _FIRST_STEP, settings.max_time),
        y0=state,
        args=flight,
        saveat=diffrax.SaveAt(subs=saved, dense=settings.dense, controller_state=True),
        stepsize_controller=PeakController(settings.controller()),
        event=diffrax.Event(_clearance, finder, direction=False),
        adjoint=adjoint,
        max_steps=settings.max_steps,
        throw=False,
    )
    ts, ys, stats = solution.ts, solution.ys, solution.stats
    assert ts is not None
    assert ys is not None
    time = jnp.where(upright, ts["end"][0], 0.0)
    state = jnp.where(upright, ys["end"][0], start.state)
    states = None
    if times is not None:
        states = _within(times, time, start.state, ys["times"])
    peaks = solution.controller_state[1]  # type: ignore
    return _Flown(
        take_off=start,
        outcome=_outcome(solution, upright, state),
        time=time,
        state=state,
        max_angles=peaks.upto(time, state),
        accepted=stats["num_accepted_steps"],
        rejected=stats["num_rejected_steps"],
        states=states,
        interpolation=solution.interpolation if settings.dense else None,
    )


_fly_either_mode = either_mode(_fly)


def _simulate_dense(glider, launch, settings: Settings, adjoint) -> Glide:
    """`_simulate` with room for as many steps as it takes, found by trying.

    The trajectory's room is set aside beforehand, a kilobyte a step.
    """
    room = _ROOM
    while True:
        room = min(room, settings.max_steps)
        enough = dataclasses.replace(settings, max_steps=room)
        glide = _simulate(glider, launch, enough, adjoint)
        if room == settings.max_steps or int(glide.outcome) != Outcome.OUT_OF_STEPS:
            return dataclasses.replace(glide, settings=settings)
        room *= 8


@eqx.filter_jit
def _simulate(glider, launch, settings, adjoint) -> Glide:
    if adjoint is not None:
        flown = _fly(glider, launch, settings=settings, adjoint=adjoint)
    elif settings.dense:
        flown = _fly(glider, launch, settings=settings, adjoint=diffrax.ForwardMode())
    else:
        flown = _fly_either_mode(glider, launch, settings=settings)
    return Glide(glider=glider, launch=launch, settings=settings, **vars(flown))


def simulate(
    glider: Glider,
    launch: Launch | None = None,
    *,
    rtol: float = 1e-6,
    atol: float = 1e-6,
    solver: diffrax.AbstractSolver | None = None,
    times=None,
    dense: bool = False,
    max_time: float = 60.0,
    max_steps: int = 100_000,
    step: float | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> Glide:
    """Fly one glide from launch to the ground, or until an angle reaches 85 degrees.

    Pure and compiled: `jit`, `vmap`, `grad`, `jacfwd` apply, with respect to every float
    in `glider` and `launch`, through the launch and the end of the glide. Nothing raises
    once the arguments are accepted: see `Glide.outcome`.

    Args:
        glider: what flies.
        launch: how it starts; by default from 10 m at the published speed.
        rtol, atol: relative and absolute tolerance of a step, above 0 up to 0.1.
        solver: a Diffrax solver of explicit Runge-Kutta kind, by default `Dopri5()`.
        times: times [s] at which to keep the state, increasing, (T,); default none.
        dense: keep a continuous trajectory for `Glide.at`. Forward mode only. Its memory
            follows the flight; inside `jit`, `vmap` and `jacfwd`, where that is not known
            beforehand, it is a kilobyte for each of `max_steps`.
        max_time: longest flight [s].
        max_steps: most steps of the solver, rejected ones included.
        step: a fixed step [s] instead of adaptive ones.
        adjoint: how Diffrax differentiates. By default both modes work, and derivatives of
            higher order in any combination of them, as long as no more numbers are varied
            than a glide has (some 40); name one of Diffrax's adjoints to commit to it
            (`RecursiveCheckpointAdjoint` for the gradient of one number with respect to very
            many).

    Returns:
        The glide. Under `vmap`, every array has the batch dimensions in front.

    Raises:
        ValueError: an argument is not finite, out of range or of the wrong shape (fly many
            at once by `vmap`); the message names it.
        TypeError: an argument is of the wrong type.
    """
    launch = Launch() if launch is None else launch
    check_glider(glider)
    check_kind("launch", launch, Launch).__check_init__()
    if solver is not None:
        check_kind("solver", solver, diffrax.AbstractERK)
    if adjoint is not None:
        check_kind("adjoint", adjoint, diffrax.AbstractAdjoint)
    for name, value in (("rtol", rtol), ("atol", atol)):
        check_range(name, value, "", 0, 0.1, low_open=True, shape=())
    check_range("max_time", max_time, "s", 0, 1e4, low_open=True, shape=())
    check_integer("max_steps", max_steps, 1, 10**9)
    if step is not None:
        check_range("step", step, "s", 1e-7, 1, low_open=True, shape=())
    if times is not None:
        times = number("times")(times)
        check_range("times", times, "s", 0, shape=("T",))
        if times.size == 0:
            raise ValueError("times is empty: give at least one")
        if not is_traced(times) and np.any(np.diff(times) < 0):
            raise ValueError("times must increase")
    dtype = launch.height.dtype
    warn_float32(rtol, atol, dtype)
    settings = Settings(
        rtol=jnp.asarray(rtol, dtype),
        atol=jnp.asarray(atol, dtype),
        times=times,
        solver=diffrax.Dopri5() if solver is None else solver,
        step=None if step is None else float(step),
        max_time=float(max_time),
        max_steps=max_steps,
        dense=dense,
    )
    if dense and all_known(glider, launch, settings):
        return _simulate_dense(glider, launch, settings, adjoint)
    return _simulate(glider, launch, settings, adjoint)


@eqx.filter_jit
def _reconstruct(glide: Glide, times, states):
    glider = glide.glider
    flight = Flight(glider, discretise(glider.snake), glide.take_off.phi_theta)
    return jax.vmap(lambda t, y: elements(t, y, flight))(times, states)


def reconstruct(glide: Glide, times=None) -> Elements:
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
    """
    _check_single(check_kind("glide", glide, Glide))
    if times is None:
        if glide.times is None:
            raise ValueError("give times, or simulate the glide with times")
        times, states = glide.times, glide.states
    else:
        times = number("times")(times)
        states = glide.at(times)
        if not is_traced(glide.time):
            check_range("times", times, "s", 0, float(glide.time))
    return _reconstruct(glide, times, states)
