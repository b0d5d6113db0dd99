"""Small numerical helpers whose values and gradients are finite everywhere.

`sincos` and `arctan2` replace XLA's own on the hot path: XLA's CPU backend calls a
scalar library routine per element, while these are branch-free polynomials that it
vectorises (2 ns instead of 14 to 30 ns an element). Both carry their exact derivative.
"""

from collections.abc import Callable, Sequence
from functools import reduce

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jax.extend.core import Primitive
from jax.interpreters import ad, batching, mlir

from .types import Array

# pi/2 in parts whose products with a small integer are exact (Cody and Waite 1980).
_HALF_PI_PARTS = {
    8: (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
    4: (1.5703125, 4.837512969970703e-4, 7.54978995489188e-8),
}
# Minimax coefficients on [-pi/4, pi/4] in r**2 (the classic double-precision sets).
_SIN = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
_COS = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)
_TAN_PI_8 = float(np.tan(np.pi / 8))


def _fit_arctan(terms: int = 13) -> tuple[float, ...]:
    """Coefficients of arctan(t)/t in t**2 for |t| <= tan(pi/8), by Chebyshev fit."""
    width = _TAN_PI_8**2
    z = width * (np.cos(np.pi * (np.arange(200) + 0.5) / 200) + 1) / 2
    series = np.polynomial.Chebyshev.fit(
        z, np.arctan(np.sqrt(z)) / np.sqrt(z), terms - 1, domain=[0, width]
    )
    return tuple(map(float, series.convert(kind=np.polynomial.Polynomial).coef))


_ARCTAN = _fit_arctan()


def _horner(coefficients: tuple[float, ...], z: Array) -> Array:
    return reduce(lambda total, c: total * z + c, coefficients[-2::-1], coefficients[-1])  # type: ignore


def once(x: Array) -> Array:
    """`x`, which is finite, computed once for all that use it, and so its tangents.

    XLA's CPU backend computes what is cheap anew for everything that uses it, a gather even
    for every number that it fetches; what ends in a division it keeps.
    """
    return _ONCE.bind(x)


def _divided(x: Array) -> Array:
    """`x`, divided by a one that the compiler does not know for one."""
    return x / (1 + (x - x))


# A primitive, since the division is not linear, and must be transposed as if it were. Divided
# by a one made from the value, which all its tangents share, they would not be kept: for a
# shared divisor the compiler multiplies by its inverse.
_ONCE = Primitive("once")
_ONCE.def_impl(lambda x: x)
_ONCE.def_abstract_eval(lambda x: x)
ad.deflinear2(_ONCE, lambda cotangent, _: [once(cotangent)])
batching.defvectorized(_ONCE)
mlir.register_lowering(_ONCE, mlir.lower_fun(_divided, multiple_results=False))


@jax.jit  # traced once, however often it is used
@jax.custom_jvp
def sincos(x: Array) -> tuple[Array, Array]:
    """Sine and cosine of `x` [rad], any shape; about 1e-16 absolute for |x| < 1e5."""
    quadrant = jnp.round(x * (2 / np.pi))
    r = x
    for part in _HALF_PI_PARTS[x.dtype.itemsize]:
        r = r - quadrant * part
    z = r * r
    s = r + r * z * _horner(_SIN, z)
    c = 1 - 0.5 * z + z * z * _horner(_COS, z)
    q = quadrant - 4 * jnp.floor(quadrant * 0.25)  # 0, 1, 2 or 3
    odd = (q == 1) | (q == 3)
    sine, cosine = jnp.where(odd, c, s), jnp.where(odd, s, c)
    return (
        once(jnp.where(q >= 2, -sine, sine)),
        once(jnp.where((q == 1) | (q == 2), -cosine, cosine)),
    )


@sincos.__wrapped__.defjvp  # type: ignore
def _sincos_jvp(primals, tangents):
    s, c = sincos(*primals)
    (dx,) = tangents
    return (s, c), (once(c * dx), once(-s * dx))


