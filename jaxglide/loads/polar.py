"""Section force coefficients and their extension beyond the measured angles.

Measured on an aerofoil with the snake's cross-section (Holden et al. 2014,
doi:10.1242/jeb.090902). Both polars are piecewise polynomials in the angle of attack and
the Reynolds number on one grid of cells; they differ in degree only.

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

MEASURED_ANGLES = (-10.0, 60.0)
"""Angles of attack within which coefficients were measured [deg]."""
REYNOLDS = np.arange(3000.0, 15001.0, 2000.0)
"""Reynolds numbers of the measurements, (7,)."""
ALPHA = np.arange(-10.0, 91.0, 5.0)
"""Angles of attack of the extended table [deg], (21,); measured to 60."""
_LARGEST = 1e3  # of a polynomial coefficient: no section comes near it

_LIFT = np.array(
    [
        [-0.22675, -0.41202, -0.46889, -0.54330, -0.45011, -0.45119, -0.54118],
        [-0.28298, -0.58908, -0.65507, -0.78313, -0.69828, -0.73020, -0.92629],
        [-0.50933, -0.66243, -0.69804, -0.76275, -0.71451, -0.74524, -0.76698],
        [-0.51737, -0.53187, -0.48373, -0.55708, -0.48915, -0.46366, -0.47324],
        [0.04247, 0.13458, 0.19880, 0.23990, 0.24323, 0.24669, 0.27402],
        [0.56881, 0.55304, 0.60312, 0.70459, 0.65080, 0.68263, 0.73989],
        [0.83848, 0.83108, 0.91241, 1.02776, 0.96539, 0.99228, 1.07329],
        [0.92120, 0.98066, 1.05762, 1.21100, 1.12271, 1.15238, 1.24631],
        [1.13018, 1.15955, 1.22699, 1.39943, 1.30234, 1.34523, 1.45209],
        [1.14460, 1.22730, 1.34801, 1.79514, 1.73560, 1.80036, 1.91365],
        [1.09770, 1.26810, 1.32193, 1.50009, 1.38071, 1.42236, 1.51284],
        [1.04975, 1.21980, 1.31015, 1.44548, 1.34351, 1.40294, 1.50492],
        [1.02167, 1.12453, 1.18085, 1.34688, 1.26836, 1.27007, 1.38877],
        [0.95800, 1.03505, 1.08048, 1.20607, 1.13650, 1.14238, 1.23793],
        [0.88767, 0.97602, 0.99975, 1.14078, 1.04725, 1.07043, 1.14229],
    ]
)
_DRAG = np.array(
    [
        [0.43486, 0.46409, 0.47499, 0.52687, 0.49011, 0.50208, 0.54158],
        [0.37349, 0.37154, 0.38539, 0.43595, 0.40435, 0.41815, 0.46085],
        [0.33250, 0.33696, 0.34938, 0.39917, 0.37505, 0.38733, 0.43753],
        [0.31892, 0.32235, 0.34590, 0.37964, 0.36553, 0.40662, 0.43803],
        [0.32600, 0.38289, 0.40988, 0.46106, 0.43600, 0.44391, 0.46885],
        [0.40892, 0.43359, 0.45770, 0.52281, 0.47954, 0.49743, 0.53203],
        [0.46275, 0.49317, 0.53012, 0.59040, 0.55208, 0.56553, 0.60831],
        [0.49986, 0.54059, 0.57099, 0.64719, 0.59826, 0.61209, 0.65836],
        [0.55810, 0.59711, 0.62550, 0.71002, 0.66035, 0.68131, 0.73402],
        [0.60098, 0.67866, 0.70442, 0.70741, 0.66079, 0.66094, 0.71938],
        [0.87052, 1.03343, 1.03499, 1.13054, 1.04045, 1.05944, 1.08919],
        [0.98144, 1.14088, 1.19927, 1.30150, 1.21728, 1.25929, 1.33044],
        [1.12651, 1.27981, 1.33685, 1.50217, 1.42195, 1.41345, 1.53178],
        [1.28611, 1.42883, 1.47262, 1.62623, 1.54021, 1.53506, 1.65131],
        [1.36197, 1.55138, 1.57948, 1.77548, 1.63220, 1.65856, 1.75309],
    ]
)


def extended_tables() -> tuple[np.ndarray, np.ndarray]:
    """C_L and C_D on (`ALPHA`, `REYNOLDS`), (21, 7): measured, continued to 90 degrees."""
    alpha = ALPHA[15:]
    # Drag: a parabola with its vertex at 90 degrees through the measured value at 60.
    top = np.linspace(2.0, 2.1, REYNOLDS.size)
    drag = top + (_DRAG[-1] - top) * ((90 - alpha[:, None]) / 30) ** 2
    # Lift: the minimum-norm cubic with C_L(90) = 0, C_L(60) and a slope at 60. As
    # published, the slope is per 5-degree step and its row lacks the linear term.
    powers = np.array([3, 2, 1, 0])
    rows = np.stack([90.0**powers, 60.0**powers, np.array([3 * 60.0**2, 2 * 60.0, 0, 0])])
    slope = 1.5 * _LIFT[-1] - 2 * _LIFT[-2] + 0.5 * _LIFT[-3]
    cubic = np.linalg.lstsq(rows, np.stack([0 * slope, _LIFT[-1], slope]), rcond=None)[0]
    lift = alpha[:, None] ** powers @ cubic
    return np.vstack([_LIFT, lift]), np.vstack([_DRAG, drag])


def _halves() -> dict[str, tuple[np.ndarray, np.ndarray, float]]:
    """Extended table, angles below it [deg], and sign behind the section, by name."""
    below = np.arange(-90.0, -10.0, 5.0)
    lift, drag = extended_tables()
    return {"lift": (lift, below, -1.0), "drag": (drag, below, 1.0)}


def _linear_cells() -> np.ndarray:
    """Cells (72, 6, 2, 2, 2) of the published polar: [beta, Re, C_L/C_D, power, power].

    Bilinear in the table, constant below -10 degrees; lift jumps at beta = -90 degrees,
    which the cells on either side represent exactly.
    """
    cells = []
    for table, below, sign in _halves().values():
        front = np.vstack([np.repeat(table[:1], below.size, axis=0), table])  # -90 to 90
        behind = sign * front[::-1]  # beta from 90 to 270
        pieces = (behind[18:], front, behind[:19])  # from -180 to 180
        cells.append(np.concatenate([_bilinear(piece) for piece in pieces]))
    return np.stack(cells, axis=2)


def _bilinear(values: np.ndarray) -> np.ndarray:
    """Coefficients (cells, 6, power of beta, power of Re) of bilinear cells."""
    along_re = np.stack([values[:, :-1], np.diff(values, axis=1)], axis=-1)
    return np.stack([along_re[:-1], np.diff(along_re, axis=0)], axis=2)


def _cubic_cells(harmonics: int | None = None) -> np.ndarray:
    """Cells (72, 6, 2, 4, 4) of the smooth polar: a tensor-product cubic spline.

    Periodic in beta, of which only so many harmonics may be kept, with zero end slopes in
    Re. Lift fades to zero from -10 to -90
    degrees (an assumption, as the published clamp is: nothing was measured there).
    """
    from scipy.interpolate import CubicSpline

    cells = []
    for name, (table, below, sign) in _halves().items():
        fade = np.sin(np.deg2rad(90 * (below + 90) / 80)) if name == "lift" else 1 + 0 * below
        front = np.vstack([fade[:, None] * table[0], table])  # -90 to 90
        behind = sign * front[::-1]  # 90 to 270
        circle = np.vstack([behind[18:], front[1:], behind[1:19]])  # -180 to 180
        if harmonics is not None:
            waves = np.fft.rfft(circle[:-1], axis=0)
            waves[harmonics + 1 :] = 0
            circle[:-1] = np.fft.irfft(waves, n=72, axis=0)
            circle[-1] = circle[0]
        knots = np.arange(circle.shape[0], dtype=float)
        in_beta = CubicSpline(knots, circle, bc_type="periodic").c[::-1]  # (4, 72, 7)
        numbers = np.arange(REYNOLDS.size, dtype=float)
        in_re = CubicSpline(numbers, in_beta, axis=2, bc_type="clamped").c[::-1]
        cells.append(in_re.transpose(3, 1, 2, 0))  # from (power, 6, power, 72)
    return np.stack(cells, axis=2)


@lru_cache
def _cells(kind: str) -> np.ndarray:
    if kind == "published":
        return _linear_cells()
    return _cubic_cells(None if kind == "smooth" else int(kind.split()[0]))


_NAMES = ("published", "smooth", *(f"{k} harmonics" for k in range(1, 37)))


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
            known ones: "published", "smooth", or "12 harmonics" (see `band_limited`).
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
    def band_limited(cls, harmonics: int = 12, lift_scale=1.0, drag_scale=1.0) -> "Polar":
        """The smooth polar of coefficients low-passed in the angle of attack.

        Nobody measured how they run between the table's angles, 5 degrees apart: how much
        that matters shows where it is left out.

        Args:
            harmonics: of beta on the full circle that are kept, 1 to 36, at every Re.
            lift_scale, drag_scale: as in `Polar`.

        Raises:
            TypeError, ValueError: `harmonics` is no whole number, or out of range.
        """
        check_integer("harmonics", harmonics, 1, 36)
        return cls(_cells(f"{harmonics} harmonics"), lift_scale, drag_scale)

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
