"""The virtual wind tunnel: the attitude is held, the air's forces and moments are read.

The paper's rotationally invariant model (figures 5 and 6). Body axes are x (pitch), y (roll)
and z (yaw); with all angles 0 they are the inertial axes.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_integer, check_range, check_shape, number
from .._lib.defaults import TUNNEL
from .._lib.numerics import cross
from .._lib.report import Report, Reported
from .._lib.types import Array, Float, Vec3
from ..body.sections import discretise
from ..flight.dynamics import (
    ANGLES,
    POSITION,
    RIGID,
    VELOCITY,
    Elements,
    Flight,
    Glider,
    check_glider,
    elements,
    with_own_states,
)
from ..flight.ends import ANGLE_LIMIT
from ..loads.inertia import moment_of, over_nodes, shape_moment

PITCH, ROLL, YAW = 0, 1, 2  # components of a moment in body axes

MOMENT_PHASES = 60
"""Phases at which moments are read, as published."""

PHASES = int(TUNNEL["phases"].low), int(TUNNEL["phases"].high)
"""Fewest and most phases; with fewer than four, left and right alone are compared."""

_STILL = 1e-12
"""Peak-to-peak [N m] below this share of the force [N] is round-off."""


def phases_of(count: int) -> Float[Array, " P"]:
    """`count` equally spaced phases phi_theta from 0 [rad], (P,)."""
    return 2 * jnp.pi / count * jnp.arange(count)


def held_elements(
    glider, sections, velocity, angles, time, phase, place: Any = 0.0
) -> Elements:
    """The body's elements at a held attitude, moving over the ground at `velocity` [m/s], (3,).

    Motion and aerodynamics with own states start there; `place` is that of the centre of
    mass [m], (3,), by default the origin.
    """
    rigid = jnp.zeros((RIGID,), velocity.dtype).at[POSITION].set(place)
    rigid = rigid.at[VELOCITY].set(velocity)
    flight = Flight(glider, sections, phase)
    return elements(time, with_own_states(time, rigid.at[ANGLES].set(angles), flight), flight)


class Loads(eqx.Module, Reported):
    """Forces and moments by phase in body axes, of the whole body or of each element.

    Leading dimensions `...` are those of times or cases; per element there is a trailing
    dimension n.

    Attributes:
        force: force of the air [N], (..., P, 3) or (..., P, 3, n).
        aerodynamic: its moment about the centre of mass [N m], same shape.
        inertial: rate [h'] of the shape change's angular momentum [N m], same shape.
    """

    force: Float[Array, "..."]
    aerodynamic: Float[Array, "..."]
    inertial: Float[Array, "..."]

    def report(self) -> Report:
        if self.force.ndim != 2:
            return Report(f"Loads of shape {self.force.shape[:-1]}")
        air, shape = over_phases(self.aerodynamic), over_phases(self.inertial)
        table = [*air, shape.peak_to_peak, self.inertial_ratio]
        rows = []
        for turn, axis in (("pitch", PITCH), ("roll", ROLL), ("yaw", YAW)):
            numbers = [1e3 * float(one[axis]) for one in table[:-1]]
            cells = "".join(f"{one:9.4f}" for one in numbers[:-1]) + f"{numbers[-1]:14.4f}"
            ratio = float(table[-1][axis])
            rows.append((turn, cells + (f"{'-':>8}" if math.isnan(ratio) else f"{ratio:8.2f}")))
        heads = "".join(f"{head:>9}" for head in ("mean", "lowest", "highest", "p-p"))
        title = f"Moments over {len(self.force)} phases (N mm)"
        return Report(title, (("", f"{heads}{'inertial p-p':>14}{'ratio':>8}"), *rows))

    @property
    def inertial_ratio(self) -> Float[Array, "... 3"]:
        """Peak-to-peak of the inertial over that of the aerodynamic moment, (..., 3).

        NaN, for undefined, where the air's moment is the same at all phases, but for
        round-off: without air, or for a straight body.
        """
        xp: Any = np if isinstance(self.force, np.ndarray) else jnp
        air = over_phases(self.aerodynamic).peak_to_peak
        still = air <= _STILL * xp.max(xp.abs(self.force), axis=(-2, -1))[..., None]
        change = over_phases(self.inertial).peak_to_peak
        return xp.where(still, xp.nan, change / xp.where(still, 1.0, air))


class OverPhases(NamedTuple):
    """Statistics over phases, each (..., 3)."""

    mean: Float[Array, "... 3"]
    lowest: Float[Array, "... 3"]
    highest: Float[Array, "... 3"]
    peak_to_peak: Float[Array, "... 3"]


def over_phases(values: Float[Array, "... P 3"]) -> OverPhases:
    """Mean, extremes and peak-to-peak of (..., P, 3) over its phases."""
    lowest, highest = values.min(-2), values.max(-2)
    return OverPhases(values.mean(-2), lowest, highest, highest - lowest)


def several(what: str, values: Array, found: Array | None = None) -> Report:
    """Report of a batch: how many, and how many of them were found."""
    rows = () if found is None else (("found", f"{int(found.sum())}"),)
    return Report(f"{values.size} {what}", rows)


def by_phase(
    glider, sections, velocity, angles, time, phases, *, place: Any = 0.0, per_element=False
) -> Loads:
    """Loads at every phase, (P, 3), or of every element, (P, 3, n)."""

    def at(phase):
        now = held_elements(glider, sections, velocity, angles, time, phase, place)
        r, force = now.body.position, now.aerodynamics.force
        inertial = shape_moment(sections, now.body)
        if per_element:
            return Loads(force, cross(r, force), inertial)
        return Loads(over_nodes(force), moment_of(r, force), over_nodes(inertial))

    return jax.vmap(at)(phases_of(phases))


def check_angles(angles, phases) -> Vec3:
    """Held angles [rad] as an array; `ValueError` where they or the phases are not allowed."""
    angles = number("angles")(angles)
    check_shape("angles", angles, (3,))
    limit = ANGLE_LIMIT
    check_range("angles", angles, "rad", -limit, limit, low_open=True, high_open=True)
    check_integer("phases", phases, *PHASES)
    return angles


def check_held(velocity, angles, phases) -> tuple[Vec3, Vec3]:
    """Velocity [m/s] and angles [rad] as arrays; `ValueError` where they are not (3,)."""
    angles = check_angles(angles, phases)
    velocity = number("velocity")(velocity)
    check_shape("velocity", velocity, (3,))
    check_range("velocity", velocity, "m/s", -1e3, 1e3)
    return velocity, angles


@eqx.filter_jit
def _read(glider, velocity, angles, time, phases, per_element):
    sections = discretise(glider.body)
    return by_phase(glider, sections, velocity, angles, time, phases, per_element=per_element)


def loads(
    glider: Glider,
    velocity,
    angles=(0.0, 0.0, 0.0),
    *,
    time=0.0,
    phases: int = MOMENT_PHASES,
    per_element: bool = False,
) -> Loads:
    """Forces and moments (eqs 18, 20) by phase at a velocity and attitude.

    Args:
        glider: what is in the tunnel, at the origin.
        velocity: of the centre of mass over the ground, inertial axes [m/s], (3,).
        angles: yaw, pitch, roll [rad], (3,), below 85 degrees.
        time: in the waves' phase phi_theta - 2 pi f_theta t [s].
        phases: number of phases phi_theta, equally spaced from 0, 4 to 3600.
        per_element: keep every element apart, (P, 3, n), instead of their sum, (P, 3).

    Raises:
        ValueError: an argument is not finite or out of range.
    """
    check_glider(glider)
    velocity, angles = check_held(velocity, angles, phases)
    check_shape("time", time, ())
    check_range("time", time, "s", -1e4, 1e4)
    return _read(glider, velocity, angles, jnp.asarray(time, angles.dtype), phases, per_element)
