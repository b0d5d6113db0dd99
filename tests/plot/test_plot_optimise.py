"""Figures of optimisations: what is drawn is the history, labelled with units, on the page."""

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection, QuadMesh
from matplotlib.quiver import Quiver
from matplotlib.transforms import Bbox

from jaxglide import Gait, Glider, Launch, Outcome, Snake, plot, simulate

NAMES = ["theta_m", "nu_theta", "d_psi"]
LOW, HIGH = np.array([80.0, 1.0, -20.0]), np.array([120.0, 1.5, 30.0])
STEPS, STARTS = 6, 4
NODES = 20


def made_up(seed=0):
    """A history as `optimise` keeps it.

    Start 0 climbs; start 1 is highest but never feasible; start 2 is feasible from its third
    step on; start 3 ends after two steps.
    """
    rng = np.random.default_rng(seed)
    point = rng.uniform(LOW, HIGH, (STEPS, STARTS, 3))
    value = rng.uniform(1.0, 5.0, (STEPS, STARTS))
    value[:, 1] += 10.0
    violation = np.zeros((STEPS, STARTS))
    violation[:, 1], violation[:2, 2] = 0.5, 2e-3
    for part in (point, value, violation):
        part[2:, 3] = np.nan
    met = np.where(violation <= 1e-3, value, -np.inf)
    last = np.where(np.isfinite(met).any(axis=0), np.argmax(met, axis=0), 0)
    each, starts = ("step", "start"), np.arange(STARTS)
    about = {"units": "m", "long_name": "landing_distance"}
    return xr.Dataset(
        {
            "point": ((*each, "parameter"), point),
            "value": (each, value, about),
            "violation": (each, violation),
            "gradients": ("step", np.array([4, 4, 3, 3, 3, 3])),
            "glides": ("step", np.zeros(STEPS, int)),
            "best_point": (("start", "parameter"), point[last, starts]),
            "best_value": ("start", value[last, starts], about),
            "best_violation": ("start", violation[last, starts]),
            "status": ("start", np.array([1, 2, 1, 0])),
        },
        coords={
            "parameter": NAMES,
            "low": ("parameter", LOW),
            "high": ("parameter", HIGH),
        },
    )


def ground():
    """A made-up sweep over the first two parameters; one corner tumbles."""
    theta, nu = np.linspace(80, 120, 5), np.linspace(1, 1.5, 4)
    place = np.random.default_rng(2).uniform(2, 7, (5, 4, 3))
    outcome = np.zeros((5, 4), int)
    outcome[-1, -1] = Outcome.UNSTABLE_ROLL
    dims = "theta_m", "nu_theta"
    return xr.Dataset(
        {"landing_point": ((*dims, "axis"), place), "outcome": (dims, outcome)},
        coords={"theta_m": theta, "nu_theta": nu, "axis": ["x", "y", "z"]},
    )


@pytest.fixture
def history():
    return made_up()


@pytest.fixture(scope="module")
def glides():
    """Two glides whose launch is given in full: one compilation."""

    def fly(theta_m, d_psi):
        gait = Gait.from_degrees(theta_m=theta_m, d_psi=d_psi)
        launch = Launch(1.0, 1.75, phi_theta=0.0, angles=np.deg2rad([0.0, -5.0, -5.0]))
        glider = Glider(Snake.from_svl(0.7, nodes=NODES), gait)
        return simulate(glider, launch, dense=True)

    return fly(96.5, 10.0), fly(85.0, 5.0)


def drawn(ax, label):
    """Points (T, 2) of the only line of that name."""
    (line,) = (line for line in ax.lines if line.get_label() == label)
    return np.column_stack([np.asarray(line.get_xdata()), np.asarray(line.get_ydata())])


def words(figure):
    """Everything written on the page."""
    texts = figure.findobj(matplotlib.text.Text)
    return " ".join(text.get_text() for text in texts)


def shown(figure):
    """Texts that are drawn: not the tick labels outside their axes' limits."""
    yield from figure.texts
    for legend in figure.findobj(matplotlib.legend.Legend):
        yield from legend.get_texts()
    for ax in figure.axes:
        yield from (*ax.texts, ax.title, ax.xaxis.label, ax.yaxis.label)
        for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
            for tick in axis.get_major_ticks():
                if min(limits) <= tick.get_loc() <= max(limits):
                    yield from (tick.label1, tick.label2)


