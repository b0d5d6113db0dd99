"""A motion given by tables of the bending angles over body and time."""

import equinox as eqx
import jax.numpy as jnp

from .._lib.fields import about, floats
from .._lib.types import Array, Float
from .motion import AbstractMotion, Bending
from .splines import basis, check_knots, knots_of, spline


class TabulatedMotion(AbstractMotion):
    """Bending angles measured or designed at stations along the body, over time.

    Cubic splines in both: in time smooth to the second derivative from the first time to the
    last, held before and after, with no rate at either. The angles hold all along the body,
    the neck included. The motion has no cycle: its launch phase has no effect, and it starts
    level where the launch says no angles.

    Args:
        times: since launch [s], rising, (T,), T at least 2 (static).
        stations: fractions of the body's length, rising within 0 to 1, (K,), K at least 2
            (static); beyond the first and the last the angles stay as they are there.
        theta: horizontal bending angles [rad], (T, K).
        psi: vertical bending angles [rad], (T, K).

    Raises:
        TypeError: a value is not a number.
        ValueError: times or stations that do not rise, or angles of another shape.
    """

    times: tuple[float, ...] = eqx.field(static=True, converter=knots_of("times"))
    stations: tuple[float, ...] = eqx.field(static=True, converter=knots_of("stations"))
    theta: Float[Array, "T K"] = eqx.field(
        converter=floats, metadata=about("rad", "horizontal bending angle")
    )
    psi: Float[Array, "T K"] = eqx.field(
        converter=floats, metadata=about("rad", "vertical bending angle")
    )

    def _check(self):
        check_knots("times", self.times, "s")
        check_knots("stations", self.stations, "of the length")
        if not 0 <= self.stations[0] <= self.stations[-1] <= 1:
            worst = self.stations[0] if self.stations[0] < 0 else self.stations[-1]
            raise ValueError(
                f"stations = {worst:g} of the length is not allowed: it must be in [0, 1]"
            )
        shape = len(self.times), len(self.stations)
        for name in ("theta", "psi"):
            found = getattr(self, name).shape
            if found != shape:
                raise ValueError(
                    f"{name} has shape {found}: it must be {shape}, by times and stations"
                )

    def bending(self, fraction, neck_fraction, time, phase, states, observation):
        both = jnp.concatenate([self.theta, self.psi], axis=1)
        now = spline(self.times, both, time)
        angles = jnp.stack([now.value, now.rate, now.second])
        # the same at the nodes: rows theta, psi of each
        along = self._along(fraction) @ angles.reshape(6, -1).T
        theta, psi = along[:, ::2].T, along[:, 1::2].T
        return Bending(*theta, *psi), states

    def _along(self, fraction) -> Float[Array, "n K"]:
        """Matrix from values at the stations to those at fractions, (n, K)."""
        knots = jnp.asarray(self.stations)
        x = jnp.clip(fraction, knots[0], knots[-1])
        i = jnp.clip(jnp.searchsorted(knots, x, side="right") - 1, 0, len(self.stations) - 2)
        c = jnp.asarray(basis(self.stations, "natural"))[i]
        x = (x - knots[i])[:, None]
        return c[:, 0] + x * (c[:, 1] + x * (c[:, 2] + x * c[:, 3]))
