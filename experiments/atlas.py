"""An atlas of gaits from 10 m: theta_m, nu_theta, d_psi, psi_m and f_theta, resumable.

`--size 1000000` flies a million gaits; the default of 20,000 shows the same at lower
resolution. The number of glides is the smallest grid not below the size asked for.
"""

import resource
import time

import numpy as np
from common import arguments, save_figure, write_table

from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.plot import stable_atlas

RANGES = {
    "f_theta": (0.6, 1.8),
    "psi_m": (0.0, 45.0),
    "d_psi": (-20.0, 30.0),
    "theta_m": (80.0, 125.0),
    "nu_theta": (0.9, 1.6),
}
SHAPE = {"f_theta": 0.7, "psi_m": 0.7, "d_psi": 1.0, "theta_m": 1.4, "nu_theta": 1.4}


def grid(size: int) -> dict[str, np.ndarray]:
    """Axes of the grid: about as many points each as `SHAPE` has it, `size` in all or more."""
    scale = 1.0
    while True:
        counts = {name: max(2, int(scale * weight)) for name, weight in SHAPE.items()}
        if np.prod(list(counts.values())) >= size:
            return {name: np.linspace(*RANGES[name], counts[name]) for name in RANGES}
        scale *= 1.005


def main() -> None:
    options = arguments(__doc__)
    study = Study(grid(options.size or 20_000))
    begin = time.perf_counter()
    data = sweep(study, options.store(f"atlas_{len(study)}"))
    took = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    header = ("glides", "seconds", "ms per glide", "peak memory (MiB)", "landed (%)")
    landed = 100.0 * float((data.outcome == 0).mean())
    row = (len(study), took, 1e3 * took / len(study), peak, landed)
    write_table(options.out / f"atlas_{len(study)}", header, [row])
    save_figure(stable_atlas(data), options.out / f"atlas_{len(study)}.png")


if __name__ == "__main__":
    main()
