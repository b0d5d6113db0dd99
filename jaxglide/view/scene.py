"""What a view shows, as plain arrays: body, forces, path and axes of a glide."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_range
from ..body.sections import discretise, surface_nodes
from ..body.snake import Snake
from ..control import Target, histories, target_of
from ..flight.dynamics import ANGLES, POSITION, VELOCITY, Flight, elements
from ..flight.glide import Glide
from ..flight.trajectory import AbstractTrajectory
from . import _loft
from ._loft import Stations

COLOURS = ("#1f3a5f", "#d55e00", "#8e3b8e", "#00795a", "#b8002e", "#5b5b5b")
"""Of several glides: legible to every kind of colour vision, and no colour of the body's."""

Flights = AbstractTrajectory | Sequence[AbstractTrajectory]
"""A flight, or several on one clock."""

_CHUNK = 64  # frames a call: one compilation serves glides of any duration
_MOST_FRAMES = 20_000
_SHEET = 0.3  # height of the tallest force sheets, of SVL


class Steered(NamedTuple):
    """An input that was set.

    Attributes:
        name: in words.
        unit: that people read.
    """

    name: str
    unit: str


@dataclass(frozen=True)
class Scene:
    """One glide at T times, in inertial axes: x right, y forward, z up.

    Attributes:
        label: what it is called.
        ended: how it ended, in words.
        svl: length of the body, a snake's from snout to vent [m].
        head_fraction: end of the head, over that length; 0 for a body without one.
        times: [s], (T,), from 0 to the end of the glide.
        centre, velocity: of the centre of mass [m, m/s], (T, 3).
        axes: co-moving axes, unit vectors to the right flank, forward and dorsal, (T, 3, 3).
        angles: yaw, pitch, roll [deg], (T, 3).
        fraction, chord: of the n nodes that have area: place over the length, and chord
            [m], (n,).
        nodes: positions of the nodes [m], (T, n, 3), snout first.
        chordwise, dorsal: unit vectors along the chord and out of the back, (T, n, 3).
        lift, drag: forces per length of body [N/m], (T, n, 3).
        steered: inputs that were set, none of a flight without control.
        inputs, told: where their actuators were, and what they were told, (T, c).
        target: where it was steered to.
    """

    label: str
    ended: str
    svl: float
    head_fraction: float
    times: np.ndarray
    centre: np.ndarray
    velocity: np.ndarray
    axes: np.ndarray
    angles: np.ndarray
    fraction: np.ndarray
    chord: np.ndarray
    nodes: np.ndarray
    chordwise: np.ndarray
    dorsal: np.ndarray
    lift: np.ndarray
    drag: np.ndarray
    steered: tuple[Steered, ...]
    inputs: np.ndarray
    told: np.ndarray
    target: Target

    @classmethod
    def of(
        cls,
        glide: AbstractTrajectory,
        label: str = "",
        rate: float = 60.0,
        policy: Any = None,
    ) -> "Scene":
        """The scene of a glide.

        Args:
            glide: one glide, simulated with `dense=True`, or a piece of flight, whose clock
                starts at 0.
            label: what to call it.
            rate: frames a second [1/s], up to 1000; the end of the glide is one more frame.
            policy: what steered it, if anything.

        Raises:
            ValueError: the glide kept no trajectory, is a batch, is not finite or lasts no
                time; or the rate is out of range or makes more than 20 000 frames.
        """
        check_viewable(glide)
        body = glide.glider.body
        start = float(glide.start_time)
        sections, moving = _moving(glide, start, _times(float(glide.time) - start, rate))
        nodes = surface_nodes(sections)
        return cls(
            label=as_text(label),
            ended=as_text(glide.ending),
            svl=float(sections.length),
            head_fraction=float(body.head_fraction) if isinstance(body, Snake) else 0.0,
            fraction=np.asarray(sections.fraction)[nodes],
            chord=np.asarray(sections.chord)[nodes],
            target=target_of(policy),
            **(_steered(glide, moving["times"] + start) | moving),
        )

    @property
    def step(self) -> np.ndarray:
        """Distances between nodes along the body [m], (n - 1,)."""
        return np.diff(self.fraction) * self.svl

    def body(self, between: int = 4) -> Stations:
        """Cross-sections of the body, `between` steps from a node to the next."""
        return _loft.body_stations(self.fraction, self.chord, self.svl, between)

    def head(self) -> Stations:
        """Cross-sections of the head; none of a body without one."""
        return _loft.head_stations(self.fraction, self.chord, self.svl, self.head_fraction)

    @property
    def covered(self) -> float:
        """Place over SVL up to which the head is drawn instead of the body."""
        return _loft.covered(self.head_fraction)

    def surface(self, frame: int, part: str = "body", between: int = 4) -> np.ndarray:
        """Points of the body's or the head's surface at a frame [m], (m, p, 3).

        Args:
            frame: index of the time.
            part: "body" or "head".
            between: steps from a node to the next, for the body.
        """
        stations = self.body(between) if part == "body" else self.head()
        outline = _loft.OUTLINE if part == "body" else _loft.HEAD_OUTLINE
        return _loft.loft(stations, outline, *self._at(frame))

    def centreline(self, frame: int) -> np.ndarray:
        """The body's curve at a frame [m], snout to vent, (m, 3)."""
        return _loft.centreline(self.body(), *self._at(frame))

    def _at(self, frame: int):
        return self.nodes[frame], self.chordwise[frame], self.dorsal[frame], self.step


