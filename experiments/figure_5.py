"""Figure 5 b-f: what dorsoventral bending does, eleven shapes, five bends, three psi_m.

Free glides for b and c; held glides for the pitch moments of d, e and f, and the bend at
which every shape is in trim.
"""

import numpy as np
from common import arguments, save_figure, write_table

from jaxglide import Gait, Glider, Outcome, Snake
from jaxglide.ensemble.published import BENDS, NU_THETA, bending_study
from jaxglide.ensemble.survey import survey
from jaxglide.ensemble.sweep import sweep
from jaxglide.plot import bending_grid, bending_moments
from jaxglide.tunnel.trim import trim

PSI_M = (0.0, 10.0, 20.0)
PUBLISHED = {20.0: (3.33, 4.04, 4.79, 5.05, 0.56)}  # mean forward distance [m] by bend
TRIM_RANGE = np.deg2rad((-20.0, 30.0))


def trim_bend(nu_theta: float) -> float:
    """The d_psi without mean pitch moment at psi_m = 20 deg [deg], NaN where there is none."""
    glider = Glider(Snake.from_svl(), Gait.from_degrees(nu_theta=nu_theta))
    found = trim(glider, "d_psi", TRIM_RANGE, points=6, tolerance=1e-6, rtol=1e-6, atol=1e-6)
    return float(np.rad2deg(found.value))


def main() -> None:
    options = arguments(__doc__)
    shape = (len(PSI_M), len(BENDS), 11)
    free = sweep(bending_study(PSI_M), options.store("figure_5"))
    held = survey(bending_study(PSI_M, times=None))
    outcome = free.outcome.values.reshape(shape)
    forward = free.landing_point.sel(axis="y").values.reshape(shape)
    moment = held.mean_moment.sel(about="pitch").isel(record=held["last"]).values.reshape(shape)

    rows = []
    for i, psi_m in enumerate(PSI_M):
        for j, bend in enumerate(BENDS):
            counts = [int((outcome[i, j] == o).sum()) for o in list(Outcome)[:4]]
            published = PUBLISHED.get(psi_m, (np.nan,) * 5)[j]
            means = moment[i, j].mean(), forward[i, j].mean()
            rows.append((psi_m, bend, *counts, *means, published))
    header = ("psi_m (deg)", "d_psi (deg)", "landed", "yaw", "pitch", "roll")
    names = (*header, "mean pitch moment (N mm)", "mean forward (m)", "published (m)")
    write_table(options.out / "figure_5", names, rows)

    at_20 = moment[PSI_M.index(20.0)]
    trims = [trim_bend(nu) for nu in NU_THETA]
    columns = zip(NU_THETA, *at_20, trims, strict=True)
    rows = [*columns, ("mean", *at_20.mean(axis=1), float(np.nanmean(trims)))]
    bends = [f"{bend:g} deg" for bend in BENDS]
    header = ("nu_theta", *bends, "trim d_psi (deg)")
    write_table(options.out / "figure_5_moments", header, rows)

    save_figure(bending_grid(free, "path"), options.out / "figure_5b.png")
    save_figure(bending_grid(free, "pitch"), options.out / "figure_5c.png")
    save_figure(bending_moments(free, held, psi_m=20.0), options.out / "figure_5def.png")


if __name__ == "__main__":
    main()
