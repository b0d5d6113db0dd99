"""Take-off: phase of the waves, attitude and state at t = 0 (floor 3, MODEL section 9)."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from ._checks import check_range
from ._types import Scalar, State, Vec3
from .dynamics import FreeRotation, Glider, free_rotation
from .inertia import angular_momentum, moment_of
from .kinematics import backbone
from .snake import Sections

_SCAN = 64  # phases over half a period of the waves among which a minimum is bracketed
_STEPS = 20  # fixed Dopri8 steps over the cycle that sets the attitude (1e-8 degrees)
_MEAN = 200  # times of the cycle over which the attitude is averaged

_PUBLISHED_SPEED = 0.2409
"""Launch speed over sqrt(2 wing loading/air density): 1.7 m/s at 29 N/m^2."""


def _optional(x):
    return None if x is None else jnp.asarray(x, float)


class Launch(eqx.Module):
    """How the glide starts: horizontally, forward, without rotation.

    Args:
        height: height of the centre of mass above the ground [m], above 0.
        speed: forward speed [m/s], 0 to 200; by default the published one, which grows
            with the square root of wing loading (1.7534 m/s for the default snake).
        phi_theta: phase of the horizontal wave [rad]; by default the one that minimises
            the angular momentum of the shape change.
        angles: yaw, pitch, roll [rad], (3,), below 85 degrees; by default minus the mean
            attitude over a free undulation cycle.

    Raises:
        ValueError: a value is not finite or out of range.
    """

    height: Scalar = eqx.field(converter=_optional, default=10.0)
    speed: Scalar | None = eqx.field(converter=_optional, default=None)
    phi_theta: Scalar | None = eqx.field(converter=_optional, default=None)
    angles: Vec3 | None = eqx.field(converter=_optional, default=None)

    def __check_init__(self):
        check_range("height", self.height, "m", 0, 1e5, low_open=True)
        if self.speed is not None:
            check_range("speed", self.speed, "m/s", 0, 200)
        if self.phi_theta is not None:
            check_range("phi_theta", self.phi_theta, "rad", -1e3, 1e3)
        if self.angles is not None:
            limit = float(jnp.deg2rad(85.0))
            if self.angles.shape[-1:] != (3,):
                raise ValueError(
                    f"angles has shape {self.angles.shape}: it must be yaw, pitch, roll, (3,)"
                )
            check_range(
                "angles", self.angles, "rad", -limit, limit, low_open=True, high_open=True
            )


class TakeOff(eqx.Module):
    """What a launch comes to for one glider.

    Attributes:
        phi_theta: launch phase of the horizontal wave [rad].
        angles: yaw, pitch, roll [rad], (3,).
        speed: forward speed [m/s].
        state: the 13 numbers of the state at t = 0 (see `dynamics`).
    """

    phi_theta: Scalar
    angles: Vec3
    speed: Scalar
    state: State


def published_speed(glider: Glider, sections: Sections) -> Scalar:
    """The published launch speed, 0.2409 sqrt(2 W_s/rho) [m/s]."""
    air = glider.environment
    loading = glider.snake.mass * air.gravity / jnp.sum(sections.area)
    return _PUBLISHED_SPEED * jnp.sqrt(2 * loading / air.air_density)


def launch_phase(glider: Glider, sections: Sections) -> Scalar:
    """Phase [rad] of the first local minimum of |h| downhill from 0 (eq. 27).

    The slope of |h|^2 is scanned over a whole period to bracket the minimum, and its root
    found by bisection; the derivative is that of the root (implicit function theorem).
    """

    def slope(phase, args):
        glider, sections = args
        body = backbone(sections, glider.gait, glider.snake.neck_fraction, phase, 1.0)
        h = angular_momentum(sections.mass, body)
        return jnp.sum(h * moment_of(body.position, sections.mass * body.acceleration))

    args = glider, sections
    fixed = jax.lax.stop_gradient(args)
    step = jnp.pi / _SCAN
    downhill = jnp.where(slope(jnp.zeros(()), fixed) > 0, -1.0, 1.0)
    phases = downhill * step * jnp.arange(1, 2 * _SCAN + 1)
    rising = downhill * jax.vmap(slope, (0, None))(phases, fixed) >= 0
    upper = phases[jnp.argmax(rising)]
    ends = upper - downhill * step, upper
    lower, upper = jnp.minimum(*ends), jnp.maximum(*ends)
    tolerance = 1e-12 if upper.dtype == jnp.float64 else 1e-6
    root = optx.root_find(
        slope,
        optx.Bisection(rtol=tolerance, atol=tolerance),
        (lower + upper) / 2,
        args,
        options={"lower": lower, "upper": upper},
        throw=False,
    )
    return root.value


def launch_angles(
    glider: Glider, sections: Sections, phi_theta: Scalar, adjoint: diffrax.AbstractAdjoint
) -> Vec3:
    """Yaw, pitch, roll [rad], (3,): minus their mean over one free undulation cycle."""
    neck = glider.snake.neck_fraction
    start = backbone(sections, glider.gait, neck, phi_theta, -2 * jnp.pi)
    momentum = angular_momentum(sections.mass, start)
    cycle = diffrax.diffeqsolve(
        diffrax.ODETerm(free_rotation),
        diffrax.Dopri8(),
        t0=0.0,
        t1=1.0,
        dt0=1 / _STEPS,
        y0=jnp.zeros_like(momentum),
        args=FreeRotation(sections, glider.gait, neck, phi_theta, momentum),
        saveat=diffrax.SaveAt(ts=jnp.arange(_MEAN) / _MEAN),
        stepsize_controller=diffrax.ConstantStepSize(),
        adjoint=adjoint,
        max_steps=_STEPS + 8,
        throw=False,
    )
    assert cycle.ys is not None
    return -jnp.mean(cycle.ys, axis=0)


def take_off(
    glider: Glider,
    launch: Launch,
    sections: Sections,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> TakeOff:
    """Phase, attitude, speed and state at t = 0.

    Args:
        glider: what flies.
        launch: how; what it leaves open is computed here.
        sections: the glider's snake, discretised.
        adjoint: how Diffrax differentiates the attitude (forward mode by default).
    """
    if adjoint is None:
        adjoint = diffrax.ForwardMode()
    phi_theta, angles, speed = launch.phi_theta, launch.angles, launch.speed
    if phi_theta is None:
        phi_theta = launch_phase(glider, sections)
    if angles is None:
        angles = launch_angles(glider, sections, phi_theta, adjoint)
    if speed is None:
        speed = published_speed(glider, sections)
    zero = jnp.zeros_like(angles)
    position = zero.at[2].set(launch.height)
    velocity = zero.at[1].set(speed)
    state = jnp.concatenate([position, velocity, zero, angles, zero[:1]])
    return TakeOff(phi_theta, angles, speed, state)