@jax.jit  # traced once, however often it is used
@jax.custom_jvp
def arctan2(y: Array, x: Array) -> Array:
    """Angle [rad] of the point (x, y) in (-pi, pi]; 0, with gradient 0, at the origin."""
    ax, ay = jnp.abs(x), jnp.abs(y)
    high, middle = ay * _TAN_PI_8 > ax, ay > ax * _TAN_PI_8
    numerator = jnp.where(high, -ax, jnp.where(middle, ay - ax, ay))
    denominator = jnp.where(high, ay, jnp.where(middle, ay + ax, ax))
    offset = jnp.where(high, np.pi / 2, jnp.where(middle, np.pi / 4, 0.0))
    t = numerator / jnp.where(denominator == 0, 1.0, denominator)
    angle = offset + t * _horner(_ARCTAN, t * t)
    angle = jnp.where(x < 0, np.pi - angle, angle)
    return once(jnp.where(y < 0, -angle, angle))


@arctan2.__wrapped__.defjvp  # type: ignore
def _arctan2_jvp(primals, tangents):
    y, x = primals
    dy, dx = tangents
    square = x * x + y * y
    inverse = 1 / jnp.where(square == 0, 1.0, square)
    return arctan2(y, x), once((x * dy - y * dx) * inverse)


def safe_sqrt(x: Array) -> Array:
    """Square root with value and gradient 0 where `x` is 0 (x >= 0, any shape)."""
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1.0)), 0.0)


def by_rows(function: Callable, *vectors: Array) -> Array:
    """`function` of the components along axis 0 one by one, stacked.

    XLA's CPU backend takes a component of a stack apart again, but not of a sum of stacks, and
    fills a stack that is computed as a whole by a branch an element, without vector
    instructions.
    """
    return jnp.stack([once(function(*row)) for row in zip(*vectors, strict=True)])


@jax.custom_jvp
def rows_times(rows: Sequence[Array], matrix: Array) -> tuple[Array, ...]:
    """Vectors (n,), each times a matrix (n, n), as one product.

    The rows are written one after the other, where XLA's CPU backend would fill a stack by a
    branch an element. Of tangents, which are many at once, each row is a product of its own.
    """
    filled = jnp.zeros((len(rows), *rows[0].shape), rows[0].dtype)
    for k, row in enumerate(rows):
        filled = jax.lax.dynamic_update_slice_in_dim(filled, row[None], k, 0)
    return tuple(filled @ matrix)


def _rows_times_jvp(primals, tangents):
    (rows, matrix), (row_rates, matrix_rate) = primals, tangents
    rates = []
    for row, rate in zip(rows, row_rates, strict=True):
        parts = []
        if not isinstance(rate, SymbolicZero):
            parts.append(rate @ matrix)
        if not isinstance(matrix_rate, SymbolicZero):
            parts.append(row @ matrix_rate)
        rates.append(sum(parts) if parts else jnp.zeros_like(row))
    return rows_times(rows, matrix), tuple(rates)


rows_times.defjvp(_rows_times_jvp, symbolic_zeros=True)


@jax.custom_jvp
def over_last(x: Array) -> Array:
    """Sum over the last axis, as a product with ones: XLA's CPU backend splits a sum into
    windows, in three passes over memory, but not a product."""
    return jnp.dot(x, jnp.ones(x.shape[-1], x.dtype), precision="highest")


@over_last.defjvp
def _over_last_jvp(primals, tangents):
    return over_last(*primals), jnp.sum(*tangents, axis=-1)


def cross(a: Array, b: Array) -> Array:
    """Cross product of vectors with components along axis 0: (3, ...) x (3, ...)."""
    return jnp.stack(
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    )


def solve3(matrix: Array, b: Array) -> Array:
    """Solve the 3x3 system `matrix x = b` in closed form (Cramer's rule).

    A general solver costs more than the rest of the vector field at this size.
    """
    c0, c1, c2 = matrix[:, 0], matrix[:, 1], matrix[:, 2]
    c12 = cross(c1, c2)
    numerators = jnp.stack([b @ c12, c0 @ cross(b, c2), c0 @ cross(c1, b)])
    return numerators / (c0 @ c12)
