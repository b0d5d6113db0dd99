"""A flight as an environment: pure `reset` and `step`, disturbed, sensed as an animal might."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.checks import check_integer, check_kind, check_range
from .._lib.numerics import sincos
from .._lib.types import Array, Bool, Float, Integer, Scalar
from ..body.sections import discretise
from ..flight.case import Case
from ..flight.dynamics import ANGLES, OMEGA, POSITION, RIGID, VELOCITY, Flight, Glider
from ..flight.ends import Outcome
from ..flight.launch import started, take_off
from .plant import INPUTS, STEP, Ended, Flying, Plant, actuated
from .policy import AbstractPolicy, Sensed

SAMPLES = 8
"""Samples in a cycle of the waves, by default."""


class Senses(eqx.Module):
    """How well a flight is sensed.

    Attributes:
        angle_noise: standard deviation of yaw, pitch, roll [rad].
        omega_noise: of the angular velocity [rad/s].
        resolution: to which angles are rounded [rad]; 0: they are not.
        velocity: whether velocity and height are sensed (static).
        delay: between a sample and the actuators' command, below an interval [s] (static).
        place: whether the horizontal position is sensed (static).
    """

    angle_noise: Scalar = eqx.field(converter=jnp.asarray, default=0.0)
    omega_noise: Scalar = eqx.field(converter=jnp.asarray, default=0.0)
    resolution: Scalar = eqx.field(converter=jnp.asarray, default=0.0)
    velocity: bool = eqx.field(static=True, default=False)
    delay: float = eqx.field(static=True, default=0.0)
    place: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        check_range("angle_noise", self.angle_noise, "rad", 0, 1, shape=())
        check_range("omega_noise", self.omega_noise, "rad/s", 0, 100, shape=())
        check_range("resolution", self.resolution, "rad", 0, 1, shape=())
        check_range("delay", self.delay, "s", 0, 1, shape=())


class Situation(NamedTuple):
    """Where an environment is.

    Attributes:
        plant: what flies, as it was drawn.
        flying: how far it is.
        sample: number of the sample.
        told: inputs told at the sample before, (6,).
        key: of what is random yet.
    """

    plant: Plant
    flying: Flying
    sample: Integer
    told: Float[Array, "6"]
    key: Array


class Moved(NamedTuple):
    """What a step gives.

    Attributes:
        situation: after it.
        sensed: there.
        reward: forward distance gained [m], less `fall` where the flight did not land.
        over: whether it has ended.
        landed: whether it has landed.
    """

    situation: Situation
    sensed: Sensed
    reward: Scalar
    over: Bool[Array, ""]
    landed: Bool[Array, ""]


class Environment(eqx.Module):
    """A case to be flown by a policy, sample by sample, drawn anew at every reset.

    Everything is pure: `jit`, `vmap` and derivatives apply.

    Args:
        case: glider with a `Gait`, launch and ends.
        inputs: which inputs are set; see `actuated`.
        samples: in a cycle of the waves, 1 to 64.
        vary: lowest and highest of any float of the case, by name, in the unit that people
            read: it is drawn between them.
        senses: how the flight is sensed; by default exactly, without velocity.
        fall: what a flight costs that ends otherwise than by landing [m].
        step: longest step of the solver [s].
        actuators: further arguments of `actuated`.

    Raises:
        TypeError: a part is of another type.
        ValueError: an unknown name, or a number out of range.

    Examples:
        >>> import jax
        >>> from jaxglide import Case, Environment, Gait, Glider, Launch, Polar, Snake
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(), Polar.smooth())
        >>> case = Case(glider, Launch(height=2.0))
        >>> flight = Environment(case, vary={"launch.speed": (1.5, 2.0)})
        >>> situation, sensed = flight.reset(jax.random.key(0))
        >>> moved = flight.step(situation, flight.plant.inputs)
        >>> print(f"{moved.situation.flying.time:.4f} s, {bool(moved.over)}")
        0.1042 s, False
    """

    case: Case
    held: Glider
    plant: Plant
    senses: Senses
    bounds: dict[str, Array]
    fall: Scalar
    chosen: tuple[int, ...] = eqx.field(static=True)

    def __init__(
        self,
        case: Case,
        inputs: Sequence[str] = ("d_psi", "d_theta"),
        *,
        samples: int = SAMPLES,
        vary: Mapping[str, tuple[float, float]] | None = None,
        senses: Senses | None = None,
        fall: float = 10.0,
        step: float = STEP,
        actuators: Mapping[str, Any] | None = None,
    ):
        check_kind("case", case, Case)
        check_integer("samples", samples, 1, 64)
        check_range("fall", fall, "m", 0, 1e4, shape=())
        gait: Any = case.glider.gait
        glider = actuated(case.glider, inputs, **dict(actuators or {}))
        if not float(gait.f_theta) > 0:
            raise ValueError("f_theta = 0 Hz is not allowed: samples are parts of a cycle")
        start = started(case.glider, case.launch)
        interval = 1 / (samples * float(gait.f_theta))
        self.senses = Senses() if senses is None else senses
        check_range("delay", self.senses.delay, "s", 0, interval, high_open=True)
        late = self.senses.delay / interval
        self.plant = Plant.of(glider, start.phi_theta, interval, case.ends, step, late)
        self.case, self.held = Case(glider, case.launch, case.ends), case.glider
        self.bounds = {}
        for name, ends in dict(vary or {}).items():
            self.case.check({name: ends})
            low, high = ends
            if not low <= high:
                raise ValueError(f"vary {name} = {ends}: the lowest is above the highest")
            self.bounds[self.case.path(name)] = jnp.asarray([low, high], float)
        self.fall = jnp.asarray(float(fall))
        self.chosen = tuple(INPUTS.index(name) for name in inputs)

    def drawn(self, key) -> dict[str, Scalar]:
        """What `vary` makes of a key: values by path, in the unit that people read.

        Args:
            key: of JAX's random numbers.
        """
        keys = jax.random.split(jax.random.split(key)[0], len(self.bounds) + 1)
        return {
            name: low + (high - low) * jax.random.uniform(one, dtype=low.dtype)
            for one, (name, (low, high)) in zip(keys[1:], self.bounds.items(), strict=True)
        }

    @eqx.filter_jit
    def reset(self, key) -> tuple[Situation, Sensed]:
        """A flight at its launch, drawn, and what is sensed there.

        Args:
            key: of JAX's random numbers.
        """
        values, later = self.drawn(key), jax.random.split(key)[1]
        case = self.case.replace(values) if values else self.case
        sections = discretise(case.glider.body)
        begun = take_off(case.glider, case.launch, sections)
        flight = Flight(case.glider, sections, begun.phi_theta)
        plant = dataclasses.replace(self.plant, flight=flight, ends=case.ends)
        none = jnp.zeros((), jnp.int32)
        flying = plant.launched(begun.state)
        situation = Situation(plant, flying, none, plant.inputs, later)
        return self._sense(situation)

    @eqx.filter_jit
    def step(self, situation: Situation, inputs: Float[Array, "6"]) -> Moved:
        """Fly on to the next sample.

        Args:
            situation: where it is.
            inputs: told to the actuators, (6,).
        """
        plant, before = situation.plant, situation.flying
        flying = plant.after_delay(before, situation.told, inputs)
        later = situation._replace(flying=flying, sample=situation.sample + 1, told=inputs)
        later, sensed = self._sense(later)
        gained = flying.state[POSITION][1] - before.state[POSITION][1]
        new = flying.over & ~before.over
        ended = plant.finish(jax.lax.stop_gradient(flying))
        landed = flying.over & (ended.outcome == Outcome.LANDED)
        reward = gained - jnp.where(new & ~landed, self.fall, 0.0)
        return Moved(later, sensed, reward, flying.over, landed)

    def _sense(self, situation: Situation) -> tuple[Situation, Sensed]:
        state, senses = situation.flying.state, self.senses
        mine, later = jax.random.split(situation.key)
        noise = jax.random.normal(mine, (6,), state.dtype)
        angles = state[ANGLES] + senses.angle_noise * noise[:3]
        grain = jnp.where(senses.resolution > 0, senses.resolution, 1.0)
        rounded = grain * jnp.round(angles / grain)
        angles = jnp.where(senses.resolution > 0, rounded, angles)
        s, c = sincos(state[ANGLES][0])
        x, y, z = state[VELOCITY]
        velocity = jnp.stack([x * c + y * s, y * c - x * s, z])
        height = state[2]
        if not senses.velocity:
            velocity, height = jnp.full_like(velocity, jnp.nan), jnp.full_like(height, jnp.nan)
        turns = state[RIGID + 2 * len(INPUTS)]
        sensed = Sensed(
            situation.sample,
            situation.plant.flight.phase - 2 * jnp.pi * turns,
            angles,
            state[OMEGA] + senses.omega_noise * noise[3:],
            velocity,
            height,
            state[RIGID : RIGID + len(INPUTS)],
            state[RIGID + len(INPUTS) :][: len(INPUTS)],
            situation.told,
            state[POSITION][:2] if senses.place else None,
        )
        return situation._replace(key=later), sensed


class Flown(NamedTuple):
    """A flight under a policy.

    Attributes:
        ended: how, where, when.
        times: of the samples [s], (N,).
        states: at the samples, of a flight that is over its last, (N, s).
        inputs: told there, (N, 6).
        over: whether it was over, (N,).
    """

    ended: Ended
    times: Float[Array, " N"]
    states: Float[Array, "N s"]
    inputs: Float[Array, "N 6"]
    over: Bool[Array, " N"]

    @property
    def landed(self) -> Bool[Array, "..."]:
        """Whether it reached the ground."""
        return self.ended.outcome == Outcome.LANDED


@eqx.filter_jit
def controlled_flight(
    environment: Environment, policy: AbstractPolicy, key, samples: int
) -> Flown:
    """A whole flight, or so many samples of it.

    Args:
        environment: what flies.
        policy: what sets its inputs.
        key: of JAX's random numbers.
        samples: most of them.
    """
    situation, sensed = environment.reset(key)
    last = jax.tree.map(jnp.zeros_like, (situation.flying.state, situation.told))
    shapes = {
        "times": jnp.zeros(samples, situation.flying.time.dtype),
        "states": jnp.zeros((samples, *last[0].shape), last[0].dtype),
        "inputs": jnp.zeros((samples, *last[1].shape), last[1].dtype),
        "over": jnp.ones(samples, bool),
    }

    def going(carry):
        k, situation, *_ = carry
        return (k < samples) & ~situation.flying.over

    def on(carry):
        k, situation, sensed, memory, kept = carry
        inputs, memory = policy(memory, sensed)
        flying = situation.flying
        now = {
            "times": flying.time,
            "states": flying.state,
            "inputs": inputs,
            "over": flying.over,
        }
        kept = {name: values.at[k].set(now[name]) for name, values in kept.items()}
        moved = environment.step(situation, inputs)
        return k + 1, moved.situation, moved.sensed, memory, kept

    none = jnp.zeros((), jnp.int32)
    carry = none, situation, sensed, policy.start(), shapes
    _, situation, _, _, kept = jax.lax.while_loop(going, on, carry)
    return Flown(situation.plant.finish(situation.flying), **kept)
