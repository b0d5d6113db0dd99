"""Figures of the wind tunnel: what is drawn is the data, labelled with units, on the page."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.transforms import Bbox

from jaxglide import Gait, Glider, Launch, Outcome, Polar, Snake, discretise, plot
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.survey import ABOUT, survey
from jaxglide.loads.coefficients import ALPHA, REYNOLDS, extended_tables
from jaxglide.tunnel.fall import Fall
from jaxglide.tunnel.glide_polar import BodyPolar, Equilibrium

PSI, BENDS, NU = [0.0, 20.0], [-20.0, -10.0, 0.0, 10.0, 20.0], [1.0, 1.25, 1.5]
RECORDS, PHASES = 7, 8
AT = {"psi_m": 20.0, "d_psi": 10.0, "nu_theta": 1.25}
OUTER = ("psi_m", "d_psi", "nu_theta")


def held_grid(seed=0):
    """A made-up survey over the grid psi_m, d_psi, nu_theta, falls of different length."""
    rng = np.random.default_rng(seed)
    shape = (len(PSI), len(BENDS), len(NU))
    last = rng.integers(3, RECORDS, shape)
    last[1, 3, 1] = 4  # the case `AT` ends before the longest fall
    flying = np.arange(RECORDS) <= last[..., None]

    def moment(size):
        drawn = size * rng.normal(0.1, 1.0, (*shape, RECORDS, PHASES, 3))
        return np.where(flying[..., None, None], drawn, np.nan)

    air, inertia = moment(1.0), moment(3.0)
    by_phase, by_record = (*OUTER, "record", "phase", "about"), (*OUTER, "record", "about")
    return xr.Dataset(
        {
            "outcome": (OUTER, np.zeros(shape, int)),
            "last": (OUTER, last),
            "aerodynamic": (by_phase, air),
            "inertial": (by_phase, inertia),
            "mean_moment": (by_record, air.mean(-2)),
            "inertial_ratio": (by_record, np.ptp(inertia, -2) / np.ptp(air, -2)),
        },
        coords={
            **{"psi_m": PSI, "d_psi": BENDS, "nu_theta": NU},
            **{"record": 0.1 * np.arange(RECORDS), "about": list(ABOUT)},
        },
    )


def listed(grid, seed=0):
    """The same cases in a list, their order shuffled."""
    cases = grid.stack(case=OUTER, create_index=False)
    return cases.isel(case=np.random.default_rng(seed).permutation(cases.sizes["case"]))


def free_grid(seed=1):
    """Made-up free glides of the same cases; the first shape of every bend tumbles."""
    rng = np.random.default_rng(seed)
    shape = (len(PSI), len(BENDS), len(NU))
    outcome = np.zeros(shape, int)
    outcome[..., 0] = Outcome.UNSTABLE_PITCH
    return xr.Dataset(
        {
            "outcome": (OUTER, outcome),
            "landing_point": ((*OUTER, "axis"), rng.uniform(0, 6, (*shape, 3))),
        },
        coords={"psi_m": PSI, "d_psi": BENDS, "nu_theta": NU, "axis": ["x", "y", "z"]},
    )


@pytest.fixture(scope="module")
def held():
    return listed(held_grid())


@pytest.fixture(scope="module")
def free():
    return listed(free_grid(), seed=5)


@pytest.fixture(scope="module")
def pitch():
    """Mean pitch moment at the last record at psi_m = 20 deg, (bend, nu)."""
    grid = held_grid().sel(psi_m=20.0, about="pitch")
    return grid.mean_moment.isel(record=grid["last"]).values


def lines(ax, label):
    """Points (T, 2) of the lines of that name, in the order drawn."""
    found = [line for line in ax.lines if line.get_label() == label]
    return [np.column_stack(line.get_data()).astype(float) for line in found]


def bend_label(bend):
    return f"{bend:g}°".replace("-", "\N{MINUS SIGN}")


def legend_texts(owner):
    legends = owner.legends if isinstance(owner, Figure) else [owner.get_legend()]
    return [text.get_text() for legend in legends for text in legend.get_texts()]


def colour_bar(figure):
    (bar,) = (ax for ax in figure.axes if ax.get_label() == "<colorbar>")
    return bar


def check_page(figure, width):
    """As wide as said; every text legible, on the page, and clear of every other."""
    assert figure.get_size_inches()[0] * 25.4 == pytest.approx(width)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    texts = [*figure.texts]
    for legend in [*figure.legends, *(ax.get_legend() for ax in figure.axes)]:
        texts += legend.get_texts() if legend else []
    for ax in figure.axes:
        texts += [*ax.texts, ax.title, ax.xaxis.label, ax.yaxis.label]
        for axis, limits in ((ax.xaxis, ax.get_xlim()), (ax.yaxis, ax.get_ylim())):
            ticks = [t for t in axis.get_major_ticks() if within(t.get_loc(), limits)]
            texts += [label for tick in ticks for label in (tick.label1, tick.label2)]
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
    assert len(boxes) > 10


def within(value, limits):
    slack = 1e-9 * np.ptp(limits)
    return min(limits) - slack <= value <= max(limits) + slack


# Figure 5 d-f


def test_landing_is_drawn_against_the_moment_of_the_same_case(free, held, pitch):
    ax = plot.landing_against_moment(free, held, psi_m=20.0)
    forward = free_grid().sel(psi_m=20.0, axis="y").landing_point.values
    for i, bend in enumerate(BENDS):
        (points,) = lines(ax, bend_label(bend))
        assert np.allclose(points, np.column_stack([pitch[i], forward[i]]))
    averages = np.concatenate(lines(ax, "average"))
    assert np.allclose(averages, np.column_stack([pitch.mean(1), forward.mean(1)]))
    assert ax.get_xlabel() == "mean pitch moment (N mm)"
    assert ax.get_ylabel() == "forward at the end, y (m)"


def test_marks_tell_shapes_and_tumbles_apart(free, held, pitch):
    ax = plot.landing_against_moment(free, held, psi_m=20.0)
    marks = [c for c in ax.collections if isinstance(c, PathCollection)]
    assert len(marks) == 2 * len(BENDS)  # landed and not, of every bend
    forward = free_grid().sel(psi_m=20.0, axis="y").landing_point.values
    for i in range(len(BENDS)):
        landed, tumbled = marks[2 * i], marks[2 * i + 1]
        assert np.allclose(landed.get_offsets(), np.column_stack([pitch[i], forward[i]])[1:])
        assert np.allclose(tumbled.get_offsets(), [[pitch[i, 0], forward[i, 0]]])
        assert len(landed.get_paths()[0].vertices) != len(tumbled.get_paths()[0].vertices)
        assert tumbled.get_sizes()[0] < landed.get_sizes()[0] < landed.get_sizes()[1]


def test_moment_by_shape_has_one_line_a_bend(held, pitch):
    ax = plot.moment_by_shape(held, psi_m=20.0)
    for i, bend in enumerate(BENDS):
        (points,) = lines(ax, bend_label(bend))
        assert np.allclose(points, np.column_stack([NU, pitch[i]]))
    assert len(ax.lines) == len(BENDS) + 1
    assert np.allclose(ax.lines[0].get_ydata(), 0.0)  # the zero line
    assert ax.get_xlabel() == r"waves $\nu_\theta$ (per SVL)"
    assert ax.get_ylabel() == "mean pitch moment (N mm)"


def test_moment_by_bend_has_one_line_a_shape_and_marks_its_zeros(held):
    known = held.copy(deep=True)
    # Straight through zero at 5, 10 and 15 degrees.
    zero = 10.0 + 20.0 * (held.nu_theta - 1.25)
    known["mean_moment"] = known.mean_moment * 0 + 0.1 * (held.d_psi - zero)
    ax = plot.moment_by_bend(known, psi_m=20.0)
    for nu, crossing in zip(NU, (5.0, 10.0, 15.0), strict=True):
        (points,) = lines(ax, f"{nu:g}")
        expected = 0.1 * (np.array(BENDS) - crossing)
        assert np.allclose(points, np.column_stack([BENDS, expected]))
    (marks,) = lines(ax, "crossings")
    assert np.allclose(marks, [[5.0, 0.0], [10.0, 0.0], [15.0, 0.0]])
    (band,) = (patch for patch in ax.patches if patch.get_label() == "zero moment")
    assert np.allclose([band.get_x(), band.get_x() + band.get_width()], [5.0, 15.0])
    assert np.allclose(ax.get_xticks(), BENDS)
    assert ax.get_xlabel() == r"bend $d_\psi$ (° per SVL)"
    assert ax.get_ylabel() == "mean pitch moment (N mm)"
    assert colour_bar(ax.figure).get_ylabel() == r"waves $\nu_\theta$ (per SVL)"
    assert np.allclose(colour_bar(ax.figure).get_ylim(), [1.0, 1.5])


def test_no_zero_is_marked_where_there_is_none(held):
    always = held.copy(deep=True)
    always["mean_moment"] = always.mean_moment * 0 - 1.0
    ax = plot.moment_by_bend(always, psi_m=20.0)
    assert not lines(ax, "crossings")
    assert not ax.patches


def test_panels_stand_together(free, held):
    figure = plot.bending_moments(free, held, psi_m=20.0)
    left, middle, right, bar = figure.axes
    alone = (
        (left, plot.landing_against_moment(free, held, psi_m=20.0)),
        (middle, plot.moment_by_shape(held, psi_m=20.0)),
        (right, plot.moment_by_bend(held, psi_m=20.0)),
    )
    for ax, single in alone:
        assert len(ax.lines) == len(single.lines)
        for a, b in zip(ax.lines, single.lines, strict=True):
            assert np.allclose(np.asarray(a.get_data(), float), np.asarray(b.get_data(), float))
    assert middle.get_shared_y_axes().joined(middle, right)
    assert middle.get_ylabel() == "mean pitch moment (N mm)"
    assert bar.get_ylabel() == r"waves $\nu_\theta$ (per SVL)"


def test_grids_and_lists_in_any_order_look_the_same(free, held):
    grid = held_grid().transpose("nu_theta", "d_psi", "psi_m", ...)
    figures = (
        (plot.moment_by_bend(data, psi_m=20.0).figure for data in (held, grid)),
        (plot.moments_in_time(data, AT) for data in (held, grid)),
        (plot.moment_ratio(data, 20.0) for data in (held, grid)),
        (
            plot.bending_moments(a, b, psi_m=20.0)
            for a, b in ((free, held), (free_grid(), grid))
        ),
    )
    for one, other in figures:
        for a, b in zip(one.axes, other.axes, strict=True):
            assert len(a.lines) == len(b.lines)
            for x, y in zip(a.lines, b.lines, strict=True):
                assert np.array_equal(x.get_xydata(), y.get_xydata(), equal_nan=True)


def test_other_vertical_amplitudes_are_left_out(held):
    ax = plot.moment_by_shape(held, psi_m=0.0)
    grid = held_grid().sel(psi_m=0.0, about="pitch")
    values = grid.mean_moment.isel(record=grid["last"]).values
    assert np.allclose(lines(ax, "0°")[0][:, 1], values[2])
    alone = held_grid().isel(psi_m=[0])
    again = plot.moment_by_shape(alone)  # only one: need not be said
    assert np.allclose(lines(again, "0°"), lines(ax, "0°"))


# Figure 6


def test_moments_in_time_show_trace_band_and_mean(held):
    figure = plot.moments_in_time(held, AT)
    one = held_grid().sel(AT)
    stop = int(one["last"]) + 1
    axes = np.array(figure.axes).reshape(3, 2)
    for row, turn in enumerate(ABOUT):
        for column, name in enumerate(("aerodynamic", "inertial")):
            ax, values = axes[row, column], one[name].sel(about=turn).values[:stop]
            time = 0.1 * np.arange(stop)
            (trace,), (mean,) = lines(ax, "one phase"), lines(ax, "mean over phases")
            assert np.allclose(trace, np.column_stack([time, values[:, 0]]))
            assert np.allclose(mean, np.column_stack([time, values.mean(1)]))
            (band,) = ax.collections
            outline = band.get_paths()[0].vertices
            for t, low, high in zip(time, values.min(1), values.max(1), strict=True):
                at = outline[np.isclose(outline[:, 0], t), 1]
                assert np.allclose([at.min(), at.max()], [low, high])
        assert axes[row, 0].get_ylabel() == f"{turn} (N mm)"
        assert axes[row, 0].get_ylim() == axes[row, 1].get_ylim()
    assert [ax.get_title() for ax in axes[0]] == ["aerodynamic moment", "inertial moment"]
    assert [ax.get_xlabel() for ax in axes[2]] == ["time, t (s)"] * 2
    assert axes[0, 0].get_xlim() == pytest.approx((0.0, 0.1 * (stop - 1)))
    assert figure.get_suptitle() == r"$\psi_m$ = 20°, $d_\psi$ = 10°, $\nu_\theta$ = 1.25"


def test_cases_are_chosen_by_number_or_by_nearest_values(held):
    near = plot.moments_in_time(held, {"psi_m": 17.0, "d_psi": 8.0, "nu_theta": 1.3})
    assert near.get_suptitle() == plot.moments_in_time(held, AT).get_suptitle()
    number = int(
        np.flatnonzero((held.psi_m == 20) & (held.d_psi == 10) & (held.nu_theta == 1.25))[0]
    )
    assert plot.moments_in_time(held, number).get_suptitle() == near.get_suptitle()


def test_ratio_has_rows_of_turns_and_columns_of_bends(held):
    figure = plot.moment_ratio(held, 20.0, case=AT)
    axes = np.array(figure.axes[:15]).reshape(3, 5)
    grid = held_grid().sel(psi_m=20.0)
    for row, turn in enumerate(ABOUT):
        for column, bend in enumerate(BENDS):
            ax = axes[row, column]
            assert ax.get_yscale() == "log"
            assert np.allclose(lines(ax, "equal")[0][:, 1], 1.0)
            for nu in NU:
                (drawn,) = lines(ax, f"{nu:g}")
                expected = grid.inertial_ratio.sel(about=turn, d_psi=bend, nu_theta=nu)
                assert np.allclose(drawn[:, 0], grid.record)
                assert np.allclose(drawn[:, 1], expected, equal_nan=True)
            assert len(ax.lines) == len(NU) + 1
        assert axes[row, 0].get_ylabel() == turn
    assert axes[0, 1].get_title() == r"$d_\psi$ = −10°"  # noqa: RUF001
    assert all(ax.get_xlabel() == "time, t (s)" for ax in axes[2])
    assert len({ax.get_ylim() for ax in axes.ravel()}) == 1
    assert colour_bar(figure).get_ylabel() == r"waves $\nu_\theta$ (per SVL)"
    assert "inertial over aerodynamic" in figure.get_supylabel()


# What is refused


@pytest.mark.parametrize("name", ["mean_moment", "last", "d_psi", "nu_theta"])
def test_missing_variables_are_named(free, held, name):
    for draw in (plot.moment_by_bend, plot.moment_by_shape):
        with pytest.raises(ValueError, match=f"no {name}"):
            draw(held.drop_vars(name), psi_m=20.0)
    with pytest.raises(ValueError, match="no landing_point"):
        plot.landing_against_moment(free.drop_vars("landing_point"), held, psi_m=20.0)
    with pytest.raises(ValueError, match="no inertial"):
        plot.moments_in_time(held.drop_vars("inertial"))
    with pytest.raises(ValueError, match="no inertial_ratio"):
        plot.moment_ratio(held.drop_vars("inertial_ratio"), 20.0)


def test_cases_that_do_not_fit_are_refused(free, held):
    with pytest.raises(ValueError, match="2 values of psi_m"):
        plot.moment_by_shape(held)
    with pytest.raises(ValueError, match=r"psi_m = 15 is none of 0\.0, 20\.0"):
        plot.moment_ratio(held, 15.0)
    with pytest.raises(ValueError, match="different cases: d_psi differs"):
        plot.landing_against_moment(free.assign_coords(d_psi=free.d_psi + 1), held, psi_m=20.0)
    with pytest.raises(ValueError, match="different cases"):
        plot.landing_against_moment(free.isel(case=slice(25)), held, psi_m=20.0)
    twice = xr.concat([held, held], dim="case")
    with pytest.raises(ValueError, match="the same d_psi and nu_theta"):
        plot.moment_by_bend(twice, psi_m=20.0)


def test_unknown_cases_are_refused(held):
    with pytest.raises(ValueError, match="case = 30"):
        plot.moments_in_time(held, 30)
    with pytest.raises(ValueError, match="no theta_m"):
        plot.moments_in_time(held, {"theta_m": 90.0})


# Figures S7 and S8


def test_force_coefficients_are_those_of_the_polars():
    figure = plot.force_coefficients()
    axes = np.array(figure.axes).reshape(3, 2)
    for column, polar in enumerate((Polar.published(), Polar.smooth())):
        for number in (3000.0, 15000.0):
            drawn = [lines(ax, f"{number:g}")[0] for ax in axes[:, column]]
            alpha = drawn[0][:, 0]
            assert alpha.min() < -89
            assert alpha.max() == 90
            lift, drag = polar(np.deg2rad(alpha), np.full(alpha.shape, number))
            for points, expected in zip(drawn, (lift, drag, lift / drag), strict=True):
                assert np.allclose(points[:, 1], expected)
    labels = ["lift, $C_L$", "drag, $C_D$", "lift to drag, $C_L/C_D$"]
    assert [ax.get_ylabel() for ax in axes[:, 0]] == labels
    assert [ax.get_xlabel() for ax in axes[2]] == ["angle of attack (°)"] * 2
    assert [ax.get_title() for ax in axes[0]] == ["published polar", "smooth polar"]
    assert set(legend_texts(figure)) == {"3000", "7000", "11000", "15000"}
    assert figure.legends[0].get_title().get_text().startswith("Reynolds number")


def test_measurements_are_dots_and_the_rest_is_grey():
    figure = plot.force_coefficients({"more lift": Polar.smooth(1.36)}, [5000.0, 6000.0])
    lift, drag = extended_tables()
    column = list(REYNOLDS).index(5000.0)
    for ax, table in zip(figure.axes, (lift, drag, lift / drag), strict=True):
        (dots,) = lines(ax, "measured")  # nothing was measured at 6000
        assert np.allclose(dots[:, 0], ALPHA[:15])
        assert np.allclose(dots[:, 1], table[:15, column])
        grey = [patch for patch in ax.patches if patch.get_label() == "not measured"]
        spans = [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in grey]
        assert spans == [(-90.0, -10.0), (60.0, 90.0)]
    assert figure.axes[0].texts[0].get_text() == "not\nmeasured"


@pytest.mark.parametrize(
    ("polars", "reynolds", "message"),
    [({}, [3000.0], "nothing"), (None, [], "nothing"), (None, [-1.0], "reynolds = -1")],
)
def test_no_polar_or_reynolds_number_is_refused(polars, reynolds, message):
    with pytest.raises(ValueError, match=message):
        plot.force_coefficients(polars, reynolds)


@pytest.mark.parametrize("node_set", ["published", "gauss"])
def test_morphology_is_the_snakes(node_set):
    snake = Snake.from_svl(0.8, mass=0.05, nodes=30, node_set=node_set)
    sections = discretise(snake)
    figure = plot.morphology(snake)
    chord, density = (lines(ax, "nodes")[0] for ax in figure.axes)
    assert np.allclose(chord, np.column_stack([sections.fraction, 1e3 * sections.chord]))
    width = 100 * np.asarray(sections.area / sections.chord)  # of the elements [cm]
    assert np.sum(density[:, 1] * width) == pytest.approx(50.0)  # g
    assert np.allclose(density[:, 1] * width, 1e3 * sections.mass)
    middles = (
        lines(figure.axes[0], "middle of the area"),
        lines(figure.axes[1], "middle of the mass"),
    )
    for (line,), weight in zip(middles, (sections.area, sections.mass), strict=True):
        assert np.allclose(line[:, 0], np.average(sections.fraction, weights=weight))
    assert figure.axes[0].get_ylabel() == "chord, $c$ (mm)"
    assert figure.axes[1].get_ylabel() == "mass per length (g/cm)"
    assert figure.axes[1].get_xlabel() == "arc length, $s$ (fraction of SVL)"
    assert all(ax.get_ylim()[0] == 0 for ax in figure.axes)
    assert figure.axes[0].get_xlim() == (0.0, 1.0)
    area = 1e4 * float(np.sum(sections.area))
    assert figure.get_suptitle() == f"length 80 cm, 50 g, wing area {area:.3g} cm²"


# Glide polar


@pytest.fixture(scope="module")
def parts():
    """A made-up polar, field, equilibrium and held glide."""
    alpha = np.deg2rad(np.linspace(-20, 90, 111))
    lift, drag = np.sin(2 * alpha), 0.4 + np.sin(alpha) ** 2
    polar = BodyPolar(alpha, lift, drag, lift, drag, lift / drag)
    v_y, v_z = np.linspace(0, 8, 17), np.linspace(-6, 0, 13)
    rate = np.stack(np.broadcast_arrays(6.0 - v_y[:, None], -3.0 - v_z[None]), axis=-1)
    rest = Equilibrium(np.array([6.0, -3.0]), np.arctan2(3.0, 6.0), np.array(True), True)
    states = np.full((9, 4), np.nan)
    states[:7, 2:] = np.column_stack([np.linspace(1, 4, 7), np.linspace(0, -5, 7)])
    states[:7, :2] = np.linspace([0, 10], [4, -0.2], 7)
    glider = Glider(Snake.from_svl(nodes=8), Gait.from_degrees())
    end = np.array([3.9, 0.0, 3.9, -4.9])
    fallen = Fall(
        glider, Launch(), np.zeros(3), np.array(0), np.array(1.45), end, np.array(0.25), states
    )
    return polar, (v_y, v_z, rate), rest, fallen


def test_glide_polar_shows_lift_to_drag_and_the_best(parts):
    polar, _, rest, _ = parts
    left = plot.glide_polar_figure(*parts).axes[0]
    (curve,) = lines(left, "undulating body, level")
    assert np.allclose(
        curve, np.column_stack([np.rad2deg(polar.angle_of_attack), polar.lift_to_drag])
    )
    (steady,) = lines(left, r"steady glide: cot $\alpha$")
    assert np.allclose(steady[:, 1] * np.tan(np.deg2rad(steady[:, 0])), 1.0)
    assert np.allclose(lines(left, "equilibrium"), [[np.rad2deg(rest.glide_angle), 2.0]])
    best = int(np.argmax(polar.lift_to_drag))
    angle = np.rad2deg(polar.angle_of_attack[best])
    assert left.texts[0].get_text() == f"best {polar.lift_to_drag[best]:.2f} at {angle:.0f}°"
    assert left.get_xlabel() == r"angle of attack, $\alpha$ (°)"
    assert left.get_ylabel() == "lift to drag of the body"
    assert left.get_xlim() == pytest.approx((-20, 90))


def test_velocity_polar_has_field_equilibrium_and_fall(parts):
    _, (_, _, rate), _, fallen = parts
    figure = plot.glide_polar_figure(*parts)
    right, bar = figure.axes[1:]
    assert np.allclose(lines(right, "equilibrium, 26.6° down"), [[6.0, -3.0]])
    (path,) = lines(right, "held glide")
    # Six records in flight, then the end: not the record past the ground.
    assert np.allclose(path, [*fallen.states[:6, 2:], fallen.state[2:]])
    (rings,) = lines(right, "every 0.5 s")
    assert np.allclose(rings, fallen.states[[0, 2, 4], 2:])
    assert (right.get_xlim(), right.get_ylim()) == ((0, 8), (-6, 0))
    assert right.get_aspect() == 1
    assert right.get_xlabel() == "forward velocity, $v_y$ (m/s)"
    assert right.get_ylabel() == "vertical velocity, $v_z$ (m/s)"
    assert bar.get_ylabel() == "acceleration (m/s²)"
    size = np.hypot(rate[..., 0], rate[..., 1])
    assert bar.get_ylim()[1] == pytest.approx(np.ceil(size.max()))
    assert right.collections  # contours and streamlines


def test_streamlines_follow_the_field(parts):
    """They end at the equilibrium, which draws everything in: x and y are not swapped."""
    right = plot.glide_polar_figure(*parts).axes[1]
    (streams,) = (
        c for c in right.collections if hasattr(c, "get_segments") and c.get_segments()
    )
    for path in streams.get_segments():
        start, moved = path[:-1], np.diff(path, axis=0)
        off = np.array([6.0, -3.0]) - start
        far = np.linalg.norm(off, axis=1) > 0.5
        off, moved = off[far], moved[far]
        assert (np.sum(off * moved, axis=1) >= -1e-9).all()
        assert np.abs(off[:, 0] * moved[:, 1] - off[:, 1] * moved[:, 0]).max(initial=0) < 1e-2


def test_what_is_not_there_is_not_drawn(parts):
    polar, field, rest, _ = parts
    figure = plot.glide_polar_figure(polar, field, replace(rest, found=np.array(False)))
    left, right = figure.axes[:2]
    assert not [x for ax in (left, right) for x in ax.lines if "equil" in str(x.get_label())]
    assert not lines(right, "held glide")


def test_fields_of_other_shapes_are_refused(parts):
    polar, (v_y, v_z, rate), rest, _ = parts
    with pytest.raises(ValueError, match=r"shape \(13, 17, 2\)"):
        plot.glide_polar_figure(polar, (v_y, v_z, rate.transpose(1, 0, 2)), rest)


# House


def test_figures_fit_the_page(free, held, parts):
    check_page(plot.bending_moments(free, held, psi_m=20.0), 180.0)
    check_page(plot.landing_against_moment(free, held, psi_m=20.0).figure, 90.0)
    check_page(plot.moment_by_shape(held, psi_m=20.0).figure, 90.0)
    check_page(plot.moment_by_bend(held, psi_m=20.0).figure, 90.0)
    check_page(plot.moments_in_time(held, AT), 180.0)
    check_page(plot.moment_ratio(held, 20.0, case=AT), 180.0)
    check_page(plot.force_coefficients(), 90.0)
    check_page(plot.morphology(Snake.from_svl()), 90.0)
    check_page(plot.glide_polar_figure(*parts), 180.0)


def test_panels_draw_on_given_axes_without_a_key(free, held):
    for draw, data in (
        (plot.landing_against_moment, (free, held)),
        (plot.moment_by_shape, (held,)),
        (plot.moment_by_bend, (held,)),
    ):
        figure = Figure()
        ax = figure.add_subplot()
        assert draw(*data, ax, psi_m=20.0, key=False) is ax
        assert figure.axes == [ax]
        assert ax.get_legend() is None


def test_settings_of_matplotlib_are_left_alone(free, held, parts):
    before = dict(matplotlib.rcParams)
    plot.bending_moments(free, held, psi_m=20.0)
    plot.moments_in_time(held, AT)
    plot.glide_polar_figure(*parts)
    assert dict(matplotlib.rcParams) == before


def test_a_survey_can_be_drawn():
    grid = {"d_psi": [0.0, 20.0], "nu_theta": [1.1, 1.4]}
    study = Study(grid, fixed={"height": 1.0}, setup={"nodes": 20})
    data = survey(study, phases=4, interval=0.1)
    ax = plot.moment_by_bend(data)
    ends = data.mean_moment.sel(about="pitch").isel(record=data["last"])
    for nu in (1.1, 1.4):
        (points,) = lines(ax, f"{nu:g}")
        assert np.isfinite(points).all()
        assert np.allclose(points[:, 1], ends.sel(nu_theta=nu))
    figure = plot.moments_in_time(data, {"d_psi": 20.0, "nu_theta": 1.4})
    assert figure.get_suptitle() == r"$d_\psi$ = 20°, $\nu_\theta$ = 1.4"
    assert len(plot.moment_ratio(data).axes) == 3 * 2 + 1


# Figure 5 b and c


@pytest.mark.parametrize("quantity", ["path", "pitch"])
@pytest.mark.parametrize("outcome", [Outcome.LANDED, Outcome.UNSTABLE_ROLL])
def test_a_cross_is_drawn_where_a_glide_does_not_land_and_explained(quantity, outcome):
    path, end = np.zeros((2, 3, 3)), [[0.0, 4.0, 0.0], [0.0, 2.0, 5.0]]
    data = xr.Dataset(
        {
            "position": (("case", "sample", "axis"), path),
            "angles": (("case", "sample", "turn"), path),
            "landing_point": (("case", "axis"), end),
            "end_angles": (("case", "turn"), end),
            "time": ("case", [2.0, 1.5]),
            "outcome": ("case", [0, int(outcome)]),
        },
        coords={
            "axis": list("xyz"),
            "turn": ["yaw", "pitch", "roll"],
            "sample": [0.0, 0.5, 1.0],
            **{name: ("case", [20.0, 20.0]) for name in ("psi_m", "nu_theta")},
            "d_psi": ("case", [-10.0, 10.0]),
        },
    )
    figure = plot.bending_grid(data, quantity)
    crosses = [
        line.get_xydata()[0]
        for ax in figure.axes
        for line in ax.lines
        if line.get_marker() == "x"
    ]
    told = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert figure.axes[0].get_title() == "$d_\\psi$ = \N{MINUS SIGN}10°"
    if outcome == Outcome.LANDED:
        assert (crosses, told) == ([], [])
        return
    np.testing.assert_allclose(crosses, [end[1][1:] if quantity == "path" else [1.5, 2.0]])
    assert told == ["does not land"]
