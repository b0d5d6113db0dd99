"""Steady glides of many cases: searches that never wait for one another.

A loop of many lanes runs as long as its slowest. So searches go in rounds of a few iterations
of Newton's method: what has arrived, or is lost, leaves its lane to the next start after a
round. All starts of all cases stand in one queue. What has arrived with a quarter of the
solver's steps is solved with all of them afterwards.
"""

import dataclasses
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..flight.case import Case
from ..steady.closure import COARSE, COARSE_ENOUGH, NEAR, Kind, Reached, Sought, begun, newton
from ..steady.glide import carried, finished
from ..steady.result import Reason, SteadyGlide
from ..steady.starts import known_starts, sobol
from .batch import shared, spread, workers

ROUND = 5
"""Iterations of a round."""
MOST = 20
"""Iterations after which a search is given up."""
FINISH = 8
"""Most iterations with all of the solver's steps."""
LANES = 16
"""Of a worker; a multiple of 8, as in `batch`."""
APART = 1e-5
"""Scaled distance from which two steady glides are different."""

_NUMBERS = (
    "state",
    "residual",
    "speed",
    "glide_angle",
    "forward_speed",
    "sink_rate",
    "turn_rate",
    "spectral_radius",
)


def kept(glide: SteadyGlide) -> dict[str, Any]:
    """What is kept of a steady glide, by name, in SI units and radians."""
    parts = jnp.stack([jnp.real(glide.multipliers), jnp.imag(glide.multipliers)], axis=-1)
    return {name: getattr(glide, name) for name in _NUMBERS} | {"multipliers": parts}


class Found(NamedTuple):
    """What searches for the steady glides of one case have come to.

    Attributes:
        roots: scaled reduced states of those that are found, the most stable first, (K, 8).
        values: what is kept of them by name, each (K, ...).
        reason: `Reason.FOUND`, or why there is none.
        coarse, full: derivatives of the map that were taken with a quarter of the solver's
            steps, and with all of them.
    """

    roots: np.ndarray
    values: dict[str, np.ndarray]
    reason: int
    coarse: int
    full: int


class _Programs(NamedTuple):
    """Compiled functions of lanes; see `spread`."""

    starts: Callable
    round: Callable
    finish: Callable


@lru_cache(maxsize=16)
def _programs(structure, leaves: tuple, kind: Kind, devices: tuple) -> _Programs:
    static = jax.tree.unflatten(structure, leaves)

    def posed(values, arrays, step) -> Sought:
        glider = eqx.combine(arrays, static).replace(values).glider
        still = dataclasses.replace(glider, air=carried(glider.air))
        return Sought(still, jnp.zeros_like(step), step, kind)

    def starts(values, arrays, step):
        return {"u": known_starts(posed(values, arrays, step))}

    def one_round(lane, arrays, step):
        u, here = lane["u"], posed(lane["values"], arrays, step)
        near = COARSE_ENOUGH[u.dtype.itemsize]
        return newton(begun(u), here, COARSE, near, ROUND)._asdict()

    def finish(lane, arrays, step):
        u, here = lane["u"], posed(lane["values"], arrays, step)
        root: Reached = newton(begun(u), here, 1.0, NEAR[u.dtype.itemsize], FINISH)
        glide = finished(here.glider, here, root)
        found = kept(glide) | {"reason": glide.reason, "iterations": root.iterations}
        return found | {"u": glide.state / here.scales()}

    return _Programs(*(spread(one, devices, 2) for one in (starts, one_round, finish)))


class _Open:
    """A case that is searched: its values, and what has come of its starts so far."""

    def __init__(self, place: int, starts: int):
        self.place, self.searches = place, starts
        self.coarse = self.full = 0
        self.roots: list[np.ndarray] = []
        self.ends: list[dict[str, np.ndarray]] = []

    def arrived(self, root: np.ndarray) -> None:
        if _new(root, self.roots, 10 * APART):
            self.roots.append(root)

    def found(self) -> Found:
        """What is found in the end: different ones, the most stable first."""
        right = [end for end in self.ends if end["reason"] == Reason.FOUND]
        right.sort(key=lambda end: float(end["spectral_radius"]))
        distinct: list[dict[str, np.ndarray]] = []
        for end in right:
            if _new(end["u"], [other["u"] for other in distinct], APART):
                distinct.append(end)
        reasons = [int(end["reason"]) for end in self.ends] or [int(Reason.NOT_CONVERGED)]
        reason = int(Reason.FOUND) if distinct else max(reasons)
        roots = np.array([end["u"] for end in distinct]).reshape(-1, 8)
        names = (*_NUMBERS, "multipliers") if distinct else ()
        values = {name: np.stack([end[name] for end in distinct]) for name in names}
        return Found(roots, values, reason, self.coarse, self.full)


