"""`steady_branch`: a steady glide followed along a number, past folds, with its stability."""

import math
from typing import TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import as_number, check_integer, check_range, is_traced
from .._lib.fields import Parameter
from .._lib.report import Report, Reported
from .._lib.types import Array, Bool, Complex, Float
from .._lib.units import labelled
from ..flight.case import Case
from ..flight.dynamics import ANGLES, Glider
from ..flight.launch import Launch
from .closure import Kind
from .follow import LONGEST, End, Here, Rules, followed_from, here
from .glide import STEP, _posed, steady_glide
from .pieces import Followed, Place
from .reduced import COMPONENTS, MOST_STEPS, SAMPLES, reduce
from .result import SteadyGlide

if TYPE_CHECKING:
    import xarray as xr

_PIECE = 0.25  # s; longest piece that a map is cut into, if they are not too many
_PIECES = 8, 32  # fewest and most; solved at once, eight take half the time of one
_ABOUT = {
    "period": {"units": "s", "long_name": "period"},
    "speed": {"units": "m s-1", "long_name": "speed at the start"},
    "glide_angle": {"units": "rad", "long_name": "mean path below the horizontal"},
    "forward_speed": {"units": "m s-1", "long_name": "forward speed"},
    "sink_rate": {"units": "m s-1", "long_name": "sink rate"},
    "turn_rate": {"units": "rad s-1", "long_name": "rate of turning to the left"},
    "spectral_radius": {"units": "1", "long_name": "spectral radius"},
}
_WORDS = {
    End.RANGE: "reaches the end of the range",
    End.UPENDED: "the nose comes to point straight up or down, where yaw has no meaning",
    End.SHORT: "the next point is not found, however near",
    End.MANY: "as many points as were asked for",
    End.CLOSED: "comes back to where it began",
}


class Branch(eqx.Module, Reported):
    """A steady glide followed along one number, as arrays over its points, in order.

    The order is that of the branch: the number may turn back. Angles are in radians, but for
    `parameter`.

    Attributes:
        name: of the number, briefly (static).
        unit: of `parameter`, the one that people read (static).
        found: whether there was a steady glide to start from; without one there are no points.
        parameter: values of the number, (N,).
        state: at the starts of cycles, as `SteadyGlide.state`, (N, 8).
        states: the same at the starts of the pieces that a cycle, or half of one, is cut into,
            (N, k, 8).
        period: of a cycle [s], (N,); of a frozen body a second.
        speed: at the starts of cycles [m/s], (N,).
        glide_angle: of the mean path below the horizontal [rad], (N,).
        forward_speed, sink_rate: along it [m/s], (N,).
        turn_rate: to the left [rad/s], (N,).
        multipliers: of a cycle (of a frozen body, of a second), the largest first, (N, 8).
        spectral_radius: modulus of the first, (N,).
        kinds: what is special about a point, (N,): "fold", where the number turns back; "+1",
            where a multiplier leaves or enters the unit circle through 1 and the number does
            not turn, so that other steady glides branch off; "-1" through -1, of half a cycle
            and its mirror image where that is the map: steady glides that are not their own
            mirror image branch off in pairs, one turning left and one right, otherwise
            glides of twice the period; "pair" for two complex ones, behind which the flight
            swings with a period of its own; "start"; "" for all others.
        ends: why it ends, below and above, or at its first and last point, in words (static).
        frozen, mirrored: which equation was solved (static); see `Kind`.
    """

    name: str = eqx.field(static=True)
    unit: str = eqx.field(static=True)
    found: bool
    parameter: Float[np.ndarray, " N"]
    state: Float[np.ndarray, "N 8"]
    states: Float[np.ndarray, "N k 8"]
    period: Float[np.ndarray, " N"]
    speed: Float[np.ndarray, " N"]
    glide_angle: Float[np.ndarray, " N"]
    forward_speed: Float[np.ndarray, " N"]
    sink_rate: Float[np.ndarray, " N"]
    turn_rate: Float[np.ndarray, " N"]
    multipliers: Complex[np.ndarray, "N 8"]
    kinds: np.ndarray
    ends: tuple[str, str] = eqx.field(static=True)
    frozen: bool = eqx.field(static=True)
    mirrored: bool = eqx.field(static=True)

    @property
    def spectral_radius(self) -> Float[np.ndarray, " N"]:
        """Modulus of the largest multiplier, (N,)."""
        return np.abs(self.multipliers[:, 0])

    @property
    def stable(self) -> Bool[np.ndarray, " N"]:
        """Where every small change dies out, (N,)."""
        return self.spectral_radius < 1

    @property
    def exponents(self) -> Complex[np.ndarray, "N 8"]:
        """Rates at which small changes grow and turn [1/s], (N, 8)."""
        return np.log(self.multipliers) / self.period[:, None]

    @property
    def special(self) -> tuple[int, ...]:
        """Points about which something is special, by their places in the arrays."""
        return tuple(k for k, kind in enumerate(self.kinds) if kind not in ("", "start"))

    def dataset(self) -> "xr.Dataset":
        """The branch as a Dataset over `point`, to save with `jaxglide.save`.

        Multipliers as real and imaginary parts over `multiplier`, the state over `component`.
        """
        import xarray as xr

        from .._lib.formats import marked

        over = {name: ("point", getattr(self, name), about) for name, about in _ABOUT.items()}
        parts = ("point", "multiplier")
        told = "multipliers of a cycle"
        variables = {
            "parameter": (
                "point",
                self.parameter,
                labelled(self.unit or "1", self.name),
            ),
            "state": (("point", "component"), self.state, {"long_name": "state at the start"}),
            "multipliers_real": (parts, self.multipliers.real, {"long_name": f"{told}, real"}),
            "multipliers_imag": (
                parts,
                self.multipliers.imag,
                {"long_name": f"{told}, imaginary"},
            ),
            "kind": ("point", self.kinds.astype(str), {"long_name": "what is special"}),
            **over,
        }
        data = xr.Dataset(variables, {"component": list(COMPONENTS)})
        named = {"parameter": self.name, "first": self.ends[0], "last": self.ends[1]}
        return marked(data.assign_attrs(named), "steady branch")

    def report(self) -> Report:
        if not self.found:
            return Report(f"No branch in {self.name}: {self.ends[0]}")
        low, high = float(self.parameter.min()), float(self.parameter.max())
        unit = f" {self.unit}" if self.unit else ""
        stable = int(self.stable.sum())
        rows = [
            ("range", f"{low:g} to {high:g}{unit}"),
            ("points", f"{len(self.parameter)}, {stable} of them stable"),
            ("first point", self.ends[0]),
            ("last point", self.ends[1]),
        ]
        for k in self.special:
            text = f"{self.parameter[k]:.4g}{unit}, {math.degrees(self.glide_angle[k]):.2f} deg"
            rows.append((str(self.kinds[k]), text))
        return Report(f"Branch of steady glides in {self.name}", tuple(rows))


