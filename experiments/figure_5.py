"""Figure 5 b-c: what dorsoventral bending does, eleven shapes, five bends, three psi_m."""

import numpy as np
from common import arguments, save_figure, write_table

from jaxglide import Outcome
from jaxglide.plot import bending_grid
from jaxglide.published import BENDS, bending_study
from jaxglide.sweep import sweep

PSI_M = (0.0, 10.0, 20.0)
PUBLISHED = {20.0: (3.33, 4.04, 4.79, 5.05, 0.56)}  # mean forward distance [m] by bend


def main() -> None:
    options = arguments(__doc__)
    data = sweep(bending_study(PSI_M), options.store("figure_5"))
    shape = (len(PSI_M), len(BENDS), 11)
    outcome = data.outcome.values.reshape(shape)
    forward = data.landing_point.sel(axis="y").values.reshape(shape)
    rows = []
    for i, psi_m in enumerate(PSI_M):
        for j, bend in enumerate(BENDS):
            counts = [int((outcome[i, j] == o).sum()) for o in list(Outcome)[:4]]
            published = PUBLISHED.get(psi_m, (np.nan,) * 5)[j]
            rows.append((psi_m, bend, *counts, forward[i, j].mean(), published))
    header = ("psi_m (deg)", "d_psi (deg)", "landed", "yaw", "pitch", "roll")
    names = (*header, "mean forward (m)", "published (m)")
    write_table(options.out / "figure_5", names, rows)
    save_figure(bending_grid(data, "path"), options.out / "figure_5b.png")
    save_figure(bending_grid(data, "pitch"), options.out / "figure_5c.png")


if __name__ == "__main__":
    main()