def _new(root: np.ndarray, others: list[np.ndarray], apart: float) -> bool:
    return all(np.max(np.abs(root - other)) > apart for other in others)


class Seeker:
    """Searches for the steady glides of cases of one kind.

    Args:
        case: the base, every float of it an array.
        kind: which equation they fulfil.
        step: longest step of the solver [s].
    """

    def __init__(self, case: Case, kind: Kind, step: float):
        devices = workers()
        arrays, key = shared(case)
        self._shared = arrays, np.asarray(step, float)
        self.width = LANES * len(devices)
        self._programs = _programs(*key, kind, devices)

    def starts(self, values: Mapping[str, np.ndarray], more: int) -> np.ndarray:
        """Where searches start, a Sobol set of `more` points the last, (N, 5 + more, 8).

        Args:
            values: of the cases by name, each (N,).
            more: see there.
        """
        count = len(next(iter(values.values())))
        known = [
            self._programs.starts(
                _at(values, slice(k, k + self.width)), self.width, *self._shared
            )
            for k in range(0, count, self.width)
        ]
        drawn = np.broadcast_to(sobol(more), (count, more, 8))
        return np.concatenate([np.concatenate([each["u"] for each in known]), drawn], axis=1)

    def search(
        self,
        values: Mapping[str, np.ndarray],
        starts: Callable[[np.ndarray], np.ndarray],
    ) -> Iterator[tuple[int, Found]]:
        """Search from all starts of all cases.

        Args:
            values: of the cases by name, each (N,).
            starts: scaled reduced states, (n, S, 8), of the cases at places, (n,).

        Yields:
            The place of a case, and what has been found of it, as it comes: to the bit the
            same whatever the other cases.
        """
        waiting: list[tuple[_Open, np.ndarray]] = []
        for case in self._coarse(values, starts):
            if not case.roots:
                yield case.place, case.found()
            waiting += [(case, root) for root in case.roots]
            while len(waiting) >= self.width:
                batch, waiting = waiting[: self.width], waiting[self.width :]
                yield from self._finished(values, batch)
        if waiting:
            yield from self._finished(values, waiting)

    def _coarse(self, values, starts) -> Iterator[_Open]:
        """Cases, all of whose starts have come to an end with a quarter of the steps."""
        total, upto = len(next(iter(values.values()))), 0
        queue: deque[tuple[_Open, np.ndarray, int]] = deque()
        while queue or upto < total:
            while len(queue) < self.width and upto < total:
                places = np.arange(upto, min(upto + self.width, total))
                upto = int(places[-1]) + 1
                for place, own in zip(places, starts(places), strict=True):
                    case = _Open(int(place), len(own))
                    queue.extend((case, u, 0) for u in own)
            lanes = [queue.popleft() for _ in range(min(self.width, len(queue)))]
            ends = self._run(self._programs.round, values, [lane[:2] for lane in lanes])
            for (case, _, taken), end in reversed(list(zip(lanes, ends, strict=True))):
                taken += int(end["iterations"])
                lost = taken >= MOST or not np.isfinite(end["u"]).all()
                if not (end["converged"] or lost):
                    queue.appendleft((case, end["u"], taken))
                    continue
                case.coarse += taken
                case.searches -= 1
                if end["converged"]:
                    case.arrived(end["u"])
                if not case.searches:
                    yield case

    def _finished(self, values, batch) -> Iterator[tuple[int, Found]]:
        ends = self._run(self._programs.finish, values, batch)
        for (case, _), end in zip(batch, ends, strict=True):
            case.full += int(end["iterations"]) + 2  # and of `refined`, and of the multipliers
            case.ends.append(end)
            if len(case.ends) == len(case.roots):
                yield case.place, case.found()

    def _run(self, program, values, lanes) -> list[dict[str, np.ndarray]]:
        """Results of lanes, cases and where each is, one by one."""
        places = np.array([case.place for case, _ in lanes])
        columns = {"values": _at(values, places), "u": np.array([u for _, u in lanes])}
        found = program(columns, self.width, *self._shared)
        return [{name: x[k] for name, x in found.items()} for k in range(len(lanes))]


def _at(values: Mapping[str, np.ndarray], places) -> dict[str, np.ndarray]:
    return {name: value[places] for name, value in values.items()}
