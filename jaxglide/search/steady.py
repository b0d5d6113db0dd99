"""Problems that ask for steady glides: found first, in lanes that do not wait, then judged.

Derivatives do not pass through the search. They are those of the fixed point.
"""

from collections.abc import Callable
from functools import lru_cache, partial

import equinox as eqx
import jax
import numpy as np

from ..ensemble.batch import shared, spread, workers
from ..ensemble.seeker import LANES, Seeker
from ..ensemble.steady import kinds
from ..steady.closure import Kind
from ..steady.glide import STEP, at_root
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


class SteadyJudge:
    """Values and gradients of a problem that asks for steady glides.

    Of several that the searches from the starts of `Seeker` find, the most stable is judged.

    Args:
        problem: the problem.
        gradients: whether to compute gradients too.

    Attributes:
        coarse, full: derivatives of the map that the searches took so far, with a quarter of
            the solver's steps and with all of them.
    """

    def __init__(self, problem: Problem, gradients: bool):
        varied = {problem.base.path(name): np.array([1.0]) for name in problem.names}
        (self._kind,) = kinds(problem.base, varied, 1)
        self._seeker = Seeker(problem.base, self._kind, STEP)
        self._problem, self._gradients = problem, gradients
        self.coarse = self.full = 0

    def roots(self, points: np.ndarray) -> np.ndarray:
        """Scaled reduced states of steady glides at points (S, n); NaN where none, (S, 8)."""
        values = dict(zip(self._problem.names, points.T, strict=True))
        starts = self._seeker.starts(values, 0)
        roots = np.full((len(points), 8), np.nan)
        for place, found in self._seeker.search(values, lambda places: starts[places]):
            if len(found.roots):
                roots[place] = found.roots[0]
            self.coarse += found.coarse
            self.full += found.full
        return roots

    def __call__(self, points: np.ndarray, given: Given) -> Evaluation:
        """Evaluate points (S, n)."""
        devices = workers()
        arrays, key = shared(given)
        judge = _judge(self._problem.asked, *key, self._kind, self._gradients, devices)
        width = LANES * len(devices)
        columns = {"x": points, "u": self.roots(points)}
        parts = [
            judge({name: x[k : k + width] for name, x in columns.items()}, width, arrays)
            for k in range(0, len(points), width)
        ]
        values, slopes = (
            np.concatenate([p[name] for p in parts]) for name in Evaluation._fields
        )
        return Evaluation(values, slopes)
