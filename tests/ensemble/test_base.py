"""Studies over a base case: a user's own parts, any float by its path, and stores of them."""

import json

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from jaxglide import (
    AngleLimit,
    Case,
    Gait,
    Glider,
    Ground,
    Launch,
    Polar,
    Problem,
    Snake,
    TabulatedBody,
    TimeLimit,
    UniformWind,
    landing_distance,
    simulate,
)
from jaxglide.ensemble import sweep as module
from jaxglide.ensemble.base import published_case
from jaxglide.ensemble.layout import layout
from jaxglide.ensemble.plan import Plan
from jaxglide.ensemble.store import StoreError
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.survey import survey
from jaxglide.ensemble.sweep import sweep
from jaxglide.files.saved import open_dataset

traces = []


class Draught(UniformWind):
    """A wind from outside, with a float that it does not describe."""

    strength: float = 1.0

    def wind(self, position, time):
        traces.append(time)
        return self.strength * super().wind(position, time)


class Breeze(UniformWind):
    """Named otherwise in its package alone: what it computes differs."""

    strength: float = 1.0

    def wind(self, position, time):
        return 2 * self.strength * super().wind(position, time)


Breeze.__name__ = Breeze.__qualname__ = "Draught"

ROBOT = TabulatedBody(
    [0.0, 0.3, 0.7], [0.03, 0.04, 0.01], [0.05, 0.06, 0.03], [0.2, 0.5], [0.01, 0.02], nodes=12
)
VARIED = {
    "point_mass[0]": [0.01, 0.03],
    "air.velocity[0]": [0.0, 2.0],
    "strength": [1.0, 0.5],
}
OPTIONS = {"rtol": 1e-5, "atol": 1e-5}


def case_with(air=Draught, ends=None, **launch):
    glider = Glider(ROBOT, Gait.from_degrees(), Polar.smooth(), air([0.0, 1.0, 0.0]))
    ends = (Ground(), AngleLimit(), TimeLimit(0.15)) if ends is None else ends
    return Case(glider, Launch(**{"height": 0.2, **launch}), ends)


@pytest.fixture(scope="module")
def study():
    return Study(cases=VARIED, case=case_with(), times=[0.05], **OPTIONS)


@pytest.fixture(scope="module")
def flown(study):
    return sweep(study, progress=False)


def test_any_float_of_any_part_is_varied(study, flown):
    """A point mass, a component of the wind and a float that its part does not describe."""
    assert list(study.varied) == ["point_mass[0]", "velocity[0]", "strength"]
    case = study.base.replace({name: values[1] for name, values in study.varied.items()})
    assert np.array_equal(case.glider.body.point_mass, [0.03, 0.02])
    assert np.array_equal(case.glider.air.velocity, [2.0, 1.0, 0.0])
    glide = simulate(case.glider, case.launch, ends=case.ends, **OPTIONS)
    one = flown.isel(case=1)
    np.testing.assert_allclose(one.landing_point, glide.landing_point, atol=1e-9)
    np.testing.assert_allclose(one.end_angles, np.rad2deg(glide.end_angles), atol=1e-7)
    assert one.outcome == glide.outcome
    other = flown.isel(case=0)
    assert abs(float(other.landing_point[0] - one.landing_point[0])) > 1e-4


def test_what_it_says_of_itself(flown):
    assert flown["velocity[0]"].attrs["units"] == "m/s"
    assert flown["point_mass[0]"].attrs == {"units": "kg", "long_name": "point masses"}
    assert (flown.outcome == 7).all()
    words = flown.outcome.attrs["flag_meanings"].split()
    assert words[7] == "reached_its_time"
    assert len(words) == len(flown.outcome.attrs["flag_values"]) == 8


def test_another_base_of_the_same_structure_compiles_nothing(study, flown):
    """Other values of all that is fixed, of the base, the tolerances, times and limits."""
    traced = len(traces)
    assert traced
    glider = Glider(
        eqx.tree_at(
            lambda body: (body.chord, body.point_mass),
            ROBOT,
            (1.1 * ROBOT.chord, jnp.array([0.0, 0.1])),
        ),
        Gait.from_degrees(nu_theta=1.1, f_theta=1.0),
        Polar.smooth(1.36, 0.6),
        Draught([0.0, 0.5, 0.1], strength=2.0, air_density=1.1),
        9.0,
    )
    ends = Ground(-0.1), AngleLimit(1.0), TimeLimit(0.1)
    case = Case(glider, Launch(0.15, elevation=0.1), ends)
    other = Study(
        cases=VARIED, case=case, fixed={"height": 0.1, "psi_m": 10.0}, times=[0.02],
        rtol=2e-5, atol=3e-5, max_time=5.0,
    )  # fmt: skip
    assert not sweep(other, progress=False).time.equals(flown.time)
    assert len(traces) == traced


