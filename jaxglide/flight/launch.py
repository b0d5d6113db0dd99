"""Take-off: phase of the waves, attitude and state at t = 0 (eq. 27)."""

from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx

from .._lib.fields import Part, about, floats
from .._lib.numerics import safe_sqrt, sincos, solve3
from .._lib.types import Array, Float, Mat3, Scalar, State, Vec3
from ..body.sections import Sections, discretise
from ..loads.inertia import angular_momentum, inertia_tensor
from ..shape.kinematics import backbone
from .attitude import angle_rates, rotation_matrix
from .dynamics import Flight, Glider, with_own_states
from .ends import ANGLE_LIMIT

_PHASES = 128  # samples of the shape over a period of its waves
_AT_ONCE = 8  # of them, so that those of a batch fit a core's cache
_STEPS = 16  # fixed Dopri8 steps over the cycle that sets the attitude
_MEAN = 200  # times of the cycle over which the attitude is averaged

_PUBLISHED_SPEED = 0.2409
"""Launch speed over sqrt(2 wing loading/air density): 1.7 m/s at 29 N/m^2."""


class Launch(Part):
    """How the glide starts: forward, by default horizontally, without rotation.

    Args:
        height: height of the centre of mass above z = 0 [m], above 0.
        speed: launch speed [m/s], 0 to 200; by default the published one, which grows
            with the square root of wing loading (1.7534 m/s for the default snake).
        phi_theta: phase of the horizontal wave [rad]; by default the one that minimises
            the angular momentum of the shape change (0 for a motion without a cycle).
        angles: yaw, pitch, roll [rad], (3,), below 85 degrees; by default minus
            the mean attitude over a free undulation cycle (level without a cycle).
        elevation: of the launch velocity above the horizontal [rad], -pi/2 to pi/2.
        heading: of the launch velocity to the left of forward [rad], -pi to pi.
        omega: angular velocity, body axes [rad/s], (3,); by default none.

    Raises:
        ValueError: a value is not finite or out of range.

    Examples:
        >>> import math
        >>> from jaxglide import Launch
        >>> launch = Launch(height=5.0, speed=2.0, elevation=math.radians(10))
        >>> print(launch.height, launch.phi_theta)  # the phase follows from the gait
        5.0 None
    """

    height: Scalar = eqx.field(
        converter=floats,
        default=10.0,
        metadata=about("m", "launch height", low=0, high=1e5, low_open=True),
    )
    speed: Scalar | None = eqx.field(
        converter=floats, default=None, metadata=about("m/s", "launch speed", low=0, high=200)
    )
    phi_theta: Scalar | None = eqx.field(
        converter=floats,
        default=None,
        metadata=about("rad", "launch phase", symbol=r"\phi_\theta", low=-1e3, high=1e3),
    )
    angles: Vec3 | None = eqx.field(
        converter=floats,
        default=None,
        metadata=about(
            "rad",
            "launch attitude",
            low=-ANGLE_LIMIT,
            high=ANGLE_LIMIT,
            low_open=True,
            high_open=True,
        ),
    )
    elevation: Scalar = eqx.field(
        converter=floats,
        default=0.0,
        metadata=about("deg", "launch direction above the horizontal", low=-90, high=90),
    )
    heading: Scalar = eqx.field(
        converter=floats,
        default=0.0,
        metadata=about("deg", "launch direction to the left of forward", low=-180, high=180),
    )
    omega: Vec3 | None = eqx.field(
        converter=floats,
        default=None,
        metadata=about("rad/s", "angular velocity at launch", low=-1e3, high=1e3),
    )


class TakeOff(eqx.Module):
    """What a launch comes to for one glider.

    Attributes:
        phi_theta: launch phase of the horizontal wave [rad].
        angles: yaw, pitch, roll [rad], (3,).
        speed: launch speed [m/s].
        state: at t = 0 (see `dynamics`), (13 or more,).
    """

    phi_theta: Scalar
    angles: Vec3
    speed: Scalar
    state: State


@eqx.filter_jit
def started(glider: Glider, launch: Launch) -> TakeOff:
    """`take_off`, compiled: asked outside of what is, it would compile its parts anew."""
    return take_off(glider, launch, discretise(glider.body))


