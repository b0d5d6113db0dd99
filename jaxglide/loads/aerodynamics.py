"""Aerodynamics of the body's elements: sweep theory (eqs 23-26), and its circulation lagging.

Only the air's velocity normal to the body makes force. All in body axes.
"""

import abc
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp

from .._lib.checks import check_given, check_kind
from .._lib.fields import Part, about, floats
from .._lib.numerics import arctan2, once, safe_sqrt
from .._lib.types import Array, Float, Nodes, Nodes3, Scalar
from .polar import AbstractPolar


class Flow(NamedTuple):
    """The elements and how they move through the air, in body axes.

    Attributes:
        velocity: of the elements through the air [m/s], (3, n).
        position: from the centre of mass [m], (3, n).
        tangent, chord_direction, normal: unit vectors along the body, along the chord and out
            of the back, (3, n).
        chord: chord [m], (n,).
        area: planform area [m^2], (n,); 0 for an element that is a point mass.
        air_density: [kg/m^3].
        kinematic_viscosity: of the air [m^2/s].
    """

    velocity: Nodes3
    position: Nodes3
    tangent: Nodes3
    chord_direction: Nodes3
    normal: Nodes3
    chord: Nodes
    area: Nodes
    air_density: Scalar
    kinematic_viscosity: Scalar


class Aerodynamics(eqx.Module):
    """The air's action on each element of the body.

    Attributes:
        force: force on the element in body axes [N], (3, n).
        lift, drag: magnitude-signed parts of it [N], (n,); lift is positive dorsally in
            everyday sinking flight.
        beta: angle of attack on the full circle [rad], (n,).
        angle_of_attack: folded fore and aft, in +-pi/2 [rad], (n,).
        sweep_angle: between the air and the plane normal to the body [rad], (n,).
        reynolds: Reynolds number on chord and total speed, (n,).
        dynamic_pressure: of the speed normal to the body [Pa], (n,).
        lift_coefficient, drag_coefficient: C_L (with the fold's sign) and C_D, (n,).
        speed: total speed of the element through the air [m/s], (n,).
    """

    force: Nodes3
    lift: Nodes
    drag: Nodes
    beta: Nodes
    angle_of_attack: Nodes
    sweep_angle: Nodes
    reynolds: Nodes
    dynamic_pressure: Nodes
    lift_coefficient: Nodes
    drag_coefficient: Nodes
    speed: Nodes


class AbstractAerodynamics(Part):
    """From flow to force: the seam for another model of the air's forces.

    See `SweepTheory` and `LaggingCirculation`. A model may have k states of its own, which
    stand in the state of the flight.
    """

    def start(self, flow: Flow) -> Float[Array, " k"]:
        """Own states at launch, (k,); by default none.

        Args:
            flow: at launch.
        """
        return jnp.zeros(0)

    @abc.abstractmethod
    def __call__(
        self, flow: Flow, states: Float[Array, " k"]
    ) -> tuple[Aerodynamics, Float[Array, " k"]]:
        """Forces on the elements, and the rates of the own states, (k,).

        Finite, once differentiable, and in proportion to the elements' areas. Everything may
        be traced.

        Args:
            flow: the elements and how they move through the air.
            states: own states, (k,).
        """


class _Section(NamedTuple):
    """What the section normal to the body meets, each (n,).

    Attributes:
        along_chord, along_normal: components of the velocity [m/s].
        speed: of both [m/s].
        total_speed: of the element [m/s].
        beta: angle of attack on the full circle [rad].
        reynolds: on the chord and the total speed.
    """

    along_chord: Nodes
    along_normal: Nodes
    speed: Nodes
    total_speed: Nodes
    beta: Nodes
    reynolds: Nodes


def _section(flow: Flow) -> _Section:
    V, c, b = flow.velocity, flow.chord_direction, flow.normal
    v_c = once(V[0] * c[0] + V[1] * c[1])  # the chord is in the body's horizontal plane
    v_b = once(V[0] * b[0] + V[1] * b[1] + V[2] * b[2])
    speed = safe_sqrt(V[0] ** 2 + V[1] ** 2 + V[2] ** 2)
    return _Section(
        along_chord=v_c,
        along_normal=v_b,
        speed=safe_sqrt(v_c**2 + v_b**2),
        total_speed=speed,
        beta=arctan2(-v_b, v_c),
        reynolds=speed * flow.chord / flow.kinematic_viscosity,
    )


