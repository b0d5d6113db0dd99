"""An end of one's own: the trunk of a tree that stands in the way."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxglide import AngleLimit, End, Gait, Glider, Ground, Launch, Polar, Snake, simulate


class Trunk(eqx.Module):
    """How far the centre of mass is from a trunk's bark [m]: positive in flight.

    Args:
        ahead: forward distance of its axis [m].
        radius: [m].
    """

    ahead: jax.Array = eqx.field(converter=jnp.asarray)
    radius: jax.Array = eqx.field(converter=jnp.asarray, default=0.2)

    def __call__(self, time, state):
        return jnp.hypot(state[0], state[1] - self.ahead) - self.radius


def main(height: float = 10.0) -> None:
    body = Snake.from_svl(nodes=60, node_set="gauss")
    glider = Glider(body, Gait.from_degrees(), Polar.smooth())
    for ahead in (0.1 * height, 10.0 * height):
        tree = End(Trunk(ahead, 0.05 * height), "reached the tree")
        print(simulate(glider, Launch(height), ends=(tree, Ground(), AngleLimit())))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
