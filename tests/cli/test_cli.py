"""The command line, in process: options, files, errors, exit codes."""

import inspect
import json
import re

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxglide as jg
from command import run
from jaxglide import Outcome, cli
from jaxglide.cli._options import print_json
from jaxglide.tunnel.fall import fall, loads_at_end
from jaxglide.tunnel.loads import loads, over_phases
from jaxglide.tunnel.trim import derivatives


def test_glide_writes_a_labelled_file_and_a_picture(capsys, tmp_path):
    save, plot = tmp_path / "g.nc", tmp_path / "g.png"
    code, out, err = run(
        capsys, "glide", "--height", "2", "--save", str(save), "--plot", str(plot)
    )
    assert (code, err) == (0, "")
    assert "landed" in out
    assert plot.stat().st_size > 20_000
    with xr.open_dataset(save, engine="h5netcdf") as data:
        assert data.position.attrs["units"] == "m"
        assert data.angles.attrs["units"] == data.theta_m.attrs["units"] == "degree"
        assert data.theta_m.item() == pytest.approx(96.5, abs=0.1)
        assert data.sizes["node"] == 70
        for name in ("rtol", "solver", "version_jaxglide"):
            assert name in data.attrs, name
        assert data.attrs["polar"] == "published"
        assert data.position.values[-1, 2] == pytest.approx(0, abs=1e-9)
        # the file's own consistency: nodes surround the centre of mass, forces are finite
        span = np.abs(data.body.values - data.position.values[:, :, None]).max()
        assert 0.05 < span < 0.7
        # and the forces, in inertial axes, move the centre of mass
        moved = np.gradient(data.velocity.values, data.time.values, axis=0)
        forced = data.force.values.sum(axis=2) / data.mass.item() - [0, 0, 9.81]
        np.testing.assert_allclose(moved[1:-1], forced[1:-1], rtol=0, atol=0.05)
        assert 10 < np.abs(data.angle_of_attack.values).max() < 180  # degrees
        assert np.isfinite(data.force.values).all()


@pytest.mark.slow
def test_options_reach_the_model(capsys):
    base = ("glide", "--json", "--height", "0.5")
    _, reference, _ = run(capsys, *base)
    reference = json.loads(reference)
    for option, value in (
        ("--nu-theta", "1.2"),
        ("--theta-m", "100"),
        ("--psi-m", "25"),
        ("--d-psi", "0"),
        ("--d-theta", "20"),
        ("--f-theta", "1.0"),
        ("--svl", "0.8"),
        ("--mass", "0.05"),
        ("--speed", "3"),
        ("--neck-fraction", "0.1"),
        ("--polar", "smooth"),
        ("--lift-scale", "1.36"),
        ("--drag-scale", "0.6"),
        ("--gravity", "9"),
        ("--air-density", "1.3"),
        ("--kinematic-viscosity", "2e-5"),
        ("--rtol", "1e-4"),
    ):
        code, out, _ = run(capsys, *base, option, value)
        assert code == 0
        changed = json.loads(out)
        assert changed["landing_point"] != reference["landing_point"], option


def test_gauss_nodes_and_other_solver(capsys):
    code, out, _ = run(
        capsys, "glide", "--json", "--height", "0.5", "--node-set", "gauss", "--nodes", "20",
        "--solver", "tsit5",
    )  # fmt: skip
    assert code == 0
    assert json.loads(out)["outcome"] == "landed"


def test_a_tumbling_glide_is_a_result(capsys):
    code, out, _ = run(
        capsys, "glide", "--json", "--nu-theta", "1", "--f-theta", "0", "--height", "10"
    )
    assert code == 0
    result = json.loads(out)
    assert result["outcome"].startswith("unstable in")
    name = result["outcome"].split()[-1]
    assert abs(result["end_angles_deg"][name]) == pytest.approx(85, abs=1e-6)


