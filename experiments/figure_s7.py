"""Figure S7: force coefficients of a body section, as published and as a smooth spline."""

from common import arguments, save_figure, write_table  # first: it sets up JAX

# isort: split
import jax.numpy as jnp
import numpy as np

from jaxglide import Polar
from jaxglide.loads.coefficients import REYNOLDS
from jaxglide.plot import force_coefficients

ANGLES = np.arange(0.0, 60.5, 0.5)  # deg
POLARS = {"published": Polar.published(), "smooth": Polar.smooth()}


def main() -> None:
    options = arguments(__doc__)
    rows = []
    for name, polar in POLARS.items():
        for number in REYNOLDS:
            angle = jnp.deg2rad(ANGLES)
            lift, drag = (np.asarray(c) for c in polar(angle, jnp.full(angle.shape, number)))
            most, best = int(np.argmax(lift)), int(np.argmax(lift / drag))
            row = (lift[most], ANGLES[most], (lift / drag)[best], ANGLES[best])
            rows.append((name, int(number), *map(float, row)))
    header = ("polar", "Re", "most C_L", "at (deg)", "most C_L/C_D", "there (deg)")
    write_table(options.out / "figure_s7", header, rows)
    save_figure(force_coefficients(POLARS), options.out / "figure_s7.png")


if __name__ == "__main__":
    main()
