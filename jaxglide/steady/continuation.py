"""`steady_branch`: a steady glide followed along a number, past folds, with its stability."""

import math
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import as_number, check_integer, check_range, is_traced, number
from .._lib.fields import Parameter
from .._lib.types import Array
from ..flight.case import Case
from ..flight.dynamics import ANGLES, Glider
from ..flight.launch import Launch
from .branch import Branch
from .closure import Kind, Sought, orbit
from .figures import mean_path
from .follow import LONGEST, Ending, Here, Rules, followed_from, here
from .glide import STEP, sought, steady_glide
from .pieces import Followed, Place
from .reduced import MOST_STEPS, SAMPLES, SIZE, reduce
from .result import SteadyGlide

_PIECE = 0.25  # s; longest piece that a map is cut into, if they are not too many
_PIECES = 8, 32  # fewest and most; solved at once, eight take half the time of one
_LOST = "the start leads to no steady glide"
_WORDS = {
    Ending.RANGE: "reaches the end of the range",
    Ending.UPENDED: "the nose comes to point straight up or down, where yaw has no meaning",
    Ending.SHORT: "the next point is not found, however near",
    Ending.MANY: "as many points as were asked for",
    Ending.CLOSED: "comes back to where it began",
}


def _pieces(longest: float) -> int:
    """Into how many pieces the time of a map is cut; a power of two, so few are compiled."""
    least = 2 ** math.ceil(math.log2(longest / _PIECE))
    return min(max(least, _PIECES[0]), _PIECES[1])


def _kind(case: Case, path: str, whole: bool) -> Kind:
    frozen = float(case.glider.gait.f_theta) == 0  # type: ignore[attr-defined]
    straight = float(case.glider.gait.d_theta) == 0  # type: ignore[attr-defined]
    mirrored = straight and path != "gait.d_theta" and not whole
    return Kind(frozen, mirrored and not frozen)


def _shifted(points: list[Here], followed: Followed) -> np.ndarray:
    """States of flight at the ends of cycles, as far as the mean path wants them, (N, 13).

    The ways of the pieces one behind the other; where half a cycle is flown, its mirror image
    comes behind. Of a frozen body its rates, which are those of a second.
    """
    ends = np.array([one.at.found.ends for one in points])
    if followed.kind.frozen:
        return ends[:, 0]
    yaw = ANGLES.start
    turned = np.cumsum(ends[..., yaw], axis=1)
    before = np.concatenate([0 * turned[:, :1], turned[:, :-1]], axis=1)
    shift = ((ends[..., 0] + 1j * ends[..., 1]) * np.exp(1j * before)).sum(axis=1)
    last, turn = ends.sum(axis=1), turned[:, -1]
    if followed.kind.mirrored:
        shift, turn = shift - np.conj(shift) * np.exp(1j * turn), 0 * turn
        last = 2 * last
    last[:, 0], last[:, 1], last[:, yaw] = shift.real, shift.imag, turn
    return last


def _arrays(points: list[Here], followed: Followed) -> dict[str, Any]:
    """Fields of a branch, by name."""
    kind, share = followed.kind, followed.pieces * (2 if followed.kind.mirrored else 1)
    states = np.array([one.at.place.u for one in points]) * np.asarray(followed.unit)
    p = np.array([one.at.place.p for one in points])
    period = share * jax.vmap(lambda p: followed.at(p)[1])(jnp.asarray(p))
    ends = jnp.asarray(_shifted(points, followed))
    mean = jax.vmap(lambda end, period: mean_path(end[None], period, kind))(ends, period)
    forward, sink, turn = map(np.asarray, mean)
    values = np.array([one.multipliers for one in points])
    return {
        "parameter": float(followed.span) * p,
        "state": states[:, 0],
        "states": states,
        "period": np.asarray(period),
        "speed": np.linalg.norm(states[:, 0, :3], axis=1),
        "glide_angle": np.arctan2(sink, forward),
        "forward_speed": forward,
        "sink_rate": sink,
        "turn_rate": turn,
        "multipliers": values**2 if kind.mirrored else values,
        "kinds": np.array([one.kind for one in points]),
    }