def assert_on_page(figure):
    """Every text is legible and none sticks out of the figure."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    across, up = canvas.get_width_height()
    page = Bbox.from_bounds(-2, -2, across + 4, up + 4)
    texts = [t for t in shown(figure) if t.get_visible() and t.get_text().strip()]
    assert len(texts) > 8
    for text in texts:
        assert 6.0 <= text.get_fontsize() <= 8.0, text
        box = text.get_window_extent(canvas.get_renderer())
        assert page.x0 <= box.x0 < box.x1 <= page.x1, text
        assert page.y0 <= box.y0 < box.y1 <= page.y1, text


def running(values):
    """Running maximum by a loop, NaN before the first value that counts."""
    best, rows = np.full(values.shape[1], -np.inf), []
    for row in values:
        best = np.where(np.isfinite(row) & (row > best), row, best)
        rows.append(np.where(np.isfinite(best), best, np.nan))
    return np.array(rows)


def feasible(history):
    return np.where(history.violation.values <= 1e-3, history.value.values, np.nan)


def test_convergence_is_the_best_feasible_value_so_far(history):
    left, right = plot.convergence(history).axes[:2]
    best = running(feasible(history))
    (lines,) = (c for c in left.collections if isinstance(c, LineCollection))
    assert len(lines.get_paths()) == STARTS
    for start, line in enumerate(lines.get_paths()):
        whole = np.isfinite(best[:, start])
        assert len(line.vertices) == whole.sum()
        if start != 1:  # which is never feasible
            np.testing.assert_allclose(line.vertices[:, 1], best[whole, start])
            np.testing.assert_allclose(line.vertices[:, 0], 1 + np.flatnonzero(whole))
    leader = np.nanmax(best, axis=1)
    np.testing.assert_allclose(drawn(left, "best start")[:, 1], leader)
    np.testing.assert_allclose(drawn(left, "median start")[:, 1], np.nanmedian(best, axis=1))
    np.testing.assert_allclose(drawn(right, "best")[:, 1], leader)
    assert "landing distance (m)" in left.get_ylabel()


def test_convergence_counts_what_was_tried(history):
    right = plot.convergence(history).axes[1]
    cost = np.cumsum([4, 4, 3, 3, 3, 3])
    np.testing.assert_allclose(drawn(right, "best")[:, 0], cost)
    assert right.get_xlabel() == "gradients"
    right = plot.convergence(history, glides_per_gradient=4.5).axes[1]
    np.testing.assert_allclose(drawn(right, "best")[:, 0], 4.5 * cost)
    assert "glides" in right.get_xlabel()
    older = history.drop_vars(["gradients", "glides"])
    right = plot.convergence(older).axes[1]
    np.testing.assert_allclose(drawn(right, "best")[:, 0], cost)


def test_convergence_goes_on_to_the_end_of_the_sampling(history):
    """Two rounds from the first start: one that finds more, one that does not."""
    rounds = history.isel(step=[0, 0]).copy(deep=True)
    for name in ("point", "value", "violation"):
        rounds[name][:, 1:] = np.nan
    rounds["violation"][:] = 0.0
    rounds["value"][:, 0] = [7.734, 7.0]
    rounds["gradients"][:], rounds["glides"][:] = 0, 256
    ends = {name: history[name] for name in history if "step" not in history[name].dims}
    whole = xr.concat([history.drop_vars(ends), rounds.drop_vars(ends)], "step").assign(ends)
    left, right = plot.convergence(whole).axes[:2]
    assert drawn(left, "best start")[-2:].tolist() == [[7, 7.734], [8, 7.734]]
    assert [text.get_text() for text in right.texts] == ["7.734 m"]
    np.testing.assert_allclose(drawn(right, "best")[-3:, 0], 20)
    (span,) = left.patches
    assert span.get_x() == 6.5
    assert span.get_x() + span.get_width() == 8
    assert "round of sampling" in left.get_xlabel()
    right = plot.convergence(whole, glides_per_gradient=4.5).axes[1]
    np.testing.assert_allclose(drawn(right, "best")[-3:, 0], 90 + np.array([0, 256, 512]))
    assert_on_page(plot.convergence(whole))


def test_convergence_shows_how_many_met_the_constraints(history):
    other = plot.convergence(history).axes[2]
    np.testing.assert_allclose(
        drawn(other, "met the constraints")[:, 1], [50, 50, 75, 75, 75, 75]
    )


def test_convergence_without_a_feasible_start(history):
    history["violation"][:] = 1.0
    left = plot.convergence(history).axes[0]
    assert not any(line.get_label() == "best start" for line in left.lines)


def test_paths_are_those_of_the_starts(history):
    ax = plot.paths(history).axes[0]
    within, outside = (c for c in ax.collections if type(c) is LineCollection)
    points = history.point.values[..., [1, 0]]
    assert [len(line) for line in within.get_segments()] == [6, 6, 2]
    np.testing.assert_allclose(within.get_segments()[0], points[:, 0])
    np.testing.assert_allclose(outside.get_segments()[0], points[:, 1])
    np.testing.assert_allclose(drawn(ax, "start"), points[0])
    assert r"\nu" in ax.get_xlabel()
    assert "°" in ax.get_ylabel()


def test_paths_star_the_best_within_the_constraints(history):
    ax = plot.paths(history).axes[0]
    values = np.nanmax(feasible(history), axis=0, initial=-np.inf)
    leader = int(np.argmax(np.nan_to_num(values, neginf=-1e9)))
    assert leader != 1  # the highest does not meet them
    best = history.best_point.values[leader, [1, 0]]
    np.testing.assert_allclose(drawn(ax, "best")[0], best)
    (dots,) = (c for c in ax.collections if type(c) is PathCollection)
    assert len(dots.get_offsets()) == 3
    np.testing.assert_allclose(dots.get_array(), history.best_value.values[[0, 2, 3]])


def test_paths_over_other_parameters(history):
    ax = plot.paths(history, parameters=("d_psi", "theta_m")).axes[0]
    np.testing.assert_allclose(drawn(ax, "start"), history.point.values[0][:, [2, 0]])
    low, high = ax.get_xlim()
    assert low <= -20
    assert high >= 30
    with pytest.raises(ValueError, match="psi_m"):
        plot.paths(history, parameters=("psi_m", "theta_m"))


def test_paths_over_the_distance_of_a_sweep(history):
    data = ground()
    ax = plot.paths(history, data).axes[0]
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    shown = np.ma.filled(mesh.get_array().astype(float), np.nan).reshape(5, 4)
    expected = data.landing_point.sel(axis="y").values.copy()
    expected[-1, -1] = np.nan  # tumbles
    np.testing.assert_allclose(shown, expected)
    (dots,) = (c for c in ax.collections if type(c) is PathCollection)
    assert dots.norm is mesh.norm  # one scale for both
    with pytest.raises(ValueError, match="sweep is not over"):
        plot.paths(history, data.rename(theta_m="psi_m"))


def shapes(third=0.25):
    """Distance 3 + 0.02 theta_m - 4 nu_theta, one shape tumbling."""
    theta, nu = np.linspace(119, 91, 5), np.linspace(1, 1.5, 6)
    dims = "theta_m", "nu_theta"
    outcome = np.zeros((5, 6), int)
    outcome[0, 5] = Outcome.UNSTABLE_PITCH
    gradient = np.tile([0.02, -4.0, third], (5, 6, 1))
    gradient[0, 0, 2] = -0.5
    distance = 3 + 0.02 * theta[:, None] - 4 * nu
    return xr.Dataset(
        {
            "distance": (dims, distance),
            "outcome": (dims, outcome),
            "gradient": ((*dims, "parameter"), gradient),
        },
        coords={"theta_m": theta, "nu_theta": nu, "parameter": NAMES},
    )


def test_sensitivity_arrows_point_uphill():
    ax = plot.sensitivity_map(shapes()).axes[0]
    (arrows,) = (c for c in ax.collections if isinstance(c, Quiver))
    places = np.asarray(arrows.get_offsets())
    assert len(places) == 29  # none where it tumbles
    assert not (np.isclose(places, [1.5, 119.0])).all(axis=1).any()
    uphill = np.array([-4.0 * 0.5, 0.02 * 28.0])  # per range of the axes
    along = np.stack([arrows.U, arrows.V], axis=1)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    np.testing.assert_allclose(along, np.tile(uphill / np.linalg.norm(uphill), (29, 1)))


def test_sensitivity_maps_lie_over_their_shapes():
    data = shapes()
    axes = plot.sensitivity_map(data).axes
    ordered = data.sortby("theta_m")
    for ax, values in (
        (axes[0], ordered.distance.values),
        (axes[1], ordered.gradient.sel(parameter="d_psi").values),
    ):
        (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
        np.testing.assert_allclose(np.asarray(mesh.get_array()).reshape(5, 6), values)
        np.testing.assert_allclose(drawn(ax, "tumbles"), [[1.5, 119.0]])
    (mesh,) = (c for c in axes[1].collections if isinstance(c, QuadMesh))
    assert mesh.norm(0.0) == pytest.approx(0.5)  # no slope is the middle of the colours


def test_sensitivity_without_what_it_needs():
    with pytest.raises(ValueError, match="gradient"):
        plot.sensitivity_map(shapes().drop_vars("gradient"))


def test_before_and_after_are_the_two_glides(glides):
    figure = plot.before_and_after(*glides, ("old", "new"))
    side, *turns = figure.axes[:4]
    for glide, name in zip(glides, ("old", "new"), strict=True):
        times = np.asarray(drawn(turns[0], name)[:, 0])
        states = np.asarray(glide.at(times))
        np.testing.assert_allclose(drawn(side, name)[:-1], states[:-1, [1, 2]], atol=1e-9)
        end = np.asarray(glide.landing_point)[[1, 2]]
        np.testing.assert_allclose(drawn(side, name)[-1], end, atol=1e-9)
        for k, ax in enumerate(turns):
            curve = drawn(ax, name)[:-1, 1]
            np.testing.assert_allclose(curve, np.rad2deg(states[:-1, 9 + k]), atol=1e-6)
        (bodies,) = (c for c in side.collections if c.get_label() == f"body, {name}")
        shapes = np.array(bodies.get_segments())
        assert shapes.shape == (7, NODES, 2)
        centres = np.asarray(glide.at(np.linspace(0.0, float(glide.time), 7)))[:, [1, 2]]
        np.testing.assert_allclose(shapes.mean(axis=1), centres, atol=0.03)  # bodies of 0.2 m
        assert f"{name}, {float(glide.landing_point[1]):.2f} m" in words(figure)
    assert [ax.get_ylabel() for ax in turns] == ["yaw (°)", "pitch (°)", "roll (°)"]


def test_before_and_after_bodies_have_their_length(glides):
    figure = plot.before_and_after(*glides)
    for ax, theta in zip(figure.axes[4:6], ("96.5", "85.0"), strict=True):
        above, right = drawn(ax, "above"), drawn(ax, "right")
        np.testing.assert_allclose(above[:, 0], right[:, 0])
        steps = np.column_stack([np.diff(above, axis=0), np.diff(right[:, 1])])
        length = np.linalg.norm(steps, axis=1).sum()
        assert 0.9 * 66.5 < length < 66.5  # cm: 19 of 20 parts of 70, along chords
        assert above[0, 0] > above[-1, 0]  # the head is forward
        assert theta in ax.get_title()


def test_everything_is_on_the_page(history, glides):
    figures = [
        plot.convergence(history, glides_per_gradient=4.0),
        plot.paths(history),
        plot.paths(history, ground()),
        plot.sensitivity_map(shapes()),
        plot.before_and_after(*glides, ("best published shape", "optimised gait")),
    ]
    for figure in figures:
        assert_on_page(figure)


@pytest.mark.parametrize("name", ["value", "violation", "best_point"])
def test_what_is_no_history_is_refused(history, name):
    with pytest.raises(ValueError, match="history"):
        plot.paths(history.drop_vars(name))


def test_an_empty_history_is_refused(history):
    with pytest.raises(ValueError, match="no steps"):
        plot.convergence(history.isel(step=slice(0)))
