"""`jaxglide steady`: what it prints, writes and refuses."""

import dataclasses
import json
import re

import numpy as np
import pytest
from made_steady import made_branch, made_steady

import jaxglide as jg
from command import run


@pytest.fixture
def asked(monkeypatch):
    """What the command asks the library for, and what that gives back."""
    told = {"branch": made_branch(), "one": made_steady()}
    told["all"] = told["one"], made_steady(0.5, 1.4)

    def one(glider, **options):
        told.update(glider=glider, options=options)
        return told["one"]

    def every(glider, **options):
        told.update(glider=glider, options=options)
        return told["all"]

    def branch(glider, *place, **options):
        told.update(glider=glider, place=place, options=options)
        return told["branch"]

    monkeypatch.setattr("jaxglide.steady.steady_branch", branch)
    monkeypatch.setattr("jaxglide.steady.steady_glide", one)
    monkeypatch.setattr("jaxglide.steady.steady_glides", every)
    return told


def test_options_reach_the_library(capsys, asked):
    code, out, err = run(
        capsys, "steady", "--nu-theta", "1.2", "--d-psi", "5", "--svl", "0.8", "--drag-scale",
        "0.9", "--wind", "1,2,0", "--starts", "9", "--step", "0.002",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert out == f"{asked['one']}\n"
    glider = asked["glider"]
    assert float(glider.gait.nu_theta) == 1.2
    assert float(glider.body.length) == 0.8
    assert np.array_equal(glider.air.velocity, [1, 2, 0])
    assert asked["options"] == {"starts": 9, "step": 0.002}
    kind, nodes = type(glider.aerodynamics.polar), glider.body.nodes
    assert (kind, nodes, glider.body.node_set) == (jg.Polar, 60, "gauss")
    smooth = jg.Polar.smooth(drag_scale=0.9)
    np.testing.assert_array_equal(glider.aerodynamics.polar.cells, smooth.cells)
    run(capsys, "steady", "--nodes", "20", "--polar", "published")
    assert asked["options"] == {}
    assert asked["glider"].body.nodes == 20


@pytest.mark.parametrize("every", [False, True])
def test_files_and_figures(capsys, asked, tmp_path, every):
    save, plot = tmp_path / "s.nc", tmp_path / "s.png"
    words = ["steady", "--save", str(save), "--plot", str(plot), *(["--all"] if every else [])]
    code, out, err = run(capsys, *words)
    assert (code, err) == (0, "")
    for name in ("s.nc", "s.png", "s_spectrum.png"):
        assert f"wrote {tmp_path / name}\n" in out
        assert (tmp_path / name).stat().st_size > 5_000
    again = jg.open(save)
    assert len(again) == 2 if every else isinstance(again, jg.SteadyGlide)
    assert out.count("Steady glide, 26.57 deg below") == 1 + every
    code, out, err = run(capsys, "plot", str(save), "--out", str(tmp_path / "again.png"))
    assert (code, err) == (0, "")
    assert "drew two cycles of the steady glide" in out


def test_json_is_one_object(capsys, asked):
    code, out, err = run(capsys, "steady", "--json")
    assert (code, err) == (0, "")
    found, glide = json.loads(out), asked["one"]
    assert (found["found"], found["stable"], found["turn_radius"]) == (True, True, "straight")
    assert found["glide_angle_deg"] == pytest.approx(np.rad2deg(float(glide.glide_angle)))
    assert found["sink_rate"] == 4.0
    assert found["state"]["v_up"] == -4.0
    wanted = np.asarray(glide.multipliers)
    np.testing.assert_array_equal(np.array(found["multipliers"]) @ [1, 1j], wanted)
    assert len(found["modes"]) == len(glide.modes)
    code, out, _ = run(capsys, "steady", "--all", "--json")
    every = json.loads(out)["glides"]
    assert [one["stable"] for one in every] == [True, False]
    assert every[1]["turn_radius"] == pytest.approx(16.0)


def test_a_branch_is_followed_drawn_and_kept(capsys, asked, tmp_path):
    save, plot = tmp_path / "b.nc", tmp_path / "b.png"
    words = ("steady", "--continue", "f_theta=0:3.5", "--d-psi", "4", "--step", "0.002")
    code, out, err = run(capsys, *words, "--save", str(save), "--plot", str(plot))
    assert (code, err) == (0, "")
    assert asked["place"] == ("f_theta", 0.0, 3.5)
    assert asked["options"] == {"step": 0.002}
    assert np.rad2deg(float(asked["glider"].gait.d_psi)) == pytest.approx(4)
    assert str(asked["branch"]) in out
    assert plot.stat().st_size > 5_000
    kept = jg.open(save)
    np.testing.assert_array_equal(kept["parameter"], asked["branch"].parameter)
    code, out, err = run(capsys, *words, "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["spectral_radius"] == asked["branch"].spectral_radius.tolist()
    assert found["kind"].count("fold") == 1
    asked["branch"] = dataclasses.replace(made_branch(), found=False)
    code, out, err = run(capsys, *words, "--save", str(tmp_path / "none.nc"))
    assert (code, err) == (1, "jaxglide: no steady glide was found: no file was written\n")
    assert out.startswith("No branch in f_theta")
    assert not (tmp_path / "none.nc").exists()


@pytest.mark.parametrize("every", [False, True])
def test_none_found_exits_with_1_and_writes_nothing(capsys, asked, tmp_path, every):
    asked.update({"one": made_steady(found=False), "all": ()})
    more = ["--all"] if every else []
    code, out, err = run(capsys, "steady", "--save", str(tmp_path / "s.nc"), *more)
    assert code == 1
    assert err == "jaxglide: no steady glide was found: no file was written\n"
    assert ("the search came to no end" in out) is not every
    assert not list(tmp_path.iterdir())
    code, out, err = run(capsys, "steady", "--json", *more)
    assert code == 1
    found = json.loads(out)
    assert found == {"glides": []} if every else found["found"] is False
    assert err == "jaxglide: no steady glide was found\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--starts=-1"], "--starts = -1 is not allowed: it must be in [0, 4096]"),
        (["--step=0"], "--step = 0 s is not allowed"),
        (["--step=0.06"], "must be finite and in [1e-05, 0.05] s"),
        (["--cycles=0", "--plot=a.png"], "--cycles = 0 is not allowed"),
        (["--cycles=3"], "--cycles does not apply: nothing is drawn without --plot or --view"),
        (["--height=10"], "unrecognized arguments: --height=10"),
        (["--gust=1,0,0"], "unrecognized arguments: --gust=1,0,0"),
        (["--lag=1"], "unrecognized arguments: --lag=1"),
        (["--theta-m=181"], "--theta-m = 181 deg is not allowed"),
        (["--view=a.gif"], "--view a.gif: the name must end in .html"),
        (["--view=no/a.html"], "cannot write no/a.html: there is no folder no"),
        (["--plot=a.txt"], "--plot a.txt: the name must end in .png or .pdf or .svg"),
        (["--svl=0.8", "--body=none.csv"], "none.csv"),
        (["--continue=f_theta"], "--continue 'f_theta' is not NAME=LOW:HIGH"),
        (["--continue=f_theta=1:2:3"], "is not NAME=LOW:HIGH"),
        (["--continue=f_theta=a:b"], "is not NAME=LOW:HIGH"),
        (["--continue=f_theta=0:3", "--all"], "--all does not apply: --continue follows one"),
        (["--continue=f_theta=0:3", "--starts=3"], "--starts does not apply"),
        (["--continue=f_theta=0:3", "--view=a.html"], "--view does not apply"),
    ],
)
def test_mistakes_are_named_before_the_work(capsys, asked, arguments, message):
    code, out, err = run(capsys, "steady", *arguments)
    assert (code, out) in ((2, ""), (1, ""))
    assert message in err
    assert err.count("\n") == 1
    assert "glider" not in asked


