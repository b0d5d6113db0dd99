"""Figures: what is drawn is where it should be, is labelled with units, and fits the page."""

import subprocess
import sys

import equinox as eqx
import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from jaxglide import AngleLimit, Gait, Glider, Ground, Launch, Outcome, Snake, plot, simulate
from jaxglide.tunnel.trim import Trim

NODES = 20
THETA, NU = np.linspace(90.8, 119.1, 11), np.linspace(1.0, 1.5, 11)


def fly(f_theta=1.2, theta_m=96.5, height=1.0, speed=1.75, angles=(0.0, -5.0, -5.0)):
    """A glide, its launch given in full (angles in degrees): one compilation serves all."""
    gait = Gait.from_degrees(theta_m=theta_m, f_theta=f_theta)
    glider = Glider(Snake.from_svl(0.7, nodes=NODES), gait)
    launch = Launch(height, speed, phi_theta=0.0, angles=np.deg2rad(angles))
    return simulate(glider, launch, dense=True)


@pytest.fixture(scope="module")
def landed():
    glide = fly()
    assert glide.outcome == Outcome.LANDED
    return glide


@pytest.fixture(scope="module")
def unstable():
    glide = fly(f_theta=0.0, height=10.0)
    assert glide.outcome in (1, 2, 3)
    return glide


def drawn(ax, label):
    """Points (T, 2) of the only line of that name."""
    (line,) = (line for line in ax.lines if line.get_label() == label)
    return np.column_stack([np.asarray(line.get_xdata()), np.asarray(line.get_ydata())])


def bodies(ax):
    """Snapshots of the body, (F, n, 2)."""
    (collection,) = (c for c in ax.collections if c.get_label() == "body")
    return np.array(collection.get_segments()).reshape(-1, NODES, 2)


def in_space(side, top):
    """Snapshots of the body in space, (F, 3, n), put together from both views."""
    from_above, from_side = bodies(top), bodies(side)
    assert np.allclose(from_above[..., 1], from_side[..., 0])
    return np.stack([from_above[..., 0], from_above[..., 1], from_side[..., 1]], axis=1)


def check_page(figure, least=16):
    """One column wide; every text legible, inside the page, and clear of every other."""
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(90.0)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    texts = [
        *figure.texts,
        *(text for legend in figure.legends for text in legend.get_texts()),
        *(text for ax in figure.axes for text in shown_texts(ax)),
    ]
    boxes = []
    for text in texts:
        if not text.get_visible() or not text.get_text():
            continue
        box = text.get_window_extent(canvas.get_renderer())
        assert 6.0 <= text.get_fontsize() <= 8.0, text
        assert (box.min >= figure.bbox.min).all(), text
        assert (box.max <= figure.bbox.max).all(), text
        for other, name in boxes:
            common = Bbox.intersection(box, other)
            assert common is None or min(common.size) < 1, f"{text.get_text()} is on {name}"
        boxes.append((box, text.get_text()))
    assert len(boxes) >= least


def shown_texts(ax):
    """Texts of the axes that are drawn: not the tick labels outside its limits."""
    ticks = []
    for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
        slack = 1e-9 * np.ptp(limits)
        for tick in axis.get_major_ticks():
            if min(limits) - slack <= tick.get_loc() <= max(limits) + slack:
                ticks += [tick.label1, tick.label2]
    legend = ax.get_legend()
    named = legend.get_texts() if legend else []
    return [*ticks, *ax.texts, *named, ax.title, ax.xaxis.label, ax.yaxis.label]


# Glides


def test_overview_has_three_labelled_axes_and_says_how_it_ended(landed, unstable):
    figure = plot.glide_overview(landed)
    assert [(ax.get_xlabel(), ax.get_ylabel()) for ax in figure.axes] == [
        ("forward, y (m)", "height, z (m)"),
        ("right, x (m)", "forward, y (m)"),
        ("time, t (s)", "angle (°)"),
    ]
    distance, time = float(landed.path_length), float(landed.time)
    title = figure.get_suptitle()
    assert title == f"Landed after {time:.2f} s, path length {distance:.2f} m"
    assert plot.glide_overview(unstable).get_suptitle().startswith("Unstable in ")


