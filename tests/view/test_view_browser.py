"""Views in a browser: they load alone and in silence, play, scrub, toggle, show the snake."""

import shutil
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from jaxglide import Gait, Glider, Launch, Snake, simulate
from jaxglide.view import Scene, view
from jaxglide.view.scene import scale_of

playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER = next(filter(None, map(shutil.which, BROWSERS)), None)
pytestmark = pytest.mark.skipif(
    BROWSER is None, reason=f"needs one of the browsers {', '.join(BROWSERS)}"
)

OPTIONS = (
    *(
        "--no-sandbox",
        "--use-gl=angle",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
    ),
    *("--disable-quic", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync"),
)
SIZE = {"width": 1280, "height": 800}
EVIL = "</script><script>window.bad=1</script>\"'><img src=x onerror='window.bad=1'>&amp;\u2028"
UNKNOWN = "Unrecognized Content-Security-Policy directive 'webrtc'."  # others may know it
SEEN = "Array.from(jaxglide.{})"


def fly(f_theta):
    glider = Glider(Snake.from_svl(0.7, nodes=70), Gait.from_degrees(f_theta=f_theta))
    launch = Launch(3.0, 1.75, phi_theta=0.0, angles=np.deg2rad((0.0, -5.0, -5.0)))
    return simulate(glider, launch, dense=True)


@pytest.fixture(scope="module")
def glide():
    return fly(1.2)


@pytest.fixture(scope="module")
def scene(glide):
    return Scene.of(glide)


@pytest.fixture(scope="module")
def folder(glide, tmp_path_factory):
    """A view of one glide and one of two, the second with hostile texts and another end."""
    folder = tmp_path_factory.mktemp("views")
    view(glide, folder / "one.html")
    view([glide, fly(0.0)], folder / "two.html", labels=["waves", EVIL], title=EVIL)
    return folder


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=BROWSER, args=list(OPTIONS))
        yield browser
        browser.close()


class Visit:
    """A page opened from its file, offline, with everything it asked for and complained of."""

    def __init__(self, browser, path, **options):
        self.context = browser.new_context(**{"viewport": SIZE} | options)
        self.context.set_offline(True)
        self.page = self.context.new_page()
        self.complaints, self.requests = [], []
        self.page.on("console", self.hear)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri())
        self.page.wait_for_selector("html[data-ready]", state="attached", timeout=30_000)
        self.own = path.as_uri()

    def hear(self, message):
        """Every word is a complaint, but the driver's on screenshots, and one on the policy."""
        if "ReadPixels" not in message.text and message.text != UNKNOWN:
            self.complaints.append(message.text)

    def run(self, code):
        return self.page.evaluate(code)

    def pixels(self):
        """The part of the window with the scene, once it is drawn, (rows, columns, 3)."""
        self.run("new Promise((go) => requestAnimationFrame(() => requestAnimationFrame(go)))")
        picture = self.page.locator("#stage").screenshot()
        return np.asarray(Image.open(BytesIO(picture)).convert("RGB")).astype(int)

    def outside(self):
        """What it asked for beside its own file and its own memory."""
        return [u for u in self.requests if u != self.own and not u.startswith("blob:")]


@pytest.fixture(scope="module")
def one(browser, folder):
    visit = Visit(browser, folder / "one.html")
    yield visit
    visit.context.close()


@pytest.fixture(scope="module")
def two(browser, folder):
    visit = Visit(browser, folder / "two.html")
    yield visit
    visit.context.close()


@pytest.fixture(autouse=True)
def _fresh(request):
    """Every test begins at the launch, paused, with everything shown; and ends in silence."""
    used = [request.getfixturevalue(n) for n in ("one", "two") if n in request.fixturenames]
    for visit in used:
        visit.run("jaxglide.play(false), jaxglide.seek(0)")
        visit.page.locator("#camera").select_option("all")
        for box in visit.page.locator("#toggles input:visible").all():
            box.check()
    yield
    for visit in used:
        assert visit.complaints == []
        assert visit.outside() == []


