"""Trim: the value of a float without pitch moment, stiffness and control effectiveness."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import check_integer, check_kind, check_range, check_shape, is_traced, number
from .._lib.paths import get, parameters
from .._lib.report import Report, Reported
from .._lib.types import Array, Float, Integer, Mat3, Scalar, Vec3
from ..flight.case import Case
from ..flight.dynamics import Glider, check_glider
from ..flight.launch import Launch
from ..shape.gait import Gait
from ..shape.motion import AbstractMotion
from .fall import PUBLISHED_LAUNCH, fall, loads_at_end
from .loads import MOMENT_PHASES, PITCH, check_held, loads, over_phases, several

GAIT_PARAMETERS = tuple(field.name for field in dataclasses.fields(Gait))
"""Names of the published gait's parameters."""


def pitch_moment(glider: Glider, launch: Launch | None = None, **options) -> Scalar:
    """Phase-averaged pitch moment where the held glide meets the ground [N m].

    Args:
        glider, launch, **options: as in `windtunnel.fall`.
    """
    read = loads_at_end(fall(glider, launch, **options))
    return over_phases(read.aerodynamic).mean[PITCH]


class Trim(eqx.Module, Reported):
    """A value of one float at which the phase-averaged pitch moment vanishes.

    Values are in SI units and radians.

    Attributes:
        parameter: its name (static).
        unit: in which people read it (static).
        value: it, NaN where there is no change of sign.
        moment: pitch moment left there [N m].
        found: whether the moment changes sign in the range.
        crossings: changes of sign among the scanned values; where there is more than one,
            `value` is the lowest.
        scanned: the values tried first, (K,).
        moments: pitch moments there [N m], (K,).
    """

    parameter: str = eqx.field(static=True)
    unit: str = eqx.field(static=True)
    value: Scalar
    moment: Scalar
    found: Array
    crossings: Integer
    scanned: Float[Array, " K"]
    moments: Float[Array, " K"]

    def report(self) -> Report:
        if self.value.ndim:
            return several("trims", self.value, self.found)
        factor = np.pi / 180 if self.unit.startswith("deg") else 1.0
        name, unit = self.parameter, f" {self.unit}".rstrip()
        rows = [
            (f"at {float(at) / factor:.6g}{unit}", f"{1e3 * float(moment):+.4f} N mm")
            for at, moment in zip(self.scanned, self.moments, strict=True)
        ]
        low, high = (float(self.scanned[k]) / factor for k in (0, -1))
        title = (
            f"no trim: the moment does not change sign between {low:g} and {high:g}{unit} of "
            f"{name}"
        )
        notes = []
        if bool(self.found):
            title = (
                f"trim at {name} = {float(self.value) / factor:.6f}{unit}, where "
                f"{1e3 * float(self.moment):+.1e} N mm are left"
            )
        if int(self.crossings) > 1:
            notes = [f"the moment changes sign {int(self.crossings)} times: this is the lowest"]
        return Report(title, tuple(rows), tuple(notes))


def _with(case: Case, parameter: str, value) -> Case:
    return case.replace({parameter: value / case.parameter(parameter).factor})


