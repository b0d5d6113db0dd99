"""The largest angles of a flight, followed as it is solved, and ends that are only grazed."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp

from .._lib.numerics import safe_sqrt
from .._lib.types import Array, Bool, Float, Scalar, State, Vec3
from .attitude import angle_rates
from .dynamics import ANGLES, OMEGA, VELOCITY
from .ends import AbstractEnd, clearance

# By float size: how far past an end counts as past it [m, rad], and the shortest step that
# is cut shorter still to see it [s].
_PAST = {8: (1e-10, 1e-9), 4: (1e-5, 1e-4)}


class _Point(eqx.Module):
    """Angles [rad] and ends at a time, (3 + k,), and their rates."""

    time: Scalar
    value: Float[Array, " w"]
    rate: Float[Array, " w"]

    @classmethod
    def of(cls, time, state: State, ends: tuple[AbstractEnd, ...]) -> "_Point":
        """What is followed, which depends on place and attitude alone: its rate is known."""
        time = jnp.asarray(time, state.dtype)
        turning, rest = angle_rates(state[ANGLES], state[OMEGA]), jnp.zeros_like(state)
        moving = jnp.concatenate(
            [state[VELOCITY], rest[: ANGLES.start - 3], turning, rest[ANGLES.stop :]]
        )

        def followed(state):
            angles = state[ANGLES]
            return jnp.concatenate([angles, clearance(ends, time, state)]) if ends else angles

        return cls(time, *jax.jvp(followed, (state,), (moving,)))


class _Step(eqx.Module):
    """The cubic through both ends of a step, values and slopes.

    Attributes:
        end: values at its end, (3 + k,).
        places, extremes: fractions of the step at which it is stationary, in 0 to 1, and
            the values there, (2, 3 + k).
    """

    end: Float[Array, " w"]
    places: Float[Array, "2 w"]
    extremes: Float[Array, "2 w"]

    @classmethod
    def between(cls, start: _Point, end: _Point) -> "_Step":
        h = end.time - start.time
        a, da, b, db = start.value, h * start.rate, end.value, h * end.rate
        # a + da x + p x^2 + q x^3 on 0 <= x <= 1; extremes where its slope is zero
        p, q = 3 * (b - a) - 2 * da - db, da + db - 2 * (b - a)
        root = safe_sqrt(jnp.maximum(p * p - 3 * q * da, 0.0))
        s = -(p + jnp.where(p < 0, -1.0, 1.0) * root)
        top, bottom = jnp.stack([s, da]), jnp.stack([3 * q, s])
        x = jnp.clip(top / jnp.where(bottom == 0, 1.0, bottom), 0.0, 1.0)
        return cls(b, x, a + x * (da + x * (p + x * q)))

    @property
    def largest(self) -> Vec3:
        """Largest |angles| after its start [rad], (3,)."""
        within = jnp.max(jnp.abs(self.extremes[:, :3]), axis=0)
        return jnp.maximum(within, jnp.abs(self.end[:3]))

    def first_graze(self, past: float) -> tuple[Bool[Array, ""], Scalar]:
        """Whether an end is passed on the way but not at the end, and where first."""
        passed = (self.extremes[:, 3:] < -past) & (self.end[3:] >= 0)
        return jnp.any(passed), jnp.min(jnp.where(passed, self.places[:, 3:], 1.0), initial=1.0)


def step_peaks(t0: Scalar, y0: State, t1: Scalar, y1: State) -> Vec3:
    """Largest |angles| of a step after its start [rad], (3,), from both of its ends."""
    return _Step.between(_Point.of(t0, y0, ()), _Point.of(t1, y1, ())).largest


class Peaks(eqx.Module):
    """Largest |angles| of a flight up to a point, and over the step from there on.

    Attributes:
        largest: up to `point` [rad], (3,).
        latest: over the step accepted there, to its full length [rad], (3,).
        point: where that step starts.
    """

    largest: Vec3
    latest: Vec3
    point: _Point

    @classmethod
    def start(cls, time, state, ends: tuple[AbstractEnd, ...] = ()) -> "Peaks":
        largest = jnp.abs(state[ANGLES])
        return cls(largest, largest, _Point.of(time, state, ends))

    def upto(self, time, state) -> Vec3:
        """Largest |angles| to a point within the latest step [rad], (3,)."""
        start = _Point(self.point.time, self.point.value[:3], self.point.rate[:3])
        step = _Step.between(start, _Point.of(time, state, ()))
        return jnp.maximum(self.largest, step.largest)


class PeakController(diffrax.AbstractStepSizeController):
    """A step size controller that also follows the largest angles of the accepted steps.

    Events are seen at the ends of steps only. So a step in whose midst an end is grazed is
    taken again, up to there. What it follows never contradicts how the flight ends. The last
    step may be cut short by an event: it is kept apart, to be covered to its true end.
    """

    inner: diffrax.AbstractStepSizeController
    ends: tuple[AbstractEnd, ...]

    def wrap(self, direction):
        return PeakController(self.inner.wrap(direction), self.ends)

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        t1, state = self.inner.init(terms, t0, t1, y0, dt0, args, func, error_order)
        return t1, (state, Peaks.start(t0, y0, self.ends))

    def adapt_step_size(
        self, t0, t1, y0, y1_candidate, args, y_error, error_order, controller_state
    ):
        before, peaks = controller_state
        keep, next_t0, next_t1, made_jump, state, result = self.inner.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, before
        )
        past, shortest = _PAST[y0.dtype.itemsize]
        # A step that is not kept may hold anything: it is replaced by none at all.
        states = jnp.stack([y0, jnp.where(keep, y1_candidate, y0)])
        points = jax.vmap(lambda t, y: _Point.of(t, y, self.ends))(jnp.stack([t0, t1]), states)
        point, end = (jax.tree.map(lambda x, i=i: x[i], points) for i in range(2))
        step = _Step.between(point, end)
        grazes, place = step.first_graze(past)
        grazes &= keep & (t1 - t0 > shortest)
        cut = jax.lax.stop_gradient(t0 + place * (t1 - t0))
        largest = jnp.maximum(peaks.largest, peaks.latest)
        latest = jnp.where(keep & ~grazes, step.largest, 0.0)
        return (
            keep & ~grazes,
            jnp.where(grazes, t0, next_t0),
            jnp.where(grazes, cut, next_t1),
            made_jump,
            (
                jax.tree.map(lambda old, new: jnp.where(grazes, old, new), before, state),
                Peaks(largest, latest, point),
            ),
            result,
        )
