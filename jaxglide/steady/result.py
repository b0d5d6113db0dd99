"""What is known of a steady glide: where it goes, and whether it stays there."""

import dataclasses
import enum
import math
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_integer, check_range, check_shape
from .._lib.report import Report, Reported
from .._lib.types import Array, Complex, Flag, Float, Integer, Scalar
from ..air.air import UniformWind
from ..flight.dynamics import ANGLES, VELOCITY, Glider
from ..flight.integrate import integrate
from ..flight.trajectory import Trajectory
from .closure import Kind, Sought, carried
from .modes import Mode, modes_of
from .reduced import Reduced, Slopes
from .uncertainty import Uncertainty, by_coefficients, by_discretisation


class Reason(enum.IntEnum):
    """Why there is no steady glide."""

    FOUND = 0
    NOT_CONVERGED = 1
    NOT_CLOSED = 2
    UPENDED = 3

    def __str__(self) -> str:
        return _WORDS[self]


_WORDS = {
    Reason.FOUND: "found",
    Reason.NOT_CONVERGED: "the search came to no end from any of its starts",
    Reason.NOT_CLOSED: "the cycle does not close where the search ended",
    Reason.UPENDED: "the nose points straight up or down on the way, where yaw has no meaning",
}


class SteadyGlide(eqx.Module, Reported):
    """A flight that repeats itself cycle after cycle: a straight descent, or a helix.

    All velocities are through the air; a uniform wind carries it along and changes nothing
    else. What is not found is NaN. Under `vmap`, every array has the batch dimensions in
    front.

    Attributes:
        glider: what flies.
        phase: of the waves at the start of a cycle [rad].
        found: whether there is one.
        reason: a `Reason`, as an integer (see `why`).
        residual: largest of the eight scaled numbers by which a cycle misses its start; of a
            frozen body the largest scaled rate [1/s].
        iterations: derivatives of the map that the search took.
        state: at the start of a cycle: velocity in heading axes (right, forward, up) [m/s],
            angular velocity in body axes [rad/s], pitch and roll [rad], (8,).
        period: of a cycle [s]; of a frozen body a second.
        speed: at the start [m/s].
        glide_angle: of the mean path, through the places at the starts of cycles, below the
            horizontal [rad].
        forward_speed: horizontally along the mean path [m/s].
        sink_rate: downwards along it [m/s].
        turn_rate: to the left [rad/s].
        multipliers: what a small change is multiplied by in a cycle (of a frozen body in a
            second), complex, the largest first, (8,).
        spectral_radius: modulus of the first: below 1 every small change dies out.
        slopes: derivative of the return map by the scaled state (of a frozen body, of the
            rates), (8, 8).
        states: states of flight through the air over a cycle, at equally spaced times, from
            the origin and yaw 0 (see `dynamics`), (C, 13).
        step: longest step of the solver [s].
        frozen: whether the body does not undulate (static).
        averaged: whether it is one of the averaged model (static); see `averaged_glide`.
    """

    glider: Glider
    phase: Scalar
    found: Flag
    reason: Integer
    residual: Scalar
    iterations: Integer
    state: Reduced
    period: Scalar
    speed: Scalar
    glide_angle: Scalar
    forward_speed: Scalar
    sink_rate: Scalar
    turn_rate: Scalar
    multipliers: Complex[Array, "8"]
    spectral_radius: Scalar
    slopes: Slopes
    states: Float[Array, "C 13"]
    step: Scalar
    frozen: bool = eqx.field(static=True)
    averaged: bool = eqx.field(static=True, default=False)

    @property
    def why(self) -> str:
        """Whether one was found, or why not, in words."""
        return str(Reason(int(self._one().reason)))

    @property
    def lift_to_drag(self) -> Float[Array, "..."]:
        """Forward speed over sink rate."""
        return self.forward_speed / self.sink_rate

    @property
    def turn_radius(self) -> Float[Array, "..."]:
        """Of the mean path [m]; infinite if it is straight."""
        turning = jnp.abs(self.turn_rate)
        straight = turning == 0
        radius = self.forward_speed / jnp.where(straight, 1.0, turning)
        return jnp.where(straight & self.found, jnp.inf, radius)

    @property
    def stable(self) -> Array:
        """Whether every small change dies out."""
        return self.spectral_radius < 1

    @property
    def exponents(self) -> Complex[Array, "... 8"]:
        """Rates at which small changes grow and turn [1/s], complex, the largest first."""
        return jnp.log(self.multipliers) / self.period[..., None]

    @property
    def times(self) -> Float[Array, "... C"]:
        """Times of `states` [s], (C,)."""
        return self.period[..., None] * jnp.linspace(0.0, 1.0, self.states.shape[-2])

    @property
    def angles(self) -> Float[Array, "... C 3"]:
        """Yaw, pitch, roll over a cycle [rad], (C, 3)."""
        return self.states[..., ANGLES]

    def _one(self) -> "SteadyGlide":
        check_shape("a steady glide", self.found, ())
        return self

    @property
    def modes(self) -> tuple[Mode, ...]:
        """The modes, the least stable first; none of what was not found."""
        if not bool(self._one().found):
            return ()
        return modes_of(np.asarray(self.slopes), float(self.period), self.frozen)

    @property
    def uncertainty(self) -> Uncertainty | None:
        """Standard deviations that the coefficients leave; None where the polar has none.

        To first order, by exact derivatives along every independent deviation of the polar
        (see `AbstractPolar.spread`, `Polar.band_limited`). Computed when it is asked for.
        """
        return by_coefficients(*self._closed(), self.states[-1], self.slopes)

    @property
    def discretisation(self) -> Uncertainty:
        """How far the numbers are from those on twice as many Gauss nodes, by half the step.

        Found again from here when it is asked for.
        """
        return by_discretisation(*self._closed())

    def _closed(self) -> tuple[Reduced, Sought]:
        """The scaled state, and what it fulfils."""
        if not bool(self._one().found):
            raise ValueError(f"there is no steady glide: {self.why}")
        if self.averaged:
            raise ValueError("how sure it is, is known of the full model's glide alone")
        gait: Any = self.glider.gait
        mirrored = not self.frozen and float(gait.d_theta) == 0
        still = dataclasses.replace(self.glider, air=carried(self.glider.air))
        posed = Sought(still, self.phase, self.step, Kind(self.frozen, mirrored))
        return self.state / posed.scales(), posed

    def fly(self, cycles: int = 1, height: float = 0.0, **options) -> Trajectory:
        """Some cycles of it as a flight, to view and to plot; the wind carries it along.

        Args:
            cycles: how many, 1 to 10,000; of a frozen body, seconds.
            height: at its start [m].
            **options: as in `integrate`; by default `save="dense"`.
        """
        check_integer("cycles", cycles, 1, 10_000)
        check_range("height", height, "m", -1e5, 1e5, shape=())
        if not bool(self._one().found):
            raise ValueError(f"there is no steady glide to fly: {self.why}")
        start = self.states[0].at[2].set(height)
        if isinstance(self.glider.air, UniformWind):
            start = start.at[VELOCITY].add(self.glider.air.velocity)
        end = float(cycles * self.period)
        given = {"phase": self.phase, "save": "dense", **options}
        return integrate(self.glider, start, 0.0, end, **given)

    def report(self) -> Report:
        if self.found.ndim:
            found = np.asarray(self.found)
            stable = np.asarray(self.stable) & found
            rows = (("found", f"  {found.sum()}"), ("stable", f"  {stable.sum()}"))
            return Report(f"{found.size} steady glides", rows)
        if not bool(self.found):
            return Report(f"No steady glide: {self.why}", (("residual", _e(self.residual)),))
        return Report(_title(self), _rows(self), () if self.averaged else (_HOW_SURE,))


