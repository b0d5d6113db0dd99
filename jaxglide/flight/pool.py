"""Many flights in a few lanes: a lane takes up the next flight as soon as its own has ended.

One step of all lanes is one attempt of Diffrax's solver and of its step size controller, as
in `solve`. The lanes step until one of them has ended; what has ended is noted, and the next
flights start. No lane's numbers depend on those of another.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.dependence import depends
from .._lib.types import Array, Bool, Int, Integer
from .lane import Lane, Pilot
from .solve import Posed


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

    _static: Any  # of a task: what is no array, once one has been traced

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
        if lane.states is not None:  # only ever read as far as they were written
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
