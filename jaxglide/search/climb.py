"""One run of an optimisation, from its starts to the sampling at its end."""

import enum
from typing import Any

import numpy as np
import xarray as xr

from .._lib.progress import progress_bar
from .ascent import Ascent, Best, sobol
from .history import labelled, row
from .journal import Journal
from .polish import SAMPLES, sample_uphill, summits
from .problem import Evaluation, Problem

_RUNNING, _LOST = -1, -2


class Status(enum.IntEnum):
    """How one start ended; `str()` gives a sentence."""

    CONVERGED = 0
    STEPS = 1
    INFEASIBLE = 2
    NOT_FINITE = 3
    INTERRUPTED = 4

    def __str__(self) -> str:
        return _SENTENCES[self]


_SENTENCES = {
    Status.CONVERGED: "converged",
    Status.STEPS: "ran all steps",
    Status.INFEASIBLE: "found no point within the constraints",
    Status.NOT_FINITE: "met nothing but values that are not finite",
    Status.INTERRUPTED: "was interrupted",
}


class Search:
    """Starts that climb together, and what they have found.

    Args:
        problem: what to maximise.
        given: the options of `optimise` in plain values, checked.
        journal: of the evaluations.
        evaluator, screener: values of points with gradients and without.
        progress: show bars.
    """

    def __init__(
        self,
        problem: Problem,
        given: dict[str, Any],
        journal: Journal,
        evaluator,
        screener,
        progress: bool | None,
    ):
        self.problem, self.given, self.journal = problem, given, journal
        self.evaluator, self.screener, self.progress = evaluator, screener, progress
        self.starts = given["starts"]
        self.best = self._best(self.starts, given["tolerance"])
        self.status = np.full(self.starts, _RUNNING)
        self.record: list[dict[str, np.ndarray]] = []
        self.flown: list[tuple[int, int]] = []  # gradients and other glides of each step
        self.skipped = 0
        self.reason = f"ran all {given['steps']} steps"

    @property
    def evaluations(self) -> int:
        """Gradients computed."""
        return sum(gradients for gradients, _ in self.flown)

    def _best(self, count: int, tolerance: float) -> Best:
        return Best(count, len(self.problem.names), len(self.problem.constraints), tolerance)

    def _fly(self, points: np.ndarray, index: np.ndarray | None = None) -> Evaluation:
        """Values, and gradients at those of the starts `index`; from the log or anew."""
        starts = np.arange(len(points)) if index is None else index
        found = self.journal.recall(starts, points)
        kept = found is not None
        if found is None:
            found = (self.screener if index is None else self.evaluator)(points)
        found = self.problem.answer(found, len(points), gradients=index is not None)
        if not kept:
            self.journal.keep(starts, points, found)
        return found

    def begin(self, guessed: np.ndarray) -> np.ndarray:
        """Where to start: guesses (G, n), then a Sobol set or the best points of a larger
        one, (S, n)."""
        wanted, screen = self.starts - len(guessed), self.given["screen"]
        count = max(wanted, screen)
        points = sobol(self.problem, count, self.given["seed"]) if count else guessed
        if screen:
            best = self._best(len(points), 0.0)
            best.update(np.arange(len(points)), points, self._fly(points))
            points = points[best.order]
        return np.concatenate([guessed, points[:wanted]])

    def climb(self, ascent: Ascent) -> None:
        """Follow the gradients until every start has converged, or all steps are done.

        Raises:
            KeyboardInterrupt: before the first step is done; later it ends the climb.
        """
        steps = self.given["steps"]
        with progress_bar(steps, "step", self.progress) as bar:
            try:
                for _ in range(steps):
                    running = self._step(ascent)
                    lead = self.best.values[self.best.leader]
                    bar.set_postfix_str(f"best {lead:.5g}, {running} running")
                    bar.update()
                    if not running:
                        self.reason = "every start has converged"
                        break
            except KeyboardInterrupt:
                if not self.record:
                    raise
                self.status[self.status == _RUNNING] = Status.INTERRUPTED
                self.reason = f"interrupted after {len(self.record)} steps"

    def _step(self, ascent: Ascent) -> int:
        """Move every start that runs by one step; how many still run."""
        best, status = self.best, self.status
        index = np.flatnonzero(status == _RUNNING)
        points = ascent.points[index]
        found = self._fly(points, index)
        self.skipped += int((~found.finite).sum())
        best.update(index, points, found)
        slope = ascent.step(index, found)
        self.record.append(row(self.starts, index, points, found, slope))
        self.flown.append((len(index), 0))
        stuck = (status == _RUNNING) & (best.since >= self.given["patience"])
        best.since[stuck] = 0
        done = ascent.shrink(stuck, best.points) & (status == _RUNNING)
        status[done] = np.where(best.feasible, Status.CONVERGED, _LOST)[done]
        return int((status == _RUNNING).sum())

    def sample(self) -> None:
        """Sample uphill from the best starts, unless the climb was interrupted."""
        rounds, best = self.given["polish"], self.best
        if (self.status == Status.INTERRUPTED).any():
            return
        before, done = float(best.values[best.leader]), 0
        with progress_bar(rounds, "round", self.progress) as bar:

            def told(lead: int, point: np.ndarray, found: Evaluation) -> None:
                index, slope = np.array([lead]), np.array([np.nan])
                self.record.append(row(self.starts, index, point, found, slope))
                self.flown.append((0, SAMPLES))
                bar.set_postfix_str(f"best {best.values[best.leader]:.5g}")
                bar.update()

            try:
                for lead in summits(self.problem, best) if rounds else ():
                    left, seed = rounds - done, self.given["seed"]
                    done += sample_uphill(self.problem, best, lead, self._fly, left, seed, told)
            except KeyboardInterrupt:
                self.reason += "; interrupted while sampling around the best"
                return
        if done:
            gain = 100 * (float(best.values[best.leader]) - before) / max(abs(before), 1e-300)
            self.reason += f"; {done} rounds of sampling around the best gained {gain:.2g} %"

    def end(self) -> xr.Dataset:
        """Say how every start ended, and why; the history."""
        best = self.best
        running = (self.status == _RUNNING) | (self.status == _LOST)
        ended = np.where(best.feasible, Status.STEPS, Status.INFEASIBLE)
        ended = np.where(np.isfinite(best.violation), ended, Status.NOT_FINITE)
        self.status = np.where(running, ended, self.status)
        if not np.isfinite(best.violation).any():
            self.reason += "; no start met a finite value"
        elif not best.feasible[best.leader]:
            self.reason += "; no start met the constraints"
        settings = {**self.given, "reason": self.reason}
        meanings = {int(status): str(status) for status in Status}
        return labelled(
            self.problem, self.record, self.flown, best, self.status, meanings, settings
        )