def _cut(states, followed: Followed) -> Array:
    """Scaled reduced states at the starts of the pieces, of states over a cycle, (k, 8)."""
    parts = followed.pieces * (2 if followed.kind.mirrored else 1)
    at = np.arange(followed.pieces) * (SAMPLES // parts if not followed.kind.frozen else 1)
    return jax.vmap(reduce)(states[at]) / followed.unit


def _ranged(case: Case, path: str, name: str, low, high) -> tuple[float, float]:
    """The range, checked against that of the number."""
    known: Parameter = case.parameter(path)
    low, high = as_number("low", low), as_number("high", high)
    for end, value in (("low", low), ("high", high)):
        known.check(f"{end} of {name}", value)
    now = case.value(path)
    if now is None:
        raise ValueError(f"{name} is left out and follows from others: give it a value")
    unit = f" {known.unit}" if known.unit else ""
    if not low < high or not low <= now <= high:
        raise ValueError(
            f"{name} = {now:g}{unit} of the glider must be in the range, low = {low:g} to "
            f"high = {high:g}{unit}, low below high"
        )
    return low, high


def _named(glider: Glider, name: str, phase: float) -> tuple[Case, str]:
    """The case in which a number varies, and the path of it."""
    if any(is_traced(leaf) for leaf in jax.tree.leaves(glider)):
        raise TypeError("glider is traced: a branch is followed outside jit, vmap and grad")
    case = Case(glider, Launch(phi_theta=phase))
    path = case.path(name)
    if path.startswith("ends") or (path.startswith("launch") and path != "launch.phi_theta"):
        raise ValueError(f"{path} does not change a steady glide")
    return case, path


def _least(path: str, kind: Kind, low: float, step: float) -> float:
    """The low end of the range; of f_theta that of the longest cycle, if it is above."""
    if path != "gait.f_theta":
        return low
    if kind.frozen:
        raise ValueError(
            "f_theta = 0 Hz of the glider: a frozen body has no waves to slow down"
        )
    return max(low, 1 / (MOST_STEPS * step))


def steady_branch(
    glider: Glider,
    name: str,
    low: float,
    high: float,
    *,
    start=None,
    whole: bool = False,
    phase: float = 0.0,
    step: float = STEP,
    points: int = 200,
    arc: float = LONGEST,
) -> Branch:
    """A steady glide followed along any number of its glider, both ways from its own value.

    Pseudo-arclength continuation: a step along the tangent, then Newton's method across it, so
    the number may turn back at a fold. The cycle, or half of one, is cut into pieces, all
    solved at once, and the starts of all are unknown; so slow waves, over whose cycle a small
    change may grow by 1e20, are no obstacle. Points about which something is special are
    found and marked.

    Args:
        glider: what glides (see `steady_glide`), with the number in the range.
        name: of the number, a path or a name that is unique, as in a `Case`: "f_theta",
            "body.mass"; "phi_theta" is the phase of the waves at the start.
        low, high: range, in the unit that people read.
        start: a steady glide of the glider, or the state near the start of a cycle, (8,), or
            those at the starts of k pieces, as in `Branch.states`, (k, 8); by default what
            `steady_glide` finds.
        whole: whether glides that are not their own mirror image are followed too; as
            always where d_theta is not 0, or is what varies.
        phase: of the waves at the start of a cycle [rad].
        step: longest step of the solver [s], 1e-5 to 0.05.
        points: most points in either direction, 1 to 10,000.
        arc: longest step along the branch, 1e-3 to 0.5; scaled states and the share of the
            range count alike.

    Raises:
        TypeError: as in `steady_glide`, or the glider is traced.
        ValueError: as in `steady_glide`, or the name means no number of the glider.

    Examples:
        >>> from jaxglide import Gait, Glider, Polar, Snake, steady_branch
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(60, 0, 1.738, 1.3, 5.5), Polar.smooth())
        >>> branch = steady_branch(glider, "f_theta", 1, 3)
        >>> print(branch)
        Branch of steady glides in f_theta
          range            1 to 3 Hz
          points           27, 0 of them stable
          first point      reaches the end of the range
          last point       reaches the end of the range
    """
    posed = sought(glider, phase, step)
    case, path = _named(posed.glider, name, phase)
    low, high = _ranged(case, path, name, low, high)
    check_integer("points", points, 1, 10_000)
    check_range("arc", arc, "", 1e-3, 0.5, shape=())
    kind = _kind(case, path, whole)
    least = _least(path, kind, low, step)
    pieces = 1 if kind.frozen else _pieces(_longest(case, path, least, kind))
    if start is not None and np.ndim(start) == 2:
        pieces = len(start)
    unit, span = posed.scales(), high - least
    followed = Followed.of(case, path, span, unit, kind, pieces)
    rules = Rules(least / span, high / span, step, points, arc)
    u, why = _begun(start, glider, posed, followed)
    first = None if u is None else _first(u, case.value(path) / span, followed, rules)
    known: dict[str, Any] = {"name": case.name(path), "unit": case.parameter(path).unit}
    known |= {"frozen": kind.frozen, "mirrored": kind.mirrored}
    if first is None:
        return Branch(found=False, ends=(why, why), **known, **_none(followed))
    below, under = followed_from(first, False, followed, rules)
    above, over = [], under
    if under != Ending.CLOSED:
        above, over = followed_from(first, True, followed, rules)
    ends = _WORDS[under], _WORDS[over]
    if least > low and under == Ending.RANGE:
        ends = f"slower waves take more than {MOST_STEPS} steps in a cycle", ends[1]
    found = _arrays([*reversed(below), first._replace(kind="start"), *above], followed)
    return Branch(found=True, ends=ends, **known, **found)


def _begun(start, glider: Glider, posed: Sought, followed: Followed):
    """Scaled states of the pieces to begin with, or None; and why there is no branch."""
    if start is None:
        start = steady_glide(glider, phase=float(posed.phase), step=float(posed.step))
    if isinstance(start, SteadyGlide):
        return (_cut(start.states, followed), _LOST) if bool(start.found) else (None, start.why)
    states = number("start")(start)
    if states.ndim == 2:
        check_range("start", states, "", shape=(1 if posed.kind.frozen else len(states), SIZE))
        return states / followed.unit, _LOST
    check_range("start", states, "", shape=(SIZE,))
    return _cut(orbit(states / followed.unit, posed).states, followed), _LOST


def _first(u, p: float, followed: Followed, rules: Rules) -> Here | None:
    """The start of a branch, by its own map; None if there is none."""
    none = Place(jnp.zeros_like(u), jnp.ones_like(u[0, 0]))
    return here(Place(u, jnp.asarray(p, u.dtype)), none, True, followed, rules)


def _longest(case: Case, path: str, least: float, kind: Kind) -> float:
    """The longest that the map takes in the range [s]."""
    slowest = least if path == "gait.f_theta" else case.value("gait.f_theta")
    return (0.5 if kind.mirrored else 1.0) / slowest


def _none(followed: Followed) -> dict[str, Any]:
    """Fields of a branch without points."""
    names = ("parameter", "period", "speed", "glide_angle", "forward_speed", "sink_rate")
    arrays: dict[str, Any] = dict.fromkeys((*names, "turn_rate"), np.zeros(0))
    arrays |= {"state": np.zeros((0, SIZE)), "states": np.zeros((0, followed.pieces, SIZE))}
    return arrays | {"multipliers": np.zeros((0, SIZE), complex), "kinds": np.zeros(0, str)}
