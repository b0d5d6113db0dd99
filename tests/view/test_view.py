"""Views: the geometry is the model's, the page is one safe file, mistakes are named."""

import base64
import functools
import gzip
import hashlib
import html
import json
import re
import tomllib
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise

import diffrax
import equinox as eqx
import numpy as np
import pytest
from made_steady import made_steady
from PIL import Image

from jaxglide import Gait, Glider, Launch, Outcome, Snake, cli, reconstruct, simulate
from jaxglide.steady.repeat import repeated
from jaxglide.view import Page, Scene, animate, still, view
from jaxglide.view._picture import Picture
from jaxglide.view.scene import scale_of, title_of
from places import ROOT

NODES, SVL, RATE = 70, 0.7, 60
EVIL = "</script><script>window.bad=1</script>\"'><img src=x onerror=bad()>&amp;\u2028{{data}}"


def fly(f_theta=1.2, height=3.0):
    """A glide, its launch given in full: one compilation serves all."""
    glider = Glider(Snake.from_svl(SVL, nodes=NODES), Gait.from_degrees(f_theta=f_theta))
    launch = Launch(height, 1.75, phi_theta=0.0, angles=np.deg2rad((0.0, -5.0, -5.0)))
    return simulate(glider, launch, dense=True)


@pytest.fixture(scope="module")
def glide():
    glide = fly()
    assert glide.outcome == Outcome.LANDED
    return glide


@pytest.fixture(scope="module")
def scene(glide):
    return Scene.of(glide, "one", RATE)


@pytest.fixture(scope="module")
def page(glide):
    return view(glide)


def three(scene):
    """Indices of three frames: launch, middle, end."""
    return [0, len(scene.times) // 2, len(scene.times) - 1]


# Geometry


def test_frames_run_from_launch_to_the_end(scene, glide):
    assert scene.times[0] == 0
    assert scene.times[-1] == float(glide.time)
    assert np.allclose(scene.times[:-1], np.arange(len(scene.times) - 1) / RATE)
    assert 0 < scene.times[-1] - scene.times[-2] <= 1.02 / RATE
    assert np.allclose(scene.centre[0], [0, 0, 3])
    assert np.allclose(scene.centre[-1], glide.landing_point, atol=1e-6)
    assert np.allclose(scene.velocity[-1], glide.velocity, atol=1e-5)
    assert np.allclose(scene.angles[0], [0, -5, -5])
    assert np.allclose(scene.angles[-1], np.rad2deg(glide.end_angles), atol=1e-4)
    assert scene.ended == "landed"


def test_a_piece_of_flight_is_seen_from_its_start():
    """Five whole cycles later it looks the same."""
    flown = repeated(made_steady(), 2)
    later = 5 * made_steady().period
    path = diffrax.LinearInterpolation(flown.interpolation.ts + later, flown.interpolation.ys)
    times = {"start_time": flown.start_time + later, "time": flown.time + later}
    one, other = Scene.of(flown), Scene.of(replace(flown, interpolation=path, **times))
    assert other.times[0] == 0
    np.testing.assert_allclose(other.times, one.times, atol=1e-12)
    for name in ("centre", "nodes", "lift", "drag"):
        found, wanted = getattr(other, name), getattr(one, name)
        np.testing.assert_allclose(found, wanted, atol=1e-9, err_msg=name)
    assert np.ptp(one.nodes[:, :, 1]) > 10
    assert title_of([flown, replace(flown, start=flown.start.at[2].set(7.25))], None) == (
        "2 glides from 0 m and 7.25 m"
    )


def test_body_is_as_long_as_the_snake(scene):
    for frame in three(scene):
        line = scene.centreline(frame)
        length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
        # The trapezoid rule of the published nodes cuts corners by 0.3 %.
        assert length == pytest.approx(SVL, rel=4e-3)
        assert np.allclose(line[0], scene.surface(frame)[0])  # the snout is a point
        assert np.allclose(line[-1], scene.surface(frame)[-1])


@pytest.fixture(scope="module")
def elements(scene, glide):
    """The model's elements at the three frames, repeated to as many as a view asks for."""
    return reconstruct(glide, np.resize(scene.times[three(scene)], 64))


def test_nodes_are_carried_by_the_centre_of_mass(scene, elements):
    frames, now = three(scene), elements
    for row, frame in enumerate(frames):
        turned = np.asarray(now.R_BI[row]).T @ np.asarray(now.body.position[row])
        assert np.allclose(scene.nodes[frame], turned.T + scene.centre[frame], atol=1e-9)
        axes = scene.axes[frame]
        assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-9)
        assert np.allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-9)