def in_parts(solve):
    """Stands in for `flown`: as many at a time as `width` says."""

    def flown(study, index, width):
        for first in range(0, len(index), width):
            places = np.arange(first, min(first + width, len(index)))
            yield places, solve(study, index[places], width)

    return flown


def numbered(study, index, width):
    """Stands in for `solve`: the number of every case as its time, at once."""
    flown = {n: a.blank(len(index)) for n, a in layout(study, "float64").items()}
    return {n: np.zeros_like(v) for n, v in flown.items()} | {"time": 1.0 * index}


def test_a_store_of_own_parts_is_resumed_by_them_alone(study, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    folder = tmp_path / "s.zarr"
    kept = sweep(study, folder, progress=False)
    monkeypatch.setattr(module, "flown", None)
    same = Study(cases=VARIED, case=case_with(), times=[0.05], **OPTIONS)
    xr.testing.assert_identical(sweep(same, folder, progress=False), kept)
    for case in (case_with(Breeze), case_with(height=0.3), case_with(ends=Ground())):
        other = Study(cases=VARIED, case=case, times=[0.05], **OPTIONS)
        with pytest.raises(StoreError, match="holds another study"):
            sweep(other, folder, progress=False)


def test_a_store_of_own_parts_is_opened_without_them(study, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    kept = sweep(study, tmp_path / "s.zarr", progress=False)
    back = open_dataset(tmp_path / "s.zarr")
    xr.testing.assert_identical(back.drop_attrs(), kept.drop_attrs())
    assert back["velocity[0]"].attrs == kept["velocity[0]"].attrs
    assert back.outcome.attrs["flag_meanings"] == kept.outcome.attrs["flag_meanings"]
    assert back.attrs["study"] == study.to_json()


def test_the_text_of_a_study_with_own_parts_needs_its_case(study):
    text = study.to_json()
    with pytest.raises(ValueError, match=r"Draught is a part of the user's own.*: give"):
        Study.from_json(text)
    assert Study.from_json(text, case_with()) == study
    assert Study.from_json(text, case_with()).to_json() == text
    with pytest.raises(ValueError, match="flies another case than this one"):
        Study.from_json(text, case_with(Breeze))
    assert Plan.from_json(text).to_json() == text


def test_the_text_of_a_study_with_the_packages_parts_is_whole():
    glider = Glider(ROBOT, Gait.from_degrees(), air=UniformWind([1.0, 0.0, 0.0]))
    study = Study({"velocity[2]": [0.0, 1 / 3]}, glider=glider, launch=Launch(3.0))
    again = Study.from_json(study.to_json())
    assert again.to_json() == study.to_json()
    assert float(again.base.launch.height) == 3.0
    assert np.array_equal(again.base.glider.air.velocity, [1.0, 0.0, 0.0])
    assert not again.own
    # what the published snake's own study says stays brief
    assert "base" not in json.loads(Study({"svl": [0.7]}).to_json())


def test_fixed_values_do_not_follow_any_more():
    base = Study({"nu_theta": [1.0]}, fixed={"theta_m": 90.0, "svl": 0.8}).base
    assert base.follow == ("body.mass",)
    flown = base.replace({"nu_theta": 1.0})
    assert float(flown.value("theta_m")) == pytest.approx(90.0, rel=1e-14)
    alone = Study({"nu_theta": [1.0]}, glider=published_case().glider)
    assert alone.base.follow == ()
    mine = Study({"nu_theta": [1.0]}, launch=Launch(5.0), setup={"nodes": 20})
    assert mine.base.follow == published_case().follow
    assert mine.base.glider.body.nodes == 20


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"case": 3}, "case must be of type Case, not int"),
        ({"glider": 3}, "glider must be of type Glider, not int"),
        ({"case": published_case(), "launch": Launch()}, "give a case or launch, not both"),
        ({"case": published_case(), "setup": {"nodes": 9}}, "give a case or setup, not both"),
        ({"glider": published_case().glider, "setup": {"nodes": 9}}, "setup is of the publ"),
        ({"grid": {"body.length": [0.7], "svl": [0.8]}}, "svl is named twice: it means body"),
        (
            {"grid": {"chord": [0.7]}},
            r"chord is not one number but of shape \(3,\)",
        ),
        ({"grid": {"chord[3]": [0.7]}}, r"there is no 'chord\[3\]': body.chord has shape"),
        ({"grid": {"angles": [0.7]}}, r"angles has shape \(\): it must be \(3,\)"),
        ({"grid": {"limit": [0.0]}}, "limit = 0 deg is not allowed"),
    ],
)
def test_wrong_bases(arguments, said):
    with pytest.raises((TypeError, ValueError), match=said) as caught:
        Study(**{"grid": {"height": [1.0]}, **arguments})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"fixed": {"limit": 60.0}}, "limit has no effect on a survey"),
        ({"fixed": {"phi_theta": 1.0}}, "phi_theta has no effect on a survey"),
        ({"ends": Ground()}, "ends have no effect on a survey"),
    ],
)
def test_what_a_held_glide_has_no_use_for(arguments, said):
    with pytest.raises(ValueError, match=said):
        survey(Study({"svl": [0.7]}, **arguments))