@pytest.mark.parametrize("name", ["landed", "unstable"])
def test_path_goes_from_launch_to_the_end_and_both_are_marked(name, request):
    glide = request.getfixturevalue(name)
    start, end = np.asarray(glide.take_off.state[:3]), np.asarray(glide.landing_point)
    word = "landing" if name == "landed" else "end of the glide"
    side, top, _ = plot.glide_overview(glide).axes
    for ax, parts in ((side, [1, 2]), (top, [0, 1])):
        path = drawn(ax, "path")
        assert len(path) >= 100
        assert np.allclose(path[0], start[parts], atol=1e-12)
        assert np.allclose(path[-1], end[parts], atol=1e-12)
        assert np.allclose(drawn(ax, "launch"), start[parts], atol=1e-12)
        assert np.allclose(drawn(ax, word), end[parts], atol=1e-12)
    middle = np.asarray(glide.at(glide.time * np.array([100 / 399]))[0])
    assert np.allclose(drawn(side, "path")[100], middle[1:3])


@pytest.mark.parametrize("name", ["landed", "unstable", "straight"])
def test_views_have_one_scale_and_show_everything(name, request):
    glide = fly(theta_m=20.0) if name == "straight" else request.getfixturevalue(name)
    figure = plot.glide_overview(glide)
    width, height = figure.get_size_inches()
    scales = []
    for ax in figure.axes[:2]:
        place = ax.get_position()
        scales.append(width * place.width / np.ptp(ax.get_xlim()))
        scales.append(height * place.height / np.ptp(ax.get_ylim()))
        points = np.concatenate([*bodies(ax), drawn(ax, "path")])
        low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
        assert (points > low).all()
        assert (points < high).all()
    assert np.allclose(scales, scales[0], rtol=1e-6)
    assert figure.axes[0].get_ylim()[0] < 0  # the ground is in view


def test_body_is_true_to_scale_and_carried_by_the_centre_of_mass(landed):
    side, top, _ = plot.glide_overview(landed, frames=5).axes
    nodes = in_space(side, top)
    assert nodes.shape == (5, 3, NODES)
    steps = np.linalg.norm(np.diff(nodes, axis=2), axis=1)
    spacing = 0.7 / NODES
    # Chords of a bent body are a little shorter than its arcs.
    assert (steps <= spacing * (1 + 1e-9)).all()
    assert (steps > 0.8 * spacing).all()
    # The centre of mass is near the middle of the nodes, as they weigh nearly the same.
    centre = np.asarray(landed.at(np.linspace(0, float(landed.time), 5)))[:, :3]
    assert np.abs(nodes.mean(axis=2) - centre).max() < 0.03
    for ax in (side, top):
        assert np.allclose(drawn(ax, "head"), bodies(ax)[:, 0])


@pytest.mark.parametrize(
    ("angles", "axis", "sign"),
    [((40, 0, 0), 0, -1), ((-40, 0, 0), 0, 1), ((0, 40, 0), 2, 1), ((0, -40, 0), 2, -1)],
)
def test_nose_points_where_yaw_and_pitch_say(angles, axis, sign):
    glide = fly(angles=angles)
    side, top = plot.side_view(glide, frames=[0.0]), plot.top_view(glide, frames=[0.0])
    nose = np.diff(in_space(side, top)[0][:, [-1, 0]])[:, 0]  # from tail to head
    assert sign * nose[axis] > 0.05
    assert nose[1] > 0.05


def test_roll_to_the_right_lowers_the_right_flank():
    glide = fly(angles=(0, 0, 60))
    side, top = plot.side_view(glide, frames=[0.0]), plot.top_view(glide, frames=[0.0])
    x, _, z = in_space(side, top)[0]
    assert z[x.argmax()] < z[x.argmin()] - 0.1


def test_frames_are_counts_or_times(landed):
    end = float(landed.time)
    assert len(bodies(plot.side_view(landed, frames=0))) == 0
    counted = bodies(plot.side_view(landed, frames=3))
    timed = bodies(plot.side_view(landed, frames=[0.0, end / 2, end]))
    assert len(counted) == 3
    assert np.allclose(counted, timed)


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        (-1, "frames = -1"),
        ([0.1, 99.0], "frames = 99 s"),
        ([[0.1]], r"frames has shape \(1, 1\)"),
    ],
)
def test_impossible_frames_are_refused(landed, frames, message):
    with pytest.raises(ValueError, match=message):
        plot.top_view(landed, frames=frames)


