"""Along a branch: predict, correct, mark what happens on the way, and say why it ends."""

import enum
from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import brentq

from .closure import LEAST_STEPS
from .pieces import Corrected, Followed, Place, corrected, weights
from .reduced import MOST_STEPS, SIZE
from .spectrum import multipliers_of

FIRST, LONGEST, SHORTEST = 0.01, 0.05, 1e-5
"""Steps along a branch: the first, the longest and the shortest; scaled (see `weights`)."""
_STRAIGHT = np.cos(np.deg2rad(25))  # between the tangents of neighbours
_EASY = 3  # iterations of an easy step, after which the next one is longer
_TRIES = 12  # points tried to find a special one


class Ending(enum.IntEnum):
    """Why a branch ends."""

    RANGE = 0
    UPENDED = 1
    SHORT = 2
    MANY = 3
    CLOSED = 4


class Here(NamedTuple):
    """A point of a branch.

    Attributes:
        at: the place, what is known there, the tangent.
        multipliers: of the map (of a frozen body, of a second), the largest first, (8,).
        kind: what is special about it; see `Branch.kinds`.
        steps: of the solver in a piece.
    """

    at: Corrected
    multipliers: np.ndarray
    kind: str
    steps: int

    @property
    def slope(self) -> float:
        """Of the scaled number, along the branch."""
        return float(self.at.tangent.p)

    @property
    def outside(self) -> int:
        """How many multipliers are outside the unit circle."""
        return int(np.sum(np.abs(self.multipliers) > 1))


class Rules(NamedTuple):
    """Where and how a branch is followed.

    Attributes:
        low, high: range of the scaled number.
        longest_step: of the solver [s].
        points: most of them in either direction.
        short: most of the arc between two of them, scaled.
    """

    low: float
    high: float
    longest_step: float
    points: int
    short: float


def steps_in(p: float, followed: Followed, longest: float) -> int:
    """Steps of the solver in a piece; held while a point is corrected, so its map is smooth."""
    if followed.kind.frozen:
        return 1
    parts = followed.pieces * (2 if followed.kind.mirrored else 1)
    duration = float(followed.at(jnp.asarray(p, followed.span.dtype))[1])
    return int(
        np.clip(np.ceil(duration / longest), np.ceil(LEAST_STEPS / parts), MOST_STEPS - 2)
    )


def multipliers_at(found: Corrected, followed: Followed) -> np.ndarray:
    """Of the map, the largest first; of a frozen body those of a second."""
    slopes = np.asarray(found.found.slopes)
    if followed.kind.frozen:
        values = np.exp(np.linalg.eigvals(slopes[0]).astype(complex))
        return values[np.argsort(-np.abs(values), kind="stable")]
    return multipliers_of(slopes)


def here(
    guess: Place, along: Place, held: bool, followed: Followed, rules: Rules
) -> Here | None:
    """The point of the branch across from a guess, or with its number; None if not reached."""
    steps = steps_in(float(guess.p), followed, rules.longest_step)
    at = corrected(guess, along, jnp.asarray(held), followed, jnp.asarray(float(steps)))
    if not bool(at.good):
        return None
    return Here(at, multipliers_at(at, followed), "", steps)


def _moved(one: Here, arc: float) -> Place:
    place, along = one.at.place, one.at.tangent
    return Place(place.u + arc * along.u, place.p + arc * along.p)


def _dot(a: Place, b: Place) -> float:
    weighed = np.asarray(weights(a.u.shape[0]))
    flat = [np.append(np.ravel(x.u), x.p) for x in (a, b)]
    return float(np.sum(weighed * flat[0] * flat[1]))


def _upended(one: Here, followed: Followed) -> bool:
    return bool(np.any(np.abs(np.asarray(one.at.place.u)[:, SIZE - 2]) >= np.pi / 2))


def _crossings(before: Here, after: Here) -> list[tuple[int, str]]:
    """Which of the sorted multipliers crosses the unit circle, and how."""
    few, many = sorted((before.outside, after.outside))
    wide = before if before.outside == many else after
    found, k = [], few
    while k < many:
        value = wide.multipliers[k]
        pair = abs(value.imag) > 1e-9 * abs(value)
        found.append((k, "pair" if pair else "+1" if value.real > 0 else "-1"))
        k += 2 if pair else 1
    return found


