"""A sweep on a Dask cluster, some hundred cases a task (extra `jaxglide[cluster]`).

A task carries its own cases and returns their results; only the process that sweeps writes to
the store, so workers need not see it. The scheduler sends a lost worker's batch to another.
Start workers with one thread each: JAX uses all cores of a process.
"""

import contextlib
import sys
from collections.abc import Iterator
from concurrent.futures import CancelledError
from typing import Any

import numpy as np

from .records import versions
from .study import Study

_RETRIES = 3
_PATIENCE = "20s"  # with a scheduler
# Glides a task: enough for the lanes of a worker, and some tasks for every worker.
_FEWEST, _MOST, _TASKS = 24, 480, 4


class ClusterError(OSError):
    """A cluster that does not answer, or whose workers died; the message is one sentence."""


def _task(
    cases: str | Study, width: int | None, x64: bool, expected: dict[str, str]
) -> dict[str, np.ndarray]:
    """Fly some cases; runs on a worker."""
    import jax

    for name, version in versions().items():
        if name != "version_python" and expected[name] != version:
            raise ClusterError(f"a worker has {name} {version}, not {expected[name]} as here")
    jax.config.update("jax_enable_x64", x64)
    from .batch import solve, width_of

    study = Study.from_json(cases) if isinstance(cases, str) else cases
    return solve(study, np.arange(len(study)), width or width_of(study))


@contextlib.contextmanager
def connected(cluster: Any, tell: bool = True) -> Iterator[Any]:
    """A client of the cluster.

    Args:
        cluster: a `dask.distributed.Client` or a scheduler's address.
        tell: say on standard error that there are no workers yet.

    Raises:
        ValueError: Dask is not installed, or that is no address.
        ClusterError: no scheduler answers there.
    """
    try:
        from distributed import Client
    except ImportError:
        raise ValueError("a cluster needs Dask: pip install 'jaxglide[cluster]'") from None
    with contextlib.ExitStack() as stack:
        client = cluster
        if not isinstance(cluster, Client):
            try:
                new = Client(cluster, timeout=_PATIENCE, set_as_default=False)
                client = stack.enter_context(new)
            except OSError as error:
                raise ClusterError(f"no scheduler answers at {cluster}: {error}") from None
            except (ValueError, TypeError) as error:
                raise ValueError(f"{cluster!r} is not a scheduler's address: {error}") from None
        if tell and not client.scheduler_info()["workers"]:
            print("the cluster has no worker yet: waiting for one", file=sys.stderr)
        yield client


def _sent(study: Study) -> str | Study:
    """A study as its text; as itself where only its program knows its parts."""
    return study if study.own else study.to_json()


def solve_on_cluster(
    client: Any, study: Study, order: np.ndarray, rows: np.ndarray, width: int | None
) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Fly glides on a cluster, yielding (places, results) of every batch as it comes.

    Args:
        client: a `dask.distributed.Client`.
        study: the study.
        order: case numbers in the order in which they are solved, (N,).
        rows: places in that order of the glides to fly, (n,).
        width: glides per task, all in flight at once; by default as suits the workers.

    Raises:
        ClusterError: workers died at a batch again and again, or the cluster went away.
    """
    import jax
    from distributed import KilledWorker, as_completed

    x64 = bool(jax.config.jax_enable_x64)  # type: ignore[attr-defined]
    workers = max(1, len(client.scheduler_info()["workers"]))
    size = width or min(_MOST, max(_FEWEST, len(rows) // (_TASKS * workers)))
    futures = {}
    for part in np.split(rows, np.arange(size, len(rows), size)):
        told = _sent(study.part(order[part])), width, x64, versions()
        futures[client.submit(_task, *told, retries=_RETRIES, pure=False)] = part
    kept = "what is finished is kept if there is a store: run the same study again"
    try:
        for future in as_completed(list(futures)):
            values = future.result()
            yield futures.pop(future), values
        if futures:
            raise ClusterError(f"the cluster went away; {kept}")
    except KilledWorker as error:
        raise ClusterError(
            f"workers of the cluster died at a batch, {error.allowed_failures + 1} in all "
            f"(their logs say why; often too little memory); {kept}"
        ) from error
    except (CancelledError, ConnectionError, TimeoutError) as error:
        raise ClusterError(f"the cluster went away ({error}); {kept}") from error
    finally:
        with contextlib.suppress(Exception):
            client.cancel(list(futures))
