"""The command line, in process: options, files, errors, exit codes."""

import json

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import jaxglide as jg
from jaxglide import cli
from jaxglide.trim import derivatives
from jaxglide.windtunnel import fall, loads_at_end, over_phases


@pytest.fixture(autouse=True)
def _keep_jax_settings(monkeypatch):
    """The tests set up JAX themselves."""
    monkeypatch.setattr(cli, "configure", lambda: None)


def run(capsys, *arguments):
    code = cli.main(list(arguments))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


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
        assert data.angles.attrs["units"] == "deg"
        assert data.sizes["node"] == 70
        for name in ("nu_theta", "theta_m", "mass", "rtol", "solver", "version_jaxglide"):
            assert name in data.attrs, name
        assert data.attrs["polar"] == "published"
        assert data.position.values[-1, 2] == pytest.approx(0, abs=1e-9)
        # the file's own consistency: nodes surround the centre of mass, forces are finite
        span = np.abs(data.body.values - data.position.values[:, :, None]).max()
        assert 0.05 < span < 0.7
        assert np.isfinite(data.force.values).all()


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


RANGES = {
    "--svl": "svl",
    "--mass": "mass",
    "--height": "height",
    "--rtol": "rtol",
    "--atol": "atol",
}


@settings(max_examples=60, deadline=None)
@given(
    option=st.sampled_from(sorted(RANGES)),
    value=st.one_of(
        st.floats(max_value=0.0, allow_infinity=False, allow_nan=False),
        st.sampled_from([float("nan"), float("inf"), -float("inf")]),
    ),
)
def test_bad_numbers(option, value):
    check_error([option + f"={value}"], RANGES[option])


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (["--theta-m=181"], "theta_m"),
        (["--psi-m=-1"], "psi_m"),
        (["--d-psi=200"], "d_psi"),
        (["--nodes=7"], "nodes"),
        (["--nodes=0"], "nodes"),
        (["--neck-fraction=0.5"], "neck_fraction"),
        (["--nu-theta=nan"], "nu_theta"),
        (["--speed=-1"], "speed"),
        (["--save=nowhere/at/all.nc"], "nowhere"),
        (["--save=file.txt"], ".nc"),
        (["--plot=file.txt"], ".png"),
    ],
)
def test_bad_input(arguments, name):
    check_error(arguments, name)


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


@pytest.mark.parametrize("arguments", [[], ["fly"], ["glide", "--height", "ten"]])
def test_usage_errors(arguments):
    with pytest.raises(SystemExit) as error:
        cli.main(arguments)
    assert error.value.code == 2


def test_a_flight_that_cannot_be_computed_exits_with_1(capsys, monkeypatch):
    from jaxglide import glide as module

    original = module.simulate
    monkeypatch.setattr(
        module, "simulate", lambda *a, **k: original(*a, **{**k, "max_steps": 3})
    )
    monkeypatch.setattr("jaxglide.simulate", module.simulate, raising=False)
    code, _, err = run(capsys, "glide")
    assert code == 1
    assert "ran out of steps" in err


def test_windtunnel_prints_and_writes_what_the_library_says(capsys, tmp_path):
    save, plot = tmp_path / "t.nc", tmp_path / "t.png"
    options = (
        "windtunnel",
        "--height",
        "1",
        "--polar",
        "smooth",
        "--phases",
        "6",
        "--pitch",
        "5",
    )
    code, out, err = run(capsys, *options, "--save", str(save), "--plot", str(plot))
    assert (code, err) == (0, "")
    assert "landed" in out
    assert "Moments there over 6 phases (N mm)" in out
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


def test_trim_prints_a_root_or_says_there_is_none(capsys, tmp_path):
    plot = tmp_path / "t.png"
    code, out, err = run(capsys, "trim", "--height", "2", "--plot", str(plot))
    assert (code, err) == (0, "")
    assert "trim at d_psi = " in out
    assert plot.stat().st_size > 5_000
    code, out, _ = run(capsys, "trim", "--height", "2", "--json")
    found = json.loads(out)
    assert (code, found["unit"]) == (0, "deg/SVL")
    assert -20 < found["value"] < 20
    assert abs(found["moment_N_mm"]) < 1e-8
    signs = np.sign(found["moments_N_mm"])
    assert signs[0] < 0 < signs[-1]
    high = str(found["scanned"][int(np.argmax(signs > 0)) - 1])
    code, out, _ = run(capsys, "trim", "--height", "2", "--high", high)
    assert code == 1
    assert "no trim: the moment does not change sign" in out
    code, _, err = run(capsys, "trim", "--low", "0", "--high", "0")
    assert (code, err) == (2, "jaxglide: --low 0 is not below --high 0\n")