def colours(pixels):
    """How many pixels have the colours of back, belly, lift, drag, path, and the axis right."""
    r, g, b = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    return {
        "back": (g > 1.25 * r) & (g > 1.25 * b) & (g > 50),
        "lift": (b - r > 100) & (g - r > 30),
        "drag": (r - b > 100) & (r - g > 20) & (g - b > 30),
        "path": (b - r > 45) & (b - g > 20) & (r < 70) & (b < 130),
        "axes": (r - g > 70) & (b - g > 15),
    }


def near(time, scene):
    return int(np.abs(scene.times - time).argmin())


# Loads


def test_loads_in_silence_and_alone(one):
    assert one.requests[0] == one.own
    assert one.page.title() == "A glide from 3 m"
    assert one.page.locator("#problem").is_hidden()
    assert one.page.locator("#readout").inner_text().startswith("0.00 / 0.9")


def test_network_is_forbidden(one):
    said = one.run("fetch('https://jaxglide.invalid/').then(() => 'sent', (e) => e.name)")
    assert said == "TypeError"
    refused = [text for text in one.complaints if "Content Security Policy" in text]
    assert refused
    one.complaints.clear()
    for kind in ("RTCPeerConnection", "webkitRTCPeerConnection"):
        assert one.run(f"typeof window.{kind}") == "undefined"
    blank = one.context.browser.new_page()
    assert blank.evaluate("typeof window.RTCPeerConnection") == "function"
    blank.close()
    written = one.run("try { document.body.innerHTML = '<p>'; 'put' } catch (e) { e.name }")
    assert written == "TypeError"
    one.complaints.clear()


def test_snake_is_in_the_picture(one, scene):
    """Green where the camera looks, and nowhere else."""
    one.run("jaxglide.seek(0.5)")
    back = colours(one.pixels())["back"]
    rows, columns = np.nonzero(back)
    assert len(rows) > 2000
    middle = np.array(back.shape) / 2
    assert np.abs(np.median([rows, columns], axis=1) - middle).max() < 0.15 * middle.max()
    assert np.ptp(columns) > 0.15 * back.shape[1]
    assert np.ptp(columns) < 0.7 * back.shape[1]
    one.run("jaxglide.stage.snakes[0].body.visible = false; jaxglide.stage.dirty = true")
    without = colours(one.pixels())["back"].sum()
    one.run("jaxglide.stage.snakes[0].body.visible = true; jaxglide.stage.dirty = true")
    assert without < 0.3 * len(rows)


def test_belly_is_yellow_green_from_below(one):
    one.page.locator("#show-lift").uncheck()
    one.page.locator("#show-drag").uncheck()
    one.run("""{
      const { stage } = jaxglide;
      stage.camera.position.copy(stage.controls.target);
      stage.camera.position.y -= 0.2; stage.camera.position.z -= 0.7;
      stage.controls.update();
    }""")
    pixels = one.pixels()
    one.page.locator("#reset").click()
    r, g, b = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    belly = (g > r) & (r > 1.5 * b) & (g > 90)
    assert belly.sum() > 2000


# The geometry the page draws


