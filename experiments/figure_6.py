"""Figure 6: moments of the air and of the body's inertia in held glides.

The paper does not say which case its panels a and b show: here it is the published gait
(nu_theta 1.4, d_psi 10 deg, psi_m 20 deg), also the black line of c.
"""

from itertools import product

import numpy as np
import xarray as xr
from common import arguments, save_figure, write_table

from jaxglide.ensemble.published import BENDS, bending_study
from jaxglide.ensemble.survey import ABOUT, survey
from jaxglide.plot import moment_ratio, moments_in_time

CASE = {"psi_m": 20.0, "d_psi": 10.0, "nu_theta": 1.4}
CYCLE = 1 / 1.2  # s


def of_the_case(one: xr.Dataset) -> list[tuple]:
    """About each axis: moments in N mm, and when inertia last exceeds the air [s]."""
    rows = []
    for turn in ABOUT:
        here = one.sel(about=turn)
        launch, cycle = here.isel(record=0), here.sel(record=CYCLE, method="nearest")
        landing = here.isel(record=one["last"])
        ranges = [float(x.aerodynamic_range) for x in (launch, cycle, landing)]
        above = here.record.values[here.inertial_ratio.values > 1]
        inertial, mean = float(landing.inertial_range), round(float(landing.mean_moment), 9)
        rows.append((turn, *ranges, mean + 0.0, inertial, float(above[-1])))
    return rows


def ratios(held: xr.Dataset) -> list[tuple]:
    """Inertial over aerodynamic peak-to-peak by axis and bend, over the eleven shapes."""
    ratio, rows = held.inertial_ratio, []
    when = (
        ratio.isel(record=0),
        ratio.sel(record=CYCLE, method="nearest"),
        ratio.isel(record=held["last"]),
    )
    for turn, bend in product(ABOUT, BENDS):
        shapes = np.flatnonzero(held.d_psi == bend)
        at = [r.sel(about=turn).isel(case=shapes).values for r in when]
        least = float(ratio.sel(about=turn).isel(case=shapes).min())
        medians = [float(np.median(values)) for values in at]
        ends = float(at[-1].min()), float(at[-1].max())
        rows.append((turn, float(bend), *medians, *ends, least, int((at[-1] > 1).sum())))
    return rows


def main() -> None:
    options = arguments(__doc__)
    held = survey(bending_study((20.0,), times=None))
    chosen = (held.d_psi == CASE["d_psi"]) & np.isclose(held.nu_theta, CASE["nu_theta"])
    one = held.isel(case=int(np.flatnonzero(chosen)[0]))
    air = [f"air p-p, {when} (N mm)" for when in ("launch", "one cycle", "landing")]
    header = (
        "about",
        *air,
        "mean, landing (N mm)",
        "inertia p-p (N mm)",
        "inertia above until (s)",
    )
    write_table(options.out / "figure_6ab", header, of_the_case(one))
    medians = [f"median, {when}" for when in ("launch", "one cycle", "landing")]
    ends = ("lowest, landing", "highest, landing", "least", "above 1 at landing, of 11")
    write_table(
        options.out / "figure_6c", ("about", "d_psi (deg)", *medians, *ends), ratios(held)
    )
    save_figure(moments_in_time(held, CASE), options.out / "figure_6ab.png")
    save_figure(moment_ratio(held, 20.0, case=CASE), options.out / "figure_6c.png")


if __name__ == "__main__":
    main()
