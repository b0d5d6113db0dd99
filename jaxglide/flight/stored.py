"""A flight whose derivative is taken backwards, through the stages of the steps it took.

The stages are kept as the flight is flown, up to so many steps. So the way back computes
nothing twice: at every stage the vector field and its pullback, once. A longer flight is flown
in parts, each once more on the way back but for the last.

The step sizes are those of the flight and do not vary, as in Diffrax's controllers.
"""

import dataclasses
from typing import Any

import diffrax
import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp

from .._lib.types import Array, Float, Int, Scalar, State
from .dynamics import ANGLES
from .lane import Lane, Pilot
from .peaks import Peaks, step_peaks
from .solve import Posed, Settings, Solved

_KEPT = 512  # steps; a kilobyte each


class _Steps(eqx.Module):
    """Accepted steps of a part of a flight.

    Attributes:
        before, upto: start and end [s], (K,).
        y: state at the start, (K, s).
        k: stages, increments of the state, (K, S, s).
        count: how many there are.
    """

    before: Float[Array, " K"]
    upto: Float[Array, " K"]
    y: Float[Array, "K s"]
    k: Float[Array, "K S s"]
    count: Int[Array, ""]

    @classmethod
    def none(cls, room: int, lane: Lane) -> "_Steps":
        times, k = jnp.zeros(room, lane.tprev.dtype), lane.info["k"]
        return cls(
            times,
            times,
            jnp.zeros((room, *lane.y.shape), lane.y.dtype),
            jnp.zeros((room, *k.shape), k.dtype),
            jnp.zeros((), jnp.int32),
        )

    def noted(self, kept, lane: Lane) -> "_Steps":
        """With the latest step of a lane, if it was kept."""
        place = jnp.where(kept, self.count, len(self.before))
        new = lane.before, lane.upto, lane.info["y0"], lane.info["k"]
        old = self.before, self.upto, self.y, self.k
        pairs = zip(old, new, strict=True)
        times, upto, y, k = (a.at[place].set(x, mode="drop") for a, x in pairs)
        return _Steps(times, upto, y, k, self.count + kept)


class _Flown(eqx.Module):
    """A lane, and which step holds the largest of each angle before the latest one.

    Attributes:
        lane: the lane.
        highest: number of that step, -1 for the start, (3,).
    """

    lane: Lane
    highest: Int[Array, " 3"]

    @classmethod
    def start(cls, pilot: Pilot, posed: Posed, args) -> "_Flown":
        return cls(pilot.start(posed, args), jnp.full(3, -1, jnp.int32))

    def advanced(self, pilot: Pilot, posed: Posed, args) -> "_Flown":
        lane, highest = self.lane, self.highest
        if posed.turns:
            peaks: Peaks = lane.control[1]
            higher = (peaks.latest > peaks.largest) & (lane.accepted > 0)
            highest = jnp.where(higher, lane.accepted - 1, highest)
        return _Flown(pilot.advance(posed, args, lane), highest)


def _while(going, body, carry):
    """A loop whose body leaves alone what goes on no longer: a batch copies no buffers."""
    return jax.lax.while_loop(lambda c: eqxi.unvmap_any(going(c)), body, carry)


def _choose(condition, new, old):
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)


def _part(pilot: Pilot, posed: Posed, args, flown: _Flown, wanted, room: int):
    """Fly one part, if it is wanted, and keep its steps."""

    def going(carry):
        flown, steps = carry
        return wanted & ~pilot.over(posed, flown.lane) & (steps.count < room)

    def body(carry):
        flown, steps = carry
        go, new = going(carry), flown.advanced(pilot, posed, args)
        kept = go & (new.lane.accepted > flown.lane.accepted)
        return _choose(go, new, flown), steps.noted(kept, new.lane)

    return _while(going, body, (flown, _Steps.none(room, flown.lane)))


