"""Gradient-based optimisation of gaits and bodies, many starts at once (floor 5).

All starts advance together: one batch of glides with their gradients a step. See `problem`
for what is asked, `_ascent` for how the starts move.
"""

import enum
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import optax
import xarray as xr

from ._ascent import FEASIBLE, Ascent, Best, sobol
from ._checks import check_choice, check_integer, check_range
from ._journal import Journal
from ._polish import RADIUS, neighbours, sample_uphill, summits
from .parameters import PARAMETERS
from .problem import Evaluation, Evaluator, Problem
from .records import stamp
from .sweep import progress_bar

OPTIMISERS = ("adam", "lbfgs")
"""Optimisers by name; others of optax can be passed themselves."""


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


@dataclass(frozen=True)
class Optimum:
    """What an optimisation found.

    Attributes:
        problem: what was asked.
        best: free parameters at the best point of all starts, by name, in their units.
        value: of the objective there.
        slacks: how far inside each constraint it lies, in the constraint's scale, (m,).
        feasible: whether it meets the constraints.
        status: how each start ended, (S,).
        points, values: the best point of each start, (S, n), and its value, (S,).
        evaluations: gradients computed.
        skipped: of these, how many were not finite and not followed.
        reason: why it stopped, a sentence.
        history: Dataset over iteration, start and parameter.
    """

    problem: Problem
    best: dict[str, float]
    value: float
    slacks: np.ndarray
    feasible: bool
    status: np.ndarray
    points: np.ndarray
    values: np.ndarray
    evaluations: int
    skipped: int
    reason: str
    history: xr.Dataset

    def __str__(self) -> str:
        unit = self.problem.objective.unit
        lines = [f"{self.problem.objective.name} {self.value:.6g} {unit}".rstrip()]
        for name, value in self.best.items():
            low, high = self.problem.free[name]
            edge = (
                " (at its bound)"
                if min(value - low, high - value) < 1e-3 * (high - low)
                else ""
            )
            lines.append(f"  {name:12} {value:.6g} {PARAMETERS[name].unit}".rstrip() + edge)
        for constraint, slack in zip(self.problem.constraints, self.slacks, strict=True):
            kept = "met" if slack > 0.05 else "binding" if slack > -FEASIBLE else "violated"
            lines.append(f"  {constraint!s} is {kept}")
        lines.append(f"  {self.reason}")
        return "\n".join(lines)


