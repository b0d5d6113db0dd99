"""The published shape space, 242 glides at 1e-6, against NumPy and SciPy.

The ratio is of processor times: how much less work it is. NumPy uses one core, a sweep all.
"""

import time

import numpy as np

from jaxglide.cli import configure

configure()

import numpy_peer as peer
from jaxglide.ensemble.published import NU_THETA, THETA_M, shape_space
from timing import measure, report
from vector_field import peer_gait


def numpy_shapes(every: int) -> float:
    """Processor time for all 242 glides with the peer, from every `every`-th of them [s]."""
    begin, flown = time.process_time(), 0
    cases = [(f, th, nu) for f in (0.0, 1.2) for th in THETA_M for nu in NU_THETA][::every]
    for f_theta, theta_m, nu_theta in cases:
        gait = {**peer_gait(), "theta_m": np.deg2rad(theta_m), "nu_theta": nu_theta}
        settings = peer.Settings(**{**gait, "f_theta": f_theta})
        peer.simulate(peer.prepare(settings), rtol=1e-6, atol=1e-6)
        flown += 1
    return (time.process_time() - begin) * 242 / flown


def main() -> None:
    ours = measure(lambda: shape_space().to_dict(), repeats=15)
    theirs = numpy_shapes(every=5)
    rows = [
        {"code": "numpy", "glides": 242, "processor_s": theirs},
        {
            "code": "jaxglide",
            "glides": 242,
            **ours,
            "times_faster": theirs / ours["processor_s"],
        },
    ]
    report("shape_space", rows)


if __name__ == "__main__":
    main()