def check_viewable(glide: AbstractTrajectory) -> None:
    """Raise `ValueError` for what has no view."""
    if not isinstance(glide, AbstractTrajectory):
        raise TypeError(f"glides: {type(glide).__name__} is not a Glide")
    if glide.time.ndim:
        raise ValueError(f"glides: a batch of shape {glide.time.shape}; pass single glides")
    if not np.isfinite(np.append(glide.state, glide.time)).all():
        raise ValueError("glides: a glide's state is not finite, there is nothing to show")
    if glide.interpolation is None:
        raise ValueError("glides: a glide kept no trajectory, simulate it with dense=True")
    if not float(glide.time) > float(glide.start_time):
        raise ValueError("glides: a glide ended at its launch, there is nothing to show")


def _times(end: float, rate: float) -> np.ndarray:
    """Times [s], (T,): multiples of 1/rate, and the end."""
    check_range("rate", rate, "frames/s", 0, 1000, low_open=True)
    if end * rate > _MOST_FRAMES:
        raise ValueError(
            f"rate = {rate:g} frames/s makes {end * rate:.0f} frames of this glide: "
            f"at most {_MOST_FRAMES} are shown, choose a lower rate"
        )
    times = np.arange(0, end, 1 / rate)
    if len(times) > 1 and end - times[-1] < 0.01 / rate:
        times = times[:-1]
    return np.append(times, end)


def _moving(
    glide: AbstractTrajectory, start: float, times: np.ndarray
) -> tuple[Any, dict[str, Any]]:
    """The body at its nodes, and the fields of a scene that change in time since a start."""
    padded = np.append(times, np.full(-len(times) % _CHUNK, times[-1])) + start
    padded = np.minimum(padded, float(glide.time))  # the sum may be a rounding later
    chunks = padded.astype(glide.time.dtype).reshape(-1, _CHUNK)
    computed = [_computed(glide, jnp.asarray(chunk)) for chunk in chunks]
    parts = [_fields(*instants) for instants in computed]
    fields = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    fields = {name: field[: len(times)] for name, field in fields.items()}
    return computed[0][0], {"times": times, **fields}


def _steered(glide: AbstractTrajectory, times: np.ndarray) -> dict[str, Any]:
    """The fields of a scene that tell of control."""
    found = histories(glide, np.minimum(times, float(glide.time)))
    none = np.zeros((len(times), 0))
    return {
        "steered": tuple(Steered(one.meaning.split(",")[0], one.unit) for one in found),
        "inputs": np.stack([one.position for one in found], axis=1) if found else none,
        "told": np.stack([one.told for one in found], axis=1) if found else none,
    }


@eqx.filter_jit
def _computed(glide: AbstractTrajectory, times):
    """Sections, states and elements in one compilation, which the first view waits for."""
    sections = discretise(glide.glider.body)
    flight = Flight(glide.glider, sections, glide.phase)
    states = glide.at(times)
    now = jax.vmap(lambda time, state: elements(time, state, flight))(times, states)
    air = now.aerodynamics
    return sections, states, now.R_BI, now.body, now.air_velocity, air.force, air.drag


