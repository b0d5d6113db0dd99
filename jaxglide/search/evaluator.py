"""Values and gradients of a problem at many points, on all devices."""

from collections.abc import Callable
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_range, warn_float32
from .._lib.defaults import MAX_STEPS
from .._lib.fingerprint import fingerprint
from .._lib.types import Array, Float
from ..ensemble.batch import Fleet, default_width, fly_all, on_workers, shared
from ..ensemble.study import nodes_of
from ..flight.glide import PILOT, landed, ready
from ..flight.pool import Program, Task
from ..flight.solve import Solved
from ..flight.tangents import dual_program
from .objective import Trial
from .problem import Asked, Evaluation, Given, Problem, judged, trial_at, values_at
from .steady import SteadyJudge

_LANES = 8  # points of a batch, whatever their number: one program serves all
# Parameters a value from which on reverse mode costs less: 6.5 glides against 1.2 and 0.63 for
# each of them.
_MANY = 8


class _Flight(Exception):
    """That an objective asks for the flight."""


class _Steady(Exception):
    """That it asks for the steady glide."""


class _Grounded(Trial):
    @property
    def glide(self):
        raise _Flight

    @property
    def steady(self):
        raise _Steady


def _asks(asked: Asked, given: Given) -> set[type[Exception]]:
    """What the objective and the constraints ask for first; one's own may do without both."""
    x, found = jnp.zeros(len(asked.free)), set()
    for one in (asked.objective, *(constraint.objective for constraint in asked.constraints)):
        try:
            jax.eval_shape(
                lambda x, one=one: one.value(trial_at(asked, given, x, _Grounded)), x
            )
        except (_Flight, _Steady) as wanted:
            found.add(type(wanted))
    return found


@eqx.filter_jit
def _batch(asked: Asked, given: Given, points: Float[Array, "S n"], mode: Callable | None):
    """Values (S, 1 + m) and gradients (S, 1 + m, n), or none (S, 1, 0), of points."""

    def one(x):
        def twice(x):
            values = values_at(asked, given, x)
            return values, values

        if mode is None:
            return twice(x)[0], x[None, :0]
        return mode(twice, has_aux=True)(x)[::-1]

    return jax.vmap(one)(points)


@lru_cache(maxsize=16)
def _judge(asked: Asked, structure, leaves, block: int, gradients: bool) -> Program:
    """Program that flies points, and keeps what is asked, with its gradients or with how many
    steps it took."""
    static = jax.tree.unflatten(structure, leaves)

    def prepare(x, arrays) -> Task:
        trial = trial_at(asked, eqx.combine(arrays, static), x)
        return ready(trial.glider, trial.launch, max_steps=MAX_STEPS, **trial.options)

    def conclude(task: Task, solved: Solved):
        values = judged(asked, Trial.of(landed(task, solved)))
        return values if gradients else (values, solved.accepted + solved.rejected)

    return (dual_program if gradients else Program)(PILOT, prepare, conclude, block)


class Evaluator:
    """Values, with gradients or without, of many points of a problem on all devices.

    Args:
        problem: the problem.
        gradients: whether to compute gradients too, in the mode that costs less.

    Steady glides that are asked for are searched first, from the five starts that
    `steady_glide` tries first, and of those that are found the most stable is judged.
    """

    def __init__(self, problem: Problem, gradients: bool = True):
        if not isinstance(problem, Problem):
            raise TypeError(f"problem = {problem!r} is not a Problem")
        self.told = warn_float32(problem.rtol, problem.atol)
        self.problem, self.gradients, self.width = problem, gradients, 0
        asks = _asks(problem.asked, problem.given())
        self._flies = _Flight in asks
        many = len(problem.names) > _MANY * (1 + len(problem.constraints))
        self._backwards = gradients and many
        self._steady = SteadyJudge(problem, gradients) if _Steady in asks else None

    def fingerprint(self) -> str:
        """A digest of all that is computed, down to the code of the user's own objective."""
        arrays, rest = eqx.partition(self.problem.given(), eqx.is_array)
        asked = self.problem.asked

        def values(arrays, x):
            return values_at(asked, eqx.combine(arrays, rest), x)

        return fingerprint(values, arrays, self.problem.low)

    def __call__(self, points: np.ndarray, rtol=None, atol=None) -> Evaluation:
        """Evaluate points (S, n) in batches; tolerances default to the problem's.

        Raises:
            ValueError: points of another shape, out of a parameter's range or not finite.
        """
        problem, n = self.problem, len(self.problem.names)
        points = np.asarray(points, float)
        if points.ndim != 2 or points.shape[1] != n or not len(points):
            raise ValueError(f"points of shape {points.shape} are not (S, {n}) or are none")
        problem.base.check(dict(zip(problem.names, points.T, strict=True)))
        rtol = problem.rtol if rtol is None else rtol
        atol = problem.atol if atol is None else atol
        for name, value in (("rtol", rtol), ("atol", atol)):
            check_range(name, value, "", 0, 0.1, low_open=True, shape=())
        self.told = self.told or warn_float32(rtol, atol)
        given = problem.given(rtol, atol)
        if self._steady is not None:
            return self._steady(points, given)
        if not self._flies:
            mode = jax.jacfwd if self.gradients else None
            return self._batched(points, given, np.arange(len(points)), mode)
        if self.gradients and not self._backwards:
            values, rates = self._flown(points, given, gradients=True)
            return Evaluation(values, np.moveaxis(rates, 1, 2))
        values, steps = self._flown(points, given, gradients=False)
        if not self.gradients:
            return Evaluation(values, np.zeros((*values.shape, 0)))
        # equally long flights side by side: hardly any waits for another
        found = self._batched(points, given, np.argsort(steps, kind="stable"), jax.jacrev)
        return Evaluation(values, found.gradients)

    def _flown(self, points, given: Given, gradients: bool) -> tuple[np.ndarray, np.ndarray]:
        """What `_judge` keeps; a lane takes up the next point as soon as its own has landed."""
        arrays, key = shared(given)
        nodes, size = lambda: nodes_of(self.problem.base), 1 + gradients * points.shape[1]
        width = default_width(len(points), nodes, size=size)
        self.width = self.width or width  # kept, so that fewer points later compile nothing
        fleet = Fleet.of(self.width)
        program = _judge(self.problem.asked, *key, fleet.block, gradients)
        return fly_all(program, points, fleet, (arrays,))

    def _batched(self, points, given: Given, order, mode: Callable | None) -> Evaluation:
        """Points in this order, a batch of them a core, with gradients by `mode`."""

        def evaluate(k: int):
            batch = jnp.asarray(points[np.resize(order[k : k + _LANES], _LANES)])
            return tuple(map(np.asarray, _batch(self.problem.asked, given, batch, mode)))

        found = on_workers(evaluate, range(0, len(points), _LANES))
        back = np.argsort(order)
        return Evaluation(*(np.concatenate(part)[back] for part in zip(*found, strict=True)))
