"""A robot: a body by its own tables, with a battery and two motors fixed to it."""

import jax
import jax.numpy as jnp

from jaxglide import Gait, Glider, Launch, Polar, TabulatedBody, discretise, simulate


def robot(battery=0.28) -> TabulatedBody:
    """0.8 m of tube with a flat belly; the battery sits so far from its front end [m].

    `TabulatedBody.from_csv` reads the same from a file.
    """
    return TabulatedBody(
        position=[0.0, 0.05, 0.4, 0.7, 0.8],  # m
        chord=[0.02, 0.04, 0.05, 0.04, 0.02],  # m
        density=[0.03, 0.03, 0.04, 0.03, 0.02],  # kg/m
        point_position=jnp.stack(
            [jnp.asarray(battery, float), jnp.asarray(0.1), jnp.asarray(0.6)]
        ),
        point_mass=[0.015, 0.004, 0.004],  # kg
        neck_fraction=0.08,
        nodes=60,
        node_set="gauss",
    )


def main(height: float = 10.0) -> None:
    for battery in (0.28, 0.36):
        body = robot(battery)
        sections = discretise(body)
        centre = float(jnp.sum(sections.mass * sections.fraction) / body.mass * body.length)
        print(f"battery at {battery:.2f} m, centre of mass at {centre:.3f} m")
        print(simulate(Glider(body, Gait.from_degrees(), Polar.smooth()), Launch(height)))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
