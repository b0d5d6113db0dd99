"""Drives: what the coordinates of a shape do in time.

All of them set inputs u, (m,): the coordinates of the shape, but for the phase of a shape
with a cycle, instead of which the last is the undulation frequency f [Hz]; the phase is the
launch phase less 2 pi times the integral of f.
"""

import abc
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import is_traced, result_of
from .._lib.fields import Part, about, floats
from .._lib.types import Array, Float, Scalar
from .gait import Gait
from .motion import AbstractDrive, Coordinates, Observation, at_rest
from .shapes import as_module
from .splines import check_knots, knots_of, spline

_GAIT = ("theta_m", "psi_m", "nu_theta", "d_psi", "d_theta", "f_theta")
LINEAR = 0.9
"""Share of a limit up to which an actuator is linear."""


def inputs_of(gait: Gait) -> Float[Array, "6"]:
    """The gait as inputs of the serpenoid waves: theta_m, psi_m, nu_theta, d_psi, d_theta
    and f_theta, (6,)."""
    return jnp.stack([getattr(gait, name) for name in _GAIT])


def given_inputs(values: Any) -> Any:
    """Converter of a field: inputs of a gait, or as they are; several one below the other."""
    if isinstance(values, Gait):
        return inputs_of(values)
    if (
        isinstance(values, list | tuple)
        and values
        and all(isinstance(one, Gait) for one in values)
    ):
        return jnp.stack([given_inputs(one) for one in values])
    return floats(values)


def _coordinates(u, du, ddu, turns, phase, cyclic: bool) -> Coordinates:
    """Coordinates from inputs, and the integral of the last one in turns."""
    if not cyclic:
        return Coordinates(u, du, ddu)
    q, dq, ddq = (
        jnp.concatenate([rest[:-1], -2 * jnp.pi * last[None]])
        for rest, last in ((u, turns), (du, u[-1]), (ddu, du[-1]))
    )
    return Coordinates(q.at[-1].add(phase), dq, ddq)


class Running(AbstractDrive):
    """Inputs that stay as they are: a gait at its constant rate.

    Args:
        inputs: of the shape, (m,), or a `Gait` for the serpenoid waves.
        cyclic: whether the last is a frequency [Hz] whose phase runs (static).
    """

    inputs: Float[Array, " m"] = eqx.field(converter=given_inputs, metadata=about("", "inputs"))
    cyclic: bool = eqx.field(static=True, default=True)

    def __call__(self, time, phase, states, observation):
        none = jnp.zeros_like(self.inputs)
        turns = self.inputs[-1] * time
        return _coordinates(self.inputs, none, none, turns, phase, self.cyclic), states


class Programme(AbstractDrive):
    """Inputs that follow cubic splines in time, held before the first and after the last knot.

    Smooth to the second derivative between; the slope is zero at both ends.

    Args:
        times: of the knots since launch [s], rising, (K,), K at least 2 (static).
        inputs: at the knots, (K, m), or K gaits.
        cyclic: as in `Running`.

    Raises:
        TypeError: a value is not a number.
        ValueError: times that do not rise, or not as many inputs.
    """

    times: tuple[float, ...] = eqx.field(static=True, converter=knots_of("times"))
    inputs: Float[Array, "K m"] = eqx.field(
        converter=given_inputs, metadata=about("", "inputs at the knots")
    )
    cyclic: bool = eqx.field(static=True, default=True)

    def _check(self):
        check_knots("times", self.times, "s")
        if self.inputs.shape[0] != len(self.times):
            raise ValueError(
                f"inputs has {self.inputs.shape[0]} rows: times has {len(self.times)}"
            )

    def at(self, time: Scalar) -> Float[Array, " m"]:
        """Inputs at a time [s], (m,)."""
        return spline(self.times, self.inputs, time).value

    def __call__(self, time, phase, states, observation):
        now = spline(self.times, self.inputs, time)
        turns = now.integral - spline(self.times, self.inputs, jnp.zeros_like(time)).integral
        parts = now.value, now.rate, now.second
        return _coordinates(*parts, turns[-1], phase, self.cyclic), states


class AbstractLaw(Part):
    """What actuators are told, from time and flight: the seam for a controller."""

    @abc.abstractmethod
    def __call__(self, time: Scalar, observation: Observation) -> Float[Array, " m"]:
        """Inputs wanted, (m,). Everything may be traced."""


class Planned(AbstractLaw):
    """The inputs of a programme, whatever the flight does.

    Args:
        programme: see `Programme`.
    """

    programme: Programme

    def __call__(self, time, observation):
        return self.programme.at(time)