@eqx.filter_jit
def _trim(case: Case, bounds, tolerance, parameter, points, options) -> Trim:
    def moment(value, given):
        case = _with(eqx.combine(given, rest), parameter, value)
        return pitch_moment(case.glider, case.launch, **options)

    arrays, rest = eqx.partition(case, eqx.is_inexact_array)

    scanned = jnp.linspace(bounds[0], bounds[1], points)
    fixed = jax.lax.stop_gradient(arrays)
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
        arrays,
        options={"lower": lower, "upper": upper},
        throw=False,
    ).value
    value = jnp.where(found, value, jnp.nan)
    left_over = moment(jnp.where(found, value, bounds[0]), fixed)
    return Trim(
        parameter,
        case.parameter(parameter).unit,
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
    """The value of one float of glider or launch with zero phase-averaged pitch moment.

    The range is scanned, the lowest change of sign bracketed, and the root found by
    bisection (Optimistix); its derivatives are those of the root (implicit function
    theorem). Pure: `jit`, `vmap`, `grad` apply.

    Args:
        glider: what to trim; its own value of the parameter does not matter.
        parameter: by path, `gait.d_psi`, or short name, `d_psi` (see `Case`); a float of a
            part of a user's own too.
        bounds: lowest and highest value, as glider and launch hold it: in SI units and
            radians; by default -20 to 20 degrees for d_psi.
        launch: of the held glide at whose end the moment is read; by default the published
            10 m and 1.7 m/s.
        points: values scanned, 2 to 1000.
        tolerance: of the value.
        **options: as in `fall`.

    Raises:
        ValueError: an argument is not finite or out of range, an unknown name, or one of
            several numbers.

    Examples:
        >>> import math
        >>> from jaxglide import Gait, Glider, Polar, Snake, trim
        >>> body, gait = Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.2)
        >>> glider = Glider(body, gait, Polar.smooth())
        >>> found = trim(glider, "d_psi", points=5)
        >>> print(f"{math.degrees(found.value):.2f} degrees per SVL")
        17.14 degrees per SVL
    """
    check_glider(glider)
    launch = (
        Launch(*PUBLISHED_LAUNCH) if launch is None else check_kind("launch", launch, Launch)
    )
    case = Case(glider, launch, ())
    path, about = case.path(parameter), case.parameter(parameter)
    check_integer("points", points, 2, 1000)
    check_range("tolerance", tolerance, "", 0, 1, low_open=True, shape=())
    if bounds is None:
        if path != "gait.d_psi":
            raise ValueError(f"bounds of {parameter} must be given: lowest and highest value")
        bounds = np.deg2rad((-20.0, 20.0))
    check_shape("bounds", bounds, (2,))
    if not any(map(is_traced, (bounds, *bounds))):
        low, high = map(float, bounds)
        if not low < high:
            raise ValueError(f"bounds = ({low:g}, {high:g}) are not lowest and highest value")
        about.check_inside(parameter, np.array([low, high]))
        case.check({parameter: low / about.factor})
    bounds = number("bounds")(bounds)
    options["angles"] = number("angles")(options.get("angles", (0.0, 0.0, 0.0)))
    near = jnp.asarray(tolerance, bounds.dtype)  # traced: another one compiles nothing
    return _trim(case, bounds, near, parameter, points, options)


class Derivatives(eqx.Module, Reported):
    """Phase-averaged moment (pitch, roll, yaw) and its derivatives at a held velocity.

    Attributes:
        moment: [N m], (3,).
        by_angles: columns yaw, pitch, roll [N m/rad], (3, 3).
        by_gait: a motion of derivatives, such as a `Gait` [N m per rad, Hz or 1], each (3,).
    """

    moment: Vec3
    by_angles: Mat3
    by_gait: AbstractMotion

    @property
    def pitch_stiffness(self) -> Scalar:
        """Pitch moment by pitch [N m/rad]; negative where the air turns the body back."""
        return self.by_angles[..., PITCH, 1]

    def report(self) -> Report:
        if self.moment.ndim > 1:
            return several("derivatives of the mean moment", self.moment[..., PITCH])
        rows = [("pitch", f"{_milli(self.pitch_stiffness, 'deg'):12.6f} N mm/deg")]
        for path, about in parameters(self.by_gait).items():
            slopes = np.asarray(get(self.by_gait, path)[PITCH])
            unit = "deg" if about.unit.startswith("deg") else about.unit or "1"
            for index in np.ndindex(slopes.shape):
                where = f"[{','.join(map(str, index))}]" if index else ""
                text = f"{_milli(slopes[index], unit):12.6f} N mm/{unit}"
                rows.append((path + where, text))
        return Report("Derivatives of the mean pitch moment", tuple(rows))


def _milli(slope, unit: str) -> float:
    """A derivative [N m per unit inside] in N mm per unit that people read."""
    return 1e3 * float(slope) * (np.pi / 180 if unit == "deg" else 1.0)


@eqx.filter_jit
def _derivatives(glider, velocity, angles, time, phases) -> Derivatives:
    def mean(angles, arrays):
        other = eqx.tree_at(lambda g: g.gait, glider, eqx.combine(arrays, rest))
        read = loads(other, velocity, angles, time=time, phases=phases)
        moment = over_phases(read.aerodynamic).mean
        return moment, moment

    arrays, rest = eqx.partition(glider.gait, eqx.is_inexact_array)
    rates, moment = jax.jacfwd(mean, argnums=(0, 1), has_aux=True)(angles, arrays)
    return Derivatives(moment, rates[0], eqx.combine(rates[1], rest))


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
