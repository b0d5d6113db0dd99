"""Laws that are trained: gains that change with the time since launch, and a small network.

Both start from a law that flies already, and add to it what they have learnt.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import as_array, check_integer, check_kind, check_range
from .._lib.types import Array, Float
from ..steady.reduced import scales
from .environment import Environment
from .plant import limits
from .policy import AbstractPolicy, Sensed, observed
from .regulator import SENSED, Regulator

TURNS = (0.0, 2.0, 4.0, 8.0)
"""Cycles since launch at which gains stand, by default; the last ones hold from there on."""


class GainScheduled(AbstractPolicy):
    """A regulator whose gains, observer and inputs change with the time since launch.

    Between the knots they change linearly. What is learnt adds to the regulator's own, in
    scaled units: half a range for inputs, about what is usual for a state.

    Attributes:
        regulator: where it starts, with what it knows of the glide.
        knots: cycles since launch, (m,).
        unit: of the controlled state, (n,).
        half: half of the ranges of the inputs, (c,).
        feedback: added to the gains, (m, N, c, n), of N rows of the regulator.
        observer: added to the observer's, (m, N, n, p), or None.
        forward: added to the inputs, (m, N, c).
    """

    regulator: Regulator
    knots: Float[Array, " m"]
    unit: Float[Array, " n"]
    half: Float[Array, " c"]
    feedback: Float[Array, "m N c n"]
    observer: Float[Array, "m N n p"] | None
    forward: Float[Array, "m N c"]
    learns: ClassVar[tuple[str, ...]] = ("feedback", "observer", "forward")

    @classmethod
    def of(
        cls, environment: Environment, regulator: Regulator, knots: Sequence[float] = TURNS
    ) -> "GainScheduled":
        """The regulator of an environment, which has learnt nothing yet.

        Args:
            environment: what will fly.
            regulator: see `linear_quadratic`.
            knots: cycles since launch at which gains stand, ascending, from 0 on.

        Raises:
            TypeError: a part is of another type.
            ValueError: the knots do not ascend from 0.
        """
        check_kind("environment", environment, Environment)
        check_kind("regulator", regulator, Regulator)
        at = as_array("knots", knots)
        check_range("knots", at, "cycles", 0, 1e4)
        if at[0] != 0 or (np.diff(at) <= 0).any():
            raise ValueError(f"knots = {tuple(knots)} is not allowed: they ascend from 0")
        half = _half(environment)
        scale = scales(environment.held, environment.plant.flight.sections)
        actuators: Any = environment.plant.drive
        rate = jnp.asarray(actuators.rate_limit)[np.array(environment.chosen)] / 2
        unit = jnp.concatenate([scale, jnp.ones(1), half, rate, half])
        m, K, L = len(at), regulator.K, regulator.L
        seen = None if L is None else jnp.zeros((m, *L.shape))
        none = jnp.zeros((m, *K.shape)), seen, jnp.zeros((m, *K.shape[:2]))
        return cls(regulator, jnp.asarray(at, float), unit, half, *none)

    def start(self):
        return self.regulator.start()

    def __call__(self, memory, sensed: Sensed):
        known = self.regulator
        k, _ = known.place(sensed.sample)
        cycles = sensed.sample / (known.K.shape[0] - known.launch)
        share = jax.vmap(lambda at: jnp.interp(cycles, self.knots, at), 1)(
            jnp.eye(len(self.knots))
        )
        if self.observer is not None and known.L is not None:
            learnt = jnp.tensordot(share, self.observer[:, k], 1)
            learnt = learnt * self.unit[:, None] / self.unit[SENSED.start :]
            known = eqx.tree_at(lambda r: r.L, known, known.L.at[k].add(learnt))
        apart = known.estimate(memory, sensed)
        feedback = jnp.tensordot(share, self.feedback[:, k], 1) @ (apart / self.unit)
        forward = jnp.tensordot(share, self.forward[:, k], 1)
        change = self.half * (forward - feedback) - known.K[k] @ apart
        return known.within(k, change), apart


class NeuralPolicy(AbstractPolicy):
    """A small network that adds to what another law wants.

    It sees what a snake might (see `observed`: the waves' phase, attitude, angular velocity,
    actuators), now and at a few samples before, and what the other law wants.

    Attributes:
        base: the other law.
        network: from all that to shares of half a range.
        middle, half: of the ranges of the inputs that are set, (c,).
        low, high: limits of these, (c,).
        chosen: which inputs are set (static).
    """

    base: AbstractPolicy
    network: eqx.nn.MLP
    middle: Float[Array, " c"]
    half: Float[Array, " c"]
    low: Float[Array, " c"]
    high: Float[Array, " c"]
    chosen: tuple[int, ...] = eqx.field(static=True)
    learns: ClassVar[tuple[str, ...]] = ("network",)

    @classmethod
    def of(
        cls,
        environment: Environment,
        base: AbstractPolicy,
        *,
        width: int = 32,
        depth: int = 2,
        history: int = 4,
        seed: int = 0,
    ) -> "NeuralPolicy":
        """A network that adds nothing yet.

        Args:
            environment: what will fly.
            base: law that it adds to, a regulator or a `Constant`.
            width: of a layer, 1 to 1,000.
            depth: layers between, 1 to 10.
            history: samples that are seen, 1 to 100.
            seed: of the weights.

        Raises:
            TypeError: a part is of another type.
            ValueError: a number out of range.
        """
        check_kind("environment", environment, Environment)
        check_kind("base", base, AbstractPolicy)
        check_integer("width", width, 1, 1000)
        check_integer("depth", depth, 1, 10)
        check_integer("history", history, 1, 100)
        count = len(environment.chosen)
        size = history * (8 + 2 * count) + count
        key = jax.random.key(seed)
        network = eqx.nn.MLP(size, count, width, depth, activation=jnp.tanh, key=key)
        last: Any = network.layers[-1]
        network = eqx.tree_at(
            lambda n: (n.layers[-1].weight, n.layers[-1].bias),
            network,
            (jnp.zeros_like(last.weight), jnp.zeros_like(last.bias)),
        )
        low, high = limits(environment.plant.drive, environment.chosen)
        half = _half(environment)
        return cls(base, network, (low + high) / 2, half, low, high, environment.chosen)

    def start(self):
        count = len(self.chosen)
        size = 8 + 2 * count
        history = (self.network.layers[0].weight.shape[1] - count) // size
        return self.base.start(), jnp.zeros((history, size))

    def __call__(self, memory, sensed: Sensed):
        told, own = self.base(memory[0], sensed)
        index = jnp.array(self.chosen)
        now, before = observed(sensed, self.chosen), memory[1]
        seen = jnp.roll(before, 1, axis=0).at[0].set(now)
        seen = jnp.where(sensed.sample == 0, now, seen)  # it has stood there until now
        wanted = (told[index] - self.middle) / self.half
        added = self.network(jnp.concatenate([seen.ravel(), wanted]))
        inputs = jnp.clip(told[index] + self.half * added, self.low, self.high)
        return told.at[index].set(inputs), (own, seen)


def _half(environment: Environment) -> Array:
    drive: Any = environment.plant.drive
    return ((drive.high - drive.low) / 2)[np.array(environment.chosen)]
