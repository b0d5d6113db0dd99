"""Multiple shooting: a flight in pieces, which an optimiser joins while it makes it better.

Unknown are the values at a programme's knots, the duration, and the states at the starts of all
pieces but the first. Every piece must end where the next one starts and the last on the
ground: through a flight that grows errors a hundredfold a second, no derivative then goes
farther than a piece. SLSQP of SciPy solves it by coarse flights; least-norm Newton steps then
close the gaps in fine ones.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.optimize import minimize

from .._lib.cores import in_threads
from .._lib.types import Array, Float, Scalar
from ..control.plant import INPUTS
from ..flight.case import Case
from ..flight.dynamics import ANGLES, PATH, RIGID
from ..flight.ends import TURNS, AngleLimit, Ground, Outcome
from ..flight.glide import Glide, checked
from ..flight.integrate import integrate
from ..flight.launch import TakeOff, started
from ..steady import SteadyGlide, steady_glide
from .objective import Objective, Trial
from .problem import Asked, judged

CLOSED = 1e-6
"""Largest gap, scaled, of a flight whose pieces have met."""
_UNIT = np.repeat([10.0, 5.0, 5.0, 1.0], 3)  # m, m/s, rad/s, rad: what a state is measured in
_LONGEST = 0.4  # s, of a piece, where nothing else is said
_COARSE, _FINE = 1e-7, 1e-9  # tolerances of the pieces' flights, on the way and in the end
_CLOSINGS = 30  # most steps that close the gaps which are left
_SHORTEST = 0.5**8  # part of such a step that is tried
_GROUP = 4  # pieces of one computation
_BRIEFEST, _TALLEST = 0.3, 3.0  # times the guessed duration
_FADES = 0.8  # s, over which a guess comes to the steady glide
_INSIDE = 0.98  # of the limits of the angles


class Joined(NamedTuple):
    """How a multiple shooting ended.

    Attributes:
        reason: a sentence.
        gap: largest miss of a piece, scaled; see `CLOSED`.
        evaluations: of the whole flight with all its derivatives.
        duration: of the flight [s].
        times: at the starts of the pieces [s], (M,).
        states: there, (M, s), the path flown in each piece beginning anew.
    """

    reason: str
    gap: float
    evaluations: int
    duration: float
    times: np.ndarray
    states: np.ndarray


class Pieces(eqx.Module):
    """A flight in pieces.

    Attributes:
        program: a `ProgramSpace`.
        launched: what the launch comes to.
        tolerance: of their flights.
        moving: own states that are unknown at the pieces' starts: those of the inputs that
            are set (static).
        count: of pieces (static).
    """

    program: Any
    launched: TakeOff
    tolerance: Scalar
    moving: tuple[int, ...] = eqx.field(static=True)
    count: int = eqx.field(static=True)

    @classmethod
    def of(cls, program, begun: TakeOff, count: int) -> "Pieces":
        """A programme's flight from a launch in so many pieces."""
        m = len(INPUTS)
        chosen = [INPUTS.index(name) for name in program.inputs]
        moving = [*chosen, *(m + k for k in chosen)]
        moving += [2 * m] if "f_theta" in program.inputs else []
        if begun.state.shape[0] > RIGID + 2 * m + 1:
            raise ValueError("multiple shooting cannot fly air forces with states of their own")
        return cls(program, begun, jnp.asarray(_COARSE), tuple(moving), count)

    @property
    def size(self) -> int:
        """Numbers of an unknown state."""
        return 12 + len(self.moving)

    @property
    def start(self) -> Array:
        """State at launch, (s,)."""
        return self.launched.state

    def full(self, u, time) -> Array:
        """A state of flight with scaled unknown ones, (s,), of a path that starts here."""
        own = self.start[RIGID:].at[-1].set(self.start[RIGID + len(INPUTS) - 1] * time)
        own = own.at[np.array(self.moving, int)].set(u[12:])
        return jnp.concatenate([u[:12] * _UNIT, jnp.zeros(1), own])

    def unknown(self, state) -> Array:
        """The scaled unknown numbers of a state of flight."""
        own = state[RIGID:][np.array(self.moving, int)]
        return jnp.concatenate([state[:12] / _UNIT, own])

    def end(self, u, first, k, duration, values) -> Float[Array, " n"]:
        """Where a piece ends: the unknown numbers of the next, and the path flown [m]."""
        glider = self.program.case.replace(
            dict(zip(self.program.names, values, strict=True))
        ).glider
        t0, t1 = duration * k / self.count, duration * (k + 1) / self.count
        start = jnp.where(first, self.start, self.full(u, t0))
        told: dict[str, Any] = dict.fromkeys(("rtol", "atol"), self.tolerance)
        told |= {"phase": self.launched.phi_theta}
        state = integrate(glider, start, t0, t1, **told).state
        return jnp.append(self.unknown(state), state[PATH])


