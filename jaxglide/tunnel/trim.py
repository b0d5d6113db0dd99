"""Trim: the gait without pitch moment, stiffness and control effectiveness."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import (
    check_choice,
    check_integer,
    check_range,
    check_shape,
    is_traced,
    number,
)
from .._lib.types import Array, Float, Integer, Mat3, Scalar, Vec3
from ..flight.dynamics import Glider, check_glider
from ..flight.launch import Launch
from ..shape.gait import Gait
from .fall import fall, loads_at_end
from .loads import MOMENT_PHASES, PITCH, check_held, loads, over_phases

GAIT_PARAMETERS = tuple(field.name for field in dataclasses.fields(Gait))
"""Names of the gait's parameters."""


def pitch_moment(glider: Glider, launch: Launch | None = None, **options) -> Scalar:
    """Phase-averaged pitch moment where the held glide meets the ground [N m].

    Args:
        glider, launch, **options: as in `windtunnel.fall`.
    """
    read = loads_at_end(fall(glider, launch, **options))
    return over_phases(read.aerodynamic).mean[PITCH]


class Trim(eqx.Module):
    """A gait parameter at which the phase-averaged pitch moment vanishes.

    Attributes:
        parameter: its name (static).
        value: it, in the gait's units (radians), NaN where there is no change of sign.
        moment: pitch moment left there [N m].
        found: whether the moment changes sign in the range.
        crossings: changes of sign among the scanned values; where there is more than one,
            `value` is the lowest.
        scanned: the values tried first, (K,).
        moments: pitch moments there [N m], (K,).
    """

    parameter: str = eqx.field(static=True)
    value: Scalar
    moment: Scalar
    found: Array
    crossings: Integer
    scanned: Float[Array, " K"]
    moments: Float[Array, " K"]

    def __str__(self) -> str:
        low, high = float(self.scanned[0]), float(self.scanned[-1])
        first, last = 1e3 * float(self.moments[0]), 1e3 * float(self.moments[-1])
        ends = f"{first:+.4f} N mm at {low:.5g} to {last:+.4f} N mm at {high:.5g}"
        if not bool(self.found):
            return f"no trim: the pitch moment goes from {ends} without a change of sign"
        text = f"trim at {self.parameter} = {float(self.value):.6g}: from {ends}"
        more = int(self.crossings) - 1
        return text + (f", {more} more change{'s' * (more > 1)} of sign" if more else "")


def _with(glider: Glider, parameter: str, value) -> Glider:
    return eqx.tree_at(lambda g: getattr(g.gait, parameter), glider, value)


@eqx.filter_jit
def _trim(glider, launch, bounds, tolerance, parameter, points, options) -> Trim:
    def moment(value, given):
        return pitch_moment(_with(given[0], parameter, value), given[1], **options)

    scanned = jnp.linspace(bounds[0], bounds[1], points)
    fixed = jax.lax.stop_gradient((glider, launch))
    moments = jax.vmap(lambda value: moment(value, fixed))(scanned)
    changes = jnp.diff(jnp.where(moments >= 0, 1, -1)) != 0
    found = jnp.any(changes) & jnp.all(jnp.isfinite(moments))
    left = jnp.argmax(changes)
    rising = jnp.where(moments[left] < 0, 1.0, -1.0)
    lower, upper = scanned[left], scanned[left + 1]

    def residual(value, given):
        # without a change of sign there is no slope that a derivative could divide by
        return jnp.where(found, rising * moment(value, given), value - lower)

    value = optx.root_find(
        residual,
        optx.Bisection(rtol=0.0, atol=tolerance, flip=False),
        (lower + upper) / 2,
        (glider, launch),
        options={"lower": lower, "upper": upper},
        throw=False,
    ).value
    value = jnp.where(found, value, jnp.nan)
    left_over = moment(jnp.where(found, value, bounds[0]), fixed)
    return Trim(
        parameter,
        value,
        jnp.where(found, left_over, jnp.nan),
        found,
        jnp.sum(changes),
        scanned,
        moments,
    )