def test_cross_section_is_the_chord_wide_flat_below_and_in_the_aerofoil_frame(scene):
    x = (np.arange(NODES) + 0.5) / NODES
    chord = SVL * ((x - 0.51220022) ** 2 / (4 * -4.88957129) + 0.02895101)  # as published
    assert np.allclose(scene.chord, chord, rtol=1e-6)
    stations = scene.body()
    at_node = (stations.within == 0) & (stations.segment >= 0)
    assert at_node.sum() >= NODES
    for frame in three(scene):
        nodes = scene.surface(frame)[at_node][:NODES]
        away = nodes - scene.nodes[frame][:, None]
        along = np.cross(scene.chordwise[frame], scene.dorsal[frame])
        across = np.einsum("npk,nk->np", away, scene.chordwise[frame])
        up = np.einsum("npk,nk->np", away, scene.dorsal[frame])
        assert np.allclose(np.einsum("npk,nk->np", away, along), 0, atol=1e-12)
        assert np.allclose(np.ptp(across, axis=1), chord, rtol=1e-6)
        belly = np.isclose(up, up.min(axis=1, keepdims=True), atol=1e-9)
        assert np.allclose(np.ptp(np.where(belly, across, 0), axis=1), chord, rtol=1e-6)
        # Flattened and triangular: narrow at the ridge, lower than wide.
        height = np.ptp(up, axis=1) / chord
        assert ((height > 0.25) & (height < 0.6)).all()
        assert np.allclose(across[np.arange(NODES), up.argmax(axis=1)], 0, atol=1e-9)


def test_head_leads_and_the_back_is_up_at_launch(scene):
    head, tail = scene.nodes[0][0], scene.nodes[0][-1]
    assert (head - tail) @ scene.velocity[0] > 0.05
    surface = scene.surface(0)
    ridge, belly = surface[:, :11, 2].max(axis=1), surface[:, 11:, 2].mean(axis=1)
    wide = scene.body().width > 1e-3
    assert (ridge - belly)[wide].min() > 0
    skull = scene.surface(0, "head")
    assert np.abs(skull - head).max() < 0.05
    snout, neck = skull[0].mean(axis=0), skull[-1].mean(axis=0)
    assert (snout - neck) @ (scene.nodes[0][0] - scene.nodes[0][2]) > 0
    assert skull[:, :9, 2].max() > skull[:, 9:, 2].max()


def test_forces_are_the_models(scene, elements):
    """Per length of body, in inertial axes, split along and across the velocity that counts."""
    frames, now = three(scene), elements
    for row, frame in enumerate(frames):
        turn = np.asarray(now.R_BI[row]).T
        air = now.aerodynamics
        lift, drag = scene.lift[frame].T * SVL / NODES, scene.drag[frame].T * SVL / NODES
        assert np.allclose(lift + drag, turn @ np.asarray(air.force[row]), atol=1e-12)
        velocity = turn @ np.asarray(now.air_velocity[row])
        tangent = turn @ np.asarray(now.body.tangent[row])
        normal = velocity - (velocity * tangent).sum(axis=0) * tangent
        assert np.allclose((lift * normal).sum(axis=0), 0, atol=1e-9)
        assert np.allclose(np.cross(drag, normal, axis=0), 0, atol=1e-9)
        assert ((drag * normal).sum(axis=0) < 0).all()
        for force, model in ((lift, air.lift), (drag, air.drag)):
            assert np.allclose(np.linalg.norm(force, axis=0), np.abs(model[row]), atol=1e-9)
        assert np.abs(air.lift[row]).max() > 5e-5


