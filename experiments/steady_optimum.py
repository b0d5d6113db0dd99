"""Steady glides made flat and stable: do gradients through the fixed point beat sampling?

The flattest steady glide whose multipliers all stay below 0.95 in modulus, by five gait
variables, in wide ranges and in those observed; smooth polar, 40 Gauss nodes. Three searches
at equal cost, ten seeds each: gradients (`optimise`: 12 points of a Sobol set tried, Adam from
the best 2 of them), CMA-ES (populations of 8; 100 degrees times the logarithm of radius over
0.95 are added where that is above 1, 1000 where nothing is found) and a Sobol set. All judge a
gait alike: by the steady glide to which the search leads from that of the nearest gait judged
before, if that is within a tenth of the ranges; if there is none or it leads nowhere, by the
most stable of those that searches from five starts find.

Cost is counted in derivatives of the return map with all steps of the solver, a derivative
with a quarter of the steps as a quarter. By processor time in lanes of 16 the five starts of
a gait cost 8 of them, to judge what is found 3.5, and with all gradients 16. Every search has
1,200 (`--size`). A seed is won by the flatter glide; one that finds none loses. The factor is
1,200 over the cost at which the gradients reach the median that sampling ends with.

Then, by gradients from the best of what CMA-ES and the Sobol set have judged: the flattest, the
slowest sinking and the most stable gait of both ranges, again on 60 nodes, and with the
deviations that the coefficients of the band-limited polar leave; and how stable a gait can
become where one range at a time is wider, or where the mass moves along the body.
"""

import dataclasses
import itertools
import json
import threading
import warnings
from collections.abc import Callable

import cma
import numpy as np
from common import arguments, save_figure, write_table, write_text
from matplotlib.figure import Figure
from scipy.stats import qmc
from steady_map import OBSERVED, WIDE

from jaxglide import (
    Launch,
    Outcome,
    Polar,
    Problem,
    discretise,
    optimise,
    simulate,
    spectral_radius,
    steady_glide,
    steady_glide_angle,
    steady_sink_rate,
)
from jaxglide.ensemble.base import published_case
from jaxglide.ensemble.seeker import MOST
from jaxglide.plot import style
from jaxglide.search.problem import Evaluation
from jaxglide.search.steady import SteadyJudge
from jaxglide.steady.reduced import scales

SETUP = {"polar": "smooth", "node_set": "gauss"}
NODES = 40
BOUND, SCALE = 0.95, 0.02
SEEDS, BUDGET = 10, 1200
SCREEN, STARTS = 12, 2
STEPS = 8  # from the best of all, at the end
REACH = 0.1  # of the ranges, within which a gait's glide is a guess
COARSE, KNOWN, JUDGED, SLOPED = 0.25, 8.0, 3.5, 16.0
POPULATION = 8
MEASURES = {
    "steady_glide_angle": steady_glide_angle,
    "spectral_radius": spectral_radius,
    "steady_sink_rate": steady_sink_rate,
}
FLAT, FIRM, SLOW = MEASURES
MASS = "body.body_density[0]"  # where the body's density is largest, fraction of its length
CENTRE = 0.52583598  # the published one