TOML = """
gravity = 9.0
[grid]
"air.velocity[0]" = [0, 1]
nu_theta = { start = 1, stop = 1.5, count = 3 }
[fixed]
"body.point_mass[0]" = 0.02
[body]
file = "robot.csv"
nodes = 20
[air]
kind = "uniform"
velocity = [0, 1, 0]
[[ends]]
kind = "ground"
"""


def test_a_study_file_makes_its_parts(tmp_path):
    (tmp_path / "robot.csv").write_text(
        "position,chord,density,point_mass\n0,.03,.05,0\n.3,.04,.06,.01\n.7,.01,.03,0\n"
    )
    (tmp_path / "study.toml").write_text(TOML)
    study = Study.from_file(tmp_path / "study.toml")
    assert study.shape == (2, 3)
    assert study.base.glider.body.point_mass.tolist() == [0.02]
    assert study.base.ends == (Ground(),)
    assert float(study.base.glider.gravity) == 9.0
    (tmp_path / "study.toml").write_text(TOML + "[setup]\nnodes = 20\n")
    with pytest.raises(ValueError, match=r"study.toml: \[setup\] is of the published snake"):
        Study.from_file(tmp_path / "study.toml")
    (tmp_path / "study.toml").write_text(TOML.replace("[0, 1, 0]", "[0, 1]"))
    with pytest.raises(ValueError, match=r"study.toml: velocity has shape \(2,\)"):
        Study.from_file(tmp_path / "study.toml")


def test_own_states_are_kept(monkeypatch):
    from jaxglide import LaggingCirculation

    body = Snake.from_svl(nodes=8)
    glider = Glider(body, Gait.from_degrees(), LaggingCirculation(Polar.smooth()))
    study = Study({"lag": [5.0, 7.0]}, glider=glider, times=[0.0, 0.1], launch=Launch(0.3))
    assert study.state_size == 13 + 8
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    data = sweep(study, progress=False)
    assert data.own_states.dims == ("lag", "sample", "own_state")
    assert data.own_states.shape == (2, 2, 8)
    assert data.lag.attrs["units"] == "1"


def test_a_part_of_a_study_flies_the_same_base(study):
    for one in (study, Study({"nu_theta": [1.0, 1.1, 1.2]}, setup={"nodes": 20})):
        some = one.part(np.array([1]))
        name, values = next(iter(one.varied.items()))
        assert some.columns(np.array([0]))[name].tolist() == [values[1]]
        assert eqx.tree_equal(some.base, one.base)
        assert some.times == one.times


@pytest.mark.parametrize(
    "ask",
    [
        lambda: Study({"height": [2.0, 0.5], "nu_theta": [1.3]}, ends=Ground(1.0)),
        lambda: Study({"ends[0].level": [0.0, 3.0]}, fixed={"height": 2.0}),
        lambda: Study(cases={"height": [3.0, 1.0], "level": [2.0, 1.0]}),
        lambda: Problem(landing_distance, {"height": (1.0, 5.0)}, fixed={"level": 1.5}),
    ],
)
def test_a_launch_below_the_ground_is_no_case(ask):
    """It would count as landed, after no time at all."""
    with pytest.raises(ValueError, match=r"^height = \S+ m is not .* above the ground at \d"):
        ask()
    Study(cases={"height": [3.0, 1.0], "level": [2.0, 0.5]})