def test_angles_are_the_glides_in_degrees(unstable):
    ax = plot.angles(unstable)
    end = np.rad2deg(np.asarray(unstable.end_angles))
    for column, name in enumerate(("yaw", "pitch", "roll")):
        time, degrees = drawn(ax, name).T
        states = np.asarray(unstable.at(time[:-1]))
        assert np.allclose(degrees[:-1], np.rad2deg(states[:, 9 + column]))
        assert time[-1] == float(unstable.time)
        assert degrees[-1] == pytest.approx(end[column], abs=1e-9)
        marks = [drawn_line for drawn_line in ax.lines if len(drawn_line.get_xdata()) == 1]
        ends = [(0.0, degrees[0]), (time[-1], degrees[-1])]
        for point in ends:
            assert any(np.allclose(np.ravel(mark.get_data()), point) for mark in marks)
    assert sorted(text.get_text() for text in ax.texts if "limit" not in text.get_text()) == [
        "pitch",
        "roll",
        "yaw",
    ]
    low, high = ax.get_ylim()
    assert low < min(line.get_ydata()[0] for line in ax.lines)
    assert high > end.max()


def test_limit_is_drawn_where_an_angle_comes_near_it(landed, unstable):
    assert not [line for line in plot.angles(landed).lines if line.get_label() == "limit"]
    ax = plot.angles(unstable)
    end = np.rad2deg(np.asarray(unstable.end_angles))
    sign = np.sign(end[np.abs(end).argmax()])
    assert drawn(ax, "limit")[:, 1] == pytest.approx(85.0 * sign)
    assert f"{85 * sign:+.0f}°".replace("-", "\N{MINUS SIGN}") in ax.texts[0].get_text()


def test_an_angle_without_a_limit_draws_none():
    """A flight that may turn: its yaw comes near where pitch and roll would end it."""
    glide, upright = fly(height=1e-6, angles=(-70, 0, 0)), AngleLimit(angles=("pitch", "roll"))
    free = eqx.tree_at(lambda g: g.settings.ends, glide, (Ground(), upright))
    ax = plot.angles(free)
    assert drawn(ax, "yaw")[:, 1] == pytest.approx(-70, abs=1)
    assert not [line for line in ax.lines if line.get_label() == "limit"]


def test_limit_is_in_view_and_small_angles_are_not_blown_up(landed):
    ax = plot.angles(fly(height=1e-6, angles=(-70, 0, 0)))
    assert drawn(ax, "yaw")[:, 1] == pytest.approx(-70, abs=1)
    assert ax.get_ylim()[0] < drawn(ax, "limit")[0, 1] == pytest.approx(-85)
    assert np.ptp(plot.angles(landed).get_ylim()) >= 20


@pytest.mark.parametrize("draw", [plot.side_view, plot.top_view, plot.angles])
def test_parts_draw_on_given_axes_or_on_new_ones(landed, draw):
    ax = Figure().add_subplot()
    assert draw(landed, ax) is ax
    assert len(ax.lines) > 2
    alone = draw(landed)
    assert alone.figure.axes == [alone]
    assert alone.get_xlabel() == ax.get_xlabel()


@pytest.mark.parametrize(
    "draw", [plot.side_view, plot.top_view, plot.angles, plot.glide_overview]
)
def test_a_glide_that_cannot_be_drawn_is_refused(landed, draw):
    with pytest.raises(ValueError, match="dense=True"):
        draw(eqx.tree_at(lambda g: g.interpolation, landed, None))
    with pytest.raises(ValueError, match=r"batch of glides of shape \(2,\)"):
        draw(eqx.tree_at(lambda g: g.time, landed, np.zeros(2)))
    with pytest.raises(ValueError, match="not finite"):
        draw(eqx.tree_at(lambda g: g.state, landed, landed.state * np.nan))


@pytest.mark.parametrize(
    "launch",
    [
        {},
        {"height": 1e-6},
        {"f_theta": 0.0, "height": 10.0},
        {"height": 3.0, "speed": 15.0},
        {"height": 75.0},
        {"f_theta": 0.0, "height": 75.0},
    ],
)
def test_overview_fits_the_page(launch):
    figure = plot.glide_overview(fly(**launch))
    check_page(figure)
    for ax in figure.axes:
        assert 90.0 * ax.get_position().width > 14.9  # mm


# Shape space


def shapes(seed=0):
    """A made-up shape space: random values, some shapes unstable, one out of time."""
    rng = np.random.default_rng(seed)
    row, column = np.arange(10, -1, -1)[:, None], np.arange(11)[None]
    region = np.where(row - column > 2, "open", "closed")
    region = np.where(abs(row - column) <= 2, "observed", region)
    outcome = rng.choice([0, 1, 2, 3], size=(2, 11, 11), p=[0.7, 0.1, 0.1, 0.1])
    outcome[0, 3, 4] = Outcome.OUT_OF_TIME
    dims = ("f_theta", "theta_m", "nu_theta")
    return xr.Dataset(
        {
            "height_lost": (dims, rng.uniform(3, 10, (2, 11, 11))),
            "path_length": (dims, rng.uniform(2, 6, (2, 11, 11))),
            "outcome": (dims, outcome),
        },
        coords={
            "f_theta": [0.0, 1.2],
            "theta_m": THETA,
            "nu_theta": NU,
            "region": (dims[1:], region),
        },
    )


