"""One flight step by step: attempt after attempt of Diffrax's solver and controller."""

import dataclasses
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from .._lib.types import Array, Bool, Float, Int, State
from .ends import clearance
from .solve import Field, Posed, Solved, classified, end_finder

_ULPS = 100  # a step that would end so close before the last time ends there


class Lane(eqx.Module):
    """How far a flight is, or flights, with a dimension for them in front.

    Attributes:
        fresh: whether nothing has been computed of it but its start.
        y: the state reached, (s,).
        tprev, tnext: time of it, and where the next attempt leads [s].
        inside: the state of the solver.
        control: that of the step size controller.
        left: smallest number of the ends there.
        result: as Diffrax's.
        accepted, rejected: steps.
        before, upto: start and end of the latest attempt [s].
        info: what interpolates it.
        states: at the settings' times that have passed, (T, s), or None.
        passed: how many have.
    """

    fresh: Bool[Array, "..."]
    y: Float[Array, "... s"]
    tprev: Float[Array, "..."]
    tnext: Float[Array, "..."]
    inside: Any
    control: Any
    left: Float[Array, "..."]
    result: diffrax.RESULTS
    accepted: Int[Array, "..."]
    rejected: Int[Array, "..."]
    before: Float[Array, "..."]
    upto: Float[Array, "..."]
    info: Any
    states: Float[Array, "... T s"] | None
    passed: Int[Array, "..."]


