"""A gust of one's own: a column of rising air, with sinking air around it."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxglide import (
    AbstractAir,
    Gait,
    Glider,
    Launch,
    Polar,
    Snake,
    StillAir,
    about,
    floats,
    simulate,
)


class Thermal(AbstractAir):
    """Vertical wind w (1 - r^2) exp(-r^2), with r the distance from the axis over a radius.

    As much air sinks as rises. Density and viscosity come with `AbstractAir`.

    Args:
        strength: on the axis, upwards [m/s].
        ahead: forward distance of the axis [m].
        radius: [m].
    """

    # its unit and range make a number one to sweep, to search, and to check
    strength: jax.Array = eqx.field(
        converter=floats, metadata=about("m/s", "strength of the thermal", low=-50, high=50)
    )
    ahead: jax.Array = eqx.field(
        converter=floats, default=2.0, metadata=about("m", "forward distance of the thermal")
    )
    radius: jax.Array = eqx.field(
        converter=floats,
        default=1.5,
        metadata=about("m", "radius of the thermal", low=0, high=1e4, low_open=True),
    )

    def wind(self, position, time):
        x, y, _ = position
        r2 = (x**2 + (y - self.ahead) ** 2) / self.radius**2
        level = jnp.zeros_like(x)
        return jnp.stack([level, level, self.strength * (1 - r2) * jnp.exp(-r2)])


def main(height: float = 10.0) -> None:
    body = Snake.from_svl(nodes=60, node_set="gauss")
    for air in (StillAir(), Thermal(strength=2.0)):
        print(simulate(Glider(body, Gait.from_degrees(), Polar.smooth(), air), Launch(height)))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
