"""Gradient-based optimisation of gaits and bodies, many starts at once.

All starts advance together: one batch of glides with their gradients a step. See `problem`
for what is asked, `_ascent` for how the starts move.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import optax
import xarray as xr

from .._lib.checks import check_choice, check_integer, check_range
from .._lib.report import Report, Reported
from ..ensemble.records import versions
from .ascent import FEASIBLE, Ascent
from .climb import Search
from .climb import Status as Status
from .evaluator import Evaluator, fingerprint
from .journal import keeping
from .polish import RADIUS, neighbours
from .problem import Problem

OPTIMISERS = ("adam", "lbfgs")
"""Optimisers by name; others of optax can be passed themselves."""

_SCREEN = 512  # points tried first, where nothing else is said and there are fewer starts
_RATE = 0.1  # of Adam, where nothing else is said


@dataclass(frozen=True)
class Optimum(Reported):
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

    def report(self) -> Report:
        base, notes = self.problem.base, []
        for constraint, slack in zip(self.problem.constraints, self.slacks, strict=True):
            kept = "met" if slack > 0.05 else "binding" if slack > -FEASIBLE else "violated"
            notes.append(f"{constraint!s} is {kept}")
        rows = []
        for name, value in self.best.items():
            low, high = self.problem.free[name]
            near = min(value - low, high - value) < 1e-3 * (high - low)
            text = f"{value:.6g} {base.parameter(name).unit}".rstrip()
            rows.append((name, text + (" (at its bound)" if near else "")))
        ended = [(str(s), int((self.status == s).sum())) for s in Status]
        rows.append(("starts", ", ".join(f"{count} {s}" for s, count in ended if count)))
        rows.append(("gradients", f"{self.evaluations}, {self.skipped} not finite"))
        rows.extend(self._starts())
        title = _said(self.problem, self.value)
        return Report(title, tuple(rows), (*notes, self.reason))

    def _starts(self) -> list[tuple[str, str]]:
        """Rows of the ten best starts."""
        unmet = self.history["best_violation"].values > FEASIBLE
        rows = []
        for k in np.lexsort((-self.values, unmet))[:10]:
            if not np.isfinite(self.values[k]):
                continue
            place = zip(self.best, self.points[k], strict=True)
            where = ", ".join(f"{name} {value:.5g}" for name, value in place)
            status = Status(int(self.status[k]))
            rows.append((f"  start {k}", f"{self.values[k]:.6g} at {where}: {status}"))
        return rows


def _said(problem: Problem, value: float) -> str:
    """The objective's name and value."""
    return f"{problem.objective.name} {value:.6g} {problem.objective.unit}".rstrip()


