"""Datasets from outside: units converted, what does not fit refused in words."""

import json

import h5py
import numpy as np
import pytest
import xarray as xr

from jaxglide._lib.formats import marked
from jaxglide._lib.netcdf import load_netcdf
from jaxglide._lib.units import factor, in_file
from jaxglide.cli import main
from jaxglide.flight.ends import Outcome
from jaxglide.flights.agreement import compare_paths, summary
from jaxglide.flights.flights import check_flights, measured_of
from jaxglide.plot.saved import draw
from made_flights import dataset, made


@pytest.fixture(scope="module")
def flights(golden):
    return dataset(golden("simulated_flights")[:3])


# ---- units


@pytest.mark.parametrize(
    ("given", "wanted", "times"),
    [
        ("rad", "deg", 180 / np.pi),
        ("rad/SVL", "deg/SVL", 180 / np.pi),
        ("radians", "deg", 180 / np.pi),
        ("degree", "deg/SVL", 1.0),
        ("°", "deg", 1.0),
        ("mm", "m", 1e-3),
        ("g", "kg", 1e-3),
        ("km/h", "m/s", 1 / 3.6),
        ("m s-1", "m/s", 1.0),
        ("ms", "s", 1e-3),
        ("ft", "m", 0.3048),
        ("1/s", "Hz", 1.0),
        ("1", "", 1.0),
        ("percent", "", 0.01),
    ],
)
def test_units_are_converted(given, wanted, times):
    assert factor(given, wanted) == pytest.approx(times, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "wanted", "said"),
    [
        ("s", "m", "'s' cannot be converted to 'm'"),
        ("rad/s", "Hz", "'rad/s' cannot be converted to 'Hz'"),  # not by 2 pi, nor by 1
        ("deg", "", "'degree' cannot be converted to '1'"),
        ("wing", "m", "'wing' is not a known unit"),
        ("9**9**9**9", "m", "is not a known unit"),
        ("m" * 1000, "m", "is not a known unit"),
        ("__import__('os')", "m", "is not a known unit"),
    ],
)
def test_other_units_are_refused(given, wanted, said):
    with pytest.raises(ValueError, match=said.replace("*", r"\*")):
        factor(given, wanted)


OTHER_UNITS = {  # name: unit, and how many of it make one of ours
    "theta_m": ("rad", np.pi / 180),
    "d_psi": ("rad/SVL", np.pi / 180),
    "svl": ("mm", 1000.0),
    "mass": ("g", 1000.0),
    "start_velocity": ("km/h", 3.6),
    "time": ("ms", 1000.0),
    "start_position": ("ft", 1 / 0.3048),
}


def test_flights_in_other_units_are_the_same_flights(flights):
    other = flights.copy()
    for name, (unit, many) in OTHER_UNITS.items():
        other[name] = (flights[name] * many).assign_attrs(units=unit, long_name="kept")
    found = check_flights(other)
    for name in OTHER_UNITS:
        np.testing.assert_allclose(found[name].values, flights[name].values, rtol=1e-12)
        assert found[name].attrs["long_name"] == "kept"
    assert found["mass"].attrs["units"] == "kg"
    assert found["theta_m"].attrs["units"] == "degree"
    ours, theirs = measured_of(flights), measured_of(other)
    for name, values in vars(ours).items():
        np.testing.assert_allclose(getattr(theirs, name), values, rtol=1e-12, err_msg=name)


def test_dimensions_are_taken_by_name(flights):
    turned = flights.copy()
    turned["position"] = flights["position"].transpose("axis", "trial", "frame")
    turned = turned.assign_coords(axis=["x", "y", "z"]).isel(axis=[2, 0, 1])
    found = check_flights(turned)
    for name in ("position", "start_position", "start_velocity"):
        assert found[name].dims == flights[name].dims
        np.testing.assert_array_equal(found[name].values, flights[name].values)


# ---- what is refused

ALL = slice(None)


def put(name, value, at=ALL):
    def change(data):
        values = data[name].values.copy()
        values[at] = value
        return data.assign({name: (data[name].dims, values, data[name].attrs)})

    return change