def _forces(flow: Flow, at: _Section, lift_coefficient, drag_coefficient) -> Aerodynamics:
    """Forces by the coefficients of the section (eqs 23-26)."""
    V, c, b = flow.velocity, flow.chord_direction, flow.normal
    v_c, v_b = at.along_chord, at.along_normal
    # One power of the normal speed is in the vectors.
    q = 0.5 * flow.air_density * at.speed * flow.area
    along_c = once(q * (-drag_coefficient * v_c - lift_coefficient * v_b))
    along_b = once(q * (-drag_coefficient * v_b + lift_coefficient * v_c))
    fold = jnp.where(v_c >= 0, 1.0, -1.0)
    pressure = 0.5 * flow.air_density * at.speed**2
    t = flow.tangent
    return Aerodynamics(
        force=jnp.stack(
            [along_c * c[0] + along_b * b[0], along_c * c[1] + along_b * b[1], along_b * b[2]]
        ),
        lift=pressure * flow.area * fold * lift_coefficient,
        drag=pressure * flow.area * drag_coefficient,
        beta=at.beta,
        angle_of_attack=arctan2(-v_b, jnp.abs(v_c)),
        sweep_angle=arctan2(V[0] * t[0] + V[1] * t[1] + V[2] * t[2], at.speed),
        reynolds=at.reynolds,
        dynamic_pressure=pressure,
        lift_coefficient=lift_coefficient,
        drag_coefficient=drag_coefficient,
        speed=at.total_speed,
    )


def _coefficients(polar: AbstractPolar, at: _Section) -> tuple[Nodes, Nodes]:
    """C_L and C_D, (n,), whose shapes are checked: the polar may be a user's own."""
    found, kind = polar(at.beta, at.reynolds), type(polar).__name__
    if not isinstance(found, tuple | list) or len(found) != 2:
        raise TypeError(f"{kind} must give C_L and C_D")
    for what, values in zip(("C_L", "C_D"), found, strict=True):
        check_given(f"{what} of {kind}", values, at.beta.shape)
    return found[0], found[1]


class SweepTheory(AbstractAerodynamics):
    """The air's force by the velocity normal to the body alone (eqs 23-26), without memory.

    Args:
        polar: coefficients of the section.

    Raises:
        TypeError: that is no polar.
    """

    polar: AbstractPolar

    def _check(self):
        check_kind("polar", self.polar, AbstractPolar)

    def __call__(self, flow, states):
        at = _section(flow)
        return _forces(flow, at, *_coefficients(self.polar, at)), states


class LaggingCirculation(AbstractAerodynamics):
    """Sweep theory whose circulation follows the flow with a lag; drag does not.

    Of the circulation that the steady section would have, G = v c C_L/2, a share comes at
    once, and the rest as one exponential of the distance travelled in half chords: the
    indicial function 1 - share exp(-s/lag), with s = 2 v t/c. In steady flow, and for
    a share of 0, it is sweep theory exactly; for a lag that goes to 0, in the limit. The
    defaults come within 0.042 of Wagner's function of a thin aerofoil (in Jones's form) at
    every s; nobody has measured it for this section.

    Args:
        polar: coefficients of the section in steady flow.
        lag: of the circulation [half chords], above 0.
        share: what lags, 0 to 1.

    Raises:
        TypeError: that is no polar.
        ValueError: a value is not finite or out of range.
    """

    polar: AbstractPolar
    lag: Scalar = eqx.field(
        converter=floats,
        default=6.8,
        metadata=about("half chords", "lag of the circulation", low=0, high=1e4, low_open=True),
    )
    share: Scalar = eqx.field(
        converter=floats,
        default=0.5,
        metadata=about("", "share of the circulation that lags", low=0, high=1),
    )

    def _check(self):
        check_kind("polar", self.polar, AbstractPolar)

    def _steady(self, flow: Flow) -> tuple[_Section, Any, Any]:
        at = _section(flow)
        lift_coefficient, drag_coefficient = _coefficients(self.polar, at)
        return at, 0.5 * at.speed * flow.chord * lift_coefficient, drag_coefficient

    def start(self, flow):
        return self._steady(flow)[1]

    def __call__(self, flow, states):
        at, steady, drag_coefficient = self._steady(flow)
        circulation = steady + self.share * (states - steady)
        scale = 0.5 * at.speed * flow.chord
        moving = scale > 0
        lift_coefficient = jnp.where(moving, circulation / jnp.where(moving, scale, 1.0), 0.0)
        rates = (steady - states) * 2 * at.speed / (flow.chord * self.lag)
        return _forces(flow, at, lift_coefficient, drag_coefficient), rates