def _fields(sections, states, R_BI, body, air_velocity, force, drag) -> dict[str, np.ndarray]:
    states, to_inertial = map(np.asarray, (states, R_BI))
    nodes = surface_nodes(sections)
    length = (np.asarray(sections.area) / np.asarray(sections.chord))[nodes]  # of elements [m]

    def inertial(vectors):
        return np.einsum("tji,tjn->tni", to_inertial, vectors)

    position, velocity, chordwise, dorsal, force = (
        np.asarray(v)[:, :, nodes]
        for v in (body.position, air_velocity, body.chord, body.normal, force)
    )
    along_c = np.sum(velocity * chordwise, axis=1, keepdims=True)
    along_b = np.sum(velocity * dorsal, axis=1, keepdims=True)
    normal = along_c * chordwise + along_b * dorsal  # the velocity that makes force
    speed = np.maximum(np.hypot(along_c, along_b), 1e-12)
    drag = -np.asarray(drag)[:, None, nodes] * normal / speed
    return {
        "centre": states[:, POSITION],
        "velocity": states[:, VELOCITY],
        "axes": to_inertial,
        "angles": np.rad2deg(states[:, ANGLES]),
        "nodes": inertial(position) + states[:, None, POSITION],
        "chordwise": inertial(chordwise),
        "dorsal": inertial(dorsal),
        "lift": inertial((force - drag) / length),
        "drag": inertial(drag / length),
    }


def scenes_of(
    glides: Flights,
    labels: Sequence[str] | None,
    rate: float,
    policies: Sequence[Any] | None = None,
) -> list[Scene]:
    """Scenes of one glide or of several, checked and named.

    Raises:
        ValueError: no glides, not one label or policy a glide, or as `Scene.of`.
    """
    several = [glides] if isinstance(glides, AbstractTrajectory) else list(glides)
    if not several:
        raise ValueError("glides is empty: pass a glide or several")
    for glide in several:
        check_viewable(glide)
    if isinstance(labels, str):
        raise ValueError(f"labels = {labels!r} must be a list, one label a glide")
    if labels is None:
        names = [f"glide {i + 1}" for i in range(len(several))] if several[1:] else ["glide"]
    else:
        names = [as_text(label) for label in labels]
    if len(names) != len(several):
        raise ValueError(f"labels has {len(names)} for {len(several)} glides: one a glide")
    steering = [None] * len(several) if policies is None else list(policies)
    if len(steering) != len(several):
        raise ValueError(f"policies has {len(steering)} for {len(several)} glides: one a glide")
    each = zip(several, names, steering, strict=True)
    return [Scene.of(glide, name, rate, policy) for glide, name, policy in each]


def scale_of(scenes: Sequence[Scene], force_scale: float | None = None) -> float:
    """Height of a force sheet for its force per length [m per N/m]: 1, 2 or 5 times 10^k.

    Args:
        scenes: what is shown.
        force_scale: the same, chosen by hand; by default the tallest sheets are about a
            third of the body's length.

    Raises:
        ValueError: `force_scale` is not positive.
    """
    if force_scale is not None:
        check_range("force_scale", force_scale, "m per N/m", 0, 1e6, low_open=True)
        return float(force_scale)
    forces = np.concatenate([np.ravel(f) for s in scenes for f in _sizes(s)])
    most = float(np.quantile(forces, 0.99))
    if most <= 0:
        return 1.0
    ideal = _SHEET * max(s.svl for s in scenes) / most
    ten = 10.0 ** np.floor(np.log10(ideal))
    return float(max(ten * step for step in (1, 2, 5) if ten * step <= ideal * (1 + 1e-9)))


def _sizes(scene: Scene):
    return np.linalg.norm(scene.lift, axis=2), np.linalg.norm(scene.drag, axis=2)


def as_text(text) -> str:
    """The text, with halves of characters that stand alone, which no file holds, replaced."""
    return str(text).encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def title_of(glides: Flights, title: str | None) -> str:
    """The title given, or one that says from where the glides start."""
    if title is not None:
        return as_text(title)
    several = [glides] if isinstance(glides, AbstractTrajectory) else list(glides)
    heights = sorted({f"{_height(glide):g} m" for glide in several})
    words = "A glide" if len(several) == 1 else f"{len(several)} glides"
    return f"{words} from {' and '.join(heights)}"


def _height(glide: AbstractTrajectory) -> float:
    """From where it starts [m]."""
    if isinstance(glide, Glide):
        return float(glide.launch.height)
    return round(float(glide.start[2]), 2)
