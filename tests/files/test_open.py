"""Every kind of file that is written: opened as what it was, and read by other software."""

import json
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from made_steady import made_steady

import jaxglide
from jaxglide import (
    Branch,
    Case,
    Constant,
    Controller,
    Environment,
    Gait,
    Glide,
    Glider,
    Launch,
    Polar,
    Snake,
    TakeOff,
)
from jaxglide._lib.formats import TITLES, kind_of, marked
from jaxglide.ensemble import records, survey
from jaxglide.ensemble.steady_records import steady_contents
from jaxglide.ensemble.study import Study
from jaxglide.files import controlled_dataset, glide_dataset, log_dataset, steady_dataset
from jaxglide.flight.ends import default_ends
from jaxglide.flight.solve import settings_of
from jaxglide.flight.trajectory import Trajectory
from jaxglide.flights import fitter as fits
from jaxglide.flights import flights
from jaxglide.measured import flights_dataset, measure_folder
from jaxglide.search.optimum import optimise
from made_recordings import swimming, write_tabular
from made_searches import Made, problem_of

FLIGHTS = ("glide", "trajectory", "steady glide", "controller")  # opened as these
GRID = {"nu_theta": [1.2, 1.4], "d_psi": [0.0, 10.0]}


def flown():
    """A glide that was not computed: straight down."""
    times = jnp.linspace(0.0, 0.5, 5)
    states = jnp.zeros((5, 13)).at[:, 2].set(1.25 - 5 * times**2).at[:, 5].set(-10 * times)
    settings = settings_of(
        rtol=1e-6,
        atol=1e-6,
        max_time=60.0,
        times=None,
        ends=default_ends(),
        solver=None,
        step=None,
        max_steps=100,
        dense=True,
    )
    return {
        "glider": Glider(Snake.from_svl(nodes=12), Gait.from_degrees(), Polar.smooth()),
        "settings": settings,
        "outcome": jnp.asarray(0),
        "time": times[-1],
        "state": states[-1],
        "max_angles": jnp.zeros(3),
        "accepted": jnp.asarray(4),
        "rejected": jnp.asarray(0),
        "states": None,
        "interpolation": diffrax.LinearInterpolation(times, states),
    }


def a_glide():
    start = jnp.zeros(13).at[2].set(1.25)
    take_off = TakeOff(jnp.asarray(0.3), jnp.zeros(3), jnp.asarray(0.0), start)
    return Glide(launch=Launch(1.25), take_off=take_off, **flown())


def a_trajectory():
    start = jnp.zeros(13).at[2].set(1.25)
    begin = jnp.asarray(0.0)
    return Trajectory(phase=jnp.asarray(0.3), start_time=begin, start=start, **flown())


def zeros(table, sizes):
    """Values for a table of variables, dimensions first, for four cases."""
    return {name: np.zeros((4, *[sizes[d] for d in row[0]])) for name, row in table.items()}


def glides():
    values = zeros(records._VARIABLES, {"axis": 3, "turn": 3})
    values |= {"outcome": np.zeros(4, np.int32), "states": np.zeros((4, 2, 13))}
    return records.study_dataset(Study(grid=GRID, times=[0.0, 0.1]), values)


def steady_sweep():
    study, contents = Study(grid=GRID), steady_contents(starts=4, most=2, step=1 / 300)
    kept = contents.layout(study, "float64")
    values = {name: np.zeros((4, *row.shape), row.dtype) for name, row in kept.items()}
    return contents.dataset(study, values)


def held():
    sizes = {"record": 3, "phase": 4, "about": 3, "forward_up": 2}
    values = zeros(survey._VARIABLES, sizes) | {"outcome": np.zeros(4, np.int32)}
    options = {"angles": (0.0, 0.0, 0.0), "interval": 0.1, "max_time": 1.0}
    return survey._dataset(Study(grid=GRID), values, 0.1 * np.arange(3), 4, options)


def measured(folder):
    write_tabular(folder, swimming())
    return flights_dataset(measure_folder(folder))


def compared(data):
    times = len(flights._TIMES)

    def fly(program, fields, *arguments):
        n = len(fields["svl"])
        return {
            "states": np.zeros((n, times, 13)),
            "end": np.zeros((n, 13)),
            "time": np.ones(n),
            "outcome": np.zeros(n, int),
            "phi_theta": np.zeros(n),
            "angles": np.zeros((n, 3)),
        }

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flights, "fly_all", fly)
        return flights.fly_flights(data)