def optimise(
    problem: Problem,
    *,
    starts: int = 64,
    guesses: Sequence[Mapping[str, float]] = (),
    screen: int = 0,
    steps: int = 100,
    polish: int = 20,
    optimiser: str | optax.GradientTransformation = "adam",
    rate: float = 0.1,
    patience: int | None = None,
    tolerance: float = 1e-3,
    seed: int = 0,
    log: str | Path | None = None,
    progress: bool | None = None,
    evaluator: Evaluator | None = None,
    screener: Evaluator | None = None,
) -> Optimum:
    """Maximise an objective from many starts at once.

    Args:
        problem: what to maximise.
        starts: number of starting points, a Sobol set within the bounds.
        guesses: points to start from before those, free parameters by name; they count
            among the starts.
        screen: where this is more than `starts`, so many points of the set are tried first,
            without gradients, and the best of them are the starts.
        steps: most iterations.
        polish: most rounds of 256 points sampled within 2 % of the ranges around the best
            one, which moves to the best of them; three rounds that gain less than a
            thousandth end it, and those left go to the second and third best starts.
        optimiser: "adam", "lbfgs", or an optax transformation (of the gradient of what is
            to become small; its updates are added).
        rate: Adam's first step, in u (the whole range of a parameter is pi).
        patience: steps without a relative gain of `tolerance` after which a start goes back
            to its best point and on from there with steps 0.4 times as long; when they are
            a hundredth of the first it has converged. By default 4, and 8 with constraints.
        tolerance: see there.
        seed: of the Sobol set.
        log: file of evaluations (JSON lines): killed and called again, it goes on there.
        progress: show a bar; by default where somebody can see it.
        evaluator, screener: an `Evaluator` of this problem with and one without gradients
            (for screening and polishing; by default `evaluator` if that is given), to use
            their compiled functions again.

    Returns:
        The best point of all starts. Ctrl-C returns the best so far.

    Raises:
        ValueError: a wrong argument, or the log of another optimisation.
    """
    check_integer("starts", starts, 1, 100_000)
    check_integer("screen", screen, 0, 10_000_000)
    check_integer("steps", steps, 1, 1_000_000)
    check_integer("polish", polish, 0, 1_000_000)
    patience = (8 if problem.constraints else 4) if patience is None else patience
    check_integer("patience", patience, 1, 1_000_000)
    check_range("rate", rate, "", 0, 10, low_open=True)
    check_range("tolerance", tolerance, "", 0, 1)
    if isinstance(optimiser, str):
        check_choice("optimiser", optimiser, OPTIMISERS)
    name = optimiser if isinstance(optimiser, str) else "given"
    given = {
        "starts": starts,
        "screen": screen,
        "steps": steps,
        "polish": polish,
        "optimiser": name,
        "rate": rate,
        "seed": seed,
    }
    given |= {"patience": patience, "tolerance": tolerance}
    guessed = _guessed(problem, guesses, starts)
    header = {"problem": problem.describe(), **given, "guesses": guessed.tolist()}
    if screener is None:
        screener = evaluator or Evaluator(problem, gradients=False)
    evaluator = Evaluator(problem) if evaluator is None else evaluator
    journal = Journal(log, header)

    def fly(points: np.ndarray, index=None) -> Evaluation:
        """Values, and gradients at those of the starts `index`; from the log or anew."""
        told = np.arange(len(points)) if index is None else index
        found = journal.recall(told)
        if found is None:
            found = (screener if index is None else evaluator)(points)
            journal.keep(told, found)
        return found

    points = _begin(problem, guessed, starts, screen, seed, fly)
    ascent = Ascent(problem, points, optimiser, rate)
    best = Best(starts, len(problem.names), len(problem.constraints), tolerance)
    status = np.full(starts, _RUNNING)
    record: list[dict[str, np.ndarray]] = []
    evaluations = skipped = 0
    reason = f"ran all {steps} steps"
    with progress_bar(steps, "step", progress) as bar:
        try:
            for _ in range(steps):
                index = np.flatnonzero(status == _RUNNING)
                points = ascent.points[index]
                found = fly(points, index)
                evaluations += len(index)
                skipped += int((~found.finite).sum())
                best.update(index, points, found)
                slope = ascent.step(index, found)
                record.append(_row(starts, index, points, found, slope))
                stuck = (status == _RUNNING) & (best.since >= patience)
                best.since[stuck] = 0
                done = ascent.shrink(stuck, best.points) & (status == _RUNNING)
                status[done] = np.where(best.feasible, Status.CONVERGED, _LOST)[done]
                running = int((status == _RUNNING).sum())
                bar.set_postfix_str(f"best {best.values[best.leader]:.5g}, {running} running")
                bar.update()
                if not running:
                    reason = "every start has converged"
                    break
        except KeyboardInterrupt:
            status[status == _RUNNING] = Status.INTERRUPTED
            reason = f"interrupted after {len(record)} steps"
    if polish and not (status == Status.INTERRUPTED).any():
        reason += _polished(problem, best, fly, polish, seed, progress)
    running = (status == _RUNNING) | (status == _LOST)
    ended = np.where(best.feasible, Status.STEPS, Status.INFEASIBLE)
    ended = np.where(np.isfinite(best.violation), ended, Status.NOT_FINITE)
    status = np.where(running, ended, status)
    lead = best.leader
    if not best.feasible[lead]:
        reason += "; no start met the constraints"
    return Optimum(
        problem=problem,
        best=dict(zip(problem.names, best.points[lead].tolist(), strict=True)),
        value=float(best.values[lead]),
        slacks=best.slacks[lead],
        feasible=bool(best.feasible[lead]),
        status=status,
        points=best.points,
        values=best.values,
        evaluations=evaluations,
        skipped=skipped,
        reason=reason,
        history=_history(problem, record, best, status, {**given, "reason": reason}),
    )


def _guessed(problem: Problem, guesses, starts: int) -> np.ndarray:
    """Guesses as points, (G, n)."""
    if len(guesses) > starts:
        raise ValueError(f"{len(guesses)} guesses are more than {starts} starts")
    for guess in guesses:
        for name in guess:
            if name not in problem.free:
                raise ValueError(f"a guess names {name!r}, which is not free")
        for name, (low, high) in problem.free.items():
            if name not in guess:
                raise ValueError(f"a guess lacks {name}")
            check_range(f"guess of {name}", guess[name], PARAMETERS[name].unit, low, high)
    points = [[float(guess[name]) for name in problem.names] for guess in guesses]
    return np.array(points).reshape(len(guesses), len(problem.names))


def _begin(problem: Problem, guessed: np.ndarray, starts, screen, seed, fly) -> np.ndarray:
    """Where to start: guesses, then a Sobol set, or the best points of a larger one, (S, n)."""
    wanted = starts - len(guessed)
    points = sobol(problem, max(wanted, screen), seed)
    if screen > starts:
        best = Best(len(points), len(problem.names), len(problem.constraints), 0.0)
        best.update(np.arange(len(points)), points, fly(points))
        points = points[best.order]
    return np.concatenate([guessed, points[:wanted]])


