"""One way to integrate: from a state to the first of its ends, with one outcome."""

import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import check_integer, check_kind, check_range, floating, is_traced, number
from .._lib.types import Array, Bool, Float, Integer, Scalar, State, Vec3
from .ends import AbstractEnd, Outcome, check_ends, clearance, outcome_codes
from .peaks import PeakController

_EVENT_TOLERANCE = {8: (1e-13, 1e-11), 4: (1e-6, 1e-5)}  # relative and absolute
_MAX_STEP = 0.05  # s; events show as sign changes between steps only
# With Diffrax's 0.9 a quarter of the steps across the published polar's kinks is rejected;
# 0.7 takes as many in all and lands three times closer (3.7 against 0.8 mm at 1e-6).
_SAFETY = 0.7
_FIRST_STEP = 2e-3  # s
_MIN_STEP = 1e-12  # s; below this the vector field is not finite
_OVER = 1e-9  # s, for which a flight that is over at its start is flown

Field = Callable[[Scalar, State, Any], State]


class Settings(eqx.Module):
    """How a flight was solved; see `simulate` and `integrate`.

    What is a float is traced, so that changing it compiles nothing; a fixed step and the
    number of steps are part of the compiled function.

    Attributes:
        rtol, atol: tolerances of a step.
        max_time: longest flight, or its last time [s].
        times: times at which the state was kept [s], (T,), or None.
        ends: what ends it.
        solver: the Diffrax solver.
        step: fixed step [s], or None (static).
        max_steps: most steps (static).
        dense: whether a continuous trajectory was kept (static).
    """

    rtol: Scalar
    atol: Scalar
    max_time: Scalar
    times: Array | None
    ends: tuple[AbstractEnd, ...]
    solver: diffrax.AbstractSolver
    step: float | None = eqx.field(static=True)
    max_steps: int = eqx.field(static=True)
    dense: bool = eqx.field(static=True)

    def controller(self, longest: float = _MAX_STEP) -> diffrax.AbstractStepSizeController:
        """The step size controller: PID on the tolerances, or the fixed step."""
        if self.step is not None:
            return diffrax.ConstantStepSize()
        return diffrax.PIDController(
            self.rtol,
            self.atol,
            safety=_SAFETY,
            dtmin=_MIN_STEP,
            dtmax=longest,
            force_dtmin=False,
        )


def settings_of(
    *, rtol, atol, max_time, times, ends, solver, step, max_steps, dense, start=0.0
) -> Settings:
    """Settings, each checked; see `simulate` for what they are.

    Raises:
        ValueError: one is not finite, out of range or of the wrong shape.
        TypeError: one is of the wrong type.
    """
    if solver is not None:
        check_kind("solver", solver, diffrax.AbstractERK)
    for name, value in (("rtol", rtol), ("atol", atol)):
        check_range(name, value, "", 0, 0.1, low_open=True, shape=())
    check_integer("max_steps", max_steps, 1, 10**9)
    if step is not None:
        check_range("step", step, "s", 1e-7, 1, low_open=True, shape=())
    if times is not None:
        times = number("times")(times)
        check_range("times", times, "s", start, shape=("T",))
        if times.size == 0:
            raise ValueError("times is empty: give at least one")
        if not is_traced(times) and np.any(np.diff(times) < 0):
            raise ValueError("times must increase")
    return Settings(
        rtol=floating(rtol),
        atol=floating(atol),
        max_time=floating(max_time),
        times=times,
        ends=check_ends(ends),
        solver=diffrax.Dopri5() if solver is None else solver,
        step=None if step is None else float(step),
        max_steps=max_steps,
        dense=dense,
    )


class FirstStep(diffrax.AbstractStepSizeController):
    """A controller that knows its first step.

    Given as Diffrax's `dt0` it would be checked at run time, by a callback to Python, as soon
    as a time is traced; and what calls back is not kept in JAX's cache of compiled code.
    """

    inner: diffrax.AbstractStepSizeController
    first: Scalar

    def wrap(self, direction):
        return FirstStep(self.inner.wrap(direction), self.first)

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        return self.inner.init(terms, t0, t1, y0, self.first, args, func, error_order)

    def adapt_step_size(self, *arguments):
        return self.inner.adapt_step_size(*arguments)


class Solved(eqx.Module):
    """What `solve` computes; see `Glide` for what it means."""

    outcome: Integer
    time: Scalar
    state: State
    max_angles: Vec3 | None
    accepted: Integer
    rejected: Integer
    states: Float[Array, "T s"] | None
    interpolation: diffrax.DenseInterpolation | None


class Posed(eqx.Module):
    """An integration to be done.

    Attributes:
        start: the state given, (s,).
        flying: whether it is in flight there. A start beyond an end, or not finite, is over at
            once. Its lane must not keep a batch waiting: another one is flown for an instant,
            and what it did is thrown away.
        state: from which to integrate, (s,).
        t0, t1: from when to when [s].
        controller: of the steps.
        settings: how.
        turns: whether the state is that of a flight, whose angles are followed (static).
    """

    start: State
    flying: Bool[Array, ""]
    state: State
    t0: Scalar
    t1: Scalar
    controller: diffrax.AbstractStepSizeController
    settings: Settings
    turns: bool = eqx.field(static=True)

    @classmethod
    def of(
        cls, start, t0, settings: Settings, turns=True, longest=_MAX_STEP, first=_FIRST_STEP
    ):
        """See `solve`."""
        ends = settings.ends
        flying = jnp.all(jnp.isfinite(start))
        if ends:
            flying &= jnp.all(clearance(ends, t0, start) > 0)
        state = jnp.where(flying, start, jnp.zeros_like(start))
        t1 = jnp.where(flying, settings.max_time, t0 + _OVER)
        step = jnp.minimum(settings.step or first, t1 - t0)
        controller = FirstStep(settings.controller(longest), step)
        if turns:
            controller = PeakController(controller, _steady(ends))
        return cls(start, flying, state, t0, t1, controller, settings, turns)


