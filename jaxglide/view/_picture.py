"""A scene drawn with Matplotlib, one instant at a time."""

from collections.abc import Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from ..plot import style
from ..plot._labels import plain
from ._loft import HEAD_OUTLINE, OUTLINE
from .scene import COLOURS, Scene

FORCES = {"lift": "#0072b2", "drag": "#e69f00"}
_BACK = np.array([to_rgb("#3f9a45"), to_rgb("#246b34")])
_BELLY = np.array([to_rgb("#d3dd5a"), to_rgb("#c2cf46")])
_BAND = 0.045  # of SVL, from one dark band to the next
_AXES = (("right", "#b3366b"), ("forward", "#33404d"), ("up", "#0b7a75"))
_SUN = np.array([-0.35, -0.45, 0.82])
_SKY, _GROUND = "#cfe2ef", "#e2e5d4"
_GAP = 1.15  # between glides side by side, in SVL


class Picture:
    """A figure of 9.6 by 5.4 inches: the bodies in space, the path, the angles, the height.

    Args:
        scenes: what to draw, on one clock: frame i of each is at the same time.
        title: heading.
        scale: height of a force sheet for its force per length [m per N/m].
    """

    @style()
    def __init__(self, scenes: Sequence[Scene], title: str, scale: float):
        self.scenes, self.scale = scenes, scale
        self.svl = max(scene.svl for scene in scenes)
        self.figure = Figure(figsize=(9.6, 5.4), dpi=100, facecolor="white")
        place = (0.0, 0.0, 0.66, 1.0)
        self.space = cast(Axes3D, self.figure.add_axes(place, projection="3d"))
        self.figure.text(0.015, 0.955, plain(title), fontsize=13, weight="bold", va="center")
        self.clock = self.figure.text(0.645, 0.955, "", fontsize=13, va="center", ha="right")
        self._prepare_space()
        self.cursors, self.dots = [], []
        self._prepare_charts()
        self._key()
        self.moving: list = []

    def _prepare_space(self) -> None:
        _draw_backdrop(self.figure)
        self.space.patch.set_alpha(0.0)
        self.space.set_axis_off()
        self.space.set_proj_type("persp", focal_length=1.0)
        self.space.view_init(elev=34, azim=-52)
        self.space.set_box_aspect((1, 1, 1), zoom=1.38)  # type: ignore

    def _prepare_charts(self) -> None:
        end = max(scene.times[-1] for scene in self.scenes)
        for row, name in enumerate(("yaw (°)", "pitch (°)", "roll (°)", "height (m)")):
            ax = self.figure.add_axes((0.725, 0.765 - 0.228 * row, 0.26, 0.165))
            for scene, colour in zip(self.scenes, COLOURS * 9, strict=False):
                ax.plot(scene.times, _curve(scene, row), color=colour, lw=1.4)
            ax.set_title(name, loc="left", fontsize=8.5, pad=3)
            ax.set_xlim(0.0, end)
            _room(ax, row)
            ax.grid(color="0.9", lw=0.6)
            ax.tick_params(labelbottom=row == 3, length=0, labelsize=7.5)
            self.cursors.append(ax.axvline(0.0, color="#22303a", lw=1.0))
            dots = [ax.plot([], [], "o", ms=4, color=c)[0] for c in COLOURS[: self.count]]
            self.dots.append(dots)
        ax.set_xlabel("time (s)", fontsize=8)

    @property
    def count(self) -> int:
        return min(len(self.scenes), len(COLOURS))

    def _key(self) -> None:
        length = f"{100 * self.scale:.3g} cm" if self.scale < 1 else f"{self.scale:.3g} m"
        keys: list = [
            Patch(color=colour, alpha=0.6, label=f"{name} per length of body")
            for name, colour in FORCES.items()
        ]
        keys.append(Line2D([], [], ls="", label=f"{length} of sheet = 1 N/m"))
        if len(self.scenes) > 1:
            keys += [
                Line2D([], [], color=colour, lw=2, label=plain(scene.label))
                for scene, colour in zip(self.scenes, COLOURS, strict=False)
            ]
        place = {"loc": "lower left", "bbox_to_anchor": (0.005, 0.01)}
        self.figure.legend(handles=keys, fontsize=8.5, **place)

    @style()
    def draw(self, frame: int) -> None:
        """Set the figure to a frame; a glide that has ended stays at its end."""
        for artist in self.moving:
            artist.remove()
        self.moving = []
        frames = [min(frame, len(scene.times) - 1) for scene in self.scenes]
        now = max(s.times[i] for s, i in zip(self.scenes, frames, strict=True))
        self.clock.set_text(f"{now:.2f} s")
        centres = []
        for index, (scene, i) in enumerate(zip(self.scenes, frames, strict=True)):
            shift = self._shift(index)
            centres.append(scene.centre[i] + shift)
            self._draw_glide(scene, i, shift, COLOURS[index % len(COLOURS)])
            for row in range(4):
                value = _curve(scene, row)[i]
                if index < self.count:
                    self.dots[row][index].set_data([scene.times[i]], [value])
        middle = np.mean(centres, axis=0)
        apart = float(np.linalg.norm(centres - middle, axis=1).max())
        half = 0.33 * self.svl + 0.6 * apart
        for axis, x in zip("xyz", middle, strict=True):
            getattr(self.space, f"set_{axis}lim")(x - half, x + half)
        for cursor in self.cursors:
            cursor.set_xdata([now, now])

    def _shift(self, index: int) -> np.ndarray:
        return np.array([(index - (len(self.scenes) - 1) / 2) * _GAP * self.svl, 0.0, 0.0])

    def _draw_glide(self, scene: Scene, i: int, shift, colour) -> None:
        polygons, paints = _body(scene, i)
        for name, paint in FORCES.items():
            sheet = _sheet(scene, i, name, self.scale)
            polygons += list(sheet)
            paints += [(*to_rgb(paint), 0.34)] * len(sheet)
        # Faces of the body have edges of their own colour, or the sky shines through.
        edges = [paint if paint[3] == 1 else (0, 0, 0, 0) for paint in paints]
        moved = [polygon + shift for polygon in polygons]
        self._add(Poly3DCollection(moved, facecolors=paints, edgecolors=edges, lw=0.4))
        for name, paint in FORCES.items():
            tips = scene.nodes[i] + self.scale * getattr(scene, name)[i] + shift
            self._line(tips, paint, 1.0)
        path = scene.centre + shift
        near = np.linalg.norm(path - path[i], axis=1) < 1.2 * scene.svl
        self._line(path[near & (np.arange(len(path)) >= i)], colour, 0.8, alpha=0.4)
        self._line(path[near & (np.arange(len(path)) <= i)], colour, 1.8)
        self._draw_axes(path[i], scene.axes[i], 0.3 * scene.svl)

    def _draw_axes(self, centre, axes, size: float) -> None:
        ends = [(centre, centre + size * axis) for axis in axes]
        colours = [colour for _, colour in _AXES]
        self._add(Line3DCollection(ends, colors=colours, linewidths=1.8))
        for (name, colour), axis in zip(_AXES, axes, strict=True):
            where = centre + 1.12 * size * axis
            look = {"color": colour, "fontsize": 9, "ha": "center"}
            x, y, z = where
            self.moving.append(self.space.text(x, y, z, name, **look))

    def _line(self, points, colour, width: float, alpha: float = 1.0) -> None:
        line = Line3DCollection([points], colors=colour, linewidths=width, alpha=alpha)
        self._add(line)

    def _add(self, collection) -> None:
        self.moving.append(self.space.add_collection3d(collection, autolim=False))


