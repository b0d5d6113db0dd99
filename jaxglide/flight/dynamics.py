"""Equations of motion (eqs 4-5, 16-20, 22).

The state of a flight is one flat vector. Its first 13 numbers are those of a rigid body:

| index | what | unit |
| --- | --- | --- |
| 0:3 | position of the centre of mass, inertial axes | m |
| 3:6 | its velocity, inertial axes | m/s |
| 6:9 | angular velocity, body axes | rad/s |
| 9:12 | yaw, pitch, roll | rad |
| 12 | horizontal path length so far | m |

Behind them stand the own states of the motion (its drive's), then those of the
aerodynamics; most have none.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.checks import check_given, check_kind
from .._lib.fields import Part, about, floats, recheck
from .._lib.numerics import by_rows, cross, safe_sqrt, solve3
from .._lib.types import Array, Float, Mat3, Nodes3, Scalar, State
from ..air.air import AbstractAir, StillAir
from ..body.sections import AbstractBody, Sections
from ..loads.aerodynamics import AbstractAerodynamics, Aerodynamics, Flow, SweepTheory
from ..loads.inertia import over_nodes, section_moment, tensor_of
from ..loads.polar import AbstractPolar, Polar
from ..shape.kinematics import Backbone, bent
from ..shape.motion import AbstractMotion, Observation
from .attitude import angle_rates, rotation_matrix
from .moving import Integrals, moments, node_velocity, relative_acceleration

POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
OMEGA = slice(6, 9)
ANGLES = slice(9, 12)
PATH = 12
RIGID = 13
"""How many numbers of the state are those of a rigid body."""


def _aerodynamics(given: Any) -> Any:
    """A bare polar becomes sweep theory with it."""
    return SweepTheory(given) if isinstance(given, AbstractPolar) else given


class Glider(Part):
    """What flies: a body, how it bends, the air's forces on it, the air, and gravity.

    Every float in it can be differentiated with respect to. Each part is a seam: its abstract
    class says what another one must do.

    Args:
        body: a `Snake`, or another `AbstractBody`.
        gait: a `Gait`, or another `AbstractMotion`.
        aerodynamics: `SweepTheory` or another `AbstractAerodynamics`; a polar alone means
            sweep theory with it. By default with the published polar.
        air: `StillAir`, or another `AbstractAir`.
        gravity: gravitational acceleration [m/s^2], 0 to 100.

    Raises:
        TypeError: a part is of another type.
        ValueError: a value in it is not allowed, or a straight body has no inertia about its
            own axis (see `Snake.gyration`).

    Examples:
        >>> from jaxglide import Gait, Glider, Polar, Snake, UniformWind
        >>> glider = Glider(Snake.from_svl(0.70), Gait.from_degrees(), Polar.smooth())
        >>> air = UniformWind([0, -1, 0])
        >>> windy = Glider(glider.body, glider.gait, glider.aerodynamics, air)
        >>> print(type(windy.aerodynamics).__name__, windy.air.velocity)
        SweepTheory [ 0. -1.  0.]
    """

    body: AbstractBody
    gait: AbstractMotion
    aerodynamics: AbstractAerodynamics = eqx.field(
        converter=_aerodynamics, default_factory=lambda: SweepTheory(Polar.published())
    )
    air: AbstractAir = eqx.field(default_factory=StillAir)
    gravity: Scalar = eqx.field(
        converter=floats,
        default=9.81,
        metadata=about("m/s^2", "gravitational acceleration", symbol="g", low=0, high=100),
    )

    def _check(self):
        check_kind("body", self.body, AbstractBody)
        check_kind("gait", self.gait, AbstractMotion)
        check_kind("aerodynamics", self.aerodynamics, AbstractAerodynamics)
        check_kind("air", self.air, AbstractAir)
        if self.gait.straight and getattr(self.body, "gyration", 0.0) is None:
            raise ValueError(
                "gyration = None is not allowed of a straight body (theta_m, psi_m, d_psi and "
                "d_theta all 0): with all mass on the backbone it has no inertia about its own "
                "axis; a flat ellipse has a gyration of 0.25 chords"
            )


def check_glider(glider) -> Glider:
    """`glider`, checked again: its parts may have been exchanged since it was made."""
    recheck(check_kind("glider", glider, Glider))
    return glider


class Flight(NamedTuple):
    """What the vector field needs besides time and state.

    Attributes:
        glider: the glider.
        sections: its body, discretised.
        phase: launch phase of the motion [rad].
    """

    glider: Glider
    sections: Sections
    phase: Scalar


class Elements(NamedTuple):
    """The body's elements at one instant, in body axes unless named otherwise.

    Attributes:
        body: positions, velocities, accelerations and frames in co-moving axes.
        air_velocity: velocity through the air, wind taken off [m/s], (3, n).
        relative_acceleration: acceleration relative to the centre of mass but for the
            part due to the angular acceleration [m/s^2], (3, n).
        moment: moment of the air's force about the centre of mass [N m], (3, n).
        aerodynamics: forces, coefficients and angles of every element.
        R_BI: rotation from inertial to body components, (3, 3).
        rates: of the own states of motion and aerodynamics, (k,).
    """

    body: Backbone
    air_velocity: Nodes3
    relative_acceleration: Nodes3
    moment: Nodes3
    aerodynamics: Aerodynamics
    R_BI: Mat3
    rates: Float[Array, " k"]


def observation(state: State) -> Observation:
    """What a drive may see of a state."""
    return Observation(state[POSITION], state[VELOCITY], state[OMEGA], state[ANGLES])


def _moving(time, state, own, flight: Flight):
    """The backbone, the rates of the motion's own states, and the elements' flow."""
    glider, sections, phase = flight
    wave, rates = glider.gait.bending(
        sections.fraction, sections.neck_fraction, time, phase, own, observation(state)
    )
    for name, angle in zip(wave._fields, wave, strict=True):
        check_given(f"{name} of {type(glider.gait).__name__}", angle, sections.fraction.shape)
    body, *integrated = bent(sections, wave)
    integrals = Integrals(integrated[0], sections.unit_integral, integrated[1])
    R_BI = rotation_matrix(state[ANGLES])
    velocity_B = jnp.sum(R_BI * state[VELOCITY], axis=1)
    velocity = node_velocity(integrals, velocity_B, state[OMEGA])
    place = R_BI.T @ body.position + state[POSITION][:, None]
    wind = glider.air.wind(place, time)
    if wind is not None:
        check_given(f"wind of {type(glider.air).__name__}", wind, place.shape)
        velocity = by_rows(jnp.subtract, velocity, R_BI @ wind)
    flow = Flow(
        velocity=velocity,
        position=body.position,
        tangent=body.tangent,
        chord_direction=body.chord,
        normal=body.normal,
        chord=sections.chord,
        area=sections.area,
        air_density=glider.air.air_density,
        kinematic_viscosity=glider.air.kinematic_viscosity,
    )
    return body, rates, flow, R_BI, integrals


def _forced(model: AbstractAerodynamics, flow: Flow, states):
    """Forces and rates of own states, whose shapes are checked: the model may be a user's."""
    found, kind = model(flow, states), type(model).__name__
    if not isinstance(found, tuple) or list(map(type, found[:-1])) != [Aerodynamics]:
        raise TypeError(f"{kind} must give Aerodynamics and the rates of its own states")
    check_given(f"force of {kind}", found[0].force, flow.velocity.shape)
    check_given(f"{kind}'s rates of its states", found[1], states.shape)
    return found


