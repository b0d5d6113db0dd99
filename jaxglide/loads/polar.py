"""Section force coefficients as functions of the angle of attack and the Reynolds number.

The polars of the measured section are piecewise polynomials in both on one grid of cells;
they differ in degree, and in what runs between the measured angles.

The angle used here is beta = atan2(-v_b, v_c) on the full circle. Beyond +-90 degrees the
air meets the section from behind; the section is symmetric fore and aft, so
C_L(180 - beta) = -C_L(beta) and C_D(180 - beta) = C_D(beta), and no case distinction is
needed in the force.
"""

import abc
import math
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero

from .._lib.checks import check_choice, check_integer, check_range, is_traced
from .._lib.fields import Part, about, floats
from .._lib.numerics import once
from .._lib.types import Array, Float, Scalar
from .coefficients import (
    BELOW,
    MEASURED_ANGLES,
    REYNOLDS,
    SIGN,
    circle,
    extended_tables,
    faded_tables,
)
from .harmonics import (
    FEWEST_HARMONICS,
    MOST_HARMONICS,
    best_harmonics,
    deviations,
    regression,
    waves_at,
)

_KNOTS = np.arange(-180.0, 181.0, 5.0)  # deg
_LARGEST = 1e3  # of a polynomial coefficient: no section comes near it


def _linear_cells() -> np.ndarray:
    """Cells (72, 6, 2, 2, 2) of the published polar: [beta, Re, C_L/C_D, power, power].

    Bilinear in the table, constant below -10 degrees; lift jumps at beta = -90 degrees,
    which the cells on either side represent exactly.
    """
    cells = []
    for table, sign in zip(extended_tables(), SIGN.values(), strict=True):
        front = np.vstack([np.repeat(table[:1], BELOW.size, axis=0), table])  # -90 to 90
        behind = sign * front[::-1]  # beta from 90 to 270
        pieces = (behind[18:], front, behind[:19])  # from -180 to 180
        cells.append(np.concatenate([_bilinear(piece) for piece in pieces]))
    return np.stack(cells, axis=2)


def _bilinear(values: np.ndarray) -> np.ndarray:
    """Coefficients (cells, 6, power of beta, power of Re) of bilinear cells."""
    along_re = np.stack([values[:, :-1], np.diff(values, axis=1)], axis=-1)
    return np.stack([along_re[:-1], np.diff(along_re, axis=0)], axis=2)


def _splined(circles: np.ndarray) -> np.ndarray:
    """Cells (..., 72, 6, 2, 4, 4) of C_L and C_D at knots of the full circle, (73, 7, 2, ...).

    Tensor-product cubic splines, periodic in beta and with zero end slopes in Re.
    """
    from scipy.interpolate import CubicSpline

    knots = np.arange(circles.shape[0], dtype=float)
    circles = np.concatenate([circles[:-1], circles[:1]])  # periodic to the last digit
    in_beta = CubicSpline(knots, circles, bc_type="periodic").c[::-1]  # (4, 72, 7, 2, ...)
    numbers = np.arange(REYNOLDS.size, dtype=float)
    cells = CubicSpline(numbers, in_beta, axis=2, bc_type="clamped").c[::-1]
    # from (power in Re, 6, power in beta, 72, 2, ...)
    return np.moveaxis(cells, (3, 1, 4, 2, 0), (-5, -4, -3, -2, -1))


def _smooth_cells() -> np.ndarray:
    """Cells (72, 6, 2, 4, 4) of the smooth polar."""
    circles = map(circle, faded_tables(), SIGN.values())
    return _splined(np.stack(list(circles), axis=-1))


def _regressed_cells(harmonics: int) -> np.ndarray:
    """The same of the polar that is band-limited."""
    both = zip(waves_at(_KNOTS, harmonics), regression(harmonics), strict=True)
    return _splined(np.stack([at @ waves.amplitudes for at, waves in both], axis=-1))


def _deviating_cells(harmonics: int) -> np.ndarray:
    """What adds to them in every independent standard deviation, (P, 72, 6, 2, 4, 4)."""
    found = []
    both = zip(waves_at(_KNOTS, harmonics), regression(harmonics), strict=True)
    for k, (at, waves) in enumerate(both):
        along = np.moveaxis(at @ deviations(waves), 0, -1)  # (73, 7, P)
        circles = np.zeros((*along.shape[:2], 2, along.shape[2]))
        circles[:, :, k] = along
        found.append(_splined(circles))
    return np.concatenate(found)


@lru_cache
def _cells(kind: str) -> np.ndarray:
    if kind == "published":
        return _linear_cells()
    return _smooth_cells() if kind == "smooth" else _regressed_cells(_harmonics(kind))


