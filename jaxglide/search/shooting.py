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

from ..flight.case import Case
from ..flight.dynamics import PATH, RIGID
from ..flight.ends import TURNS, AngleLimit, Ground, Outcome
from ..flight.glide import Glide, checked
from ..flight.launch import TakeOff, started
from ..steady import SteadyGlide, steady_glide
from .objective import Objective, Trial
from .pieces import FINE, UNIT, Pieces, ends_of
from .problem import Asked, judged

CLOSED = 1e-6
"""Largest gap, scaled, of a flight whose pieces have met."""
_LONGEST = 0.4  # s, of a piece, where nothing else is said
_CLOSINGS = 30  # most steps that close the gaps which are left
_SHORTEST = 0.5**8  # part of such a step that is tried
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


@eqx.filter_jit
def _judged(pieces: Pieces, asked: Asked, ends, duration):
    """Objective and slacks (v,), and their slopes by ends and duration."""
    case = pieces.program.case

    def values(ends, duration):
        last = pieces.full(ends[-1, :-4], duration).at[PATH].set(jnp.sum(ends[:, -4]))
        launch, settings = checked(
            case.glider,
            case.launch,
            ends=case.ends,
            max_time=60.0,
            rtol=1e-6,
            atol=1e-6,
            max_steps=1,
        )
        none = jnp.zeros((), int)
        glide: Any = Glide(  # type: ignore[call-arg]
            glider=case.glider,
            launch=launch,
            settings=settings,
            take_off=pieces.launched,
            outcome=jnp.asarray(int(Outcome.LANDED)),
            time=duration,
            state=last,
            max_angles=jnp.max(ends[:, -3:], axis=0),
            accepted=none,
            rejected=none,
            states=None,
            interpolation=None,
        )
        found = judged(asked, Trial.of(glide))
        return found, found

    slopes, found = jax.jacrev(values, (0, 1), has_aux=True)(ends, duration)
    return found, *slopes


class _Place(NamedTuple):
    """What is known of a place z of the nonlinear programme.

    Attributes:
        worth: objective and slacks of the constraints, (v,).
        gaps: where pieces do not meet, and the miss of the ground, scaled, (g,).
        left: to the limits of the angles, by piece and angle [rad], (l,).
        rates, joined, closer: their Jacobians, (v, z), (g, z), (l, z).
    """

    worth: np.ndarray
    gaps: np.ndarray
    left: np.ndarray
    rates: np.ndarray
    joined: np.ndarray
    closer: np.ndarray


class _Posed:
    """The nonlinear programme, its functions and their Jacobians; the last place is kept."""

    def __init__(self, pieces: Pieces, asked: Asked, level: float):
        self.pieces, self.asked, self.level = pieces, asked, level
        self.free, self.key = (pieces.count - 1) * pieces.size, np.zeros(0)
        self.known: _Place | None = None
        self.evaluations, self.limits = 0, _limits(pieces.program.case)

    def to(self, tolerance: float) -> None:
        """From now on pieces fly to this tolerance."""
        self.pieces = eqx.tree_at(lambda p: p.tolerance, self.pieces, jnp.asarray(tolerance))
        self.known = None

    def split(self, z):
        """Starts (M, u), duration, values."""
        size = self.pieces.size
        first = np.asarray(self.pieces.unknown(self.pieces.start))
        starts = np.concatenate([first[None], z[: self.free].reshape(-1, size)])
        return starts, z[self.free], z[self.free + 1 :]

    def at(self, z) -> _Place:
        """Values; gaps with the miss of the ground; what is left to the limits of the angles
        on the way; and their Jacobians."""
        if self.known is not None and np.array_equal(z, self.key):
            return self.known
        starts, duration, values = self.split(z)
        ends, by_u, by_t, by_v = ends_of(self.pieces, starts, duration, values)
        count, size = self.pieces.count, self.pieces.size
        slopes = np.zeros((*ends.shape, len(z)))
        for k in range(1, count):
            slopes[k, :, (k - 1) * size : k * size] = by_u[k]
        slopes[:, :, self.free], slopes[:, :, self.free + 1 :] = by_t, by_v
        found = _judged(self.pieces, self.asked, jnp.asarray(ends), jnp.asarray(duration))
        worth, by_ends, by_duration = map(np.asarray, found)
        rates = np.einsum("vku,kuz->vz", by_ends, slopes)
        rates[:, self.free] += by_duration
        gaps = (ends[:-1, :size] - starts[1:]).ravel()
        gaps = np.append(gaps, ends[-1, 2] - self.level / UNIT[2])
        joined = slopes[:-1, :size].reshape(-1, len(z)).copy()
        joined[:, : self.free] -= np.eye(self.free)
        joined = np.concatenate([joined, slopes[-1, 2][None]])
        self.evaluations += 1
        which, most = self.limits
        left = (most - ends[:, -3:][:, which]).ravel()
        closer = -slopes[:, -3:][:, which].reshape(-1, len(z))
        self.key, self.known = z.copy(), _Place(worth, gaps, left, rates, joined, closer)
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


def _limits(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Which angles end a flight, and within what they are to stay [rad], (L,) each."""
    found = [
        (TURNS.index(name), _INSIDE * float(end.limit))
        for end in case.ends
        if isinstance(end, AngleLimit)
        for name in end.angles
    ]
    return np.array([k for k, _ in found], int), np.array([most for _, most in found])


def _bounds(pieces: Pieces, duration: float) -> list[tuple[float, float]]:
    """Of all unknown numbers: angles within those that end the flight."""
    state = [(-np.inf, np.inf)] * pieces.size
    for k, most in zip(*_limits(pieces.program.case), strict=True):
        state[9 + k] = (-most, most)
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
    posed.to(FINE)
    for _ in range(_CLOSINGS):
        here = posed.at(z)
        most, share = np.abs(here.gaps).max(), 1.0
        step = _step(here.gaps, here.joined, low - z, high - z)
        if most < CLOSED:  # what is left is mostly the flights' own error
            better = z + step
            return better if np.abs(posed.at(better).gaps).max() < most else z
        while np.abs(posed.at(z + share * step).gaps).max() > (1 - share / 10) * most:
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
            largest angles on the way.
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
        {"type": "eq", "fun": lambda z: posed.at(z).gaps, "jac": lambda z: posed.at(z).joined},
        {
            "type": "ineq",
            "fun": lambda z: np.append(posed.at(z).worth[1:], posed.at(z).left),
            "jac": lambda z: np.concatenate([posed.at(z).rates[1:], posed.at(z).closer]),
        },
    ]
    bounds = _bounds(pieces, duration)
    found = minimize(
        lambda z: -posed.at(z).worth[0],
        np.append(starts, [duration, *guess]),
        jac=lambda z: -posed.at(z).rates[0],
        bounds=bounds,
        constraints=rules,
        method="SLSQP",
        options={"maxiter": steps, "ftol": 1e-7},
    )
    z = _closed(posed, found.x, *np.array(bounds).T)
    place = posed.at(z)
    starts, duration, values = posed.split(z)
    times = duration * np.arange(count) / count
    states = np.array(jax.vmap(pieces.full)(jnp.asarray(starts), jnp.asarray(times)))
    states[0] = np.asarray(pieces.start)
    gap = float(np.abs(place.gaps).max())
    reason = f"SLSQP: {found.message.lower()} after {found.nit} steps"
    reason += "" if gap < CLOSED else f"; the pieces have not met, {gap:.1e} is missed"
    joined = Joined(reason, gap, posed.evaluations, float(duration), times, states)
    best = dict(zip(program.names, values.tolist(), strict=True))
    return best, float(place.worth[0]), joined
