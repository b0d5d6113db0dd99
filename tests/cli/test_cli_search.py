"""`optimise` and `gradient` on the command line, over closed forms: nothing is flown."""

import inspect
import json
import re

import numpy as np
import pytest

from command import run
from jaxglide.cli.gradient import _stencil
from jaxglide.ensemble.base import published_case
from jaxglide.search.optimum import optimise
from jaxglide.search.problem import Evaluation

FEW = (
    "--free",
    "d_psi,psi_m",
    "--starts",
    "2",
    "--screen",
    "4",
    "--steps",
    "2",
    "--polish",
    "1",
)


@pytest.fixture
def flown(monkeypatch):
    """Replaces what evaluates: `flown(function)` takes values (S, 1 + m) of points (S, n),
    and gives the list of points asked for."""

    def put(function):
        asked = []

        class Made:
            def __init__(self, problem, gradients=True):
                self.problem = problem

            def fingerprint(self):
                return "made"

            def __call__(self, points, rtol=None, atol=None):
                asked.extend(points)
                values, h = function(points), 1e-6
                near = (function(points + h * e) for e in np.eye(points.shape[1]))
                slopes = np.stack([(v - values) / h for v in near], axis=-1)
                return Evaluation(values, slopes)

        monkeypatch.setattr("jaxglide.search.evaluator.Evaluator", Made)
        monkeypatch.setattr("jaxglide.search.optimum.Evaluator", Made)
        return asked

    return put


def interrupted(points):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (interrupted, "jaxglide: interrupted before anything was found\n"),
        (
            lambda points: np.full((len(points), 3), np.nan),
            "jaxglide: ran all 2 steps; no start met a finite value: there is nothing to "
            "write\n",
        ),
    ],
)
def test_where_nothing_was_found_nothing_is_written(capsys, tmp_path, flown, function, said):
    save, plot = tmp_path / "o.nc", tmp_path / "o.png"
    save.write_text("what was here")
    flown(function)
    code, out, err = run(
        capsys, "optimise", *FEW, "--save", str(save), "--plot", str(plot), "--json"
    )
    assert (code, err) == (1, said)
    assert save.read_text() == "what was here"
    assert not plot.exists()
    if out:
        found = json.loads(out, parse_constant=pytest.fail)
        assert found["value"] is None
        assert found["best"] == {"d_psi": None, "psi_m": None}
        assert found["status"]["met nothing but values that are not finite"] == 2


def test_where_the_constraints_are_not_met_the_search_is_drawn(capsys, tmp_path, flown):
    flown(lambda points: np.stack([points[:, 0], 0 * points[:, 0], -1 - points[:, 1]], axis=1))
    code, out, err = run(capsys, "optimise", *FEW, "--plot", str(tmp_path / "o.png"))
    assert code == 1
    assert "no start met the constraints" in out
    assert err == "jaxglide: no picture of the best glide: there is none\n"
    assert {path.name for path in tmp_path.iterdir()} == {"o.png", "o_paths.png"}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--free", "theta_m,theta_m"), "--free gives theta_m twice"),
        (("--fix", "height=1", "--fix", "height=2"), "--fix gives height twice"),
        (("--bounds", "d_psi=0:1", "--bounds", "d_psi=0:2"), "--bounds gives d_psi twice"),
        (("--guess", "d_psi=1,d_psi=2"), "--guess gives d_psi twice"),
        (("--guess", "theta_m"), "--guess 'theta_m' is not NAME=VALUE"),
        (("--starts", "8", "--screen", "8"), "screen = 8 is not allowed"),
        (("--seed", "-1"), "seed = -1 is not allowed"),
        (("--log", "nowhere/o.jsonl"), "cannot write nowhere/o.jsonl: there is no folder"),
        (("--log", "."), "cannot write ."),
        (("--log", "o.nc", "--save", "o.nc"), "--save and --log both name o.nc"),
        (("--log", "o_paths.png", "--plot", "o.png"), "--log and --plot both name o_paths.png"),
        (("--plot", "nowhere/o.png"), "cannot write nowhere/o.png: there is no folder"),
    ],
)
def test_optimise_names_what_does_not_fit(capsys, flown, options, message):
    asked = flown(interrupted)
    code, out, err = run(capsys, "optimise", *options)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert message in err
    assert not asked


def test_the_help_names_the_defaults_of_optimise(capsys):
    with pytest.raises(SystemExit):
        run(capsys, "optimise", "--help")
    text = " ".join(capsys.readouterr().out.split())
    for name in ("starts", "steps", "polish", "seed"):
        default = inspect.signature(optimise).parameters[name].default
        assert re.search(rf"--{name} N [^(]*\([^)]*default: {default}\)", text), name


