"""Another waveform: a lateral wave that grows towards the tail, written as one function."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxglide import Driven, Gait, Glider, Launch, Polar, Running, Snake, Waveform, simulate


class Eel(eqx.Module):
    """Bending angles of a sine with more amplitude behind; its float is a parameter.

    Args:
        growth: of the amplitude from snout to vent, in shares of that at the middle.
    """

    growth: jax.Array = eqx.field(converter=jnp.asarray, default=0.5)

    def __call__(self, x, q):
        amplitude, waves, bend, phase = q
        theta = (
            amplitude * (1 + self.growth * (x - 0.5)) * jnp.sin(2 * jnp.pi * waves * x + phase)
        )
        return theta, bend * x


def eel(growth=0.5) -> Driven:
    """The wave at 1.2 Hz; velocities and accelerations of the body come from JAX."""
    shape = Waveform(Eel(growth), ("amplitude", "waves", "bend", "phase"))
    return Driven(shape, Running([1.6, 1.4, jnp.deg2rad(10.0), 1.2]))


def main(height: float = 10.0) -> None:
    body = Snake.from_svl(nodes=60, node_set="gauss")
    for gait in (Gait.from_degrees(), eel()):
        print(simulate(Glider(body, gait, Polar.smooth()), Launch(height)))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