def test_scale_of_the_forces_is_round_and_fits(scene):
    scale = scale_of([scene])
    assert f"{scale:e}"[0] in "125"
    tallest = scale * np.linalg.norm(scene.drag, axis=2).max()
    assert 0.05 * SVL < tallest < 0.6 * SVL
    assert scale_of([scene], 0.123) == 0.123


# The page


class Elements(HTMLParser):
    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.found, self.text = [], {}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        self.found.append((f"/{tag}", {}))

    def handle_data(self, data):
        if self.found:
            index = len(self.found) - 1
            self.text[index] = self.text.get(index, "") + data

    def of(self, tag):
        return [
            (given, self.text.get(i, ""))
            for i, (name, given) in enumerate(self.found)
            if name == tag
        ]


def numbers(text):
    """The page's description and its packed numbers."""
    scripts = {given.get("id"): data for given, data in Elements(text).of("script")}
    packed = gzip.decompress(base64.b64decode(scripts["data"]))
    return json.loads(scripts["about"]), np.frombuffer(packed, "<f4")


def test_page_holds_the_scene(scene, page):
    about, values = numbers(page.html)
    given = about["glides"][0]
    frames = len(scene.times)
    assert (given["frames"], given["nodes"]) == (frames, NODES)
    assert np.allclose(values[:frames], scene.times, rtol=1e-6)
    each = 3 * NODES * frames
    assert values.size == frames * (1 + 3 + 3 + 9 + 3) + 5 * each
    for place, field in ((2, scene.lift), (1, scene.drag)):
        start = values.size - place * each
        assert np.array_equal(values[start : start + each], np.float32(field.ravel()))
    assert about["forceScale"] == scale_of([scene])


def test_ten_metres_make_a_small_file():
    page = view(fly(height=10.0))
    about, _ = numbers(page.html)
    assert about["glides"][0]["frames"] > 100
    assert len(page.html.encode()) < 2.5e6


def test_page_needs_nothing_and_forbids_everything_else(page):
    elements = Elements(page.html)
    for tag, given in elements.found:
        for name in ("src", "srcset", "href", "action", "data", "style", "onclick", "onload"):
            assert given.get(name, "data:,") == "data:,", (tag, name)
    (policy,) = (m["content"] for m, _ in elements.of("meta") if "http-equiv" in m)
    assert policy.startswith("default-src 'none';")
    (style,) = (text for _, text in elements.of("style"))
    (boot,) = (text for given, text in elements.of("script") if "type" not in given)
    for text in (style, boot):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy
    assert not re.search(r"unsafe|http|\*", policy)


def test_text_is_escaped(glide):
    page = view([glide, glide], title=EVIL, labels=[EVIL, "a & b < c"])
    plain, evil = Elements(view([glide, glide]).html), Elements(page.html)
    assert [tag for tag, _ in evil.found] == [tag for tag, _ in plain.found]
    assert evil.of("title")[0][1] == evil.of("h1")[0][1] == EVIL
    about, _ = numbers(page.html)
    assert about["title"] == EVIL
    assert [given["label"] for given in about["glides"]] == [EVIL, "a & b < c"]
    (packed,) = (text for given, text in evil.of("script") if given.get("id") == "about")
    assert not set(packed) & set("<>&\u2028\u2029")


def test_texts_that_no_file_holds_are_mended(glide, tmp_path):
    """Halves of characters that stand alone; two that belong together make one."""
    path = tmp_path / "a.html"
    page = view(glide, path, title="a\udc00b", labels=["\ud83d\udc0d \ud800"])
    assert path.read_text(encoding="utf-8") == page.html
    assert page.title == Elements(page.html).of("title")[0][1] == "a\ufffdb"
    assert numbers(page.html)[0]["glides"][0]["label"] == "\U0001f40d \ufffd"