@settings(max_examples=60, deadline=None)
@given(
    option=st.sampled_from(["--svl", "--mass", "--height", "--rtol", "--atol"]),
    value=st.one_of(
        st.floats(max_value=0.0, allow_infinity=False, allow_nan=False),
        st.sampled_from([float("nan"), float("inf"), -float("inf")]),
    ),
)
def test_bad_numbers(option, value):
    check_error([option + f"={value}"], option)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--theta-m=181"], "--theta-m = 181 deg is not allowed"),
        (["--psi-m=-1"], "--psi-m = -1 deg"),
        (["--d-psi=200"], "must be finite and in [-180, 180] deg/SVL"),
        (["--nodes=7"], "--nodes = 7 is not allowed: it must be in [8, 2000]"),
        (["--nodes=0"], "--nodes = 0"),
        (["--neck-fraction=0.5"], "--neck-fraction = 0.5 of SVL is not allowed"),
        (["--nu-theta=nan"], "--nu-theta"),
        (["--speed=-1"], "--speed = -1 m/s"),
        (["--save=nowhere/at/all.nc"], "nowhere"),
        (["--save=file.txt"], ".nc"),
        (["--plot=file.txt"], ".png"),
    ],
)
def test_bad_input(arguments, message):
    check_error(arguments, message)


def check_error(arguments, name):
    import contextlib
    import io

    err = io.StringIO()
    with contextlib.redirect_stderr(err), contextlib.redirect_stdout(io.StringIO()) as out:
        code = cli.main(["glide", *arguments])
    assert code == 2
    assert out.getvalue() == ""
    message = err.getvalue()
    assert name in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--json",), "arguments are required: COMMAND"),
        (("fly",), "invalid choice: 'fly'"),
        (("glide", "--height", "ten"), "argument --height: 'ten' is not a number"),
        (("glide", "--height", "nan"), "argument --height: 'nan' is not a finite number"),
        (("glide", "--nodes", "70.0"), "argument --nodes: '70.0' is not a whole number"),
        (("glide", "--height", "1", "--height", "2"), "argument --height: given twice"),
        (("sweep", "--rtol=1", "--json", "--rtol=1"), "argument --rtol: given twice"),
        (("view", "--out", "a.html", "--out", "b.html"), "argument --out: given twice"),
        (("glide", "--heigh", "1"), "unrecognized arguments: --heigh 1"),
        (("gradient", "--fix", "mass=1", "--fix", "mass=2"), "--fix gives mass twice"),
    ],
)
def test_usage_errors(capsys, arguments, message):
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_json_has_null_for_what_is_not_a_number(capsys):
    print_json({"a": np.float64("nan"), "b": [1.5, {"c": [float("inf"), True]}], "d": "nan"})
    expected = {"a": None, "b": [1.5, {"c": [None, True]}], "d": "nan"}
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == expected


def test_a_flight_that_cannot_be_computed_exits_with_1(capsys, monkeypatch):
    from jaxglide.flight import glide as module

    original = module.simulate
    monkeypatch.setattr(
        module, "simulate", lambda *a, **k: original(*a, **{**k, "max_steps": 3})
    )
    monkeypatch.setattr("jaxglide.simulate", module.simulate, raising=False)
    code, _, err = run(capsys, "glide")
    assert code == 1
    assert "ran out of steps" in err


TUNNEL = ("windtunnel", "--polar", "smooth", "--phases", "6")  # compiled once


def test_windtunnel_prints_and_writes_what_the_library_says(capsys, tmp_path):
    save, plot = tmp_path / "t.nc", tmp_path / "t.png"
    options = (*TUNNEL, "--height", "1", "--pitch", "5")
    code, out, err = run(capsys, *options, "--save", str(save), "--plot", str(plot))
    assert (code, err) == (0, "")
    assert "landed" in out
    assert "Moments over 6 phases (N mm)" in out
    assert plot.stat().st_size > 10_000
    with xr.open_dataset(save, engine="h5netcdf") as data:
        assert data.sizes["phase"] == 6
        assert data.velocity.values[0, 0].tolist() == [1.7, 0.0]
    code, out, _ = run(capsys, *options, "--json")
    found = json.loads(out)
    glider = jg.Glider(jg.Snake.from_svl(), jg.Gait.from_degrees(), jg.Polar.smooth())
    fallen = fall(glider, jg.Launch(1.0, 1.7), angles=(0.0, np.deg2rad(5), 0.0), max_time=10.0)
    assert found["time"] == pytest.approx(float(fallen.time), abs=1e-9)
    stats = over_phases(loads_at_end(fallen, 6).aerodynamic)
    pitch = found["moments_N_mm"]["pitch"]
    assert pitch["mean"] == pytest.approx(1e3 * float(stats.mean[0]))
    assert pitch["peak_to_peak"] == pytest.approx(1e3 * float(stats.peak_to_peak[0]))
    effect = found["pitch_moment_derivatives_N_mm_per_unit"]["d_psi"]
    assert effect["unit"] == "deg"
    state = fallen.state
    slopes = derivatives(
        glider, [0, state[2], state[3]], fallen.angles, time=fallen.time, phases=6
    )
    assert effect["value"] == pytest.approx(np.deg2rad(1e3 * float(slopes.by_gait.d_psi[0])))


