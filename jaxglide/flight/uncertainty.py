"""How sure a number is that follows from the section's coefficients."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import numpy as np

from .dynamics import Glider, check_glider


def _polar(glider: Any):
    return glider.aerodynamics.polar


@eqx.filter_jit
def _slopes(function, glider, moving, fixed):
    def value(moving):
        return function(eqx.tree_at(_polar, glider, eqx.combine(moving, fixed)))

    return jax.jacrev(value)(moving)


def standard_deviation(function: Callable[[Glider], Any], glider: Glider) -> Any:
    """Standard deviation that the coefficients leave to numbers of a glider.

    To first order: the numbers' gradient by everything in the polar, in reverse mode, along
    every independent deviation of it (see `AbstractPolar.spread`). For steady glides there is
    `SteadyGlide.uncertainty`.

    Args:
        function: pure function of a glider to floats: a number, or arrays in any tree.
            Compiled once for each function.
        glider: with a polar that knows how sure it is, such as `Polar.band_limited`.

    Returns:
        Of the same form.

    Raises:
        ValueError: the polar does not know.

    Examples:
        >>> from jaxglide import Gait, Glider, Launch, Polar, Snake, simulate
        >>> from jaxglide import standard_deviation
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(), Polar.band_limited())
        >>> def distance(glider):
        ...     return simulate(glider, Launch(height=10.0)).landing_point[1]
        ...
        >>> off = standard_deviation(distance, glider)
        >>> print(f"{distance(glider):.1f} m, give or take {off:.1f}")
        5.2 m, give or take 0.9
    """
    polar = getattr(check_glider(glider).aerodynamics, "polar", None)
    spread = None if polar is None else polar.spread()
    if spread is None:
        raise ValueError(
            f"polar of type {type(polar).__name__} has no spread, which says how sure its "
            "coefficients are: take Polar.band_limited"
        )
    floats, rest = eqx.partition(polar, eqx.is_inexact_array)
    slopes = _slopes(function, glider, floats, rest)
    spreads = jax.tree.leaves(eqx.filter(spread, eqx.is_inexact_array))

    def deviation(by_polar):
        pairs = list(zip(jax.tree.leaves(by_polar), spreads, strict=True))
        moved = sum(_along(slope, each) for slope, each in pairs)
        return np.sqrt(np.sum(np.square(moved), axis=-1))

    return jax.tree.map(deviation, slopes, is_leaf=lambda tree: isinstance(tree, type(polar)))


def _along(slope, deviations) -> np.ndarray:
    """Derivatives (..., *s) along deviations (P, *s), (..., P)."""
    count, size = len(deviations), deviations[0].size
    kept = slope.shape[: slope.ndim - deviations.ndim + 1]
    return np.reshape(slope, (*kept, size)) @ np.reshape(deviations, (count, size)).T
