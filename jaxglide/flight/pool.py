"""Many flights in a few lanes: a lane takes up the next flight as soon as its own has ended.

One step of all lanes is one attempt of Diffrax's solver and of its step size controller, as
in `solve`. The lanes step until one of them has ended; what has ended is noted, and the next
flights start. No lane's numbers depend on those of another.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from .._lib.dependence import depends
from .._lib.types import Array, Bool, Float, Int, Integer, State
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

    def _step(self, posed: Posed, args, tprev, tnext, y, inside):
        solver = dataclasses.replace(posed.settings.solver, scan_kind="lax")
        term = diffrax.ODETerm(self.field)  # type: ignore
        return solver.step(term, tprev, tnext, y, args, inside, False)

    def start(self, posed: Posed, args) -> Lane:
        """A lane at the start of a flight."""
        settings, t0, y = posed.settings, posed.t0, posed.state
        order = settings.solver.error_order(diffrax.ODETerm(self.field))
        tnext, control = posed.controller.init(None, t0, posed.t1, y, None, None, None, order)
        shapes = eqx.filter_eval_shape(
            lambda: self._step(
                posed,
                args,
                t0,
                tnext,
                y,
                settings.solver.init(diffrax.ODETerm(self.field), t0, tnext, y, args),
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
        y1, error, info, inside, _ = self._step(
            posed, args, lane.tprev, upto, lane.y, lane.inside
        )
        error = jnp.where(jnp.isnan(error), jnp.inf, error)
        order = settings.solver.error_order(diffrax.ODETerm(self.field))
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


class Task(eqx.Module):
    """A flight, ready to be flown.

    Attributes:
        posed: what to integrate.
        args: what the field needs.
        kept: what else is needed at its end.
    """

    posed: Posed
    args: Any
    kept: Any


class Pool(eqx.Module):
    """What goes from one call of the program to the next.

    Attributes:
        case: number of the case in each lane, below 0 for none, (W,).
        lane: how far each is, (W, ...).
        args, rest: the arrays that each case has of its own, of a task's arguments and of the
            rest of it, lists of (W, ...), with None for what all share.
    """

    case: Int[Array, " W"]
    lane: Lane
    args: list
    rest: list

    @property
    def busy(self) -> Bool[Array, " W"]:
        """Which lanes have a case."""
        return self.case >= 0


class Turn(eqx.Module):
    """What one call of the program gives.

    Attributes:
        case, results: numbers of the cases that have ended, and what came of them: of all
            the room (K, ...) the first `found`.
        found: how many.
        steps: how often all lanes made a step.
        busy: how many steps of lanes that had a case.
    """

    case: Int[Array, " K"]
    results: Any
    found: Integer
    steps: Integer
    busy: Integer


class _Tasks:
    """Tasks of one program: which of their arrays are a case's own, and which all share.

    Shared ones stay single: a product with a matrix that all lanes share is one product.
    """

    def __init__(self, prepare: Callable, one, shared):
        def arrays(values):
            task = prepare(values, *shared)
            moving, self._static = eqx.partition(task, eqx.is_array)
            return moving.args, (moving.posed, moving.kept)

        self._arrays = arrays
        self._structure, self._own = depends(arrays, one)
        self._count = self._structure.children()[0].num_leaves
        found = zip(jax.tree.leaves(arrays(one)), self._own, strict=True)
        self._shared = [None if own else x for x, own in found]

    def own(self, values) -> tuple[list, list]:
        """Own arrays of a case, of its arguments and of the rest."""
        found = zip(jax.tree.leaves(self._arrays(values)), self._own, strict=True)
        leaves = [x if own else None for x, own in found]
        return leaves[: self._count], leaves[self._count :]

    def task(self, args: list | None, rest: list) -> Task:
        """The task of a case from its own arrays, or one without what its field needs."""
        own = [*([None] * self._count if args is None else args), *rest]
        pairs = zip(own, self._shared, strict=True)
        leaves = [shared if mine is None else mine for mine, shared in pairs]
        args_, (posed, kept) = jax.tree.unflatten(self._structure, leaves)
        return eqx.combine(Task(posed, args_, kept), self._static)


def _many(count: int, tree) -> Any:
    """Zeros for `count` of what a tree of arrays or shapes holds."""
    return jax.tree.map(lambda x: jnp.zeros((count, *x.shape), x.dtype), tree)


def _number(chosen) -> Integer:
    return jnp.sum(chosen, dtype=jnp.int32)


def _nth(chosen) -> Array:
    """Of each that is chosen, how many are before it."""
    return jnp.cumsum(chosen, dtype=jnp.int32) - 1


def _by_blocks(function, size: int, count, given, into):
    """A function of one, of the first `count` of many, `size` at a time."""

    def block(k, found):
        start = k * size
        part = jax.tree.map(lambda x: jax.lax.dynamic_slice_in_dim(x, start, size), given)
        return jax.tree.map(
            lambda all_, new: jax.lax.dynamic_update_slice_in_dim(all_, new, start, 0),
            found,
            jax.vmap(function)(part),
        )

    return jax.lax.fori_loop(0, -(-count // size), block, into)


class Program:
    """The compiled program of a pool.

    Args:
        pilot: how a lane flies.
        prepare: a task from the values of one case, a tree of arrays, and what all share.
        conclude: what is kept, a tree of arrays, from a task, without arguments, and from
            what came of it.
        block: how many are concluded at once.
    """

    def __init__(self, pilot: Pilot, prepare: Callable, conclude: Callable, block: int):
        self.pilot, self.prepare, self.conclude = pilot, prepare, conclude
        self.block = block
        self.empty = jax.jit(self._empty, static_argnames="lanes")
        # A program of its own: inside a loop XLA makes it three times as slow.
        self.prepared = jax.jit(self._prepared)
        self.turn = jax.jit(self._turn, donate_argnums=0)

    def _empty(self, one, *shared, lanes: int) -> Pool:
        """A pool of idle lanes, W of them; `one` are values of any case."""

        def idle(one, *shared):
            tasks = _Tasks(self.prepare, one, shared)
            own = tasks.own(one)
            return self._start(tasks, *own), *own

        shapes = eqx.filter_eval_shape(idle, one, *shared)
        return Pool(jnp.full(lanes, -1, jnp.int32), *_many(lanes, shapes))

    def _prepared(self, values, *shared) -> tuple[list, list]:
        """Own arrays of tasks, as `Pool` holds them, of values of any number of cases."""
        tasks = _Tasks(self.prepare, jax.tree.map(lambda x: x[0], values), shared)
        return jax.vmap(tasks.own)(values)

    def _turn(self, pool: Pool, cases, queue, one, count, last, *shared) -> tuple[Pool, Turn]:
        """Fly until no case is left to be taken up and a lane is idle.

        Args:
            pool: the lanes, W of them.
            cases, queue: numbers of cases, (Q,), and what `prepared` gave of them, (Q, ...).
            one: values of any case.
            count: how many of the queue are to be flown, the first ones.
            last: whether to go on until all lanes are idle.
            *shared: what all cases share.
        """
        tasks = _Tasks(self.prepare, one, shared)
        room = -(-(len(cases) + len(pool.case)) // self.block) * self.block

        def more(carry):
            pool, taken, *_ = carry
            return (taken < count) | (last & jnp.any(pool.busy))

        def body(carry):
            pool, taken, ended, turn = carry
            pool, taken = self._refill(tasks, pool, cases, queue, count, taken)
            pool, turn = self._fly(tasks, pool, turn)
            done = self._over(tasks, pool)
            place = jnp.where(done, turn.found + _nth(done), room)
            ended, case = jax.tree.map(
                lambda all_, new: all_.at[place].set(new, mode="drop"),
                (ended, turn.case),
                ((pool.lane, pool.rest), pool.case),
            )
            turn = dataclasses.replace(turn, case=case, found=turn.found + _number(done))
            pool = dataclasses.replace(pool, case=jnp.where(done, -1, pool.case))
            return pool, taken, ended, turn

        zero = jnp.zeros((), jnp.int32)
        ended = jax.tree.map(
            lambda x: jnp.zeros((room, *x.shape[1:]), x.dtype), (pool.lane, pool.rest)
        )
        turn = Turn(jnp.full(room, -1, jnp.int32), None, zero, zero, zero)
        carry = pool, zero, ended, turn
        pool, _, ended, turn = jax.lax.while_loop(more, body, carry)

        def concluded(flown):
            lane, rest = flown
            task = tasks.task(None, rest)
            return self.conclude(task, self.pilot.finish(task.posed, lane))

        shapes = jax.eval_shape(concluded, jax.tree.map(lambda x: x[0], ended))
        results = _by_blocks(concluded, self.block, turn.found, ended, _many(room, shapes))
        return pool, dataclasses.replace(turn, results=results)

    def _start(self, tasks: _Tasks, args, rest) -> Lane:
        task = tasks.task(args, rest)
        return self.pilot.start(task.posed, task.args)

    def _refill(self, tasks: _Tasks, pool: Pool, cases, queue, count, taken):
        """Idle lanes take up the next cases, as long as there are any."""
        idle = ~pool.busy
        place = taken + _nth(idle)
        chosen = idle & (place < count)
        place = jnp.minimum(place, len(cases) - 1)
        case, args, rest = jax.tree.map(lambda x: x[place], (cases, *queue))
        lane = jax.vmap(lambda *own: self._start(tasks, *own))(args, rest)
        # what is kept at times is only ever read as far as it was written
        lane = dataclasses.replace(lane, states=pool.lane.states)

        def choose(new, old):
            return jnp.where(chosen.reshape(-1, *[1] * (new.ndim - 1)), new, old)

        pool = jax.tree.map(choose, Pool(case, lane, args, rest), pool)
        return pool, taken + _number(chosen)

    def _fly(self, tasks: _Tasks, pool: Pool, turn: Turn) -> tuple[Pool, Turn]:
        """All lanes make steps until a case has ended."""

        def going(flown):
            pool, _ = flown
            return jnp.any(pool.busy) & ~jnp.any(self._over(tasks, pool))

        def step(flown):
            pool, turn = flown

            def advance(lane, args, rest):
                task = tasks.task(args, rest)
                return self.pilot.advance(task.posed, task.args, lane)

            lane = jax.vmap(advance)(pool.lane, pool.args, pool.rest)
            pool = dataclasses.replace(pool, lane=self._note(tasks, lane, pool.rest))
            busy = turn.busy + _number(pool.busy)
            return pool, dataclasses.replace(turn, steps=turn.steps + 1, busy=busy)

        return jax.lax.while_loop(going, step, (pool, turn))

    def _note(self, tasks: _Tasks, lane: Lane, rest: list) -> Lane:
        """Keep the states at the times that the latest step has passed."""
        if lane.states is None:
            return lane

        def due(lane):
            def one(lane, rest):
                return self.pilot.due(tasks.task(None, rest).posed, lane)

            return jax.vmap(one)(lane, rest)

        def note(lane):
            def one(lane, rest):
                return self.pilot.state_due(tasks.task(None, rest).posed, lane)

            here = due(lane)
            place = jnp.where(here, lane.passed, lane.states.shape[1])
            states = lane.states.at[jnp.arange(len(place)), place].set(
                jax.vmap(one)(lane, rest), mode="drop"
            )
            return dataclasses.replace(lane, states=states, passed=lane.passed + here)

        return jax.lax.while_loop(lambda lane: jnp.any(due(lane)), note, lane)

    def _over(self, tasks: _Tasks, pool: Pool) -> Bool[Array, " W"]:
        """Which lanes have a case that has ended."""

        def one(lane, rest):
            return self.pilot.over(tasks.task(None, rest).posed, lane)

        return pool.busy & jax.vmap(one)(pool.lane, pool.rest)