@pytest.mark.slow
def test_trim_prints_a_root_or_says_there_is_none(capsys, tmp_path):
    plot = tmp_path / "t.png"
    # over the published polar's kinks the moment jumps by 1e-8 N mm from value to value
    given = ("trim", "--height", "2", "--polar", "smooth")
    code, out, err = run(capsys, *given, "--plot", str(plot))
    assert (code, err) == (0, "")
    assert "trim at d_psi = " in out
    assert plot.stat().st_size > 5_000
    code, out, _ = run(capsys, *given, "--json")
    found = json.loads(out)
    assert (code, found["unit"]) == (0, "deg/SVL")
    assert -20 < found["value"] < 20
    assert abs(found["moment_N_mm"]) < 1e-8
    signs = np.sign(found["moments_N_mm"])
    assert signs[0] < 0 < signs[-1]
    high = str(found["scanned"][int(np.argmax(signs > 0)) - 1])
    code, out, _ = run(capsys, *given, "--high", high)
    assert code == 1
    assert "no trim: the moment does not change sign" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("windtunnel", "--phases=1"), "--phases = 1 is not allowed: it must be in [4, 3600]"),
        (("windtunnel", "--phases=0"), "--phases = 0 is not allowed"),
        (("windtunnel", "--phases=1000000000"), "--phases = 1000000000 is not allowed"),
        (("windtunnel", "--pitch=85"), "--pitch = 85 deg is not allowed"),
        (("windtunnel", "--max-time=0"), "--max-time = 0 s is not allowed"),
        (("windtunnel", "--interval=0.1"), "--interval does not apply: records are kept with"),
        (("windtunnel", "--heading=5"), "unrecognized arguments: --heading=5"),
        (("trim", "--d-psi=5"), "--d-psi does not apply: d_psi is what trim looks for"),
        (("trim", "--low=-181"), "--low = -181 deg/SVL is not allowed"),
        (("trim", "--low=0", "--high=0"), "--low 0 is not below --high 0"),
        (("shapes", "--height=0"), "--height = 0 m is not allowed"),
        (
            ("view", "--out=a.html", "--playback=1"),
            "--playback does not apply: it is",
        ),
        (("view", "--out=a.gif", "--at=1"), "--at does not apply: it is the time of a still"),
        (("view", "--out=a.png", "--frames-per-second=9"), "a still (.png) is one frame"),
        (("plot", "a.nc", "--at", "x=1", "--at", "x=2"), "--at gives x twice"),
    ],
)
def test_what_does_not_apply_is_refused(capsys, arguments, message):
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_a_ratio_over_no_moment_is_undefined_and_said_to_be(capsys):
    calm = (*TUNNEL, "--height", "1", "--lift-scale=0", "--drag-scale=0")
    code, out, err = run(capsys, *calm, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out, parse_constant=pytest.fail)
    ratios = {turn: row["inertial_ratio"] for turn, row in found["moments_N_mm"].items()}
    assert ratios == {"pitch": None, "roll": None, "yaw": None}
    assert found["moments_N_mm"]["yaw"]["inertial_peak_to_peak"] > 0
    assert "moment of the air does not change" in found["note"]
    code, out, err = run(capsys, *calm)
    assert (code, err) == (0, "")
    assert "nan" not in out
    assert found["note"] in out


def test_a_held_glide_that_does_not_land_is_a_failure(capsys, tmp_path):
    save = tmp_path / "t.nc"
    high = (*TUNNEL, "--height", "1000", "--save", str(save))
    code, out, err = run(capsys, *high)
    assert code == 1
    assert "ran out of time" in out
    assert "no file was written" in err
    assert not save.exists()


