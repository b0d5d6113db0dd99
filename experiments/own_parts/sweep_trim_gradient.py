"""A sweep, a trim and a gradient over floats of parts that are one's own."""

import jax
import jax.numpy as jnp
import numpy as np
from aerodynamics import WithFriction
from robot import robot
from waveform import eel

from jaxglide import Case, Glider, Launch, Polar, Study, SweepTheory, simulate, sweep, trim


def main(height: float = 5.0) -> None:
    model = WithFriction(SweepTheory(Polar.smooth()))
    glider, launch = Glider(robot(), eel(), model), Launch(height)

    # every float of them has a name: its path, or the last of it where that is unique
    grid = {"growth": np.linspace(0.0, 1.0, 4), "friction_coefficient": [0.0, 0.02]}
    data = sweep(Study(grid, glider=glider, launch=launch))
    print(data.landing_point.sel(axis="y").to_pandas().round(3))

    battery = "body.point_position[0]"
    print(trim(glider, battery, (0.1, 0.6), launch=launch, points=5))

    @jax.jit
    @jax.grad
    def gradient(values):
        case = Case(glider, launch).replace(values)
        return simulate(case.glider, case.launch).landing_point[1]

    slopes = gradient({"growth": jnp.asarray(0.5), battery: jnp.asarray(0.28)})
    for name, slope in slopes.items():
        print(f"forward distance by {name}: {float(slope):+.3f} m per unit")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
