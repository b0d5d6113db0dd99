"""Controllers as data, and made whole again: arrays by name, and records of what holds them."""

import json
import re
from collections.abc import Iterable, Mapping
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
from ..control.controller import Controller, arguments_of, check_model, launch_rate
from ..control.plant import INPUTS
from ..control.regulator import Linear
from ..ensemble.records import outcome_flags, stamp
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
    variables: dict[str, Any] = {
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
    """What makes an environment again, as a record."""
    known = arguments_of(environment)
    own = known.pop("actuators")
    vary = [[name, *both] for name, both in known.pop("vary").items()]
    parts = {name: encode(known.pop(name)) for name in ("case", "senses")}
    numbers = {name: own[name] for name in ("natural_frequency", "damping")}
    by_input = {name: [*own[name].values()] for name in ("ranges", "rates")}
    return {CLASS: "Environment", **parts, **known, "vary": vary, **numbers, **by_input}


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


def _registry(data: xr.Dataset) -> Registry:
    """What may be made from a controller's record."""

    def stored(name):
        if name not in data:
            raise ValueError(f"it lacks {name}")
        values = data[name].values
        if values.dtype.kind not in "biuf":
            raise ValueError(f"{name} holds {values.dtype.name} values, no numbers")
        if not np.isfinite(values).all():
            raise ValueError(f"{name} is not finite")
        return jnp.asarray(values)

    kinds = (
        control.Constant,
        control.Regulator,
        control.GainScheduled,
        control.NeuralPolicy,
        control.CoordinatedTurn,
        control.Waypoints,
        control.Senses,
        Linear,
    )
    laws = {kind.__name__: kind for kind in kinds}
    made = {"Environment": _environment, "Stored": stored, "Network": _network}
    return {**PARTS, **laws, **made}


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


def drawn_as(names: Iterable[Any]) -> dict[str, str]:
    """Names of variables for numbers that were drawn, by their paths, among all names."""
    paths = [str(name) for name in names if "." in str(name)]
    last = [path.rpartition(".")[2] for path in paths]
    found = {}
    for path, one in zip(paths, last, strict=True):
        brief = one if last.count(one) == 1 else path
        found[path] = re.sub(r"\W+", "_", brief).strip("_")
    return found


def controlled_dataset(tables: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Random flights of several laws as one dataset, along `law` and `flight`.

    Args:
        tables: of `evaluate_policy`, by what steered.

    Returns:
        Their variables with units; what was drawn by its last name, `speed` of `launch.speed`.
    """
    several = [table.rename(drawn_as(table)) for table in tables.values()]
    data = xr.concat(several, xr.Variable("law", list(tables)), combine_attrs="override")
    words = {
        "outcome": ("", "how the flight ended"),
        "landed": ("", "whether it reached the ground"),
        "time": ("s", "duration of the flight"),
        "position": ("m", "centre of mass at the end: right, forward, up"),
        "angles": ("rad", "yaw, pitch, roll at the end"),
    }
    for name in data.data_vars:
        known = data[name].attrs
        unit, said = words.get(str(name), (str(known.get("units", "")), f"drawn {name}"))
        data[name].attrs = labelled(unit, said)
    said = next(iter(tables.values()))["outcome"].attrs["words"]
    data["outcome"].attrs |= outcome_flags(dict(enumerate(said)))
    data["landed"] = data["landed"].astype(np.int8)
    return stamp(data, {}, "controlled flights")