def test_page_draws_the_models_geometry_and_forces(one, scene):
    scale = scale_of([scene])
    snake = "stage.snakes[0]"
    for frame in (6, len(scene.times) // 2, len(scene.times) - 1):
        one.run(f"jaxglide.seek({float(np.float32(scene.times[frame]))!r})")
        for part in ("body", "head"):
            code = f"{snake}.{part}.geometry.attributes.position.array"
            drawn = np.reshape(one.run(SEEN.format(code)), (-1, 3))
            points = scene.surface(frame, part).reshape(-1, 3)
            assert np.allclose(drawn, points, atol=3e-6), part
        for name in ("lift", "drag"):
            code = f"{snake}.parts.{name}.userData.points"
            drawn = np.reshape(one.run(SEEN.format(code)), (-1, 2, 3))
            assert np.allclose(drawn[:, 0], scene.nodes[frame], atol=3e-6)
            sheets = scale * getattr(scene, name)[frame]
            assert np.allclose(drawn[:, 1] - drawn[:, 0], sheets, atol=3e-6), name
            assert np.abs(sheets).max() > 1e-3


def test_pose_between_frames_is_between_them(one, scene):
    time = float(scene.times[20:22].mean())
    one.run(f"jaxglide.seek({time})")
    nodes = np.reshape(one.run(SEEN.format("glides[0].now.nodes")), (-1, 3))
    assert np.allclose(nodes, scene.nodes[20:22].mean(axis=0), atol=1e-5)


# Time


def test_plays_and_pauses(one):
    play = one.page.locator("#play")
    play.click()
    assert play.get_attribute("aria-pressed") == "true"
    assert "Pause" in play.inner_text()
    one.page.wait_for_timeout(400)
    play.click()
    time = one.run("jaxglide.time")
    assert 0.01 < time < 0.9
    one.page.wait_for_timeout(200)
    assert one.run("jaxglide.time") == time
    shown = one.run("jaxglide.time.toFixed(2)")  # JavaScript rounds halves up, Python to even
    assert one.page.locator("#readout").inner_text().startswith(shown)


@pytest.mark.parametrize("speed", ["0.1", "0.25", "1"])
def test_speed(one, speed):
    one.page.locator("#speed").select_option(speed)
    code = "jaxglide.play(true), jaxglide.frame(1000), jaxglide.frame(1100), jaxglide.time"
    assert one.run(code) == pytest.approx(0.1 * float(speed))


def test_stops_at_the_end_and_starts_again(one):
    end = one.run("jaxglide.end")
    one.run("jaxglide.seek(jaxglide.end - 1e-3), jaxglide.play(true)")
    one.page.wait_for_selector("#play[aria-pressed=false]")
    assert one.run("jaxglide.time") == end
    assert "landed" in one.page.locator("#readouts").inner_text()
    one.page.locator("#play").click()
    assert one.run("jaxglide.time") < end


def test_scrubs(one, scene):
    before = one.run(SEEN.format("glides[0].now.nodes"))
    picture = one.pixels()
    one.page.locator("#time").fill("0.5")
    assert one.run("jaxglide.time") == 0.5
    assert one.page.locator("#readout").inner_text().startswith("0.50 / ")
    assert one.page.locator("#time").get_attribute("aria-valuetext") == "0.50 s"
    moved = np.subtract(one.run(SEEN.format("glides[0].now.nodes")), before)
    frame = near(0.5, scene)
    assert moved[2::3].mean() == pytest.approx(scene.centre[frame][2] - 3, abs=0.03)
    assert (np.abs(one.pixels() - picture).max(axis=-1) > 40).sum() > 2000
    shown = [float(text) for text in one.page.locator("#readouts td").all_inner_texts()]
    assert shown[0] == pytest.approx(scene.centre[frame][2], abs=0.01)
    assert shown[1] == pytest.approx(np.linalg.norm(scene.velocity[frame]), abs=0.01)
    x, y, z = scene.velocity[frame]
    assert shown[2] == pytest.approx(np.rad2deg(np.arctan2(-z, np.hypot(x, y))), abs=0.51)


def test_keyboard(one):
    press, time = one.page.keyboard.press, lambda: one.run("jaxglide.time")
    one.page.locator("#canvas").focus()
    press("ArrowRight")
    assert time() == pytest.approx(1 / 60)
    press("Shift+ArrowRight")
    assert time() == pytest.approx(11 / 60)
    press("ArrowLeft")
    assert time() == pytest.approx(10 / 60)
    press("End")
    assert time() == one.run("jaxglide.end")
    press("Home")
    assert time() == 0
    press("Space")
    assert one.run("jaxglide.playing")
    press("Space")
    assert not one.run("jaxglide.playing")
    one.page.locator("#play").focus()
    press("Space")  # once, as the button's own key, not twice
    assert one.run("jaxglide.playing")
    one.run("jaxglide.play(false)")
    one.page.locator("#show-axes").focus()
    press("Space")  # is the box's own key
    assert not one.page.locator("#show-axes").is_checked()
    assert not one.run("jaxglide.playing")


# What is shown


def test_toggles(one):
    one.run("jaxglide.seek(0.6)")
    counts = {name: mask.sum() for name, mask in colours(one.pixels()).items()}
    assert min(counts.values()) > 60, counts
    for name in ("lift", "drag", "path", "axes"):
        one.page.locator(f"#show-{name}").uncheck()
        now = colours(one.pixels())
        assert now[name].sum() < 0.12 * counts[name], name
        # Sheets before the body and the ground look green, too.
        assert now["back"].sum() > 0.5 * counts["back"], name
        one.page.locator(f"#show-{name}").check()
        assert colours(one.pixels())[name].sum() == pytest.approx(counts[name], rel=0.05)
    shown = one.pixels()
    one.page.locator("#show-labels").uncheck()
    assert (np.abs(one.pixels() - shown).max(axis=-1) > 40).sum() > 100


def test_camera_follows_or_stays(one):
    place = SEEN.format("stage.camera.position.toArray()")
    centre = SEEN.format("glides[0].now.centre")
    start, here = np.array(one.run(place)), np.array(one.run(centre))
    one.run("jaxglide.seek(0.7)")
    moved = np.array(one.run(centre)) - here
    assert moved[2] < -0.5
    assert np.allclose(np.array(one.run(place)) - start, moved, atol=1e-5)
    one.page.locator("#camera").select_option("fixed")
    still = one.run(place)
    pixels = one.pixels()
    one.run("jaxglide.seek(0.1)")
    assert one.run(place) == still
    assert (np.abs(one.pixels() - pixels).max(axis=-1) > 40).sum() > 50
    # Dragging turns the camera; the button puts it back.
    box = one.page.locator("#canvas").bounding_box()
    one.page.mouse.move(box["x"] + 300, box["y"] + 300)
    one.page.mouse.down()
    one.page.mouse.move(box["x"] + 420, box["y"] + 330, steps=3)
    one.page.mouse.up()
    assert not np.allclose(one.run(place), still, atol=0.1)
    one.page.locator("#reset").click()
    assert np.allclose(one.run(place), still)


def test_charts_follow_and_scrub(one, scene):
    def places(kind):
        boxes = [box.bounding_box() for box in one.page.locator(f".{kind}").all()]
        return np.array([[b["x"] + b["width"] / 2, b["y"] + b["height"] / 2] for b in boxes])

    plots = [box.bounding_box() for box in one.page.locator(".u-over").all()]
    assert len(plots) == len(places("cursor")) == len(places("dot")) == 4
    end = scene.times[-1]
    seen = []
    for time in (0.0, 0.3, end):
        one.run(f"jaxglide.seek({time})")
        expected = [box["x"] + box["width"] * time / end for box in plots]
        assert np.allclose(places("cursor")[:, 0], expected, atol=1.5)
        assert np.allclose(places("dot")[:, 0], expected, atol=1.5)
        seen.append(places("dot")[:, 1])
    frames = [0, near(0.3, scene), -1]
    for chart in range(4):  # up is more
        curve = scene.angles[frames, chart] if chart < 3 else scene.centre[frames, 2]
        assert (np.argsort(-np.array(seen)[:, chart]) == np.argsort(curve)).all()
    box = plots[1]
    one.page.mouse.click(box["x"] + 0.4 * box["width"], box["y"] + 10)
    assert one.run("jaxglide.time") == pytest.approx(0.4 * end, abs=0.02)
    ink = one.page.locator("#charts canvas").first.screenshot()
    ink = np.asarray(Image.open(BytesIO(ink)).convert("RGB")).astype(int)
    assert (np.abs(ink - [0x1F, 0x3A, 0x5F]).max(axis=-1) < 40).sum() > 50


# Several glides, hostile texts, small windows, no WebGL


def test_two_glides_on_one_clock(two):
    ends = two.run("jaxglide.glides.map((glide) => glide.end)")
    assert ends[0] != ends[1]
    two.run(f"jaxglide.seek({max(ends)})")
    assert two.run("jaxglide.glides.map((glide) => glide.now.times[0])") == ends
    assert two.page.locator("#readouts tbody tr").count() == 2
    assert two.run("jaxglide.stage.snakes.map((snake) => snake.group.position.x)") == (
        pytest.approx([-0.4025, 0.4025])
    )
    back = colours(two.pixels())["back"]
    half = back.shape[1] // 2
    assert min(back[:, :half].sum(), back[:, half:].sum()) > 300
    two.page.locator("#show-apart").uncheck()
    assert two.run("jaxglide.stage.snakes.map((snake) => snake.group.position.x)") == [0, 0]
    two.page.locator("#camera").select_option("1")
    assert two.run("jaxglide.stage.mode") == "1"


def test_hostile_texts_are_only_texts(two):
    assert two.run("window.bad") is None
    assert two.page.locator("img").count() == 0
    assert two.page.locator("h1").text_content() == EVIL
    assert two.page.locator("#names li").nth(1).text_content() == EVIL
    assert EVIL in two.page.locator("#readouts tbody tr").nth(1).text_content()


@pytest.mark.parametrize("size", [(800, 600), (500, 700)])
def test_small_windows(browser, folder, size):
    shape = dict(zip(("width", "height"), size, strict=True))
    visit = Visit(browser, folder / "one.html", viewport=shape)
    wide = visit.run("document.documentElement.scrollWidth")
    assert wide <= size[0]
    for name in ("#play", "#time", "#camera", "#show-labels", "#canvas"):
        box = visit.page.locator(name).bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= size[0]
        assert box["y"] + box["height"] <= size[1] + 1
    assert colours(visit.pixels())["back"].sum() > 800
    assert visit.complaints == []
    visit.context.close()


def test_page_in_a_notebooks_frame(browser, glide, tmp_path):
    path = tmp_path / "notebook.html"
    path.write_text(f"<!doctype html><body>{view(glide)._repr_html_()}", encoding="utf-8")
    context = browser.new_context(viewport=SIZE)
    context.set_offline(True)
    page = context.new_page()
    complaints = []
    page.on("console", lambda m: m.text == UNKNOWN or complaints.append(m.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(path.as_uri())
    frame = page.frame_locator("iframe")
    frame.locator("html[data-ready]").wait_for(state="attached", timeout=30_000)
    frame.locator("#time").fill("0.5")
    assert frame.locator("#readout").inner_text().startswith("0.50")
    assert complaints == []
    context.close()


def test_charts_work_without_webgl(browser, folder):
    context = browser.new_context(viewport=SIZE)
    context.add_init_script("HTMLCanvasElement.prototype.getContext = new Proxy("
        "HTMLCanvasElement.prototype.getContext, { apply: (f, self, given) => "
        "given[0].startsWith('webgl') ? null : Reflect.apply(f, self, given) })")  # fmt: skip
    page = context.new_page()
    page.goto((folder / "one.html").as_uri())
    page.wait_for_selector("html[data-ready]", state="attached", timeout=30_000)
    assert "WebGL" in page.locator("#problem").inner_text()
    page.locator("#time").fill("0.5")
    assert page.locator("#readout").inner_text().startswith("0.50")
    assert page.locator(".cursor").first.is_visible()
    context.close()
