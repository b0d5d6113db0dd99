"""A sweep on a Dask cluster, one task a batch (floor 5; extra `jaxglide[cluster]`).

Every worker writes its batches to the store itself; the scheduler sends a lost worker's
batch to another. Start workers with one thread each: JAX uses all cores of a process.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .study import Study

_RETRIES = 3


def _task(study: str, store: str, width: int, chunk: int, x64: bool) -> int:
    """Fly one batch and write it; runs on a worker."""
    import jax

    jax.config.update("jax_enable_x64", x64)
    from .batch import solve, template
    from .store import Store

    described = Study.from_json(study)
    index = described.order()[chunk * width : (chunk + 1) * width]
    kept = Store(store, described, width, template(described))
    kept.write(chunk, solve(described, index, width))
    return chunk


def solve_on_cluster(
    study: Study, store: Path, width: int, todo: np.ndarray, cluster: Any
) -> Iterator[int]:
    """Fly the batches `todo` on a cluster, yielding each when it is in the store.

    Args:
        study, store, width: as in `sweep.sweep`; the store exists.
        todo: batch numbers, (n,).
        cluster: a `dask.distributed.Client` or a scheduler's address.

    Raises:
        ValueError: Dask is not installed, or no scheduler answers at the address.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise ValueError("a cluster needs Dask: pip install 'jaxglide[cluster]'") from None
    import jax

    if isinstance(cluster, Client):
        client, own = cluster, False
    else:
        try:
            client, own = Client(cluster, timeout="20s"), True
        except OSError as error:
            raise ValueError(f"no scheduler answers at {cluster}: {error}") from None
    try:
        x64 = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]
        arguments = study.to_json(), str(store.resolve()), width
        futures = [
            client.submit(_task, *arguments, int(chunk), x64, retries=_RETRIES, pure=False)
            for chunk in todo
        ]
        for future in as_completed(futures):
            yield future.result()
    finally:
        if own:
            client.close()
