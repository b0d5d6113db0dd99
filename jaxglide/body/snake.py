"""The snake's morphology and its division into nodes (figure S8).

A `Snake` holds what can be measured or designed; `discretise` turns it into `Sections`,
the arrays along the body that the physics works on. Arc length s runs from the snout
(0) to the vent (L); `fraction` is s/L.
"""

from functools import lru_cache
from typing import Literal, TypeAlias

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import (
    check_choice,
    check_integer,
    check_range,
    check_shapes,
    is_traced,
    number,
    optional_number,
)
from .._lib.parameters import PUBLISHED_NECK
from .._lib.types import Array, Float, Nodes, NodesNodes, Scalar

NodeSet: TypeAlias = Literal["published", "gauss"]

# Parabolas (h, k, p) of (x - h)^2/(4p) + k in x = s/L: chord/L, and linear density.
_CHORD = (0.51220022, 0.02895101, -4.88957129)
_HEAD_DENSITY = (0.01661771, 1.36099325, -0.00012991)
_BODY_DENSITY = (0.52583598, 1.11461374, -0.10778636)
_HEAD_END = 0.037
_LEAST_GYRATION = 1e-5  # below it the inertia would be round-off


class Snake(eqx.Module):
    """A gliding body: size, mass, planform, mass distribution, and its nodes.

    Use `Snake.from_svl` for an animal. A robot sets its own parabolas.

    Args:
        length: snout-vent length L [m], above 0.
        mass: total mass [kg], above 0.
        neck_fraction: end of the straight-ramped neck, fraction of L in (0, 0.5).
        chord: (h, k, p) of the chord/L, `(x - h)^2/(4p) + k` in x = s/L, shape (3,).
        head_density, body_density: the same for the linear mass density, up to a factor
            that `mass` fixes, before and after `head_fraction`, shape (3,).
        head_fraction: where the density changes from head to body, fraction of L.
        gyration: radius of gyration of a section about the body's own axis, in chords, 1e-5
            to 1; a flat ellipse has 0.25. By default None, as published: all mass lies on
            the backbone, and a straight body, which then has no inertia that could turn it
            about itself, is refused. A gyration costs two fifths more time in a batch.
        nodes: number of nodes, 8 to 2000 (static).
        node_set: "published" (midpoints and trapezoid rule, for comparison with the
            paper) or "gauss" (Gauss-Legendre on three panels, converges fast; static).
        spacing: node spacing [m] of the published set where it is not L/nodes (static).
            The body then has L/spacing nodes, rounded up, and nodes beyond it weigh
            nothing: snakes of several lengths share one compiled function.

    Raises:
        ValueError: a value is not finite, out of range or of the wrong shape, or the chord
            or the density is not above 0 all along.
    """

    length: Scalar = eqx.field(converter=number("length"))
    mass: Scalar = eqx.field(converter=number("mass"))
    neck_fraction: Scalar = eqx.field(converter=number("neck_fraction"), default=PUBLISHED_NECK)
    chord: Float[Array, "3"] = eqx.field(converter=number("chord"), default=_CHORD)
    head_density: Float[Array, "3"] = eqx.field(
        converter=number("head_density"), default=_HEAD_DENSITY
    )
    body_density: Float[Array, "3"] = eqx.field(
        converter=number("body_density"), default=_BODY_DENSITY
    )
    head_fraction: Scalar = eqx.field(converter=number("head_fraction"), default=_HEAD_END)
    gyration: Scalar | None = eqx.field(
        converter=optional_number("gyration"), default=None, kw_only=True
    )
    nodes: int = eqx.field(static=True, default=70)
    node_set: NodeSet = eqx.field(static=True, default="published")
    spacing: float | None = eqx.field(static=True, default=None)

    def __check_init__(self):
        check_shapes(self)
        check_range("length", self.length, "m", 0, 100, low_open=True)
        check_range("mass", self.mass, "kg", 0, 1e5, low_open=True)
        check_range(
            "neck_fraction", self.neck_fraction, "of SVL", 0, 0.5, low_open=True, high_open=True
        )
        check_range(
            "head_fraction", self.head_fraction, "of SVL", 0, 0.5, low_open=True, high_open=True
        )
        if self.gyration is not None:
            check_range("gyration", self.gyration, "chords", _LEAST_GYRATION, 1)
        self._check_profiles()
        check_integer("nodes", self.nodes, 8, 2000)
        check_choice("node_set", self.node_set, ("published", "gauss"))
        if self.spacing is not None:
            check_range("spacing", self.spacing, "m", 0, 100, low_open=True)
            if self.node_set == "gauss":
                raise ValueError("spacing is for node_set = 'published' only")
            reach = self.nodes * self.spacing
            if not is_traced(self.length) and reach < (1 - 1e-6) * self.length:
                raise ValueError(
                    f"nodes = {self.nodes} at a spacing of {self.spacing:g} m reach "
                    f"{reach:g} m only, less than the length of {self.length:g} m"
                )

    def _check_profiles(self):
        """The body has a width and a mass all along."""
        end = self.head_fraction
        for name, low, high, most in (
            ("chord", 0.0, 1.0, 1.0),
            ("head_density", 0.0, end, np.inf),
            ("body_density", end, 1.0, np.inf),
        ):
            coefficients = getattr(self, name)
            check_range(name, coefficients, "")
            if not (is_traced(coefficients) or is_traced(end)):
                parabola = np.asarray(coefficients).tolist()
                _check_profile(name, *parabola, float(low), float(high), most)

    @classmethod
    def from_svl(cls, svl=0.70, mass=None, **fields) -> "Snake":
        """A flying snake (Chrysopelea paradisi) of the given snout-vent length.

        Args:
            svl: snout-vent length [m].
            mass: mass [kg]; by default from the length, after 17 animals (Socha and
                LaBarbera 2005, doi:10.1242/jeb.01579).
            **fields: any other field of `Snake`.
        """
        check_range("svl", svl, "m", 0, 100, low_open=True, shape=())
        if mass is None:
            centimetres = 100 * jnp.asarray(svl, float)
            mass = 1e-3 * jnp.exp(-9.94919177 + 3.19831074 * jnp.log(centimetres))
        return cls(svl, mass, **fields)


