"""`jaxglide control`: what it prints, writes and refuses."""

import json
import re

import equinox as eqx
import numpy as np
import pytest
import xarray as xr

import jaxglide
from command import run
from jaxglide import (
    Case,
    Constant,
    Controller,
    Environment,
    Gait,
    Glider,
    Gust,
    Launch,
    NeuralPolicy,
    Outcome,
    Polar,
    Snake,
    save,
)
from jaxglide._lib.formats import marked
from jaxglide.control import Trained
from jaxglide.loads.polar import name_of_cells
from jaxglide.plot.saved import draw

SMALL = "--nodes", "40", "--height", "2", "--d-psi", "5"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("control")


@pytest.fixture(scope="module")
def files(folder):
    """A controller that holds the gait, and a file that holds none."""
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    glider = Glider(body, Gait.from_degrees(d_psi=5), Polar.smooth())
    environment = Environment(Case(glider, Launch(height=2.0)))
    held = Controller(Constant(environment.plant.inputs), environment)
    other = xr.Dataset({"length": ((), 1.0, {"units": "m"})})
    save(marked(other, "fit"), folder / "fit.nc")
    return {"keep": save(held, folder / "law.nc"), "save": folder / "fit.nc"}


@pytest.mark.slow
def test_a_flight_is_told_saved_drawn_and_shown_and_its_law_flies_again(capsys, tmp_path):
    names = {"save": "it.nc", "plot": "it.png", "view": "it.html", "keep": "law.nc"}
    files = {name: tmp_path / file for name, file in names.items()}
    options = [word for name, file in files.items() for word in (f"--{name}", str(file))]
    code, out, err = run(capsys, "control", "fly", "--law", "none", *SMALL, *options)
    assert (code, err) == (0, "")
    flight = jaxglide.open(files["save"])
    assert flight.ending == "landed"
    assert f"landed at {float(flight.time):.4f} s" in out
    assert "d_psi          5.00 to 5.00 deg/SVL, of -20 to 30" in out
    assert files["plot"].stat().st_size > 10_000
    assert files["plot"].with_stem("it_portrait").stat().st_size > 5_000
    assert "dorsoventral bending" in files["view"].read_text()
    law = str(files["keep"])
    code, out, err = run(capsys, "control", "fly", "--law", law, "--json", "--height", "2.2")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["outcome"] == "landed"
    assert found["time"] > float(flight.time)
    assert found["heading_deg"] is None
    assert found["inputs"]["d_psi"]["unit"] == "deg/SVL"
    assert found["inputs"]["d_psi"]["lowest"] == pytest.approx(5)


@pytest.fixture
def asked(monkeypatch):
    told = {}

    def design(environment, **options):
        told.update(environment=environment, options=options)
        return Constant(environment.plant.inputs)

    def fly(environment, policy, key, samples):
        told.update(flown=environment, samples=samples)
        raise ValueError("flown")

    monkeypatch.setattr("jaxglide.control.linear_quadratic", design)
    monkeypatch.setattr("jaxglide.control.controlled_flight", fly)
    return told


def test_options_reach_the_library(capsys, asked):
    code, _, err = run(
        capsys, "control", "fly", "--inputs", "d_psi,nu_theta", "--samples", "4", "--price",
        "2", "--towards", "90", "--launch-cycles", "3", "--angle-noise", "2", "--delay", "0.05",
        "--omega-noise", "5", "--vary", "speed=1.5:2", "--gust", "0,0,1", "--max-time", "5",
        *SMALL,
    )  # fmt: skip
    assert (code, err) == (2, "jaxglide: flown\n")
    environment = asked["environment"]
    assert environment.chosen == (3, 2)
    options = {"price": 2.0, "heading": pytest.approx(np.pi / 2), "launch": 3}
    assert asked["options"] == options
    senses = environment.senses
    found = float(senses.angle_noise), float(senses.omega_noise), senses.delay, senses.velocity
    assert found == (pytest.approx(np.deg2rad(2)), pytest.approx(np.deg2rad(5)), 0.05, False)
    np.testing.assert_array_equal(environment.bounds["launch.speed"], [1.5, 2])
    assert isinstance(environment.held.air, Gust)
    assert asked["samples"] == 24  # 5 s of 4 samples in 1/1.2 s
    assert float(environment.case.launch.height) == 2


