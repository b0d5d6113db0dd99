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
from .._lib.numerics import safe_sqrt, sincos
from .._lib.types import Array, Float, Scalar
from ..body.sections import discretise
from ..flight.case import Case
from ..flight.dynamics import VELOCITY, Glider
from ..flight.ends import TURNS
from ..flight.launch import Launch, published_speed
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


def _multiplied(case: Case, factors: Mapping[str, Scalar]) -> Case:
    """The case with some of its floats multiplied."""
    values = {}
    for name, factor in factors.items():
        value = case.value(name)
        if value is None and case.path(name) == "launch.speed":
            value = published_speed(case.glider, discretise(case.glider.body))
        if value is None:
            raise ValueError(f"{name} is left out: there is nothing to multiply")
        values[name] = factor * value
    return case.replace(values)


def varied(
    objective: Objective, factors: Mapping[str, Sequence[float]], how: str = "mean"
) -> Objective:
    """The objective over a set of changed circumstances: its mean, or its worst value.

    Args:
        objective: what is wanted in each of them (see `Objective.sense`).
        factors: multipliers of floats of glider, launch and ends, by path or short name (see
            `Case`), each (K,); nothing else changes. A launch speed that is left out is that
            of the unchanged glider.
        how: "mean" or "worst"; the gradient of the worst is that of the one that is worst.

    Raises:
        ValueError: lengths that differ, factors not above 0; in a trial, an unknown name.

    Examples:
        >>> from jaxglide import landing_distance, varied
        >>> robust = varied(landing_distance, {"lift_scale": [0.9, 1.1]}, how="worst")
        >>> robust.unit
        'm'
    """
    check_choice("how", how, ("mean", "worst"))
    for name, values in factors.items():
        check_range(f"factors of {name}", np.asarray(values), "", 0, 100, low_open=True)
    shapes = {np.shape(values) for values in factors.values()}
    if len(shapes) != 1 or min(map(len, shapes)) != 1 or shapes == {(0,)}:
        raise ValueError(
            f"factors have shapes {sorted(shapes)}: they must be one list each, of one length"
        )
    table = {name: np.asarray(values, float) for name, values in factors.items()}

    def function(trial: Trial) -> Scalar:
        def one(row):
            case = _multiplied(Case(trial.glider, trial.launch, trial.ends), row)
            options = trial.options | {"ends": case.ends}
            return objective.value(Trial(case.glider, case.launch, **options))

        values = jax.vmap(one)(jax.tree.map(jnp.asarray, table))
        if how == "mean":
            return jnp.mean(values)
        return jnp.min(values) if objective.sense > 0 else jnp.max(values)

    name = f"{how} {objective.name} of {len(next(iter(table.values())))}"
    return Objective(name, objective.unit, function, objective.sense)


def _stability_margin(trial: Trial) -> Scalar:
    angles, beyond = jnp.rad2deg(trial.glide.max_angles), []
    for end in trial.limits:
        which = np.array([TURNS.index(name) for name in end.angles])
        beyond.append(angles[which] - jnp.rad2deg(end.limit))
    largest = _SOFTNESS * jax.nn.logsumexp(jnp.concatenate(beyond) / _SOFTNESS)
    limit = jnp.rad2deg(jnp.min(jnp.stack([end.limit for end in trial.limits])))
    return -largest - limit * trial.height_left / trial.height


def _squared_pitch_moment(trial: Trial) -> Scalar:
    launch = eqx.tree_at(lambda x: x.height, trial.launch, trial.height)
    return (1e3 * pitch_moment(trial.glider, launch)) ** 2


def _over_phases(trial: Trial, function) -> Scalar:
    return jnp.mean(jax.vmap(function)(phases_of(_PHASES)))


def _curvature(trial: Trial) -> Scalar:
    sections = trial.sections
    width = sections.area / sections.chord

    def squared(phase):
        def angles(fraction):
            wave = trial.cycle(fraction, phase)
            return wave.theta, wave.psi

        ones = jnp.ones_like(sections.fraction)
        (_, psi), (theta_s, psi_s) = jax.jvp(angles, (sections.fraction,), (ones,))
        kappa = psi_s**2 + (jnp.cos(psi) * theta_s) ** 2
        return jnp.sum(width * kappa) / jnp.sum(width)

    return safe_sqrt(_over_phases(trial, squared))


def _undulation_power(trial: Trial) -> Scalar:
    sections = trial.sections

    def squared(phase):
        body = trial.moving(phase)
        return jnp.sum(sections.mass * jnp.sum(body.velocity * body.acceleration, axis=0)) ** 2

    return safe_sqrt(_over_phases(trial, squared))


def _clearance(trial: Trial) -> Scalar:
    sections = trial.sections
    fraction = sections.fraction
    apart = jnp.abs(fraction[:, None] - fraction) > _APART

    def nearest(phase):
        place = backbone(sections, trial.cycle(fraction, phase)).position
        squared = jnp.sum((place[:, :, None] - place[:, None, :]) ** 2, axis=0)
        return jnp.min(jnp.where(apart, squared, jnp.inf))

    least = jnp.min(jax.vmap(nearest)(phases_of(_PHASES)))
    return safe_sqrt(least) / jnp.max(sections.chord)


