"""A policy with the environment that it is for: what a file of a controller holds."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_kind
from ..flight.case import Case
from ..flight.dynamics import six_degrees_of_freedom
from .environment import Environment
from .plant import INPUTS
from .policy import AbstractPolicy

_SAME = 1e-4  # by which share the rates of one model may differ from machine to machine


class Controller(eqx.Module):
    """A policy, and the environment that it was made for.

    `save` writes it as data, `open` reads it.

    Args:
        policy: what sets the inputs.
        environment: what flies.

    Raises:
        TypeError: a part is of another type.
        ValueError: the policy is for another environment: it sets other inputs, or what it
            remembers or gives is of another shape.

    Examples:
        >>> import jaxglide
        >>> from jaxglide import Case, Constant, Controller, Environment, Gait, Glider, Polar
        >>> from jaxglide import Snake
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(), Polar.smooth())
        >>> environment = Environment(Case(glider), inputs=("d_psi",))
        >>> held = Controller(Constant(environment.plant.inputs), environment)
        >>> again = jaxglide.open(jaxglide.save(held, "held.nc"))
        >>> print(type(again.policy).__name__, again.environment.chosen)
        Constant (3,)
    """

    policy: AbstractPolicy
    environment: Environment

    def __check_init__(self):
        check_kind("policy", self.policy, AbstractPolicy)
        check_kind("environment", self.environment, Environment)
        check_fits(self.policy, self.environment)


def check_fits(policy: AbstractPolicy, environment: Environment) -> None:
    """Raise `ValueError` unless a policy can fly an environment."""
    own, chosen = chosen_by(policy), environment.chosen
    if own is not None and own != chosen:
        mine, other = (", ".join(INPUTS[k] for k in which) for which in (own, chosen))
        raise ValueError(f"the policy is for another model: it sets {mine}, not {other}")
    cycle = samples_of(policy)
    if cycle is not None and cycle != environment_samples(environment):
        raise ValueError(
            f"the policy is for another model: it has {cycle} samples in a cycle, not "
            f"{environment_samples(environment)}"
        )

    def step(policy, environment):
        _, sensed = environment.reset(jax.random.key(0))
        memory = policy.start()
        return memory, policy(memory, sensed)

    try:
        before, (inputs, after) = eqx.filter_eval_shape(step, policy, environment)
    except (TypeError, IndexError) as error:
        said = str(error).split("\n")[0]
        raise ValueError(f"the policy is for another model: {said}") from None
    if inputs.shape != (len(INPUTS),):
        raise ValueError(
            f"the policy gives inputs of shape {inputs.shape}: they must be ({len(INPUTS)},)"
        )
    shapes = [jax.tree.map(lambda leaf: leaf.shape, memory) for memory in (before, after)]
    if shapes[0] != shapes[1]:
        raise ValueError("the policy remembers other shapes after a sample than before")


def chosen_by(policy: Any) -> tuple[int, ...] | None:
    """Which inputs a policy, or the law within it, sets; None if it does not say."""
    found = getattr(policy, "chosen", None)
    return _of_inner(policy, chosen_by) if found is None else tuple(found)


def samples_of(policy: Any) -> int | None:
    """Samples in a cycle that a policy, or the law within it, has; None if it does not say."""
    gains = getattr(policy, "K", None)
    if gains is None:
        return _of_inner(policy, samples_of)
    return len(gains) - int(getattr(policy, "launch", 0))


def _of_inner(policy: Any, ask) -> Any:
    for name in ("steering", "regulator", "base"):
        inner = getattr(policy, name, None)
        if inner is not None:
            return ask(inner)
    return None


def environment_samples(environment: Environment) -> int:
    """Samples in a cycle of the waves."""
    gait: Any = environment.held.gait
    return round(1 / float(environment.plant.interval * gait.f_theta))


def arguments_of(environment: Environment) -> dict[str, Any]:
    """What makes the environment again, but for rounding: arguments of `Environment`."""
    plant, chosen = environment.plant, environment.chosen
    drive, names = plant.drive, [INPUTS[k] for k in environment.chosen]
    ends = np.stack([np.asarray(drive.low), np.asarray(drive.high)], axis=1).tolist()
    rates = np.asarray(drive.rate_limit).tolist()
    return {
        "case": Case(environment.held, environment.case.launch, environment.case.ends),
        "inputs": names,
        "samples": environment_samples(environment),
        "vary": {name: tuple(map(float, both)) for name, both in environment.bounds.items()},
        "senses": environment.senses,
        "fall": float(environment.fall),
        "step": float(plant.interval / plant.steps),
        "actuators": {
            "natural_frequency": float(drive.natural_frequency),
            "damping": float(drive.damping),
            "ranges": {INPUTS[k]: ends[k] for k in chosen},
            "rates": {INPUTS[k]: rates[k] for k in chosen},
        },
    }


@eqx.filter_jit
def launch_rate(environment: Environment):
    """Rate of the state of flight at launch, nothing drawn, (s,): what tells models apart."""
    vary = eqx.tree_at(lambda e: e.bounds, environment, {})
    flight = vary.reset(jax.random.key(0))[0]
    none = jnp.zeros(())
    return six_degrees_of_freedom(none, flight.flying.state, flight.plant.flight)


def check_model(rate: np.ndarray, environment: Environment) -> None:
    """Raise `ValueError` unless a rate of the state at launch is that of an environment."""
    here = np.asarray(launch_rate(environment))
    if rate.shape != here.shape:
        raise ValueError(
            f"it is of another model: its flight has {rate.size} states, here {here.size}"
        )
    apart = float(np.max(np.abs(rate - here) / (1e-3 + np.abs(here))))
    if not apart < _SAME:
        raise ValueError(
            f"it is of another model: its flight begins otherwise, by {apart:.2g} of a rate"
        )
