"""A law of one's own: the tail's bend answers to pitch, through actuators with limits."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxglide import (
    AbstractLaw,
    Actuated,
    Driven,
    Gait,
    Glider,
    Launch,
    Polar,
    Serpenoid,
    Snake,
    simulate,
)

INPUTS = ("theta_m", "psi_m", "nu_theta", "d_psi", "d_theta", "f_theta")


class PitchHold(AbstractLaw):
    """The inputs of a gait, but for d_psi, which leans against pitch and its rate.

    Args:
        gait: at the wanted pitch.
        gain: of d_psi by pitch [1/SVL].
        rate_gain: of d_psi by the rate of pitch [s/SVL].
        pitch: wanted [rad].
    """

    gait: Gait
    gain: jax.Array = eqx.field(converter=jnp.asarray, default=0.3)
    rate_gain: jax.Array = eqx.field(converter=jnp.asarray, default=0.05)
    pitch: jax.Array = eqx.field(converter=jnp.asarray, default=-0.3)

    def __call__(self, time, observation):
        inputs = jnp.stack([getattr(self.gait, name) for name in INPUTS])
        error = observation.angles[1] - self.pitch
        answer = self.gain * error + self.rate_gain * observation.omega[0]
        return inputs.at[INPUTS.index("d_psi")].add(-answer)


def held(gait: Gait, gain=0.3) -> Driven:
    """The serpenoid waves under the law, by actuators of 4 Hz that bend at most so fast."""
    fastest = [2.0, 2.0, 0.5, 1.0, 1.0, 2.0]  # rad/s, but waves/s and Hz/s
    drive = Actuated(PitchHold(gait, gain), gait, 2 * jnp.pi * 4.0, rate_limit=fastest)
    return Driven(Serpenoid(), drive)


def main(height: float = 10.0) -> None:
    body, gait = Snake.from_svl(nodes=60, node_set="gauss"), Gait.from_degrees()
    for gain in (0.0, 0.3):
        print(simulate(Glider(body, held(gait, gain), Polar.smooth()), Launch(height)))


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
