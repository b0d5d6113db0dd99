"""A polar of one's own: a flat plate, in closed form, in place of the measured section."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxglide import AbstractPolar, Gait, Glider, Launch, Polar, Snake, about, floats, simulate


class Plate(AbstractPolar):
    """C_L = lift sin 2b and C_D = friction + drag sin^2 b at an angle of attack b.

    At every angle: from behind, the plate is what it is from the front.

    Args:
        lift: C_L at 45 degrees.
        drag: C_D across the flow, above that along it.
        friction: C_D along the flow.
    """

    lift: jax.Array = eqx.field(
        converter=floats, default=1.2, metadata=about("", "lift of the plate", low=0, high=10)
    )
    drag: jax.Array = eqx.field(
        converter=floats, default=1.8, metadata=about("", "drag of the plate", low=0, high=10)
    )
    friction: jax.Array = eqx.field(
        converter=floats, default=0.1, metadata=about("", "its friction", low=0, high=10)
    )

    def __call__(self, beta, reynolds):
        return (
            self.lift * jnp.sin(2 * beta),
            self.friction + self.drag * jnp.sin(beta) ** 2,
        )


def main(height: float = 10.0) -> None:
    body = Snake.from_svl(nodes=60, node_set="gauss")
    for polar in (Polar.smooth(), Plate()):
        print(simulate(Glider(body, Gait.from_degrees(), polar), Launch(height)))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
