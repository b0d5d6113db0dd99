"""One batch of a study as a vmapped computation on all local devices."""

import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.types import Array
from ..flight.case import Case
from ..flight.glide import Glide, simulate
from .study import Study, nodes_of

_CPU_LANES = (16, 24)  # per core: more do not pay for waiting for the slowest flight
# Lanes per device are a multiple of this. Loops over other numbers end in a remainder that
# the compiler may round otherwise: a glide's last bits would depend on its batch.
_UNIT = 8
_MAX_LANES = 65_536  # per GPU
_LIVE = 60  # arrays of the body's size alive at once in the vector field, at most


def results(glide: Glide) -> dict[str, Array]:
    """What a sweep keeps of every glide, in SI units and radians, by name."""
    kept = {
        "outcome": glide.outcome,
        "time": glide.time,
        "landing_point": glide.landing_point,
        "path_length": glide.path_length,
        "height_lost": glide.height_lost,
        "glide_angle": glide.glide_angle,
        "velocity": glide.velocity,
        "end_angles": glide.end_angles,
        "max_angles": glide.max_angles,
        "launch_phase": glide.take_off.phi_theta,
        "launch_angles": glide.take_off.angles,
        "launch_speed": glide.take_off.speed,
        "accepted": glide.accepted.astype(jnp.int32),
        "rejected": glide.rejected.astype(jnp.int32),
    }
    if glide.states is not None:
        kept["states"] = glide.states
    return kept


def _one(static: Case, max_steps: int):
    """Function of the values of one case, and of what all share, that flies it."""

    def fly(values, arrays, times, rtol, atol, max_time):
        case = eqx.combine(arrays, static).replace(values)
        glide = simulate(
            case.glider,
            case.launch,
            ends=case.ends,
            rtol=rtol,
            atol=atol,
            times=times,
            max_time=max_time,
            max_steps=max_steps,
        )
        return results(glide)

    return fly


def spread(one: Callable, devices: tuple, common: int):
    """Compiled function of a batch whose lanes are shared out over the devices.

    Every device runs the same program by itself: divided among several, XLA would put
    together otherwise what it computes, and round otherwise.

    Args:
        one: pure function of one case (a dict of arrays) and of what all cases share, trees
            of arrays, which get no dimension for the lanes.
        devices: JAX devices.
        common: number of shared arguments.
    """
    compiled = jax.jit(jax.vmap(one, in_axes=(0,) + (None,) * common))
    every = len(devices)

    def run(columns: Mapping[str, Any], width: int, *shared) -> dict[str, np.ndarray]:
        count = len(jax.tree.leaves(columns)[0])
        lanes = -(-width // every) * every
        x64 = jax.config.jax_enable_x64  # type: ignore[attr-defined]

        def fly(k: int) -> dict[str, np.ndarray]:
            # Filled up with repeats, so that one compiled function serves every batch.
            # Neighbours go to different devices: each gets as many long flights as the others.
            source = np.minimum(np.arange(k, lanes, every), count - 1)
            batch = jax.tree.map(lambda v: v[source], dict(columns))
            with jax.enable_x64(x64):
                flown = compiled(*jax.device_put((batch, *shared), devices[k]))
                return {name: np.asarray(values) for name, values in flown.items()}

        if every == 1:
            parts = [fly(0)]
        else:
            with ThreadPoolExecutor(every) as pool:  # which compile at once, and wait at once
                parts = list(pool.map(fly, range(every)))
        together = {n: np.stack([part[n] for part in parts], axis=1) for n in parts[0]}
        return {n: v.reshape(lanes, *v.shape[2:])[:count] for n, v in together.items()}

    return run


@lru_cache(maxsize=16)
def _flier(structure, leaves: tuple, max_steps: int, devices: tuple):
    return spread(_one(jax.tree.unflatten(structure, leaves), max_steps), devices, 5)


def shared(case: Case) -> tuple[Case, tuple]:
    """The arrays of a case, which all lanes share, and what a compiled function is kept by:
    the case without them."""
    arrays, static = eqx.partition(case, eqx.is_array)
    leaves, structure = jax.tree.flatten(static)
    # of no device: they go to whatever devices the lanes are on
    return jax.tree.map(np.asarray, arrays), (structure, tuple(leaves))


def default_width(study: Study) -> int:
    """Glides per batch: by cache on CPU cores, by memory on GPUs."""
    devices = jax.local_devices()
    if devices[0].platform == "cpu":
        most = _CPU_LANES
    else:
        memory = (devices[0].memory_stats() or {}).get("bytes_limit", 8 * 2**30)
        states = study.state_size * len(study.times or ())
        per_lane = 8 * (_LIVE * nodes_of(study.base) + 20 * 13 + states)
        most = (max(_UNIT, int(min(_MAX_LANES, 0.5 * memory / per_lane)) // _UNIT * _UNIT),)
    # As many batches as that takes, all of one size: a last small one would cost as much. The
    # fewest lanes in all, where there is a choice.
    each = -(-len(study) // len(devices))
    batches = [-(-each // lanes) for lanes in most]
    lanes = [_rounded(-(-each // count)) for count in batches]
    return len(devices) * min(zip(batches, lanes, strict=True), key=math.prod)[1]


def _rounded(lanes: int) -> int:
    return -(-lanes // _UNIT) * _UNIT


def solve(study: Study, index: np.ndarray, width: int) -> dict[str, np.ndarray]:
    """Fly some cases of a study as one batch.

    Args:
        study: the study.
        index: case numbers, (n,), n at most `width`.
        width: size of the batch; it is filled up with repeats, so that one compiled
            function serves every batch of a study.

    Returns:
        What `results` keeps, by name, each (n, ...): to the bit the same whatever the batch.
    """
    devices = tuple(jax.local_devices())
    lanes = len(devices) * _rounded(-(-width // len(devices)))
    arrays, key = shared(study.base)
    times = None if study.times is None else np.asarray(study.times, float)
    limits = (np.asarray(getattr(study, name)) for name in ("rtol", "atol", "max_time"))
    fly = _flier(*key, study.max_steps, devices)
    return fly(study.lanes(index), lanes, arrays, times, *limits)