class Desk:
    """Judges gaits for several searches at once, whenever all of them have asked.

    Args:
        ranges: of the free parameters, of which only the names count here.
        searches: how many.
        nodes: of the body.
    """

    def __init__(self, ranges: dict, searches: int = 1, nodes: int = NODES):
        raw = tuple(MEASURES[name].at_most(0.0) for name in (FIRM, SLOW))
        setup = {**SETUP, "nodes": nodes}
        problem = Problem(MEASURES[FLAT], ranges, raw, setup=setup)
        self.given = problem.given()
        self.judges = {slopes: SteadyJudge(problem, slopes) for slopes in (False, True)}
        self.active, self.ready = searches, threading.Condition()
        self.waiting: dict[int, tuple[np.ndarray, np.ndarray, bool]] = {}
        self.answers: dict[int, tuple[Evaluation, np.ndarray, np.ndarray]] = {}
        self.broken = False

    def ask(
        self, points: np.ndarray, guesses: np.ndarray, slopes: bool = False
    ) -> tuple[Evaluation, np.ndarray, np.ndarray]:
        """Glide angle, radius and sink rate at points, (S, 3), and their gradients; the states
        of the glides, (S, 8); the costs, (S,)."""
        who = threading.get_ident()
        with self.ready:
            self.waiting[who] = points, guesses, slopes
            self._serve()
            self.ready.wait_for(lambda: self.broken or who in self.answers)
            return self.answers.pop(who)

    def leave(self) -> None:
        """One search fewer."""
        with self.ready:
            self.active -= 1
            self._serve()

    def _serve(self) -> None:
        if self.broken or not self.waiting or len(self.waiting) < self.active:
            return
        try:
            self._judge()
        except BaseException:
            self.broken = True
            raise
        finally:
            self.ready.notify_all()

    def _judge(self) -> None:
        for slopes, judge in self.judges.items():
            asked = {
                who: given[:2] for who, given in self.waiting.items() if given[2] == slopes
            }
            if not asked:
                continue
            points, guesses = map(np.concatenate, zip(*asked.values(), strict=True))
            roots = judge.roots(points, guesses)
            cold = ~np.isfinite(guesses).all(axis=1)  # or a guess that leads nowhere, below
            cold |= roots.coarse > MOST
            cost = COARSE * roots.coarse + roots.full + (SLOPED if slopes else JUDGED)
            cost += np.where(cold, KNOWN, 0.0)
            found = judge.judge(points, roots.u, self.given)
            sign = np.array([1.0, -1.0, -1.0])  # slacks are what they are below 0
            values, gradients = found.values * sign, found.gradients * sign[:, None]
            upto = 0
            for who, (own, _) in asked.items():
                at = slice(upto, upto := upto + len(own))
                told = Evaluation(values[at], gradients[at])
                self.answers[who] = told, roots.u[at], cost[at]
        self.waiting = {}


class Ledger:
    """What a search has spent, and the values (glide angle, radius, sink rate) it has got."""

    def __init__(self, desk: Desk, ranges: dict):
        self.desk, self.spent = desk, 0.0
        self.low, self.high = np.array(list(ranges.values())).T
        self.costs, self.points, self.values, self.roots = [], [], [], []

    def ask(self, points: np.ndarray, slopes: bool = False) -> Evaluation:
        found, roots, cost = self.desk.ask(points, self._guesses(points), slopes)
        self.costs += (self.spent + np.cumsum(cost)).tolist()
        self.spent = self.costs[-1]
        self.points += points.tolist()
        self.values += found.values.tolist()
        self.roots += list(roots)
        return found

    def _guesses(self, points: np.ndarray) -> np.ndarray:
        """The glide of the nearest gait judged so far, where that is near."""
        guesses = np.full((len(points), 8), np.nan)
        if not self.roots:
            return guesses
        roots = np.array(self.roots)
        away = (points[:, None] - np.array(self.points)) / (self.high - self.low)
        distance = np.where(np.isfinite(roots).all(axis=1), np.abs(away).max(axis=2), np.inf)
        nearest = distance.argmin(axis=1)
        near = distance.min(axis=1) < REACH
        guesses[near] = roots[nearest[near]]
        return guesses


class Asked:
    """An evaluator of `optimise` that a desk serves."""

    def __init__(self, problem: Problem, gradients: bool, ledger: Ledger):
        self.problem, self.gradients, self.ledger = problem, gradients, ledger
        self.wanted = list(MEASURES).index(problem.objective.name.lstrip("-"))

    def __call__(self, points: np.ndarray, rtol=None, atol=None) -> Evaluation:
        found = self.ledger.ask(points, self.gradients)
        radius, slope = found.values[:, 1], found.gradients[:, 1]
        parts = [(-found.values[:, self.wanted], -found.gradients[:, self.wanted])]
        parts += [
            ((c.bound - radius) / c.scale, -slope / c.scale) for c in self.problem.constraints
        ]
        values, gradients = (np.stack(each, axis=1) for each in zip(*parts, strict=True))
        return Evaluation(values, gradients)


