"""How many cores there are, and work on all of them."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor


def cores() -> int:
    """Cores that this process may use, which can be fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_threads(function: Callable, items: Iterable, *, first: bool = False) -> list:
    """A function's values of all items, in order, a thread a core.

    Args:
        function: of one item.
        items: any number.
        first: whether the first is done before the others, which so compile nothing.
    """
    import jax

    x64 = jax.config.jax_enable_x64  # type: ignore[attr-defined]

    def one(item):
        with jax.enable_x64(x64):
            return jax.block_until_ready(function(item))

    items = list(items)
    begun = [one(item) for item in items[:1]] if first else []
    with ThreadPoolExecutor(cores()) as threads:
        return [*begun, *threads.map(one, items[len(begun) :])]