def _draw_backdrop(figure: Figure) -> None:
    """A sky over a ground, behind the space."""
    ax = figure.add_axes((0.0, 0.0, 0.66, 1.0), zorder=-1)
    ax.set_axis_off()
    fade = np.linspace(0, 1, 64)[:, None, None] ** 1.5
    colours = (1 - fade) * to_rgb(_SKY) + fade * to_rgb(_GROUND)
    ax.imshow(colours, aspect="auto", interpolation="bilinear")


def _curve(scene: Scene, row: int) -> np.ndarray:
    return scene.angles[:, row] if row < 3 else scene.centre[:, 2]


def _room(ax: Axes, row: int) -> None:
    """Limits that blow up no small angle, and the ground for the height."""
    low, high = ax.get_ylim()
    more = max(0.0, 20 - (high - low)) / 2
    ax.set_ylim((low - more, high + more) if row < 3 else (0.0, high))


def _body(scene: Scene, i: int) -> tuple[list[np.ndarray], list]:
    """Faces of body and head, and their colours in the light of the sun."""
    polygons, paints = [], []
    parts = (("body", scene.body(2), OUTLINE), ("head", scene.head(), HEAD_OUTLINE))
    for part, stations, outline in parts:
        points = scene.surface(i, part, between=2)
        kept = stations.fraction[:-1] >= (scene.covered if part == "body" else -1.0)
        around = np.arange(len(outline))
        following = np.roll(around, -1)
        same = outline[around, 2] == outline[following, 2]
        a, b = around[same], following[same]
        quads = np.stack(
            [points[:-1][:, a], points[1:][:, a], points[1:][:, b], points[:-1][:, b]], axis=2
        )[kept]
        wave = 0.5 + 0.5 * np.cos(2 * np.pi * stations.fraction[:-1][kept] / _BAND)
        wave = np.full_like(wave, 0.3) if part == "head" else wave**2
        belly = outline[a, 2][None, :, None]
        tint = wave[:, None, None]
        colour = belly * ((1 - tint) * _BELLY[0] + tint * _BELLY[1])
        colour = colour + (1 - belly) * ((1 - tint) * _BACK[0] + tint * _BACK[1])
        quads, colour = quads.reshape(-1, 4, 3), colour.reshape(-1, 3)
        polygons += list(quads)
        paints += list(np.clip(colour * _light(quads)[:, None], 0, 1))
    return polygons, [(*paint, 1.0) for paint in paints]


def _light(quads: np.ndarray) -> np.ndarray:
    """Brightness of faces, (f,)."""
    normal = np.cross(quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1])
    size = np.maximum(np.linalg.norm(normal, axis=1), 1e-15)
    return 0.8 - 0.35 * normal @ _SUN / size


def _sheet(scene: Scene, i: int, name: str, scale: float) -> np.ndarray:
    """Faces of a force sheet, (n - 1, 4, 3)."""
    foot = scene.nodes[i]
    tip = foot + scale * getattr(scene, name)[i]
    return np.stack([foot[:-1], tip[:-1], tip[1:], foot[1:]], axis=1)