def problem_of(ranges: dict, measure: str = FLAT) -> Problem:
    """To make a measure small, every multiplier below the bound."""
    bounds = () if measure == FIRM else (spectral_radius.at_most(BOUND, SCALE),)
    setup = {**SETUP, "nodes": NODES}
    return Problem(MEASURES[measure].wanted, ranges, bounds, setup=setup)


def climb(problem: Problem, ledger: Ledger, **options) -> None:
    """`optimise`, without its sampling at the end."""
    exact, fast = (Asked(problem, gradients, ledger) for gradients in (True, False))
    given = {"polish": 0, "progress": False, "evaluator": exact, "screener": fast}
    optimise(problem, **given, **options)  # type: ignore[arg-type]


def by_gradients(problem: Problem, ledger: Ledger, seed: int, budget: float) -> None:
    """Points of a Sobol set, then Adam from the best; steps as the budget allows."""
    value, slope = 36.5, 24.0  # about what an evaluation costs
    steps = max(int((budget - SCREEN * value) / slope / STARTS), 1)
    climb(problem, ledger, seed=seed, screen=SCREEN, starts=STARTS, steps=steps)


def by_evolution(problem: Problem, ledger: Ledger, seed: int, budget: float) -> None:
    """CMA-ES from the middle of nowhere."""
    low, high = problem.low, problem.high
    start = np.random.default_rng(2000 + seed).uniform(0.2, 0.8, len(low))
    given = {"bounds": [0, 1], "popsize": POPULATION, "seed": seed + 1, "verbose": -9}
    search = cma.CMAEvolutionStrategy(start, 0.3, given)
    while ledger.spent < budget and not search.stop():
        asked = search.ask()
        values = ledger.ask(low + (high - low) * np.array(asked)).values
        with np.errstate(invalid="ignore", divide="ignore"):
            over = np.maximum(np.log(values[:, 1] / BOUND), 0)
        search.tell(asked, np.nan_to_num(values[:, 0] + 100 * over, nan=1e3).tolist())


def by_sampling(problem: Problem, ledger: Ledger, seed: int, budget: float) -> None:
    """A Sobol set, eight points at a time."""
    drawn = qmc.Sobol(len(problem.low), rng=1000 + seed)
    while ledger.spent < budget:
        points = problem.low + (problem.high - problem.low) * drawn.random(8)
        ledger.ask(points)


SEARCHES = {"gradients": by_gradients, "CMA-ES": by_evolution, "Sobol set": by_sampling}


def side_by_side(works: list[tuple[dict, Callable[[Ledger], None]]]) -> list[dict]:
    """What searches find, each within its ranges, of the same parameters."""
    desk = Desk(works[0][0], len(works))
    ledgers = [Ledger(desk, ranges) for ranges, _ in works]

    def work(k: int) -> None:
        try:
            works[k][1](ledgers[k])
        finally:
            desk.leave()

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(works))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return [{"costs": x.costs, "points": x.points, "values": x.values} for x in ledgers]


def with_seeds(search: Callable, ranges: dict, budget: float, seeds: int) -> list[dict]:
    """What a search finds with each seed."""
    problem = problem_of(ranges)
    return side_by_side(
        [
            (ranges, lambda ledger, seed=seed: search(problem, ledger, seed, budget))
            for seed in range(seeds)
        ]
    )


def kept(options, name: str, compute: Callable[[], list[dict]]) -> list[dict]:
    """Runs from a file, or anew and into it."""
    path = options.out / f"{name}.runs.json"
    if options.resume and path.exists():
        return json.loads(path.read_text())
    found = compute()
    write_text(path, json.dumps(found))
    return found


