"""Sensitivity to the force coefficients: the line of shapes with 1.36 C_L and 0.6 C_D."""

from common import arguments, save_figure, write_table

from jaxglide import Outcome
from jaxglide.ensemble.published import BENDS, bending_study
from jaxglide.ensemble.sweep import sweep
from jaxglide.plot import bending_grid

CASES = {"published": (1.0, 1.0), "more_lift": (1.36, 1.0), "more_lift_less_drag": (1.36, 0.6)}


def main() -> None:
    options = arguments(__doc__)
    rows = []
    for name, (lift, drag) in CASES.items():
        study = bending_study((20.0,), fixed={"lift_scale": lift, "drag_scale": drag})
        data = sweep(study, options.store(f"force_{name}"))
        forward = data.landing_point.sel(axis="y").values.reshape(5, 11)
        landed = (data.outcome.values == Outcome.LANDED).reshape(5, 11)
        for j, bend in enumerate(BENDS):
            rows.append((lift, drag, bend, int(landed[j].sum()), forward[j].mean()))
        save_figure(bending_grid(data, "path"), options.out / f"force_{name}.png")
    header = ("C_L times", "C_D times", "d_psi (deg)", "landed of 11", "mean forward (m)")
    write_table(options.out / "force_coefficients", header, rows)


if __name__ == "__main__":
    main()