def controller():
    glider = Glider(Snake.from_svl(nodes=12), Gait.from_degrees(), Polar.smooth())
    environment = Environment(Case(glider))
    return Controller(Constant(environment.plant.inputs), environment)


def controlled():
    values = {"landed": True, "outcome": np.int32(0), "time": 1.0, "launch.speed": 2.0}
    flights = xr.Dataset({name: ("flight", [value]) for name, value in values.items()})
    flights["outcome"].attrs["words"] = ["landed", "unstable in yaw"]
    return controlled_dataset({"none": flights, "lqr": flights})


def fitted():
    fitter = SimpleNamespace(trials=["a"], animals=["A"], corrected=["psi_m"])
    one = SimpleNamespace(
        scales={"lift_scale": 1.0, "drag_scale": 1.1},
        covariance=np.eye(2),
        errors=np.ones(1),
        errors_before=np.ones(1),
        starts=np.ones((1, 2)),
        ends=np.ones((1, 2)),
        misfits=np.ones(1),
        changes=np.zeros((1, 1)),
        misfit=1.0,
        misfit_before=2.0,
    )
    return fits.fitted_dataset(fitter, one)


def branch():
    """Two points of a branch."""
    arrays = {name: np.arange(2.0) for name in ("parameter", "period", "speed", "glide_angle")}
    arrays |= {name: np.ones(2) for name in ("forward_speed", "sink_rate", "turn_rate")}
    arrays |= {"state": np.ones((2, 8)), "states": np.ones((2, 1, 8))}
    arrays |= {"multipliers": np.full((2, 8), 0.5 + 0.5j), "kinds": np.array(["start", ""])}
    known = {"name": "f_theta", "unit": "Hz", "found": True, "ends": ("here", "there")}
    return Branch(**known, frozen=False, mirrored=True, **arrays).dataset()


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    return tmp_path_factory.mktemp("log") / "search.jsonl"


@pytest.fixture(scope="module")
def results(tmp_path_factory, log):
    """One result of every kind."""
    recorded = measured(tmp_path_factory.mktemp("recordings"))
    problem = problem_of()
    options = {"starts": 2, "screen": 4, "steps": 2, "polish": 1}
    found = optimise(problem, **options, evaluator=Made(problem, (0.3, 0.6)), log=log)
    return {
        "glide": glide_dataset(a_glide(), 9),
        "trajectory": glide_dataset(a_trajectory(), 9),
        "steady glide": steady_dataset(made_steady()),
        "glides": glides(),
        "steady glides": steady_sweep(),
        "shape space": marked(glides(), "shape space"),
        "held glides": held(),
        "optimisation": found.history,
        "search log": log_dataset(log),
        "measured flights": recorded,
        "compared flights": compared(recorded),
        "fit": fitted(),
        "controller": controller(),
        "controlled flights": controlled(),
        "steady branch": branch(),
    }