class Repeated(AbstractLaw):
    """Inputs that repeat themselves every cycle: a periodic cubic spline in its phase.

    Args:
        inputs: at K equal parts of a cycle, the first at its start, (K, m), or K gaits, K at
            least 2.
        frequency: of the cycle [Hz], above 0.

    Raises:
        ValueError: fewer inputs, or a frequency that is not above 0.
    """

    inputs: Float[Array, "K m"] = eqx.field(
        converter=given_inputs, metadata=about("", "inputs at the parts of a cycle")
    )
    frequency: Scalar = eqx.field(
        converter=floats, metadata=about("Hz", "of the cycle", low=0, high=100, low_open=True)
    )

    def _check(self):
        if self.inputs.ndim != 2 or len(self.inputs) < 2:
            raise ValueError(f"inputs has shape {self.inputs.shape}: it must be (K, m), K >= 2")

    def __call__(self, time, observation):
        count = self.inputs.shape[0]
        turned = jnp.mod(self.frequency * time, 1.0)
        parts = tuple(k / count for k in range(count + 1))
        return spline(parts, self.inputs, turned, "periodic").value


class AttitudeLaw(AbstractLaw):
    """Inputs that answer to attitude and turning, proportionally.

    Wanted are `inputs + gain (angles - observed angles) - rate_gain omega`.

    Args:
        inputs: at the wanted attitude without turning, (m,), or a `Gait`.
        gain: by yaw, pitch and roll [1/rad], (m, 3).
        rate_gain: by the angular velocity in body axes x, y, z [s], (m, 3); by default none.
        angles: wanted yaw, pitch, roll [rad], (3,); by default level and forward.

    Raises:
        ValueError: a value is not finite or of the wrong shape.
    """

    inputs: Float[Array, " m"] = eqx.field(converter=given_inputs, metadata=about("", "inputs"))
    gain: Float[Array, "m 3"] = eqx.field(
        converter=floats, metadata=about("1/rad", "gain by angles")
    )
    rate_gain: Float[Array, "m 3"] | None = eqx.field(
        converter=floats, default=None, metadata=about("s", "gain by turning")
    )
    angles: Float[Array, "3"] = eqx.field(
        converter=floats, default=(0.0, 0.0, 0.0), metadata=about("rad", "wanted attitude")
    )

    def __call__(self, time, observation):
        wanted = self.inputs + self.gain @ (self.angles - observation.angles)
        if self.rate_gain is None:
            return wanted
        return wanted - self.rate_gain @ observation.omega


class Stepped(AbstractLaw):
    """Inputs that stay as they are from one time to the next, whatever the flight does.

    Args:
        times: from which on the inputs are told, since launch [s], rising, (K,); the first
            are told before it too.
        inputs: told then, (K, m), or K gaits.

    Raises:
        ValueError: times that do not rise, or not as many inputs.
    """

    times: Float[Array, " K"] = eqx.field(
        converter=floats, metadata=about("s", "times of new inputs")
    )
    inputs: Float[Array, "K m"] = eqx.field(
        converter=given_inputs, metadata=about("", "inputs told")
    )

    def _check(self):
        if self.inputs.shape[:1] != self.times.shape:
            raise ValueError(f"inputs has shape {self.inputs.shape}: times {self.times.shape}")
        if not is_traced(self.times) and np.any(np.diff(self.times) <= 0):
            raise ValueError("times must increase")

    def __call__(self, time, observation):
        told = jnp.searchsorted(self.times, time, side="right") - 1
        return self.inputs[jnp.maximum(told, 0)]


