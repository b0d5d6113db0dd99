"""What gradients are worth with many parameters: the farthest glide of a programme of d_psi.

From 10 m, the default gait, smooth polar: d_psi follows a spline with n knots, by an actuator.
Three searches for the farthest landing, n = 3, 10, 30, 100, 200, ten seeds each at equal
cost: gradients (Adam, one start a seed), CMA-ES (the package cma, bounds by its own handling)
from the same starts, and random programmes within the bounds. Cost is counted in glides of
the same programme; a gradient at its measured processor time, forward or backwards as the
search takes it.

Expected before it was run: with three knots CMA-ES is as good or better, since ridges of the
distance mislead a gradient; from 30 knots on gradients win, and the more the more knots: a
gradient costs some six glides whatever their number, where CMA-ES needs some ten evaluations a
parameter to learn a direction. Random programmes lose from ten knots on.

`--size` is the number of glides of a search.
"""

import time
import warnings

import cma
import numpy as np
from common import arguments, save_figure, write_table
from matplotlib.figure import Figure
from search_cost import price

from jaxglide import Case, Gait, Glider, Launch, Polar, Snake, landing_distance
from jaxglide.plot import style
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.optimum import optimise
from jaxglide.search.problem import Problem
from jaxglide.search.program import ProgramSpace

KNOTS = 3, 10, 30, 100, 200
SEEDS = 10
SIGMA = 0.15  # of the range: CMA-ES's first step
SEARCHES = "gradients", "CMA-ES", "random"


def problem_of(knots: int) -> tuple[Problem, list[dict[str, float]]]:
    """The problem, and where the seeds start."""
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    case = Case(Glider(body, Gait.from_degrees(), Polar.smooth()), Launch(height=10.0))
    program = ProgramSpace.of(case, ("d_psi",), knots, 2.5, "time", None)
    problem = Problem(landing_distance, program.bounds, case=program.case)
    return problem, program.guesses(SEEDS + 1, 0)[1:]


def by_gradients(problem, guesses, exact, fast, budget: int, cost: float):
    """Cost and best so far of every seed, (I,) and (SEEDS, I)."""
    found = optimise(
        problem,
        starts=SEEDS,
        guesses=guesses,
        screen=0,
        polish=0,
        steps=max(2, int(budget / cost)),
        patience=12,
        evaluator=exact,
        screener=fast,
        progress=False,
    )
    values = found.history["value"].transpose("start", "step").values
    best = np.fmax.accumulate(np.where(np.isfinite(values), values, -np.inf), axis=1)
    return cost * np.arange(1, best.shape[1] + 1), best


def by_cma(problem, guesses, fast, budget: int):
    """The same by CMA-ES, all seeds side by side."""
    reach = problem.high - problem.low
    starts = np.array([list(guess.values()) for guess in guesses])
    told = {"bounds": [0, 1], "verbose": -9, "maxfevals": budget}
    searches = [
        cma.CMAEvolutionStrategy((x - problem.low) / reach, SIGMA, {**told, "seed": 1 + k})
        for k, x in enumerate(starts)
    ]
    curves = [[] for _ in searches]
    while len(curves[0]) < budget:
        asked = [np.array(one.ask()) for one in searches]
        points = problem.low + reach * np.clip(np.concatenate(asked), 0, 1)
        values = fast(points).values[:, 0]
        values = np.where(np.isfinite(values), values, -1e3)
        for one, curve, x, y in zip(
            searches, curves, asked, np.split(values, len(searches)), strict=True
        ):
            one.tell(list(x), list(-y))
            curve.extend(y)
    best = np.maximum.accumulate(np.array([curve[:budget] for curve in curves]), axis=1)
    return np.arange(1, budget + 1), best


def by_chance(problem, fast, budget: int):
    """The same by programmes drawn evenly within the bounds."""
    rows = []
    for seed in range(SEEDS):
        rng = np.random.default_rng(100 + seed)
        points = rng.uniform(problem.low, problem.high, (budget, len(problem.names)))
        values = fast(points).values[:, 0]
        rows.append(np.fmax.accumulate(np.where(np.isfinite(values), values, -np.inf)))
    return np.arange(1, budget + 1), np.array(rows)


def compared(knots: int, budget: int) -> tuple[dict, tuple]:
    """Curves by search, and the rows of a number of knots."""
    problem, guesses = problem_of(knots)
    exact, fast = Evaluator(problem), Evaluator(problem, gradients=False)
    glide, cost = price(problem, exact, fast, 32, time.process_time)
    print(f"{knots} knots: a glide {glide:.1f} ms, a gradient {cost:.2f} glides", flush=True)
    curves, seconds = {}, []
    for name in SEARCHES:
        begin = time.process_time()
        if name == "gradients":
            curves[name] = by_gradients(problem, guesses, exact, fast, budget, cost)
        elif name == "CMA-ES":
            curves[name] = by_cma(problem, guesses, fast, budget)
        else:
            curves[name] = by_chance(problem, fast, budget)
        seconds.append(time.process_time() - begin)
        ends = curves[name][1][:, -1]
        print(f"  {name}: {np.median(ends):.3f} m, {seconds[-1]:.0f} s", flush=True)
    ends = [curves[name][1][:, -1] for name in SEARCHES]
    wins = int((ends[0] > ends[1]).sum())
    spread = [float(f(one)) for one in ends for f in (np.median, np.min, np.max)]
    return curves, (knots, cost, *spread, wins, *seconds)


HEADER = (
    "knots",
    "cost of a gradient (glides)",
    *(f"{name}: {what} (m)" for name in SEARCHES for what in ("median", "lowest", "highest")),
    "seeds of which gradients end ahead of CMA-ES",
    *(f"{name}: processor seconds of all seeds" for name in SEARCHES),
)


@style()
def draw(runs: dict[int, dict], budget: int) -> Figure:
    """Best so far against cost, number by number of knots."""
    figure = Figure(figsize=(180 / 25.4, 55 / 25.4), layout="constrained")
    axes = figure.subplots(1, len(runs), sharex=True, sharey=True)
    for ax, (knots, curves) in zip(np.atleast_1d(axes), runs.items(), strict=True):
        for name, colour in zip(SEARCHES, ("#0072B2", "#D55E00", "#999999"), strict=True):
            cost, best = curves[name]
            low, middle, high = (f(best, axis=0) for f in (np.min, np.median, np.max))
            ax.fill_between(cost, low, high, color=colour, alpha=0.15, lw=0)
            ax.plot(cost, middle, color=colour, lw=1.2, label=name)
        ax.set_xscale("log")
        ax.set_xlim(5, budget)
        ax.set_title(f"{knots} knots", fontsize=7)
        ax.set_xlabel("cost (glides)")
    first = np.atleast_1d(axes)[0]
    first.set_ylabel("farthest so far (m)")
    first.legend(fontsize=6, loc="lower right")
    return figure


def main() -> None:
    options = arguments(__doc__)
    budget = options.size or 2000
    warnings.filterwarnings("ignore", module="cma")
    runs, rows = {}, []
    for knots in KNOTS:
        runs[knots], row = compared(knots, budget)
        rows.append(row)
        write_table(options.out / "program_cost", HEADER, rows)
    save_figure(draw(runs, budget), options.out / "program_cost.png")


if __name__ == "__main__":
    main()