_HOW_SURE = "how sure: .uncertainty (coefficients) and .discretisation (nodes and steps)"


def _e(value) -> str:
    return f"{float(value):.1e}"


def _title(glide: SteadyGlide) -> str:
    angle, kind = math.degrees(glide.glide_angle), "stable" if glide.stable else "unstable"
    what = "frozen, " if glide.frozen else ""
    what = "averaged, " if glide.averaged else what
    return f"Steady glide, {what}{angle:.2f} deg below the horizontal: {kind}"


def _rows(glide: SteadyGlide) -> tuple[tuple[str, str], ...]:
    pitch, roll = np.rad2deg(np.asarray(glide.state[6:]))
    rows = [
        ("speed", f"{float(glide.speed):.3f} m/s, sinking {float(glide.sink_rate):.3f} m/s"),
        ("lift to drag", f"{float(glide.lift_to_drag):.3f}"),
        ("at its start", f"pitch {pitch:.2f}   roll {roll:.2f} deg"),
    ]
    if float(glide.turn_rate):
        side = "left" if float(glide.turn_rate) > 0 else "right"
        turning = abs(math.degrees(glide.turn_rate))
        text = f"{turning:.2f} deg/s to the {side}, radius {float(glide.turn_radius):.1f} m"
        rows.append(("turning", text))
    every = "a second" if glide.frozen else "a cycle"
    rows.append(("spectral radius", f"{float(glide.spectral_radius):.4f} {every}"))
    for mode in glide.modes:
        change = "doubles" if mode.doubling > 0 else "halves"
        text = f"|{abs(mode.multiplier):.4f}|   {change} in {abs(mode.doubling):.3f} s"
        if mode.frequency:
            text += f", {mode.frequency:.3f} Hz"
        leading = max(mode.shares, key=lambda name: mode.shares[name])
        text += f"   {mode.name or 'unnamed'}, most in {leading} ({mode.shares[leading]:.0%})"
        rows.append(("mode", text))
    rows.append(("residual", f"{_e(glide.residual)} after {int(glide.iterations)} iterations"))
    return tuple(rows)
