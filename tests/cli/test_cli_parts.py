"""Parts on the command line: each flag makes its part, what does not fit is named."""

import json
import re

import numpy as np
import pytest
from equinox import tree_equal

import jaxglide as jg
from command import run
from jaxglide import cli
from jaxglide.cli import _case, optimise, sweep

ROBOT = "position,chord,density,point_mass\n0,0.02,0.05,0\n0.3,0.05,0.1,0.02\n0.9,0.01,0.05,0\n"
POLAR = "angle_of_attack,lift,drag\n-90,0,2\n0,0,0.1\n45,1,1\n90,0,2\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A scratch folder with a robot and a polar, the current one."""
    (tmp_path / "robot.csv").write_text(ROBOT)
    (tmp_path / "polar.csv").write_text(POLAR)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def parsed(*words):
    return cli._parser(words[:1]).parse_args(words)


def case_of(*words, command="glide"):
    return _case.case_of(parsed(command, *words))


@pytest.mark.parametrize(
    ("words", "air"),
    [
        ("--wind 1,0,-0.5", jg.UniformWind([1, 0, -0.5])),
        ("--wind -1,0,0 --air-density 1.2", jg.UniformWind([-1, 0, 0], air_density=1.2)),
        ("--shear 0,2,0", jg.ShearWind([0, 2, 0])),
        (
            "--shear 0,2,0 --shear-height 5 --shear-exponent 0.2",
            jg.ShearWind([0, 2, 0], 5, 0.2),
        ),
        ("--gust 0,0,1", jg.Gust([0, 0, 1])),
        ("--gust 0,0,1 --gust-start -2 --gust-length 3", jg.Gust([0, 0, 1], -2, 3)),
        ("--turbulence 0.5", jg.Turbulence(0.5)),
        (
            "--turbulence 0.5 --turbulence-length 3 --turbulence-seed 7 --wind 1,0,0",
            jg.Turbulence(0.5, 3, [1, 0, 0], 7),
        ),
    ],
)
def test_winds(words, air):
    assert tree_equal(case_of(*words.split()).glider.air, air, rtol=1e-15)


def test_bodies_polars_lag_and_launch(folder):
    words = "--body robot.csv --neck-fraction 0.05 --gyration 0.2 --nodes 20 --d-psi 4"
    words += " --polar polar.csv --lift-scale 1.1 --lag 5 --lag-share 0.3 --omega 0,-1,2"
    case = case_of(*words.split())
    robot = jg.TabulatedBody.from_csv(
        "robot.csv", neck_fraction=0.05, gyration=0.2, nodes=20, node_set="published"
    )
    lagging = jg.LaggingCirculation(jg.TabulatedPolar.from_csv("polar.csv", 1.1), 5, 0.3)
    assert tree_equal(case.glider.body, robot, rtol=1e-15)
    assert tree_equal(case.glider.aerodynamics, lagging, rtol=1e-15)
    assert case.launch.omega.tolist() == [0, -1, 2]
    assert case.value("d_psi") == pytest.approx(4)
    band = case_of("--polar", "band-limited").glider.aerodynamics.polar
    assert tree_equal(band, jg.Polar.band_limited())


@pytest.mark.parametrize(
    ("given", "ends"),
    [
        ((), (jg.Ground(), jg.AngleLimit())),
        (("time=2",), (jg.Ground(), jg.AngleLimit(), jg.TimeLimit(2))),
        (("ground=-1.5",), (jg.AngleLimit(), jg.Ground(-1.5))),
        (
            ("angle=60:pitch,roll", "plane=0,1,0,5"),
            (
                jg.Ground(),
                jg.AngleLimit.degrees(60.0, ("pitch", "roll")),
                jg.Plane([0, 1, 0], 5),
            ),
        ),
        (("ground=none", "angle=none", "time=1"), (jg.TimeLimit(1),)),
    ],
)
def test_ends(given, ends):
    words = [word for text in given for word in ("--end", text)]
    assert tree_equal(case_of(*words).ends, ends, rtol=1e-15)


def test_a_robot_flies_as_it_does_in_python(capsys, folder):
    words = "--body robot.csv --height 0.3 --nodes 20 --wind 0.5,0,0 --polar polar.csv"
    words += " --end angle=80:roll,pitch --end plane=0,1,0,0.2 --speed 2 --rtol 1e-5"
    code, out, err = run(capsys, "glide", *words.split(), "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    glider = jg.Glider(
        jg.TabulatedBody.from_csv("robot.csv", nodes=20),
        jg.Gait.from_degrees(),
        jg.TabulatedPolar.from_csv("polar.csv"),
        jg.UniformWind([0.5, 0, 0]),
    )
    limit = jg.AngleLimit.degrees(80.0, ("roll", "pitch"))
    ends = jg.Ground(), limit, jg.Plane([0, 1, 0], 0.2)
    glide = jg.simulate(glider, jg.Launch(0.3, 2.0), ends=ends, rtol=1e-5)
    assert found["outcome"] == glide.ending == "reached the plane"
    np.testing.assert_allclose(found["landing_point"], glide.landing_point, atol=1e-12)
    assert found["time"] == pytest.approx(float(glide.time), rel=1e-12)