@lru_cache(maxsize=64)
def _check_profile(name, h, k, p, low, high, most):
    """Raise `ValueError` unless a parabola is in (0, most] on [low, high]."""
    if p == 0:
        raise ValueError(f"{name} = ({h:g}, {k:g}, {p:g}) is not allowed: p must not be 0")
    # its extremes are at the ends and at its vertex
    for x in (low, high, min(max(h, low), high)):
        value = _parabola(x, (h, k, p))
        if not 0 < value <= most:
            bracket = "]" if np.isfinite(most) else ")"
            raise ValueError(
                f"{name} = {value:g} at s/L = {x:g} is not allowed: it must be in "
                f"(0, {most:g}{bracket} all along the body"
            )


class Sections(eqx.Module):
    """The body at its n nodes.

    Attributes:
        fraction: arc length over SVL, (n,).
        chord: chord [m], (n,).
        area: planform area of the element [m^2], (n,).
        mass: mass of the element [kg], (n,).
        axial_inertia: inertia of the element about the body's own axis [kg m^2], (n,), or None.
        integral: matrix that integrates along the body a field given at the nodes and
            removes the mass-weighted mean of the result [m], (n, n); the result at node i
            is `sum_j field_j integral[j, i]`.
    """

    fraction: Nodes
    chord: Nodes
    area: Nodes
    mass: Nodes
    axial_inertia: Nodes | None
    integral: NodesNodes


def _parabola(x, coefficients):
    h, k, p = coefficients[0], coefficients[1], coefficients[2]
    return (x - h) ** 2 / (4 * p) + k


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


def _quadrature(snake: Snake) -> tuple[Array, Array, Array]:
    """Node fractions, weights (sum about 1) and cumulative integration matrix, of s/L."""
    if snake.node_set == "published":
        step = 1 / snake.nodes if snake.spacing is None else snake.spacing / snake.length
        index = jnp.arange(snake.nodes)
        fraction = (index + 0.5) * step
        # a node is the body's where its element begins before the vent, but for round-off
        weight = jnp.where(index * step < 1 - 1e-6, step, 0.0)
        return fraction, weight, jnp.asarray(_midpoint_rule(snake.nodes)) * step
    panel, point, weight, matrix = _gauss_rule(snake.nodes)
    first = jnp.minimum(snake.head_fraction, snake.neck_fraction)
    second = jnp.maximum(snake.head_fraction, snake.neck_fraction)
    start = jnp.stack([jnp.zeros_like(first), first, second])[panel]
    width = jnp.stack([first, second - first, 1 - second])[panel]
    return start + width * point, width * weight, jnp.asarray(matrix) * width


def discretise(snake: Snake) -> Sections:
    """The snake at its nodes: area, mass and chord there, and how to integrate along it."""
    fraction, weight, cumulative = _quadrature(snake)
    density = jnp.where(
        fraction <= snake.head_fraction,
        _parabola(fraction, snake.head_density),
        _parabola(fraction, snake.body_density),
    )
    share = density * weight / jnp.sum(density * weight)
    chord = snake.length * _parabola(jnp.where(weight > 0, fraction, 1.0), snake.chord)
    centred = cumulative - share @ cumulative
    axial = None
    if snake.gyration is not None:
        axial = snake.mass * share * (snake.gyration * chord) ** 2
    return Sections(
        fraction=fraction,
        chord=chord,
        area=chord * weight * snake.length,
        mass=snake.mass * share,
        axial_inertia=axial,
        integral=snake.length * centred.T,
    )


def wing_area(snake: Snake) -> Scalar:
    """Planform area [m^2]."""
    return jnp.sum(discretise(snake).area)
