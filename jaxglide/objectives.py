"""What an optimiser asks for, and its constraints (floor 5).

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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._checks import check_choice, check_range
from ._numerics import safe_sqrt
from ._types import Array, Float, Scalar
from .dynamics import VELOCITY, Glider
from .gait import bending
from .glide import ANGLE_LIMIT, Glide, Outcome, simulate
from .kinematics import backbone
from .launch import Launch, published_speed
from .snake import Sections, discretise
from .trim import pitch_moment
from .windtunnel import phases_of

_SOFTNESS = 2.0  # deg over which the largest of three angles is smoothed
_PHASES = 24  # of the waves, over which properties of the gait are averaged
_APART = 0.15  # of the length, for parts of the body that might touch


class Trial:
    """A glider and launch under judgement; flies at most once, however many ask.

    Args:
        glider, launch: what is judged.
        **options: how to solve; keyword arguments of `simulate`.
    """

    def __init__(self, glider: Glider, launch: Launch | None = None, **options):
        self.glider = glider
        self.launch = Launch() if launch is None else launch
        self.options = options

    @cached_property
    def sections(self) -> Sections:
        return discretise(self.glider.snake)

    @cached_property
    def glide(self) -> Glide:
        return simulate(self.glider, self.launch, **self.options)

    @cached_property
    def landed(self) -> Array:
        return self.glide.outcome == Outcome.LANDED

    @cached_property
    def height_left(self) -> Scalar:
        """Height above the ground at the end [m], 0 for a landing."""
        return jnp.where(self.landed, 0.0, jnp.maximum(self.glide.state[2], 0.0))

    @cached_property
    def drop_time(self) -> Scalar:
        """Time that a body without air takes from the end to the ground [s]."""
        v_z, gravity = self.glide.state[VELOCITY][2], self.glider.environment.gravity
        root = safe_sqrt(v_z**2 + 2 * gravity * self.height_left)
        # v_z + root without cancellation for a falling body
        down = 2 * gravity * self.height_left / jnp.where(root > v_z, root - v_z, 1.0)
        return jnp.where(self.height_left > 0, down / gravity, 0.0)

    @cached_property
    def distance(self) -> Scalar:
        """Forward distance at the ground [m], continued."""
        return self.glide.state[1] + self.drop_time * self.glide.state[VELOCITY][1]

    @cached_property
    def path_length(self) -> Scalar:
        """Horizontal path length to the ground [m], continued."""
        v_x, v_y, _ = self.glide.state[VELOCITY]
        return self.glide.path_length + self.drop_time * safe_sqrt(v_x**2 + v_y**2)

    @cached_property
    def time(self) -> Scalar:
        """Duration to the ground [s], continued."""
        return self.glide.time + self.drop_time


@dataclass(frozen=True)
class Objective:
    """A number to be made as large as possible, or kept in bounds.

    Call it with a glider and a launch; options are those of `simulate`.

    Args:
        name: in a word, or as a sum of words.
        unit: of its value.
        function: of a `Trial`.
        sense: 1 where more is better, -1 where less is.
    """

    name: str
    unit: str
    function: Callable[[Trial], Scalar]
    sense: int = 1

    def __call__(self, glider: Glider, launch: Launch | None = None, **options) -> Scalar:
        return self.function(Trial(glider, launch, **options))

    def __mul__(self, factor: float) -> "Objective":
        weight = float(factor)
        return Objective(
            f"{weight:g} * {self.name}",
            self.unit,
            lambda trial: weight * self.function(trial),
            self.sense if weight >= 0 else -self.sense,
        )

    __rmul__ = __mul__

    def __add__(self, other: "Objective") -> "Objective":
        return Objective(
            f"{self.name} + {other.name}",
            self.unit if self.unit == other.unit else "mixed",
            lambda trial: self.function(trial) + other.function(trial),
        )

    def __neg__(self) -> "Objective":
        return Objective(
            f"-{self.name}", self.unit, lambda trial: -self.function(trial), -self.sense
        )

    def __sub__(self, other: "Objective") -> "Objective":
        total = self + (-other)
        return Objective(f"{self.name} - {other.name}", total.unit, total.function)

    @property
    def wanted(self) -> "Objective":
        """The objective such that more is better."""
        return self if self.sense > 0 else -self

    def at_least(self, bound: float, scale: float = 1.0) -> "Constraint":
        """The constraint that the value is `bound` or more; `scale` as in `Constraint`."""
        return Constraint(self, float(bound), 1, float(scale))

    def at_most(self, bound: float, scale: float = 1.0) -> "Constraint":
        """The constraint that the value is `bound` or less."""
        return Constraint(self, float(bound), -1, float(scale))


@dataclass(frozen=True)
class Constraint:
    """An inequality that a solution has to meet.

    Args:
        objective: what is constrained.
        bound: in its unit.
        side: 1 for at least, -1 for at most.
        scale: a violation that weighs as much as one unit of what is optimised.

    Raises:
        ValueError: the bound is not finite or the scale not above 0.
    """

    objective: Objective
    bound: float
    side: int
    scale: float

    def __post_init__(self):
        check_range(f"bound of {self.objective.name}", self.bound, self.objective.unit)
        check_range(f"scale of {self.objective.name}", self.scale, "", 0, low_open=True)

    def __str__(self) -> str:
        return f"{self.objective.name} {'>=' if self.side > 0 else '<='} {self.bound:g}"

    def slack(self, trial: Trial) -> Scalar:
        """How far inside the bound the value lies, over the scale; negative outside."""
        return self.side * (self.objective.function(trial) - self.bound) / self.scale


def evaluate(
    objectives: Sequence[Objective], glider: Glider, launch: Launch | None = None, **options
) -> Float[Array, " k"]:
    """Values of several objectives from one glide, (k,)."""
    trial = Trial(glider, launch, **options)
    return jnp.stack([objective.function(trial) for objective in objectives])


VARIED = ("lift_scale", "drag_scale", "speed", "mass")
"""What `varied` can multiply."""


def _multiplied(glider: Glider, launch: Launch, factors) -> tuple[Glider, Launch]:
    """Glider and launch with four quantities multiplied, in the order of `VARIED`."""
    lift, drag, speed, mass = factors
    polar = glider.polar
    launched = launch.speed
    if launched is None:
        launched = published_speed(glider, discretise(glider.snake))
    glider = eqx.tree_at(
        lambda g: (g.polar.lift_scale, g.polar.drag_scale, g.snake.mass),
        glider,
        (lift * polar.lift_scale, drag * polar.drag_scale, mass * glider.snake.mass),
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
    lengths = {len(values) for values in factors.values()}
    if len(lengths) != 1:
        raise ValueError(f"factors have lengths {sorted(lengths)}: they must be one length")
    ones = np.ones(lengths.pop())
    table = np.stack([np.asarray(factors.get(name, ones), float) for name in VARIED], axis=1)

    def function(trial: Trial) -> Scalar:
        def one(row):
            changed = _multiplied(trial.glider, trial.launch, row)
            return objective.function(Trial(*changed, **trial.options))

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
            wave = bending(glider.gait, glider.snake.neck_fraction, fraction, phase, 0.0)
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
        body = backbone(sections, glider.gait, glider.snake.neck_fraction, phase, rate)
        return jnp.sum(sections.mass * jnp.sum(body.velocity * body.acceleration, axis=0)) ** 2

    return safe_sqrt(_over_phases(trial, squared))


def _clearance(trial: Trial) -> Scalar:
    glider, sections = trial.glider, trial.sections
    fraction = sections.fraction
    apart = jnp.abs(fraction[:, None] - fraction) > _APART

    def nearest(phase):
        place = backbone(sections, glider.gait, glider.snake.neck_fraction, phase, 0.0).position
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