def test_page_saves_itself_and_shows_itself_in_a_notebook(glide, page, tmp_path):
    path = tmp_path / "glide.html"
    page = view(glide, path, title='A "quoted" <glide>')
    assert isinstance(page, Page)
    assert path.read_text(encoding="utf-8") == page.html
    assert page.save(str(tmp_path / "again.html")).read_text(encoding="utf-8") == page.html
    ((frame, _),) = Elements(page._repr_html_()).of("iframe")
    assert frame["srcdoc"] == page.html
    assert html.unescape(frame["title"]) == page.title
    assert page.html not in repr(page)


def test_same_glide_makes_the_same_file(glide, page):
    assert view([glide]).html == page.html


def test_vendored_files_are_as_published_and_travel_with_the_package():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())
    patterns = patterns["tool"]["setuptools"]["package-data"]["jaxglide.view"]
    package = ROOT / "jaxglide" / "view"
    carried = {path for pattern in patterns for path in package.glob(pattern)}
    for folder in ("vendor/three", "vendor/uplot", "page"):
        files = [path for path in (package / folder).iterdir() if path.is_file()]
        assert len(files) >= 4
        assert set(files) <= carried
        if folder == "page":
            continue
        about = (package / folder / "README.md").read_text()
        listed = dict(re.findall(r"\| `([^`]+)` \| `([0-9a-f]{64})` \|", about))
        assert "LICENSE" in listed
        assert set(listed) == {path.name for path in files} - {"README.md"}
        for name, digest in listed.items():
            found = hashlib.sha256((package / folder / name).read_bytes()).hexdigest()
            assert found == digest, name


# Mistakes


@pytest.mark.parametrize("show", [view, Scene.of, "animate", "still"])
def test_what_cannot_be_shown_is_refused(glide, show, tmp_path):
    if show == "animate":
        show = lambda glide: animate(glide, tmp_path / "a.gif")  # noqa: E731
    elif show == "still":
        show = lambda glide: still(glide, tmp_path / "a.png")  # noqa: E731
    for part, value, message in (
        (lambda g: g.interpolation, None, "glides: .* dense=True"),
        (lambda g: g.time, np.zeros(2), r"glides: a batch of shape \(2,\)"),
        (lambda g: g.state, glide.state * np.nan, "glides: .* not finite"),
        (lambda g: g.time, np.zeros(()), "glides: .* ended at its launch"),
    ):
        with pytest.raises(ValueError, match=message):
            show(eqx.tree_at(part, glide, value))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"labels": ["a", "b"]}, "labels has 2 for 1 glides"),
        ({"labels": "a"}, "labels = 'a' must be a list"),
        ({"rate": 0}, "rate = 0"),
        ({"rate": 1e4}, "rate = 10000"),
        ({"rate": np.nan}, "rate = nan"),
        ({"force_scale": -1}, "force_scale = -1"),
    ],
)
def test_wrong_options_are_named(glide, options, message):
    with pytest.raises(ValueError, match=message):
        view(glide, **options)


def test_wrong_glides_are_named(glide):
    with pytest.raises(ValueError, match="glides is empty"):
        view([])
    with pytest.raises(TypeError, match="glides: str is not a Glide"):
        view(["glide"])
    long = eqx.tree_at(lambda g: g.time, glide, np.asarray(100.0))
    with pytest.raises(ValueError, match="rate = 500 frames/s makes 50000 frames"):
        view(long, rate=500)


# Animation and still


def greens(pixels):
    r, g, b = (pixels[..., i].astype(int) for i in range(3))
    return (g > 1.25 * r) & (g > 1.2 * b) & (g > 50)


def test_animation_moves(glide, tmp_path):
    path = tmp_path / "a.gif"
    assert animate(glide, path, frames_per_second=2, playback=0.5, title="x") == path
    with Image.open(path) as film:
        assert film.size == (960, 540)
        assert film.n_frames == len(Scene.of(glide, rate=4).times) == 5
        pictures = []
        for i in range(film.n_frames):
            film.seek(i)
            pictures.append(np.asarray(film.convert("RGB")))
            assert film.info["duration"] == (1500 if i == 4 else 500)
    for one, other in pairwise(pictures):
        assert (one != other).any(axis=-1)[:, :600].sum() > 1000  # the body moves
        assert (one != other).any(axis=-1)[:, 680:].sum() > 50  # and the cursors
    for picture in pictures:
        rows, columns = np.nonzero(greens(picture[:, :620]))
        assert len(rows) > 400
        assert abs(np.median(columns) - 316) < 120
        assert abs(np.median(rows) - 270) < 100


