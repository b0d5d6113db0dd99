"""What an optimiser asks for, and its constraints.

An `Objective` is a pure, differentiable function of a glider and its launch. Objectives add
up, scale and become constraints:

    landing_distance - 0.5 * sink_rate
    stability_margin.at_least(10.0)

Several of them evaluated together (`evaluate`) share one glide.

A glide that tumbles has no landing point. So that a search can leave the region of tumbling
without falling off a cliff, distance and time are then continued from the tumble by the
parabola of a body without air, which agrees with a landing where the tumble happens at the
ground; and `stability_margin`, zero at such a landing, goes on below zero in proportion to
the height left.
"""

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_choice, check_range
from .._lib.numerics import safe_sqrt
from .._lib.types import Array, Float, Scalar
from ..body.sections import discretise
from ..flight.dynamics import Glider
from ..flight.ends import ANGLE_LIMIT
from ..flight.launch import Launch, published_speed
from ..shape.gait import waves
from ..shape.kinematics import backbone
from ..tunnel.loads import phases_of
from ..tunnel.trim import pitch_moment
from .objective import Constraint as Constraint
from .objective import Objective, Trial

_SOFTNESS = 2.0  # deg over which the largest of three angles is smoothed
_PHASES = 24  # of the waves, over which properties of the gait are averaged
_APART = 0.15  # of the length, for parts of the body that might touch


def evaluate(
    objectives: Sequence[Objective], glider: Glider, launch: Launch | None = None, **options
) -> Float[Array, " k"]:
    """Values of several objectives from one glide, (k,)."""
    if not objectives:
        raise ValueError("there are no objectives to evaluate")
    trial = Trial(glider, launch, **options)
    return jnp.stack([objective.value(trial) for objective in objectives])


VARIED = ("lift_scale", "drag_scale", "speed", "mass")
"""What `varied` can multiply."""


def _multiplied(glider: Glider, launch: Launch, factors) -> tuple[Glider, Launch]:
    """Glider and launch with four quantities multiplied, in the order of `VARIED`."""
    lift, drag, speed, mass = factors
    polar = glider.aerodynamics.polar
    launched = launch.speed
    if launched is None:
        launched = published_speed(glider, discretise(glider.body))
    glider = eqx.tree_at(
        lambda g: (
            g.aerodynamics.polar.lift_scale,
            g.aerodynamics.polar.drag_scale,
            g.body.mass,
        ),
        glider,
        (lift * polar.lift_scale, drag * polar.drag_scale, mass * glider.body.mass),
    )
    launch = eqx.tree_at(
        lambda x: x.speed, launch, speed * launched, is_leaf=lambda x: x is None
    )
    return glider, launch


def varied(
    objective: Objective, factors: Mapping[str, Sequence[float]], how: str = "mean"
) -> Objective:
    """The objective over a set of changed circumstances: its mean, or its worst value.

    Args:
        objective: what is wanted in each of them (see `Objective.sense`).
        factors: multipliers by name of `VARIED`, each (K,); the others are 1. The launch
            speed is that of the unchanged glider.
        how: "mean" or "worst"; the gradient of the worst is that of the one that is worst.

    Raises:
        ValueError: an unknown name, lengths that differ, factors not above 0.
    """
    check_choice("how", how, ("mean", "worst"))
    for name, values in factors.items():
        check_choice("factors", name, VARIED)
        check_range(f"factors of {name}", np.asarray(values), "", 0, 100, low_open=True)
    shapes = {np.shape(values) for values in factors.values()}
    if len(shapes) != 1 or min(map(len, shapes)) != 1 or shapes == {(0,)}:
        raise ValueError(
            f"factors have shapes {sorted(shapes)}: they must be one list each, of one length"
        )
    ones = np.ones(shapes.pop())
    table = np.stack([np.asarray(factors.get(name, ones), float) for name in VARIED], axis=1)

    def function(trial: Trial) -> Scalar:
        def one(row):
            changed = _multiplied(trial.glider, trial.launch, row)
            return objective.value(Trial(*changed, **trial.options))

        values = jax.vmap(one)(jnp.asarray(table))
        if how == "mean":
            return jnp.mean(values)
        return jnp.min(values) if objective.sense > 0 else jnp.max(values)

    name = f"{how} {objective.name} of {len(table)}"
    return Objective(name, objective.unit, function, objective.sense)


