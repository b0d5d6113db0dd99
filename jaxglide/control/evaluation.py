"""A policy judged by many random flights at once."""

import equinox as eqx
import jax
import numpy as np
import xarray as xr

from .._lib.checks import check_integer, check_kind
from .._lib.cores import in_threads
from ..flight.dynamics import ANGLES, POSITION
from ..flight.ends import Outcome, outcome_words
from .environment import Environment, controlled_flight
from .policy import AbstractPolicy

_LANES = 32  # flights of one computation: more fit no core's cache


@eqx.filter_jit
def _flown(environment, policy, keys, samples: int):
    """Ends of a group of flights, and what was drawn for them."""

    def one(key):
        flown = controlled_flight(environment, policy, key, samples)
        return flown.ended, environment.drawn(key)

    return jax.vmap(one)(keys)


def evaluate_policy(
    environment: Environment,
    policy: AbstractPolicy,
    flights: int = 1000,
    *,
    seed: int = 0,
    samples: int = 200,
) -> xr.Dataset:
    """Fly random flights of an environment under a policy, on all cores.

    Args:
        environment: what flies; its `vary` says what is random.
        policy: what sets its inputs.
        flights: how many, 1 to 1,000,000.
        seed: of the flights: two policies are judged by the same ones.
        samples: after which a flight is cut off.

    Returns:
        Along `flight`: `outcome` (its codes in words are an attribute), `landed`, `time` [s],
        the end's `position` (right, forward, up) [m] and `angles` (yaw, pitch, roll) [rad],
        and what was drawn, by name, in the unit that people read.

    Raises:
        TypeError: a part is of another type.
        ValueError: a number out of range.

    Examples:
        >>> from jaxglide import Case, Constant, Environment, Gait, Glider, Launch, Polar
        >>> from jaxglide import Snake, evaluate_policy
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(), Polar.smooth())
        >>> environment = Environment(
        ...     Case(glider, Launch(height=2.0)), vary={"launch.speed": (1.5, 2.0)}
        ... )
        >>> held = Constant(environment.plant.inputs)
        >>> found = evaluate_policy(environment, held, flights=4, samples=20)
        >>> print(found.sizes["flight"], float(found.landed.mean()))
        4 1.0
    """
    check_kind("environment", environment, Environment)
    check_kind("policy", policy, AbstractPolicy)
    check_integer("flights", flights, 1, 1_000_000)
    check_integer("samples", samples, 1, 100_000)
    keys = jax.random.key_data(jax.random.split(jax.random.key(seed), flights))
    lanes = min(_LANES, flights)
    count = -(-flights // lanes)
    groups = np.resize(np.asarray(keys), (count * lanes, *keys.shape[1:]))
    groups = groups.reshape(count, lanes, *keys.shape[1:])
    parts = in_threads(
        lambda own: jax.tree.map(np.asarray, _flown(environment, policy, own, samples)),
        groups,
        first=True,
    )
    ended, drawn = jax.tree.map(lambda *each: np.concatenate(each)[:flights], *parts)
    words = outcome_words(environment.case.ends)
    turns = "flight", "angle"
    return xr.Dataset(
        {
            "outcome": ("flight", ended.outcome, {"words": [*words.values()]}),
            "landed": ("flight", ended.outcome == Outcome.LANDED),
            "time": ("flight", ended.time, {"units": "s"}),
            "position": (("flight", "axis"), ended.state[:, POSITION], {"units": "m"}),
            "angles": (turns, ended.state[:, ANGLES], {"units": "rad"}),
            **{
                name: ("flight", values, {"units": environment.case.parameter(name).unit})
                for name, values in drawn.items()
            },
        },
        {"axis": ["right", "forward", "up"], "angle": ["yaw", "pitch", "roll"]},
    )
