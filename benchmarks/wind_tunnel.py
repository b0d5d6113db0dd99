"""The published wind-tunnel study: 165 cases, every 25 ms record, 60 phases.

The published code took 108.7 minutes on four processes.
"""

import time

from jaxglide.cli import configure

configure()

import jax

from jaxglide.ensemble.published import bending_study
from jaxglide.ensemble.survey import survey
from timing import report

PUBLISHED = 108.7 * 60.0  # s, on four processes


def main() -> None:
    rows = []
    for psi_m in ((20.0,), (0.0, 10.0, 20.0)):
        study = bending_study(psi_m, times=None)
        seconds = []
        for _ in range(4):
            begin = time.perf_counter()
            data = survey(study)
            seconds.append(time.perf_counter() - begin)
        later = sorted(seconds[1:])
        row = {"cases": len(study), "records": int(data["last"].sum()) + len(study)}
        row |= {"devices": len(jax.local_devices()), "first_s": seconds[0]}
        row |= {"median_s": later[1], "lower_s": later[0], "upper_s": later[2]}
        if len(study) == 165:
            row["times_faster_than_published"] = PUBLISHED / later[1]
        rows.append(row)
    report("wind_tunnel", rows)


if __name__ == "__main__":
    main()
