"""`simulate`: one glide from launch to its end."""

from collections.abc import Sequence

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import all_known, check_kind, check_range, is_traced, warn_float32
from .._lib.either_mode import either_mode
from .._lib.fields import recheck
from .._lib.report import Report
from .._lib.types import Array, Bool, Float, Integer, Scalar, State, Vec3
from ..body.sections import discretise
from .dynamics import Flight, Glider, check_glider, six_degrees_of_freedom
from .ends import (
    AbstractEnd,
    AngleLimit,
    Ground,
    Outcome,
    Plane,
    check_ends,
    default_ends,
    outcome_words,
)
from .integrate import with_room
from .lane import Pilot
from .launch import Launch, TakeOff, take_off
from .pool import Task
from .solve import Posed, Settings, Solved, settings_of, solve
from .stored import Stages, solve_back
from .trajectory import AbstractTrajectory, steps_row


class Glide(AbstractTrajectory):
    """A glide: how it went, and its trajectory where one was asked for.

    Attributes:
        glider, launch: what flew and how it was launched.
        settings: how it was solved.
        take_off: phase, angles, speed and state at t = 0.
        outcome: how it ended, an `Outcome` or the code of another end (see `ending`).
        time: end of the glide [s].
        state: at the end (see `dynamics`), (s,).
        max_angles: largest |yaw|, |pitch|, |roll| on the way [rad], (3,).
        accepted, rejected: steps of the solver.
        states: states at `times`, (T, s), NaN after the end, or None.
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
    states: Float[Array, "T s"] | None
    interpolation: diffrax.DenseInterpolation | None

    @property
    def phase(self) -> Float[Array, "..."]:
        """Launch phase [rad]."""
        return self.take_off.phi_theta

    @property
    def start_time(self) -> Float[Array, "..."]:
        """Time of the launch, 0 [s]."""
        return jnp.zeros_like(self.time)

    @property
    def start(self) -> Float[Array, "... s"]:
        """State at launch, (s,)."""
        return self.take_off.state

    @property
    def stable(self) -> Bool[Array, "..."]:
        """Whether the glide reached the ground."""
        return self.outcome == Outcome.LANDED

    def report(self) -> Report:
        if self.time.ndim:
            outcomes, counts = np.unique(np.asarray(self.outcome), return_counts=True)
            words = outcome_words(self.settings.ends)
            rows = zip(outcomes.tolist(), counts.tolist(), strict=True)
            return Report(
                f"{np.asarray(self.time).size} glides",
                tuple((words[code], f"  {count}") for code, count in rows),
            )
        known = jax.device_get(self)  # JAX would compile every slice of it
        x, y, z = known.landing_point
        end, most, start = map(
            np.rad2deg, (known.end_angles, known.max_angles, known.take_off.angles)
        )

        def triple(a):
            return f"yaw {a[0]:8.3f}   pitch {a[1]:8.3f}   roll {a[2]:8.3f} deg"

        speed, phase = float(self.take_off.speed), float(self.take_off.phi_theta)
        return Report(
            f"Glide from {float(self.launch.height):g} m: {self.ending} "
            f"after {float(self.time):.4f} s",
            (
                ("end point", f"x {x:.4f}   y {y:.4f}   z {z:.4f} m"),
                ("path length", f"{known.path_length:.4f} m horizontally"),
                ("height lost", f"{known.height_lost:.4f} m"),
                ("glide angle", f"{np.rad2deg(known.glide_angle):.2f} deg at the end"),
                ("launch", f"{speed:.4f} m/s, phase {phase:.6f} rad"),
                ("launch angles", triple(start)),
                ("end angles", triple(end)),
                ("largest angles", triple(most)),
                steps_row(self),
            ),
        )


def _fly(glider: Glider, launch: Launch, settings, *, adjoint) -> tuple[TakeOff, Solved]:
    """Launch, integrate, classify. Pure; nothing raises here."""
    sections = discretise(glider.body)
    start = take_off(glider, launch, sections, adjoint)
    flight = Flight(glider, sections, start.phi_theta)
    time = jnp.zeros_like(start.state[0])
    if isinstance(adjoint, Stages) and settings.times is None:
        return start, solve_back(six_degrees_of_freedom, start.state, time, flight, settings)
    return start, solve(six_degrees_of_freedom, start.state, time, flight, settings, adjoint)


_fly_either_mode = either_mode(_fly, Stages())


PILOT = Pilot(six_degrees_of_freedom)
"""How a lane of a pool flies a glide."""


def ready(glider: Glider, launch: Launch, **options) -> Task:
    """A glide as a task of a pool; options as in `simulate`, but for dense and adjoint."""
    launch, settings = checked(glider, launch, **options)
    sections = discretise(glider.body)
    start = take_off(glider, launch, sections)
    posed = Posed.of(start.state, jnp.zeros_like(start.state[0]), settings)
    return Task(posed, Flight(glider, sections, start.phi_theta), (glider, launch, start))


def landed(task: Task, solved: Solved) -> Glide:
    """The glide that has come of a task."""
    glider, launch, start = task.kept
    settings = task.posed.settings
    return Glide(
        glider=glider, launch=launch, settings=settings, take_off=start, **vars(solved)
    )


@eqx.filter_jit
def _simulate(glider, launch, settings: Settings, adjoint) -> Glide:
    if adjoint is None and not settings.dense:
        start, solved = _fly_either_mode(glider, launch, settings)
    else:
        adjoint = diffrax.ForwardMode() if adjoint is None else adjoint
        start, solved = _fly(glider, launch, settings, adjoint=adjoint)
    return Glide(
        glider=glider, launch=launch, settings=settings, take_off=start, **vars(solved)
    )


def simulate(
    glider: Glider,
    launch: Launch | None = None,
    *,
    ends: AbstractEnd | Sequence[AbstractEnd] | None = None,
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
    """Fly one glide from launch to its end: the ground, or an angle of 85 degrees.

    Pure and compiled: `jit`, `vmap`, `grad`, `jacfwd` apply, with respect to every float
    in `glider` and `launch`, through the launch and the end of the glide. Nothing raises
    once the arguments are accepted: see `Glide.outcome`.

    Args:
        glider: what flies.
        launch: how it starts; by default from 10 m at the published speed.
        ends: what ends it, an end or several; by default the ground and 85 degrees of yaw,
            pitch or roll (`Ground()`, `AngleLimit()`). For turning flight, leave the yaw out:
            `AngleLimit(angles=("pitch", "roll"))`.
        rtol, atol: relative and absolute tolerance of a step, above 0 up to 0.1.
        solver: a Diffrax solver of explicit Runge-Kutta kind, by default `Dopri5()`.
        times: times [s] at which to keep the state, increasing, (T,); default none.
        dense: keep a continuous trajectory for `Glide.at`. Forward mode only. Its memory
            follows the flight; inside `jit`, `vmap` and `jacfwd`, where that is not known
            beforehand, it is a kilobyte for each of `max_steps`.
        max_time: longest flight [s].
        max_steps: most steps of the solver, rejected ones included.
        step: a fixed step [s] instead of adaptive ones.
        adjoint: how Diffrax differentiates. By default both modes work, each at its own
            cost, and derivatives of higher order in any combination of them; name one of
            Diffrax's adjoints to commit to it.

    Returns:
        The glide. Under `vmap`, every array has the batch dimensions in front.

    Raises:
        ValueError: an argument is not finite, out of range or of the wrong shape (fly many
            at once by `vmap`); the message names it.
        TypeError: an argument is of the wrong type.

    Examples:
        >>> from jaxglide import Gait, Glider, Launch, Polar, Snake, simulate
        >>> body, gait = Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.4)
        >>> glider = Glider(body, gait, Polar.smooth())
        >>> glide = simulate(glider, Launch(height=2.0))
        >>> print(f"{glide.ending} {glide.landing_point[1]:.3f} m forward")
        landed 1.298 m forward
    """
    if adjoint is not None:
        check_kind("adjoint", adjoint, diffrax.AbstractAdjoint)
    launch, settings = checked(
        glider,
        launch,
        ends=ends,
        rtol=rtol,
        atol=atol,
        max_time=max_time,
        times=times,
        solver=solver,
        step=step,
        max_steps=max_steps,
        dense=dense,
    )
    if dense and all_known(glider, launch, settings):
        return with_room(lambda s: _simulate(glider, launch, s, adjoint), settings)
    return _simulate(glider, launch, settings, adjoint)


def checked(
    glider,
    launch,
    *,
    ends,
    max_time,
    times=None,
    solver=None,
    step=None,
    dense=False,
    **given,
) -> tuple[Launch, Settings]:
    """Launch and settings of a glide, both checked; see `simulate` for arguments and errors."""
    launch = Launch() if launch is None else launch
    check_glider(glider)
    recheck(check_kind("launch", launch, Launch))
    ends = default_ends() if ends is None else check_ends(ends)
    _check_start(launch, ends)
    check_range("max_time", max_time, "s", 0, 1e4, low_open=True, shape=())
    others = {"times": times, "solver": solver, "step": step, "dense": dense}
    settings = settings_of(max_time=max_time, ends=ends, **others, **given)
    warn_float32(given["rtol"], given["atol"], launch.height.dtype)
    return launch, settings


def _check_start(launch: Launch, ends: Sequence[AbstractEnd]) -> None:
    """Raise `ValueError` for a launch beyond the ground, a plane or a limit of the angles."""
    for end in ends:
        beyond = ""
        if any(map(is_traced, jax.tree.leaves((launch.height, end)))):
            continue
        if isinstance(end, Ground) and float(launch.height) <= float(end.level):
            beyond = f"above the ground at {float(end.level):g} m"
        if isinstance(end, Plane):
            along = float(np.asarray(end.normal)[2]) * float(launch.height)
            beyond = "on the near side of the plane" if along >= float(end.offset) else ""
        if beyond:
            raise ValueError(
                f"height = {float(launch.height):g} m is not allowed: the launch must be "
                f"{beyond} that ends the flight"
            )
    if launch.angles is None or is_traced(launch.angles):
        return
    for end in ends:
        if isinstance(end, AngleLimit) and not is_traced(end.limit):
            limit = float(end.limit)
            names = ("yaw", "pitch", "roll")
            given = np.asarray(launch.angles)[[names.index(name) for name in end.angles]]
            check_range("angles", given, "rad", -limit, limit, low_open=True, high_open=True)
