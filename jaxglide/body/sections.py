"""The body at its nodes, and how to integrate along it (figure S8)."""

import abc
from functools import lru_cache
from typing import Literal, TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_choice, check_given, check_integer, check_kind
from .._lib.fields import Part
from .._lib.types import Array, Nodes, NodesNodes, Scalar

NodeSet: TypeAlias = Literal["published", "gauss"]
NODE_SETS: tuple[str, ...] = ("published", "gauss")
NODES_RANGE = (8, 2000)
"""Fewest and most nodes."""


class Sections(eqx.Module):
    """The body at its n nodes.

    Attributes:
        fraction: arc length over the body's length, (n,).
        neck_fraction: end of the neck, in which bending ramps up from none at the snout;
            0 for a body without one.
        length: of the body [m].
        chord: chord [m], (n,).
        area: planform area of the element [m^2], (n,).
        mass: mass of the element [kg], (n,).
        total_mass: of the body [kg].
        axial_inertia: inertia of the element about the body's own axis [kg m^2], (n,), or None.
        unit_integral: `integral` of a body of unit length, (n, n): apart from the length, for
            then a body that grows does not change it, and its derivatives cost little.
    """

    fraction: Nodes
    neck_fraction: Scalar
    length: Scalar
    chord: Nodes
    area: Nodes
    mass: Nodes
    total_mass: Scalar
    axial_inertia: Nodes | None
    unit_integral: NodesNodes

    @property
    def integral(self) -> NodesNodes:
        """Matrix that integrates along the body a field given at the nodes and removes the
        mass-weighted mean of the result [m], (n, n); the result at node i is
        `sum_j field_j integral[j, i]`."""
        return self.length * self.unit_integral


class AbstractBody(Part):
    """What flies: the seam for a body of one's own.

    A body is a module with one method. Its floats may be traced, and derivatives are taken
    with respect to them; how many nodes it has may not depend on them.
    """

    @abc.abstractmethod
    def sections(self) -> Sections:
        """The body at its nodes.

        The masses are above 0 in sum, the chords above 0, and mass and area sum up to those
        of the body. Called once a flight, inside `jit`.
        """


@eqx.filter_jit  # outside of compiled code some thirty programs else, each compiled alone
def _sections(body: AbstractBody) -> Sections:
    return body.sections()


def discretise(body: AbstractBody) -> Sections:
    """The body at its nodes: area, mass and chord there, and how to integrate along it.

    Raises:
        TypeError, ValueError: a body of one's own gives something else.
    """
    found, kind = _sections(body), type(body).__name__
    check_kind(f"sections of {kind}", found, Sections)
    nodes = np.shape(found.fraction)
    for name in ("fraction", "chord", "area", "mass"):
        check_given(f"{name} of {kind}", getattr(found, name), nodes)
    check_given(f"unit_integral of {kind}", found.unit_integral, 2 * nodes)
    return found


def wing_area(body: AbstractBody) -> Scalar:
    """Planform area [m^2]."""
    return jnp.sum(discretise(body).area)


def surface_nodes(sections: Sections) -> np.ndarray:
    """Indices of the nodes that have area, front to rear: what is drawn of a body.

    A point mass has none, nor has a node beyond the end.
    """
    order = np.argsort(np.asarray(sections.fraction), kind="stable")
    return order[np.asarray(sections.area)[order] > 0]


def check_nodes(nodes, node_set) -> None:
    """Raise unless a number of nodes and the name of a set are allowed."""
    check_integer("nodes", nodes, *NODES_RANGE)
    check_choice("node_set", node_set, NODE_SETS)


@lru_cache
def _midpoint_rule(nodes: int) -> np.ndarray:
    """Cumulative trapezoid from node 0 at unit spacing: result_i = sum_j A[i, j] f_j."""
    matrix = np.tril(np.ones((nodes, nodes))) - 0.5 * np.eye(nodes)
    matrix[:, 0] -= 0.5
    matrix[0, 0] = 0.0
    return matrix


@lru_cache
def _gauss_panel(nodes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gauss-Legendre on [0, 1]: points, weights, exact cumulative integration matrix."""
    legendre = np.polynomial.legendre
    x, w = legendre.leggauss(nodes)
    degrees = np.arange(nodes)
    # f = sum_k a_k P_k with a_k = (2k + 1)/2 sum_j w_j P_k(x_j) f_j, integrated exactly.
    to_series = (degrees + 0.5)[:, None] * legendre.legvander(x, nodes - 1).T * w
    antiderivative = legendre.legint(np.eye(nodes), lbnd=-1, axis=0)
    from_series = legendre.legvander(x, nodes) @ antiderivative
    return (x + 1) / 2, w / 2, from_series @ to_series / 2


@lru_cache
def _gauss_rule(nodes: int):
    """Three panels: panel index, point in panel, weight, and integration matrix.

    The matrix is for panels of unit width; its columns scale with the panel's width.
    """
    short = max(3, nodes // 12)
    rules = [_gauss_panel(k) for k in (short, short, nodes - 2 * short)]
    panel = np.repeat(np.arange(3), [len(rule[0]) for rule in rules])
    point, weight = (np.concatenate([rule[i] for rule in rules]) for i in (0, 1))
    matrix = np.where(panel[:, None] > panel[None, :], weight[None, :], 0.0)
    for index, rule in enumerate(rules):
        inside = np.flatnonzero(panel == index)
        matrix[np.ix_(inside, inside)] = rule[2]
    return panel, point, weight, matrix


def midpoints(nodes: int, step) -> tuple[Array, Array, Array]:
    """The published nodes: fractions, weights and cumulative matrix, of s/L.

    Args:
        nodes: number of nodes.
        step: their spacing over the length; nodes that begin beyond the body weigh nothing.
    """
    index = jnp.arange(nodes)
    # a node is the body's where its element begins before the end, but for round-off
    weight = jnp.where(index * step < 1 - 1e-6, step, 0.0)
    return (index + 0.5) * step, weight, jnp.asarray(_midpoint_rule(nodes)) * step


def gauss_nodes(nodes: int, first, second) -> tuple[Array, Array, Array]:
    """Gauss-Legendre nodes on three panels: the same.

    Args:
        nodes: number of nodes.
        first, second: fractions where the panels meet, the kinks of the body.
    """
    panel, point, weight, matrix = _gauss_rule(nodes)
    start = jnp.stack([jnp.zeros_like(first), first, second])[panel]
    width = jnp.stack([first, second - first, 1 - second])[panel]
    return start + width * point, width * weight, jnp.asarray(matrix) * width


def centred(cumulative: Array, share: Array) -> Array:
    """`Sections.unit_integral`: integration over s/L less the mean by mass.

    Args:
        cumulative: cumulative integration matrix of s/L, (n, n).
        share: masses of the nodes over their sum, (n,).
    """
    return (cumulative - share @ cumulative).T