def solve(
    field: Field,
    start: State,
    t0: Scalar,
    args: Any,
    settings: Settings,
    adjoint: diffrax.AbstractAdjoint,
    *,
    turns: bool = True,
    longest: float = _MAX_STEP,
    first: float = _FIRST_STEP,
) -> Solved:
    """Integrate to the first end, or to the last time; classify. Pure; nothing raises.

    Args:
        field: rate of the state, of time [s], state and `args`.
        start: state at `t0`, (s,).
        t0: time [s].
        args: what the field needs.
        settings: how.
        adjoint: how Diffrax differentiates.
        turns: whether the state is that of a flight, whose angles are followed.
        longest, first: longest and first step of adaptive ones [s].
    """
    posed = Posed.of(start, t0, settings, turns, longest, first)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),  # type: ignore
        settings.solver,
        t0=t0,
        t1=posed.t1,
        dt0=None,
        y0=posed.state,
        args=args,
        saveat=_kept(settings, t0, posed.t1, turns),
        stepsize_controller=posed.controller,
        event=_event(settings.ends, posed.state.dtype),
        adjoint=adjoint,
        max_steps=settings.max_steps,
        throw=False,
    )
    ts, ys, stats = solution.ts, solution.ys, solution.stats
    assert ts is not None
    assert ys is not None
    results = diffrax.RESULTS
    solved = classified(
        posed,
        time=ts["end"][0],
        state=ys["end"][0],
        ended=solution.result == results.event_occurred,
        failed=solution.result == results.dt_min_reached,
        unfinished=solution.result == results.max_steps_reached,
        control=solution.controller_state,
        accepted=stats["num_accepted_steps"],
        rejected=stats["num_rejected_steps"],
        states=None if settings.times is None else ys["times"],
    )
    if not settings.dense:
        return solved
    return dataclasses.replace(solved, interpolation=solution.interpolation)


def classified(
    posed: Posed,
    *,
    time: Scalar,
    state: State,
    ended: Bool[Array, ""],
    failed: Bool[Array, ""],
    unfinished: Bool[Array, ""],
    control: Any,
    accepted: Integer,
    rejected: Integer,
    states: Float[Array, "T s"] | None,
) -> Solved:
    """An integration that is over, and how it ended.

    Args:
        posed: what was to be done.
        time, state: at its end.
        ended: whether one of the ends was reached.
        failed: whether the steps became too short.
        unfinished: whether there were too few steps.
        control: state of the controller.
        accepted, rejected: steps.
        states: at the settings' times, (T, s), or None.
    """
    t0, flying, times = posed.t0, posed.flying, posed.settings.times
    time = jnp.where(flying, time, t0)
    state = jnp.where(flying, state, posed.start)
    if times is not None:
        states = within(times, t0, time, posed.start, states)
    ends, outcome = posed.settings.ends, jnp.asarray(int(Outcome.OUT_OF_TIME))
    finite = jnp.all(jnp.isfinite(state))
    if ends:
        # of all ends at the end point, the one it is closest to
        left = clearance(ends, time, state)
        nearest, finite = jnp.argmin(left), finite & ~jnp.any(jnp.isnan(left))
        outcome = jnp.where(ended | ~flying, jnp.asarray(outcome_codes(ends))[nearest], outcome)
    outcome = jnp.where(unfinished, Outcome.OUT_OF_STEPS, outcome)
    # A vector field that is not finite has every step rejected, down to the smallest.
    outcome = jnp.where(finite & ~failed, outcome, Outcome.NON_FINITE).astype(jnp.int32)
    return Solved(
        outcome=outcome,
        time=time,
        state=state,
        max_angles=control[1].upto(time, state) if posed.turns else None,
        accepted=accepted,
        rejected=rejected,
        states=states,
        interpolation=None,
    )


def _steady(ends: tuple[AbstractEnd, ...]) -> tuple[AbstractEnd, ...]:
    return tuple(end for end in ends if end.steady)


def _kept(settings: Settings, t0, t1, turns) -> diffrax.SaveAt:
    saved = {"end": diffrax.SubSaveAt(t1=True)}
    if settings.times is not None:
        saved["times"] = diffrax.SubSaveAt(ts=jnp.clip(settings.times, t0, t1))
    return diffrax.SaveAt(subs=saved, dense=settings.dense, controller_state=turns)


def _event(ends: tuple[AbstractEnd, ...], dtype) -> diffrax.Event | None:
    if not ends:
        return None
    return diffrax.Event(
        lambda t, y, args, **_: jnp.min(clearance(ends, t, y)),
        end_finder(dtype),
        direction=False,
    )


def end_finder(dtype) -> optx.AbstractRootFinder:
    """What finds the end within a step, in numbers of that type."""
    # The bracket's signs are known: positive in flight, negative after the event.
    return optx.Bisection(*_EVENT_TOLERANCE[dtype.itemsize], flip=True)


def within(times, start, end, first: State, states) -> Float[Array, "T s"]:
    """States (T, s): the first one at the start, NaN outside the flight."""
    states = jnp.where((times == start)[:, None], first, states)
    return jnp.where(((times >= start) & (times <= end))[:, None], states, jnp.nan)
