"""Nodes along the body: how far landing points are from those of 200 Gauss nodes, and the cost.

The glides of random gaits in the observed ranges that land, at 1e-9, so that the nodes alone
make the difference; then all of them at the usual tolerances, float32 against float64.
Cost is processor time, on one core.
"""

import argparse
import json
import os
import subprocess
import sys
import time

import numpy as np

from throughput import POLARS, cases
from timing import report

GAITS, MANY, FINE = 24, 240, 200
LANES = 8
RULES = [("gauss", n) for n in (30, 40, 50, 60, FINE)] + [("published", 70)]


def run(polar: str, node_set: str, nodes: int, *, gaits: int, tolerance, double: bool) -> dict:
    """Landing points, outcomes and processor time of one set of nodes, in this process."""
    import jax

    jax.config.update("jax_enable_x64", double)
    from jaxglide import Outcome, Study, sweep

    study = Study(
        cases=cases(gaits),
        setup={"polar": polar, "node_set": node_set, "nodes": nodes},
        rtol=tolerance,
        atol=tolerance,
    )
    sweep(study.part(np.arange(LANES)), width=LANES, progress=False)
    times = []
    for _ in range(2):
        begin = time.process_time()
        data = sweep(study, width=LANES, progress=False)
        times.append(time.process_time() - begin)
    return {
        "ms_per_glide": 1e3 * min(times) / gaits,
        "landed": (data.outcome == Outcome.LANDED).values.tolist(),
        "landing": data.landing_point.values[:, :2].tolist(),
    }


def process(**given) -> dict:
    """What `run` gives, of a process of its own on one core."""
    core = str(min(os.sched_getaffinity(0)))
    command = ["taskset", "-c", core, sys.executable, __file__, "--row", json.dumps(given)]
    environment = {"JAX_PLATFORMS": "cpu", **os.environ}
    environment.setdefault("XLA_FLAGS", "--xla_cpu_prefer_vector_width=512")
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True)
    done.check_returncode()
    found = json.loads(done.stdout.splitlines()[-1])
    print(given, f"{found['ms_per_glide']:.3g} ms a glide", flush=True)
    return found


def apart(found: dict, truth: dict) -> dict:
    """How far landing points are from the true ones, of those that land."""
    landed = np.array(truth["landed"])
    both = landed & found["landed"]
    distance = np.linalg.norm(np.array(found["landing"]) - truth["landing"], axis=1)
    distance = 1e3 * distance[both]
    return {
        "land": int(landed.sum()),
        "another_outcome": int((landed != found["landed"]).sum()),
        "median_mm": float(np.median(distance)),
        "largest_mm": float(distance.max()),
        "within_1_cm": float((distance <= 10).sum() / landed.sum()),
        "ms_per_glide": found["ms_per_glide"],
    }


def by_nodes(polar: str) -> list[dict]:
    """Error and cost of each set of nodes."""
    given = {"polar": polar, "gaits": GAITS, "tolerance": 1e-9, "double": True}
    found = {rule: process(node_set=rule[0], nodes=rule[1], **given) for rule in RULES}
    truth = found["gauss", FINE]
    return [
        {"polar": polar, "node_set": rule[0], "nodes": rule[1], **apart(found[rule], truth)}
        for rule in RULES
    ]


def by_precision(polar: str) -> list[dict]:
    """Error and cost of float32 and float64 lane by lane, of many gaits."""
    given = {"polar": polar, "node_set": "published", "nodes": 70, "gaits": MANY}
    truth = process(**given, tolerance=1e-9, double=True)
    rows = []
    for double, tolerance in ((True, 1e-6), (True, 1e-5), (False, 1e-5)):
        found = process(**given, tolerance=tolerance, double=double)
        about = {"polar": polar, "float": 64 if double else 32, "tolerance": tolerance}
        rows.append({**about, **apart(found, truth)})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--row", type=json.loads, help=argparse.SUPPRESS)
    parser.add_argument("--polars", nargs="+", choices=POLARS, default=POLARS)
    given = parser.parse_args()
    if given.row:
        print(json.dumps(run(**given.row)))
        return
    report("nodes", [row for polar in given.polars for row in by_nodes(polar)])
    report("precision", [row for polar in given.polars for row in by_precision(polar)])


if __name__ == "__main__":
    main()