def maps(figure):
    """The four maps by (frequency, variable), and the two colour bars."""
    axes = np.array(figure.axes[:4])
    return {
        (f, name): axes[2 * f + column]
        for f in (0, 1)
        for column, name in enumerate(("height_lost", "path_length"))
    }, figure.axes[4:]


def mesh_of(ax):
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    return mesh


def test_heat_maps_show_the_data():
    dataset = shapes()
    figure = plot.shape_heatmaps(dataset)
    panels, bars = maps(figure)
    assert len(figure.axes) == 6
    for (f, name), ax in panels.items():
        mesh = mesh_of(ax)
        assert np.array_equal(mesh.get_array(), dataset[name].values[f])
        corners = mesh.get_coordinates()
        centres = (corners[1:, 1:] + corners[:-1, :-1]) / 2
        assert np.allclose(centres[..., 0], NU[None])
        assert np.allclose(centres[..., 1], THETA[:, None])
        assert ax.get_ylim()[0] < THETA[0] < THETA[-1] < ax.get_ylim()[1]
        assert ax.get_xlim()[0] < NU[0] < NU[-1] < ax.get_xlim()[1]
        # One scale of colours for both frequencies.
        assert mesh.get_clim() == (float(dataset[name].min()), float(dataset[name].max()))
    x = {key: ax.get_position().x0 for key, ax in panels.items()}
    y = {key: ax.get_position().y0 for key, ax in panels.items()}
    assert x[0, "height_lost"] == x[1, "height_lost"] < x[0, "path_length"]
    assert y[0, "height_lost"] == y[0, "path_length"] > y[1, "height_lost"]
    for bar, name in zip(bars, ("height_lost", "path_length"), strict=True):
        assert bar.get_position().x0 == pytest.approx(x[0, name])


def test_heat_maps_are_labelled_with_units():
    panels, bars = maps(plot.shape_heatmaps(shapes()))
    assert [bar.get_xlabel() for bar in bars] == ["height lost (m)", "path length (m)"]
    for f in (0, 1):
        assert panels[f, "height_lost"].get_ylabel() == r"amplitude $\theta_m$ (°)"
        assert panels[f, "path_length"].texts[0].get_text().endswith(("= 0 Hz", "= 1.2 Hz")[f])
    for name in ("height_lost", "path_length"):
        assert panels[1, name].get_xlabel() == r"waves $\nu_\theta$ (per SVL)"


def test_order_of_the_data_does_not_matter():
    dataset = shapes()
    shuffled = dataset.isel(theta_m=slice(None, None, -1), nu_theta=[3, 1, 2, 0, *range(4, 11)])
    shuffled = shuffled.transpose("nu_theta", "theta_m", "f_theta")
    figures = [plot.shape_heatmaps(data) for data in (dataset, shuffled)]
    for one, other in zip(*(figure.axes for figure in figures), strict=True):
        if one in figures[0].axes[:4]:
            assert np.array_equal(mesh_of(one).get_array(), mesh_of(other).get_array())
        for a, b in zip(one.lines, other.lines, strict=True):
            assert np.array_equal(a.get_xydata(), b.get_xydata())


def test_every_unstable_shape_is_marked():
    dataset = shapes()
    figure = plot.shape_heatmaps(dataset)
    for (f, _), ax in maps(figure)[0].items():
        outcome = dataset["outcome"].values[f]
        rows, columns = np.nonzero(np.isin(outcome, [1, 2, 3]))
        expected = set(zip(NU[columns], THETA[rows], strict=True))
        marks = drawn(ax, "unstable")
        assert len(marks) == len(expected)
        assert set(map(tuple, marks)) == expected
        other = [line.get_label() for line in ax.lines if line.get_label() != "unstable"]
        assert other == (["not finished"] if f == 0 else [])
    ax = maps(figure)[0][0, "height_lost"]
    assert np.allclose(drawn(ax, "not finished"), [[NU[4], THETA[3]]])


def test_nothing_is_marked_where_all_shapes_land():
    dataset = shapes()
    dataset["outcome"] = 0 * dataset["outcome"]
    figure = plot.shape_heatmaps(dataset)
    assert not figure.legends
    assert not [line for ax in figure.axes[:4] for line in ax.lines]


