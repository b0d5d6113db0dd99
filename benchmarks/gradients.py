"""What a gradient of the landing distance costs, in units of one glide.

For 3, 5 and 12 parameters, forward and reverse, one glide and a batch of 64 on one core;
and the memory of reverse mode over a glide from 75 m. Every row is a process of its own, which
flies the glide too. Times are of the processor: others may use the machine.
"""

import argparse
import json
import os
import resource
import subprocess
import sys

import numpy as np

from timing import measure, report

NAMES = ("theta_m", "nu_theta", "d_psi", "psi_m", "f_theta", "svl", "mass", "speed")
NAMES += ("lift_scale", "drag_scale", "air_density", "gravity")
AT = (96.5, 1.4, 10.0, 20.0, 1.2, 0.7, 0.038, 1.75, 1.0, 1.0, 1.165, 9.81)
MODES = ("none", 3), ("forward", 3), ("forward", 5), ("forward", 12)
MODES += ("reverse", 3), ("reverse", 12)
ROWS = [
    {"mode": mode, "parameters": n, "batch": batch, "height": 10.0}
    for batch in (1, 64)
    for mode, n in MODES
]
ROWS.append({"mode": "reverse", "parameters": 12, "batch": 1, "height": 75.0})


def run(row: dict) -> dict:
    """Time one row in this process."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp

    from jaxglide.ensemble.base import published_case
    from jaxglide.flight.glide import simulate
    from jaxglide.search.problem import SETUP

    base, n = published_case(SETUP), row["parameters"]

    def distance(x):
        case = base.replace(dict(zip(NAMES, x, strict=False)) | {"height": row["height"]})
        options = {"rtol": 1e-7, "atol": 1e-7, "max_steps": 4096}
        glide = simulate(case.glider, case.launch, **options)
        return glide.landing_point[1]

    function = {
        "none": distance,
        "forward": lambda x: jax.jacfwd(lambda x: (distance(x),) * 2, has_aux=True)(x),
        "reverse": jax.value_and_grad(distance),
    }[row["mode"]]
    spread = 1 + 0.01 * np.random.default_rng(0).uniform(-1, 1, (row["batch"], n))
    points = jnp.asarray(np.array(AT[:n]) * spread)
    one = row["batch"] == 1

    def timed(function) -> dict:
        compiled = jax.jit(function if one else jax.vmap(function))
        return measure(compiled, points[0] if one else points, repeats=9, inner=row["batch"])

    found = timed(function)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    glide = timed(distance)["processor_s"] if row["mode"] != "none" else found["processor_s"]
    first = {"first_s": found["first_s"], "peak_mib": peak}
    taken = {"ms": 1e3 * found["processor_s"], "glides": found["processor_s"] / glide}
    return {**row, **first, **taken}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--row", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.row:
        print(json.dumps(run(json.loads(given.row))))
        return
    rows = []
    environment = {**os.environ, "JAX_PLATFORMS": "cpu"}
    environment.setdefault("XLA_FLAGS", "--xla_cpu_prefer_vector_width=512")
    for row in ROWS:
        command = ["taskset", "-c", "0", sys.executable, __file__, "--row", json.dumps(row)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        )
        rows.append(json.loads(done.stdout.splitlines()[-1]))
    report("gradients", rows)


if __name__ == "__main__":
    main()
