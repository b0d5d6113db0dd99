"""Glide polar of the whole undulating body, its attitude held.

Lift and drag against angle of attack, and the velocity polar diagram with its equilibrium
(Yeaton, Socha and Ross, "Global dynamics of non-equilibrium gliding in animals", 2017).
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import check_integer, check_range, check_shape, number
from .._lib.report import Report, Reported
from .._lib.types import Array, Float, Scalar
from ..air.air import AbstractAir, StillAir
from ..body.sections import discretise, wing_area
from ..flight.dynamics import Glider, check_glider
from .fall import FORCE_PHASES, Tunnel, mean_acceleration
from .loads import MOMENT_PHASES, PHASES, check_angles, several


class BodyPolar(eqx.Module, Reported):
    """Force on the whole undulating body against its angle of attack, each (A,).

    Attributes:
        angle_of_attack: between the level body and its path [rad].
        lift, drag: phase-averaged, across and against the path [N].
        lift_coefficient, drag_coefficient: the same over dynamic pressure and wing area.
        lift_to_drag: their ratio, NaN where there is neither.
    """

    angle_of_attack: Float[Array, " A"]
    lift: Float[Array, " A"]
    drag: Float[Array, " A"]
    lift_coefficient: Float[Array, " A"]
    drag_coefficient: Float[Array, " A"]
    lift_to_drag: Float[Array, " A"]

    def report(self) -> Report:
        if self.lift.ndim != 1:
            return several("polars", self.lift[..., 0])
        heads = ("lift N", "drag N", "C_L", "C_D", "L/D")
        rows = [("angle of attack", "".join(f"{head:>10}" for head in heads))]
        for alpha, *values in zip(*(np.asarray(x) for x in vars(self).values()), strict=True):
            cells = "".join(f"{value:10.4f}" for value in values)
            rows.append((f"{np.rad2deg(alpha):.1f} deg", cells))
        return Report("Polar of the whole body, level and undulating", tuple(rows))


def _still(air: AbstractAir) -> StillAir:
    """The same air at rest."""
    return StillAir(air_density=air.air_density, kinematic_viscosity=air.kinematic_viscosity)


@eqx.filter_jit
def _body_polar(glider, speed, alpha, phases) -> BodyPolar:
    glider = dataclasses.replace(glider, air=_still(glider.air))
    tunnel = Tunnel(glider, discretise(glider.body), jnp.zeros(3), phases)
    weight = jnp.zeros(3).at[2].set(glider.gravity)

    def at(alpha):
        along = jnp.stack([0 * alpha, jnp.cos(alpha), -jnp.sin(alpha)])
        across = jnp.stack([0 * alpha, jnp.sin(alpha), jnp.cos(alpha)])
        force = tunnel.sections.total_mass * (mean_acceleration(speed * along, tunnel) + weight)
        return force @ across, -force @ along

    lift, drag = jax.vmap(at)(alpha)
    pressure = 0.5 * glider.air.air_density * speed**2 * wing_area(glider.body)
    return BodyPolar(alpha, lift, drag, lift / pressure, drag / pressure, lift / drag)


def body_polar(
    glider: Glider, speed, angle_of_attack, *, phases: int = MOMENT_PHASES
) -> BodyPolar:
    """Lift and drag of the whole body, level and undulating, averaged over phases.

    Args:
        glider: what is in the tunnel; its wind, if there is one, is left out.
        speed: of the centre of mass through the air [m/s], above 0.
        angle_of_attack: of the level body to its path [rad], (A,): the path points that
            much below the horizontal.
        phases: number of phases.

    Raises:
        ValueError: an argument is not finite or out of range.
    """
    check_glider(glider)
    check_shape("speed", speed, ())
    check_range("speed", speed, "m/s", 0, 1e3, low_open=True)
    alpha = jnp.atleast_1d(number("angle_of_attack")(angle_of_attack))
    check_range("angle_of_attack", alpha, "rad", -np.pi, np.pi)
    check_shape("angle_of_attack", alpha, ("A",))
    check_integer("phases", phases, *PHASES)
    return _body_polar(glider, jnp.asarray(speed, alpha.dtype), alpha, phases)


@eqx.filter_jit
def _field(glider, v_y, v_z, angles, phases):
    tunnel = Tunnel(glider, discretise(glider.body), angles, phases)

    def at(v_y, v_z):
        return mean_acceleration(jnp.stack([0 * v_y, v_y, v_z]), tunnel)[1:]

    return jax.vmap(jax.vmap(at, (None, 0)), (0, None))(v_y, v_z)


def velocity_polar(
    glider: Glider, v_y, v_z, angles=(0.0, 0.0, 0.0), *, phases: int = FORCE_PHASES
) -> Float[Array, "Y Z 2"]:
    """Velocity polar diagram: phase-averaged acceleration over forward and vertical speed.

    Args:
        glider: what is in the tunnel.
        v_y, v_z: forward and vertical (downward negative) velocities over the ground [m/s],
            (Y,), (Z,).
        angles: held yaw, pitch, roll [rad], (3,).
        phases: number of phases.

    Returns:
        Accelerations along y and z [m/s^2], (Y, Z, 2).

    Raises:
        ValueError: an argument is not finite or out of range.
    """
    check_glider(glider)
    angles = check_angles(angles, phases)
    v_y, v_z = (jnp.atleast_1d(number(n)(v)) for n, v in (("v_y", v_y), ("v_z", v_z)))
    for name, value in (("v_y", v_y), ("v_z", v_z)):
        check_shape(name, value, ("N",))
        check_range(name, value, "m/s", -1e3, 1e3)
    return _field(glider, v_y, v_z, angles, phases)


class Equilibrium(eqx.Module, Reported):
    """Steady glide of a body whose attitude is held.

    Attributes:
        velocity: v_y, v_z over the ground [m/s], (2,), NaN where none was found.
        glide_angle: of the path over the ground below the horizontal [rad].
        found: whether the acceleration vanishes there.
        stable: whether a small change of velocity dies out, the attitude still held.
    """

    velocity: Float[Array, "2"]
    glide_angle: Scalar
    found: Array
    stable: Array

    def report(self) -> Report:
        if np.ndim(self.glide_angle):
            return several("steady glides", self.glide_angle, self.found)
        if not bool(self.found):
            return Report("Steady glide: none found")
        v_y, v_z = map(float, self.velocity)
        kind = "stable" if bool(self.stable) else "unstable"
        angle = float(np.rad2deg(self.glide_angle))
        return Report(
            f"Steady glide: {angle:.2f} deg below the horizontal, {kind} in speed",
            (("velocity", f"v_y {v_y:.4f}   v_z {v_z:.4f} m/s"),),
        )


@eqx.filter_jit
def _equilibrium(glider, angles, phases) -> Equilibrium:
    def acceleration(velocity, held):
        glider, angles = held
        tunnel = Tunnel(glider, discretise(glider.body), angles, phases)
        return mean_acceleration(jnp.concatenate([jnp.zeros(1), velocity]), tunnel)[1:]

    gravity, density = glider.gravity, glider.air.air_density
    tolerance = 1e-10 if angles.dtype == jnp.float64 else 1e-5

    def solve(guess, held, exists: Array | bool = True):
        return optx.root_find(
            # where there is none, nothing a derivative could divide by
            lambda velocity, held: jnp.where(exists, acceleration(velocity, held), velocity),
            optx.Newton(rtol=tolerance, atol=tolerance),
            guess,
            held,
            max_steps=64,
            throw=False,
        ).value

    def judge(velocity, held):
        """Whether nothing accelerates on a forward path, and whether a change dies out."""
        left = jnp.linalg.norm(acceleration(velocity, held))
        found = jnp.isfinite(left) & (left < 1e4 * tolerance * gravity) & (velocity[0] > 0)
        slopes = jax.jacfwd(acceleration)(velocity, held)
        return found, found & (jnp.trace(slopes) < 0) & (jnp.linalg.det(slopes) > 0)

    # From shallow to steep paths, slow to fast; stable ones first, then the shallowest.
    held = jax.lax.stop_gradient((glider, angles))
    sections = discretise(glider.body)
    loading = sections.total_mass * gravity / jnp.sum(sections.area)
    speed = jnp.sqrt(jax.lax.stop_gradient(2 * loading / density)) * jnp.array([0.7, 1.0, 1.4])
    slope = jnp.deg2rad(jnp.linspace(10.0, 85.0, 16))
    paths = jnp.stack([jnp.cos(slope), -jnp.sin(slope)], axis=-1)
    guesses = (speed[:, None, None] * paths).reshape(-1, 2)
    roots = jax.vmap(lambda guess: solve(guess, held))(guesses)
    found, stable = jax.vmap(lambda root: judge(root, held))(roots)
    rank = jnp.arctan2(-roots[:, 1], roots[:, 0]) - 10.0 * found - 10.0 * stable
    best = roots[jnp.argmin(jnp.where(found, rank, jnp.inf))]
    exists = jnp.any(found)
    velocity = solve(jnp.where(exists, best, guesses[0]), (glider, angles), exists)
    found, stable = judge(velocity, held)
    found, stable = found & exists, stable & exists
    velocity = jnp.where(found, velocity, jnp.nan)
    return Equilibrium(velocity, jnp.arctan2(-velocity[1], velocity[0]), found, stable)


def equilibrium(
    glider: Glider, angles=(0.0, 0.0, 0.0), *, phases: int = FORCE_PHASES
) -> Equilibrium:
    """The steady glide at a held attitude: where the velocity polar diagram has its zero.

    Searched from 48 velocities on forward paths; of several it gives a stable one before an
    unstable one, and the shallowest. Differentiable.

    Args:
        glider: what glides.
        angles: held yaw, pitch, roll [rad], (3,).
        phases: number of phases over which the force is averaged.

    Raises:
        ValueError: an argument is not finite or out of range.

    Examples:
        >>> import math
        >>> from jaxglide import Gait, Glider, Polar, Snake, equilibrium
        >>> body, gait = Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.4)
        >>> glider = Glider(body, gait, Polar.smooth())
        >>> steady = equilibrium(glider)
        >>> print(f"{math.degrees(steady.glide_angle):.1f} degrees below the horizontal")
        27.6 degrees below the horizontal
    """
    check_glider(glider)
    return _equilibrium(glider, check_angles(angles, phases), phases)