def curve(run: dict, budget: float) -> tuple[np.ndarray, np.ndarray]:
    """Cost and flattest so far that meets the bound, NaN before the first."""
    values, costs = np.array(run["values"], float), np.array(run["costs"])
    met = np.where(values[:, 1] <= BOUND * (1 + 1e-6), values[:, 0], np.nan)
    some = costs <= budget
    return costs[some], np.fmin.accumulate(met[some])


def table_of(found: dict[str, list[dict]], name: str, budget: float) -> list[tuple]:
    """A row for each search."""
    curves = {which: [curve(run, budget) for run in each] for which, each in found.items()}
    ends = {which: [float(best[-1]) for _, best in each] for which, each in curves.items()}
    worst = {which: np.nan_to_num(each, nan=np.inf) for which, each in ends.items()}
    target = float(np.median(worst["Sobol set"]))
    rows = []
    for which, each in curves.items():
        wins = int((worst[which] < worst["Sobol set"]).sum())
        reached = [
            float(costs[np.argmax(best <= target)]) if (best <= target).any() else np.inf
            for costs, best in each
        ]
        end = worst[which]
        factor = budget / float(np.median(reached)) if np.isfinite(target) else np.nan
        evaluations = float(np.median([len(costs) for costs, _ in each]))
        finds, middle = int(np.isfinite(end).sum()), float(np.median(end))
        row = (name, which, evaluations, finds, budget * len(each) / max(finds, 1))
        middle = middle if np.isfinite(middle) else np.nan
        rows.append((*row, middle, float(end.min()), wins, factor))
    return rows


HEADER = (
    "ranges",
    "search",
    "gaits judged",
    "seeds that find one",
    "cost for each of those",
    "median of the flattest (deg)",
    "flattest (deg)",
    "seeds flatter than the Sobol set's",
    "factor against it",
)


def refined(ranges: dict, measure: str, guesses: np.ndarray, steps: int) -> tuple:
    """Work for `side_by_side`: gradients alone, from some guesses."""
    problem = problem_of(ranges, measure)
    given = np.clip(guesses, problem.low, problem.high)
    given = [dict(zip(ranges, map(float, guess), strict=True)) for guess in given]
    options = {"guesses": given, "starts": len(given), "screen": 0, "steps": steps}
    return ranges, lambda ledger: climb(problem, ledger, **options)


def best_in(points: np.ndarray, values: np.ndarray, measure: str) -> tuple:
    """The best of gaits, (n,), and its three measures, (3,); NaN where none is allowed."""
    met = values[:, 1] <= (np.inf if measure == FIRM else BOUND)
    wanted = np.where(met, values[:, list(MEASURES).index(measure)], np.nan)
    if not np.isfinite(wanted).any():
        return np.full(points.shape[1], np.nan), np.full(3, np.nan)
    k = int(np.nanargmin(wanted))
    return points[k], values[k]


def pooled(found: list[list[dict]]) -> tuple[np.ndarray, np.ndarray]:
    """All points that were judged, (N, n), and what came of them, (N, 3)."""
    every = [run for each in found for run in each]
    points = np.concatenate([run["points"] for run in every])
    return points, np.concatenate([np.array(run["values"], float) for run in every])


def drawn(found: dict[str, list[dict]]) -> list[list[dict]]:
    """Runs of the searches without gradients."""
    return [found[label] for label in SEARCHES if label != "gradients"]


def leaders(points, values, measure: str, count: int = STARTS) -> np.ndarray:
    """The best points by a measure, those that meet the bound first; no two alike."""
    column = values[:, list(MEASURES).index(measure)]
    over = 0.0 if measure == FIRM else 1e3 * np.maximum(values[:, 1] - BOUND, 0)
    order = np.argsort(np.nan_to_num(column + over, nan=1e9))
    chosen: list[np.ndarray] = []
    spread = points.max(axis=0) - points.min(axis=0)
    for k in order:
        if all(np.max(np.abs(points[k] - other) / spread) > 0.1 for other in chosen):
            chosen.append(points[k])
        if len(chosen) == count:
            break
    return np.array(chosen)


