"""A flight and its derivatives by a few numbers, side by side, as a lane of a pool flies them.

What a flight is made of goes through the pool with its rates: a step is an attempt at the
flight's, and moves the rates along. The step sizes are the flight's own and do not vary. So a
lane that has landed has its gradient too, and takes up the next flight.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero

from .lane import Pilot
from .pool import Program, Task


class Dual(eqx.Module):
    """A tree, and how its floats change with each of n numbers.

    Attributes:
        value: the tree.
        rates: of its floats, (n, ...), None where nothing changes.
    """

    value: Any
    rates: Any

    @property
    def states(self) -> None:
        """None are kept on the way."""


def pushed(function: Callable, *given: Dual) -> Dual:
    """A pure function's value and its rates."""
    rates, structure = jax.tree.flatten([d.rates for d in given], is_leaf=_is_none)
    values = structure.flatten_up_to([d.value for d in given])
    moved = [k for k, rate in enumerate(rates) if rate is not None]
    rest, kept = [], []

    def floats(*some):
        row = list(values)
        for k, x in zip(moved, some, strict=True):
            row[k] = x
        found, other = eqx.partition(function(*structure.unflatten(row)), eqx.is_inexact_array)
        arrays, static = eqx.partition(other, eqx.is_array)
        leaves, shape = jax.tree.flatten(found)
        kept[:] = [shape, static]
        return _noticed(leaves, rest), arrays

    def along(rates):
        return jax.jvp(floats, [values[k] for k in moved], rates, has_aux=True)

    by_number = jax.vmap(along, out_axes=(None, 0, None))
    leaves, slopes, arrays = by_number([rates[k] for k in moved])
    slopes = [slope if moves else None for slope, moves in zip(slopes, rest, strict=True)]
    shape, static = kept
    return Dual(eqx.combine(shape.unflatten(leaves), arrays, static), shape.unflatten(slopes))


def _is_none(x) -> bool:
    return x is None


def _noticed(leaves: list, moves: list) -> list:
    """The same leaves; whether each has a tangent is noted in `moves` as it is traced."""
    moves[:] = [False] * len(leaves)  # JAX asks no rule where nothing moves at all

    @jax.custom_jvp
    def same(leaves):
        return leaves

    @partial(same.defjvp, symbolic_zeros=True)
    def _(primals, tangents):
        moves[:] = [not isinstance(tangent, SymbolicZero) for tangent in tangents[0]]
        pairs = zip(primals[0], tangents[0], moves, strict=True)
        return primals[0], [t if moved else jnp.zeros_like(x) for x, t, moved in pairs]

    return same(leaves)


def _filled(dual: Dual, like: Any) -> Dual:
    """With zeros for the rates that `like` has beyond its own."""

    def fill(rate, other):
        if rate is None and other is not None:
            return jnp.zeros(other.shape, other.dtype)
        return rate

    return Dual(dual.value, jax.tree.map(fill, dual.rates, like, is_leaf=_is_none))


class DualPilot(eqx.Module):
    """How a lane flies a flight with its rates; all that it is given and gives is dual."""

    pilot: Pilot

    def start(self, posed: Dual, args: Dual) -> Dual:
        """A lane at the start, with rates for all that moves on the way."""
        lane = pushed(self.pilot.start, posed, args)
        while True:
            after = eqx.filter_eval_shape(pushed, self.pilot.advance, posed, args, lane)
            moving = jax.tree.map(
                lambda rate, new: new if rate is None else rate,
                lane.rates,
                after.rates,
                is_leaf=_is_none,
            )
            if jax.tree.structure(moving) == jax.tree.structure(lane.rates):
                return lane
            lane = _filled(lane, moving)

    def advance(self, posed: Dual, args: Dual, lane: Dual) -> Dual:
        return _filled(pushed(self.pilot.advance, posed, args, lane), lane.rates)

    def over(self, posed: Dual, lane: Dual):
        return self.pilot.over(posed.value, lane.value)

    def finish(self, posed: Dual, lane: Dual) -> Dual:
        return pushed(self.pilot.finish, posed, lane)


def dual_program(pilot: Pilot, prepare: Callable, conclude: Callable, block: int) -> Program:
    """A pool's program as `Program` makes it, of cases that are vectors of numbers, (n,), and
    of results that are floats. It gives their derivatives too, (n, ...), behind them."""

    def prepare_dual(x, *shared) -> Task:
        def parts(x):
            task = prepare(x, *shared)
            return task.posed, task.args, task.kept

        found = pushed(parts, Dual(x, jnp.eye(x.size, dtype=x.dtype)))
        dual: Any = map(Dual, found.value, found.rates)
        return Task(*dual)

    def conclude_dual(task: Any, solved: Dual):
        def end(posed, kept, solved):
            return conclude(Task(posed, None, kept), solved)

        found = pushed(end, task.posed, task.kept, solved)
        count = jax.tree.leaves(solved.rates)[0].shape[0]
        still = jax.eval_shape(lambda x: jnp.zeros((count, *x.shape), x.dtype), found.value)
        return found.value, _filled(found, still).rates

    dual_pilot: Any = DualPilot(pilot)
    return Program(dual_pilot, prepare_dual, conclude_dual, block)
