"""`integrate`: a flight from any state, from one time to another or to an end."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import all_known, check_kind, check_range, is_traced, number, warn_float32
from .._lib.either_mode import either_mode
from ..body.sections import discretise
from .dynamics import (
    RIGID,
    Flight,
    Glider,
    check_glider,
    six_degrees_of_freedom,
    with_own_states,
)
from .ends import AbstractEnd, Outcome
from .solve import Settings, Solved, settings_of, solve
from .trajectory import Trajectory

_ROOM = 1024  # steps of a dense trajectory that are provided for at first


def with_room(solved: Callable[[Settings], Any], settings: Settings) -> Any:
    """A flight with room for as many steps of a dense trajectory as it takes, by trying.

    The trajectory's room is set aside beforehand, a kilobyte a step.

    Args:
        solved: from settings to a flight.
        settings: the room in them is the most there may be.
    """
    room = _ROOM
    while True:
        room = min(room, settings.max_steps)
        flown = solved(dataclasses.replace(settings, max_steps=room))
        if room == settings.max_steps or int(flown.outcome) != Outcome.OUT_OF_STEPS:
            return dataclasses.replace(flown, settings=settings)
        room *= 8


def _flown(glider, state, t0, phase, settings: Settings, *, adjoint) -> tuple[Any, Solved]:
    flight = Flight(glider, discretise(glider.body), phase)
    if state.shape[0] == RIGID:
        state = with_own_states(t0, state, flight)
    return state, solve(six_degrees_of_freedom, state, t0, flight, settings, adjoint)


_flown_either_mode = either_mode(_flown)


@eqx.filter_jit
def _integrate(glider, state, t0, phase, settings: Settings, adjoint) -> Trajectory:
    if adjoint is None and not settings.dense:
        start, solved = _flown_either_mode(glider, state, t0, phase, settings)
    else:
        adjoint = diffrax.ForwardMode() if adjoint is None else adjoint
        start, solved = _flown(glider, state, t0, phase, settings, adjoint=adjoint)
    return Trajectory(
        glider=glider,
        settings=settings,
        phase=phase,
        start_time=t0,
        start=start,
        **vars(solved),
    )


def own_states(glider: Glider) -> int:
    """How many own states motion and aerodynamics of a glider have."""

    def state(glider):
        flight = Flight(glider, discretise(glider.body), jnp.zeros(()))
        return with_own_states(jnp.zeros(()), jnp.zeros(RIGID), flight)

    return eqx.filter_eval_shape(state, glider).shape[0] - RIGID


def integrate(
    glider: Glider,
    state,
    t0: float,
    t1: float,
    *,
    phase=0.0,
    ends: AbstractEnd | Sequence[AbstractEnd] = (),
    save: Any = None,
    rtol: float = 1e-6,
    atol: float = 1e-6,
    solver: diffrax.AbstractSolver | None = None,
    max_steps: int = 100_000,
    step: float | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> Trajectory:
    """Fly on from a state, until an end or a time.

    Pure and compiled, and differentiable, as `simulate` is; with respect to the state, t0 and
    t1 too.

    Args:
        glider: what flies.
        state: at t0, (13,), as described in `jaxglide.flight.dynamics`; the own states of
            motion and aerodynamics, if there are any, start here, or stand behind it.
        t0, t1: first and last time since launch [s], t0 below t1.
        phase: launch phase of the motion [rad].
        ends: what may end it before; by default nothing.
        save: times [s] at which to keep the state, increasing, (T,), or "dense" for a
            continuous trajectory; by default only the end is kept.
        rtol, atol, solver, max_steps, step, adjoint: as in `simulate`.

    Raises:
        ValueError: an argument is not finite, out of range or of the wrong shape; the message
            names it.
        TypeError: an argument is of the wrong type.

    Examples:
        >>> from jaxglide import Gait, Glider, Ground, Polar, Snake, integrate
        >>> body, gait = Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.4)
        >>> glider = Glider(body, gait, Polar.smooth())
        >>> state = [0, 0, 1, 0, 2, -3, 0, 0, 0, 1, 0, 0, 0]  # at 1 m, forward and down
        >>> flight = integrate(glider, state, 0.0, 1.0, ends=Ground())
        >>> print(f"{flight.ending} after {flight.time:.3f} s")
        landed after 0.267 s
    """
    check_glider(glider)
    state = number("state")(state)
    if state.ndim != 1 or state.shape[0] not in (RIGID, RIGID + own_states(glider)):
        sizes = sorted({RIGID, RIGID + own_states(glider)})
        allowed = " or ".join(f"({size},)" for size in sizes)
        raise ValueError(f"state has shape {state.shape}: it must be {allowed}")
    check_range("state", state, "")
    check_range("t0", t0, "s", 0, 1e4, shape=())
    check_range("t1", t1, "s", 0, 1e4, shape=())
    if not is_traced(t0) and not is_traced(t1) and not float(t0) < float(t1):
        raise ValueError(f"t1 = {float(t1):g} s is not after t0 = {float(t0):g} s")
    check_range("phase", phase, "rad", -1e6, 1e6, shape=())
    if adjoint is not None:
        check_kind("adjoint", adjoint, diffrax.AbstractAdjoint)
    dense = isinstance(save, str)
    if dense and save != "dense":
        raise ValueError(f"save = {save!r} is neither times nor 'dense'")
    settings = settings_of(
        rtol=rtol,
        atol=atol,
        max_time=t1,
        times=None if dense else save,
        ends=ends,
        solver=solver,
        step=step,
        max_steps=max_steps,
        dense=dense,
        start=-np.inf if is_traced(t0) else float(t0),
    )
    warn_float32(rtol, atol, state.dtype)
    given = glider, state, jnp.asarray(t0, state.dtype), jnp.asarray(phase, state.dtype)
    if dense and all_known(given, settings):
        return with_room(lambda s: _integrate(*given, s, adjoint), settings)
    return _integrate(*given, settings, adjoint)