def test_parts_reach_a_study_and_a_problem(folder):
    words = "--vary d_psi=0,10 --vary air.velocity[0]=0,1 --fix gait.psi_m=15"
    words += " --wind 0,1,0 --body robot.csv"
    args = parsed("sweep", *words.split())
    study = sweep._study(args)
    assert study.shape == (2, 2)
    assert study.setup == {}
    assert study.case.glider.air.velocity.tolist() == [0, 1, 0]
    assert study.base.value("psi_m") == pytest.approx(15)
    assert float(study.case.glider.body.mass) == pytest.approx(0.0875)
    words = "--free gust_length --bounds gust_length=1:3 --gust 0,0,1 --fix gust_start=0"
    problem = optimise._problem(parsed("optimise", *words.split()))
    assert problem.base.value("gust_length") == 2
    assert problem.base.glider.aerodynamics.polar.cells.shape[-1] == 4  # smooth still
    plain = sweep._study(parsed("sweep", "--vary", "d_psi=0,10", "--polar", "smooth"))
    assert plain.setup == {"polar": "smooth", "node_set": "published", "nodes": 70}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("glide --wind 1,0", "argument --wind: '1,0' is not three numbers X,Y,Z"),
        ("glide --wind 1,x,0", "argument --wind: 'x' is not a number"),
        ("glide --wind 1,nan,0", "argument --wind: 'nan' is not a finite number"),
        ("glide --wind 1,0,500", "--wind = 500 m/s is not allowed"),
        ("glide --wind 1,0,0 --gust 1,0,0", "--wind and --gust are two winds: give one"),
        ("glide --gust-length 3", "--gust-length does not apply: give --gust too"),
        ("glide --gust 0,0,1 --gust-length 0", "--gust-length = 0 m is not allowed"),
        ("glide --turbulence-seed 3", "--turbulence-seed does not apply"),
        ("glide --turbulence 1 --turbulence-seed -1", "--turbulence-seed = -1 is not allowed"),
        ("glide --turbulence -1", "--turbulence = -1 m/s is not allowed"),
        ("glide --shear 1,0,0 --shear-exponent 2", "--shear-exponent = 2 is not allowed"),
        ("glide --lag-share 0.5", "--lag-share does not apply: give --lag too"),
        ("glide --lag 0", "--lag = 0 half chords is not allowed"),
        ("glide --omega 0,0,1e4", "--omega = 10000 rad/s is not allowed"),
        ("glide --gyration 2", "--gyration = 2 chords is not allowed"),
        ("glide --polar flat", "'flat' is not one of published, smooth, band-limited, nor a"),
        ("glide --polar robot.csv", "robot.csv: "),
        ("glide --body polar.csv", "polar.csv: "),
        ("glide --body robot.csv --svl 0.8", "--svl does not apply: robot.csv decides it"),
        ("glide --body robot.csv --mass 1", "--mass does not apply: robot.csv decides it"),
        ("glide --nu-theta 5", "theta_m = -107.274 deg is not allowed"),
        ("glide --end", "argument --end: expected one argument"),
        ("glide --end tree=3", "--end 'tree=3' is not ground=Z, angle=LIMIT"),
        ("glide --end time", "--end 'time' is not ground=Z"),
        ("glide --end time=none", "--end 'time=none' is not ground=Z"),
        ("glide --end time=nan", "--end time = nan s is not allowed"),
        ("glide --end angle=0", "--end angle = 0 deg is not allowed"),
        ("glide --end angle=80:nod", "it must name yaw, pitch or roll"),
        ("glide --end plane=0,0,1", "--end 'plane=0,0,1' is not"),
        ("glide --end plane=0,0,0,1", "normal = (0, 0, 0) is not allowed"),
        ("windtunnel --gust 0,0,1", "unrecognized arguments: --gust 0,0,1"),
        ("windtunnel --omega 0,0,1", "unrecognized arguments: --omega"),
        ("trim --end time=1", "unrecognized arguments: --end"),
        ("sweep s.toml --wind 1,0,0", "--wind does not apply: s.toml decides it"),
        ("sweep s.toml --end time=1", "--end does not apply: s.toml decides it"),
        ("sweep --vary air.velocity[3]=1 --wind 1,0,0", "there is no 'air.velocity[3]'"),
        (
            "sweep --vary velocity=1 --wind 1,0,0",
            "velocity is not one number but of shape (3,)",
        ),
        ("sweep --vary wings=1", "there is no parameter 'wings'"),
        ("sweep --vary d_psi=1 --fix lag=-1 --lag 5", "lag = -1 half chords is not allowed"),
        ("gradient --free d_psi --wind 1,0", "is not three numbers"),
    ],
)
def test_what_does_not_fit_is_named(capsys, folder, words, message):
    code, out, err = run(capsys, *words.split())
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1


def test_a_file_that_is_not_there_is_named(capsys, folder):
    code, out, err = run(capsys, "glide", "--body", "none.csv")
    assert (code, out) == (1, "")
    assert err == "jaxglide: none.csv: No such file or directory\n"


def test_flags_of_numbers_say_what_their_fields_do(capsys):
    with pytest.raises(SystemExit):
        run(capsys, "glide", "--help")
    text = " ".join(capsys.readouterr().out.split())
    base = _case.published_case()
    for names in _case._GROUPS.values():
        for name in names:
            known = base.parameter(name)
            unit = re.escape(f" [{known.unit}]") if known.unit else ""
            flag = f"--{name.replace('_', '-')} X"
            assert re.search(rf"{flag} {re.escape(known.meaning)}{unit} \(", text), name
