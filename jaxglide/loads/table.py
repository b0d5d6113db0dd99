"""A section's coefficients from a user's own table."""

import itertools
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import is_traced
from .._lib.columns import TableError, read_columns
from .._lib.fields import about, floats
from .._lib.types import Array, Float, Scalar
from .polar import AbstractPolar, scale_of


class TabulatedPolar(AbstractPolar):
    """Coefficients at angles of attack and Reynolds numbers, linear between them.

    Outside the table the nearest values hold, up to +-90 degrees; beyond, the section is
    taken as symmetric fore and aft. A table that goes beyond +-90 degrees itself must reach
    from -180 to 180 degrees, and is taken as it is.

    Args:
        angle_of_attack: rising [rad], (A,), A at least 2.
        reynolds: rising, (R,); one value for coefficients that do not depend on it.
        lift, drag: C_L and C_D, (A, R); drag 0 or more.
        lift_scale, drag_scale: as in `Polar`.

    Raises:
        TypeError: a value is not a number.
        ValueError: angles or Reynolds numbers that do not rise, or coefficients of another
            shape or range.

    Examples:
        >>> import math
        >>> from jaxglide import TabulatedPolar
        >>> angles = [math.radians(a) for a in (-10, 0, 30, 60)]
        >>> lift, drag = [[-0.5], [0], [1.2], [0.9]], [[0.4], [0.3], [0.7], [1.4]]
        >>> polar = TabulatedPolar(angles, [5000], lift, drag)
        >>> lift, drag = polar(math.radians(15), 7000.0)
        >>> print(f"{lift:.2f} {drag:.2f}")
        0.60 0.50
    """

    angle_of_attack: Float[Array, " A"] = eqx.field(
        converter=floats, metadata=about("deg", "angle of attack", low=-180, high=180)
    )
    reynolds: Float[Array, " R"] = eqx.field(
        converter=floats, metadata=about("", "Reynolds number", low=0, high=1e9)
    )
    lift: Float[Array, "A R"] = eqx.field(
        converter=floats, metadata=about("", "lift coefficient", low=-1e3, high=1e3)
    )
    drag: Float[Array, "A R"] = eqx.field(
        converter=floats, metadata=about("", "drag coefficient", low=0, high=1e3)
    )
    lift_scale: Scalar = eqx.field(
        converter=floats, default=1.0, metadata=scale_of("multiplier on the lift coefficient")
    )
    drag_scale: Scalar = eqx.field(
        converter=floats, default=1.0, metadata=scale_of("multiplier on the drag coefficient")
    )

    def _check(self):
        shape = self.angle_of_attack.shape[0], self.reynolds.shape[0]
        for name in ("lift", "drag"):
            found = getattr(self, name).shape
            if found != shape:
                raise ValueError(
                    f"{name} has shape {found}: it must be {shape}, by angles and Reynolds "
                    "numbers"
                )
        if shape[0] < 2:
            raise ValueError(f"angle_of_attack has {shape[0]} values: it needs at least 2")
        if is_traced(self.angle_of_attack) or is_traced(self.reynolds):
            return
        degrees = np.rad2deg(self.angle_of_attack)
        for name, values, unit in (
            ("angle_of_attack", degrees, " deg"),
            ("reynolds", np.asarray(self.reynolds), ""),
        ):
            for before, after in itertools.pairwise(values):
                if not after > before:
                    raise ValueError(
                        f"{name} goes from {before:g} to {after:g}{unit}: it must rise"
                    )
        if np.any(np.abs(degrees) > 90 + 1e-9) and not np.allclose(
            degrees[[0, -1]], (-180, 180)
        ):
            raise ValueError(
                f"angle_of_attack runs from {degrees[0]:g} to {degrees[-1]:g} deg: it must "
                "stay within [-90, 90] deg, or run from -180 to 180 deg"
            )

    @classmethod
    def from_csv(cls, path: str | Path, lift_scale=1.0, drag_scale=1.0) -> "TabulatedPolar":
        """A polar from a CSV file with the columns angle_of_attack [deg], lift and drag.

        A column `reynolds` may stand beside them; then every Reynolds number has the same
        angles.

        Raises:
            ValueError: the file lacks a column, an angle of one of its Reynolds numbers, or
                holds what is not allowed; one sentence names it.
            OSError: it cannot be read.
        """
        columns = read_columns(path, ("angle_of_attack", "lift", "drag"), ("reynolds",))
        angle = columns["angle_of_attack"]
        number = columns.get("reynolds", np.zeros_like(angle))
        angles, numbers = np.unique(angle), np.unique(number)
        table = np.full((2, angles.size, numbers.size), np.nan)
        for k in range(angle.size):
            i, j = np.searchsorted(angles, angle[k]), np.searchsorted(numbers, number[k])
            if not np.isnan(table[0, i, j]):
                raise TableError(
                    f"{path}: angle_of_attack = {angle[k]:g} deg stands twice"
                    + (f" at reynolds = {number[k]:g}" if "reynolds" in columns else "")
                )
            table[:, i, j] = columns["lift"][k], columns["drag"][k]
        for re in numbers:
            falls = np.flatnonzero(np.diff(angle[number == re]) < 0)
            if falls.size:
                before, after = angle[number == re][falls[0] : falls[0] + 2]
                raise TableError(
                    f"{path}: angle_of_attack goes from {before:g} to {after:g} deg: it must "
                    "rise" + (f" at reynolds = {re:g}" if "reynolds" in columns else "")
                )
        if np.isnan(table).any():
            _, i, j = np.argwhere(np.isnan(table))[0]
            raise TableError(
                f"{path}: angle_of_attack = {angles[i]:g} deg is missing at reynolds = "
                f"{numbers[j]:g}"
            )
        try:
            return cls(
                angle_of_attack=np.deg2rad(angles),
                reynolds=numbers,
                lift=table[0],
                drag=table[1],
                lift_scale=lift_scale,
                drag_scale=drag_scale,
            )
        except ValueError as error:
            raise TableError(f"{path}: {error}") from None

    @property
    def measured_angles(self) -> tuple[float, float]:
        """Lowest and highest angle of the table [deg]."""
        degrees = np.rad2deg(np.asarray(self.angle_of_attack))
        return float(degrees[0]), float(degrees[-1])

    @property
    def measured_reynolds(self) -> tuple[float, float]:
        """Lowest and highest Reynolds number of the table; none to all where it has one."""
        if self.reynolds.shape[0] == 1:
            return 0.0, np.inf
        return float(self.reynolds[0]), float(self.reynolds[-1])

    def __call__(self, beta, reynolds):
        # a table of the full circle is looked up as it is, any other one is folded
        whole = self.angle_of_attack[-1] > 0.51 * jnp.pi
        behind = ~whole & (jnp.abs(beta) > jnp.pi / 2)
        folded = jnp.where(behind, jnp.sign(beta) * jnp.pi - beta, beta)
        row, x = _place(folded, self.angle_of_attack)
        table = jnp.stack([self.lift, self.drag])
        if self.reynolds.shape[0] == 1:
            below, above = table[:, row, 0], table[:, row + 1, 0]
            lift, drag = below + x * (above - below)
        else:
            column, y = _place(reynolds, self.reynolds)
            (a, b), (c, d) = (
                (table[:, row + i, column], table[:, row + i, column + 1]) for i in (0, 1)
            )
            lift, drag = (1 - x) * ((1 - y) * a + y * b) + x * ((1 - y) * c + y * d)
        sign = jnp.where(behind, -1.0, 1.0)
        return sign * self.lift_scale * lift, self.drag_scale * drag


def _place(values, knots):
    """Index of the cell that values are in, clamped, and where in it, 0 to 1."""
    inside = jnp.clip(values, knots[0], knots[-1])
    index = jnp.clip(jnp.searchsorted(knots, inside, side="right") - 1, 0, knots.shape[0] - 2)
    return index, (inside - knots[index]) / (knots[index + 1] - knots[index])
