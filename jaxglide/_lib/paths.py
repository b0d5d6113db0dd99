"""Floats of a module by name: by their path, or by a last name that is unique.

A path names fields, `gait.nu_theta`, an element of an array by its index,
`air.velocity[0]`, or of a tuple of modules, `ends[1].limit`. Values are in the units that
people read (see `fields`).
"""

import dataclasses
import re
from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .checks import floating, in_numpy
from .fields import Parameter, parameters_of

_Module = TypeVar("_Module", bound=eqx.Module)
_INDEX = re.compile(r"(?P<path>.*?)\[(?P<index>\d+(?:,\d+)*)\]")


def _walk(module: eqx.Module, prefix: str) -> Iterator[tuple[str, Parameter]]:
    known = parameters_of(type(module))
    for field in dataclasses.fields(module):  # type: ignore[arg-type]
        if field.metadata.get("static"):
            continue  # part of what is compiled
        value, path = getattr(module, field.name), prefix + field.name
        if isinstance(value, eqx.Module):
            yield from _walk(value, f"{path}.")
        elif isinstance(value, tuple):
            for k, one in enumerate(value):
                if isinstance(one, eqx.Module):
                    yield from _walk(one, f"{path}[{k}].")
        elif field.name in known:
            yield path, known[field.name]
        elif eqx.is_inexact_array(value) or isinstance(value, float):
            yield path, Parameter("", field.name)  # of a part that describes none


def parameters(module: eqx.Module) -> dict[str, Parameter]:
    """Every float of a module, and of the modules in it, by its path."""
    return dict(_walk(module, ""))


def _meant(known: Mapping[str, Parameter], name: str) -> list[str]:
    """The paths whose last or short name it is."""
    return [p for p, about in known.items() if name in (p.rpartition(".")[2], about.short)]


def resolve(module: eqx.Module, name: str) -> str:
    """The path that a name means: a path itself, a last name or a short one, if it is unique.

    Raises:
        ValueError: there is none, or there are several; the message lists them.
    """
    found = _INDEX.fullmatch(name)
    if found:
        path = resolve(module, found["path"])
        shape = np.shape(get(module, path))
        index = tuple(map(int, found["index"].split(",")))
        if len(index) != len(shape) or any(i >= n for i, n in zip(index, shape, strict=True)):
            raise ValueError(f"there is no {name!r}: {path} has shape {shape}")
        return f"{path}[{found['index']}]"
    known = parameters(module)
    if name in known:
        return name
    paths = _meant(known, name)
    if len(paths) == 1:
        return paths[0]
    if paths:
        raise ValueError(f"{name!r} may mean {' or '.join(paths)}: give its path")
    names = ", ".join(short_name(module, path) for path in known)
    raise ValueError(f"there is no parameter {name!r}: known are {names}")


def short_name(module: eqx.Module, path: str) -> str:
    """The briefest name that means a path: its short one, its last name, or itself."""
    found = _INDEX.fullmatch(path)
    if found:
        return f"{short_name(module, found['path'])}[{found['index']}]"
    known = parameters(module)
    name = known[path].short or path.rpartition(".")[2]
    return name if len(_meant(known, name)) == 1 else path


def described(module: eqx.Module, path: str) -> Parameter:
    """What is known of the float at a path."""
    found = _INDEX.fullmatch(path)
    return parameters(module)[found["path"] if found else path]


def get(module: eqx.Module, path: str) -> Any:
    """What the module holds at a path, in SI units and radians; None where it is left out."""
    value: Any = module
    for part in path.split("."):
        found = _INDEX.fullmatch(part)
        value = getattr(value, found["path"] if found else part)
        if found and value is not None:
            index = tuple(map(int, found["index"].split(",")))
            value = value[index[0]] if isinstance(value, tuple) else value[index]
    return value


def put(module: _Module, values: Mapping[str, Any]) -> _Module:
    """The module with other values at paths; pure, and values may be traced.

    Args:
        module: any module.
        values: by path, in the units of their parameters.
    """
    for path, value in values.items():
        inside = floating(described(module, path).factor * in_numpy(floating(value)))
        found = _INDEX.fullmatch(path)
        if found:
            path, index = found["path"], tuple(map(int, found["index"].split(",")))
            inside = jnp.asarray(get(module, path)).at[index].set(inside)
        module = eqx.tree_at(
            lambda m, path=path: get(m, path), module, inside, is_leaf=lambda x: x is None
        )
    return module