WIDER = {
    "as observed": {},
    "theta_m 40 to 140 deg": {"theta_m": (40.0, 140.0)},
    "nu_theta 0.8 to 2.2": {"nu_theta": (0.8, 2.2)},
    "f_theta 0.6 to 3 Hz": {"f_theta": (0.6, 3.0)},
    "d_psi -60 to 60 deg": {"d_psi": (-60.0, 60.0)},
    "psi_m 0 to 90 deg": {"psi_m": (0.0, 90.0)},
    "wide in all five": WIDE,
    "mass 0.30 to 0.75 of SVL": {MASS: (0.30, 0.75)},
}


def wider(points, values, steps: int) -> list[tuple]:
    """Works for `side_by_side`: the most stable gait with one range at a time wider."""
    guesses, works = leaders(points, values, FIRM), []
    for changed in WIDER.values():
        ranges = {**OBSERVED, **changed}
        extra = np.full((len(guesses), len(ranges) - len(OBSERVED)), CENTRE)
        works.append(refined(ranges, FIRM, np.hstack([guesses, extra]), steps))
    return works


def needed(found: list[dict]) -> list[tuple]:
    """How stable a gait became with one range at a time wider than observed, a row each."""
    rows = []
    for name, run in zip(WIDER, found, strict=True):
        point, value = best_in(*pooled([[run]]), FIRM)
        known = dict(zip({**OBSERVED, **WIDER[name]}, map(float, point), strict=True))
        shown = [known[n] for n in OBSERVED] + [known.get(MASS, CENTRE)]
        rows.append((name, float(value[1]), float(value[0]), *shown))
    return rows


def again(ends: list[tuple]) -> list[tuple]:
    """Rows of optima: again on 60 nodes, and with what the coefficients leave open.

    Args:
        ends: ranges, measure, gait, (5,), and its three measures, (3,).
    """
    points = np.array([point for *_, point, _ in ends])
    known = Desk(WIDE).ask(points, np.full((len(points), 8), np.nan))[1]
    base = published_case({**SETUP, "nodes": 60})
    rows = []
    for (name, measure, point, value), root in zip(ends, known, strict=True):
        glider = base.replace(dict(zip(WIDE, map(float, point), strict=True))).glider
        # what a climb found from nearby, the search from afar may not find again
        near = np.isfinite(root).all()
        state = root * np.asarray(scales(glider, discretise(glider.body))) if near else None
        finer = steady_glide(glider, state)
        banded = dataclasses.replace(glider, aerodynamics=Polar.band_limited())
        banded = steady_glide(banded, finer.state if bool(finer.found) else None)
        sure = banded.uncertainty if bool(banded.found) else None
        row = (name, measure, *map(float, point), *map(float, value))
        row += (np.rad2deg(float(finer.glide_angle)), float(finer.spectral_radius))
        row += (np.rad2deg(float(banded.glide_angle)),)
        row += (np.nan if sure is None else np.rad2deg(float(sure.glide_angle)),)
        row += (float(banded.spectral_radius),)
        rows.append((*row, np.nan if sure is None else float(sure.spectral_radius)))
        print(rows[-1], flush=True)
    return rows


def launched(ends: list[tuple], height: float = 75.0) -> list[tuple]:
    """How gaits end that are launched as published, a row each; 60 nodes."""
    base, rows = published_case({**SETUP, "nodes": 60}), []
    for name, measure, point, value in ends:
        case = base.replace(dict(zip(WIDE, map(float, point), strict=True)))
        glide = simulate(case.glider, Launch(height=height))
        ended = str(Outcome(int(glide.outcome))), float(glide.time), float(glide.path_length)
        angle = float(np.rad2deg(glide.glide_angle))
        rows.append((name, measure, float(value[0]), *ended, angle))
    return rows


