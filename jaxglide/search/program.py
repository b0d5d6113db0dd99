"""Open loop: inputs of the waves as splines with n knots, made to fly well."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_choice, check_integer, check_kind, check_range
from .._lib.fields import parameters_of
from .._lib.report import Report, Reported
from ..control.environment import Environment
from ..control.plant import INPUTS, actuated, limits
from ..control.sampled import SampledPath, controlled_state
from ..flight.case import Case
from ..flight.dynamics import Glider
from ..flight.glide import simulate
from ..flight.integrate import integrate
from ..shape.drives import Planned, Programme, Repeated
from ..shape.gait import Gait
from ..steady import steady_glide
from .objective import Constraint, Objective
from .objectives import landing_distance
from .optimum import optimise
from .problem import Problem
from .shooting import Joined, lasting, level_of, shoot

_LAW = "gait.drive.law"
_TABLE = {"time": f"{_LAW}.programme.inputs", "phase": f"{_LAW}.inputs"}
_SPREAD = 0.1  # of half the range: how far a start's knots lie from the gait
_COARSE = 6  # knots of a start's deviation: white noise would cancel itself


class ProgramSpace(eqx.Module):
    """Which knots there are, and where their values stand in a case.

    Attributes:
        case: with a glider whose actuators follow a programme: the gait, at all knots.
        held: the glider without.
        inputs: names of those that are set (static).
        knots: times [s] or parts of a cycle, (K,) (static).
        over: "time" or "phase" (static).
    """

    case: Case
    held: Glider
    inputs: tuple[str, ...] = eqx.field(static=True)
    knots: tuple[float, ...] = eqx.field(static=True)
    over: str = eqx.field(static=True)

    @classmethod
    def of(
        cls,
        case: Case,
        inputs: Sequence[str],
        knots: int,
        until: float | None,
        over: str,
        actuators: Mapping[str, Any] | None,
    ) -> "ProgramSpace":
        """A programme of K knots; arguments as in `optimise_program`."""
        check_kind("case", case, Case)
        check_choice("over", over, tuple(_TABLE))
        check_integer("knots", knots, 3, 200)
        gait: Any = case.glider.gait
        glider = actuated(case.glider, inputs, **dict(actuators or {}))
        if over == "phase":
            if "f_theta" in inputs:
                raise ValueError("f_theta sets the phase: it cannot follow a programme over it")
            check_range("f_theta", gait.f_theta, "Hz", 0, 100, low_open=True)
            if until is not None:
                raise ValueError("until is a time: a programme over the phase repeats itself")
            places = tuple(k / knots for k in range(knots))
            law: Any = Repeated([gait] * knots, gait.f_theta)
        else:
            if until is None:
                until = _lasts(case)
            check_range("until", until, "s", 0, 1e3, low_open=True, shape=())
            places = tuple(np.linspace(0.0, float(until), knots).tolist())
            law = Planned(Programme(places, [gait] * knots))
        glider = eqx.tree_at(lambda g: g.gait.drive.law, glider, law)
        moved = Case(glider, case.launch, case.ends)
        return cls(moved, case.glider, tuple(inputs), places, over)

    @property
    def names(self) -> list[str]:
        """Names of the knots' values in the case, knot by knot, (K c)."""
        index = [INPUTS.index(name) for name in self.inputs]
        table = _TABLE[self.over]
        return [f"{table}[{k},{j}]" for k in range(len(self.knots)) for j in index]

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Of every value, by its name: within which an actuator is linear."""
        index = tuple(INPUTS.index(name) for name in self.inputs)
        drive: Any = self.case.glider.gait.drive  # type: ignore[attr-defined]
        low, high = map(np.asarray, limits(drive, index))
        ends = [(float(a), float(b)) for a, b in zip(low, high, strict=True)]
        return dict(zip(self.names, ends * len(self.knots), strict=True))

    def guesses(self, count: int, seed: int) -> list[dict[str, float]]:
        """The gait itself, and deviations from it that are smooth from knot to knot."""
        rng, bounds = np.random.default_rng(seed), self.bounds
        low, high = np.array(list(bounds.values())).T
        index = [INPUTS.index(name) for name in self.inputs]
        drive: Any = self.case.glider.gait.drive  # type: ignore[attr-defined]
        middle = np.tile(np.asarray(drive.initial)[index], len(self.knots))
        found, places = [], np.linspace(0, _COARSE - 1, len(self.knots))
        for k in range(count):
            coarse = rng.normal(size=(_COARSE, len(index))) * bool(k)
            fine = [np.interp(places, np.arange(_COARSE), column) for column in coarse.T]
            away = _SPREAD * (high - low) / 2 * np.stack(fine, axis=1).ravel()
            point = np.clip(middle + away, low, high)
            found.append(dict(zip(bounds, point.tolist(), strict=True)))
        return found


def _lasts(case: Case) -> float:
    """How long a programme is by default [s]: as a glide without one that lands, or else about
    as one that has become steady."""
    alone, level = simulate(case.glider, case.launch, ends=case.ends), level_of(case)
    if not bool(alone.stable) and level is not None:
        glide = steady_glide(case.glider, phase=float(alone.take_off.phi_theta))
        if bool(glide.found):
            return lasting(alone.take_off, glide, level)
    return float(alone.time)


@dataclass(frozen=True)
class ProgramOptimum(Reported):
    """A programme that flies well.

    Attributes:
        glider: with it; `simulate` flies it.
        inputs: names of those that are set.
        knots: times [s] or parts of a cycle, (K,).
        over: "time" or "phase".
        values: at the knots, in the units that people read, (K, c).
        value: of the objective.
        objective: what was wanted.
        optimum: the search, or what the multiple shooting says of itself.
    """

    glider: Glider
    inputs: tuple[str, ...]
    knots: np.ndarray
    over: str
    values: np.ndarray
    value: float
    objective: Objective
    optimum: Any

    def path(self, environment: Environment) -> SampledPath:
        """The flight at an environment's samples, for a feedback that keeps to it.

        `linear_quadratic(environment, along=found.path(environment))` flies it so. It goes on
        beyond the landing to the end of a cycle.

        Args:
            environment: of the same case and inputs.

        Raises:
            TypeError: it is no environment.
            ValueError: it sets other inputs.
        """
        check_kind("environment", environment, Environment)
        own = tuple(INPUTS.index(name) for name in self.inputs)
        if environment.chosen != own:
            sets = ", ".join(INPUTS[k] for k in environment.chosen)
            raise ValueError(
                f"environment sets {sets}: the programme is of {', '.join(self.inputs)}"
            )
        plant, launch = environment.plant, environment.case.launch
        joined = self.optimum if isinstance(self.optimum, Joined) else None
        if joined is None:
            glide = simulate(self.glider, launch, ends=environment.case.ends)
            duration, starts = float(glide.time), [(0.0, glide.take_off.state)]
        else:
            duration = joined.duration
            starts = list(zip(joined.times, joined.states, strict=True))
        interval, gait = float(plant.interval), environment.held.gait
        cycle = round(1 / (interval * float(gait.f_theta)))  # type: ignore[attr-defined]
        count = cycle * int(np.ceil(duration / interval / cycle))
        times = interval * np.arange(count + 1)
        ends = [time for time, _ in starts[1:]] + [float(times[-1])]
        phase, states = float(plant.flight.phase), []
        for (t0, state), t1 in zip(starts, ends, strict=True):
            piece = integrate(
                self.glider, state, float(t0), float(t1), phase=phase, save="dense"
            )
            last = t1 == times[-1]
            inside = (times >= t0) & ((times <= t1) if last else (times < t1))
            states.append(np.asarray(piece.at(np.clip(times, t0, t1)))[inside])
        drive: Any = self.glider.gait.drive  # type: ignore[attr-defined]
        middles = jnp.asarray(times[:-1] + interval / 2)
        wanted = jax.vmap(lambda time: drive.law(time, None))(middles)[:, np.array(own)]
        told = jnp.clip(wanted, *limits(drive, own))
        before = jnp.concatenate([plant.inputs[None, np.array(own)], told])
        controlled = jax.vmap(lambda state, told: controlled_state(state, told, own))
        return SampledPath(controlled(jnp.asarray(np.concatenate(states)), before), told)

    def report(self) -> Report:
        units = [parameters_of(Gait)[name].unit for name in self.inputs]
        rows = []
        for name, unit, column in zip(self.inputs, units, self.values.T, strict=True):
            rows.append((name, f"{column.min():.4g} to {column.max():.4g} {unit}"))
        where = "s" if self.over == "time" else "of a cycle"
        rows.append(
            ("knots", f"{len(self.knots)}, {self.knots[0]:g} to {self.knots[-1]:.4g} {where}")
        )
        title = f"{self.objective.name} {self.value:.6g} {self.objective.unit}".rstrip()
        return Report(title, tuple(rows), (self.optimum.reason,))


def optimise_program(
    case: Case,
    inputs: Sequence[str] = ("d_psi",),
    knots: int = 10,
    *,
    objective: Objective = landing_distance,
    constraints: Sequence[Constraint] = (),
    until: float | None = None,
    over: str = "time",
    actuators: Mapping[str, Any] | None = None,
    shooting: str = "single",
    pieces: int | None = None,
    starts: int = 8,
    steps: int = 100,
    seed: int = 0,
    **options,
) -> ProgramOptimum:
    """Make the inputs of the waves, as splines with knots, fly as well as they can.

    Single shooting: whole flights from the launch, `optimise` with the values at the knots as
    parameters; with many of them the gradient goes backwards. Multiple shooting: the flight in
    pieces that an optimiser joins, one start, from the launch into the steady glide; for long
    flights, whose derivatives grow beyond use. Such a programme is a flight, but a small
    error grows on it too: fly it under feedback (see `ProgramOptimum.path`). Limits of range
    and rate are those of the actuators, which never pass them.

    Args:
        case: glider with a `Gait`, launch and ends.
        inputs: which of theta_m, psi_m, nu_theta, d_psi, d_theta, f_theta are set.
        knots: of each, 3 to 200, evenly spaced.
        objective: what is wanted (see `Objective.sense`).
        constraints: inequalities to meet, as `stability_margin.at_least(10)`.
        until: time of the last knot [s]; by default the duration of the glide without a
            programme, or about that of a steady one where it does not land.
        over: "time" since launch, or "phase": the knots of one cycle, repeated.
        actuators: further arguments of `actuated`: natural_frequency, damping, ranges, rates.
        shooting: "single" or "multiple".
        pieces: of multiple shooting, 2 to 200; by default none lasts longer than 0.4 s.
        starts: of single shooting: the gait itself, and deviations from it, drawn.
        steps: most of them.
        seed: of the deviations.
        **options: of single shooting: further arguments of `optimise`, as optimiser, rate,
            log, progress.

    Raises:
        TypeError: a part is of another type.
        ValueError: an unknown name, or a number out of range.

    Examples:
        >>> from jaxglide import Case, Gait, Glider, Launch, Polar, Snake, optimise_program
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> case = Case(Glider(body, Gait.from_degrees(), Polar.smooth()), Launch(height=2.0))
        >>> found = optimise_program(case, knots=3, starts=1, steps=4, progress=False)
        >>> found.values.shape
        (3, 1)
    """
    program = ProgramSpace.of(case, inputs, knots, until, over, actuators)
    check_choice("shooting", shooting, ("single", "multiple"))
    check_integer("starts", starts, 1, 100_000)
    check_integer("steps", steps, 1, 1_000_000)
    if shooting == "multiple":
        if pieces is not None:
            check_integer("pieces", pieces, 2, 200)
        if options:
            raise ValueError(f"{', '.join(options)}: multiple shooting has no such option")
        return _flown_by(
            program, objective, *shoot(program, objective, constraints, pieces, steps)
        )
    problem = Problem(objective.wanted, program.bounds, tuple(constraints), case=program.case)
    guesses = program.guesses(starts, seed)
    told = {"screen": 0, "polish": 0, "seed": seed, **options}
    found = optimise(problem, starts=starts, guesses=guesses, steps=steps, **told)
    return _flown_by(program, objective, found.best, found.value, found)


def _flown_by(
    program: ProgramSpace, objective: Objective, best, value: float, found
) -> ProgramOptimum:
    """A programme with the values found, by name."""
    factors = [parameters_of(Gait)[name].factor for name in program.inputs]
    table = np.array([best[name] for name in program.names])
    table = table.reshape(len(program.knots), -1) / factors
    return ProgramOptimum(
        program.case.replace(best).glider,
        program.inputs,
        np.array(program.knots),
        program.over,
        table,
        value if objective.sense > 0 else -value,
        objective,
        found,
    )