landing_distance = Objective("landing_distance", "m", lambda trial: trial.distance)
"""Forward distance y of the landing point; after a tumble continued without air."""

path_length = Objective("path_length", "m", lambda trial: trial.path_length)
"""Horizontal path length, the published glide distance; after a tumble continued."""

glide_ratio = Objective("glide_ratio", "", lambda trial: trial.path_length / trial.height)
"""Horizontal path length over height; after a tumble continued."""

sink_rate = Objective("sink_rate", "m/s", lambda trial: trial.height / trial.time, sense=-1)
"""Height over duration; after a tumble continued."""

glide_angle = Objective(
    "glide_angle", "deg", lambda trial: jnp.rad2deg(trial.glide.glide_angle), sense=-1
)
"""Angle of the path below the horizontal at the end, wherever that is."""

stability_margin = Objective("stability_margin", "deg", _stability_margin)
"""The limit of the angles among the ends, 85 degrees by default, minus the largest of those it
holds for, |yaw|, |pitch|, |roll| (a smooth maximum, of three at most 2.2 degrees above the true
one), and minus the limit times the share of the height left where it tumbles."""

squared_pitch_moment = Objective(
    "squared_pitch_moment", "(N mm)^2", _squared_pitch_moment, sense=-1
)
"""Square of the phase-averaged pitch moment at the end of the held glide (`windtunnel`)."""

curvature = Objective("curvature", "1/SVL", _curvature, sense=-1)
"""Root mean square curvature of the body over its length and a cycle, times its length."""

undulation_power = Objective("undulation_power", "W", _undulation_power, sense=-1)
"""Root mean square rate of the kinetic energy of the shape change over a cycle, as it runs at
launch."""

clearance = Objective("clearance", "chords", _clearance)
"""Least distance over a cycle between parts of the body more than 0.15 of its length apart,
in greatest chords: below 1 the body may touch itself, which the model does not know."""

steady_glide_angle = Objective(
    "steady_glide_angle", "deg", lambda trial: jnp.rad2deg(trial.steady.glide_angle), sense=-1
)
"""Angle below the horizontal of the path that the gait would settle into (`steady_glide`); NaN
where there is none."""

steady_sink_rate = Objective(
    "steady_sink_rate", "m/s", lambda trial: trial.steady.sink_rate, sense=-1
)
"""Sink rate of that glide."""

spectral_radius = Objective(
    "spectral_radius", "", lambda trial: trial.steady.spectral_radius, sense=-1
)
"""Largest modulus of that glide's multipliers, below 1 where it is stable. It has no derivative
where two of the largest meet."""


def _landing_speed(trial: Trial) -> Scalar:
    velocity = trial.glide.state[VELOCITY]
    return safe_sqrt(jnp.sum(velocity**2) + 2 * trial.glider.gravity * trial.height_left)


def _heading_change(trial: Trial) -> Scalar:
    v_x, v_y, _ = trial.glide.state[VELOCITY]
    s, c = sincos(trial.launch.heading)
    return jnp.rad2deg(jnp.arctan2(-v_x * c - v_y * s, v_y * c - v_x * s))


landing_speed = Objective("landing_speed", "m/s", _landing_speed, sense=-1)
"""Speed over the ground at the landing; after a tumble continued without air."""

heading_change = Objective("heading_change", "deg", _heading_change)
"""Direction of the velocity at the end, to the left of that of the launch, -180 to 180."""


def miss_distance(x: float, y: float) -> Objective:
    """Horizontal distance of the landing point from a target; after a tumble continued.

    Args:
        x, y: of the target, to the right and forward of the launch [m].

    Raises:
        ValueError: a number that is not finite.

    Examples:
        >>> from jaxglide import miss_distance
        >>> miss_distance(0.0, 6.0).name
        'miss_distance of (0, 6)'
    """
    check_range("x", x, "m", -1e6, 1e6, shape=())
    check_range("y", y, "m", -1e6, 1e6, shape=())

    def function(trial: Trial) -> Scalar:
        at, v = trial.glide.state[:2], trial.glide.state[VELOCITY][:2]
        return safe_sqrt(jnp.sum((at + trial.drop_time * v - jnp.array([x, y])) ** 2))

    return Objective(f"miss_distance of ({x:g}, {y:g})", "m", function, sense=-1)


def height_lost(glide_angle: float) -> Objective:
    """Height that the launch costs: how much lower a glide at an angle all the way would have
    needed to start for the same distance forward.

    Args:
        glide_angle: of the steady glide, below the horizontal [deg], above 0 and below 90.

    Raises:
        ValueError: it is not between them.
    """
    check_range(
        "glide_angle", glide_angle, "deg", 0, 90, low_open=True, high_open=True, shape=()
    )
    slope = float(np.tan(np.deg2rad(glide_angle)))
    name = f"height_lost before {glide_angle:g} deg"
    return Objective(name, "m", lambda trial: trial.height - slope * trial.distance, sense=-1)


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
        landing_speed,
        heading_change,
        steady_glide_angle,
        steady_sink_rate,
        spectral_radius,
    )
}
"""Objectives by name."""