class Actuated(AbstractDrive):
    """Actuators of second order that follow a law, with limits of rate and range.

    u'' = w^2 (wanted - u) - 2 z w u' for each input. Up to nine tenths of a limit that holds
    exactly; beyond, rate and range bend over smoothly and never pass it. The own states are
    positions and rates before the limits, and the turns of the phase.

    Args:
        law: what is wanted, (m,), of time and `Observation`: an `AbstractLaw`, or a pure
            function.
        initial: inputs at launch, (m,), or a `Gait`.
        natural_frequency: w [rad/s], above 0, one number.
        damping: z, 0 or more, one number.
        rate_limit: largest rate of each input [its unit/s], above 0, (m,); by default none.
        low, high: range of each input, (m,); by default none.
        cyclic: as in `Running`.

    Raises:
        TypeError: a value is not a number, or the law is no function.
        ValueError: a value is not allowed, or the law gives another number of inputs.

    Examples:
        >>> import jax.numpy as jnp
        >>> from jaxglide import Actuated, Driven, Gait, Serpenoid
        >>> Serpenoid().coordinates  # inputs, of which the last is the rate of the phase [Hz]
        ('theta_m', 'psi_m', 'nu_theta', 'd_psi', 'd_theta', 'phase')
        >>> def bend_after_a_second(time, observation):
        ...     d_psi = jnp.where(time < 1.0, 0.0, 0.2)
        ...     return jnp.stack([1.7, 0.35, 1.4, d_psi, 0.0, 1.2])
        ...
        >>> drive = Actuated(bend_after_a_second, Gait.from_degrees(), natural_frequency=25.0)
        >>> motion = Driven(Serpenoid(), drive)
        >>> print(motion.drive.natural_frequency)
        25.0
    """

    law: Callable[..., Any] = eqx.field(converter=as_module)
    initial: Float[Array, " m"] = eqx.field(
        converter=given_inputs, metadata=about("", "inputs at launch")
    )
    natural_frequency: Scalar = eqx.field(
        converter=floats,
        metadata=about(
            "rad/s", "natural frequency of the actuators", low=0, high=1e4, low_open=True
        ),
    )
    damping: Scalar = eqx.field(
        converter=floats,
        default=1.0,
        metadata=about("", "damping of the actuators", low=0, high=100),
    )
    rate_limit: Float[Array, " m"] | None = eqx.field(
        converter=floats,
        default=None,
        metadata=about("1/s", "largest rate", low=0, low_open=True),
    )
    low: Float[Array, " m"] | None = eqx.field(
        converter=floats, default=None, metadata=about("", "lowest inputs")
    )
    high: Float[Array, " m"] | None = eqx.field(
        converter=floats, default=None, metadata=about("", "highest inputs")
    )
    cyclic: bool = eqx.field(static=True, default=True)

    def _check(self):
        count = self.initial.shape[0]
        for name in ("rate_limit", "low", "high"):
            value = getattr(self, name)
            if value is not None and value.shape != (count,):
                raise ValueError(f"{name} has shape {value.shape}: it must be ({count},)")
        if (self.low is None) != (self.high is None):
            raise ValueError("low and high: give both or neither")
        if not callable(self.law):
            raise TypeError(f"law = {self.law!r} is not a function")
        wanted = result_of("law", self.law, jnp.zeros(()), at_rest())
        shape = getattr(wanted, "shape", None)
        if shape != (count,):
            raise ValueError(f"law gives inputs of shape {shape}: initial has ({count},)")
        self._check_range()

    def _check_range(self):
        if self.low is None or any(map(is_traced, (self.low, self.high, self.initial))):
            return
        low, high, initial = map(np.asarray, (self.low, self.high, self.initial))
        for k in range(len(initial)):
            if not low[k] < high[k]:
                raise ValueError(f"low = {low[k]:g} is not below high = {high[k]:g}, input {k}")
            if not low[k] <= initial[k] <= high[k]:
                raise ValueError(
                    f"initial = {initial[k]:g} is not allowed: input {k} must be in "
                    f"[{low[k]:g}, {high[k]:g}]"
                )

    def start(self, phase):
        none = jnp.zeros_like(self.initial)
        return jnp.concatenate([self.initial, none, none[: int(self.cyclic)]])

    def __call__(self, time, phase, states, observation):
        m = self.initial.shape[0]
        x, v = states[:m], states[m : 2 * m]
        w, z = self.natural_frequency, self.damping
        push = w**2 * (self.law(time, observation) - x) - 2 * z * w * v
        rate, by_v, _ = (v, 1.0, 0.0) if self.rate_limit is None else soft(v, self.rate_limit)
        u, by_x, curved = x, 1.0, 0.0
        if self.low is not None and self.high is not None:
            middle, half = (self.high + self.low) / 2, (self.high - self.low) / 2
            u, by_x, curved = soft(x - middle, half)
            u = u + middle
        du, ddu = by_x * rate, curved * rate**2 + by_x * by_v * push
        rates = [rate, push] + [u[-1:]] * self.cyclic
        turns = states[-1]
        return _coordinates(u, du, ddu, turns, phase, self.cyclic), jnp.concatenate(rates)


def soft(x, limit):
    """x as it is up to nine tenths of a limit, bending over beyond: never past it.

    Returns:
        The value and its first two derivatives; the second is continuous.
    """
    width = (1 - LINEAR) * limit
    over = jnp.maximum(jnp.abs(x) - LINEAR * limit, 0.0) / width
    bent, side = jnp.tanh(over), jnp.sign(x)
    value = jnp.where(over > 0, side * (LINEAR * limit + width * bent), x)
    slope = 1 - bent**2
    return value, slope, -2 * side * bent * slope / width
