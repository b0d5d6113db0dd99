"""One evaluation of the vector field, alone and per lane in batches, against NumPy and C.

One core: `taskset -c 0 python benchmarks/vector_field.py`. Ratios are of processor times.
"""

from typing import Any

import numpy as np

from jaxglide.cli import configure

configure()

import jax
import jax.numpy as jnp

import c_kernel
import numpy_peer as peer
from jaxglide import (
    Flight,
    Gait,
    Glider,
    Polar,
    Snake,
    discretise,
    six_degrees_of_freedom,
)
from timing import measure, report

STATE = np.array([0, 0, 9, 0.1, 1.7, -1.0, 0.3, 0, 0, 0.1, -0.1, 0.05, 0])


def repeated(polar: str, count: int):
    """`count` evaluations in a compiled loop, as a solver makes them."""

    def run(state, nu_theta):
        glider = Glider(
            Snake.from_svl(0.7), Gait.from_degrees(nu_theta=nu_theta), Polar.from_name(polar)
        )
        flight = Flight(glider, discretise(glider.body), jnp.asarray(-0.03))

        def body(i, y):
            return y + 1e-6 * six_degrees_of_freedom(1e-3 * i, y, flight)

        return jax.lax.fori_loop(0, count, body, state)

    return run


def in_c(lanes: int, count: int) -> dict[str, float]:
    """The same evaluations by the kernel in C, with the published polar."""
    model = c_kernel.model(Glider(Snake.from_svl(0.7), Gait.from_degrees(nu_theta=1.4)), -0.03)
    models, states = (c_kernel.Model * lanes)(*[model] * lanes), np.tile(STATE, (lanes, 1))
    return measure(c_kernel.evaluate, states, models, count, inner=count * lanes)


def main() -> None:
    rows = []
    for polar in ("published", "smooth"):
        model = peer.prepare(peer.Settings(**peer_gait(), polar=polar))
        start = STATE[:12]
        numpy_time = measure(lambda m=model, y=start: peer.vector_field(0.1, y, m, -0.03))
        rows.append({"polar": polar, "code": "numpy", "lanes": 1, **per_lane(numpy_time, 1)})
        for lanes, count in ((1, 2000), (8, 500), (64, 100), (512, 20)):
            limit = in_c(lanes, count) if c_kernel.available() else None
            if limit:
                rows.append(
                    {"polar": "published", "code": "C", "lanes": lanes, **per_lane(limit, 1)}
                )
            run = repeated(polar, count)
            shape = np.full(lanes, 1.4) + 1e-4 * np.arange(lanes)
            if lanes == 1:
                timing = measure(jax.jit(run), STATE, 1.4, inner=count)
            else:
                states = np.tile(STATE, (lanes, 1))
                timing = measure(jax.jit(jax.vmap(run)), states, shape, inner=count * lanes)
            ratio = numpy_time["processor_s"] / timing["processor_s"]
            row = {"polar": polar, "code": "jaxglide", "lanes": lanes, **per_lane(timing, 1)}
            row["times_faster_than_numpy"] = ratio
            if limit:
                row["times_slower_than_c"] = timing["processor_s"] / limit["processor_s"]
            rows.append(row)
    report("vector_field", rows)


def per_lane(timing: dict[str, float], lanes: int) -> dict[str, float]:
    """Microseconds per lane and evaluation; compilation in seconds."""
    names = ("median_s", "lower_s", "upper_s", "processor_s")
    micro = {f"{k[:-2]}_us": 1e6 * timing[k] / lanes for k in names}
    return {**micro, "compile_s": timing["first_s"]}


def peer_gait() -> dict[str, Any]:
    angles = {"theta_m": 96.48753, "psi_m": 20.0, "d_psi": 10.0, "d_theta": 0.0}
    radians = {name: float(np.deg2rad(value)) for name, value in angles.items()}
    return {**radians, "nu_theta": 1.4, "f_theta": 1.2, "svl": 0.7}


if __name__ == "__main__":
    main()