def optimise(
    problem: Problem,
    *,
    starts: int = 64,
    guesses: Sequence[Mapping[str, float]] = (),
    screen: int | None = None,
    steps: int = 100,
    polish: int = 20,
    optimiser: str | optax.GradientTransformation = "adam",
    rate: float | None = None,
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
        screen: so many points of the set, more than `starts`, are tried first, without
            gradients, and the best of them are the starts; 0 for none. By default 512,
            where that is more.
        steps: most iterations.
        polish: most rounds of 256 points sampled within 2 % of the ranges around the best
            one, which moves to the best of them; three rounds that gain less than a
            thousandth end it, and those left go to the second and third best starts.
        optimiser: "adam", "lbfgs", or an optax transformation (of the gradient of what is
            to become small; its updates are added).
        rate: Adam's first step, in u (the whole range of a parameter is pi); by default 0.1.
        patience: steps without a relative gain of `tolerance` after which a start goes back
            to its best point and on from there with steps 0.4 times as long; when they are
            a hundredth of the first it has converged. By default 4, and 8 with constraints.
        tolerance: see there.
        seed: of the Sobol set, 0 or more.
        log: file of evaluations (JSON lines): killed and called again, it goes on there. It
            belongs to this search, down to the code of the objective and the versions.
        progress: show a bar; by default where somebody can see it.
        evaluator, screener: an `Evaluator` of this problem with and one without gradients
            (for screening and polishing; by default `evaluator` if that is given), to use
            their compiled functions again.

    Returns:
        The best point of all starts. Ctrl-C returns the best so far; before the first step
        is done there is none, and it is raised.

    Raises:
        ValueError: a wrong argument, the log of another optimisation, or a damaged one.
        OSError: the log cannot be written (`WriteError`), or another process is at work on
            it (`BusyError`).

    Examples:
        >>> from jaxglide import Problem, landing_distance, optimise
        >>> problem = Problem(landing_distance, {"d_psi": (0, 20)}, fixed={"height": 2})
        >>> best = optimise(problem, starts=2, screen=0, steps=8, polish=0, progress=False)
        >>> print(f"{best.value:.2f} m at {best.best['d_psi']:.0f} degrees per SVL")
        1.32 m at 2 degrees per SVL
    """
    if not isinstance(problem, Problem):
        raise TypeError(f"problem = {problem!r} is not a Problem")
    rule = _optimiser(optimiser, len(problem.names))
    given = _options(problem, starts, screen, steps, polish, optimiser, rate, patience)
    check_range("tolerance", tolerance, "", 0, 1, shape=())
    check_integer("seed", seed, 0, 2**63 - 1)
    given |= {"optimiser": rule, "tolerance": float(tolerance), "seed": int(seed)}
    guessed = _guessed(problem, guesses, given["starts"])
    for name, one in (("evaluator", evaluator), ("screener", screener)):
        if getattr(one, "problem", problem) != problem:
            raise ValueError(f"{name} is that of another problem")
    if screener is None:
        screener = evaluator or Evaluator(problem, gradients=False)
    evaluator = Evaluator(problem) if evaluator is None else evaluator
    asked = {} if log is None else _asked(problem, given, guessed, evaluator)
    with keeping(log, asked) as journal:
        search = Search(problem, given, journal, evaluator, screener, progress)
        points = search.begin(guessed)
        search.climb(Ascent(problem, points, optimiser, given["rate"] or 0.0))
        search.sample()
    history, best = search.end(), search.best
    lead = best.leader
    return Optimum(
        problem=problem,
        best=dict(zip(problem.names, best.points[lead].tolist(), strict=True)),
        value=float(best.values[lead]),
        slacks=best.slacks[lead],
        feasible=bool(best.feasible[lead]),
        status=search.status,
        points=best.points,
        values=best.values,
        evaluations=search.evaluations,
        skipped=search.skipped,
        reason=search.reason,
        history=history,
    )


def _options(
    problem: Problem, starts, screen, steps, polish, optimiser, rate, patience
) -> dict[str, Any]:
    """The options in plain values, defaults filled in, checked."""
    check_integer("starts", starts, 1, 100_000)
    if screen is None:
        screen = _SCREEN if starts < _SCREEN else 0
    check_integer("screen", screen, 0, 10_000_000)
    if 0 < screen <= starts:
        raise ValueError(
            f"screen = {screen} is not allowed: it must be more than starts = {starts}, or 0"
        )
    check_integer("steps", steps, 1, 1_000_000)
    check_integer("polish", polish, 0, 1_000_000)
    patience = (8 if problem.constraints else 4) if patience is None else patience
    check_integer("patience", patience, 1, 1_000_000)
    if optimiser == "adam":
        rate = _RATE if rate is None else rate
        check_range("rate", rate, "", 0, 10, low_open=True, shape=())
        rate = float(rate)
    elif rate is not None:
        raise ValueError(f"rate = {rate!r} is Adam's: another optimiser brings its own")
    counts = {"starts": starts, "screen": screen, "steps": steps, "polish": polish}
    plain = {name: int(count) for name, count in counts.items()}
    return {**plain, "rate": rate, "patience": int(patience)}


def _optimiser(optimiser, n: int) -> str:
    """A name that tells an optimiser from every other, tried on n parameters.

    Raises:
        ValueError: an unknown name, or what cannot be used here.
    """
    if isinstance(optimiser, str):
        check_choice("optimiser", optimiser, OPTIMISERS)
        return optimiser
    if not isinstance(optimiser, optax.GradientTransformation):
        raise TypeError(
            f"optimiser = {optimiser!r} is neither one of {', '.join(OPTIMISERS)} nor an optax "
            "transformation, such as optax.sgd(1.0)"
        )
    u = jnp.zeros(n)

    def two_steps(downhill):
        _, state = optimiser.update(downhill, optimiser.init(u), u)
        return optimiser.update(downhill, state, u)

    try:
        change = jax.eval_shape(two_steps, u)[0]
    except Exception as error:
        raise ValueError(
            "optimiser cannot be used: its update(gradient, state, parameters) fails with "
            f"{type(error).__name__}"
        ) from error
    if getattr(change, "shape", None) != u.shape:
        raise ValueError(f"optimiser cannot be used: it makes {change} of a gradient ({n},)")
    return f"given {fingerprint(two_steps, u)}"


def _asked(problem, given, guessed, evaluator) -> dict[str, Any]:
    """A search in plain values: all that its results depend on."""
    kind = type(evaluator)
    computed = f"{kind.__module__}.{kind.__qualname__}"
    if isinstance(evaluator, Evaluator):
        computed += f" {evaluator.fingerprint()}"
    used = {name: text for name, text in versions().items() if name != "version_python"}
    used["version_optax"] = optax.__version__
    asked = {**used, "precision": str(jnp.zeros(()).dtype), **problem.describe()}
    asked |= {"order": list(problem.names), **given, "guesses": guessed.tolist()}
    return {**asked, "computed": computed}


def _guessed(problem: Problem, guesses, starts: int) -> np.ndarray:
    """Guesses as points, (G, n)."""
    if isinstance(guesses, Mapping) or not all(isinstance(one, Mapping) for one in guesses):
        raise TypeError(f"guesses = {guesses!r} is not a list of values by name")
    if len(guesses) > starts:
        raise ValueError(f"{len(guesses)} guesses are more than {starts} starts")
    return np.array([_point("guess", problem, guess) for guess in guesses]).reshape(
        len(guesses), len(problem.names)
    )


def _point(what: str, problem: Problem, given: Mapping[str, float]) -> list[float]:
    """Values by name as those of the free parameters in their order, n, checked."""
    for name in given:
        if name not in problem.free:
            raise ValueError(f"a {what} names {name!r}, which is not free")
    for name, (low, high) in problem.free.items():
        if name not in given:
            raise ValueError(f"a {what} lacks {name}")
        unit = problem.base.parameter(name).unit
        check_range(f"{what} of {name}", given[name], unit, low, high)
    return [float(given[name]) for name in problem.names]


@dataclass(frozen=True)
class Verification(Reported):
    """An optimum looked at again.

    Attributes:
        problem: what was asked.
        value, slacks: by a solution at 1e-9, and (m,).
        nearby: best value found among feasible samples around it; NaN where none is.
        gain: of that over the value, relative; NaN where there is none.
        at: where, (n,).
        samples: number of samples.
    """

    problem: Problem
    value: float
    slacks: np.ndarray
    nearby: float
    gain: float
    at: np.ndarray
    samples: int

    def report(self) -> Report:
        nearby = f"none of {self.samples} points nearby meets the constraints"
        if np.isfinite(self.gain):
            gain = f"{100 * self.gain:+.3f} % better"
            nearby = f"of {self.samples} points nearby the best is {gain}"
        return Report(f"{_said(self.problem, self.value)} at 1e-9", (), (nearby,))


def verify(
    problem: Problem,
    point: Mapping[str, float] | Sequence[float] | np.ndarray,
    *,
    samples: int = 128,
    radius: float = RADIUS,
    seed: int = 1,
    screener: Evaluator | None = None,
) -> Verification:
    """Solve again at 1e-9, and sample the neighbourhood.

    Args:
        problem: what was maximised.
        point: free parameters, by name or (n,), within the bounds.
        samples: points drawn evenly within the bounds, at most `radius` of each
            parameter's range away.
        radius: see there.
        seed: of the samples.
        screener: an `Evaluator` of this problem without gradients, to be used again.

    Raises:
        ValueError: a wrong argument.
    """
    if not isinstance(point, Mapping):
        names = problem.names
        if np.shape(point) != (len(names),):
            raise ValueError(f"point has shape {np.shape(point)}: it must be ({len(names)},)")
        point = dict(zip(names, point, strict=True))
    centre = np.array(_point("point", problem, point))
    check_integer("samples", samples, 1, 10_000_000)
    check_integer("seed", seed, 0, 2**63 - 1)
    check_range("radius", radius, "", 0, 1, low_open=True, shape=())
    evaluate = Evaluator(problem, gradients=False) if screener is None else screener
    around = neighbours(problem, centre, radius, samples, np.random.default_rng(seed))
    found = evaluate(np.vstack([centre, around]), rtol=1e-9, atol=1e-9)
    values = problem.answer(found, samples + 1, gradients=False).values
    feasible = (values[1:, 1:] >= -FEASIBLE).all(axis=1) & np.isfinite(values[1:, 0])
    others = np.where(feasible, values[1:, 0], -np.inf)
    k, value = int(np.argmax(others)), float(values[0, 0])
    nearby = float(others[k]) if feasible.any() else np.nan
    gain = (nearby - value) / max(abs(value), 1e-300)
    return Verification(problem, value, values[0, 1:], nearby, float(gain), around[k], samples)