def test_the_command_line_and_python_have_the_same_defaults():
    """Options left out are the defaults of the functions that they reach."""
    from jaxglide._lib.defaults import HELD_SPEED, HELD_TOLERANCE, TUNNEL
    from jaxglide.ensemble import published, survey
    from jaxglide.ensemble.study import Study
    from jaxglide.flight.glide import simulate
    from jaxglide.flights.flights import fly_flights
    from jaxglide.search.objectives import landing_distance
    from jaxglide.search.problem import Problem
    from jaxglide.tunnel.fall import PUBLISHED_LAUNCH

    def defaults(function):
        given = inspect.signature(function).parameters.values()
        return {p.name: p.default for p in given if p.default is not p.empty}

    def parsed(*words):
        return vars(cli._parser().parse_args(words))

    plain, held, search = parsed("glide"), parsed("windtunnel"), parsed("gradient")
    for function in (simulate, Study, published.shape_space, published.shape_study):
        for name in ("rtol", "atol"):
            assert defaults(function)[name] == plain[name], function
    for words in (("shapes",), ("sweep",), ("view",)):
        given = parsed(*words)
        assert given["rtol"] == given["atol"] == plain["rtol"]
    assert defaults(simulate)["max_time"] == defaults(Study)["max_time"]
    assert defaults(simulate)["max_steps"] == defaults(Study)["max_steps"]
    for name in ("interval", "max_time"):
        assert defaults(fall)[name] == held[name] == TUNNEL[name].default
        assert defaults(survey.survey)[name] == held[name]
    reading = (loads, loads_at_end, survey.survey, derivatives)
    for function in reading:
        assert defaults(function)["phases"] == held["phases"]
    assert defaults(fall)["rtol"] == defaults(fall)["atol"]
    assert defaults(fall)["rtol"] == HELD_TOLERANCE
    assert (jg.Launch().height, HELD_SPEED) == PUBLISHED_LAUNCH
    setups = [parsed(word) for word in ("glide", "windtunnel", "trim", "sweep", "view")]
    study = Study({"svl": [0.7]})
    assert {(s["polar"], s["node_set"]) for s in setups} == {("published", "published")}
    assert (study.setup["polar"], study.setup["node_set"]) == ("published", "published")
    flown = defaults(fly_flights)
    assert flown == {name: parsed("compare", "a.nc").get(name, x) for name, x in flown.items()}
    problem = Problem(landing_distance, {"d_psi": (0, 1)})
    for name in ("polar", "node_set"):
        assert problem.setup[name] == search[name] == parsed("optimise")[name]


@pytest.fixture
def swept(monkeypatch):
    """What `jaxglide sweep` hands to `sweep`; the outcomes it gets back are set by it."""
    told = {"outcome": Outcome.LANDED}

    def fly(study, store, **options):
        told.update(study=study, store=store, **options)
        point = np.zeros((*study.shape, 3))
        point[..., 1].flat = np.arange(len(study))
        outcome = np.zeros(study.shape, int)
        outcome.flat[0] = told["outcome"]
        dims = tuple(study.varied)
        return xr.Dataset(
            {"outcome": (dims, outcome), "landing_point": ((*dims, "axis"), point)},
            {"axis": list("xyz")},
        )

    monkeypatch.setattr("jaxglide.ensemble.sweep.sweep", fly)
    return told


SWEEP = ("sweep", "--vary", "nu_theta=1.2:1.5:4", "--vary", "d_psi=0,10", "--fix", "height=5")


def test_sweep_options_reach_the_study(capsys, tmp_path, swept):
    store, save = tmp_path / "s.zarr", tmp_path / "s.nc"
    code, out, err = run(
        capsys, *SWEEP, "--fix", "speed=2", "--polar", "smooth", "--nodes", "20", "--rtol",
        "1e-5", "--atol", "1e-4", "--width", "3", "--store", str(store), "--save", str(save),
    )  # fmt: skip
    assert (code, err) == (0, "")
    study = swept["study"]
    assert study.shape == (4, 2)
    np.testing.assert_allclose(study.varied["nu_theta"], [1.2, 1.3, 1.4, 1.5])
    assert list(study.varied["d_psi"]) == [0, 10]
    assert study.fixed == {"height": 5, "speed": 2}
    assert study.setup == {"polar": "smooth", "node_set": "published", "nodes": 20}
    assert (study.rtol, study.atol) == (1e-5, 1e-4)
    assert (swept["store"], swept["width"], swept["cluster"]) == (store, 3, None)
    assert "8 glides" in out
    assert "7.000 m at nu_theta 1.5, d_psi 10, height 5" in out
    with xr.open_dataset(save, engine="h5netcdf") as data:
        assert data.outcome.shape == (4, 2)


