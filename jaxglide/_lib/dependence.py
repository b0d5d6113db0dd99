"""What of a result depends on which arguments."""

from collections.abc import Callable
from typing import Any

import jax
from jax.extend.core import Literal


def depends(function: Callable[..., Any], first: Any, *others: Any) -> tuple[Any, Any]:
    """Which arrays that a function gives may depend on its first argument.

    Args:
        function: pure, from trees of arrays to a tree of arrays.
        first, others: arguments, or their shapes.

    Returns:
        The structure that it gives, and whether each leaf may depend, in order.
    """
    closed, shapes = jax.make_jaxpr(function, return_shape=True)(first, *others)
    jaxpr = closed.jaxpr
    moved = set(jaxpr.invars[: len(jax.tree.leaves(first))])

    def any_moved(variables) -> bool:
        return any(not isinstance(v, Literal) and v in moved for v in variables)

    for equation in jaxpr.eqns:
        if any_moved(equation.invars):
            moved.update(equation.outvars)
    return jax.tree.structure(shapes), [any_moved([v]) for v in jaxpr.outvars]