def test_points_are_flown_to_by_place_whatever_the_yaw(capsys, asked, monkeypatch):
    turns = []

    def coordinated(regulator, **told):
        turns.append(told)
        return regulator

    monkeypatch.setattr("jaxglide.control.CoordinatedTurn", coordinated)
    monkeypatch.setattr("jaxglide.control.Waypoints", lambda *given: asked.update(given=given))
    run(capsys, "control", "fly", "--to", "-20,50", "--to", "0,90", *SMALL)
    regulator, points = asked["given"]
    assert isinstance(regulator, Constant)
    assert points == [(-20, 50), (0, 90)]
    for where in (("--towards", "40"), ("--to", "0,90")):
        run(capsys, "control", "fly", *where, "--pace", "11.5", *SMALL)
    assert turns == [{}, *[{"pace": pytest.approx(np.deg2rad(11.5))}] * 2]
    environment = asked["environment"]
    assert environment.senses.place
    assert environment.case.ends[1].angles == ("pitch", "roll")


@pytest.mark.slow
def test_a_flight_to_points_tells_how_near_it_passed(capsys):
    gait = "--theta-m=82", "--psi-m=12.6", "--nu-theta=1.12", "--f-theta=1.58", "--d-psi=7.2"
    points = "--to=-20,50", "--to", "0,90", "--pace", "11.5", "--see-velocity"
    told = "--nodes", "40", "--height", "75", *gait, *points
    code, out, err = run(capsys, "control", "fly", "--json", *told)
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["outcome"] == "landed"
    first, second = found["points"]
    assert (first["right"], first["forward"]) == (-20, 50)
    assert max(first["distance"], second["distance"]) < 2


def test_what_is_given_beside_a_file_changes_its_case(capsys, asked, files):
    run(
        capsys, "control", "fly", "--law", str(files["keep"]), "--polar", "published",
        "--gust", "0,0,1", "--see-velocity", "--vary", "mass=0.03:0.04", "--end",
        "angle=80:pitch,roll", "--speed", "2",
    )  # fmt: skip
    known, now = jaxglide.open(files["keep"]).environment, asked["flown"]
    assert now.senses.velocity
    assert not known.senses.velocity
    assert isinstance(now.held.air, Gust)
    polars = [name_of_cells(one.held.aerodynamics.polar.cells) for one in (known, now)]
    assert polars == ["smooth", "published"]
    assert list(now.bounds) == ["body.mass"]
    assert float(now.case.launch.speed) == 2
    assert [type(end).__name__ for end in now.case.ends] == ["Ground", "AngleLimit"]
    assert now.case.ends[1].angles == ("pitch", "roll")


def flights(landed, speeds):
    """What `evaluate_policy` gives of such flights."""
    count, words = len(landed), [str(one) for one in Outcome]
    return xr.Dataset(
        {
            "outcome": ("flight", np.where(landed, 0, 2).astype(np.int32), {"words": words}),
            "landed": ("flight", np.asarray(landed)),
            "time": ("flight", np.arange(count) + 1.0, {"units": "s"}),
            "position": (("flight", "axis"), np.outer(np.arange(count), [3.0, 4.0, 0.0])),
            "angles": (("flight", "angle"), np.zeros((count, 3))),
            "launch.speed": ("flight", np.asarray(speeds), {"units": "m/s"}),
        },
        {"axis": ["right", "forward", "up"], "angle": ["yaw", "pitch", "roll"]},
    )


def test_laws_are_compared_by_the_same_flights(capsys, asked, monkeypatch, tmp_path, files):
    told = []

    def judge(environment, policy, count, **options):
        told.append((type(policy).__name__, count, options))
        return flights([len(told) > 1] * 3 + [True], [1.5, 1.6, 1.7, 1.8])

    monkeypatch.setattr("jaxglide.control.evaluate_policy", judge)
    words = "--vary", "speed=1.5:2", "--flights", "4", "--seed", "7", *SMALL
    saved, drawn = tmp_path / "it.nc", tmp_path / "it.png"
    written = "--save", str(saved), "--plot", str(drawn)
    code, out, err = run(capsys, "control", "compare", *words, *written)
    assert (code, err) == (0, "")
    assert out.splitlines()[:2] == [
        "none: 1 of 4 flights land (25 %), 15.0 m from the launch (median)",
        "lqr: 4 of 4 flights land (100 %), 7.5 m from the launch (median)",
    ]
    options = {"seed": 7, "samples": 288}
    assert told == [("Constant", 4, options)] * 2
    data = jaxglide.open(saved)
    assert data.sizes == {"law": 2, "flight": 4, "axis": 3, "angle": 3}
    assert data["landed"].sum("flight").values.tolist() == [1, 4]
    assert data["outcome"].attrs["flag_meanings"].startswith("landed ")
    assert data["speed"].attrs["units"] == "m/s"
    assert draw(data).said == "share of flights that land over speed"
    assert drawn.stat().st_size > 5_000
    code, out, _ = run(capsys, "control", "compare", "--law", "none", *words, "--json")
    counts = {"flights": 4, "landed": 4, "distance": 7.5, "time": 2.5}
    assert (code, json.loads(out)) == (0, {"none": counts})