def test_mp4(glide, tmp_path):
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = animate([glide], tmp_path / "a.mp4", frames_per_second=4, playback=1.0)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == len(Scene.of(glide, rate=4).times)
    assert seconds == pytest.approx(frames / 4, abs=0.3)


def test_still_shows_forces_of_several_glides(glide, tmp_path):
    frozen = fly(f_theta=0.0)
    path = still([glide, frozen], tmp_path / "a.png", time=0.6, labels=["1.2 Hz", "0 Hz"])
    pixels = np.asarray(Image.open(path).convert("RGB"))
    assert pixels.shape == (1080, 1920, 3)
    columns = np.nonzero(greens(pixels[:, :1240]))[1]
    assert (columns < 620).sum() > 500
    assert (columns > 620).sum() > 500
    r, g, b = (pixels[:, :1240, i].astype(int) for i in range(3))
    assert ((r - b > 100) & (r > g)).sum() > 500  # drag
    assert ((b - r > 100) & (g > r)).sum() > 100  # lift


@pytest.mark.filterwarnings("error")  # of glyphs that are missing
def test_texts_in_pictures_are_texts(scene, glide, tmp_path):
    """No formulas, and no box where the font has no picture of a character."""
    text = "$\\frac{$ a_b ψ \U0001f40d"
    picture = Picture([scene, replace(scene, label=text)], text, 0.1)
    drawn = [picture.figure.texts[0], picture.figure.legends[0].get_texts()[-1]]
    assert [t.get_text() for t in drawn] == [r"\$\frac{\$ a_b ψ U+1F40D"] * 2
    still(glide, tmp_path / "a.png", title=text, labels=[text])
    assert (tmp_path / "a.png").stat().st_size > 20_000


WRITTEN = {
    "a.html": lambda g, path: view(g, path),
    "a.png": lambda g, path: still(g, path),
    "a.gif": lambda g, path: animate(g, path, frames_per_second=2, playback=0.5),
    "a.mp4": lambda g, path: animate(g, path, frames_per_second=2, playback=0.5),
}


@pytest.mark.parametrize("size", [0, 16_384])
@pytest.mark.parametrize("name", WRITTEN)
def test_a_full_disk_leaves_the_old_file(glide, tmp_path, disk_of, name, size):
    if name == "a.mp4":
        pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / name
    path.write_text("old")
    with disk_of(size), pytest.raises(OSError, match=f"^cannot write {path}: .+") as caught:
        WRITTEN[name](glide, path)
    assert "\n" not in str(caught.value)
    assert [p.name for p in tmp_path.iterdir()] == [name]
    assert path.read_text() == "old"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda g, p: animate(g, p / "a.avi"), "must end in .gif or .mp4"),
        (lambda g, p: animate(g, p / "a.gif", playback=0), "playback = 0"),
        (lambda g, p: animate(g, p / "a.gif", frames_per_second=99), "frames_per_second = 99"),
        (lambda g, p: animate(g, p / "a.gif", playback=1e-3), "more than 3000"),
        (lambda g, p: still(g, p / "a.gif"), "must end in .png"),
        (lambda g, p: still(g, p / "a.png", time=99), "time = 99 s"),
    ],
)
def test_wrong_animations_are_refused(glide, tmp_path, call, message):
    with pytest.raises(ValueError, match=message):
        call(glide, tmp_path)
    assert not list(tmp_path.iterdir())


