"""Text from outside, such as names in a file, is drawn as it stands."""

import io
import warnings
from dataclasses import replace
from html import unescape

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from jaxglide.control import Target
from jaxglide.plot import every_flight, heatmap, region_outlines, style
from jaxglide.plot._labels import plain
from jaxglide.plot._style import new_axes
from jaxglide.view._picture import Picture
from jaxglide.view.scene import Scene
from made_flights import paths_of

matplotlib.use("agg")

HOSTILE = {
    r"$\frac{$": r"$\frac{$",
    "$a_1$ and $b": "$a_1$ and $b",
    r"\$5, \textbf{x}": r"\$5, \textbf{x}",
    "_hidden": "_hidden",
    "snake \U0001f40d": "snake U+1F40D",
    "lone \ud800": "lone U+D800",
    "two\nlines\t\x07": "two lines U+0007",
    "<b>&amp;": "<b>&amp;",
    "long " * 99: ("long " * 99)[:59] + "…",
}


def drawn(figure: Figure) -> str:
    """All words of a figure, as an SVG file holds them; warnings are errors."""
    memory = io.BytesIO()
    with style(), warnings.catch_warnings():
        warnings.simplefilter("error")
        figure.savefig(memory, format="svg")
    return " ".join(unescape(memory.getvalue().decode()).split())


@pytest.fixture(params=HOSTILE, ids=range(len(HOSTILE)))
def text(request):
    return request.param


def test_names_of_flights(text):
    flown = paths_of(turn_back=False)
    flown = flown.assign_coords(trial=[text, "202"], snake=("trial", [text, text]))
    said = HOSTILE[text]
    assert f"{said} (snake {said})<" in drawn(every_flight(flown))


def test_attributes_and_names_of_a_dataset(text):
    about = {"long_name": text, "units": text}
    data = xr.Dataset(
        {"v": (("p", text), np.arange(6.0).reshape(2, 3), about)},
        coords={"p": ("p", [0.0, 1.0], about)},
    )
    svg, said = drawn(heatmap(data, "v", text, "p").figure), HOSTILE[text]
    assert said in svg  # the axis that has no coordinate
    name = HOSTILE[text] if "_" not in text else HOSTILE[text].replace("_", " ").strip()
    assert svg.replace("( ", "(").count(f">{name} ({said})<") == 2


def test_flags(text):
    flags = {"flag_meanings": "_".join(text.split()) + " other"}
    data = xr.Dataset({"v": (("y", "x"), [[0, 1], [1, 0]], flags)})
    svg = drawn(heatmap(data, "v", "x", "y").figure)
    assert f">{HOSTILE[text].replace('_', ' ').strip()}<" in svg.replace("> ", ">")


def test_regions(text):
    shape = {"theta_m": [80.0, 90.0], "nu_theta": [1.0, 1.5]}
    names = (tuple(shape), [[text, text], ["b", "b"]])
    ax = new_axes()
    ax.set(xlim=(0.5, 2.0), ylim=(70.0, 100.0))
    region_outlines(ax, xr.Dataset({"region": names}, coords=shape))
    for name in ax.texts:
        name.set_path_effects([])  # their halo would draw them as curves
    assert f">{HOSTILE[text]}<" in drawn(ax.figure).replace("> ", ">")


@pytest.fixture(scope="module")
def scene():
    """Two frames of a straight body of four nodes."""
    frames, nodes = np.zeros((2, 3)), np.zeros((2, 4, 3))
    along = {"fraction": np.linspace(0, 1, 4), "chord": np.full(4, 0.03)}
    flight = {"times": np.array([0.0, 1.0]), "centre": frames, "velocity": frames}
    turns = {"axes": np.tile(np.eye(3), (2, 1, 1)), "angles": frames}
    body = dict.fromkeys(("nodes", "chordwise", "dorsal", "lift", "drag"), nodes)
    none = np.zeros((2, 0))
    told = {"steered": (), "inputs": none, "told": none, "target": Target()}
    return Scene("", "landed", 0.7, 0.05, **flight, **turns, **along, **body, **told)


def test_titles_and_labels_of_the_view(text, scene):
    picture = Picture([replace(scene, label=text), scene], title=text, scale=0.01)
    svg = drawn(picture.figure)
    assert svg.replace("> ", ">").count(f">{HOSTILE[text]}<") == 2


def test_what_needs_no_change_is_not_changed():
    for said in ("81", "A (2)", "θ_m, 20 °/s: ψ", "a-b", "😀"):
        assert plain(said) == said


def test_a_user_of_tex_gets_the_same_words():
    with matplotlib.rc_context({"text.usetex": True}):
        flown = paths_of(turn_back=False).assign_coords(trial=["a_b#%", "202"])
        figure = every_flight(flown)
    assert ">a_b#% (snake A)<" in drawn(figure)