@pytest.mark.parametrize("extra", [(), ("--json",)])
def test_a_sweep_that_could_not_compute_a_glide_exits_with_1(capsys, swept, extra):
    for outcome, expected in ((Outcome.UNSTABLE_ROLL, 0), (Outcome.OUT_OF_TIME, 1)):
        swept["outcome"] = outcome
        code, out, _ = run(capsys, *SWEEP, *extra)
        assert code == expected
        assert str(outcome) in out
    if extra:
        assert json.loads(out)["outcomes"] == {"landed": 7, "ran out of time": 1}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "nothing to vary"),
        (("study.toml", "--vary", "svl=1"), "not both"),
        (("--vary", "svl"), "is not NAME=a,b,c"),
        (("--vary", "svl=1:2:0"), "nor NAME=start:stop:count"),
        (("--vary", "svl=1", "--fix", "height=1,2"), "--fix 'height=1,2' is not NAME=VALUE"),
        (("--vary", "svl=1", "--vary", "svl=2"), "--vary gives svl twice"),
        (("--vary=svl=1", "--fix=mass=1", "--fix=mass=2"), "--fix gives mass twice"),
        (("--vary", "svl=1", "--fix", "svl=1"), "svl is both varied and fixed"),
        (("--vary", "svl=1:2:9999", "--vary", "mass=1:2:9999"), "svl 9999 x mass 9999"),
        (("study.toml", "--polar", "smooth"), "--polar does not apply: study.toml decides it"),
        (("study.toml", "--node-set=gauss"), "--node-set does not apply"),
        (("study.toml", "--nodes=20"), "--nodes does not apply"),
        (("study.toml", "--rtol=1e-6"), "--rtol does not apply"),
        (("study.toml", "--atol=1e-6"), "--atol does not apply"),
        (("--vary", "svl=1", "--width", "0"), "--width = 0 is not allowed"),
        (("--vary", "svl=1", "--save", "s.zarr"), ".nc"),
        (("--vary", "nu_theta=1:2:1"), "nu_theta from 1 to 2 is more than 1 value"),
        (("--vary", f"nu_theta=1:2:{10**20}"), "cases (nu_theta"),
        (("--vary", "nu_theta=1,2,1"), "nu_theta = 1 stands twice in the grid"),
    ],
)
def test_wrong_sweeps(capsys, swept, arguments, message):
    code, out, err = run(capsys, "sweep", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert "study" not in swept


def test_shapes_options_reach_the_study(capsys, monkeypatch):
    from jaxglide.ensemble.published import NU_THETA, THETA_M, regions

    told, lost = [], []

    def fly(height, **tolerances):
        told.append((height, tolerances))
        shapes = ("f_theta", "theta_m", "nu_theta")
        outcome = np.zeros((2, 11, 11), int)
        outcome[1, 3, 4] = len(told) == 2  # at the finer tolerance one is unstable
        for place in lost:
            outcome[place] = Outcome.OUT_OF_TIME
        return xr.Dataset(
            {"outcome": (shapes, outcome), "path_length": (shapes, np.ones((2, 11, 11)))},
            {"f_theta": [0.0, 1.2], "theta_m": THETA_M, "nu_theta": NU_THETA,
             "region": (shapes[1:], regions())},
        )  # fmt: skip

    monkeypatch.setattr("jaxglide.ensemble.published.shape_space", fly)
    options = ("--height", "12", "--rtol", "1e-5", "--atol", "1e-4", "--check", "--json")
    code, out, err = run(capsys, "shapes", *options)
    assert (code, err) == (0, "")
    fine = {"rtol": 1e-9, "atol": 1e-9}
    assert told == [(12, {"rtol": 1e-5, "atol": 1e-4}), (12, fine)]
    result = json.loads(out)
    assert result["height"] == 12
    assert len(result["table"]) == 16
    assert all(row["published"] is None for row in result["table"])  # published for 10 m
    assert result["borderline"] == [[1.2, THETA_M[3], NU_THETA[4]]]
    code, out, _ = run(capsys, "shapes")
    assert code == 0
    assert "242 glides from 10 m" in out
    assert "94.215" in out  # published
    lost.append((0, 5, 6))
    code, out, err = run(capsys, "shapes", "--json")
    assert (code, json.loads(out)["not_computed"]) == (1, 1)
    assert "1 of 242 glides could not be computed" in err


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_pictures_may_be_png_pdf_or_svg(tmp_path, suffix):
    check_error(["--nodes=7", f"--plot={tmp_path}/glide.{suffix}"], "nodes")


THROW = ("--free", "elevation", "--fix", "lift_scale=0", "--fix", "drag_scale=0", "--fix")
THROW += ("speed=6", "--fix", "height=2", "--nodes", "20")


def thrown(degrees):
    """Distance [m] of a body thrown at 6 m/s from 2 m."""
    a = np.deg2rad(degrees)
    up = 6 * np.sin(a)
    return 6 * np.cos(a) * (up + np.sqrt(up**2 + 4 * 9.81)) / 9.81


@pytest.mark.slow
def test_gradient_is_the_closed_form_and_shows_its_check(capsys):
    code, out, err = run(capsys, "gradient", *THROW, "--fix", "elevation=20", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    expected = (thrown(20 + 1e-4) - thrown(20 - 1e-4)) / 2e-4
    row = found["gradient"]["elevation"]
    assert found["value"] == pytest.approx(thrown(20), rel=1e-9)
    assert row["at"] == 20
    assert row["unit"] == "deg"
    assert row["gradient"] == pytest.approx(expected, rel=1e-6)
    assert row["difference"] == pytest.approx(expected, rel=1e-6)
    code, _, err = run(capsys, "gradient", "--free", "speed")
    assert code == 2
    assert "speed follows from other parameters" in err


@pytest.mark.slow
def test_optimise_finds_the_best_throw(capsys, tmp_path):
    save, plot, log = tmp_path / "o.nc", tmp_path / "o.png", tmp_path / "o.jsonl"
    options = ("optimise", *THROW, "--bounds", "elevation=10:60", "--margin", "none")
    options += ("--starts", "2", "--screen", "8", "--steps", "25", "--log", str(log))
    options += ("--guess", "elevation=12.5")
    code, out, err = run(capsys, *options, "--save", str(save), "--plot", str(plot))
    assert (code, err) == (0, "")
    assert re.search(r"^  elevation +\d+\.\d+ deg$", out, re.M)
    assert "landing_distance" in out
    assert "at 1e-9" in out
    assert "of body and flight lies beyond the measured force coefficients" in out
    for ending in ("", "_glides"):
        assert (tmp_path / f"o{ending}.png").stat().st_size > 5_000
    with xr.open_dataset(save, engine="h5netcdf") as data:
        assert data.attrs["seed"] == 0
        assert data.sizes["start"] == 2
        first = data.point.isel(step=0, start=0).sel(parameter="elevation")
        assert float(first) == pytest.approx(12.5)
    code, out, _ = run(capsys, *options, "--json")  # from the log: nothing is flown again
    found = json.loads(out)
    best = np.rad2deg(np.arctan(6 / np.sqrt(36 + 4 * 9.81)))
    assert found["best"]["elevation"] == pytest.approx(best, abs=1.0)
    assert found["value"] == pytest.approx(thrown(best), rel=1e-3)
    assert found["feasible"] is True
    assert 0 < found["beyond_measured"]["either"] <= 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--bounds", "d_psi"), "'d_psi' is not NAME=LOW:HIGH"),
        (("--bounds", "psi_m=1:2"), "--bounds psi_m: it is not free"),
        (("--free", "speed"), "give --bounds of speed"),
        (("--margin", "much"), "--margin 'much' is not a number"),
        (("--fix", "height"), "--fix 'height' is not NAME=VALUE"),
        (("--fix", "height=-1"), "height = -1 m is not allowed"),
        (("--starts", "0"), "starts = 0 is not allowed"),
        (("--guess", "theta_m"), "'theta_m' is not NAME=VALUE"),
        (("--guess", "theta_m=96,nu_theta=1.3"), "a guess lacks d_psi"),
    ],
)
def test_optimise_names_what_is_wrong(capsys, options, message):
    code, out, err = run(capsys, "optimise", *options)
    assert (code, out) == (2, "")
    assert message in err
