"""A body given by tables along its length: a robot, or an animal as measured."""

import itertools
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import is_traced
from .._lib.columns import read_columns
from .._lib.fields import about, floats
from .._lib.types import Array, Float, Scalar
from .sections import (
    AbstractBody,
    NodeSet,
    Sections,
    centred,
    check_nodes,
    gauss_nodes,
    midpoints,
)
from .snake import LEAST_GYRATION

_LEAST = 1e-6  # of the length, that a panel of nodes is wide


class _Columns(NamedTuple):
    """A body's table: arc length [m], chord [m], linear density [kg/m]."""

    position: np.ndarray
    chord: np.ndarray
    density: np.ndarray


class TabulatedBody(AbstractBody):
    """A body by chord and linear mass density along its length, and point masses on it.

    Between the stations both run straight. Mass, length and centre of mass follow: the mass
    is the integral of the density, and the point masses (a battery, motors) come on top.

    Args:
        position: arc length of the stations from the front end [m], rising from 0, (K,), K at
            least 2; the last is the body's length.
        chord: chord there [m], above 0, (K,).
        density: mass per length there [kg/m], 0 or more, (K,).
        point_position: arc length of the point masses [m], (M,); by default none.
        point_mass: point masses [kg], 0 or more, (M,).
        neck_fraction: end of the neck, in which bending ramps up from the front end, as a
            fraction of the length, 0 to 0.5; by default 0, none.
        gyration: as in `Snake`.
        nodes, node_set: as in `Snake` (static). The Gauss set has its panels meet at the
            neck's end and at a tenth of the length; where a table has kinks elsewhere, give
            it more nodes.

    Raises:
        TypeError: a value is not a number.
        ValueError: the stations do not rise from 0, arrays differ in length, a value is out
            of range, or the body has no mass.

    Examples:
        >>> from jaxglide import TabulatedBody
        >>> robot = TabulatedBody(
        ...     position=[0, 0.4, 0.8],  # m
        ...     chord=[0.03, 0.05, 0.02],  # m
        ...     density=[0.03, 0.05, 0.02],  # kg/m
        ...     point_position=[0.3],
        ...     point_mass=[0.015],  # kg
        ... )
        >>> print(f"{robot.length:.2f} m, {1e3 * robot.mass:.1f} g")
        0.80 m, 45.0 g
    """

    position: Float[Array, " K"] = eqx.field(
        converter=floats, metadata=about("m", "arc length of the stations", low=0, high=100)
    )
    chord: Float[Array, " K"] = eqx.field(
        converter=floats, metadata=about("m", "chord", low=0, high=100, low_open=True)
    )
    density: Float[Array, " K"] = eqx.field(
        converter=floats, metadata=about("kg/m", "mass per length", low=0, high=1e5)
    )
    point_position: Float[Array, " M"] = eqx.field(
        converter=floats,
        default=(),
        metadata=about("m", "arc length of the point masses", low=0, high=100),
    )
    point_mass: Float[Array, " M"] = eqx.field(
        converter=floats, default=(), metadata=about("kg", "point masses", low=0, high=1e5)
    )
    neck_fraction: Scalar = eqx.field(
        converter=floats,
        default=0.0,
        kw_only=True,
        metadata=about("of SVL", "end of the neck", low=0, high=0.5),
    )
    gyration: Scalar | None = eqx.field(
        converter=floats,
        default=None,
        kw_only=True,
        metadata=about(
            "chords", "radius of gyration about the body's own axis", low=LEAST_GYRATION, high=1
        ),
    )
    nodes: int = eqx.field(static=True, default=70, kw_only=True)
    node_set: NodeSet = eqx.field(static=True, default="published", kw_only=True)

    def _check(self):
        check_nodes(self.nodes, self.node_set)
        stations, points = self.position.shape[0], self.point_position.shape[0]
        for name, count in (("chord", stations), ("density", stations), ("point_mass", points)):
            if getattr(self, name).shape[0] != count:
                along = "point_position" if name == "point_mass" else "position"
                raise ValueError(
                    f"{name} has {getattr(self, name).shape[0]} values: {along} has {count}"
                )
        if stations < 2:
            raise ValueError(f"position has {stations} stations: a body has at least 2")
        if not is_traced(self.position):
            self._check_stations()
        masses = self.density, self.point_mass
        if not any(map(is_traced, masses)) and not any(np.asarray(m).any() for m in masses):
            raise ValueError("density and point_mass are all 0: the body has no mass")

    def _check_stations(self):
        position = np.asarray(self.position)
        if position[0] != 0:
            raise ValueError(f"position starts at {position[0]:g} m: it must start at 0")
        for before, after in itertools.pairwise(position):
            if not after > before:
                raise ValueError(
                    f"position goes from {before:g} to {after:g} m: it must rise from station "
                    "to station"
                )
        if is_traced(self.point_position):
            return
        worst = np.asarray(self.point_position).max(initial=0.0)
        if worst > position[-1]:
            raise ValueError(
                f"point_position = {worst:g} m lies beyond the body's length of "
                f"{position[-1]:g} m"
            )

    @classmethod
    def from_csv(cls, path: str | Path, **fields) -> "TabulatedBody":
        """A body from a CSV file with the columns position, chord and density (SI units).

        A column `point_mass` may stand beside them: what is fixed to the body at that
        station [kg].

        Args:
            path: the file.
            **fields: other fields of `TabulatedBody`.

        Raises:
            ValueError: the file lacks a column, or holds what is not allowed.
            OSError: it cannot be read.
        """
        wanted, optional = ("position", "chord", "density"), ("point_mass",)
        columns = read_columns(path, wanted, optional)
        masses = columns.pop("point_mass", None)
        if masses is not None:
            there = masses != 0
            columns |= {
                "point_position": columns["position"][there],
                "point_mass": masses[there],
            }
        try:
            return cls(**columns, **fields)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @property
    def length(self) -> Scalar:
        """Of the body [m]."""
        return self.position[-1]

    @property
    def mass(self) -> Scalar:
        """Of the body and its point masses [kg]."""
        return self._spread_mass() + jnp.sum(self.point_mass)

    def _spread_mass(self) -> Scalar:
        middle = (self.density[1:] + self.density[:-1]) / 2
        return jnp.sum(middle * jnp.diff(self.position))

    def sections(self) -> Sections:
        """The body at its nodes, and at its point masses, which are nodes without area."""
        length = self.length
        fraction, weight, cumulative = self._quadrature()
        at = fraction * length
        density = jnp.interp(at, self.position, self.density) * weight
        # the table's own integral, to the last digit, whatever the nodes
        total = jnp.sum(density)
        spread = density * (self._spread_mass() / jnp.where(total == 0, 1.0, total))
        fraction, weight, cumulative = self._with_points(fraction, weight, cumulative)
        chord = jnp.interp(fraction * length, self.position, self.chord)
        mass = jnp.concatenate([spread, self.point_mass])
        axial = None if self.gyration is None else mass * (self.gyration * chord) ** 2
        return Sections(
            fraction=fraction,
            neck_fraction=self.neck_fraction,
            length=length,
            chord=chord,
            area=chord * weight * length,
            mass=mass,
            total_mass=jnp.sum(mass),
            axial_inertia=axial,
            unit_integral=centred(cumulative, mass / jnp.sum(mass)),
        )

    def _quadrature(self):
        if self.node_set == "published":
            return midpoints(self.nodes, 1 / self.nodes)
        neck = jnp.clip(self.neck_fraction, _LEAST, 0.5)
        tenth = jnp.full_like(neck, 0.1)
        return gauss_nodes(self.nodes, jnp.minimum(neck, tenth), jnp.maximum(neck, tenth))

    def _with_points(self, fraction, weight, cumulative):
        """Nodes and the point masses behind them, which bring no weight.

        Where a point lies is integrated from its neighbours, linearly between the nodes.
        """
        points = self.point_position.shape[0]
        if not points:
            return fraction, weight, cumulative
        at = self.point_position / self.length
        place = _between(at, fraction) @ cumulative
        rows = jnp.concatenate([cumulative, place])
        return (
            jnp.concatenate([fraction, at]),
            jnp.concatenate([weight, jnp.zeros(points)]),
            jnp.concatenate([rows, jnp.zeros((rows.shape[0], points))], axis=1),
        )


def _between(x, nodes):
    """Matrix that interpolates linearly, or beyond the ends extrapolates, (M, n)."""
    i = jnp.clip(jnp.searchsorted(nodes, x) - 1, 0, nodes.shape[0] - 2)
    share = (x - nodes[i]) / (nodes[i + 1] - nodes[i])
    row = jnp.arange(x.shape[0])
    matrix = jnp.zeros((x.shape[0], nodes.shape[0]))
    return matrix.at[row, i].set(1 - share).at[row, i + 1].set(share)