OPTIMA = (
    "ranges",
    "least",
    *WIDE,
    "glide angle (deg)",
    "spectral radius",
    "sink rate (m/s)",
    "angle on 60 nodes (deg)",
    "radius on 60 nodes",
    "angle, band-limited (deg)",
    "its deviation (deg)",
    "radius, band-limited",
    "its deviation",
)


@style()
def draw(found: dict[str, dict[str, list[dict]]], budget: float) -> Figure:
    """Flattest so far against cost, a line for each seed that finds one."""
    figure = Figure(figsize=(150 / 25.4, 75 / 25.4), dpi=300, layout="constrained")
    axes = figure.subplots(1, len(found), sharey=True)
    looks = (("#0072B2", 1.4, 3), ("#D55E00", 0.9, 2), ("#888888", 0.9, 1))
    for ax, (name, searches) in zip(axes, found.items(), strict=True):
        for (which, each), (colour, width, order) in zip(searches.items(), looks, strict=True):
            curves = [curve(run, budget) for run in each]
            finds = sum(bool(np.isfinite(best[-1])) for _, best in curves)
            label = f"{which}: {finds} of {len(each)}"
            for k, (costs, best) in enumerate(curves):
                ax.step(
                    [*costs, budget],
                    [*best, best[-1]],
                    where="post",
                    color=colour,
                    lw=width,
                    alpha=0.8,
                    zorder=order,
                    label=None if k else label,
                )
        ax.set_title(name)
        ax.set_xlabel("cost (derivatives of the map)")
        ax.set_xlim(0, budget)
        ax.legend(loc="upper left")
    axes[0].set_ylabel("flattest with radius below 0.95 (deg)")
    axes[0].set_ylim(90, 10)
    return figure


def main() -> None:
    options = arguments(__doc__)
    warnings.filterwarnings("ignore", "The balance properties of Sobol")
    budget = options.size or BUDGET
    seeds, steps = (SEEDS, STEPS) if budget >= BUDGET else (2, 2)
    found: dict[str, dict[str, list[dict]]] = {}
    rows, works = [], []
    for name, ranges in (("wide", WIDE), ("observed", OBSERVED)):
        found[name] = {
            label: kept(
                options,
                f"{name}_{label.replace(' ', '_')}_{budget}",
                lambda search=search, ranges=ranges: with_seeds(search, ranges, budget, seeds),
            )
            for label, search in SEARCHES.items()
        }
        rows += table_of(found[name], name, budget)
        works += [
            refined(ranges, measure, leaders(*pooled(drawn(found[name])), measure), steps)
            for measure in MEASURES
        ]
    write_table(options.out / "searches", HEADER, rows)
    save_figure(draw(found, budget), options.out / "steady_search.png")
    *gaits, body = wider(*pooled(drawn(found["observed"])), steps)
    runs = kept(options, f"refined_{steps}", lambda: side_by_side(works + gaits))
    named = [(name, measure) for name in found for measure in MEASURES]
    ends = []
    for (name, measure), run in zip(named, runs[: len(works)], strict=True):
        every = [run, *itertools.chain(*found[name].values())]
        ends.append((name, measure, *best_in(*pooled([every]), measure)))
    known = [end for end in ends if np.isfinite(end[-1]).all()]
    write_table(options.out / "optima", OPTIMA, again(known))
    header = ("ranges", "least", "steady glide angle (deg)", "from 75 m", "time (s)")
    header += ("path length (m)", "glide angle at the end (deg)")
    write_table(options.out / "launched", header, launched(known))
    runs = runs[len(works) :] + kept(options, f"mass_{steps}", lambda: side_by_side([body]))
    header = ("ranges", "least radius", "its glide angle (deg)", *OBSERVED, "mass at")
    write_table(options.out / "needed", header, needed(runs))


if __name__ == "__main__":
    main()
