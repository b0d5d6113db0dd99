"""Controllers as data, and made whole again: arrays by name, and records of what holds them."""

import json
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from .. import control
from .._lib.checks import check_kind
from .._lib.formats import kind_of
from .._lib.records import CLASS, Registry, decode, encode
from .._lib.units import labelled
from ..control.controller import Controller, check_model, environment_samples, launch_rate
from ..control.plant import INPUTS
from ..control.regulator import Linear
from ..ensemble.records import stamp
from ..flight.case import Case
from ..flight.parts import PARTS
from .restore import or_refuse

_RATE = "launch_rate"


class Stored(eqx.Module):
    """An array that stands in the file by a name."""

    name: str = eqx.field(static=True)


class Network(eqx.Module):
    """Layers of a network with tanh between them."""

    weights: tuple
    biases: tuple


def controller_dataset(controller: Controller) -> xr.Dataset:
    """A controller as a dataset: its arrays, and what they are for in its attribute `parts`.

    Raises:
        ValueError: it holds a network other than of tanh.
    """
    check_kind("result", controller, Controller)
    environment, arrays = controller.environment, {}

    def stored(path, leaf):
        if not eqx.is_array(leaf):
            return leaf
        name = "".join(str(key) for key in path).strip(".")
        name = name.replace(".", "_").replace("[", "_").replace("]", "")
        arrays[name] = np.asarray(leaf)
        return Stored(name)

    policy = _plain(controller.policy)
    policy = jax.tree_util.tree_map_with_path(stored, policy)
    record = {"policy": encode(policy), "environment": _described(environment)}
    variables = {
        name: ([f"{name}_{k}" for k in range(values.ndim)], values, labelled("mixed", name))
        for name, values in arrays.items()
    }
    rate = np.asarray(launch_rate(environment))
    said = labelled("mixed", "rate of the state of flight at launch, which tells the model")
    variables[_RATE] = ("state", rate, said)
    settings = {
        "law": type(controller.policy).__name__,
        "inputs": ", ".join(INPUTS[k] for k in environment.chosen),
        "parts": json.dumps(record),
    }
    return stamp(xr.Dataset(variables), settings, "controller")


def _is_network(part: Any) -> bool:
    return isinstance(part, eqx.nn.MLP)


def _plain(policy: Any) -> Any:
    """The policy with networks as their weights."""

    def plain(part):
        if not _is_network(part):
            return part
        if part.activation is not jnp.tanh:
            raise ValueError("only a network of tanh is kept in a file")
        layers = part.layers
        return Network(tuple(a.weight for a in layers), tuple(a.bias for a in layers))

    return jax.tree.map(plain, policy, is_leaf=_is_network)


def _described(environment: control.Environment) -> dict[str, Any]:
    """What makes an environment again."""
    plant, drive = environment.plant, environment.plant.drive
    chosen = list(environment.chosen)
    ranges = np.stack([np.asarray(drive.low), np.asarray(drive.high)], axis=1)[chosen]
    return {
        CLASS: "Environment",
        "case": encode(Case(environment.held, environment.case.launch, environment.case.ends)),
        "inputs": [INPUTS[k] for k in chosen],
        "samples": environment_samples(environment),
        "vary": [
            [name, *np.asarray(ends).tolist()] for name, ends in environment.bounds.items()
        ],
        "senses": encode(environment.senses),
        "fall": float(environment.fall),
        "step": float(plant.interval / plant.steps),
        "natural_frequency": float(drive.natural_frequency),
        "damping": float(drive.damping),
        "ranges": ranges.tolist(),
        "rates": np.asarray(drive.rate_limit)[chosen].tolist(),
    }


def _environment(
    *,
    case,
    inputs,
    samples,
    vary,
    senses,
    fall,
    step,
    natural_frequency,
    damping,
    ranges,
    rates,
) -> control.Environment:
    actuators = {
        "natural_frequency": natural_frequency,
        "damping": damping,
        "ranges": dict(zip(inputs, ranges, strict=True)),
        "rates": dict(zip(inputs, rates, strict=True)),
    }
    return control.Environment(
        case,
        inputs,
        samples=samples,
        vary={name: (low, high) for name, low, high in vary},
        senses=senses,
        fall=fall,
        step=step,
        actuators=actuators,
    )


def _network(weights, biases) -> eqx.nn.MLP:
    """A network of tanh from its weights."""
    sizes = [(int(w.shape[1]), int(w.shape[0])) for w in weights]
    (size, width), count = sizes[0], sizes[-1][1]
    depth = len(weights) - 1
    key = jax.random.key(0)
    network = eqx.nn.MLP(size, count, width, depth, activation=jnp.tanh, key=key)
    wanted = [layer.weight.shape for layer in network.layers]
    found = (
        [w.shape for w in weights],
        [(*b.shape, w.shape[1]) for b, w in zip(biases, weights, strict=True)],
    )
    if found[0] != wanted or found[1] != wanted:
        raise ValueError(f"its layers are of shapes {found[0]}")
    return eqx.tree_at(
        lambda n: [a for layer in n.layers for a in (layer.weight, layer.bias)],
        network,
        [a for both in zip(weights, biases, strict=True) for a in both],
    )


def _turn(*, regulator, pace, settle, forward) -> Any:
    """A coordinated turn; what a turn adds follows from its regulator."""
    return control.CoordinatedTurn(regulator, float(pace), float(settle))


def _registry(data: xr.Dataset) -> Registry:
    """What may be made from a controller's record."""

    def stored(name):
        values = data[name].values
        if values.dtype.kind not in "biuf":
            raise ValueError(f"{name} holds {values.dtype.name} values, no numbers")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} is not finite")
        return jnp.asarray(values)

    names = "Constant", "Regulator", "GainScheduled", "NeuralPolicy", "Waypoints"
    laws = {name: getattr(control, name) for name in names if hasattr(control, name)}
    made = {"Environment": _environment, "Stored": stored, "Network": _network}
    own = {"Linear": Linear, "Senses": control.Senses, "CoordinatedTurn": _turn}
    return {**PARTS, **laws, **made, **own}


def controller_of(data: xr.Dataset) -> Controller:
    """The controller that `controller_dataset` made the dataset of.

    Raises:
        OwnPartError: a part is the user's own; the message names it.
        ValueError: it lacks something, holds a wrong one, or is of another model; one
            sentence says which.
    """
    return or_refuse(lambda: _controller(data), data, "controller")


def _controller(data: xr.Dataset) -> Controller:
    if kind_of(data) != "controller":
        raise ValueError(f"it is of the kind {kind_of(data)!r}")
    try:
        record = json.loads(str(data.attrs["parts"]))
    except (RecursionError, ValueError):
        raise ValueError("its parts are no JSON text") from None
    if not isinstance(record, dict):
        raise ValueError("its parts are no table")
    registry = _registry(data)
    environment = decode(record["environment"], registry)
    policy = decode(record["policy"], registry)
    check_model(data[_RATE].values, check_kind("environment", environment, control.Environment))
    return Controller(policy, environment)