def with_own_states(time: Scalar, rigid: Float[Array, "13"], flight: Flight) -> State:
    """A state whose motion and aerodynamics start here.

    Args:
        time: since launch [s].
        rigid: its first 13 numbers.
        flight: glider, sections and launch phase.
    """
    glider = flight.glider
    own, air = glider.gait.start(flight.phase), glider.aerodynamics
    parts = [rigid, own] if own.shape[0] else [rigid]
    if type(air).start is not AbstractAerodynamics.start:  # else there is nothing to start
        parts.append(air.start(_moving(time, rigid, own, flight)[2]))
    return jnp.concatenate(parts) if parts[1:] else rigid


def elements(time: Scalar, state: State, flight: Flight) -> Elements:
    """Motion of and force on every element.

    Args:
        time: since launch [s].
        state: as described in this module.
        flight: glider, sections and launch phase.
    """
    return _elements(time, state, flight)[0]


def _elements(time: Scalar, state: State, flight: Flight) -> tuple[Elements, Integrals]:
    """The same, and the integrals along the body behind it."""
    glider = flight.glider
    count = jax.eval_shape(glider.gait.start, flight.phase).shape[0]
    own, lag = state[RIGID : RIGID + count], state[RIGID + count :]
    body, own_rates, flow, R_BI, integrals = _moving(time, state, own, flight)
    relative = relative_acceleration(state[OMEGA], integrals.integrals)
    air, lag_rates = _forced(glider.aerodynamics, flow, lag)
    moment = cross(body.position, air.force)
    rates = jnp.concatenate([own_rates, lag_rates])
    found = Elements(body, flow.velocity, relative, moment, air, R_BI, rates)
    return found, integrals


@eqx.filter_jit
def six_degrees_of_freedom(time: Scalar, state: State, flight: Flight) -> State:
    """Rate of the state in free flight (eqs 4-5, 16-17, 22).

    The rotational equation I omega' = M_A - omega x (I omega) - [I'] omega - omega x h
    - [h'] is written as the moment of the air minus that of every element's inertia,
    since omega x (I omega) + [I'] omega + omega x h + [h'] = sum m r x (r'' + 2 omega x r'
    + omega x (omega x r)): one sum over the nodes instead of four.

    Args:
        time: since launch [s].
        state: as described in this module.
        flight: glider, sections and launch phase.
    """
    glider, sections, _ = flight
    now, integrals = _elements(time, state, flight)
    force_B = over_nodes(now.aerodynamics.force)
    force_I = jnp.sum(now.R_BI * force_B[:, None], axis=0)
    weight = jnp.stack([0.0 * glider.gravity] * 2 + [glider.gravity])
    acceleration = force_I / sections.total_mass - weight
    moment, seconds = moments(integrals, state[OMEGA], sections.mass, now.aerodynamics.force)
    if sections.axial_inertia is not None:
        moment = moment - section_moment(sections, now.body, state[OMEGA])
    omega_dot = solve3(tensor_of(sections, now.body.chord, seconds), moment)
    velocity = state[VELOCITY]
    path_rate = safe_sqrt(velocity[0] ** 2 + velocity[1] ** 2)
    rates = [
        velocity,
        acceleration,
        omega_dot,
        angle_rates(state[ANGLES], state[OMEGA]),
        path_rate[None],
    ]
    return jnp.concatenate([*rates, now.rates] if now.rates.shape[0] else rates)
