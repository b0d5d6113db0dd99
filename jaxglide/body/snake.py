"""The snake's morphology (figure S8).

A `Snake` holds what can be measured or designed; its `sections` are the arrays along the
body that the physics works on. Arc length s runs from the snout (0) to the vent (L);
`fraction` is s/L.
"""

from functools import lru_cache
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_range, in_numpy, is_traced
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

PUBLISHED_NECK = 0.055 / 0.70
"""Fraction of SVL at which the published model's neck ends (its node at 5.5 cm)."""

# Parabolas (h, k, p) of (x - h)^2/(4p) + k in x = s/L: chord/L, and linear density.
_CHORD = (0.51220022, 0.02895101, -4.88957129)
_HEAD_DENSITY = (0.01661771, 1.36099325, -0.00012991)
_BODY_DENSITY = (0.52583598, 1.11461374, -0.10778636)
_HEAD_END = 0.037
LEAST_GYRATION = 1e-5  # below it the inertia would be round-off


def mass_from_length(svl):
    """Mass [kg] of a flying snake of a snout-vent length [m], after 17 animals.

    Socha and LaBarbera 2005, doi:10.1242/jeb.01579.
    """
    svl = in_numpy(svl)
    xp: Any = jnp if is_traced(svl) else np
    return 1e-3 * xp.exp(-9.94919177 + 3.19831074 * xp.log(100 * svl))


def _by_length(snake: "Snake") -> Scalar:
    return mass_from_length(snake.length)


class Snake(AbstractBody):
    """A gliding body: size, mass, planform, mass distribution, and its nodes.

    Use `Snake.from_svl` for an animal. A robot sets its own parabolas, or is a
    `TabulatedBody`.

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

    length: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "m", "snout-vent length", symbol="L", low=0, high=100, low_open=True, short="svl"
        ),
    )
    mass: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "kg", "mass", symbol="m", low=0, high=1e5, low_open=True, rule=_by_length
        ),
    )
    neck_fraction: Scalar = eqx.field(
        converter=floats,
        default=PUBLISHED_NECK,
        metadata=about(
            "of SVL", "end of the neck", low=0, high=0.5, low_open=True, high_open=True
        ),
    )
    chord: Float[Array, "3"] = eqx.field(
        converter=floats, default=_CHORD, metadata=about("", "parabola of the chord")
    )
    head_density: Float[Array, "3"] = eqx.field(
        converter=floats,
        default=_HEAD_DENSITY,
        metadata=about("", "parabola of the head's density"),
    )
    body_density: Float[Array, "3"] = eqx.field(
        converter=floats,
        default=_BODY_DENSITY,
        metadata=about("", "parabola of the body's density"),
    )
    head_fraction: Scalar = eqx.field(
        converter=floats,
        default=_HEAD_END,
        metadata=about(
            "of SVL", "end of the head", low=0, high=0.5, low_open=True, high_open=True
        ),
    )
    gyration: Scalar | None = eqx.field(
        converter=floats,
        default=None,
        kw_only=True,
        metadata=about(
            "chords", "radius of gyration about the body's own axis", low=LEAST_GYRATION, high=1
        ),
    )
    nodes: int = eqx.field(static=True, default=70)
    node_set: NodeSet = eqx.field(static=True, default="published")
    spacing: float | None = eqx.field(static=True, default=None)

    def _check(self):
        self._check_profiles()
        check_nodes(self.nodes, self.node_set)
        if self.spacing is not None:
            check_range("spacing", self.spacing, "m", 0, 100, low_open=True)
            if self.node_set == "gauss":
                raise ValueError("spacing is for node_set = 'published' only")
            reach = self.nodes * self.spacing
            if not is_traced(self.length) and reach < (1 - 1e-6) * float(self.length):
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
            if not (is_traced(coefficients) or is_traced(end)):
                parabola = np.asarray(coefficients).tolist()
                _check_profile(name, *parabola, float(low), float(high), most)

    @classmethod
    def from_svl(cls, svl=0.70, mass=None, **fields) -> "Snake":
        """A flying snake (Chrysopelea paradisi) of the given snout-vent length.

        Args:
            svl: snout-vent length [m].
            mass: mass [kg]; by default from the length (`mass_from_length`).
            **fields: any other field of `Snake`.

        Examples:
            >>> from jaxglide import Snake
            >>> snake = Snake.from_svl(0.70, node_set="gauss", nodes=60)
            >>> print(f"{1e3 * snake.mass:.2f} g")
            38.05 g
        """
        check_range("svl", svl, "m", 0, 100, low_open=True, shape=())
        mass = mass_from_length(svl) if mass is None else mass
        return cls(svl, mass, **fields)

    def sections(self) -> Sections:
        """The snake at its nodes; see `AbstractBody.sections`."""
        fraction, weight, cumulative = self._quadrature()
        density = jnp.where(
            fraction <= self.head_fraction,
            _parabola(fraction, self.head_density),
            _parabola(fraction, self.body_density),
        )
        share = density * weight / jnp.sum(density * weight)
        chord = self.length * _parabola(jnp.where(weight > 0, fraction, 1.0), self.chord)
        axial = None
        if self.gyration is not None:
            axial = self.mass * share * (self.gyration * chord) ** 2
        return Sections(
            fraction=fraction,
            neck_fraction=self.neck_fraction,
            length=self.length,
            chord=chord,
            area=chord * weight * self.length,
            mass=self.mass * share,
            total_mass=self.mass,
            axial_inertia=axial,
            unit_integral=centred(cumulative, share),
        )

    def _quadrature(self):
        """Node fractions, weights (sum about 1) and cumulative integration matrix, of s/L."""
        if self.node_set == "published":
            step = 1 / self.nodes if self.spacing is None else self.spacing / self.length
            return midpoints(self.nodes, step)
        ends = self.head_fraction, self.neck_fraction
        return gauss_nodes(self.nodes, jnp.minimum(*ends), jnp.maximum(*ends))


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


def _parabola(x, coefficients):
    h, k, p = coefficients[0], coefficients[1], coefficients[2]
    return (x - h) ** 2 / (4 * p) + k