@eqx.filter_jit
def _some_ends(pieces: Pieces, starts, numbers, duration, values):
    """Ends of some pieces, and their slopes by start, duration and values."""

    def one(u, k):
        def to(u, duration, values):
            found = pieces.end(u, k == 0, k, duration, values)
            return found, found

        return jax.jacfwd(to, (0, 1, 2), has_aux=True)(u, duration, values)

    (by_u, by_duration, by_values), ends = jax.vmap(one)(starts, numbers)
    return ends, by_u, by_duration, by_values


def _ends(pieces: Pieces, starts, duration, values) -> list[np.ndarray]:
    """Ends of all pieces (M, u + 1), and their slopes by start, duration and values."""
    numbers = np.arange(pieces.count)
    parts = [numbers[k : k + _GROUP] for k in range(0, pieces.count, _GROUP)]
    parts = [np.resize(part, _GROUP) for part in parts]  # of one length: one compilation
    told = jnp.asarray(duration), jnp.asarray(values)

    def some(part):
        return _some_ends(pieces, jnp.asarray(starts[part]), jnp.asarray(part, float), *told)

    found = in_threads(some, parts)
    return [
        np.concatenate([np.asarray(x) for x in every])[: pieces.count]
        for every in zip(*found, strict=True)
    ]


@eqx.filter_jit
def _judged(pieces: Pieces, asked: Asked, ends, duration):
    """Objective and slacks (v,), and their slopes by ends and duration."""
    case = pieces.program.case

    def values(ends, duration):
        last = pieces.full(ends[-1, :-1], duration).at[PATH].set(jnp.sum(ends[:, -1]))
        launch, settings = checked(
            case.glider,
            case.launch,
            ends=case.ends,
            max_time=60.0,
            rtol=1e-6,
            atol=1e-6,
            max_steps=1,
        )
        angles = jnp.abs(jnp.concatenate([pieces.start[None, ANGLES], ends[:, 9:12]]))
        none = jnp.zeros((), int)
        glide: Any = Glide(  # type: ignore[call-arg]
            glider=case.glider,
            launch=launch,
            settings=settings,
            take_off=pieces.launched,
            outcome=jnp.asarray(int(Outcome.LANDED)),
            time=duration,
            state=last,
            max_angles=jnp.max(angles, axis=0),
            accepted=none,
            rejected=none,
            states=None,
            interpolation=None,
        )
        found = judged(asked, Trial.of(glide))
        return found, found

    slopes, found = jax.jacrev(values, (0, 1), has_aux=True)(ends, duration)
    return found, *slopes


