"""Pictures of the body in its own axes (the paper's figures 2 a-b and 5 a)."""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from .._lib.checks import check_choice, check_range
from ..body.sections import AbstractBody, discretise, surface_nodes
from ..body.snake import Snake
from ..shape.gait import Gait
from ..shape.kinematics import backbone
from ..shape.motion import AbstractMotion, at_rest
from ._labels import degrees
from ._style import HEAD, INK, new_axes, new_figure, style, zero_line
from .waves import bending_waves

# Dark above and light below: distinct without colour, too.
DORSAL, VENTRAL = "#00755A", "#F0E442"
_HEAD = {"ls": "", "marker": "o", "ms": 3.2, "mew": 0.0, "color": HEAD, "zorder": 5}


class View(NamedTuple):
    """From where the body is seen: rows of a frame [across, up, towards the viewer]."""

    frame: np.ndarray
    across: str
    up: str


_VIEWS = {
    "top": View(np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1.0]]), "forward, y", "right, x"),
    "side": View(np.array([[0, 1, 0], [0, 0, 1], [1.0, 0, 0]]), "forward, y", "up, z"),
    "rear": View(np.array([[1, 0, 0], [0, 0, 1], [0, -1.0, 0]]), "right, x", "up, z"),
}


@eqx.filter_jit
def _placed(gait: AbstractMotion, body: AbstractBody, phase):
    sections = discretise(body)
    along = sections.fraction, sections.neck_fraction
    now, own = jnp.zeros_like(phase), gait.start(phase)
    wave, _ = gait.bending(*along, now, phase, own, at_rest())
    bent = backbone(sections, wave)
    return sections, bent.position, 0.5 * sections.chord * bent.chord, bent.normal