def _pieces(longest: float) -> int:
    """Into how many pieces the time of a map is cut; a power of two, so few are compiled."""
    least = 2 ** math.ceil(math.log2(longest / _PIECE))
    return min(max(least, _PIECES[0]), _PIECES[1])


def _kind(case: Case, path: str, whole: bool) -> Kind:
    frozen = float(case.glider.gait.f_theta) == 0  # type: ignore[attr-defined]
    straight = float(case.glider.gait.d_theta) == 0  # type: ignore[attr-defined]
    mirrored = straight and path != "gait.d_theta" and not whole
    return Kind(frozen, mirrored and not frozen)


def _frozen_figures(points: list[Here], unit) -> dict[str, np.ndarray]:
    moving = np.array([one.at.found.ends[0] for one in points])
    forward = np.hypot(moving[:, 0], moving[:, 1])
    return {
        "period": np.ones(len(points)),
        "forward_speed": forward,
        "sink_rate": -moving[:, 2],
        "turn_rate": moving[:, 9],
    }


def _mean_figures(points: list[Here], followed: Followed) -> dict[str, np.ndarray]:
    """Of the mean path: the ways of the pieces, one behind the other."""
    ends = np.array([one.at.found.ends for one in points])
    turned = np.cumsum(ends[..., ANGLES.start], axis=1)
    before = np.concatenate([0 * turned[:, :1], turned[:, :-1]], axis=1)
    flat = (ends[..., 0] + 1j * ends[..., 1]) * np.exp(1j * before)
    shift, turn = flat.sum(axis=1), turned[:, -1]
    share = followed.pieces * (2 if followed.kind.mirrored else 1)
    p = jnp.asarray([one.at.place.p for one in points])
    period = share * np.asarray(jax.vmap(lambda p: followed.at(p)[1])(p))
    sink = -ends[..., 2].sum(axis=1)
    if followed.kind.mirrored:  # the other half is the mirror image, and turns back
        shift, turn, sink = shift - np.conj(shift) * np.exp(1j * turn), 0 * turn, 2 * sink
    forward = np.abs(shift) / (np.sinc(turn / (2 * np.pi)) * period)
    return {
        "period": period,
        "forward_speed": forward,
        "sink_rate": sink / period,
        "turn_rate": turn / period,
    }


