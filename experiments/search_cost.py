"""What gradients are worth: the farthest glide found against the number of glides flown.

Five searches on the same problem: theta_m, nu_theta and d_psi within the ranges observed,
from 10 m, at least 10 degrees short of a tumble and no part of the body within a chord of
another. Gradients from random starts (a gradient counted at its measured cost in glides);
the search of the library, which screens its starts and samples around the best at its end;
the same without any gradient; random sampling; Nelder-Mead from many starts, which sees a
penalty of 3 m for every 10 degrees or chord missing. Only gaits that meet the constraints
count. `--size` is the number of glides of a search.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure
from optimal_gaits import problem_of
from scipy.optimize import minimize

from jaxglide.plot import style
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.optimum import optimise
from jaxglide.search.problem import Evaluation, Problem

SEEDS = 5
CHAINS = 4  # of Nelder-Mead searches side by side in one budget
STARTS = 12  # of the gradient searches
SCREENED, POLISH = 512, 6  # glides flown first; rounds of sampling at the end
ROUND = 256  # glides of one round
PENALTY, SIMPLEX = 3.0, 0.15
FEASIBLE = 1e-3


def price(
    problem: Problem,
    exact: Evaluator,
    fast: Evaluator,
    count: int = 64,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[float, float]:
    """Milliseconds of a glide, and cost of a gradient in glides; batches of `count`."""
    size = count, len(problem.names)
    points = np.random.default_rng(99).uniform(problem.low, problem.high, size)
    best = []
    for evaluate in (fast, exact):
        evaluate(points)
    for evaluate in (fast, exact):
        times = []
        for _ in range(3):
            begin = clock()
            evaluate(points)
            times.append(clock() - begin)
        best.append(min(times))
    return 1e3 * best[0] / count, best[1] / best[0]


def climb(values: np.ndarray) -> np.ndarray:
    """Best feasible distance so far of evaluations (N, 1 + m), NaN before the first."""
    met = (values[:, 1:] >= -FEASIBLE).all(axis=1) & np.isfinite(values[:, 0])
    return np.fmax.accumulate(np.where(met, values[:, 0], np.nan))


class Counted(Evaluator):
    """An evaluator that keeps the best so far and what was spent, in glides."""

    def __init__(self, problem: Problem, gradients: bool, price: float = 1.0):
        super().__init__(problem, gradients)
        self.price = price
        self.ledger: list[tuple[float, np.ndarray]] = []

    def __call__(self, points: np.ndarray, rtol=None, atol=None) -> Evaluation:
        found = super().__call__(points, rtol, atol)
        self.ledger.append((self.price * len(points), found.values))
        return found


def gradients_used(budget: int, cost: float, screen: int, polish: int) -> int:
    """Steps of all starts that the rest of a budget pays for, at least one."""
    return max(int((budget - screen - ROUND * polish) / cost / STARTS), 1)


def library_search(exact: Counted, fast: Counted, seed: int, **effort):
    """Cost [glides] and best so far of `optimise`, everything it flies counted."""
    exact.ledger = fast.ledger = ledger = []
    optimise(exact.problem, seed=seed, **effort, evaluator=exact, screener=fast)
    cost = np.concatenate([np.full(len(v), spent / len(v)) for spent, v in ledger])
    return np.cumsum(cost), climb(np.concatenate([values for _, values in ledger]))


class Desk:
    """Flies the points of several searches together, whenever all have handed one in."""

    def __init__(self, evaluate: Evaluator, searches: int):
        self.evaluate, self.active = evaluate, searches
        self.waiting: dict[int, np.ndarray] = {}
        self.answers: dict[int, np.ndarray] = {}
        self.ready = threading.Condition()

    def ask(self, who: int, point: np.ndarray) -> np.ndarray:
        """Values at a point, (1 + m,)."""
        with self.ready:
            self.waiting[who] = point
            self._serve()
            self.ready.wait_for(lambda: who in self.answers)
            return self.answers.pop(who)

    def leave(self) -> None:
        """One search fewer."""
        with self.ready:
            self.active -= 1
            self._serve()

    def _serve(self) -> None:
        if self.waiting and len(self.waiting) >= self.active:
            values = self.evaluate(np.stack(list(self.waiting.values()))).values
            self.answers |= dict(zip(self.waiting, values, strict=True))
            self.waiting = {}
            self.ready.notify_all()


class _Spent(Exception):
    """The budget of a search is used up."""


def nelder_mead(problem: Problem, desk: Desk, who: int, budget: int, record: list) -> None:
    """Restarted from random points until `budget` glides are flown; appends values (1 + m,)."""
    rng = np.random.default_rng(1000 + who)
    reach = problem.high - problem.low

    def loss(u: np.ndarray) -> float:
        if len(record) >= budget:
            raise _Spent
        value = desk.ask(who, problem.low + reach * np.clip(u, 0, 1))
        record.append(value)
        if not np.isfinite(value).all():
            return 1e3
        return float(-value[0] + PENALTY * np.maximum(-value[1:], 0.0).sum())

    try:
        while True:
            start = rng.uniform(0, 1, 3)
            sides = np.where(start < 0.5, SIMPLEX, -SIMPLEX)
            simplex = np.vstack([start, start + np.diag(sides)])
            given = {"initial_simplex": simplex, "xatol": 2e-3, "fatol": 2e-3}
            minimize(loss, start, method="Nelder-Mead", bounds=[(0, 1)] * 3, options=given)
    except _Spent:
        pass
    finally:
        desk.leave()


def nelder_mead_all(problem: Problem, fast: Evaluator, budget: int) -> list[np.ndarray]:
    """Best so far of every seed, side by side."""
    records: list[list] = [[] for _ in range(SEEDS * CHAINS)]
    desk = Desk(fast, len(records))
    threads = [
        threading.Thread(target=nelder_mead, args=(problem, desk, k, budget // CHAINS, record))
        for k, record in enumerate(records)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    together = np.array(records).reshape(SEEDS, CHAINS, budget // CHAINS, -1)
    return [climb(np.concatenate(one.transpose(1, 0, 2))) for one in together]


def reached(cost: np.ndarray, best: np.ndarray, least: float) -> float:
    """Cost at which the best first reaches `least`, infinite where it never does."""
    there = np.flatnonzero(best >= least)
    return float(cost[there[0]]) if there.size else np.inf


def main() -> None:
    options = arguments(__doc__)
    budget, problem = options.size or 3000, problem_of()
    exact, fast = Counted(problem, True), Counted(problem, False)
    glide, cost = price(problem, exact, fast)
    print(f"a glide {glide:.1f} ms, a gradient {cost:.2f} glides", flush=True)
    exact.price = cost
    climbing = gradients_used(budget, cost, 0, 0)
    both = gradients_used(budget, cost, SCREENED, POLISH)
    efforts: dict[str, dict[str, Any]] = {
        "gradients": {"starts": STARTS, "screen": 0, "steps": climbing, "polish": 0},
        "screening, gradients, sampling": {
            **{"starts": STARTS, "steps": both},
            **{"screen": SCREENED, "polish": POLISH},
        },
        "screening, sampling": {
            **{"starts": 1, "steps": 1},
            **{"screen": budget - POLISH * ROUND, "polish": POLISH},
        },
    }
    runs: dict[str, list] = {name: [] for name in (*efforts, "random", "Nelder-Mead")}
    spent = {}
    for name, curves in runs.items():
        begin = time.perf_counter()
        if name == "Nelder-Mead":
            few = Evaluator(problem, gradients=False)
            for best in nelder_mead_all(problem, few, budget):
                curves.append((np.arange(1.0, len(best) + 1), best))
        for seed in range(SEEDS if name != "Nelder-Mead" else 0):
            if name in efforts:
                curves.append(library_search(exact, fast, seed, **efforts[name]))
            else:
                rng = np.random.default_rng(100 + seed)
                points = rng.uniform(problem.low, problem.high, (budget, 3))
                curves.append((np.arange(1.0, budget + 1), climb(fast(points).values)))
        spent[name] = time.perf_counter() - begin
        print(f"{name}: {spent[name]:.0f} s", flush=True)
    known = max(float(np.nanmax(best)) for c in runs.values() for _, best in c)
    rows = []
    for name, curves in runs.items():
        ends = [float(best[-1]) for _, best in curves]
        row = [name, len(curves), *map(float, (np.median(ends), min(ends), max(ends)))]
        for part in (0.90, 0.95, 0.99):
            costs = [reached(glides, best, part * known) for glides, best in curves]
            row += [int(np.isfinite(costs).sum()), float(np.median(costs))]
        rows.append((*row, spent[name]))
    header = ["search", "seeds", f"median of the best after {budget} glides (m)", "lowest"]
    header.append("highest")
    for within in (10, 5, 1):
        header += [f"seeds within {within} % of {known:.2f} m", f"median glides to {within} %"]
    write_table(options.out / "search_cost", (*header, "seconds"), rows)
    save_figure(draw(runs, known, budget, cost), options.out / "search_cost.png")


@style()
def draw(runs: dict, known: float, budget: int, cost: float) -> Figure:
    """Median and spread over the seeds of the best so far against cost."""
    figure = Figure(figsize=(120 / 25.4, 78 / 25.4), dpi=300, layout="constrained")
    ax = figure.add_subplot()
    colours = "#D55E00", "#009E73", "#CC79A7", "#999999", "#0072B2"
    grid = np.geomspace(20, budget, 200)
    for (name, curves), colour in zip(runs.items(), colours, strict=True):
        on_grid = []
        for costs, best in curves:
            at = np.searchsorted(costs, grid, side="right") - 1
            on_grid.append(np.where(at >= 0, best[np.maximum(at, 0)], np.nan))
        whole = np.isfinite(on_grid).all(axis=0)
        low, middle, high = (
            f(np.array(on_grid)[:, whole], axis=0) for f in (np.min, np.median, np.max)
        )
        ax.fill_between(grid[whole], low, high, color=colour, alpha=0.18, lw=0)
        ax.plot(grid[whole], middle, color=colour, lw=1.4, label=name)
    ax.axhline(known, color="#222222", lw=0.7, ls=(0, (4, 2)), label="best known")
    ax.set_xscale("log")
    ax.set_xlim(grid[0], grid[-1])
    ax.set_xlabel(f"cost (glides; a gradient is {cost:.1f})")
    ax.set_ylabel("farthest so far (m)")
    ax.legend(loc="lower right")
    return figure


if __name__ == "__main__":
    main()
