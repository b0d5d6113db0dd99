"""One HTML file that plays glides and needs nothing else.

The page's scripts, the viewer library and the numbers are packed into it as text; the page
unpacks them and forbids itself the network.
"""

import base64
import gzip
import hashlib
import html
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from .._lib.writing import write_text
from . import _loft
from .scene import COLOURS, Flights, Scene, scale_of, scenes_of, title_of

# In the order of their imports: each needs only those before it.
_MODULES = (
    "vendor/three/three.core.js",
    "vendor/three/three.module.js",
    "vendor/three/OrbitControls.js",
    "vendor/three/LineSegmentsGeometry.js",
    "vendor/three/LineMaterial.js",
    "vendor/three/LineSegments2.js",
    "vendor/three/LineGeometry.js",
    "vendor/three/Line2.js",
    "vendor/uplot/uPlot.esm.js",
    "page/data.js",
    "page/labels.js",
    "page/surroundings.js",
    "page/snake.js",
    "page/stage.js",
    "page/charts.js",
    "page/page.js",
)
# What moves, each T times so many numbers; the page reads them in this order.
_FIELDS = (
    *("times", "centre", "velocity", "axes", "angles"),
    *("nodes", "chordwise", "dorsal", "lift", "drag", "inputs", "told"),
)


@dataclass(frozen=True)
class Page:
    """A view: one HTML document. In a notebook it shows itself.

    Attributes:
        html: the document.
        title: its title.
    """

    html: str
    title: str

    def save(self, path: str | Path) -> Path:
        """Write the document to `path` and return it."""
        path = Path(path)
        write_text(path, self.html)
        return path

    def _repr_html_(self) -> str:
        """The document in a frame, for a notebook's output cell."""
        return (
            f'<iframe title="{html.escape(self.title)}" srcdoc="{html.escape(self.html)}" '
            'width="100%" height="640" style="border:0" allow="fullscreen"></iframe>'
        )

    def __repr__(self) -> str:
        return f"Page({self.title!r}, {len(self.html) / 1e6:.2f} MB)"


def view(
    glides: Flights,
    path: str | Path | None = None,
    *,
    labels: Sequence[str] | None = None,
    title: str | None = None,
    rate: float = 60.0,
    force_scale: float | None = None,
    policies: Sequence[Any] | None = None,
) -> Page:
    """An interactive view of one glide, or of several on one clock, as one HTML file.

    It plays, pauses and scrubs; the camera follows or stays; forces, path, axes and labels
    can be hidden; yaw, pitch, roll and height run beside it, and of a flight under control
    (see `retrace`) the inputs that were told and reached. It needs no network.

    Args:
        glides: a glide, or several, simulated with `dense=True`; or pieces of flight, such as
            `SteadyGlide.fly` gives.
        path: where to write the file; by default nowhere.
        labels: what to call the glides, one each.
        title: heading of the page.
        rate: frames a second of flight [1/s]; the page draws between them.
        force_scale: height of a force sheet for its force per length of body [m per N/m],
            chosen to suit by default.
        policies: what steered the glides, one each: headings are drawn beside the yaw,
            points stand on the ground.

    Returns:
        The page: `page.html`, `page.save(path)`; it shows itself in a notebook.

    Raises:
        ValueError: a glide kept no trajectory, is a batch, is not finite or has no duration;
            not one label or policy a glide; rate or force_scale out of range.
        OSError: the file cannot be written.
    """
    scenes = scenes_of(glides, labels, rate, policies)
    scale = scale_of(scenes, force_scale)
    page = Page(_document(scenes, title_of(glides, title), scale), title_of(glides, title))
    if path is not None:
        write_text(path, page.html)
    return page


def script_json(value) -> str:
    """JSON that is safe inside a script element: no tag, entity or line end can begin in it."""
    text = json.dumps(value, ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode()


def _read(name: str) -> str:
    return files("jaxglide.view").joinpath(*name.split("/")).read_text(encoding="utf-8")


@cache
def _modules() -> str:
    """The page's scripts and the libraries they use, as elements that do not run."""
    elements = []
    for name in _MODULES:
        kind = f'type="text/plain" class="module" data-name="{Path(name).name}"'
        elements.append(f"<script {kind}>{_packed(_read(name).encode())}</script>")
    return "\n".join(elements)


def _outline(outline: np.ndarray) -> dict:
    return {"points": outline[:, :2].tolist(), "belly": outline[:, 2].astype(int).tolist()}


def _stations(stations: _loft.Stations) -> dict:
    return {name: np.round(values, 7).tolist() for name, values in stations._asdict().items()}


def _described(scene: Scene, colour: str) -> dict:
    """What the page must know of a glide besides the numbers that move."""
    heading, points = scene.target
    return {
        "label": scene.label,
        "ended": scene.ended,
        "colour": colour,
        "frames": len(scene.times),
        "nodes": len(scene.fraction),
        "svl": scene.svl,
        "step": scene.step.tolist(),
        "covered": scene.covered,
        "body": _stations(scene.body()),
        "head": _stations(scene.head()),
        "steered": [one._asdict() for one in scene.steered],
        "heading": None if heading is None else float(np.rad2deg(heading)),
        "points": [] if points is None else np.asarray(points, float).tolist(),
    }


def _document(scenes: list[Scene], title: str, scale: float) -> str:
    """The whole page."""
    about = {
        "title": title,
        "forceScale": scale,
        "outlines": {
            "body": _outline(_loft.OUTLINE),
            "head": _outline(_loft.HEAD_OUTLINE),
        },
        "glides": [
            _described(scene, COLOURS[i % len(COLOURS)]) for i, scene in enumerate(scenes)
        ],
    }
    fields = [np.ravel(getattr(scene, name)) for scene in scenes for name in _FIELDS]
    style = f"{_read('vendor/uplot/uPlot.min.css')}\n{_read('page/page.css')}"
    boot = _read("page/boot.js")
    parts = {
        "title": html.escape(title),
        "policy": _policy(style, boot),
        "style": style,
        "boot": boot,
        "about": script_json(about),
        "data": _packed(np.concatenate(fields).astype("<f4").tobytes()),
        "modules": _modules(),
    }
    # One pass: what is put in is never searched for further places.
    return re.sub(r"\{\{(\w+)\}\}", lambda place: parts[place[1]], _read("page/page.html"))


def _policy(style: str, boot: str) -> str:
    """Content security policy: this style and this script, and nothing from anywhere."""

    def digest(text: str) -> str:
        return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    return (
        f"default-src 'none'; script-src {digest(boot)} blob:; style-src {digest(style)}; "
        "img-src data: blob:; connect-src 'none'; frame-src 'none'; worker-src 'none'; "
        "object-src 'none'; base-uri 'none'; form-action 'none'; webrtc 'block'; "
        "require-trusted-types-for 'script'; trusted-types 'none'"
    )