def _polished(problem: Problem, best: Best, fly, rounds: int, seed: int, progress) -> str:
    """Sample uphill from the best starts; what came of it, in words."""
    before, done = float(best.values[best.leader]), 0
    with progress_bar(rounds, "round", progress) as bar:

        def told(value: float) -> None:
            bar.set_postfix_str(f"best {value:.5g}")
            bar.update()

        try:
            for lead in summits(problem, best):
                done += sample_uphill(problem, best, lead, fly, rounds - done, seed, told)
        except KeyboardInterrupt:
            return "; interrupted while sampling around the best"
    if not done:
        return ""
    gain = 100 * (float(best.values[best.leader]) - before) / max(abs(before), 1e-300)
    return f"; {done} rounds of sampling around the best gained {gain:.2g} %"


def _row(starts, index, points, found, slope) -> dict[str, np.ndarray]:
    """A step of the history; starts that have ended are NaN."""
    rows = {
        "point": points,
        "value": found.values[:, 0],
        "violation": np.maximum(-found.slacks, 0).max(axis=1, initial=0.0),
        "slope": slope,
    }
    full = {name: np.full((starts, *row.shape[1:]), np.nan) for name, row in rows.items()}
    for name, row in rows.items():
        full[name][index] = row
    return full


def _history(problem: Problem, record, best: Best, status, given) -> xr.Dataset:
    """Steps and results of an optimisation, labelled."""
    unit, name = problem.objective.unit, problem.objective.name
    # name: (dimensions, values, unit, long name)
    shapes = {"point": (len(problem.names),), "value": (), "violation": (), "slope": ()}
    steps = {
        key: np.array([row[key] for row in record]).reshape(len(record), len(status), *shape)
        for key, shape in shapes.items()
    }
    each, at = ("step", "start"), "parameter"
    table = {
        "point": ((*each, at), steps["point"], "", "free parameters, in their units"),
        "value": (each, steps["value"], unit, name),
        "violation": (each, steps["violation"], "", "largest violation over its scale"),
        "slope": (each, steps["slope"], "", "norm of the ascent direction"),
        "best_point": (("start", at), best.points, "", "best point of the start"),
        "best_value": ("start", best.values, unit, f"{name} there"),
        "best_violation": ("start", best.violation, "", "largest violation there"),
        "status": ("start", status.astype(np.int32), "", "how the start ended"),
    }
    data = xr.Dataset(
        {
            key: (dims, values, {"units": unit, "long_name": long_name})
            for key, (dims, values, unit, long_name) in table.items()
        },
        coords={
            "parameter": list(problem.names),
            "unit": (at, [PARAMETERS[n].unit or "1" for n in problem.names]),
            "low": (at, problem.low),
            "high": (at, problem.high),
        },
    )
    data["status"].attrs |= {
        "flag_values": np.array([int(s) for s in Status], np.int32),
        "flag_meanings": " ".join(str(s).replace(" ", "_") for s in Status),
    }
    return stamp(data, {"problem": json.dumps(problem.describe()), **given})


class Verification(NamedTuple):
    """An optimum looked at again.

    Attributes:
        value, slacks: by a solution at 1e-9, and (m,).
        nearby: best value found among feasible samples around it.
        gain: of that over the value, relative.
        at: where, (n,).
        samples: number of samples.
    """

    value: float
    slacks: np.ndarray
    nearby: float
    gain: float
    at: np.ndarray
    samples: int


def verify(
    problem: Problem,
    point,
    *,
    samples: int = 128,
    radius: float = RADIUS,
    seed: int = 1,
    screener: Evaluator | None = None,
) -> Verification:
    """Solve again at 1e-9, and sample the neighbourhood.

    Args:
        problem: what was maximised.
        point: free parameters, by name or (n,).
        samples: points drawn evenly within the bounds, at most `radius` of each
            parameter's range away.
        radius: see there.
        seed: of the samples.
        screener: an `Evaluator` of this problem without gradients, to be used again.
    """
    named = isinstance(point, Mapping)
    centre = np.array([point[name] for name in problem.names] if named else point)
    check_integer("samples", samples, 1, 10_000_000)
    check_range("radius", radius, "", 0, 1, low_open=True)
    evaluate = Evaluator(problem, gradients=False) if screener is None else screener
    around = neighbours(problem, centre, radius, samples, np.random.default_rng(seed))
    values = evaluate(np.vstack([centre, around]), rtol=1e-9, atol=1e-9).values
    feasible = (values[1:, 1:] >= -FEASIBLE).all(axis=1) & np.isfinite(values[1:, 0])
    others = np.where(feasible, values[1:, 0], -np.inf)
    k, value = int(np.argmax(others)), float(values[0, 0])
    gain = (others[k] - value) / max(abs(value), 1e-300)
    return Verification(value, values[0, 1:], float(others[k]), float(gain), around[k], samples)