def trim(
    glider: Glider,
    parameter: str = "d_psi",
    bounds=None,
    *,
    launch: Launch | None = None,
    points: int = 9,
    tolerance: float = 1e-10,
    **options,
) -> Trim:
    """The value of a gait parameter with zero phase-averaged pitch moment.

    The range is scanned, the lowest change of sign bracketed, and the root found by
    bisection (Optimistix); its derivatives are those of the root (implicit function
    theorem). Pure: `jit`, `vmap`, `grad` apply.

    Args:
        glider: what to trim; its own value of the parameter does not matter.
        parameter: a name of `GAIT_PARAMETERS`.
        bounds: lowest and highest value, in the gait's units (radians, or none); by
            default -20 to 20 degrees for d_psi.
        launch: of the held glide at whose end the moment is read.
        points: values scanned, 2 to 1000.
        tolerance: of the value.
        **options: as in `windtunnel.fall`.

    Raises:
        ValueError: an argument is not finite or out of range.
    """
    check_glider(glider)
    check_choice("parameter", parameter, GAIT_PARAMETERS)
    check_integer("points", points, 2, 1000)
    check_range("tolerance", tolerance, "", 0, 1, low_open=True, shape=())
    if bounds is None:
        if parameter != "d_psi":
            raise ValueError(f"bounds of {parameter} must be given: lowest and highest value")
        bounds = np.deg2rad((-20.0, 20.0))
    check_shape("bounds", bounds, (2,))
    if not any(map(is_traced, (bounds, *bounds))):
        low, high = map(float, bounds)
        if not low < high:
            raise ValueError(f"bounds = ({low:g}, {high:g}) are not lowest and highest value")
        for end in (low, high):
            _with(glider, parameter, jnp.asarray(end)).gait.__check_init__()
    bounds = number("bounds")(bounds)
    options["angles"] = number("angles")(options.get("angles", (0.0, 0.0, 0.0)))
    return _trim(glider, launch, bounds, tolerance, parameter, points, options)


class Derivatives(NamedTuple):
    """Phase-averaged moment (pitch, roll, yaw) and its derivatives at a held velocity.

    Attributes:
        moment: [N m], (3,).
        by_angles: columns yaw, pitch, roll [N m/rad], (3, 3).
        by_gait: a `Gait` of derivatives [N m per rad, Hz or 1], each (3,).
    """

    moment: Vec3
    by_angles: Mat3
    by_gait: Gait

    @property
    def pitch_stiffness(self) -> Scalar:
        """Pitch moment by pitch [N m/rad]; negative where the air turns the body back."""
        return self.by_angles[PITCH, 1]


@eqx.filter_jit
def _derivatives(glider, velocity, angles, time, phases) -> Derivatives:
    def mean(angles, gait):
        other = eqx.tree_at(lambda g: g.gait, glider, gait)
        read = loads(other, velocity, angles, time=time, phases=phases)
        moment = over_phases(read.aerodynamic).mean
        return moment, moment

    rates, moment = jax.jacfwd(mean, argnums=(0, 1), has_aux=True)(angles, glider.gait)
    return Derivatives(moment, *rates)


def derivatives(
    glider: Glider,
    velocity,
    angles=(0.0, 0.0, 0.0),
    *,
    time=0.0,
    phases: int = MOMENT_PHASES,
) -> Derivatives:
    """Pitch stiffness and control effectiveness at a velocity and attitude.

    Derivatives of the phase-averaged moment of the air with the velocity held, by automatic
    differentiation: how it answers to a change of attitude or gait in flight.

    Args:
        glider, velocity, angles, time, phases: as in `windtunnel.loads`.

    Raises:
        ValueError: an argument is not finite or out of range.
    """
    check_glider(glider)
    velocity, angles = check_held(velocity, angles, phases)
    check_shape("time", time, ())
    check_range("time", time, "s", -1e4, 1e4)
    return _derivatives(glider, velocity, angles, jnp.asarray(time, angles.dtype), phases)
