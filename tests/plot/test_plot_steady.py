"""Pictures of steady glides: helix, angles and multipliers are where they should be."""

import dataclasses

import numpy as np
import pytest
from made_steady import FORWARD, SINK, made_branch, made_steady, on_the_way
from matplotlib.patches import Circle
from test_plot import check_page, drawn

from jaxglide import plot
from jaxglide.files import steady_dataset
from jaxglide.plot.saved import draw


def words(ax):
    """Of the axes' legend."""
    return [text.get_text() for text in ax.get_legend().get_texts()]


@pytest.fixture(scope="module")
def helix():
    return made_steady(-1.1, 1.3)


@pytest.fixture(scope="module")
def figure(helix):
    return plot.steady(helix, cycles=3)


def test_the_orbit_is_drawn_to_scale_and_in_time(helix, figure):
    side, top, angles, speeds = figure.axes
    end = 3 * float(helix.period)
    times = np.linspace(0, end, 400)
    wanted = on_the_way(times, -1.1, heading=0.0, f_theta=1 / float(helix.period))
    np.testing.assert_allclose(drawn(side, "path"), wanted[:, 1:3], atol=2e-3)  # linear between
    np.testing.assert_allclose(drawn(top, "path"), wanted[:, :2], atol=2e-3)
    np.testing.assert_allclose(drawn(angles, "roll")[:, 1], np.rad2deg(wanted[:, 11]), atol=0.1)
    np.testing.assert_allclose(drawn(angles, "yaw")[-1, 0], end, rtol=1e-12)
    np.testing.assert_allclose(drawn(speeds, "sinking")[:, 1], SINK, rtol=1e-12)
    speed, forward = (drawn(speeds, name)[:, 1] for name in ("speed", "forward"))
    np.testing.assert_allclose(speed**2, forward**2 + SINK**2, rtol=1e-12)
    assert abs(forward.mean() - FORWARD) < 0.05
    assert figure.get_suptitle() == "26.6° below the horizontal, spectral radius 1.300 a cycle"
    assert [ax.get_ylabel() for ax in figure.axes[2:]] == ["angle (°)", "speed (m/s)"]


def test_the_orbit_fits_its_page(figure):
    check_page(figure)


def test_words_of_a_piece_of_flight_are_no_launch_and_no_landing(figure):
    (legend,) = figure.legends
    said = [text.get_text() for text in legend.get_texts()]
    assert said == ["centre of mass", "body", "head", "start", "end"]


def test_every_multiplier_of_one_glide_is_drawn_and_named(helix):
    ax = plot.spectrum(helix)
    (disc,) = (patch for patch in ax.patches if isinstance(patch, Circle))
    assert (disc.center, disc.radius) == ((0, 0), 1.0)
    assert ax.get_aspect() == 1
    points = np.concatenate(
        [line.get_xydata() for line in ax.lines if len(line.get_label()) > 9]
    )
    found = np.sort_complex(points @ [1, 1j])
    np.testing.assert_allclose(
        found, np.sort_complex(np.asarray(helix.multipliers)), atol=1e-15
    )
    said = words(ax)
    assert len(said) == len(helix.modes) == 7
    assert said[0].startswith("1.30   ")
    assert max(map(abs, ax.get_xlim())) > 1.3
    check_page(ax.figure, 14)


def test_several_glides_are_told_apart():
    glides = [made_steady(radius=r) for r in (0.4, 0.9, 2.0)]
    ax = plot.spectrum(glides, labels=["$a$", "b", "c"])
    assert words(ax) == [r"\$a\$", "b", "c"]
    marked = [line for line in ax.lines if len(line.get_xdata()) == 8]
    assert len({(line.get_color(), line.get_marker()) for line in marked}) == 3
    radii = [np.hypot(*line.get_xydata().T).max() for line in marked]
    np.testing.assert_allclose(radii, [0.5, 0.9, 2.0], rtol=1e-12)
    many = plot.spectrum([made_steady()] * 20)
    assert len(words(many)) == 20
    check_page(many.figure, 28)