class _Posed:
    """The nonlinear programme, its functions and their Jacobians; the last place is kept."""

    def __init__(self, pieces: Pieces, asked: Asked, level: float):
        self.pieces, self.asked, self.level = pieces, asked, level
        self.free, self.key, self.known = (pieces.count - 1) * pieces.size, None, None
        self.evaluations = 0

    def to(self, tolerance: float) -> None:
        """From now on pieces fly to this tolerance."""
        self.pieces = eqx.tree_at(lambda p: p.tolerance, self.pieces, jnp.asarray(tolerance))
        self.key = None

    def split(self, z):
        """Starts (M, u), duration, values."""
        size = self.pieces.size
        first = np.asarray(self.pieces.unknown(self.pieces.start))
        starts = np.concatenate([first[None], z[: self.free].reshape(-1, size)])
        return starts, z[self.free], z[self.free + 1 :]

    def at(self, z) -> Any:
        """Values, gaps with the miss of the ground, and their Jacobians."""
        if self.key is not None and np.array_equal(z, self.key):
            return self.known
        starts, duration, values = self.split(z)
        ends, by_u, by_t, by_v = _ends(self.pieces, starts, duration, values)
        count, size = self.pieces.count, self.pieces.size
        slopes = np.zeros((count, size + 1, len(z)))  # of all ends
        for k in range(1, count):
            slopes[k, :, (k - 1) * size : k * size] = by_u[k]
        slopes[:, :, self.free], slopes[:, :, self.free + 1 :] = by_t, by_v
        found = _judged(self.pieces, self.asked, jnp.asarray(ends), jnp.asarray(duration))
        worth, by_ends, by_duration = map(np.asarray, found)
        rates = np.einsum("vku,kuz->vz", by_ends, slopes)
        rates[:, self.free] += by_duration
        gaps = (ends[:-1, :size] - starts[1:]).ravel()
        gaps = np.append(gaps, ends[-1, 2] - self.level / _UNIT[2])
        joined = slopes[:-1, :size].reshape(-1, len(z)).copy()
        joined[:, : self.free] -= np.eye(self.free)
        joined = np.concatenate([joined, slopes[-1, 2][None]])
        self.evaluations += 1
        self.key, self.known = z.copy(), (worth, gaps, rates, joined)
        return self.known


def level_of(case: Case) -> float | None:
    """Height of the ground that a case lands on [m]; None where there is none."""
    grounds = [float(end.level) for end in case.ends if isinstance(end, Ground)]
    return max(grounds, default=None)


def lasting(begun: TakeOff, glide: SteadyGlide, level: float) -> float:
    """About how long a flight lasts from a launch into a steady glide, to a level [s]."""
    return (float(begun.state[2]) - level) / float(glide.sink_rate) + _FADES


def _guessed(pieces: Pieces, glide: SteadyGlide, duration: float) -> np.ndarray:
    """Scaled starts of the pieces but the first: from the launch into the steady glide, a
    place that no flight has been to."""
    launch = np.asarray(pieces.start)
    times = duration * np.arange(1, pieces.count) / pieces.count
    cycle = np.asarray(glide.states)
    turned = np.mod(times / float(glide.period), 1.0) * len(cycle)
    states = np.zeros((len(times), len(launch)))
    states[:, :RIGID] = cycle[turned.astype(int) % len(cycle)]
    states[:, RIGID:] = launch[RIGID:]
    fade = np.exp(-times / _FADES)[:, None]
    states += fade * (launch - states)
    gone = np.maximum(times - _FADES, 0.0)
    states[:, :2] = launch[:2]
    states[:, 1] += float(glide.forward_speed) * gone
    states[:, 2] = launch[2] - float(glide.sink_rate) * gone
    return np.array(jax.vmap(pieces.unknown)(jnp.asarray(states)))


def _bounds(pieces: Pieces, duration: float) -> list[tuple[float, float]]:
    """Of all unknown numbers: angles within those that end the flight."""
    state = [(-np.inf, np.inf)] * pieces.size
    for end in pieces.program.case.ends:
        for name in end.angles if isinstance(end, AngleLimit) else ():
            most = _INSIDE * float(end.limit)
            state[9 + TURNS.index(name)] = (-most, most)
    time = (_BRIEFEST * duration, _TALLEST * duration)
    return state * (pieces.count - 1) + [time, *pieces.program.bounds.values()]