def test_missing_values_stay_blank():
    dataset = shapes()
    dataset["height_lost"][1, 2, 3] = np.nan
    mesh = mesh_of(maps(plot.shape_heatmaps(dataset))[0][1, "height_lost"])
    mask = np.ma.getmaskarray(mesh.get_array())
    assert mask.sum() == 1
    assert mask[2, 3]


def inside(collection, x, y):
    """Whether a point is inside an outline: a ray crosses it an odd number of times."""
    crossings = 0
    for (x0, y0), (x1, y1) in collection.get_segments():
        if x0 == x1 < x and min(y0, y1) < y < max(y0, y1):
            crossings += 1
    return crossings % 2 == 1


def test_regions_are_outlined_in_every_map():
    dataset = shapes()
    for ax in maps(plot.shape_heatmaps(dataset))[0].values():
        outlines = {c.get_label(): c for c in ax.collections if isinstance(c, LineCollection)}
        for name in ("observed", "open", "closed"):
            found = [[inside(outlines[name], nu, theta) for nu in NU] for theta in THETA]
            assert np.array_equal(found, dataset["region"].values == name)


def test_regions_are_named_once_inside_and_clear_of_marks():
    dataset = shapes()
    dataset["outcome"][1] = 0
    dataset["outcome"][1, :, 8:] = 1
    named = {}
    for key, ax in maps(plot.shape_heatmaps(dataset))[0].items():
        for text in ax.texts:
            if text.get_text() in ("observed", "open", "closed"):
                assert text.get_text() not in named
                named[text.get_text()] = (key, text.get_position())
    assert set(named) == {"observed", "open", "closed"}
    for name, (key, (nu, theta)) in named.items():
        assert key == (1, "height_lost")  # the frequency with the fewest marks
        cell = dataset.sel(theta_m=theta, nu_theta=nu, method="nearest")
        assert cell["region"] == name
        assert cell["outcome"][1] == 0


def test_regions_alone():
    dataset = shapes()[["region"]]
    ax = Figure().add_subplot()
    assert plot.region_outlines(ax, dataset, labels=False) is ax
    assert not ax.texts
    plot.region_outlines(ax, dataset)
    assert len(ax.texts) == 3


@pytest.mark.parametrize("name", ["height_lost", "path_length", "outcome", "region", "theta_m"])
def test_missing_variables_are_named(name):
    with pytest.raises(ValueError, match=f"no {name}"):
        plot.shape_heatmaps(shapes().drop_vars(name))


def test_wrong_dimensions_are_named():
    dataset = shapes()
    dataset["height_lost"] = dataset["height_lost"][0]
    with pytest.raises(ValueError, match="height_lost has dimensions"):
        plot.shape_heatmaps(dataset)


def test_heat_maps_fit_the_page():
    check_page(plot.shape_heatmaps(shapes()))


# House


def test_settings_of_matplotlib_are_left_alone(landed):
    before = dict(matplotlib.rcParams)
    plot.glide_overview(landed)
    plot.shape_heatmaps(shapes())
    assert dict(matplotlib.rcParams) == before
    with plot.style():
        assert matplotlib.rcParams["font.size"] == 7.0


def test_library_does_not_import_matplotlib_nor_plot_pyplot():
    code = (
        "import sys, jaxglide; assert 'matplotlib' not in sys.modules; "
        "import jaxglide.plot; assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("found", [True, False])
def test_trim_curve_shows_what_was_scanned_and_the_trim(found):
    scanned, moments = np.deg2rad([0.0, 10.0, 20.0]), np.array([-2e-4, -1e-4, 3e-4])
    trim = Trim(
        parameter="d_psi",
        unit="deg/SVL",
        value=np.deg2rad(13.5) if found else np.nan,
        moment=np.zeros(()),
        found=np.array(found),
        crossings=np.array(int(found)),
        scanned=scanned,
        moments=moments,
    )
    ax = plot.trim_curve(trim)
    assert ax.get_xlabel() == r"$d_\psi$ (° per SVL)"
    assert ax.get_ylabel() == "mean pitch moment (N mm)"
    curve = ax.lines[1]
    assert curve.get_xydata() == pytest.approx(np.array([[0, -0.2], [10, -0.1], [20, 0.3]]))
    assert [text.get_text() for text in ax.texts] == (["13.50° per SVL"] if found else [])
    assert len(ax.lines) == 2 + found
    if found:
        assert ax.lines[2].get_xydata() == pytest.approx(np.array([[13.5, 0.0]]))
