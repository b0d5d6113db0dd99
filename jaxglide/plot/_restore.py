"""A saved glide made whole again: glider, launch and trajectory from its dataset (floor 6)."""

from dataclasses import fields
from typing import Any

import diffrax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from ..dynamics import Glider
from ..environment import Environment
from ..gait import Gait
from ..glide import Glide, Outcome, Settings
from ..launch import Launch, TakeOff
from ..polar import Polar
from ..snake import Snake

_STATE = ("position", "velocity", "omega", "angles", "path_length")


def _made(kind, attrs) -> Any:
    """A module from the attributes named as its fields."""
    found = {field.name: attrs[field.name] for field in fields(kind) if field.name in attrs}
    plain = {name: v.item() if isinstance(v, np.generic) else v for name, v in found.items()}
    return kind(**{name: None if v == "none" else v for name, v in _lists(plain).items()})


def _lists(values: dict) -> dict:
    return {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in values.items()}


def snake_of(data: xr.Dataset) -> Snake:
    """The snake of a saved glide; `ValueError` where the dataset does not say."""
    return _or_refuse(lambda: _made(Snake, data.attrs))


def glide_of(data: xr.Dataset) -> Glide:
    """The glide that `records.glide_dataset` made the dataset of.

    Between the saved times its trajectory is interpolated linearly.

    Args:
        data: over time [s], with the settings in its attributes.

    Raises:
        ValueError: the dataset lacks a variable or an attribute.
    """
    return _or_refuse(lambda: _glide(data))


def _or_refuse(make):
    try:
        return make()
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"this is not a whole glide: it lacks {error}") from None


def _glide(data: xr.Dataset) -> Glide:
    attrs = data.attrs
    scales = float(attrs["lift_scale"]), float(attrs["drag_scale"])
    polar = Polar.from_name(attrs["polar"], *scales)
    parts = (_made(kind, attrs) for kind in (Snake, Gait, Environment))
    snake, gait, environment = parts
    columns = [data[name].values.reshape(data.sizes["time"], -1) for name in _STATE]
    columns[3] = np.deg2rad(columns[3])
    states, times = np.concatenate(columns, axis=1), data["time"].values
    start = TakeOff(
        jnp.asarray(float(attrs["launch_phase"])),
        jnp.asarray(np.asarray(attrs["launch_angles"], float)),
        jnp.asarray(float(attrs["launch_speed"])),
        jnp.asarray(states[0]),
    )
    outcome = next(o for o in Outcome if str(o) == attrs["outcome"])
    return Glide(
        glider=Glider(snake, gait, polar, environment),
        launch=_made(Launch, attrs),
        settings=_made(Settings, {**attrs, "times": None, "solver": diffrax.Dopri5()}),
        take_off=start,
        outcome=jnp.asarray(int(outcome)),
        time=jnp.asarray(times[-1]),
        state=jnp.asarray(states[-1]),
        max_angles=jnp.asarray(np.asarray(attrs["max_angles"], float)),
        accepted=jnp.asarray(int(attrs["accepted"])),
        rejected=jnp.asarray(int(attrs["rejected"])),
        states=None,
        interpolation=diffrax.LinearInterpolation(times, states),  # type: ignore
    )
