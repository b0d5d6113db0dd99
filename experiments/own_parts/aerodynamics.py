"""An aerodynamic model of one's own: sweep theory, and friction of the air along the body."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxglide import (
    AbstractAerodynamics,
    Gait,
    Glider,
    Launch,
    Polar,
    Snake,
    SweepTheory,
    simulate,
)


class WithFriction(AbstractAerodynamics):
    """A model of the force normal to the body, and friction on both of its faces.

    Args:
        normal: the model of the normal force, own states and all.
        friction_coefficient: of the velocity along the body.
    """

    normal: AbstractAerodynamics
    friction_coefficient: jax.Array = eqx.field(converter=jnp.asarray, default=0.01)

    def start(self, flow):
        return self.normal.start(flow)

    def __call__(self, flow, states):
        air, rates = self.normal(flow, states)
        along = jnp.sum(flow.velocity * flow.tangent, axis=0)
        pressure = 0.5 * flow.air_density * jnp.abs(along) * along
        friction = self.friction_coefficient * pressure * 2 * flow.area
        return dataclasses.replace(air, force=air.force - friction * flow.tangent), rates


def main(height: float = 10.0) -> None:
    body, gait = Snake.from_svl(nodes=60, node_set="gauss"), Gait.from_degrees()
    sweep_theory = SweepTheory(Polar.smooth())
    for model in (sweep_theory, WithFriction(sweep_theory, 0.02)):
        print(simulate(Glider(body, gait, model), Launch(height)))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