@pytest.mark.parametrize(
    ("call", "error", "said"),
    [
        (lambda g: plot.steady(g, cycles=0), ValueError, "cycles = 0 is not allowed"),
        (lambda g: plot.steady(g, frames=-1), ValueError, "frames = -1 is not allowed"),
        (lambda g: plot.steady(1.0), TypeError, "glide must be of type SteadyGlide, not float"),
        (
            lambda g: plot.steady(made_steady(found=False)),
            ValueError,
            "no steady glide to draw",
        ),
        (lambda g: plot.spectrum([]), ValueError, "glides is empty"),
        (
            lambda g: plot.spectrum([g, made_steady(found=False)]),
            ValueError,
            "to draw: the sea",
        ),
        (lambda g: plot.spectrum([g], labels=["a", "b"]), ValueError, "labels has 2 for 1"),
    ],
)
def test_what_cannot_be_drawn_is_refused(helix, call, error, said):
    with pytest.raises(error, match=said):
        call(helix)


def test_a_saved_one_is_drawn_as_the_glide_itself(helix):
    for given in (helix, steady_dataset(helix), (helix, helix)):
        drawing = draw(given)
        assert drawing.said == "two cycles of the steady glide"
        assert len(drawing.figure.axes) == 4
    ours, theirs = draw(steady_dataset(helix), "spectrum"), plot.spectrum(helix)
    said = [
        [t.get_text() for t in ax.get_legend().get_texts()]
        for ax in (ours.figure.axes[0], theirs)
    ]
    assert said[0] == said[1]
    assert len(words(draw((helix, helix), "spectrum").figure.axes[0])) == 2
    velocity = draw(steady_dataset(helix), "velocity", at={"axis": "z"}).figure.axes[0]
    np.testing.assert_allclose(velocity.lines[0].get_ydata(), -SINK)


# Branches


def test_a_branch_is_solid_where_it_is_stable_and_dashed_where_not():
    branch = made_branch()
    figure = plot.branch(branch)
    angles, radii = figure.axes
    both = (angles, np.rad2deg(branch.glide_angle)), (radii, branch.spectral_radius)
    for ax, values in both:
        solid, dashed = (drawn(ax, name) for name in ("stable", "unstable"))
        last = int(branch.stable.sum()) - 1
        wanted = np.column_stack([branch.parameter, values])
        np.testing.assert_array_equal(solid, wanted[: last + 1])
        np.testing.assert_array_equal(dashed, wanted[last:])
        styles = {line.get_label(): line.get_linestyle() for line in ax.lines}
        assert (styles["stable"], styles["unstable"]) == ("-", "--")
        for kind in ("fold", "pair", "start"):
            np.testing.assert_array_equal(drawn(ax, kind), wanted[branch.kinds == kind])
    assert radii.get_xlabel() == r"$f_\theta$ (Hz)"
    said = [text.get_text() for text in figure.legends[0].get_texts()]
    assert said == ["stable", "unstable", "fold", "starts to swing", "start"]
    check_page(figure)


def test_a_branch_of_many_radii_is_drawn_on_a_logarithmic_scale():
    branch = made_branch()
    branch.multipliers[:, 0] **= 6
    assert plot.branch(branch).axes[1].get_yscale() == "log"
    assert plot.branch(made_branch()).axes[1].get_yscale() == "linear"


def test_a_saved_branch_is_drawn_as_the_branch_itself():
    data = made_branch().dataset()
    drawing = draw(data)
    assert drawing.said == "the branch, and where it is stable"
    ours, theirs = drawing.figure.axes[0], plot.branch(made_branch()).axes[0]
    np.testing.assert_array_equal(drawn(ours, "unstable"), drawn(theirs, "unstable"))
    assert draw(data, "speed").said == "speed over point"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data.drop_vars("spectral_radius"), "have no variable 'spectral_radius'"),
        (lambda data: data.drop_vars("parameter"), "have no variable 'parameter'"),
        (lambda data: data.isel(point=slice(0)), "have 0 entries over 'point'"),
        (lambda data: data.assign(spectral_radius=-data.spectral_radius), "is not allowed"),
        (lambda data: data.assign(kind=data.spectral_radius), "where names are needed"),
    ],
)
def test_what_is_no_branch_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        plot.branch(change(made_branch().dataset()))


def test_no_branch_says_why():
    with pytest.raises(ValueError, match="there is no branch to draw: here"):
        plot.branch(dataclasses.replace(made_branch(), found=False))