class Pilot(eqx.Module):
    """How one lane flies.

    Attributes:
        field: rate of the state, of time [s], state and arguments.
    """

    field: Field

    @property
    def _term(self) -> Any:
        return diffrax.ODETerm(self.field)  # type: ignore

    def _step(self, posed: Posed, args, tprev, tnext, y, inside):
        solver = dataclasses.replace(posed.settings.solver, scan_kind="lax")
        return solver.step(self._term, tprev, tnext, y, args, inside, False)

    def start(self, posed: Posed, args) -> Lane:
        """A lane at the start of a flight."""
        settings, t0, y = posed.settings, posed.t0, posed.state
        order = settings.solver.error_order(self._term)
        tnext, control = posed.controller.init(
            self._term, t0, posed.t1, y, None, None, lambda *_: None, order
        )
        shapes = eqx.filter_eval_shape(
            lambda: self._step(
                posed,
                args,
                t0,
                tnext,
                y,
                settings.solver.init(self._term, t0, tnext, y, args),
            )
        )
        info, inside = jax.tree.map(
            lambda x: jnp.zeros(x.shape, x.dtype) if hasattr(x, "shape") else jnp.asarray(x),
            (shapes[2], shapes[3]),
        )
        times, ends = settings.times, settings.ends
        none = jnp.zeros((), jnp.int32)
        return Lane(
            fresh=jnp.asarray(True),
            y=y,
            tprev=t0,
            tnext=jnp.minimum(tnext, posed.t1),
            inside=inside,
            control=jax.tree.map(jnp.asarray, control),
            left=jnp.min(clearance(ends, t0, y)) if ends else jnp.ones_like(t0),
            result=diffrax.RESULTS.successful,
            accepted=none,
            rejected=none,
            before=t0,
            upto=t0,
            info=info,
            states=None if times is None else jnp.zeros((*times.shape, *y.shape), y.dtype),
            passed=none,
        )

    def advance(self, posed: Posed, args, lane: Lane) -> Lane:
        """One attempt of a step.

        A solver whose last stage is the next step's first computes that anew at a start, and
        all lanes would wait for it. So a flight begins with a step of no length, of which
        that stage alone is kept.
        """
        settings, ends, t1 = posed.settings, posed.settings.ends, posed.t1
        upto = jnp.where(lane.fresh, lane.tprev, lane.tnext)
        attempt: Any = self._step(posed, args, lane.tprev, upto, lane.y, lane.inside)
        y1, error, info, inside, _ = attempt
        error = jnp.where(jnp.isnan(error), jnp.inf, error)
        order: Any = settings.solver.error_order(self._term)
        keep, tprev, tnext, _, control, failed = posed.controller.adapt_step_size(
            lane.tprev, upto, lane.y, y1, args, error, order, lane.control
        )
        tprev = jnp.minimum(tprev, t1)
        clipped = jnp.where(keep, t1, tprev + 0.5 * (t1 - tprev))
        tnext = jnp.where(tnext > t1 - _ULPS * jnp.spacing(t1), clipped, tnext)
        y = jnp.where(keep, y1, lane.y)
        result = diffrax.RESULTS.where(diffrax.is_okay(lane.result), failed, lane.result)
        left = lane.left
        if ends:
            left = jnp.min(clearance(ends, tprev, y))
            ended = (jnp.sign(lane.left) > 0) & (jnp.sign(left) <= 0)
            result = diffrax.RESULTS.where(ended, diffrax.RESULTS.event_occurred, result)
        first = lane.fresh
        stepped = Lane(
            fresh=jnp.zeros_like(first),
            y=y,
            tprev=tprev,
            tnext=tnext,
            inside=jax.tree.map(
                lambda new, old: jnp.where(keep, new, old), inside, lane.inside
            ),
            control=control,
            left=left,
            result=result,
            accepted=lane.accepted + keep,
            rejected=lane.rejected + ~keep,
            before=lane.tprev,
            upto=upto,
            info=info,
            states=lane.states,
            passed=lane.passed,
        )
        begun = dataclasses.replace(
            lane, fresh=stepped.fresh, inside=inside, before=lane.tprev, upto=upto, info=info
        )
        return jax.tree.map(lambda old, new: jnp.where(first, old, new), begun, stepped)

    def due(self, posed: Posed, lane: Lane) -> Bool[Array, ""]:
        """Whether the latest step has passed a time at which the state is to be kept."""
        kept = (lane.upto > lane.before) & (lane.tprev == lane.upto)
        times = self._times(posed)
        nearest = times[jnp.minimum(lane.passed, len(times) - 1)]
        return kept & (lane.passed < len(times)) & (nearest <= lane.upto)

    def state_due(self, posed: Posed, lane: Lane) -> State:
        """The state at that time."""
        times = self._times(posed)
        return self._path(posed, lane).evaluate(times[jnp.minimum(lane.passed, len(times) - 1)])

    def _times(self, posed: Posed) -> Array:
        return jnp.clip(posed.settings.times, posed.t0, posed.t1)

    def _path(self, posed: Posed, lane: Lane) -> diffrax.AbstractLocalInterpolation:
        """What interpolates the latest step."""
        kind = posed.settings.solver.interpolation_cls
        return kind(t0=lane.before, t1=lane.upto, **lane.info)

    def over(self, posed: Posed, lane: Lane) -> Bool[Array, ""]:
        """Whether a flight has ended."""
        steps = lane.accepted + lane.rejected
        return (
            ~diffrax.is_successful(lane.result)
            | (lane.tprev >= posed.t1)
            | (steps >= posed.settings.max_steps)
        )

    def finish(self, posed: Posed, lane: Lane) -> Solved:
        """What comes of a flight that is over."""
        ends = posed.settings.ends
        ended = lane.result == diffrax.RESULTS.event_occurred
        time, state = lane.tprev, lane.y
        if ends:
            path = self._path(posed, lane)

            def left(t, _):
                nearest = jnp.min(clearance(ends, t, path.evaluate(t)))
                return jnp.where(ended, nearest, lane.upto - t)

            found = optx.root_find(
                left,
                end_finder(state.dtype),
                lane.upto,
                options={"lower": lane.before, "upper": lane.upto},
                throw=False,
            )
            time = jnp.where(ended, found.value, time)
            state = jnp.where(ended, path.evaluate(found.value), state)
            ended &= found.result == optx.RESULTS.successful
        return classified(
            posed,
            time=time,
            state=state,
            ended=ended,
            failed=lane.result == diffrax.RESULTS.dt_min_reached,
            unfinished=diffrax.is_successful(lane.result) & (lane.tprev < posed.t1),
            control=lane.control,
            accepted=lane.accepted,
            rejected=lane.rejected,
            states=lane.states,
        )