def _harmonics(name: str) -> int:
    return int(name.split()[0])


_HARMONICS = range(FEWEST_HARMONICS, MOST_HARMONICS + 1)
_NAMES = ("published", "smooth", *(f"{k} harmonics" for k in _HARMONICS))


def _given_cells(given: Any) -> Any:
    """Converter of a field: cells by their name, or as they are."""
    if isinstance(given, str):
        check_choice("cells", given, _NAMES)
        return floats(_cells(given))
    return floats(given)


def name_of_cells(cells: Any) -> str | None:
    """Name of a polar's cells, if they are known ones to the last digit."""
    cells = np.asarray(cells)
    for name in _NAMES[:1] if cells.shape[-1] == 2 else _NAMES[1:]:
        known = _cells(name)
        if known.shape == cells.shape and np.array_equal(known.astype(cells.dtype), cells):
            return name
    return None


class AbstractPolar(Part):
    """Lift and drag coefficients of a body section: the seam for a table of one's own."""

    @property
    def measured_angles(self) -> tuple[float, float]:
        """Angles of attack [deg] within which the coefficients are known; by default all."""
        return -np.inf, np.inf

    @property
    def measured_reynolds(self) -> tuple[float, float]:
        """Reynolds numbers within which they are known; by default all."""
        return 0.0, np.inf

    def spread(self) -> "AbstractPolar | None":
        """How uncertain its floats are: what adds to them in P independent standard deviations.

        Returns:
            A polar whose floats have P in front; None, the default, where nobody knows.
        """
        return None

    @abc.abstractmethod
    def __call__(self, beta, reynolds) -> tuple[Array, Array]:
        """C_L and C_D, the fold's sign included.

        Defined for every angle and Reynolds number, once differentiable but where the polar
        says otherwise. Both may be traced.

        Args:
            beta: angle of attack on the full circle [rad], any shape.
            reynolds: Reynolds number on the chord, same shape.

        Returns:
            C_L and C_D, each of the shape of `beta`. Beyond +-90 degrees the air comes from
            behind: C_L(180 - beta) = -C_L(beta) and C_D(180 - beta) = C_D(beta) for a section
            that is symmetric fore and aft.
        """


def scale_of(meaning: str) -> dict:
    """Metadata of a multiplier of a coefficient."""
    return about("", meaning, low=0, high=100)


