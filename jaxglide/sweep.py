"""Batches of glides (floor 5)."""

from collections.abc import Callable, Mapping
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

from ._types import Array, Scalar
from .dynamics import Glider
from .glide import Glide, simulate
from .launch import Launch

Build = Callable[[dict[str, Scalar]], tuple[Glider, Launch]]
"""Turns one case, a value per name, into what flies and how it is launched."""


def results(glide: Glide) -> dict[str, Array]:
    """What a sweep keeps of every glide, in SI units and radians, by name."""
    return {
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
        "accepted": glide.accepted,
        "rejected": glide.rejected,
    }


@lru_cache(maxsize=16)
def _flier(build: Build, mesh: Mesh, options: tuple):
    """Compiled function of a batch of cases, its lanes shared out over the devices."""

    def lanes(cases, rtol, atol):
        def one(case):
            glider, launch = build(case)
            return results(simulate(glider, launch, rtol=rtol, atol=atol, **dict(options)))

        return jax.vmap(one)(cases)

    split, whole = PartitionSpec("lanes"), PartitionSpec()
    mapped = jax.shard_map(
        lanes, mesh=mesh, in_specs=(split, whole, whole), out_specs=split, check_vma=False
    )
    return eqx.filter_jit(mapped)


def fly(
    build: Build,
    cases: Mapping[str, np.ndarray],
    *,
    rtol: float = 1e-6,
    atol: float = 1e-6,
    chunk: int = 128,
    **options,
) -> dict[str, np.ndarray]:
    """Fly a list of cases as vmapped batches on all local devices.

    A batch runs until its slowest flight ends, so list together cases of similar length.

    Args:
        build: turns one case into a glider and a launch; traced under `vmap`. Pass the
            same function again to reuse what was compiled for it.
        cases: values by name, each of shape (N, ...).
        rtol, atol: tolerances, as in `simulate`.
        chunk: number of glides in one batch.
        **options: other keyword arguments of `simulate`, hashable.

    Returns:
        What `results` keeps of every glide, by name, each of shape (N, ...), in order.
    """
    devices = jax.local_devices()
    mesh = Mesh(np.array(devices), ("lanes",))
    count = len(next(iter(cases.values())))
    width = -(-min(chunk, count) // len(devices)) * len(devices)
    flier = _flier(build, mesh, tuple(sorted(options.items())))
    sharding = NamedSharding(mesh, PartitionSpec("lanes"))
    pieces = []
    for start in range(0, count, width):
        # The last batch is filled up with repeats, so that one compiled function serves.
        index = np.minimum(np.arange(start, start + width), count - 1)
        # Neighbours go to different devices: every device gets short and long flights.
        order = np.argsort(np.arange(width) % len(devices), kind="stable")
        batch = {
            name: jax.device_put(np.asarray(values)[index[order]], sharding)
            for name, values in cases.items()
        }
        flown = flier(batch, jnp.asarray(rtol), jnp.asarray(atol))
        back = np.argsort(order)[: count - start]
        pieces.append({name: np.asarray(values)[back] for name, values in flown.items()})
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
