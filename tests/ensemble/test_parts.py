"""Parts from plain tables: equal to those made in Python, and what is wrong is named."""

import numpy as np
import pytest
from equinox import tree_equal

import jaxglide as jg
from jaxglide.ensemble.base import published_case
from jaxglide.ensemble.parts import case_of
from jaxglide.flight.case import Case

ROBOT = "position,chord,density,point_mass\n0,0.02,0.05,0\n0.3,0.05,0.1,0.2\n0.9,0.01,0.05,0\n"
POLAR = "angle_of_attack,lift,drag\n-90,0,2\n0,0,0.1\n45,1,1\n90,0,2\n"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "robot.csv").write_text(ROBOT)
    (tmp_path / "polar.csv").write_text(POLAR)
    return tmp_path


def test_no_table_is_the_published_snake():
    assert tree_equal(case_of({}), published_case())
    assert case_of({}).follow == published_case().follow


def test_every_table_makes_its_part(folder):
    case = case_of(
        {
            "body": {"file": "robot.csv", "neck_fraction": 0.05, "nodes": 40, "gyration": 0.25},
            "gait": {"nu_theta": 1.2, "d_psi": 15},
            "polar": {"file": "polar.csv", "lift_scale": 1.1},
            "aerodynamics": {"kind": "lagging", "lag": 5.0},
            "air": {
                "kind": "gust",
                "velocity": [0, 0, 1],
                "gust_length": 3,
                "air_density": 1.2,
            },
            "launch": {"height": 5, "elevation": 10, "omega": [0, 0, 1]},
            "ends": [
                {"kind": "ground", "level": -1},
                {"kind": "angle", "limit": 60, "angles": ["pitch", "roll"]},
                {"kind": "plane", "normal": [0, 1, 0], "offset": 4},
                {"kind": "time", "end_time": 3},
            ],
            "gravity": 9.8,
        },
        folder,
    )
    robot = jg.TabulatedBody.from_csv(
        folder / "robot.csv", neck_fraction=0.05, nodes=40, gyration=0.25
    )
    polar = jg.TabulatedPolar.from_csv(folder / "polar.csv", 1.1)
    glider = jg.Glider(
        robot,
        jg.Gait.from_degrees(nu_theta=1.2, d_psi=15),
        jg.LaggingCirculation(polar, 5.0),
        jg.Gust([0, 0, 1], gust_length=3, air_density=1.2),
        9.8,
    )
    launch = jg.Launch(5, elevation=np.deg2rad(10), omega=[0, 0, 1])
    ends = (
        jg.Ground(-1),
        jg.AngleLimit(np.deg2rad(60), ("pitch", "roll")),
        jg.Plane([0, 1, 0], 4),
        jg.TimeLimit(3),
    )
    assert tree_equal(case, Case(glider, launch, ends, ("gait.theta_m",)), rtol=1e-15)


def test_the_other_kinds():
    made = case_of({"body": {"svl": 0.8, "mass": 0.05, "node_set": "gauss", "nodes": 60},
                    "gait": {"theta_m": 90}, "polar": {"name": "band-limited", "harmonics": 8},
                    "air": {"kind": "turbulence", "intensity": 0.5, "seed": 3}})  # fmt: skip
    assert tree_equal(made.glider.body, jg.Snake(0.8, 0.05, nodes=60, node_set="gauss"))
    assert tree_equal(made.glider.aerodynamics.polar, jg.Polar.band_limited(8))
    assert made.glider.air == jg.Turbulence(0.5, seed=3)
    assert made.follow == ()
    assert made.value("theta_m") == pytest.approx(90)
    wind = case_of({"air": {"kind": "uniform", "velocity": [1, 0, 0]}}).glider.air
    assert tree_equal(wind, jg.UniformWind([1, 0, 0]))
    shear = {"kind": "shear", "velocity": [1, 0, 0], "shear_exponent": 0.2}
    assert tree_equal(
        case_of({"air": shear}).glider.air, jg.ShearWind([1, 0, 0], shear_exponent=0.2)
    )
    assert case_of({"ends": []}).ends == ()


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"wind": {}}, "there is no entry 'wind': known are body, gait"),
        ({"air": 3}, "air = 3 is not a table"),
        ({"air": {"kind": "storm"}}, "air.kind = 'storm' is not one of still, uniform"),
        ({"air": {"kind": ["still"]}}, r"air.kind = \['still'\] is not a text"),
        ({"air": {"velocity": [1, 0, 0]}}, "there is no entry 'velocity' in air: known are"),
        ({"air": {"kind": "uniform"}}, "air of kind 'uniform' lacks velocity"),
        ({"air": {"kind": "uniform", "velocity": [1, 2]}}, r"velocity has shape \(2,\)"),
        ({"air": {"kind": "uniform", "velocity": [1, "x", 0]}}, "air.velocity = .* is not a"),
        (
            {"air": {"kind": "uniform", "velocity": [1, 200, 0]}},
            "air.velocity = 200 m/s is not",
        ),
        ({"air": {"kind": "turbulence", "intensity": 1, "seed": 1.5}}, "air.seed = 1.5 is not"),
        ({"body": {"svl": -1}}, "body.svl = -1 m is not allowed"),
        ({"body": {"svl": 1, "length": 1}}, "body gives length twice"),
        ({"body": {"spacing": 1}}, "there is no entry 'spacing' in body"),
        ({"body": {"file": "robot.csv", "svl": 1}}, "body.svl does not apply: robot.csv"),
        ({"body": {"file": 3}}, "body.file = 3 is not a text"),
        ({"gait": {"psi_m": 200}}, "gait.psi_m = 200 deg is not allowed"),
        ({"polar": {"name": "flat"}}, "polar.name = 'flat' is not one of published"),
        ({"polar": {"cells": [1]}}, "there is no entry 'cells' in polar"),
        ({"polar": {"harmonics": 3}}, "polar.harmonics does not apply"),
        ({"polar": {"file": "polar.csv", "name": "smooth"}}, "polar.name does not apply"),
        ({"aerodynamics": {"lag": 3}}, "there is no entry 'lag' in aerodynamics"),
        ({"launch": {"height": [1, 2]}}, r"height has shape \(2,\)"),
        ({"launch": {"height": True}}, "launch.height = True is not a number"),
        ({"ends": 3}, "ends = 3 is not a list of tables"),
        ({"ends": [{"level": 0}]}, r"ends\[0\] lacks kind: ground, angle"),
        ({"ends": [{"kind": "angle", "limit": -1}]}, r"ends\[0\].limit = -1 deg is not"),
        (
            {"ends": [{"kind": "angle", "angles": "roll"}]},
            r"ends\[0\].angles = 'roll' is not a",
        ),
        ({"ends": [{"kind": "angle", "angles": ["nod"]}]}, "it must name yaw, pitch or roll"),
        ({"gravity": "x"}, "gravity = 'x' is not a number"),
    ],
)
def test_what_is_wrong_is_named(folder, tables, said):
    with pytest.raises((ValueError, TypeError), match=said) as caught:
        case_of(tables, folder)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(folder):
    with pytest.raises(OSError, match=r"none\.csv"):
        case_of({"body": {"file": "none.csv"}}, folder)
