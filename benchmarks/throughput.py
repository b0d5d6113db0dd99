"""Glides per second of a sweep as their number grows: on cores, on devices, on a GPU.

Every row is a process of its own, so that its peak memory is its own. Without options: both
polars on all cores, and what lanes do in fixed batches and in pools, from the steps counted.
`--gpu`: 10^3 to 10^6 glides in float64 and float32, against the CPU. `--devices N`: the same
code on N virtual devices of the CPU.
"""

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import time
from contextlib import nullcontext
from unittest import mock

import numpy as np

from timing import report

POLARS = ("smooth", "published")
SIZES = (1000, 4000, 20_000)
GPU_SIZES = (1000, 10_000, 100_000, 1_000_000)
COMPARED = 1000  # glides whose landing points are compared with the CPU's

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


class Power:
    """Mean power [W] of the GPU while this is open; none where nvidia-smi does not tell."""

    mean: float | None = None

    _told: subprocess.Popen | None = None

    def __enter__(self):
        if shutil.which("nvidia-smi"):
            query = "--query-gpu=power.draw --format=csv,noheader,nounits --id=0 -lms 100"
            self._told = subprocess.Popen(
                ["nvidia-smi", *query.split()],
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
            )
        return self

    def __exit__(self, *_):
        if self._told:
            self._told.terminate()
            words = self._told.communicate()[0].split("\n")[:-1]  # the last may be cut off
            watts = [float(x) for x in words if x.strip().replace(".", "", 1).isdigit()]
            self.mean = float(np.mean(watts)) if watts else None


def busy_share(study, width: int) -> tuple:
    """A sweep, and the share of the lanes' steps that were of a flight."""
    from jaxglide.ensemble import batch
    from jaxglide.ensemble.sweep import sweep

    turns, fly = [], batch.fly

    def counted(program, values, fleet, *rest):
        for ended in fly(program, values, fleet, *rest):
            turns.append((int(ended[2].busy), fleet.lanes * int(ended[2].steps)))
            yield ended

    with mock.patch.object(batch, "fly", counted):
        data = sweep(study, width=width, progress=False)
    busy, steps = np.sum(turns, axis=0)
    return data, float(busy / steps)


def run(glides: int, polar: str, double: bool, width: int | None) -> dict:
    """One row, measured in this process; `told` is not for the table."""
    import jax

    jax.config.update("jax_enable_x64", double)
    from jaxglide.ensemble.batch import width_of, workers
    from jaxglide.ensemble.study import Study

    tolerance = 1e-6 if double else 1e-5
    given = {"rtol": tolerance, "atol": tolerance, "setup": {"polar": polar}}
    study = Study(cases=cases(glides), **given)
    width = width or width_of(study)
    begin = time.perf_counter()
    busy_share(study.part(np.arange(min(64, glides))), width)
    compiled = time.perf_counter() - begin
    with Power() if jax.default_backend() == "gpu" else nullcontext() as power:
        begin, processor = time.perf_counter(), time.process_time()
        data, busy = busy_share(study, width)
        took, worked = time.perf_counter() - begin, time.process_time() - processor
    watts = power and power.mean
    memory = (jax.local_devices()[0].memory_stats() or {}).get("peak_bytes_in_use")
    # attempts, and the rate at the start, which is a step too
    told = {"landing": data.landing_point.values[:COMPARED, :2].tolist()}
    told["steps"] = (data.accepted + data.rejected + 1).values.tolist()
    return {
        "glides": glides,
        "polar": polar,
        "float": 64 if double else 32,
        "workers": len(workers()),
        "lanes": width,
        "first_s": compiled,
        "seconds": took,
        "processor_s": worked,
        "ms_per_glide": 1e3 * took / glides,
        "glides_per_s": glides / took,
        "glides_per_joule": watts and glides / took / watts,
        "busy": busy,
        "peak_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "gpu_peak_mib": memory and memory / 2**20,
        "told": told,
    }


def process(glides, polar="smooth", *, double=True, width=None, cores=None, **environment):
    """One row, measured in a fresh process, and what it tells beside."""
    environment = {"JAX_PLATFORMS": "cpu", **os.environ, **environment}
    environment.setdefault("XLA_FLAGS", "--xla_cpu_prefer_vector_width=512")
    row = {"glides": glides, "polar": polar, "double": double, "width": width}
    command = [sys.executable, __file__, "--row", json.dumps(row)]
    allowed = sorted(os.sched_getaffinity(0))[:cores]
    command = ["taskset", "-c", ",".join(map(str, allowed)), *command]
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True)
    done.check_returncode()
    found = {"cores": len(allowed), **json.loads(done.stdout.splitlines()[-1])}
    told = {name: np.array(values) for name, values in found.pop("told").items()}
    print({name: found[name] for name in ("glides", "polar", "seconds", "busy")}, flush=True)
    return found, told


def on_cpu(sizes) -> None:
    import lanes

    rows, waiting = [], []
    for polar in POLARS:
        told = {}
        for count in sizes:
            row, told = process(count, polar)
            rows.append(row)
        waiting += lanes.table(told["steps"], polar=polar)
    row, _ = process(sizes[0], cores=1)
    report("throughput", [*rows, row])
    report("lanes", waiting)


def compared(settings, truth, name: str) -> None:
    """Rows beside the CPU's landing points, by polar."""
    rows = []
    for given in settings:
        row, told = process(**given)
        expected = truth[row["polar"]][: row["glides"]]
        apart = np.linalg.norm(told["landing"][: len(expected)] - expected, axis=1)
        row["within_1_cm"] = float((apart <= 0.01).mean())
        rows.append({**row, "same_bits": float((apart == 0).mean())})
    report(name, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gpu", action="store_true", help="on a GPU")
    parser.add_argument("--devices", type=int, help="on so many virtual devices of the CPU")
    parser.add_argument("--sizes", type=int, nargs="+", help="numbers of glides")
    parser.add_argument("--row", type=json.loads, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.row:
        print(json.dumps(run(**given.row)))
        return
    if not (given.gpu or given.devices):
        on_cpu(given.sizes or SIZES)
        return
    truth = {polar: process(COMPARED, polar)[1]["landing"] for polar in POLARS}
    if given.gpu:
        sizes, doubles, where = GPU_SIZES, (True, False), {"JAX_PLATFORMS": "cuda"}
    else:
        where = {"JAX_NUM_CPU_DEVICES": str(given.devices)}
        sizes, doubles = SIZES[1:2], (True,)
    rows = [
        {"glides": count, "polar": polar, "double": double, **where}
        for polar in POLARS
        for double in doubles
        for count in given.sizes or sizes
    ]
    compared(rows, truth, "throughput_gpu" if given.gpu else "throughput_devices")


if __name__ == "__main__":
    main()
