"""Problems that ask for steady glides: found first, in lanes that do not wait, then judged.

Derivatives do not pass through the search. They are those of the fixed point.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from ..ensemble.batch import shared, spread, workers
from ..ensemble.seeker import LANES, Seeker
from ..ensemble.steady import kinds
from ..steady.closure import Kind
from ..steady.glide import STEP, at_root, sought
from .problem import Asked, Evaluation, Given, Problem, judged, trial_at


@lru_cache(maxsize=16)
def _judge(asked: Asked, structure, leaves, kind: Kind, gradients: bool, devices) -> Callable:
    """Function of points whose steady glides are known; see `spread`."""
    static = jax.tree.unflatten(structure, leaves)

    def one(lane, arrays):
        given: Given = eqx.combine(arrays, static)

        def twice(x):
            trial = trial_at(asked, given, x)
            trial.known = partial(at_root, u=lane["u"], kind=kind, step=STEP)
            values = judged(asked, trial)
            return values, values

        if gradients:
            slopes, values = jax.jacfwd(twice, has_aux=True)(lane["x"])
            return {"values": values, "gradients": slopes}
        return {"values": twice(lane["x"])[0], "gradients": lane["x"][None, :0]}

    return spread(one, devices, 1)


class Roots(NamedTuple):
    """Where the searches of some points have come to.

    Attributes:
        u: scaled reduced states, NaN where nothing is found, (S, 8).
        coarse, full: derivatives of the map that each took, with a quarter of the solver's
            steps and with all of them, (S,).
    """

    u: np.ndarray
    coarse: np.ndarray
    full: np.ndarray


class SteadyJudge:
    """Values and gradients of a problem that asks for steady glides.

    Of several that the searches from the starts of `Seeker` find, the most stable is judged.

    Args:
        problem: the problem.
        gradients: whether to compute gradients too.
    """

    def __init__(self, problem: Problem, gradients: bool):
        sought(problem.base.glider, 0.0, STEP)  # which checks it
        varied = {problem.base.path(name): np.array([1.0]) for name in problem.names}
        (self._kind,) = kinds(problem.base, varied, 1)
        self._seeker = Seeker(problem.base, self._kind, STEP)
        self._problem, self._gradients = problem, gradients

    def roots(self, points: np.ndarray, guesses: np.ndarray | None = None) -> Roots:
        """Search for steady glides.

        Args:
            points: (S, n).
            guesses: scaled reduced states from which alone to search, as long as that finds
                one; NaN for none, (S, 8).
        """
        found = Roots(np.full((len(points), 8), np.nan), *np.zeros((2, len(points))))
        if guesses is not None:
            some = np.flatnonzero(np.isfinite(guesses).all(axis=1))
            self._search(points, some, lambda places: guesses[places, None], found)
        rest = np.flatnonzero(~np.isfinite(found.u).all(axis=1))
        if len(rest):
            starts = self._seeker.starts(self._values(points[rest]), 0)
            self._search(
                points, rest, lambda places: starts[np.searchsorted(rest, places)], found
            )
        return found

    def _values(self, points: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(self._problem.names, points.T, strict=True))

    def _search(self, points, some, starts, found: Roots) -> None:
        if not len(some):
            return
        values = self._values(points[some])
        for place, end in self._seeker.search(values, lambda places: starts(some[places])):
            k = some[place]
            if len(end.roots):
                found.u[k] = end.roots[0]
            found.coarse[k] += end.coarse
            found.full[k] += end.full

    def judge(self, points: np.ndarray, roots: np.ndarray, given: Given) -> Evaluation:
        """Evaluate points (S, n) whose steady glides are known, (S, 8)."""
        devices = workers()
        arrays, key = shared(given)
        judge = _judge(self._problem.asked, *key, self._kind, self._gradients, devices)
        width = LANES * len(devices)
        columns = {"x": points, "u": roots}
        parts = [
            judge({name: x[k : k + width] for name, x in columns.items()}, width, arrays)
            for k in range(0, len(points), width)
        ]
        fields = Evaluation._fields
        return Evaluation(*(np.concatenate([p[name] for p in parts]) for name in fields))

    def __call__(self, points: np.ndarray, given: Given) -> Evaluation:
        """Evaluate points (S, n)."""
        return self.judge(points, self.roots(points).u, given)
