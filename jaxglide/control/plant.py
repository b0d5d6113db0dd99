"""A glider whose inputs are set anew at every sample: actuated, flown interval by interval."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from .._lib.checks import check_choice, check_kind, check_range, is_traced
from .._lib.fields import about, parameters_of
from .._lib.types import Array, Bool, Float, Integer, Scalar, State
from ..body.sections import discretise
from ..flight.dynamics import Flight, Glider, check_glider, six_degrees_of_freedom
from ..flight.ends import AbstractEnd, Outcome, clearance, outcome_codes
from ..flight.solve import end_finder
from ..shape.drives import LINEAR, AbstractLaw, Actuated, given_inputs
from ..shape.gait import Gait
from ..shape.motion import Driven
from ..shape.shapes import Serpenoid

INPUTS = ("theta_m", "psi_m", "nu_theta", "d_psi", "d_theta", "f_theta")
"""Inputs of the serpenoid waves, in their order."""
NATURAL_FREQUENCY = 25.0
"""Of the actuators by default [rad/s]; they follow to some 2.5 Hz."""
LATERAL = np.deg2rad(30.0)
"""Largest lateral bias by default [rad per SVL]; none has been measured."""
_PER_SECOND = 2.0  # how often an input can cross its range in a second, by default
_FREE = 1e3  # a limit of inputs that are not set, which they never come near
STEP = 1 / 120
"""Longest step of the solver by default [s]."""


class Held(AbstractLaw):
    """Inputs that stay as they are until others are set.

    Args:
        inputs: of the shape, (m,), or a `Gait`.
    """

    inputs: Float[Array, " m"] = eqx.field(converter=given_inputs, metadata=about("", "inputs"))

    def __call__(self, time, observation):
        return self.inputs


def measured_range(name: str) -> tuple[float, float]:
    """Range of an input: as observed in flight [rad, Hz or periods]; see `LATERAL`."""
    about = parameters_of(Gait)[name]
    if about.observed is None:
        return -LATERAL, LATERAL
    low, high = about.observed
    return low * about.factor, high * about.factor


def actuated(
    glider: Glider,
    inputs: Sequence[str] = ("d_psi", "d_theta"),
    *,
    natural_frequency: float = NATURAL_FREQUENCY,
    damping: float = 1.0,
    ranges: Mapping[str, tuple[float, float]] | None = None,
    rates: Mapping[str, float] | None = None,
) -> Glider:
    """The glider with actuators that hold its gait until they are told otherwise.

    Args:
        glider: with a `Gait`.
        inputs: which of `INPUTS` will be set; the others have no limits.
        natural_frequency: of the actuators [rad/s].
        damping: of the actuators.
        ranges: lowest and highest, by input [rad, Hz or periods]; by default as observed in
            flight.
        rates: largest rate by input [its unit/s]; by default its range twice a second.

    Raises:
        TypeError: the glider's motion is no `Gait`.
        ValueError: an unknown input, or the gait is out of the range.
    """
    gait = check_glider(glider).gait
    check_kind("gait", gait, Gait)
    for name in (*inputs, *(ranges or {}), *(rates or {})):
        check_choice("inputs", name, INPUTS)
    if not inputs or len(set(inputs)) < len(inputs):
        raise ValueError(
            f"inputs = {tuple(inputs)} is not allowed: name one or more, each once"
        )
    ranges, rates = dict(ranges or {}), dict(rates or {})
    low, high = np.full(len(INPUTS), -_FREE), np.full(len(INPUTS), _FREE)
    rate = np.full(len(INPUTS), _FREE)
    for name in inputs:
        k = INPUTS.index(name)
        low[k], high[k] = ranges[name] if name in ranges else measured_range(name)
        value = getattr(gait, name)
        if not is_traced(value) and not low[k] <= float(value) <= high[k]:
            unit = parameters_of(Gait)[name].unit
            factor = parameters_of(Gait)[name].factor
            raise ValueError(
                f"{name} = {float(value) / factor:g} {unit} is not allowed: the actuator goes "
                f"from {low[k] / factor:g} to {high[k] / factor:g}"
            )
        rate[k] = rates.get(name, _PER_SECOND * (high[k] - low[k]))
    drive = Actuated(
        Held(gait),
        gait,
        natural_frequency=natural_frequency,
        damping=damping,
        rate_limit=rate,
        low=low,
        high=high,
    )
    return dataclasses.replace(glider, gait=Driven(Serpenoid(), drive))


def limits(drive: Actuated, chosen: tuple[int, ...]) -> tuple[Array, Array]:
    """Lowest and highest that some inputs are told, (c,) each: there an actuator is linear."""
    assert drive.low is not None
    assert drive.high is not None
    index = np.array(chosen)
    middle, half = (drive.high + drive.low) / 2, LINEAR * (drive.high - drive.low) / 2
    return (middle - half)[index], (middle + half)[index]


class Flying(NamedTuple):
    """How far a flight is.

    Attributes:
        time: since launch [s].
        state: of the flight, (s,); of one that is over, at the start of its last step.
        inputs: held in its last step, (6,).
        length: of that step [s].
        over: whether it has ended.
    """

    time: Scalar
    state: State
    inputs: Float[Array, "6"]
    length: Scalar
    over: Bool[Array, ""]


class Ended(NamedTuple):
    """How a flight ended.

    Attributes:
        outcome: an `Outcome`, or the code of another end.
        time: [s].
        state: (s,).
    """

    outcome: Integer
    time: Scalar
    state: State


class Plant(eqx.Module):
    """What is controlled: an actuated glider, flown from sample to sample.

    By equal steps of Dopri5, so that a flight depends smoothly on its inputs; ends are located
    on the interpolant of the last step.

    Attributes:
        flight: glider, sections, launch phase.
        interval: between samples [s].
        ends: what ends a flight.
        steps: of the solver in an interval (static).
        late: share of an interval that passes before new inputs are told (static).
        backward: whether derivatives are taken backwards, or forwards (static).
    """

    flight: Flight
    interval: Scalar
    ends: tuple[AbstractEnd, ...]
    steps: int = eqx.field(static=True)
    late: float = eqx.field(static=True, default=0.0)
    backward: bool = eqx.field(static=True, default=False)

    @classmethod
    def of(
        cls,
        glider: Glider,
        phase,
        interval: float,
        ends: tuple[AbstractEnd, ...] = (),
        step: float = STEP,
        late: float = 0.0,
    ) -> "Plant":
        """A plant.

        Args:
            glider: actuated; see `actuated`.
            phase: of the waves at launch [rad].
            interval: between samples [s].
            ends: what ends a flight.
            step: longest step of the solver [s].
            late: share of an interval that passes before new inputs are told.

        Raises:
            TypeError: the glider is not actuated.
            ValueError: a number out of range.
        """
        drive = getattr(glider.gait, "drive", None)
        if not isinstance(drive, Actuated) or not isinstance(drive.law, Held):
            raise TypeError("the glider has no inputs to be set: see `actuated`")
        check_range("interval", interval, "s", 1e-3, 10, shape=())
        check_range("step", step, "s", 1e-5, 0.05, shape=())
        steps = int(np.ceil(float(interval) / step - 1e-9))
        flight = Flight(glider, discretise(glider.body), jnp.asarray(phase))
        return cls(flight, jnp.asarray(interval), ends, steps, float(late))

    @property
    def inputs(self) -> Float[Array, "6"]:
        """Inputs that the glider holds, (6,)."""
        return self.drive.law.inputs

    @property
    def drive(self) -> Any:
        """The drive of its glider."""
        gait: Any = self.flight.glider.gait
        return gait.drive

    def told(self, inputs: Float[Array, "6"]) -> Flight:
        """The flight with other inputs held."""
        glider = eqx.tree_at(lambda g: g.gait.drive.law.inputs, self.flight.glider, inputs)
        return self.flight._replace(glider=glider)

    def launched(self, state: State) -> Flying:
        """A flight at its start, from a state (s,)."""
        none = jnp.zeros_like(self.interval)
        beyond = jnp.zeros((), bool)
        if self.ends:
            beyond = jnp.min(clearance(self.ends, none, state)) <= 0
        return Flying(none, state, self.inputs, none, beyond)

    def advance(self, flying: Flying, inputs: Float[Array, "6"], share: float = 1.0) -> Flying:
        """Fly on for a share of an interval, with inputs held; what is over stays."""
        flight, count = self.told(inputs), max(1, int(np.ceil(share * self.steps - 1e-9)))
        t0, length = flying.time, share * self.interval / count
        solver = _BACKWARD if self.backward else _SOLVER
        inside = solver.init(_TERM, t0, t0 + length, flying.state, flight)

        def one(carry, k):
            now, inside = carry
            t = t0 + k * length
            moved: Any = solver.step(_TERM, t, t + length, now.state, flight, inside, False)
            ended = now.over | ~jnp.all(jnp.isfinite(moved[0]))
            if self.ends:
                ended |= jnp.min(clearance(self.ends, t + length, moved[0])) <= 0
            later = Flying(t + length, moved[0], inputs, length, now.over)
            here = now._replace(
                inputs=jnp.where(now.over, now.inputs, inputs),
                length=jnp.where(now.over, now.length, length),
            )
            chosen = jax.tree.map(lambda old, new: jnp.where(ended, old, new), here, later)
            return (chosen._replace(over=ended), moved[3]), None

        return jax.lax.scan(one, (flying, inside), jnp.arange(count))[0][0]

    def after_delay(self, flying: Flying, before, inputs) -> Flying:
        """Fly on for an interval, with the inputs told before until the new ones arrive."""
        if self.late:
            flying = self.advance(flying, before, self.late)
        return self.advance(flying, inputs, 1 - self.late)

    def finish(self, flying: Flying) -> Ended:
        """How a flight ended: where on its last step, or that it ran out of time."""
        flight, t0, over = self.told(flying.inputs), flying.time, flying.over
        length = jnp.where(over, flying.length, self.interval / self.steps)
        inside = _SOLVER.init(_TERM, t0, t0 + length, flying.state, flight)
        last: Any = _SOLVER.step(_TERM, t0, t0 + length, flying.state, flight, inside, False)
        broken = over & ~jnp.all(jnp.isfinite(last[0]))
        outcome = jnp.asarray(int(Outcome.OUT_OF_TIME))
        time, state = t0, flying.state
        if self.ends:
            path = _SOLVER.interpolation_cls(t0=t0, t1=t0 + length, **last[2])

            def left(t, _):
                least = jnp.min(clearance(self.ends, t, path.evaluate(t)))
                return jnp.where(over & ~broken, least, t0 + length - t)

            found = optx.root_find(
                left,
                end_finder(state.dtype),
                t0 + length,
                options={"lower": t0, "upper": t0 + length},
                throw=False,
            ).value
            time = jnp.where(over, found, time)
            state = jnp.where(over, path.evaluate(found), state)
            nearest = jnp.argmin(clearance(self.ends, time, state))
            codes = jnp.asarray(outcome_codes(self.ends))
            outcome = jnp.where(over, codes[nearest], outcome)
        outcome = jnp.where(broken, Outcome.NON_FINITE, outcome).astype(jnp.int32)
        return Ended(outcome, time, state)


_SOLVER, _BACKWARD = diffrax.Dopri5(scan_kind="lax"), diffrax.Dopri5()
_TERM: Any = diffrax.ODETerm(six_degrees_of_freedom)  # type: ignore[arg-type]