REFUSED = {
    "no nu_theta": (lambda d: d.drop_vars("nu_theta"), "have no variable 'nu_theta'"),
    "no mass": (lambda d: d.drop_vars("mass"), "have no variable 'mass'"),
    "no snake": (lambda d: d.drop_vars("snake"), "have no variable 'snake'"),
    "no trial": (lambda d: d.drop_vars("trial"), "have no variable 'trial'"),
    "scalar trial": (
        lambda d: d.isel(trial=0),
        "have 0 entries over 'trial', where 1 to 10000",
    ),
    "none": (lambda d: d.isel(trial=slice(0, 0)), "have 0 entries over 'trial'"),
    "mass by frame": (
        lambda d: d.assign(mass=d["mass"] * xr.ones_like(d["time"])),
        "'mass' is over trial, frame, where it must be over trial",
    ),
    "numbers as names": (
        lambda d: d.assign_coords(trial=[1, 2, 3]),
        "'trial' holds int64 values, where names are needed",
    ),
    "names as numbers": (
        lambda d: d.assign(svl=("trial", ["a", "b", "c"])),
        "'svl' holds .* values, where numbers are needed",
    ),
    "twice": (lambda d: d.assign_coords(trial=["1", "1", "2"]), "trial 1 is there 2 times"),
    "axes": (
        lambda d: d.assign_coords(axis=["x", "y", "w"]),
        "'axis' has entries x, y, w, not x, y, z",
    ),
    "two axes": (lambda d: d.isel(axis=[0, 1]), "'axis' has entries"),
    "unit": (
        lambda d: d.assign(svl=d["svl"].assign_attrs(units="kg")),
        "unit of 'svl': 'kg' cannot be converted to 'm'",
    ),
    "too long": (
        put("svl", 2.0, 1),
        r"svl = 2 m at trial \d+ is not allowed: .* \[0.1, 1.5\] m",
    ),
    "far longer": (put("svl", 19.0), r"svl = 19 m at trial"),
    "grams": (put("mass", 38.0), r"mass = 38 kg at trial \d+ is not allowed"),
    "not a number": (
        put("theta_m", np.nan, 2),
        r"theta_m = nan deg at trial \d+ is not allowed",
    ),
    "infinite": (put("position", np.inf, (0, 3, 1)), r"position = inf m at trial .* frame 4"),
    "far": (put("start_position", 1e9), r"start_position = 1e\+09 m at trial \d+, axis 1"),
    "underground": (put("start_position", -1.0, (0, 2)), r"trial \d+ is -1 m above the ground"),
    "no path": (put("position", np.nan, 0), r"position of trial \d+ is known in 0 frames"),
    "backwards": (put("time", 1.0, (0, 2)), r"time of trial \d+ does not rise"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_flights_cannot_be_is_said(flights, case):
    change, message = REFUSED[case]
    with pytest.raises(ValueError, match=message) as caught:
        check_flights(change(flights))
    assert "\n" not in str(caught.value)


# ---- files


@pytest.fixture
def saved(flights, tmp_path):
    path = tmp_path / "gaits.nc"
    flights.to_netcdf(path, engine="h5netcdf")
    return path


def test_a_file_is_read_as_it_stands(saved, flights):
    xr.testing.assert_equal(load_netcdf(saved), flights)
    minutes = flights.assign(time=(flights["time"] / 60).assign_attrs(units="minutes"))
    minutes.to_netcdf(saved, engine="h5netcdf")
    found = check_flights(load_netcdf(saved))
    np.testing.assert_allclose(found["time"].values, flights["time"].values, rtol=1e-12)


def test_messages_name_the_file(saved, flights):
    put("mass", 38.0)(flights).to_netcdf(saved, engine="h5netcdf")
    with pytest.raises(ValueError, match=rf"^{saved}: mass = 38 kg"):
        check_flights(load_netcdf(saved))


def cut(path):
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def edit(change):
    def done(path):
        with h5py.File(path, "a") as file:
            change(file)

    return done


def huge(file):
    file.create_dataset("long", (10**12,), "f8", chunks=(1000,))


def circle(file):
    file["again"] = file["/"]


def elsewhere(file):
    del file["mass"]
    file.create_dataset("mass", (3,), "f8", external=[("/etc/hostname", 0, 24)])


def reference(file):
    file.create_dataset("which", (2,), h5py.ref_dtype)


DAMAGED = {
    "cut": (cut, "damaged, or no NetCDF 4 file"),
    "empty": (lambda path: path.write_bytes(b""), "damaged, or no NetCDF 4 file"),
    "text": (lambda path: path.write_text("text"), "damaged, or no NetCDF 4 file"),
    "huge": (edit(huge), r"up to 'long' of shape \(1000000000000,\), take 8e\+12 bytes"),
    "circle": (edit(circle), "'again' is a group, where only variables may be"),
    "soft link": (edit(lambda f: f.__setitem__("a", h5py.SoftLink("/a"))), "'a' is a link"),
    "other file": (
        edit(lambda f: f.__setitem__("a", h5py.ExternalLink("other.nc", "/a"))),
        "'a' is a link to elsewhere",
    ),
    "values elsewhere": (edit(elsewhere), "the values of 'mass' are in another file"),
    "references": (edit(reference), "'which' holds neither numbers nor texts"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_files_that_are_not_whole_are_refused(saved, case):
    change, message = DAMAGED[case]
    change(saved)
    with pytest.raises(ValueError, match=rf"^cannot read {saved}: .*{message}") as caught:
        load_netcdf(saved)
    assert "\n" not in str(caught.value)


# ---- simulations that break down


def broken():
    """Three flights, the second of which ends in no number, the third out of steps."""
    down = [[0, 0, 8], [0, 3, 5], [0, 6, 2]]
    three = xr.concat([made(down, down)] * 3, "trial").assign_coords(trial=["1", "2", "3"])
    three["end"][1] = np.nan
    three["path"][2, 1:] = three["path"][2, 0]
    three["end"][2] = three["path"][2, 0]
    ends = [Outcome.LANDED, Outcome.NON_FINITE, Outcome.OUT_OF_STEPS]
    return three.assign(outcome=("trial", [int(end) for end in ends]))


def test_a_simulation_that_broke_down_counts_nowhere():
    compared = compare_paths(broken())
    assert np.isfinite(compared.path_error.values).tolist() == [True, False, False]
    assert np.isnan(compared.distance_simulated.values[1:]).all()
    text = summary(compared)
    assert "2 of 3 simulations broke down: they are left out" in text
    assert "simulated  6.00 m, 1.00 of it, farther in 0" in text
    assert summary(compared.isel(trial=[1, 2])) == (
        "2 of 2 simulations broke down: they are left out"
    )


def test_compare_fails_where_a_simulation_broke_down(saved, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("jaxglide.flights.flights.fly_flights", lambda *_, **__: broken())
    plots = tmp_path / "figures"
    assert main(["compare", str(saved), "--plots", str(plots)]) == 1
    assert "2 of 3 simulations broke down" in capsys.readouterr().out
    assert len(list(plots.iterdir())) == 3
    assert main(["compare", str(saved), "--json"]) == 1
    rows = json.loads(capsys.readouterr().out)["flights"]
    assert [row["distance_simulated"] for row in rows] == [6.0, None, None]


def test_compare_refuses_a_file_in_one_sentence(saved, capsys):
    for change, said in ((elsewhere, "in another file"), (huge, "8e+12 bytes")):
        edit(change)(saved)
        assert main(["compare", str(saved)]) == 2
        err = capsys.readouterr().err
        assert said in err
        assert err.count("\n") == 1
        saved.unlink()
        with h5py.File(saved, "w"):
            pass
    assert main(["compare", str(saved)]) == 2
    assert f"{saved}: the flights have no variable 'trial'" in capsys.readouterr().err
    assert main(["compare", "nowhere.nc"]) == 2


def test_a_wrong_file_is_named_once_by_plot(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = plottable().drop_vars("snake")
    wrong.to_netcdf("flown.nc", engine="h5netcdf")
    assert main(["plot", "flown.nc"]) == 2
    assert capsys.readouterr().err == (
        "jaxglide: flown.nc: the compared flights have no variable 'snake'\n"
    )


def test_units_in_files_are_those_of_udunits():
    for ours, theirs in {
        "deg": "degree",
        "deg/SVL": "degree",
        "1/SVL": "1",
        "m/s": "m/s",
    }.items():
        assert in_file(ours) == theirs


def plottable():
    """Two flights beside their simulations, as `fly_flights` labels them."""
    down = np.stack([np.zeros(8), np.linspace(0, 6, 8), np.linspace(8, 2, 8)], axis=1)
    two = xr.concat([made(down, 0.9 * down)] * 2, "trial").assign_coords(trial=["1", "2"])
    two = two.assign_coords(time_simulated=np.linspace(0, 1, 8), axis=["x", "y", "z"])
    return marked(two, "compared flights")


UNDRAWN = {
    "no snake": (lambda d: d.drop_vars("snake"), "have no variable 'snake'"),
    "numbers as names": (lambda d: d.assign_coords(trial=[1, 2]), "'trial' holds int64 values"),
    "by trial": (lambda d: d.assign(end=d["end"][0]), "'end' is over axis, where it must be"),
    "infinite": (
        put("path", np.inf, (0, 1, 1)),
        "path = inf m at trial 1, time_simulated 0.14",
    ),
    "unit": (
        lambda d: d.assign(end=d["end"].assign_attrs(units="s")),
        "unit of 'end': 's' can",
    ),
    "never seen": (put("position", np.nan, 1), "position of trial 2 is known in no frame"),
}


@pytest.mark.parametrize("case", UNDRAWN)
def test_compared_flights_that_cannot_be_drawn_say_why(case):
    change, message = UNDRAWN[case]
    with pytest.raises(ValueError, match=message):
        draw(change(plottable()))


def test_flights_in_other_units_and_orders_are_drawn_the_same():
    ours = plottable()
    feet = (ours["path"] / 0.3048).assign_attrs(units="ft").transpose("axis", ...)
    turned = ours.assign(path=feet).isel(axis=[1, 2, 0])
    lines = [
        [line.get_xydata() for ax in draw(data).figure.axes for line in ax.lines]
        for data in (ours, turned)
    ]
    for a, b in zip(*lines, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12)