def _special(
    before: Here, arc: float, kind: str, test: Callable[[Here], float], how
) -> Here | None:
    """The point between two at which a test vanishes."""
    tried: dict[float, Here] = {}

    def value(at: float) -> float:
        found = here(_moved(before, at), before.at.tangent, False, *how)
        if found is None:
            raise ArithmeticError("lost between two points of a branch")
        tried[at] = found
        return test(found)

    try:
        root: Any = brentq(value, 0.0, arc, xtol=1e-6 * arc, maxiter=_TRIES, disp=False)
    except (ArithmeticError, ValueError):  # lost on the way, or no change of sign after all
        return None
    nearest = min(tried, key=lambda at: abs(at - root))
    return tried[nearest]._replace(kind=kind)


def _marked(before: Here, after: Here, arc: float, how) -> list[Here]:
    """Special points between two points, in the order of the branch."""
    found: list[tuple[float, Here]] = []
    turns = before.slope * after.slope < 0
    tests = [("fold", lambda one: one.slope)] if turns else []
    for k, kind in _crossings(before, after):
        if kind == "+1" and turns:
            continue  # a multiplier passes 1 where the branch turns
        tests.append((kind, lambda one, k=k: float(np.log(np.abs(one.multipliers[k])))))
    for kind, test in tests:
        one = _special(before, arc, kind, test, how)
        if one is not None:
            found.append((_dot(_apart(one, before), before.at.tangent), one))
    return [one for _, one in sorted(found, key=lambda pair: pair[0])]


def _up_to_the_edge(last: Here, arc: float, rules: Rules) -> tuple[float, float | None]:
    """The arc of a step, shorter where it would leave the range, and the edge it then meets."""
    now = float(last.at.place.p)
    then = now + arc * last.slope
    if rules.low <= then <= rules.high:
        return arc, None
    edge = rules.low if then < rules.low else rules.high
    return arc * (edge - now) / (then - now), edge


def _apart(one: Here, other: Here) -> Place:
    a, b = one.at.place, other.at.place
    return Place(a.u - b.u, a.p - b.p)


def _same_way(one: Here, other: Here) -> bool:
    return _dot(one.at.tangent, other.at.tangent) > _STRAIGHT


def _turned(one: Here) -> Here:
    back = Place(-one.at.tangent.u, -one.at.tangent.p)
    return one._replace(at=one.at._replace(tangent=back))


def followed_from(
    start: Here, upwards: bool, followed: Followed, rules: Rules
) -> tuple[list[Here], Ending]:
    """The points of a branch beyond its start, and why they end.

    The secant of two points is not used: the tangent is exact. A step that is not corrected,
    or behind which the branch has turned by more than 25 degrees, is halved.

    Args:
        start: a point on it.
        upwards: whether the number grows at first.
        followed: what.
        rules: where and how.
    """
    how = (followed, rules)
    last = start if (start.slope > 0) == upwards else _turned(start)
    first, found, arc, gone = last, [], min(FIRST, rules.short), 0.0
    while len(found) < rules.points:
        if arc < SHORTEST:
            return found, Ending.SHORT
        step, edge = _up_to_the_edge(last, arc, rules)
        if edge is not None and step == 0:
            return found, Ending.RANGE
        new = here(_moved(last, step), last.at.tangent, edge is not None, *how)
        if new is not None and edge is None and not rules.low <= new.at.place.p <= rules.high:
            new = None  # past the edge though the guess was not
        if new is None or not _same_way(new, last):
            arc /= 2
            continue
        if _upended(new, followed):
            return found, Ending.UPENDED
        found += [*_marked(last, new, step, how), new]
        gone += step
        if edge is not None:
            return found, Ending.RANGE
        away = _apart(new, first)
        if gone > 4 * arc and _dot(away, away) < arc**2 and _same_way(new, first):
            return found, Ending.CLOSED
        last, count = new, int(new.at.iterations)
        arc = min((1.5 if count <= _EASY else 1.0 if count < 6 else 0.7) * arc, rules.short)
    return found, Ending.MANY
