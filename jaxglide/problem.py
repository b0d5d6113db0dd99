"""A problem of optimisation, and its values and gradients at many points (floor 5)."""

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ._checks import check_range
from .cases import build, check_parameters, check_setup
from .objectives import Constraint, Objective, Trial
from .parameters import GRADIENT_SETUP as SETUP
from .parameters import OBSERVED

_LANES = 16  # points per core in one batch


class Evaluation(NamedTuple):
    """Values at S points: the objective and m slacks, and their gradients.

    Attributes:
        values: (S, 1 + m).
        gradients: by the n parameters in their units, (S, 1 + m, n).
    """

    values: np.ndarray
    gradients: np.ndarray

    @property
    def slacks(self) -> np.ndarray:
        """Slacks of the constraints, (S, m)."""
        return self.values[:, 1:]

    @property
    def finite(self) -> np.ndarray:
        """Where every value and gradient is finite, (S,)."""
        ordinary = np.isfinite(self.values).all(axis=1)
        return np.logical_and(ordinary, np.isfinite(self.gradients).all(axis=(1, 2)))


@dataclass(frozen=True)
class Problem:
    """What to make as large as possible, by changing what, within which limits.

    Args:
        objective: what to maximise (see `Objective.wanted`).
        free: bounds by name of `PARAMETERS`, in its unit; a sequence of names takes the
            ranges observed in flight.
        constraints: inequalities to meet.
        fixed: values of other parameters.
        setup: "polar", "node_set", "nodes"; smooth polar, Gauss nodes where not given.
        rtol, atol: tolerances of the glides.
        max_time: longest flight [s].

    Raises:
        ValueError: an unknown name, bounds out of range or without room between them.
    """

    objective: Objective
    free: Any
    constraints: tuple[Constraint, ...] = ()
    fixed: Mapping[str, float] | None = None
    setup: Mapping[str, Any] | None = None
    rtol: float = 1e-7
    atol: float = 1e-7
    max_time: float = 60.0

    def __post_init__(self):
        free = self.free
        if not isinstance(free, Mapping):
            for name in free:
                if name not in OBSERVED:
                    known = ", ".join(OBSERVED)
                    raise ValueError(f"give bounds of {name!r}: ranges observed are of {known}")
            free = {name: OBSERVED[name] for name in free}
        if not free:
            raise ValueError("no parameter is free")
        bounds = {name: tuple(map(float, ends)) for name, ends in free.items()}
        for name, ends in bounds.items():
            check_parameters({name: np.array(ends)})
            if len(ends) != 2 or not ends[0] < ends[1]:
                raise ValueError(f"bounds of {name} are {ends}, not lowest and highest")
        fixed = {name: float(value) for name, value in (self.fixed or {}).items()}
        check_parameters(fixed)
        for name in fixed:
            if name in bounds:
                raise ValueError(f"{name} is both free and fixed")
        for name in ("rtol", "atol"):
            check_range(name, getattr(self, name), "", 0, 0.1, low_open=True)
        check_range("max_time", self.max_time, "s", 0, 1e4, low_open=True)
        set_ = object.__setattr__
        set_(self, "free", bounds)
        set_(self, "fixed", fixed)
        set_(self, "constraints", tuple(self.constraints))
        set_(self, "setup", check_setup(SETUP | dict(self.setup or {})))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters, n of them."""
        return tuple(self.free)

    @property
    def low(self) -> np.ndarray:
        """Lowest values, (n,)."""
        return np.array([ends[0] for ends in self.free.values()])

    @property
    def high(self) -> np.ndarray:
        """Highest values, (n,)."""
        return np.array([ends[1] for ends in self.free.values()])

    def values(self, x, rtol=None, atol=None):
        """The objective and the slacks of the constraints at a point (n,), (1 + m,)."""
        assert self.fixed is not None
        assert self.setup is not None
        case = {**self.fixed, **dict(zip(self.names, x, strict=True))}
        trial = Trial(
            *build(case, self.setup),
            rtol=self.rtol if rtol is None else rtol,
            atol=self.atol if atol is None else atol,
            max_time=self.max_time,
        )
        slacks = [constraint.slack(trial) for constraint in self.constraints]
        return jnp.stack([self.objective.function(trial), *slacks])

    def describe(self) -> dict[str, Any]:
        """The problem in plain values."""
        assert self.fixed is not None
        assert self.setup is not None
        return {
            "objective": self.objective.name,
            "free": {name: list(ends) for name, ends in self.free.items()},
            "constraints": [f"{c} (scale {c.scale:g})" for c in self.constraints],
            "fixed": dict(self.fixed),
            "setup": dict(self.setup),
            "rtol": self.rtol,
            "atol": self.atol,
            "max_time": self.max_time,
        }


class Evaluator:
    """Values, with gradients or without, of many points of a problem on all devices.

    Args:
        problem: the problem.
        gradients: whether to compute gradients too (forward mode while there are fewer
            parameters than results of a glide, else reverse mode; see `simulate`).
    """

    def __init__(self, problem: Problem, gradients: bool = True):
        self.problem, self.width = problem, 0

        def one(x, rtol, atol):
            def twice(x):
                values = problem.values(x, rtol, atol)
                return values, values

            if gradients:
                return jax.jacfwd(twice, has_aux=True)(x)[::-1]
            return twice(x)[0], x[None, :0]

        self._batch = jax.jit(jax.vmap(one, in_axes=(0, None, None)))
        # Optimistix's implicit derivatives do not trace under shard_map (0.1.0), so that
        # threads share out the batches: over the cores of a CPU, or one a GPU.
        devices = jax.local_devices()
        on_cpu = devices[0].platform == "cpu"
        self._workers = devices[:1] * (os.cpu_count() or 1) if on_cpu else devices

    def __call__(self, points: np.ndarray, rtol=None, atol=None) -> Evaluation:
        """Evaluate points (S, n) in batches; tolerances default to the problem's."""
        problem, workers = self.problem, self._workers
        rtol = jnp.asarray(problem.rtol if rtol is None else rtol)
        atol = jnp.asarray(problem.atol if atol is None else atol)
        if not self.width:  # kept, so that fewer points later compile nothing
            batches = -(-len(points) // (_LANES * len(workers))) * len(workers)
            self.width = -(-len(points) // batches)

        def evaluate(k: int):
            index = np.minimum(np.arange(k, k + self.width), len(points) - 1)
            batch = jax.device_put(points[index], workers[k // self.width % len(workers)])
            return tuple(map(np.asarray, self._batch(batch, rtol, atol)))

        with ThreadPoolExecutor(len(workers)) as pool:
            found = list(pool.map(evaluate, range(0, len(points), self.width)))
        values, gradients = (np.concatenate(part) for part in zip(*found, strict=True))
        return Evaluation(values[: len(points)], gradients[: len(points)])