def published_speed(glider: Glider, sections: Sections) -> Scalar:
    """The published launch speed, 0.2409 sqrt(2 W_s/rho) [m/s]."""
    loading = sections.total_mass * glider.gravity / jnp.sum(sections.area)
    return _PUBLISHED_SPEED * safe_sqrt(2 * loading / glider.air.air_density)


def launch_velocity(launch: Launch, speed: Scalar) -> Vec3:
    """Launch velocity in inertial axes [m/s], (3,), for a speed [m/s]."""
    (up, left), (level, ahead) = sincos(jnp.stack([launch.elevation, launch.heading]))
    return speed * jnp.stack([-level * left, level * ahead, up])


class Cycle(eqx.Module):
    """Inertia over one undulation cycle, as Fourier series in the phase of the waves.

    The shape is periodic in its phase and analytic, so that equally spaced samples give
    both to round-off at any phase.

    Attributes:
        cosines, sines: coefficients of cos(k phase) and sin(k phase), k from 0 to
            `_PHASES`/2, of the angular momentum of the shape change per unit phase rate
            (3 rows) and of the inertia tensor (9 rows), (12, k).
    """

    cosines: Float[Array, "12 k"]
    sines: Float[Array, "12 k"]

    @classmethod
    def of(cls, glider: Glider, sections: Sections) -> "Cycle | None":
        """Sample the glider's body at `_PHASES` phases; None without a cycle."""

        def bent(phase):
            return glider.gait.cycle(sections.fraction, sections.neck_fraction, phase)

        if bent(jnp.zeros(())) is None:
            return None

        def sample(phase):
            wave = bent(phase)
            assert wave is not None
            body = backbone(sections, wave)
            tensor = inertia_tensor(sections, body)
            return jnp.concatenate([angular_momentum(sections, body), tensor.ravel()])

        phases = 2 * jnp.pi / _PHASES * jnp.arange(_PHASES)
        samples = jax.lax.map(sample, phases, batch_size=_AT_ONCE)
        series = 2 * jnp.fft.rfft(samples, axis=0, norm="forward").T
        series = series.at[:, 0].divide(2).at[:, -1].divide(2)
        return cls(series.real, -series.imag)

    def momentum(self, phase: Scalar) -> Vec3:
        """Angular momentum sum m r x dr/dphase [kg m^2], (3,)."""
        return _evaluate(self.cosines[:3], self.sines[:3], phase)

    def momentum_and_tensor(self, phase: Scalar) -> tuple[Vec3, Mat3]:
        """The same and the inertia tensor [kg m^2], (3,) and (3, 3)."""
        values = _evaluate(self.cosines, self.sines, phase)
        return values[:3], values[3:].reshape(3, 3)

    @jax.jit  # traced once: the root's finder asks again and again
    def slope(self, phase: Scalar) -> Scalar:
        """Half the derivative of |momentum|^2 with respect to phase."""
        k, cosines, sines = jnp.arange(self.cosines.shape[1]), self.cosines[:3], self.sines[:3]
        both = jnp.concatenate([cosines, k * sines]), jnp.concatenate([sines, -k * cosines])
        values = _evaluate(*both, phase)
        return jnp.sum(values[:3] * values[3:])


def _evaluate(cosines, sines, phase):
    sine, cosine = sincos(jnp.arange(cosines.shape[-1]) * phase)
    return cosines @ cosine + sines @ sine


@jax.custom_jvp
def launch_phase(cycle: Cycle) -> Scalar:
    """Phase [rad] of the first local minimum of |h| downhill from 0 (eq. 27).

    The slope of |h|^2 is scanned over a whole period either way to bracket the minimum,
    and its root found by bisection; its derivative is that of the root (implicit function
    theorem).
    """
    phases = 2 * jnp.pi / _PHASES * jnp.arange(-_PHASES, _PHASES + 1)
    slopes = jax.vmap(cycle.slope)(phases)
    # Walking up from 0 where the slope is negative there, else down: the first change of
    # sign is a minimum, between neighbours.
    first_up = jnp.argmax(slopes[_PHASES + 1 :] >= 0) + _PHASES
    first_down = _PHASES - 1 - jnp.argmax(slopes[:_PHASES][::-1] <= 0)
    left = jnp.where(slopes[_PHASES] <= 0, first_up, first_down)
    lower, upper = phases[left], phases[left + 1]
    tolerance = 1e-12 if upper.dtype == jnp.float64 else 1e-6
    return optx.root_find(
        lambda phase, cycle: cycle.slope(phase),
        optx.Bisection(rtol=tolerance, atol=tolerance, flip=False),
        (lower + upper) / 2,
        cycle,
        options={"lower": lower, "upper": upper},
        throw=False,
    ).value