def _step(gaps, slopes, low, high):
    """The smallest step (z,) within bounds that closes gaps to first order."""
    free, step = np.ones(len(low), bool), np.zeros(len(low))
    while free.any():
        left = -gaps - slopes[:, ~free] @ step[~free]
        step[free] = np.linalg.lstsq(slopes[:, free], left, rcond=None)[0]
        beyond = free & ((step < low) | (step > high))
        if not beyond.any():
            break
        step[beyond] = np.clip(step, low, high)[beyond]
        free &= ~beyond
    return step


def _closed(posed: _Posed, z, low, high) -> np.ndarray:
    """A place (z,) near one, within bounds, where the pieces meet in fine flights, if steps
    that close their gaps lead to one."""
    posed.to(_FINE)
    for _ in range(_CLOSINGS):
        _, gaps, _, slopes = posed.at(z)
        most, share = np.abs(gaps).max(), 1.0
        step = _step(gaps, slopes, low - z, high - z)
        if most < CLOSED:  # what is left is mostly the flights' own error
            better = z + step
            return better if np.abs(posed.at(better)[1]).max() < most else z
        while np.abs(posed.at(z + share * step)[1]).max() > (1 - share / 10) * most:
            share /= 2
            if share < _SHORTEST:
                return z
        z = z + share * step
    return z


def shoot(program, objective: Objective, constraints, count: int | None, steps: int):
    """Make a programme fly well in pieces.

    Args:
        program: a `ProgramSpace`.
        objective, constraints: what is wanted; of the flight they may ask for its end and the
            angles on the way, which are looked at where pieces meet.
        count: of pieces; by default as many as make them last 0.4 s at most.
        steps: most of SLSQP.

    Returns:
        Values by name, the objective's value, and a `Joined`.
    """
    level = level_of(program.case)
    if level is None:
        raise ValueError("ends hold no Ground: multiple shooting lands on one")
    begun = started(program.case.glider, program.case.launch)
    glide = steady_glide(program.held, phase=float(begun.phi_theta))
    if not bool(glide.found):
        raise ValueError(
            f"there is no steady glide to begin with ({glide.why}): "
            "shooting = 'single' needs none"
        )
    duration = lasting(begun, glide, level)
    if count is None:
        count = max(2, int(np.ceil(duration / _LONGEST)))
    pieces = Pieces.of(program, begun, count)
    starts = _guessed(pieces, glide, duration)
    guess = np.array(list(program.guesses(1, 0)[0].values()))
    posed = _Posed(pieces, Asked(objective.wanted, tuple(constraints), ()), level)
    rules: list[dict[str, Any]] = [
        {"type": "eq", "fun": lambda z: posed.at(z)[1], "jac": lambda z: posed.at(z)[3]}
    ]
    if constraints:
        rules.append(
            {
                "type": "ineq",
                "fun": lambda z: posed.at(z)[0][1:],
                "jac": lambda z: posed.at(z)[2][1:],
            }
        )
    bounds = _bounds(pieces, duration)
    found = minimize(
        lambda z: -posed.at(z)[0][0],
        np.append(starts, [duration, *guess]),
        jac=lambda z: -posed.at(z)[2][0],
        bounds=bounds,
        constraints=rules,
        method="SLSQP",
        options={"maxiter": steps, "ftol": 1e-7},
    )
    z = _closed(posed, found.x, *np.array(bounds).T)
    worth, gaps, *_ = posed.at(z)
    starts, duration, values = posed.split(z)
    times = duration * np.arange(count) / count
    states = np.array(jax.vmap(pieces.full)(jnp.asarray(starts), jnp.asarray(times)))
    states[0] = np.asarray(pieces.start)
    gap = float(np.abs(gaps).max())
    reason = f"SLSQP: {found.message.lower()} after {found.nit} steps"
    reason += "" if gap < CLOSED else f"; the pieces have not met, {gap:.1e} is missed"
    joined = Joined(reason, gap, posed.evaluations, float(duration), times, states)
    best = dict(zip(program.names, values.tolist(), strict=True))
    return best, float(worth[0]), joined
