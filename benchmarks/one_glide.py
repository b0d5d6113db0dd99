"""One 10 m glide, launch included, against NumPy and SciPy at matched landing accuracy.

For either code and polar the loosest of a few tolerances whose landing point is within the
target of that code's own solution at 1e-10 is timed. Ratios are of processor times, which are
of all threads: a glide uses one core.
"""

import numpy as np

from jaxglide.cli import configure

configure()

import jax

import numpy_peer as peer
from jaxglide import Gait, Glider, Launch, Polar, Snake, simulate
from timing import measure, report
from vector_field import peer_gait

TARGETS = (0.01, 0.001)  # m
TOLERANCES = 10.0 ** -np.arange(3, 9.5, 0.5)


def jax_lander(polar: str):
    glider = Glider(Snake.from_svl(0.7), Gait.from_degrees(), Polar.from_name(polar))
    fly = jax.jit(lambda tol: simulate(glider, Launch(), rtol=tol, atol=tol).state)
    return fly, lambda tol: np.asarray(fly(tol))[:2]


def numpy_lander(polar: str):
    settings = peer.Settings(**peer_gait(), polar=polar)

    def fly(tol):
        return peer.simulate(peer.prepare(settings), rtol=tol, atol=tol)

    return fly, lambda tol: fly(tol)["y"][:2, -1]


def main() -> None:
    rows = []
    for polar in ("published", "smooth"):
        for target in TARGETS:
            pair = {}
            for code, make in (("numpy", numpy_lander), ("jaxglide", jax_lander)):
                fly, land = make(polar)
                truth = land(1e-10)
                # A tolerance counts once it and all tighter ones reach the target.
                errors = [float(np.linalg.norm(land(tol) - truth)) for tol in TOLERANCES]
                good = [max(errors[i:]) <= target for i in range(len(errors))]
                index = good.index(True)
                timing = measure(fly, TOLERANCES[index], repeats=9)
                pair[code] = timing["processor_s"]
                rows.append(
                    {
                        "polar": polar,
                        "target_mm": 1e3 * target,
                        "code": code,
                        "tolerance": float(TOLERANCES[index]),
                        "error_mm": 1e3 * errors[index],
                        "median_ms": 1e3 * timing["median_s"],
                        "lower_ms": 1e3 * timing["lower_s"],
                        "upper_ms": 1e3 * timing["upper_s"],
                        "processor_ms": 1e3 * timing["processor_s"],
                    }
                )
            rows[-1]["times_faster"] = pair["numpy"] / pair["jaxglide"]
    report("one_glide", rows)


if __name__ == "__main__":
    main()