@launch_phase.defjvp
def _launch_phase_jvp(primals, tangents):
    (cycle,) = primals
    phase = launch_phase(cycle)
    _, change = jax.jvp(lambda cycle: cycle.slope(phase), primals, tangents)
    curvature = jax.grad(cycle.slope)(phase)
    curved = curvature > 0  # not where nothing moves, and every phase is as good
    return phase, jnp.where(curved, -change / jnp.where(curved, curvature, 1.0), 0.0)


class _FreeBody(NamedTuple):
    cycle: Cycle
    phi_theta: Scalar
    momentum_I: Vec3


def _turning(angles, h, tensor, momentum_I) -> Vec3:
    """Rates of the angles per cycle, of a body whose angular momentum stays."""
    momentum_B = jnp.sum(rotation_matrix(angles) * momentum_I, axis=1)
    return angle_rates(angles, solve3(tensor, momentum_B + 2 * jnp.pi * h))


@jax.jit  # traced once, however often Diffrax asks
def _free_rotation(time: Scalar, state: Float[Array, "6"], body: _FreeBody):
    """Rates per undulation cycle, without air and gravity, of the angles and their integral.

    Angular momentum is conserved, R_BI^T (I omega + h) = H, so the attitude alone is the
    state; and everything scales with frequency, so that its path over a cycle does not
    depend on it.
    """
    h, tensor = body.cycle.momentum_and_tensor(body.phi_theta - 2 * jnp.pi * time)
    return jnp.concatenate([_turning(state[:3], h, tensor, body.momentum_I), state[:3]])


def launch_angles(cycle: Cycle, phi_theta: Scalar, adjoint: diffrax.AbstractAdjoint) -> Vec3:
    """Yaw, pitch, roll [rad], (3,): minus their mean over one free undulation cycle.

    The mean is over n = `_MEAN` equally spaced times including the start but not the end:
    by the Euler-Maclaurin formula the integral of the angles, less (end - start)/(2 n), plus
    (rate at end - rate at start)/(12 n^2), which is 0 at the start.

    Args:
        cycle: inertia of the body over its cycle.
        phi_theta: launch phase [rad].
        adjoint: how Diffrax differentiates.
    """
    h, tensor = cycle.momentum_and_tensor(phi_theta)  # at the end as well
    body = _FreeBody(cycle, phi_theta, -2 * jnp.pi * h)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_free_rotation),  # type: ignore
        diffrax.Dopri8(),
        t0=0.0,
        t1=1.0,
        dt0=1 / _STEPS,
        y0=jnp.zeros((6,), h.dtype),
        args=body,
        stepsize_controller=diffrax.ConstantStepSize(),
        adjoint=adjoint,
        max_steps=_STEPS + 8,
        throw=False,
    )
    assert solution.ys is not None
    end = solution.ys[0]
    rates = _turning(end[:3], h, tensor, body.momentum_I)
    return end[:3] / (2 * _MEAN) - end[3:] - rates / (12 * _MEAN**2)


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
        sections: the glider's body, discretised.
        adjoint: how Diffrax differentiates the attitude (forward mode by default).
    """
    if adjoint is None:
        adjoint = diffrax.ForwardMode()
    phi_theta, angles, speed = launch.phi_theta, launch.angles, launch.speed
    cycle = None
    if phi_theta is None or angles is None:
        cycle = Cycle.of(glider, sections)
    if phi_theta is None:
        phi_theta = jnp.zeros(()) if cycle is None else launch_phase(cycle)
    if angles is None:
        angles = jnp.zeros(3) if cycle is None else launch_angles(cycle, phi_theta, adjoint)
    if speed is None:
        speed = published_speed(glider, sections)
    zero = jnp.zeros_like(angles)
    position = zero.at[2].set(launch.height)
    velocity = launch_velocity(launch, speed)
    omega = zero if launch.omega is None else launch.omega
    rigid = jnp.concatenate([position, velocity, omega, angles, zero[:1]])
    state = with_own_states(zero[0], rigid, Flight(glider, sections, phi_theta))
    return TakeOff(phi_theta, angles, speed, state)