def _room(posed: Posed) -> tuple[int, int]:
    """Steps of a part, and parts."""
    most = posed.settings.max_steps
    return min(_KEPT, most), -(-most // _KEPT)


def _forward(pilot: Pilot, posed: Posed, args):
    """The flight at its end, the steps of its last part, and the starts of all parts."""
    room, parts = _room(posed)
    flown = _Flown.start(pilot, posed, args)
    starts = jax.tree.map(lambda x: jnp.zeros((parts, *x.shape), x.dtype), flown)

    def going(carry):
        return ~pilot.over(posed, carry[0].lane)

    def body(carry):
        flown, steps, starts, part = carry
        go = going(carry)
        place = jnp.where(go, part, parts)
        starts = jax.tree.map(lambda a, x: a.at[place].set(x, mode="drop"), starts, flown)
        new, found = _part(pilot, posed, args, flown, go, room)
        return new, _choose(go, found, steps), starts, part + go

    none = _Steps.none(room, flown.lane), starts, jnp.zeros((), jnp.int32)
    return _while(going, body, (flown, *none))


def _tableau(solver):
    """Coefficients of the stages (S, S), weights and places (S,)."""
    tableau, rows = solver.tableau, []
    count = len(tableau.b_sol)
    for row in [(), *tableau.a_lower]:
        rows.append(jnp.concatenate([jnp.asarray(row, float), jnp.zeros(count - len(row))]))
    places = jnp.concatenate([jnp.zeros(1), jnp.asarray(tableau.c, float)])
    return jnp.stack(rows), jnp.asarray(tableau.b_sol, float), places


class _Back(eqx.Module):
    """Cotangents on the way back.

    Attributes:
        y: of the state that is reached, (s,).
        k: of the stages of the step that leads there, which its interpolation reads, (S, s).
        before: of the state at that step's start, which its interpolation and peaks read.
        args: of the arguments.
        time: of the start of the flight, which moves all steps [1/s].
        last: of the end of its last step [1/s].
    """

    y: State
    k: Float[Array, "S s"]
    before: State
    args: Any
    time: Scalar
    last: Scalar

    def moved(self, first, start, end) -> "_Back":
        """With cotangents of a step's start and end [1/s]."""
        time = self.time + start + jnp.where(first, 0.0, end)
        last = self.last + jnp.where(first, end, 0.0)
        return dataclasses.replace(self, time=time, last=last)


def _step_back(pilot: Pilot, posed: Posed, args, moved, step, active, first, back: _Back):
    """Cotangents where a step starts.

    Args:
        moved: which of the arguments are differentiated.
        step: its start and end [s], the state at its start and its stages.
        active: whether there is one.
        first: whether it is the first on the way back.
        back: cotangents at its end.
    """
    t0, t1, y0, k = step
    solver: Any = posed.settings.solver
    a, weights, places = (x.astype(y0.dtype) for x in _tableau(solver))
    h, count, zero = t1 - t0, len(weights), jnp.zeros_like(t0)
    dynamic, static = eqx.partition(args, moved)

    def stage(j, carry):
        pulled, found, start, end = carry
        i = count - 1 - j
        force = jnp.where(active, back.k[i] + weights[i] * back.y + a[:, i] @ pulled, 0.0)
        _, pull = jax.vjp(
            lambda t, y, d: pilot.field(t, y, eqx.combine(d, static)),
            t0 + places[i] * h,
            y0 + a[i] @ k,
            dynamic,
        )
        dt, dy, da = pull(h * force)
        # a stage is h times the rate
        grown = jnp.where(active, jnp.sum(k[i] * force) / jnp.where(active, h, 1.0), 0.0)
        start, end = start + (1 - places[i]) * dt - grown, end + places[i] * dt + grown
        return pulled.at[i].set(dy), jax.tree.map(jnp.add, found, da), start, end

    # A last stage that is the next step's first is read by interpolation only.
    idle = jnp.where(first, 0, 1) if solver.tableau.fsal else 0
    carry = jnp.zeros_like(k), back.args, zero, zero
    pulled, found, start, end = jax.lax.fori_loop(idle, count, stage, carry)
    y, none = back.y + jnp.sum(pulled, axis=0) + back.before, jnp.zeros_like(y0)
    back = _Back(y, jnp.zeros_like(k), none, found, back.time, back.last)
    return back.moved(first, start, end)


def _peaks_back(weights, step, slopes, first, back: _Back) -> _Back:
    """With the cotangents of a step's largest angles, (3,)."""
    t0, t1, y0, k = step
    y1 = y0 + weights.astype(y0.dtype) @ k
    start, before, end, y = jax.vjp(step_peaks, t0, y0, t1, y1)[1](slopes)
    back = dataclasses.replace(back, y=back.y + y, before=back.before + before)
    return back.moved(first, start, end)


def _part_back(
    pilot: Pilot, posed: Posed, args, moved, steps: _Steps, wanted, first, peaks, back: _Back
) -> _Back:
    """Cotangents where a part starts, if it is wanted.

    Args:
        steps: of the part.
        wanted: whether it is.
        first: whether it is the first on the way back.
        peaks: cotangents of the largest angles, and the numbers of the steps that hold them,
            counted in this part, (3,).
        back: cotangents at its end.
    """
    weights = _tableau(posed.settings.solver)[1]

    def going(carry):
        return wanted & (carry[0] > 0)

    def body(carry):
        left, first, back = carry
        active, n = going(carry), jnp.maximum(left - 1, 0)
        step = steps.before[n], steps.upto[n], steps.y[n], steps.k[n]
        if posed.turns:
            slopes = jnp.where(active & (peaks[1] == n), peaks[0], 0.0)
            back = _peaks_back(weights, step, slopes, first, back)
        new = _step_back(pilot, posed, args, moved, step, active, first, back)
        return left - 1, jnp.zeros((), bool), _choose(active, new, back)

    return _while(going, body, (steps.count, first, back))[-1]


def _end(pilot: Pilot, posed: Posed, lane: Lane):
    """What comes of a flight that is over, from its latest step, and that."""
    largest = lane.control[1].largest if posed.turns else None

    def solved(given):
        posed, y, tprev, before, upto, info, largest = given
        control = lane.control
        if posed.turns:
            # the peaks of the last step are followed from where it starts
            start = Peaks.start(before, info["y0"])
            control = control[0], dataclasses.replace(start, largest=largest)
        new = {"y": y, "tprev": tprev, "before": before, "upto": upto, "info": info}
        return pilot.finish(posed, dataclasses.replace(lane, control=control, **new))

    return solved, (posed, lane.y, lane.tprev, lane.before, lane.upto, lane.info, largest)


def _end_back(pilot: Pilot, posed: Posed, args, moved, lane: Lane, cotangents):
    """Cotangents at the end, those of what was posed, and of the largest angles before."""
    solved, pull = eqx.filter_vjp(*_end(pilot, posed, lane))
    floats = eqx.filter(solved, eqx.is_inexact_array)
    given = jax.tree.map(
        lambda g, x: jnp.zeros_like(x) if g is None and x is not None else g,
        cotangents,
        floats,
        is_leaf=lambda g: g is None,
    )
    bars = pull(given)[0]
    posed_bar, y, tprev, before, upto, info, largest = bars
    kept = lane.tprev == lane.upto  # else the latest attempt starts at the end
    at_end = _Back(
        y + info["y1"] + jnp.where(kept, 0.0, info["y0"]),
        info["k"],
        jnp.where(kept, info["y0"], 0.0),
        jax.tree.map(jnp.zeros_like, eqx.filter(args, moved)),
        before,
        tprev + upto,
    )
    return at_end, posed_bar, largest


@eqx.filter_custom_vjp
def _flown(given, pilot: Pilot) -> Solved:
    posed, args = given

    def going(flown):
        return ~pilot.over(posed, flown.lane)

    def body(flown):
        return _choose(going(flown), flown.advanced(pilot, posed, args), flown)

    return pilot.finish(posed, _while(going, body, _Flown.start(pilot, posed, args)).lane)


@_flown.def_fwd
def _(_, given, pilot: Pilot):
    posed, args = given
    found = _forward(pilot, posed, args)
    return pilot.finish(posed, found[0].lane), found


@_flown.def_bwd
def _(found, cotangents, perturbed, given, pilot: Pilot):
    (posed, args), moved = given, perturbed[1]
    flown, steps, starts, count = found
    lane, room = flown.lane, len(steps.before)
    back, bars, largest = _end_back(pilot, posed, args, moved, lane, cotangents)
    where = pilot, posed, args, moved

    def going(carry):
        return carry[0] > 0

    def body(carry):
        left, steps, first, back = carry
        go = going(carry)
        start = jax.tree.map(lambda x: x[jnp.maximum(left - 1, 0)], starts)
        if _room(posed)[1] > 1:
            again = _part(pilot, posed, args, start, go & ~first, room)[1]
            steps = _choose(first, steps, again)
        peaks = largest, flown.highest - start.lane.accepted
        back = _part_back(*where, steps, go, first, peaks, back)
        return left - 1, steps, jnp.zeros((), bool), back

    back = _while(going, body, (count, steps, jnp.ones((), bool), back))[-1]
    state, reached = back.y, lane.tprev >= posed.t1
    if posed.turns:
        angles = posed.state[ANGLES]
        highest = jnp.where(flown.highest < 0, jnp.sign(angles) * largest, 0.0)
        state = state.at[ANGLES].add(highest)
    t0, t1 = (
        back.time + jnp.where(reached, 0.0, back.last),
        jnp.where(reached, back.last, 0.0),
    )
    bars = eqx.tree_at(
        lambda p: (p.state, p.t0, p.t1), bars, (bars.state + state, bars.t0 + t0, bars.t1 + t1)
    )
    return bars, back.args


class Stages(diffrax.RecursiveCheckpointAdjoint):
    """Reverse mode through the stages that were kept, wherever a flight allows it."""


def solve_back(field, start: State, t0, args, settings: Settings, **options) -> Solved:
    """As `solve`, to be differentiated backwards."""
    posed = Posed.of(start, t0, settings, **options)
    return _flown((posed, args), Pilot(field))
