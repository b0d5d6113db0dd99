"""Figures over one or two dimensions of any dataset: the data, its units, what is refused."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.figure import Figure

from jaxglide import plot
from jaxglide.plot.heatmap import colours_of

BENDS, NU, PSI = [20.0, -10.0, 0.0, 10.0], [1.0, 1.2, 1.5], [10.0, 20.0]
DIMS = ("d_psi", "nu_theta", "psi_m")


def made_up(seed=0):
    """A made-up sweep over three parameters, the first not in order; two glides tumble."""
    rng = np.random.default_rng(seed)
    shape = len(BENDS), len(NU), len(PSI)
    outcome = np.zeros(shape, int)
    outcome[0, 0], outcome[2, 1, 1], outcome[3, 2, 1] = 2, 5, -1
    about = {"units": "m", "long_name": "horizontal path length"}
    flags = {"flag_values": np.arange(7), "flag_meanings": "a b_c d e f g h"}
    turns = rng.uniform(-80, 80, (*shape, 3))
    return xr.Dataset(
        {
            "path_length": (DIMS, rng.uniform(2, 6, shape), about),
            "end_angles": ((*DIMS, "turn"), turns, {"units": "deg"}),
            "outcome": (DIMS, outcome, flags),
        },
        coords={
            "d_psi": ("d_psi", BENDS, {"units": "deg/SVL"}),
            "nu_theta": NU,
            "psi_m": PSI,
            "turn": ["yaw", "pitch", "roll"],
        },
    )


def mesh_of(ax):
    (mesh,) = (c for c in ax.collections if isinstance(c, QuadMesh))
    return mesh


def marks(ax, label):
    """Points of the marks of that name, sorted."""
    (line,) = (line for line in ax.lines if line.get_label() == label)
    return sorted(map(tuple, np.asarray(line.get_xydata())))


def bar_of(ax):
    (bar,) = (other for other in ax.figure.axes if other is not ax)
    return bar


def test_map_shows_the_chosen_part_in_order():
    data = made_up()
    ax = plot.heatmap(data, "path_length", "nu_theta", "d_psi", at={"psi_m": 10.0})
    mesh = mesh_of(ax)
    wanted = data["path_length"].sel(psi_m=10.0).sortby("d_psi")
    assert np.array_equal(mesh.get_array(), wanted.values)
    corners = mesh.get_coordinates()
    assert np.allclose(corners[0, :, 0], [0.9, 1.1, 1.35, 1.65])
    assert (np.diff(corners[:, 0, 1]) > 0).all()
    assert (ax.get_xlabel(), ax.get_ylabel()) == (
        r"waves $\nu_\theta$ (per SVL)",
        r"$d_\psi$ (° per SVL)",
    )
    assert bar_of(ax).get_ylabel() == "horizontal path length (m)"
    assert mesh.get_clim() == (float(wanted.min()), float(wanted.max()))


def test_either_pair_of_parameters_may_be_drawn():
    data = made_up()
    ax = plot.heatmap(data, "path_length", "psi_m", "nu_theta", at={"d_psi": 20})
    wanted = data["path_length"].sel(d_psi=20.0).transpose("nu_theta", "psi_m")
    assert np.array_equal(mesh_of(ax).get_array(), wanted.values)
    assert ax.get_xlabel() == r"$\psi_m$ (°)"


def test_tumbles_unfinished_and_missing_glides_are_marked():
    data = made_up()
    at = {"psi_m": 20.0}
    ax = plot.heatmap(data, "path_length", "nu_theta", "d_psi", at=at)
    assert marks(ax, "tumbles") == [(1.0, 20.0)]
    assert marks(ax, "not finished") == [(1.2, 0.0)]
    shown = np.ma.getmaskarray(mesh_of(ax).get_array())
    assert list(map(tuple, np.argwhere(shown))) == [(2, 2)]  # d_psi 10, nu_theta 1.5
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert set(words) == {"tumbles", "not finished", "not computed"}
    quiet = made_up()
    quiet["outcome"][:] = 7  # an end that was asked for, as landing is
    assert plot.heatmap(quiet, "path_length", "nu_theta", "d_psi", at=at).get_legend() is None


def test_signed_values_have_white_at_zero_and_others_do_not():
    data = made_up()
    at = {"psi_m": 10.0, "turn": "pitch"}
    ax = plot.heatmap(data, "end_angles", "nu_theta", "d_psi", at=at)
    low, high = mesh_of(ax).get_clim()
    assert low == -high == -np.abs(data["end_angles"].sel(at).values).max()
    assert bar_of(ax).get_ylabel() == "pitch at the end (°)"
    assert colours_of(np.array([-0.1, 2.0]))["vmin"] == -0.1
    assert colours_of(np.array([np.nan]))["vmax"] == 1.0


def test_outcomes_are_named():
    ax = plot.heatmap(made_up(), "outcome", "nu_theta", "d_psi", at={"psi_m": 10.0})
    words = [text.get_text() for text in bar_of(ax).get_yticklabels()]
    assert words == ["a", "b c", "d", "e", "f", "g", "h"]
    assert not ax.lines


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("speed", "nu_theta", "d_psi", {}), "no variable 'speed' to draw: path_length"),
        (("path_length", "theta_m", "d_psi", {"psi_m": 10}), "not over 'theta_m'"),
        (("path_length", "nu_theta", "d_psi", {}), "also over psi_m: choose one of 10, 20"),
        (
            ("path_length", "nu_theta", "d_psi", {"psi_m": 12}),
            "psi_m = 12 is not there: 10, 20",
        ),
        (("path_length", "nu_theta", "d_psi", {"turn": "yaw"}), "not over 'turn'"),
        (("end_angles", "turn", "d_psi", {"psi_m": 10}), "turn are names"),
        (
            ("end_angles", "nu_theta", "d_psi", {"psi_m": 10, "turn": "up"}),
            "turn = up is not there: yaw",
        ),
        (("path_length", "d_psi", "d_psi", {"psi_m": 10}), "both 'd_psi'"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_what_there_is(arguments, message):
    variable, x, y, at = arguments
    with pytest.raises(ValueError, match=message):
        plot.heatmap(made_up(), variable, x, y, at=at)


def test_dimensions_of_one_entry_need_no_choice():
    data = made_up().isel(psi_m=[0])
    drawn = mesh_of(plot.heatmap(data, "path_length", "nu_theta", "d_psi")).get_array()
    assert np.array_equal(drawn, data["path_length"].isel(psi_m=0).sortby("d_psi").values)


def test_curve_is_in_order_and_marked():
    data = made_up()
    ax = plot.curve(data, "path_length", "d_psi", at={"psi_m": 10.0, "nu_theta": 1.0})
    wanted = data["path_length"].sel(psi_m=10.0, nu_theta=1.0).sortby("d_psi")
    line = ax.lines[0]
    assert np.array_equal(line.get_xdata(), [-10, 0, 10, 20])
    assert np.array_equal(line.get_ydata(), wanted.values)
    assert marks(ax, "tumbles") == [(20.0, float(wanted[-1]))]
    assert ax.get_ylabel() == "horizontal path length (m)"


def test_cases_of_a_list_are_scattered():
    grid = made_up().isel(psi_m=0).copy(deep=True)
    grid["outcome"][2, 1], grid["outcome"][3, 2] = 5, -1
    data = grid.stack(case=("d_psi", "nu_theta"), create_index=False)
    landed, other = (data["outcome"] == 0).values, (data["outcome"] > 0).values
    ax = plot.case_scatter(data, "path_length", "d_psi", "nu_theta")
    discs, crosses = (c for c in ax.collections if isinstance(c, PathCollection))
    assert np.array_equal(discs.get_array(), data["path_length"].values[landed])
    assert np.array_equal(discs.get_offsets()[:, 0], data["d_psi"].values[landed])
    assert len(crosses.get_offsets()) == other.sum() == 2
    assert discs.get_clim() == crosses.get_clim()
    assert bar_of(ax).get_ylabel() == "horizontal path length (m)"
    plain = plot.case_scatter(data, "path_length", "nu_theta")
    assert plain.get_ylabel() == "horizontal path length (m)"
    heights = plain.collections[0].get_offsets()[:, 1]
    assert np.array_equal(heights, data["path_length"].values[landed])
    with pytest.raises(ValueError, match="no 'psi_x': they have d_psi, nu_theta"):
        plot.case_scatter(data, "path_length", "psi_x")


def test_axes_may_be_given():
    ax = Figure().add_subplot()
    at = {"psi_m": 10.0}
    assert plot.heatmap(made_up(), "path_length", "nu_theta", "d_psi", ax, at=at) is ax
    alone = Figure().add_subplot()
    assert (
        plot.curve(made_up(), "path_length", "d_psi", alone, at=at | {"nu_theta": 1}) is alone
    )


def test_an_atlas_leaves_out_what_was_not_computed():
    data = made_up()
    figure = plot.stable_atlas(data)
    count = int((data["outcome"] >= 0).sum())
    assert figure.get_suptitle().startswith(f"{count} glides")
    share = mesh_of(figure.axes[0]).get_array()  # d_psi across, nu_theta up
    stable = (100.0 * (data["outcome"] == 0)).where(data["outcome"] >= 0)
    assert np.allclose(share, stable.mean("psi_m").sortby("d_psi").T.values)
