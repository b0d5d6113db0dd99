"""The reduced state of a flight, its rates, and the map from one cycle to the next.

The equations of motion do not change under a shift of the place or a turn about the
vertical, in still air or in a uniform wind. Eight numbers therefore evolve by themselves:

| index | what | unit |
| --- | --- | --- |
| 0:3 | velocity through the air, heading axes: right, forward, up | m/s |
| 3:6 | angular velocity, body axes | rad/s |
| 6:8 | pitch, roll | rad |

Heading axes are the inertial ones turned by the yaw.
"""

from typing import NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.numerics import sincos
from .._lib.types import Array, Float, Scalar, State
from ..body.sections import Sections
from ..flight.dynamics import (
    ANGLES,
    OMEGA,
    RIGID,
    VELOCITY,
    Flight,
    Glider,
    six_degrees_of_freedom,
)
from ..flight.solve import FirstStep

SIZE = 8
"""How many numbers the reduced state has."""
COMPONENTS = ("v_right", "v_forward", "v_up", "omega_x", "omega_y", "omega_z", "pitch", "roll")
"""Their names."""
MIRROR = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0])
"""Signs that the mirror image in x gives them."""

SAMPLES = 64
"""Into how many parts a flown cycle is divided."""
MOST_STEPS = 16384
"""Most steps of the solver in the time of a map."""

Reduced = Float[Array, "8"]
Slopes = Float[Array, "8 8"]


def embed(reduced: Reduced) -> Float[Array, "13"]:
    """A state of flight (see `dynamics`) at the origin, of yaw 0, with a reduced state."""
    zero = jnp.zeros_like(reduced[:1])
    none = jnp.zeros_like(reduced[:3])
    return jnp.concatenate([none, reduced[:6], zero, reduced[6:], zero])


def reduce(state: Float[Array, "13"]) -> Reduced:
    """The reduced state of a state of flight."""
    s, c = sincos(state[ANGLES][0])
    x, y, z = state[VELOCITY]
    heading = jnp.stack([x * c + y * s, y * c - x * s, z])
    return jnp.concatenate([heading, state[OMEGA], state[ANGLES][1:]])


def rates(time: Scalar, reduced: Reduced, flight: Flight) -> Reduced:
    """Rates of the reduced state.

    Args:
        time: since the start [s].
        reduced: the reduced state, (8,).
        flight: glider in still air, sections and phase.
    """
    state = embed(reduced)
    rate = six_degrees_of_freedom(time, state, flight)
    return jax.jvp(reduce, (state,), (rate,))[1]


def scales(glider: Glider, sections: Sections) -> Reduced:
    """What the eight numbers are measured in, where one number is to stand for all.

    sqrt(2 m g/(density area)) for velocities, that over the length for rates of turning, a
    radian for angles. No derivative passes through them.
    """
    weight = sections.total_mass * glider.gravity
    speed = jnp.sqrt(2 * weight / (glider.air.air_density * jnp.sum(sections.area)))
    turning, one = speed / sections.length, jnp.ones_like(speed)
    parts = [speed] * 3 + [turning] * 3 + [one] * 2
    return jax.lax.stop_gradient(jnp.stack(parts))


class ReturnMap(NamedTuple):
    """What a map needs.

    Attributes:
        flight: glider in still air, sections and phase at the start.
        steps: of the solver in the time of a map.
    """

    flight: Flight
    steps: Scalar


def _solved(field, start, cycle: ReturnMap, adjoint, count: int = 1):
    """The solution of a field at `count` equally spaced times up to 1, by equal steps.

    Adaptive ones change from one start to the next, which leaves a noise of 1e-7 in the map;
    by equal ones the map is smooth, and its derivative exact.
    """
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),  # type: ignore
        diffrax.Dopri5(),
        t0=0.0,
        t1=1.0,
        dt0=None,
        y0=start,
        args=cycle.flight,
        stepsize_controller=FirstStep(diffrax.ConstantStepSize(), 1 / cycle.steps),
        saveat=diffrax.SaveAt(ts=jnp.linspace(0.0, 1.0, count + 1)[1:]),
        adjoint=adjoint,
        max_steps=MOST_STEPS,
        throw=False,
    )
    assert solution.ys is not None
    return solution.ys


def flown(
    reduced: Reduced,
    duration: Scalar,
    cycle: ReturnMap,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> tuple[Reduced, Float[Array, "C 13"]]:
    """The map P_t: where a flight is after a time, and how it got there.

    Args:
        reduced: its reduced state at the start, (8,).
        duration: t [s].
        cycle: what flies.
        adjoint: how Diffrax differentiates; by default in forward mode.

    Returns:
        The reduced state at the end, (8,), and states of flight (see `dynamics`) at equally
        spaced times, the first and the last included, from the origin and yaw 0, (C, 13).
    """

    def field(tau, state, flight):
        return duration * six_degrees_of_freedom(duration * tau, state, flight)

    adjoint = diffrax.ForwardMode() if adjoint is None else adjoint
    start = embed(reduced)
    states = _solved(field, start, cycle, adjoint, SAMPLES)
    return reduce(states[-1]), jnp.concatenate([start[None], states])


def ended(
    reduced: Reduced, duration: Scalar, cycle: ReturnMap, adjoint: diffrax.AbstractAdjoint
) -> State:
    """The state of flight (see `dynamics`) at the end of a map, without the way there, (13,).

    Args:
        reduced, duration, cycle, adjoint: as in `flown`.
    """

    def field(tau, state, flight):
        return duration * six_degrees_of_freedom(duration * tau, state, flight)

    return _solved(field, embed(reduced), cycle, adjoint)[-1]


def ended_with_slopes(
    reduced: Reduced, duration: Scalar, cycle: ReturnMap, adjoint: diffrax.AbstractAdjoint
) -> tuple[State, Slopes]:
    """The same, and the derivative of the map by the reduced state, (13,) and (8, 8).

    The variational equations are solved beside the flight's. So the derivative is a plain
    solution, which can be differentiated again in either mode.

    Args:
        reduced, duration, cycle, adjoint: as in `flown`.
    """

    def field(tau, y, flight):
        state, tangents = y

        def at(state):
            return duration * six_degrees_of_freedom(duration * tau, state, flight)

        rate, along = jax.vmap(lambda d: jax.jvp(at, (state,), (d,)), out_axes=(None, 0))(
            tangents
        )
        return rate, along

    tangents = jnp.zeros((SIZE, RIGID), reduced.dtype)
    tangents = tangents.at[jnp.arange(SIZE), jnp.array([3, 4, 5, 6, 7, 8, 10, 11])].set(1.0)
    solved = _solved(field, (embed(reduced), tangents), cycle, adjoint)
    end, along = jax.tree.map(lambda y: y[-1], solved)
    slopes = jax.vmap(lambda d: jax.jvp(reduce, (end,), (d,))[1])(along)
    return end, slopes.T


def flown_with_slopes(
    reduced: Reduced,
    duration: Scalar,
    cycle: ReturnMap,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> tuple[Reduced, Slopes]:
    """The map P_t with its derivative by the reduced state, (8,) and (8, 8).

    Args:
        reduced, duration, cycle, adjoint: as in `flown`.
    """
    adjoint = diffrax.ForwardMode() if adjoint is None else adjoint
    end, slopes = ended_with_slopes(reduced, duration, cycle, adjoint)
    return reduce(end), slopes