def test_a_torn_log_goes_on_and_a_damaged_one_is_named(capsys, tmp_path, flown):
    log = tmp_path / "o.jsonl"
    options = ("optimise", *FEW, "--log", str(log))

    def unmet(points):
        return np.stack([points[:, 0], 0 * points[:, 0], -1 - points[:, 1]], axis=1)

    def cut(points):
        if len(asked) > 6:  # in the second step
            raise KeyboardInterrupt
        return unmet(points)

    asked = flown(cut)
    code, out, _ = run(capsys, *options)
    assert code == 1
    assert "interrupted after 1 steps" in out
    assert log.read_text().count("\n") == 3
    with log.open("a") as file:
        file.write('{"number":3,"star')
    asked = flown(unmet)
    code, out, _ = run(capsys, *options)
    assert "ran all 2 steps" in out
    assert len(asked) == 2
    kept = log.read_text()
    log.write_text(kept.replace('"starts":[0,1]', '"starts":[1,0]', 1))
    flown(interrupted)
    code, out, err = run(capsys, *options)
    assert (code, out) == (2, "")
    assert re.fullmatch(r"jaxglide: \S*o.jsonl is damaged: line 3 is not .*\n", err)


def test_a_disk_that_fills_is_one_sentence_and_the_search_goes_on(
    capsys, tmp_path, flown, disk_of
):
    log = tmp_path / "o.jsonl"
    options = ("optimise", *FEW, "--log", str(log), "--json")

    def unmet(points):
        return np.stack([points[:, 0], 0 * points[:, 0], -1 - points[:, 1]], axis=1)

    asked = flown(unmet)
    with disk_of(100):
        code, out, err = run(capsys, *options)
    assert (code, out, err) == (1, "", f"jaxglide: cannot write {log}: File too large\n")
    assert not log.exists()
    assert not asked
    run(capsys, *options)
    whole = log.read_bytes()
    head, screened, first, _ = whole.splitlines(keepends=True)
    log.unlink()
    with disk_of(len(head + screened + first) - 5):
        code, out, err = run(capsys, *options)
    assert (code, out, err) == (1, "", f"jaxglide: cannot write {log}: File too large\n")
    run(capsys, *options)
    assert log.read_bytes() == whole


@pytest.mark.parametrize(
    ("name", "value", "inside"),
    [
        ("f_theta", 0.0, "low"),
        ("psi_m", 180.0, "high"),
        ("d_psi", -180.0, "low"),
        ("kinematic_viscosity", 1e-9, "low"),
        ("kinematic_viscosity", 1.568e-5, None),
        ("nu_theta", 1.4, None),
        ("gravity", 1e-6, "low"),
    ],
)
def test_differences_stay_in_the_range_of_the_parameter(name, value, inside):
    p = published_case().parameter(name)
    step, places, weights = _stencil(p, value)
    at = value + step * np.array(places)
    assert ((at > p.low) if p.low_open else (at >= p.low)).all()
    assert (at <= p.high).all()
    assert (inside is None) == (0 not in places)
    assert sum(weights) == pytest.approx(0, abs=1e-12)
    for power in (1, 2, 3, 4):  # exact for polynomials up to the fourth degree
        slope = np.dot(weights, (np.array(places) * 1.0) ** power)
        assert slope == pytest.approx(float(power == 1), abs=1e-12)


def test_gradients_at_a_bound_are_checked_on_one_side(capsys, flown):
    flown(lambda points: np.sin(1 + points[:, :1]) + points[:, 1:] ** 2)
    options = ("--free", "f_theta,d_psi", "--fix", "f_theta=0", "--fix", "d_psi=3", "--json")
    code, out, err = run(capsys, "gradient", *options)
    assert (code, err) == (0, "")
    rows = json.loads(out)["gradient"]
    assert rows["f_theta"]["difference"] == pytest.approx(np.cos(1), rel=1e-9)
    assert rows["d_psi"]["difference"] == pytest.approx(6, rel=1e-9)
    assert rows["d_psi"]["gradient"] == pytest.approx(6, rel=1e-5)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda x: x * np.nan, "jaxglide: landing_distance is not a number there\n"),
        (
            lambda x: np.where(x == 10, 1.0, np.nan),
            "jaxglide: the gradient by d_psi is not a number there\n",
        ),
    ],
)
def test_a_gradient_that_is_none_is_said(capsys, flown, function, said):
    flown(function)
    code, out, err = run(capsys, "gradient", "--free", "d_psi", "--json")
    assert (code, err) == (1, said)
    assert json.loads(out, parse_constant=pytest.fail)["gradient"]["d_psi"]["gradient"] is None
    code, out, err = run(capsys, "gradient", "--free", "d_psi")
    assert (code, err) == (1, said)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--free", "d_psi,d_psi"), "--free gives d_psi twice"),
        (("--free", "speed"), "speed follows from other parameters"),
        (("--free", "bend"), "there is no parameter 'bend'"),
        (("--free", ""), "there is no parameter ''"),
        (("--free", "d_psi", "--fix", "d_psi=200"), "d_psi = 200 deg/SVL is not allowed"),
        (("--fix", "bend=1"), "there is no parameter 'bend'"),
    ],
)
def test_gradient_names_what_is_wrong(capsys, flown, options, message):
    asked = flown(interrupted)
    code, out, err = run(capsys, "gradient", *options)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert message in err
    assert not asked
