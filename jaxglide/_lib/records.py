"""Parts as plain records: what JSON can hold of a module, and the module back from it.

A record names a module's class and holds all its fields, modules in it nested. Floats are
exact. A class of this package goes by its bare name, any other one has its own package's in
front, `__main__.Tailwind`: a record is read with a registry of what may be made, by name, and
nothing else is looked up, imported or run.
"""

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import equinox as eqx
import numpy as np

CLASS, FUNCTION, OBJECT = "class", "function", "object"
_PACKAGE = __name__.partition(".")[0]
_OTHERS = f"{_PACKAGE}.experiments"  # in the package's folder, but users' own
_DEEPEST = 50

Registry = Mapping[str, Callable[..., Any]]
"""What may be made from a record, by name: classes, or functions of their fields."""


class OwnPartError(ValueError):
    """A record of a part that is the user's own, which no file brings back."""


def _name(thing: Any) -> str:
    """Name of a class or a function: bare if it is this package's, which no other one is."""
    module = str(getattr(thing, "__module__", ""))
    name = str(getattr(thing, "__qualname__", type(thing).__qualname__))
    root = module.partition(".")[0]
    ours = root == _PACKAGE and not module.startswith(_OTHERS)
    return name if ours else f"{root or 'unknown'}.{name}"


def encode(value: Any) -> Any:
    """A module as a plain record; of what a record cannot hold, a function, its name.

    A field may say by the entry `record` of its metadata how it is written: a function of its
    value, None for as it is.

    Args:
        value: a module, or what may stand in a field of one; nothing traced.
    """
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, eqx.Module):
        fields = dataclasses.fields(value)  # type: ignore[arg-type]
        return {CLASS: _name(type(value))} | {f.name: _field(value, f) for f in fields}
    names = getattr(value, "_fields", None)
    if isinstance(value, tuple) and names is not None:
        named = zip(names, value, strict=True)
        return {CLASS: _name(type(value))} | {name: encode(one) for name, one in named}
    if isinstance(value, tuple | list):
        return [encode(one) for one in value]
    if isinstance(value, float | np.generic) or eqx.is_array(value):
        return _numbers(np.asarray(value))
    if callable(value):
        return {FUNCTION: _name(value)}
    return {OBJECT: _name(type(value))}


def _field(module: eqx.Module, field: dataclasses.Field) -> Any:
    value = getattr(module, field.name)
    brief = field.metadata.get("record", lambda value: None)(value)
    return encode(value) if brief is None else brief


def _numbers(values: np.ndarray) -> Any:
    """Numbers as lists; what is not finite, which JSON has no word for, as a text."""
    if values.dtype.kind not in "biuf":
        return {OBJECT: str(values.dtype)}
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return values.tolist()
    return [_numbers(one) for one in values] if values.ndim else str(values)


def decode(record: Any, registry: Registry) -> Any:
    """What a record was made of; lists come back as tuples.

    Args:
        record: as `encode` made it, maybe by way of JSON.
        registry: what may be made.

    Raises:
        OwnPartError: it holds a part of the user's own.
        ValueError: it is no record, or a value in it is not allowed; the message names it.
    """
    own = next(own_parts(record, registry), None)
    if own is not None:
        raise OwnPartError(f"{own} is a part of the user's own, which no file brings back")
    return _decoded(record, registry)


def _decoded(record: Any, registry: Registry) -> Any:
    if isinstance(record, list):
        return tuple(_decoded(one, registry) for one in record)
    if isinstance(record, int) and abs(record) >= 2**63:
        raise ValueError(f"a number of {record.bit_length()} bits is not allowed")
    if not isinstance(record, dict):
        return record
    fields = {name: _decoded(one, registry) for name, one in record.items() if name != CLASS}
    name = record[CLASS]
    try:
        return _make(registry[name], fields)
    except (TypeError, ValueError) as error:
        said = str(error)
        raise ValueError(said if said.startswith("in ") else f"in {name}: {said}") from None


def _make(maker: Callable[..., Any], fields: dict[str, Any]) -> Any:
    known = inspect.signature(maker).parameters
    for name in fields:
        if name not in known:
            raise ValueError(f"there is no field {name!r}")
    for name, parameter in known.items():
        if parameter.default is parameter.empty and name not in fields:
            raise ValueError(f"the field {name!r} is missing")
    return maker(**fields)


def own_parts(record: Any, registry: Registry, depth: int = 0) -> Iterator[str]:
    """Names of the classes and functions in a record that no registry entry makes.

    Raises:
        ValueError: it is no record.
    """
    if depth > _DEEPEST:
        raise ValueError("this is no record of parts: it is nested too deeply")
    if isinstance(record, list):
        for one in record:
            yield from own_parts(one, registry, depth + 1)
    elif isinstance(record, dict):
        name = record.get(CLASS, record.get(FUNCTION, record.get(OBJECT)))
        if not isinstance(name, str) or any(not isinstance(key, str) for key in record):
            raise ValueError("this is no record of parts: an entry names no class")
        own = CLASS not in record or name not in registry
        if own and "." in name:  # and all that is in it
            yield name
            return
        for one in record.values():
            yield from own_parts(one, registry, depth + 1)
        if own:
            yield name
