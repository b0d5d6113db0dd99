"""The published shape space, 242 glides at 1e-6, against NumPy and SciPy."""

import time

import numpy as np

from jaxglide.cli import configure

configure()

import numpy_peer as peer
from jaxglide.ensemble.published import NU_THETA, THETA_M, shape_space
from timing import measure, report
from vector_field import peer_gait


def numpy_shapes(every: int) -> float:
    """Seconds for all 242 glides with the peer, from every `every`-th of them."""
    begin, flown = time.perf_counter(), 0
    cases = [(f, th, nu) for f in (0.0, 1.2) for th in THETA_M for nu in NU_THETA][::every]
    for f_theta, theta_m, nu_theta in cases:
        gait = {**peer_gait(), "theta_m": np.deg2rad(theta_m), "nu_theta": nu_theta}
        settings = peer.Settings(**{**gait, "f_theta": f_theta})
        peer.simulate(peer.prepare(settings), rtol=1e-6, atol=1e-6)
        flown += 1
    return (time.perf_counter() - begin) * 242 / flown


def main() -> None:
    ours = measure(lambda: shape_space().to_dict(), repeats=7)
    theirs = numpy_shapes(every=5)
    rows = [
        {"code": "numpy", "glides": 242, "median_s": theirs},
        {
            "code": "jaxglide",
            "glides": 242,
            **{key: ours[key] for key in ("median_s", "lower_s", "upper_s", "first_s")},
            "times_faster": theirs / ours["median_s"],
        },
    ]
    report("shape_space", rows)


if __name__ == "__main__":
    main()