def _stability_margin(trial: Trial) -> Scalar:
    degrees = jnp.rad2deg(trial.glide.max_angles)
    largest = _SOFTNESS * jax.nn.logsumexp(degrees / _SOFTNESS)
    limit = np.rad2deg(ANGLE_LIMIT)
    return limit - largest - limit * trial.height_left / trial.launch.height


def _squared_pitch_moment(trial: Trial) -> Scalar:
    return (1e3 * pitch_moment(trial.glider, trial.launch)) ** 2


def _over_phases(trial: Trial, function) -> Scalar:
    return jnp.mean(jax.vmap(function)(phases_of(_PHASES)))


def _curvature(trial: Trial) -> Scalar:
    glider, sections = trial.glider, trial.sections
    width = sections.area / sections.chord

    def squared(phase):
        def angles(fraction):
            wave = waves(glider.gait, glider.body.neck_fraction, fraction, phase, 0.0)
            return wave.theta, wave.psi

        ones = jnp.ones_like(sections.fraction)
        (_, psi), (theta_s, psi_s) = jax.jvp(angles, (sections.fraction,), (ones,))
        kappa = psi_s**2 + (jnp.cos(psi) * theta_s) ** 2
        return jnp.sum(width * kappa) / jnp.sum(width)

    return safe_sqrt(_over_phases(trial, squared))


def _undulation_power(trial: Trial) -> Scalar:
    glider, sections = trial.glider, trial.sections

    def squared(phase):
        rate = -2 * jnp.pi * glider.gait.f_theta
        body = backbone(
            sections, waves(glider.gait, sections.neck_fraction, sections.fraction, phase, rate)
        )
        return jnp.sum(sections.mass * jnp.sum(body.velocity * body.acceleration, axis=0)) ** 2

    return safe_sqrt(_over_phases(trial, squared))


def _clearance(trial: Trial) -> Scalar:
    glider, sections = trial.glider, trial.sections
    fraction = sections.fraction
    apart = jnp.abs(fraction[:, None] - fraction) > _APART

    def nearest(phase):
        place = backbone(
            sections, waves(glider.gait, sections.neck_fraction, sections.fraction, phase, 0.0)
        ).position
        squared = jnp.sum((place[:, :, None] - place[:, None, :]) ** 2, axis=0)
        return jnp.min(jnp.where(apart, squared, jnp.inf))

    least = jnp.min(jax.vmap(nearest)(phases_of(_PHASES)))
    return safe_sqrt(least) / jnp.max(sections.chord)


landing_distance = Objective("landing_distance", "m", lambda trial: trial.distance)
"""Forward distance y of the landing point; after a tumble continued without air."""

path_length = Objective("path_length", "m", lambda trial: trial.path_length)
"""Horizontal path length, the published glide distance; after a tumble continued."""

glide_ratio = Objective(
    "glide_ratio", "", lambda trial: trial.path_length / trial.launch.height
)
"""Horizontal path length over height; after a tumble continued."""

sink_rate = Objective(
    "sink_rate", "m/s", lambda trial: trial.launch.height / trial.time, sense=-1
)
"""Height over duration; after a tumble continued."""

glide_angle = Objective(
    "glide_angle", "deg", lambda trial: jnp.rad2deg(trial.glide.glide_angle), sense=-1
)
"""Angle of the path below the horizontal at the end, wherever that is."""

stability_margin = Objective("stability_margin", "deg", _stability_margin)
"""85 degrees minus the largest |yaw|, |pitch|, |roll| of the glide (a smooth maximum, at most
2.2 degrees above the true one), and minus 85 degrees times the share of the height left where
it tumbles."""

squared_pitch_moment = Objective(
    "squared_pitch_moment", "(N mm)^2", _squared_pitch_moment, sense=-1
)
"""Square of the phase-averaged pitch moment at the end of the held glide (`windtunnel`)."""

curvature = Objective("curvature", "1/SVL", _curvature, sense=-1)
"""Root mean square curvature of the body over its length and a cycle, times its length."""

undulation_power = Objective("undulation_power", "W", _undulation_power, sense=-1)
"""Root mean square rate of the kinetic energy of the shape change over a cycle."""

clearance = Objective("clearance", "chords", _clearance)
"""Least distance over a cycle between parts of the body more than 0.15 of its length apart,
in greatest chords: below 1 the body may touch itself, which the model does not know."""

OBJECTIVES = {
    objective.name: objective
    for objective in (
        landing_distance,
        path_length,
        glide_ratio,
        sink_rate,
        glide_angle,
        stability_margin,
        squared_pitch_moment,
        curvature,
        undulation_power,
        clearance,
    )
}
"""Objectives by name."""