def test_a_law_is_trained_kept_and_told(capsys, monkeypatch, tmp_path, files):
    told = {}

    def train(policy, environment, **options):
        told.update(policy=policy, options=options)
        losses = np.linspace(2.0, 1.0, 20)
        return Trained(policy, losses, np.where(np.arange(20) < 2, np.nan, 0.75))

    monkeypatch.setattr("jaxglide.control.train_policy", train)
    saved, log = tmp_path / "it.nc", tmp_path / "it.log"
    code, out, err = run(
        capsys, "control", "train", "--law", "none", "--learns", "network", "--updates", "20",
        "--rate", "0.02", "--seed", "3", "--log", str(log), "--save", str(saved), *SMALL,
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert "20 updates" in out
    assert "cost of a sample   1.974   1.026" in out
    assert "flights that land  nan   0.75" in out
    options = {"updates": 20, "rate": 0.02, "samples": 288, "seed": 3, "log": log}
    assert told["options"] == options
    first = told["policy"]
    assert isinstance(first, NeuralPolicy)
    assert eqx.tree_equal(jaxglide.open(saved).policy, first)
    code, out, err = run(capsys, "control", "train", "--law", str(saved), "--json")
    assert (code, json.loads(out)["landed"]) == (0, {"first": None, "last": 0.75})
    assert eqx.tree_equal(told["policy"], first)
    law = "--law", str(saved)
    code, _, err = run(capsys, "control", "train", *law, "--learns", "network")
    assert (code, err.count("\n")) == (2, 1)
    assert "holds a NeuralPolicy, which goes on" in err
    code, _, err = run(capsys, "control", "train", "--law", "none", *SMALL)
    assert "--learns gains needs the law lqr, not none: it has no gains" in err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["fly", "--law", "pid"], "--law 'pid' is not one of none, lqr"),
        (
            ["fly", "--law", "{keep}", "--price", "2"],
            "--price does not apply: it designs lqr, and what flies is .*law.nc",
        ),
        (["fly", "--law", "{keep}", "--nodes", "50"], "--nodes does not apply: .*law.nc decid"),
        (["fly", "--law", "{save}"], "fit.nc holds no controller but a Dataset"),
        (["fly", "--vary", "speed=2"], "--vary 'speed=2' is not NAME=LOW:HIGH"),
        (["fly", "--vary", "speed=2:1"], "the lowest is above the highest"),
        (["fly", "--vary", "speed=1:2", "--vary", "speed=1:3"], "--vary gives speed twice"),
        (["fly", "--to", "3"], "argument --to: '3' is not RIGHT,FORWARD"),
        (["fly", "--law", "{keep}", "--to", "3,4"], "--to does not apply: it designs lqr"),
        (["fly", "--law", "none", "--towards", "9"], "--towards .* and what flies is none"),
        (["compare", "--law", "none", "--pace", "5"], "--pace does not apply: it designs lqr"),
        (["train", "--law", "none", "--launch-cycles", "2"], "--launch-cycles does not apply"),
        (["fly", "--inputs", "tail"], "inputs = 'tail'"),
        (["fly", "--delay", "0.2"], r"delay = 0\.2 s is not allowed"),
        (["fly", "--angle-noise", "100"], "--angle-noise = 100 deg is not allowed"),
        (["fly", "--pace", "60"], r"--pace = 60 deg is not allowed: .* 57"),
        (["fly", "--price", "0"], "--price = 0 is not allowed"),
        (["fly", "--keep", "law.txt"], r"--keep law\.txt: the name must end in \.nc"),
        (["fly", "--save", "a.nc", "--keep", "a.nc"], "both name a.nc"),
        (["compare", "--plot", "a.png"], "--plot draws over a number of --vary"),
        (["compare", "--over", "speed"], "--over speed: it is not in --vary"),
        (["compare", "--law", "lqr", "--law", "lqr"], "--law gives lqr twice"),
        (["hover"], "invalid choice: 'hover'"),
        ([], "ACTION"),
    ],
)
def test_mistakes_are_told_in_a_sentence(capsys, files, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    named = [word.format(**{name: str(file) for name, file in files.items()}) for word in words]
    code, out, err = run(capsys, "control", *named)
    assert (code, out) == (2, "")
    assert err.startswith("jaxglide: ")
    assert err.count("\n") == 1
    assert re.search(said, err), err


def test_a_file_that_is_not_there_is_told(capsys, tmp_path):
    law = str(tmp_path / "nowhere.nc")
    said = f"jaxglide: there is no {law}\n"
    assert run(capsys, "control", "fly", "--law", law) == (1, "", said)