@pytest.fixture(scope="module")
def files(results, tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    names = {kind: folder / f"{kind.replace(' ', '-')}.nc" for kind in results}
    for kind, data in results.items():
        assert jaxglide.save(data, names[kind]) == names[kind]
    return names


def test_every_kind_has_a_file(files):
    assert set(files) == set(TITLES)


@pytest.mark.parametrize("kind", [k for k in TITLES if k not in FLIGHTS])
def test_a_dataset_comes_back_as_it_was(results, files, kind):
    again = jaxglide.open(files[kind])
    assert kind_of(again) == kind
    xr.testing.assert_equal(again, results[kind])
    assert again.attrs["format"] == f"jaxglide {kind} 2"


@pytest.mark.parametrize(("kind", "made"), [("glide", a_glide), ("trajectory", a_trajectory)])
def test_a_flight_comes_back_as_a_flight(files, kind, made):
    again, first = jaxglide.open(files[kind]), made()
    assert type(again) is type(first)
    assert str(again) == str(first)
    np.testing.assert_allclose(again.at([0.2, 0.5]), first.at([0.2, 0.5]), atol=1e-12)


def test_a_log_says_what_was_evaluated(log):
    data = jaxglide.open(log)
    assert kind_of(data) == "search log"
    assert [str(name) for name in data.parameter.values] == ["theta_m", "nu_theta"]
    z = (data.point.values - [80.0, 1.0]) / [40.0, 0.5]
    away = z - [0.3, 0.6]
    wanted = -np.einsum("si,ij,sj->s", away, Made.A, away)
    np.testing.assert_allclose(data.value.sel(quantity="objective"), wanted, atol=1e-12)
    known = np.isfinite(data.gradient.values).all(axis=(1, 2))
    slopes = (-2 * away @ Made.A / [40.0, 0.5])[known]
    assert known.any()
    np.testing.assert_allclose(data.gradient.values[known, 0], slopes, atol=1e-12)
    assert json.loads(data.attrs["asked"])["objective"] == "landing_distance"
    log.with_name("cut.jsonl").write_bytes(log.read_bytes()[:-20])
    cut = jaxglide.open(log.with_name("cut.jsonl"))
    assert cut.sizes["row"] < data.sizes["row"]
    wrong = log.with_name("wrong.jsonl")
    wrong.write_bytes(log.read_bytes().replace(b'"number":1', b'"number":7'))
    with pytest.raises(ValueError, match="is damaged: line 2 is not the one written there"):
        jaxglide.open(wrong)


def test_a_study_file_is_a_study(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text("[grid]\nnu_theta = [1.2, 1.4]\n")
    study = jaxglide.open(path)
    assert isinstance(study, Study)
    assert len(study) == 2


def old(path, results):
    results["glides"].drop_attrs(deep=False).assign_attrs(version_jaxglide="0.1.0").to_netcdf(
        path, engine="h5netcdf"
    )


def later(path, results):
    results["fit"].assign_attrs(format="jaxglide fit 3").to_netcdf(path, engine="h5netcdf")


def other(path, results):
    xr.Dataset({"a": ("b", [1.0])}).to_netcdf(path, engine="h5netcdf")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (old, "was written by jaxglide 0.1, which said no format: compute it anew"),
        (later, "format = 'jaxglide fit 3' is of version 3: this jaxglide reads 2"),
        (other, "is not a result of jaxglide"),
        (lambda path, results: path.write_text("text"), "cannot read .*damaged, or no NetCDF"),
        (lambda path, results: None, "there is no "),
    ],
)
def test_what_is_no_result_is_refused_in_one_sentence(results, tmp_path, make, said):
    path = tmp_path / "it.nc"
    make(path, results)
    with pytest.raises((ValueError, FileNotFoundError), match=said) as caught:
        jaxglide.open(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("result", "name", "error", "said"),
    [
        (lambda r: r["fit"], "fit.txt", ValueError, "must end in .nc"),
        (lambda r: xr.Dataset(), "a.nc", ValueError, "result says no format"),
        (lambda r: 3.0, "a.nc", TypeError, "result = float is no flight and no Dataset"),
    ],
)
def test_what_cannot_be_saved_is_refused(results, tmp_path, result, name, error, said):
    with pytest.raises(error, match=said):
        jaxglide.save(result(results), tmp_path / name)


def test_the_room_of_files_loads_no_matplotlib(files):
    """In a fresh process: everything is opened and saved."""
    code = """
import sys
import jaxglide
for path in sys.argv[1:]:
    result = jaxglide.open(path)
    jaxglide.save(result, path + ".again.nc")
loaded = sorted(name for name in sys.modules if name.split(".")[0] == "matplotlib")
assert not loaded, loaded
assert "jaxglide.plot" not in sys.modules
"""
    chosen = [str(files[kind]) for kind in ("glide", "steady glide", "glides", "optimisation")]
    done = subprocess.run([sys.executable, "-c", code, *chosen], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


# What the checker says against our files, and why it stays so.
ALLOWED = {
    "Coordinate variable 'time' should have standard_name='time'": "it is time since launch, "
    "not since a date",
}


def test_files_follow_the_conventions(files, tmp_path):
    """The CF checker of IOOS, over one file of each kind: what it says is known."""
    out = tmp_path / "said.json"
    checker = Path(sys.executable).with_name("compliance-checker")
    command = [checker, "-t", "cf:1.11", "-c", "strict", "-f", "json_new", "-o", out]
    done = subprocess.run([*command, *files.values()], capture_output=True, text=True)
    assert out.exists(), done.stderr
    said = json.loads(out.read_text())
    assert len(said) == len(files)
    levels = ("high_priorities", "medium_priorities", "low_priorities")
    found = {
        (name, message)
        for name, report in said.items()
        for level in levels
        for one in report["cf:1.11"][level]
        for message in one["msgs"]
    }
    left = {one for one in found if not any(re.search(known, one[1]) for known in ALLOWED)}
    assert not left
    for known in ALLOWED:
        assert any(re.search(known, message) for _, message in found), known
