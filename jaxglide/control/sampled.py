"""The return map with inputs, sampled: what a linear law is made of.

The state that is controlled is the reduced state of a flight (see `steady.reduced`) with its
yaw, and the states of the c actuators that are set: velocity in heading axes, angular velocity,
pitch, roll, yaw, positions, rates, and what they were told at the sample before, which holds
until new inputs arrive: n = 9 + 3 c numbers.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.numerics import sincos
from .._lib.types import Array, Float, State
from ..flight.dynamics import ANGLES, OMEGA, RIGID, VELOCITY
from .plant import INPUTS, Plant

YAW = 8
"""Where the yaw is in a controlled state."""


def controlled_state(state: State, told, chosen: tuple[int, ...]) -> Float[Array, " n"]:
    """The controlled state of a state of flight (s,), and of what was told, (c,)."""
    index = np.array(chosen)
    s, c = sincos(state[ANGLES][0])
    x, y, z = state[VELOCITY]
    heading = jnp.stack([x * c + y * s, y * c - x * s, z])
    own = state[RIGID:][index], state[RIGID + len(INPUTS) :][index], told
    return jnp.concatenate([heading, state[OMEGA], jnp.roll(state[ANGLES], -1), *own])


def flight_state(
    controlled: Float[Array, " n"], time, plant: Plant, chosen: tuple[int, ...]
) -> State:
    """A state of flight at the origin with a controlled state; other actuators at rest."""
    index, m = np.array(chosen), len(INPUTS)
    pitch, roll, yaw = controlled[6:9]
    s, c = sincos(yaw)
    right, forward, up = controlled[:3]
    velocity = jnp.stack([right * c - forward * s, forward * c + right * s, up])
    position, rates, _ = jnp.split(controlled[9:], 3)
    none = jnp.zeros(3)
    own = jnp.concatenate([plant.inputs, jnp.zeros(m), (plant.inputs[-1] * time)[None]])
    own = own.at[index].set(position).at[m + index].set(rates)
    angles = jnp.stack([yaw, pitch, roll])
    return jnp.concatenate([none, velocity, controlled[3:6], angles, none[:1], own])


def next_state(
    controlled, inputs, time, plant: Plant, chosen: tuple[int, ...]
) -> Float[Array, " n"]:
    """The controlled state an interval later.

    Args:
        controlled: at the sample, (n,).
        inputs: the chosen ones, held, (c,).
        time: of the sample since launch [s].
        plant: what flies; its ends are not looked at.
        chosen: which inputs are set.
    """
    plant = eqx.tree_at(lambda p: p.ends, plant, ())
    start = flight_state(controlled, time, plant, chosen)
    flying = plant.launched(start)._replace(time=time)
    index = np.array(chosen)
    before = plant.inputs.at[index].set(controlled[-len(chosen) :])
    flown = plant.after_delay(flying, before, plant.inputs.at[index].set(inputs))
    return controlled_state(flown.state, inputs, chosen)


class Linear(NamedTuple):
    """x_{k+1} - x*_{k+1} = A_k (x_k - x*_k) + B_k (u_k - u*_k), of N samples.

    Attributes:
        states: x*, (N, n).
        A: (N, n, n).
        B: (N, n, c).
    """

    states: Float[Array, "N n"]
    A: Float[Array, "N n n"]
    B: Float[Array, "N n c"]


class SampledPath(NamedTuple):
    """A flight at the samples.

    Attributes:
        states: controlled states, (M + 1, n).
        inputs: the chosen ones, told there, (M, c).
    """

    states: Float[Array, "M+1 n"]
    inputs: Float[Array, "M c"]


@eqx.filter_jit
def linearised(start, plant: Plant, chosen: tuple[int, ...], samples: int) -> Linear:
    """Along the flight from a controlled state (n,), the chosen inputs held; exact."""
    held = plant.inputs[np.array(chosen)]
    times = plant.interval * jnp.arange(samples)

    def on(x, time):
        return next_state(x, held, time, plant, chosen), x

    states = jax.lax.scan(on, start, times)[1]

    def slopes(x, time):
        return jax.jacfwd(lambda x, u: next_state(x, u, time, plant, chosen), argnums=(0, 1))(
            x, held
        )

    A, B = jax.lax.map(lambda at: slopes(*at), (states, times))
    return Linear(states, A, B)


def start_of(state, plant: Plant, chosen: tuple[int, ...]) -> Float[Array, " n"]:
    """The controlled state of a reduced one (8,), of yaw 0, its actuators at rest."""
    index = np.array(chosen)
    held = plant.inputs[index]
    return jnp.concatenate([state, jnp.zeros(1), held, 0 * held, held])