def _arrays(points: list[Here], followed: Followed) -> dict[str, np.ndarray]:
    """The fields of a branch."""
    unit, kind = np.asarray(followed.unit), followed.kind
    states = np.array([one.at.place.u for one in points]) * unit
    figures = _frozen_figures(points, unit) if kind.frozen else _mean_figures(points, followed)
    values = np.array([one.multipliers for one in points])
    return {
        "parameter": float(followed.span) * np.array([one.at.place.p for one in points]),
        "state": states[:, 0],
        "states": states,
        "speed": np.linalg.norm(states[:, 0, :3], axis=1),
        "glide_angle": np.arctan2(figures["sink_rate"], figures["forward_speed"]),
        "multipliers": values**2 if kind.mirrored else values,
        "kinds": np.array([one.kind for one in points]),
        **figures,
    }


def _cut(glide: SteadyGlide, followed: Followed) -> np.ndarray:
    """Scaled reduced states of a glide at the starts of the pieces, (k, 8)."""
    parts = followed.pieces * (2 if followed.kind.mirrored else 1)
    at = np.arange(followed.pieces) * (SAMPLES // parts if not followed.kind.frozen else 1)
    return np.asarray(jax.vmap(reduce)(glide.states[at]) / followed.unit)


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
    start: SteadyGlide | Float[Array, "8"] | None = None,
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
        start: a steady glide of the glider, or the state at the start of a cycle, (8,); by
            default what `steady_glide` finds.
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
        >>> glider = Glider(body, Gait.from_degrees(f_theta=0), Polar.smooth())
        >>> branch = steady_branch(glider, "d_psi", 5, 15)
        >>> print(branch.ends)
    """
    posed = _posed(glider, phase, step)
    case, path = _named(posed.glider, name, phase)
    low, high = _ranged(case, path, name, low, high)
    check_integer("points", points, 1, 10_000)
    check_range("arc", arc, "", 1e-3, 0.5, shape=())
    kind = _kind(case, path, whole)
    least = _least(path, kind, low, step)
    if isinstance(start, SteadyGlide):
        start = start.state
    glide = steady_glide(glider, start, phase=phase, step=step)
    pieces = 1 if kind.frozen else _pieces(_longest(case, path, least, kind))
    unit, span = posed.scales(), high - least
    followed = Followed.of(case, path, span, unit, kind, pieces)
    rules = Rules(least / span, high / span, step, points, arc)
    first = _first(glide, case.value(path) / span, followed, rules)
    known = {"name": case.name(path), "unit": case.parameter(path).unit}
    known |= {"frozen": kind.frozen, "mirrored": kind.mirrored}
    if first is None:
        return _none(glide.why, followed, known)
    below, under = followed_from(first, False, followed, rules)
    above, over = (
        ([], under) if under == End.CLOSED else followed_from(first, True, followed, rules)
    )
    ends = _WORDS[under], _WORDS[over]
    if least > low and under == End.RANGE:
        ends = (
            f"slower waves take more than {MOST_STEPS} steps of the solver in a cycle",
            ends[1],
        )
    found = _arrays([*reversed(below), first._replace(kind="start"), *above], followed)
    return Branch(found=True, ends=ends, **known, **found)


def _first(glide: SteadyGlide, p: float, followed: Followed, rules: Rules) -> Here | None:
    """The start of a branch, by its own map; None if there is none."""
    if not bool(glide.found):
        return None
    u = _cut(glide, followed)
    none = Place(np.zeros_like(u), np.ones_like(u[0, 0]))
    return here(Place(u, np.asarray(p, u.dtype)), none, True, followed, rules)


def _longest(case: Case, path: str, least: float, kind: Kind) -> float:
    """The longest that the map takes in the range [s]."""
    slowest = least if path == "gait.f_theta" else case.value("gait.f_theta")
    return (0.5 if kind.mirrored else 1.0) / slowest


def _none(why: str, followed: Followed, known: dict) -> Branch:
    """No branch, and why."""
    none, k = np.zeros(0), followed.pieces
    names = ("parameter", "period", "speed", "glide_angle", "forward_speed", "sink_rate")
    arrays = dict.fromkeys((*names, "turn_rate"), none)
    arrays |= {"state": np.zeros((0, 8)), "states": np.zeros((0, k, 8))}
    arrays |= {"multipliers": np.zeros((0, 8), complex), "kinds": np.zeros(0, str)}
    return Branch(found=False, ends=(why, why), **known, **arrays)
