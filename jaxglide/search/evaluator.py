"""Values and gradients of a problem at many points, on all devices."""

from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_range, warn_float32
from .._lib.defaults import MAX_STEPS
from .._lib.fingerprint import fingerprint
from .._lib.types import Array, Float
from ..ensemble.batch import Fleet, default_width, fly_all, on_workers, shared, workers
from ..ensemble.study import nodes_of
from ..flight.glide import PILOT, landed, ready
from ..flight.pool import Program, Task
from .objective import Trial
from .problem import Asked, Evaluation, Given, Problem, judged, trial_at, values_at
from .steady import SteadyJudge

_LANES = 16  # points per core in one batch


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
def _batch(asked: Asked, given: Given, points: Float[Array, "S n"], gradients: bool):
    """Values (S, 1 + m) and gradients (S, 1 + m, n), or none (S, 1, 0), of points."""

    def one(x):
        def twice(x):
            values = values_at(asked, given, x)
            return values, values

        if gradients:
            return jax.jacfwd(twice, has_aux=True)(x)[::-1]
        return twice(x)[0], x[None, :0]

    return jax.vmap(one)(points)


@lru_cache(maxsize=16)
def _judge(asked: Asked, structure, leaves, block: int) -> Program:
    """Program that flies points, and keeps what is asked."""
    static = jax.tree.unflatten(structure, leaves)

    def prepare(x, arrays) -> Task:
        trial = trial_at(asked, eqx.combine(arrays, static), x)
        return ready(trial.glider, trial.launch, max_steps=MAX_STEPS, **trial.options)

    def conclude(task: Task, solved):
        return judged(asked, Trial.of(landed(task, solved)))

    return Program(PILOT, prepare, conclude, block)


class Evaluator:
    """Values, with gradients or without, of many points of a problem on all devices.

    Args:
        problem: the problem.
        gradients: whether to compute gradients too, in forward mode.

    Steady glides that are asked for are searched first, from the five starts that
    `steady_glide` tries first, and of those that are found the most stable is judged.
    """

    def __init__(self, problem: Problem, gradients: bool = True):
        if not isinstance(problem, Problem):
            raise TypeError(f"problem = {problem!r} is not a Problem")
        self.told = warn_float32(problem.rtol, problem.atol)
        self.problem, self.gradients, self.width = problem, gradients, 0
        asks = _asks(problem.asked, problem.given())
        self._flies = gradients or _Flight in asks
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
        asked, given = problem.asked, problem.given(rtol, atol)
        if self._steady is not None:
            return self._steady(points, given)
        if not self.gradients and self._flies:
            return self._flown(points, given)
        if not self.width:  # kept, so that fewer points later compile nothing
            threads = len(workers())
            batches = -(-len(points) // (_LANES * threads)) * threads
            self.width = -(-len(points) // batches)

        def evaluate(k: int):
            index = np.minimum(np.arange(k, k + self.width), len(points) - 1)
            batch = jnp.asarray(points[index])
            return tuple(map(np.asarray, _batch(asked, given, batch, self.gradients)))

        found = on_workers(evaluate, range(0, len(points), self.width))
        values, gradients = (np.concatenate(part) for part in zip(*found, strict=True))
        return Evaluation(values[: len(points)], gradients[: len(points)])

    def _flown(self, points: np.ndarray, given: Given) -> Evaluation:
        """Values alone: a lane takes up the next point as soon as its own has landed."""
        arrays, key = shared(given)
        width = default_width(len(points), lambda: nodes_of(self.problem.base))
        self.width = self.width or width  # kept, so that fewer points later compile nothing
        fleet = Fleet.of(self.width)
        program = _judge(self.problem.asked, *key, fleet.block)
        values = fly_all(program, points, fleet, (arrays,))
        return Evaluation(values, np.zeros((*values.shape, 0)))