class Polar(AbstractPolar):
    """The measured section of the snake; see `Polar.published`, `Polar.smooth`.

    Args:
        cells: polynomial coefficients, (72, 6, 2, k, k): cell of beta (5 degrees each from
            -180), cell of Re (2000 each from 3000), C_L or C_D, power of the position in
            the beta cell (0 to 1), power of the position in the Re cell; or the name of
            known ones: "published", "smooth", or "15 harmonics" (see `band_limited`).
        lift_scale, drag_scale: multipliers on C_L and C_D, 0 to 100. The published
            sensitivity case is 1.36 and 0.6.

    Raises:
        ValueError: a value is not finite, out of range or of the wrong shape, or the drag
            at a cell's corner is below 0.

    Examples:
        >>> import math
        >>> from jaxglide import Polar
        >>> for polar in (Polar.published(), Polar.smooth()):
        ...     lift, drag = polar(math.radians(22.5), 9000.0)
        ...     print(f"{lift:.4f} {drag:.4f}")
        ...
        1.1194 0.6188
        1.1385 0.6153
    """

    cells: Float[Array, "72 6 2 k k"] = eqx.field(
        converter=_given_cells,
        metadata=about("", "polynomial coefficients", low=-_LARGEST, high=_LARGEST)
        | {"record": name_of_cells},
    )
    lift_scale: Scalar = eqx.field(
        converter=floats, default=1.0, metadata=scale_of("multiplier on the lift coefficient")
    )
    drag_scale: Scalar = eqx.field(
        converter=floats, default=1.0, metadata=scale_of("multiplier on the drag coefficient")
    )

    def _check(self):
        if not is_traced(self.cells):
            check_range("C_D of cells", np.asarray(self.cells)[:, :, 1, 0, 0], "", 0)

    @classmethod
    def from_name(cls, name: str, lift_scale=1.0, drag_scale=1.0) -> "Polar":
        """`Polar.published` or `Polar.smooth` by name."""
        check_choice("polar", name, ("published", "smooth"))
        return cls(_cells(name), lift_scale, drag_scale)

    @classmethod
    def published(cls, lift_scale=1.0, drag_scale=1.0) -> "Polar":
        """The paper's polar: bilinear, clamped to -10..90 degrees and Re 3000..15000.

        Its slopes jump at every knot and lift jumps at -90 degrees: use it to reproduce
        published results, not for gradients.
        """
        return cls.from_name("published", lift_scale, drag_scale)

    @classmethod
    def smooth(cls, lift_scale=1.0, drag_scale=1.0) -> "Polar":
        """A cubic spline through the same values: twice differentiable, for gradients."""
        return cls.from_name("smooth", lift_scale, drag_scale)

    @classmethod
    def band_limited(
        cls, harmonics: int | None = None, lift_scale=1.0, drag_scale=1.0
    ) -> "Polar":
        """The measured coefficients regressed on waves of the angle of attack.

        It does not meet every measured value, as the others do, and knows how far the truth
        may be from it (see `spread`): for derivatives, and for how sure a result is.

        Args:
            harmonics: of beta on the full circle, 2 to 24, at every Re; by default those with
                the least error where a measured angle is left out.
            lift_scale, drag_scale: as in `Polar`.

        Raises:
            TypeError, ValueError: `harmonics` is no whole number, or out of range.
        """
        if harmonics is None:
            harmonics = best_harmonics()
        check_integer("harmonics", harmonics, FEWEST_HARMONICS, MOST_HARMONICS)
        return cls(_cells(f"{harmonics} harmonics"), lift_scale, drag_scale)

    def spread(self) -> "Polar | None":
        """Of a band-limited polar, by the covariance of the regression; else None.

        Raises:
            TypeError: within `jit`, where the cells are not known.
        """
        if is_traced(self.cells):
            raise TypeError("the spread of a polar is not known within jit: ask for it outside")
        name = name_of_cells(self.cells)
        if name is None or not name.endswith("harmonics"):
            return None
        cells = _deviating_cells(_harmonics(name)).astype(self.cells.dtype)
        none = np.zeros(len(cells), cells.dtype)
        parts = lambda polar: (polar.cells, polar.lift_scale, polar.drag_scale)  # noqa: E731
        return eqx.tree_at(parts, self, (cells, none, none))

    @property
    def measured_angles(self) -> tuple[float, float]:
        return MEASURED_ANGLES

    @property
    def measured_reynolds(self) -> tuple[float, float]:
        return float(REYNOLDS[0]), float(REYNOLDS[-1])

    def __call__(self, beta, reynolds):
        rows, columns, _, degree, _ = self.cells.shape
        x = beta * (rows / (2 * jnp.pi)) + rows / 2
        y = jnp.clip((reynolds - REYNOLDS[0]) / 2000.0, 0.0, float(columns))
        i = jnp.clip(jnp.floor(x), 0, rows - 1)
        j = jnp.clip(jnp.floor(y), 0, columns - 1)
        index = once(i * columns + j).astype(jnp.int32)
        index = jnp.clip(index, 0, rows * columns - 1)  # NaN angles stay in the table
        flat = self.cells.reshape(rows * columns, 2 * degree * degree)
        c = flat.at[index].get(mode="promise_in_bounds")
        lift, drag = _polynomials(c, x - i, y - j)
        return once(self.lift_scale * lift), once(self.drag_scale * drag)


def _polynomial(c, x, y) -> tuple[Array, Array]:
    """C_L and C_D, (...), from their coefficients (..., 2 k k), by Horner's rule."""
    degree = math.isqrt(c.shape[-1] // 2)

    def horner(terms, z):
        return terms[0] + z * horner(terms[1:], z) if len(terms) > 1 else terms[0]

    def evaluate(first):
        in_re = [[c[..., first + degree * p + q] for q in range(degree)] for p in range(degree)]
        return horner([horner(terms, y) for terms in in_re], x)

    return evaluate(0), evaluate(degree * degree)


@jax.custom_jvp
def _polynomials(c, x, y) -> tuple[Array, Array]:
    """The same; all tangents share its slopes."""
    return _polynomial(c, x, y)


def _polynomials_jvp(primals, tangents):
    c, x, y = primals
    rates = []
    along = (x, lambda x: _polynomial(c, x, y)), (y, lambda y: _polynomial(c, x, y))
    for (z, of), rate in zip(along, tangents[1:], strict=True):
        if not isinstance(rate, SymbolicZero):
            _, slopes = jax.jvp(of, (z,), (jnp.ones_like(z),))
            rates.append([once(slope) * rate for slope in slopes])
    if not isinstance(tangents[0], SymbolicZero):
        rates.append(_polynomial(tangents[0], x, y))
    return _polynomials(*primals), tuple(map(sum, zip(*rates, strict=True)))


_polynomials.defjvp(_polynomials_jvp, symbolic_zeros=True)  # type: ignore