def ribbon(
    gait: AbstractMotion, snake: AbstractBody, phase: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The flattened body at a launch phase of its motion, in body axes.

    Args:
        gait, snake: the body.
        phase: of the horizontal wave [rad].

    Returns:
        Nodes of the backbone and half the chord there [cm], and the unit normal out of
        the back, each (3, n).
    """
    sections, *placed = _placed(gait, snake, jnp.asarray(phase, float))
    nodes = surface_nodes(sections)
    position, half, normal = (np.asarray(v)[:, nodes] for v in placed)
    return 100.0 * position, 100.0 * half, normal


@style()
def body_view(
    gait: AbstractMotion,
    snake: AbstractBody | None = None,
    ax: Axes | None = None,
    *,
    view: str = "top",
    phase: float = 0.0,
) -> Axes:
    """The body from above, from the right or from behind, flattened as it flies.

    Args:
        gait: its shape; of a motion that changes, as it starts.
        snake: its size; by default a snake with a snout-vent length of 70 cm.
        ax: axes to draw on; by default new ones, alone in a figure (`ax.figure`).
        view: "top", "side" or "rear".
        phase: of the horizontal wave [rad].

    Returns:
        The axes, to scale, in cm from the centre of mass; seen from above and from the side
        the head (disc) is to the right. One polygon for each pair of neighbouring nodes,
        its ends their chords: dark where the back is seen, light where the belly is.

    Raises:
        ValueError: another view, or a phase that is not finite.
    """
    check_choice("view", view, tuple(_VIEWS))
    check_range("phase", phase, "rad")
    ax = new_axes(height=60.0) if ax is None else ax
    frame, across, up = _VIEWS[view]
    snake = Snake.from_svl() if snake is None else snake
    position, half, normal = (frame @ part for part in ribbon(gait, snake, phase))
    left, right = position - half, position + half
    corners = np.stack([left[:, :-1], right[:, :-1], right[:, 1:], left[:, 1:]])  # (4, 3, n-1)
    order = np.argsort(corners[:, 2].mean(axis=0))  # the nearest is drawn last
    seen = (normal[2, :-1] + normal[2, 1:])[order] > 0
    polygons = corners[:, :2, order].transpose(2, 0, 1)
    look = {"edgecolors": INK, "linewidths": 0.25, "zorder": 3, "label": "body"}
    ax.add_collection(
        PolyCollection(list(polygons), facecolors=np.where(seen, DORSAL, VENTRAL), **look)
    )
    ax.plot(*position[:2, 0], label="head", **_HEAD)
    ax.set_aspect("equal")
    ax.margins(0.05)
    ax.autoscale_view()
    ax.set_xlabel(f"{across} (cm)")
    ax.set_ylabel(f"{up} (cm)")
    if view == "top" and not ax.yaxis_inverted():
        ax.invert_yaxis()  # seen from above, right is to the right of forward
    return ax


def _keys() -> list:
    look = {"edgecolor": INK, "linewidth": 0.4}
    return [
        Patch(facecolor=DORSAL, label="back", **look),
        Patch(facecolor=VENTRAL, label="belly", **look),
        Line2D([], [], label="head", **_HEAD),
    ]


@style()
def body_shape(
    gait: AbstractMotion, snake: AbstractBody | None = None, *, phase: float = 0.0
) -> Figure:
    """A gait at one phase: its waves of bending, and the body from above and the side (2 a, b).

    Args:
        gait, snake, phase: as in `body_view`.

    Returns:
        A figure of one column's width (90 mm): `bending_waves` above, `body_view` from
        above and from the side below it, at one scale.

    Raises:
        ValueError: a phase that is not finite.
    """
    figure = new_figure(height=134.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(3, 1)
    bending_waves(gait, snake, axes[0], phases=[phase])
    for ax, view in zip(axes[1:], ("top", "side"), strict=True):
        body_view(gait, snake, ax, view=view, phase=phase)
    _one_scale(axes[1:])
    heights = [float(np.ptp(ax.get_ylim())) for ax in axes[1:]]
    axes[0].get_gridspec().set_height_ratios([0.5 * sum(heights), *heights])
    axes[1].set_xlabel("")
    figure.legend(handles=_keys(), loc="outside lower center", ncols=3, handlelength=1.2)
    return figure


def _one_scale(axes: Sequence[Axes]) -> None:
    """The same limits across, so that all are drawn at one scale."""
    reach = max(max(np.abs(ax.get_xlim())) for ax in axes)
    for ax in axes:
        ax.set_xlim(-reach, reach)


@style()
def bent_bodies(
    gait: AbstractMotion,
    snake: AbstractBody | None = None,
    *,
    bends: Sequence[float] = (-20.0, -10.0, 0.0, 10.0, 20.0),
    phase: float = 0.0,
) -> Figure:
    """One gait at several dorsoventral bends, from the right and from behind (5a).

    Args:
        gait, snake, phase: as in `body_view`; the gait's own bend is not used.
        bends: d_psi [deg per SVL], (B,).

    Returns:
        A figure of one column's width (90 mm), a row for each bend: `body_view` from the
        side (left) and from the rear (right), all at one scale.

    Raises:
        ValueError: no bend, one that is not allowed, or a motion that is no `Gait`.
    """
    if not isinstance(gait, Gait):
        raise ValueError(f"{type(gait).__name__} has no bend d_psi to draw: a Gait has one")
    if not len(bends):
        raise ValueError("there is nothing to draw: give a bend")
    check_range("bends", bends, "deg", -180, 180)
    figure = new_figure(height=17.0 + 24.5 * len(bends))
    figure.set_layout_engine("constrained")
    axes = figure.subplots(len(bends), 2, sharex=True, sharey=True, squeeze=False)
    for (side, rear), bend in zip(axes, bends, strict=True):
        bent = eqx.tree_at(lambda g: g.d_psi, gait, jnp.deg2rad(jnp.asarray(bend, float)))
        for ax, view in ((side, "side"), (rear, "rear")):
            body_view(bent, snake, ax, view=view, phase=phase)
            zero_line(ax)
            ax.set(xlabel="", ylabel="")
        said = rf"$d_\psi$ = {degrees(bend)}"
        side.text(1.0, 1.0, said, transform=side.transAxes, va="top", ha="right")
    _one_scale(list(axes.ravel()))
    axes[-1, 0].set_xlabel("forward, y (cm)")
    axes[-1, 1].set_xlabel("right, x (cm)")
    axes[len(bends) // 2, 0].set_ylabel("up, z (cm)")
    figure.legend(handles=_keys(), loc="outside lower center", ncols=3, handlelength=1.2)
    return figure
