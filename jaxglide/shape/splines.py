"""Cubic splines whose coefficients are linear in the values: made once, of matrices.

Knots are known when a spline is made; values may be traced. In time the slope is zero at both
ends, where the spline is held: it is smooth to the second derivative between.
"""

import itertools
from functools import lru_cache
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from .._lib.types import Array, Float, Scalar

_MOST = 2000  # knots: their matrix grows with the square, here to 160 MB


@lru_cache(maxsize=64)
def basis(knots: tuple[float, ...], ends: str = "clamped") -> np.ndarray:
    """Coefficients of every piece by every value, (K - 1, 5, K).

    Of powers 0 to 3 of the time from the piece's start; the last is the integral from the
    first knot to there. `ends` is SciPy's boundary condition; of a periodic spline the last
    knot is the first again and has no value of its own: (K - 1, 5, K - 1).
    """
    from scipy.interpolate import CubicSpline, PPoly

    values = np.eye(len(knots))
    if ends == "periodic":
        values = np.eye(len(knots) - 1)
        values = np.concatenate([values, values[:1]])
    pieces = CubicSpline(knots, values, bc_type=ends)
    whole = PPoly(pieces.c, pieces.x).antiderivative()
    powers = pieces.c[::-1].transpose(1, 0, 2)
    return np.concatenate([powers, whole(np.asarray(knots[:-1]))[:, None]], axis=1)


class Spline(NamedTuple):
    """A value and its first two derivatives, and its integral from the first knot, (m,)."""

    value: Float[Array, " m"]
    rate: Float[Array, " m"]
    second: Float[Array, " m"]
    integral: Float[Array, " m"]


def spline(
    knots: tuple[float, ...],
    values: Float[Array, "K m"],
    time: Scalar,
    ends: str = "clamped",
) -> Spline:
    """The spline through values (K, m) at the knots [s], at a time [s]; `ends` as in
    `basis`."""
    inside = jnp.clip(time, knots[0], knots[-1])
    i = jnp.clip(jnp.searchsorted(jnp.asarray(knots), inside, side="right") - 1, 0)
    i = jnp.minimum(i, len(knots) - 2)
    c = jnp.asarray(basis(knots, ends))[i] @ values
    x = inside - jnp.asarray(knots)[i]
    held = (time < knots[0]) | (time > knots[-1])
    value = c[0] + x * (c[1] + x * (c[2] + x * c[3]))
    rate = c[1] + x * (2 * c[2] + 3 * x * c[3])
    second = 2 * c[2] + 6 * x * c[3]
    integral = c[4] + x * (c[0] + x * (c[1] / 2 + x * (c[2] / 3 + x * c[3] / 4)))
    return Spline(
        value,
        jnp.where(held, 0.0, rate),
        jnp.where(held, 0.0, second),
        integral + (time - inside) * value,
    )


def check_knots(name: str, knots: tuple[float, ...], unit: str) -> None:
    """Raise `ValueError` unless 2 to 2000 knots rise."""
    if len(knots) < 2:
        raise ValueError(f"{name} has {len(knots)} values: it needs at least 2")
    if len(knots) > _MOST:
        raise ValueError(f"{name} has {len(knots)} values: at most {_MOST} are allowed")
    for before, after in itertools.pairwise(knots):
        if not np.isfinite(before) or not np.isfinite(after) or not after > before:
            raise ValueError(f"{name} goes from {before:g} to {after:g} {unit}: it must rise")


def knots_of(name: str):
    """Converter of a field to a tuple of numbers that are known when it is made."""

    def convert(values) -> tuple[float, ...]:
        try:
            return tuple(map(float, np.ravel(values)))
        except (TypeError, ValueError, OverflowError):
            raise TypeError(f"{name} = {values!r} is not a list of numbers") from None

    return convert
