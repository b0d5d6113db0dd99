"""Glides per second of a sweep as their number grows, on one core and on all, or on a GPU.

Every row is a process of its own, so that its peak memory is its own. `--gpu` runs float64
and float32 at 10^4 to 10^6 glides and compares landing points with float64 on the CPU.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time

import numpy as np

from timing import report

SIZES = (242, 1000, 4000, 20_000)
GPU_SIZES = (10_000, 100_000, 1_000_000)
COMPARED = 2000  # glides whose landing points are compared with the CPU's

RANGES = {
    "nu_theta": (1.0, 1.5),
    "theta_m": (90.0, 120.0),
    "psi_m": (10.0, 40.0),
    "d_psi": (-10.0, 20.0),
    "f_theta": (0.0, 1.7),
}


def cases(count: int) -> dict[str, np.ndarray]:
    """Gaits drawn evenly over the observed ranges; the first ones are always the same."""
    random = np.random.default_rng(0).uniform(size=(count, len(RANGES)))
    spans = zip(RANGES.items(), random.T, strict=True)
    return {name: low + (high - low) * column for (name, (low, high)), column in spans}


def run(count: int, double: bool, width: int | None) -> dict:
    """One row, measured in this process."""
    import jax

    jax.config.update("jax_enable_x64", double)
    from jaxglide.ensemble.batch import default_width
    from jaxglide.ensemble.study import Study
    from jaxglide.ensemble.sweep import sweep

    tolerance = 1e-6 if double else 1e-5
    given = {"rtol": tolerance, "atol": tolerance, "setup": {"polar": "smooth"}}
    study = Study(cases=cases(count), **given)
    width = min(width or default_width(study), count)
    warm = Study(cases=cases(width), **given)
    begin = time.perf_counter()
    sweep(warm, width=width, progress=False)
    compiled = time.perf_counter() - begin
    begin = time.perf_counter()
    data = sweep(study, width=width, progress=False)
    took = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    landing = data.landing_point.values[:COMPARED, :2].tolist()
    return {
        "glides": count,
        "float": 64 if double else 32,
        "devices": len(jax.local_devices()),
        "width": width,
        "first_s": compiled,
        "seconds": took,
        "ms_per_glide": 1e3 * took / count,
        "peak_mib": peak,
        "landing": landing,
    }


def process(count: int, *, double=True, cores=None, platform="cpu", width=None) -> dict:
    """One row, measured in a fresh process."""
    environment = {**os.environ, "JAX_PLATFORMS": platform}
    environment.setdefault("XLA_FLAGS", "--xla_cpu_prefer_vector_width=512")
    command = [sys.executable, __file__, "--row", str(count), "--double", str(int(double))]
    command += [] if width is None else ["--width", str(width)]
    if platform == "cpu":
        cores = cores or os.cpu_count() or 1
        environment["JAX_NUM_CPU_DEVICES"] = str(cores)
        command = ["taskset", "-c", f"0-{cores - 1}", *command]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def on_cpu() -> None:
    rows = [process(count) for count in SIZES]
    rows.append(process(SIZES[2], cores=1))
    for row in rows:
        row.pop("landing")
    rows[-1]["speedup_of_all_cores"] = rows[-1]["seconds"] / rows[2]["seconds"]
    report("throughput", rows)


def on_gpu() -> None:
    truth = np.array(process(COMPARED)["landing"])
    rows = []
    for double in (True, False):
        for count in GPU_SIZES:
            row = process(count, double=double, platform="cuda")
            landing = np.array(row.pop("landing"))[: len(truth)]
            apart = np.linalg.norm(landing - truth, axis=1)
            rows.append({**row, "over_1_cm": float((apart > 0.01).mean())})
            print(rows[-1], flush=True)
    report("throughput_gpu", rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gpu", action="store_true", help="on a GPU")
    parser.add_argument("--row", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--double", type=int, default=1, help=argparse.SUPPRESS)
    parser.add_argument("--width", type=int, help="glides per batch")
    given = parser.parse_args()
    if given.row:
        print(json.dumps(run(given.row, bool(given.double), given.width)))
    elif given.gpu:
        on_gpu()
    else:
        on_cpu()


if __name__ == "__main__":
    main()
