"""Pictures of measured flights beside their simulations, and `jaxglide compare`."""

import json

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg

from jaxglide.cli import main
from jaxglide.flights.agreement import compare_paths
from jaxglide.plot.flights import distances, every_flight, measured_and_simulated
from made_flights import dataset, paths_of

matplotlib.use("agg")


def test_all_paths_are_drawn_from_the_origin():
    flown = paths_of(turn_back=True)
    figure = measured_and_simulated(flown)
    side_m, side_s, top_m, top_s = figure.axes
    for ax in (side_m, side_s, top_m, top_s):
        lines = [line for line in ax.lines if len(line.get_xdata()) > 1]
        assert len(lines) == 2
        for line in lines:
            assert line.get_xdata()[0] == 0.0
    np.testing.assert_allclose(side_m.lines[0].get_ydata(), np.linspace(8, 0.5, 16))
    np.testing.assert_allclose(top_m.lines[0].get_ydata()[-1], 0.45)
    assert side_m.get_ylabel() == "height, z (m)"
    low, high = top_m.get_ylim()
    assert low > high  # seen from above
    assert side_m.get_ylim()[0] < side_m.get_ylim()[1]
    assert top_m.get_xlabel() == "forward, y (m)"
    assert top_m.get_ylabel() == "right, x (m)"
    assert side_m.get_aspect() == top_s.get_aspect() == 1.0
    assert "4.52 m" in side_m.get_title()


@pytest.mark.parametrize("sideways", [1.0, 8.0])
def test_views_from_the_side_and_from_above_share_their_axis(sideways):
    """To the pixel, at one scale, whatever the paths' shape."""
    flown = paths_of(turn_back=True)
    flown = flown.assign({n: flown[n] * [sideways, 1, 1] for n in ("position", "path", "end")})
    figure = measured_and_simulated(flown)
    FigureCanvasAgg(figure).draw()
    boxes = [ax.get_window_extent() for ax in figure.axes]
    side_m, side_s, top_m, top_s = boxes
    for above, below in ((side_m, top_m), (side_s, top_s)):
        np.testing.assert_allclose(above.intervalx, below.intervalx, atol=0.1)
    scales = [
        size / abs(float(np.ptp(limits)))
        for ax, box in zip(figure.axes, boxes, strict=True)
        for size, limits in ((box.width, ax.get_xlim()), (box.height, ax.get_ylim()))
    ]
    np.testing.assert_allclose(scales, scales[0], rtol=1e-3)
    assert all(ax.get_xlim() == figure.axes[0].get_xlim() for ax in figure.axes)


def test_distances_are_those_compared():
    flown = paths_of(turn_back=True)
    ax = distances(flown)
    compared = compare_paths(flown)
    drawn = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert compared.turned_simulated.values.tolist() == [False, True]
    for row, label in enumerate(("shallows", "simulation does not shallow")):
        one = compared.isel(trial=row)
        expected = [[one.distance_measured, one.distance_simulated]]
        np.testing.assert_allclose(drawn[label], expected)
    assert ax.get_xlim() == ax.get_ylim()
    assert ax.get_xlabel().endswith("(m)")
    assert distances(flown, ax) is ax


def test_every_flight_has_its_panel():
    figure = every_flight(paths_of(turn_back=False))
    titles = [ax.get_title() for ax in figure.axes]
    assert titles == ["101 (snake A)", "202 (snake B)"]
    for ax in figure.axes:
        measured, simulated = ax.lines
        assert measured.get_xdata()[-1] > simulated.get_xdata()[-1]


@pytest.fixture(scope="module")
def saved(golden, tmp_path_factory):
    """Two flights in a file, as `jaxglide measure --save` writes them."""
    path = tmp_path_factory.mktemp("flights") / "gaits.nc"
    dataset(golden("simulated_flights")[:2]).to_netcdf(path, engine="h5netcdf")
    return path


def test_compare_prints_a_table_and_draws(saved, tmp_path, capsys):
    save, plots = tmp_path / "flown.nc", tmp_path / "figures"
    assert main(["compare", str(saved), "--save", str(save), "--plots", str(plots)]) == 0
    out = capsys.readouterr().out
    assert "2 flights; horizontal distance to a common end height:" in out
    assert sorted(p.name for p in plots.iterdir()) == [
        "distances.png",
        "every_flight.png",
        "paths.png",
    ]
    with xr.open_dataset(save, engine="h5netcdf") as data:
        assert data.path_error.attrs["units"] == "m"
        assert data.attrs["polar"] == "published"
    assert main(["plot", str(save), "--out", str(tmp_path / "flown.png")]) == 0
    assert "drew measured and simulated paths" in capsys.readouterr().out
    assert main(["compare", str(saved), "--json"]) == 0
    flights = json.loads(capsys.readouterr().out)["flights"]
    assert [flight["trial"] for flight in flights] == ["205", "303"]
    assert 0.5 < flights[0]["distance_simulated"] < 4.5


def test_compare_names_what_it_cannot_use(tmp_path, capsys):
    assert main(["compare", str(tmp_path / "nothing")]) == 2
    assert "there is no such folder or file" in capsys.readouterr().err
    wrong = tmp_path / "wrong.nc"
    wrong.write_text("no")
    assert main(["compare", str(wrong)]) == 2
    assert "no NetCDF 4 file" in capsys.readouterr().err
    xr.Dataset({"a": 1.0}).to_netcdf(wrong, engine="h5netcdf")
    assert main(["compare", str(wrong)]) == 2
    assert "no variable 'trial'" in capsys.readouterr().err
    assert main(["compare", str(tmp_path)]) == 2
    assert "no recording there" in capsys.readouterr().err