def test_the_library_has_the_same_defaults():
    import inspect

    from jaxglide import cli
    from jaxglide.cli.steady import _STARTS, _STEP

    defaults = inspect.signature(jg.steady_glide).parameters
    parser = cli._parser(["steady"]).commands.choices["steady"]
    told = {action.dest: action.help for action in parser._actions}
    every = inspect.signature(jg.steady_glides).parameters["starts"].default
    assert f"default: {defaults['starts'].default}, with --all {every})" in told["starts"]
    assert f"default: 1/{1 / defaults['step'].default:.0f})" in told["step"]
    glider = made_steady().glider
    for name, known in (("starts", _STARTS), ("step", _STEP)):
        for value in (known.low, known.high):
            outside = value + (1 if name == "starts" else 1e-3) * (
                1 if value == known.high else -1
            )
            with pytest.raises(ValueError, match=f"{name} = "):
                jg.steady_glide(glider, **{name: outside})


@pytest.mark.slow
def test_the_gait_that_glides_far_from_end_to_end(capsys, tmp_path):
    """Solved, flown and seen; in a wind, which carries the view along."""
    view = tmp_path / "s.html"
    gait = ("--theta-m=60", "--psi-m=0", "--nu-theta=1.738", "--f-theta=1.3", "--d-psi=5.5")
    code, out, err = run(capsys, "steady", *gait, "--wind=0,3,1", "--view", str(view))
    assert (code, err) == (0, "")
    angle = re.search(r"Steady glide, (\d+\.\d+) deg below", out)
    assert float(angle[1]) == pytest.approx(22.95, abs=0.1)
    assert "spiral" in out
    assert view.stat().st_size > 500_000
    assert r'"label": "22.9\u00b0 down"' in view.read_text()
