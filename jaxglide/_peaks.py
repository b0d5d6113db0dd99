"""The largest angles of a glide, followed as it is solved (floor 4)."""

import diffrax
import equinox as eqx
import jax.numpy as jnp

from ._numerics import safe_sqrt
from ._types import Scalar, State, Vec3
from .attitude import angle_rates
from .dynamics import ANGLES, OMEGA


class Peaks(eqx.Module):
    """Largest |angles| up to a point of the glide, and that point."""

    largest: Vec3
    time: Scalar
    angles: Vec3
    rates: Vec3

    @classmethod
    def start(cls, time, state) -> "Peaks":
        angles = state[ANGLES]
        return cls(jnp.abs(angles), time, angles, _rates(state))

    def upto(self, time, state) -> "Peaks":
        """Include the cubic through both ends of the interval, values and slopes."""
        angles, rates = state[ANGLES], _rates(state)
        h = time - self.time
        a, da, b, db = self.angles, h * self.rates, angles, h * rates
        # a + da x + p x^2 + q x^3 on 0 <= x <= 1; extremes where its slope is zero
        p, q = 3 * (b - a) - 2 * da - db, da + db - 2 * (b - a)
        root = safe_sqrt(jnp.maximum(p * p - 3 * q * da, 0.0))
        sign = jnp.where(p < 0, -1.0, 1.0)
        s = -(p + sign * root)
        largest = jnp.maximum(self.largest, jnp.abs(b))
        for top, bottom in ((s, 3 * q), (da, s)):
            x = jnp.clip(top / jnp.where(bottom == 0, 1.0, bottom), 0.0, 1.0)
            largest = jnp.maximum(largest, jnp.abs(a + x * (da + x * (p + x * q))))
        return Peaks(largest, time, angles, rates)


def _rates(state: State) -> Vec3:
    return angle_rates(state[ANGLES], state[OMEGA])


class PeakController(diffrax.AbstractStepSizeController):
    """A step size controller that also follows the largest angles of the accepted steps.

    Each call covers the glide up to the start of the step it judges, so that the last
    step, which an event cuts short, is left to be covered to its true end.
    """

    inner: diffrax.AbstractStepSizeController

    def wrap(self, direction):
        return PeakController(self.inner.wrap(direction))

    def init(self, terms, t0, t1, y0, dt0, args, func, error_order):
        t1, state = self.inner.init(terms, t0, t1, y0, dt0, args, func, error_order)
        return t1, (state, Peaks.start(t0, y0))

    def adapt_step_size(
        self, t0, t1, y0, y1_candidate, args, y_error, error_order, controller_state
    ):
        state, peaks = controller_state
        *decision, state, result = self.inner.adapt_step_size(
            t0, t1, y0, y1_candidate, args, y_error, error_order, state
        )
        return *decision, (state, peaks.upto(t0, y0)), result