def test_missing_encoder_is_explained(glide, tmp_path, monkeypatch):
    monkeypatch.setattr("jaxglide.view.animation.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"imageio-ffmpeg \(pip install 'jaxglide\[view\]'\)"):
        animate(glide, tmp_path / "a.mp4")


# The command


@pytest.fixture
def flown(glide, monkeypatch):
    """The command line with one glide for all: gliders and launches that were to fly."""
    flown = []

    @functools.wraps(simulate)
    def fake(glider, launch, **options):
        flown.append((glider, launch, options))
        return glide

    monkeypatch.setattr("jaxglide.flight.glide.simulate", fake)
    return flown


def test_command_writes_a_page_of_several_glides(flown, tmp_path, capsys):
    out = tmp_path / "g.html"
    words = ["--height", "3", "--compare", "f_theta=0", "--compare", "d_psi=0"]
    assert cli.main(["view", *words, "--out", str(out), "--title", "T"]) == 0
    gaits = [(float(g.gait.f_theta), float(np.rad2deg(g.gait.d_psi))) for g, _, _ in flown]
    assert np.allclose(gaits, [(1.2, 10), (0, 10), (1.2, 0)])
    assert [float(launch.height) for _, launch, _ in flown] == [3, 3, 3]
    assert all(options["dense"] for _, _, options in flown)
    about, _ = numbers(out.read_text(encoding="utf-8"))
    labels = [given["label"] for given in about["glides"]]
    assert labels == [
        "undulation frequency = 1.2 Hz, dorsoventral bending = 10 deg/SVL",
        "undulation frequency = 0 Hz",
        "dorsoventral bending = 0 deg/SVL",
    ]
    printed = capsys.readouterr().out
    assert f"wrote {out} (" in printed
    assert "MB): open it in a browser" in printed


def test_command_writes_pictures(flown, tmp_path, capsys):
    for name, words in (
        ("g.png", ["--at", "0.2"]),
        ("g.gif", ["--playback", "1", "--frames-per-second", "3"]),
    ):
        out = tmp_path / name
        assert cli.main(["view", "--out", str(out), *words]) == 0
        with Image.open(out) as image:
            assert image.size[0] >= 960
    assert "browser" not in capsys.readouterr().out


@pytest.mark.parametrize("name", ["g.html", "g.gif"])
def test_command_says_that_the_disk_is_full(flown, tmp_path, capsys, disk_of, name):
    words = ["view", "--out", str(tmp_path / name), "--frames-per-second", "2"]
    with disk_of(4096):
        assert cli.main(words) == 1
    assert capsys.readouterr() == (
        "",
        f"jaxglide: cannot write {tmp_path / name}: File too large\n",
    )
    assert not list(tmp_path.iterdir())


def test_command_replaces_only_what_it_was_told_to(flown, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "glide.html"
    path.write_text("mine")
    assert cli.main(["view"]) == 2
    assert capsys.readouterr().err == (
        "jaxglide: glide.html exists: give a name with --out, or --force to replace it\n"
    )
    assert not flown
    assert path.read_text() == "mine"
    for words in (["--force"], ["--out", "glide.html"]):
        path.write_text("mine")
        assert cli.main(["view", *words]) == 0
        assert "<html" in path.read_text(encoding="utf-8")


def test_command_fails_where_a_glide_was_not_computed_to_its_end(
    glide, tmp_path, capsys, monkeypatch
):
    lost = eqx.tree_at(lambda g: g.outcome, glide, np.asarray(int(Outcome.OUT_OF_STEPS)))
    glides = iter([glide, lost])
    monkeypatch.setattr("jaxglide.flight.glide.simulate", lambda *_, **options: next(glides))
    words = ["view", "--compare", "mass=1e-9", "--out", str(tmp_path / "g.html")]
    assert cli.main(words) == 1
    told = f"the glide with mass = 1e-09 kg ran out of steps at {float(glide.time):.6g} s"
    assert capsys.readouterr() == ("", f"jaxglide: {told}\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--out", "a.txt"], "must end in .html"),
        (["--out", "nowhere/a.html"], "there is no folder nowhere"),
        (["--compare", "wings=2"], "no parameter 'wings'"),
        (["--compare", "f_theta"], "not NAME=VALUE"),
        (["--compare", "f_theta=-1"], "f_theta = -1"),
        (["--frames-per-second", "0"], "rate = 0"),
    ],
)
def test_command_refuses_mistakes(flown, tmp_path, capsys, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["view", *words]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
