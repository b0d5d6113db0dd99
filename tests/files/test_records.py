"""What a saved glide says: units that other software reads, and the glide back from it."""

import json
import re

import jax
import numpy as np
import pint
import pytest

from jaxglide import Gait, Glider, Launch, Polar, Snake, simulate
from jaxglide._lib.netcdf import load_netcdf
from jaxglide._lib.units import in_file
from jaxglide._lib.writing import write_netcdf
from jaxglide.ensemble.base import published_case
from jaxglide.ensemble.records import _STATES, _VARIABLES
from jaxglide.files.glides import glide_dataset
from jaxglide.files.restore import flight_of
from jaxglide.measured.table import NUMBERS
from jaxglide.search.objectives import OBJECTIVES

# Names of units that UDUNITS-2 has; `deg` and SVL are none.
UDUNITS = {"m", "s", "kg", "N", "W", "mm", "Pa", "Hz", "degree", "rad", "1"}


@pytest.fixture(scope="module")
def glide():
    gait = Gait.from_degrees(d_theta=3.0)
    launch = Launch(0.4, 1.75, phi_theta=0.3, angles=np.deg2rad([0.0, -5.0, -5.0]))
    snake = Snake.from_svl(0.7, nodes=20)
    return simulate(Glider(snake, gait, Polar.smooth(1.1)), launch, dense=True)


@pytest.fixture(scope="module")
def path(glide, tmp_path_factory):
    path = tmp_path_factory.mktemp("records") / "glide.nc"
    write_netcdf(path, glide_dataset(glide, frames=11))
    return path


@pytest.fixture
def data(path):
    return load_netcdf(path)


def readable(unit):
    """Whether both UDUNITS and pint read a unit, and as the same."""
    pint.get_application_registry().parse_units(unit)
    return set(re.findall(r"[^\W\d]+|1", re.sub(r"\^\d", "", unit))) <= UDUNITS


def test_every_number_of_a_glide_has_a_unit_that_others_read(data):
    for name, variable in data.variables.items():
        if variable.dtype.kind == "f":
            assert readable(variable.attrs["units"]), name
            assert variable.attrs["long_name"], name
    # what is left in attributes has no unit
    numbers = {n for n, v in data.attrs.items() if not isinstance(v, str)}
    assert numbers == {"outcome_code", "accepted", "rejected", "rtol", "atol"}


def test_every_unit_of_this_package_is_one_that_others_read():
    units = [p.unit for p in published_case().parameters.values()]
    units += [row[2] for row in _STATES.values()] + [row[1] for row in _VARIABLES.values()]
    units += [row[0] for row in NUMBERS.values()] + [o.unit for o in OBJECTIVES.values()]
    assert {"deg", "deg/SVL", "1/SVL", "rad/s"} <= set(units)
    for unit in units:
        assert readable(in_file(unit)), unit
    with pytest.raises(AssertionError):
        assert readable("deg")  # the check sees what is wrong


def test_what_went_in_is_in_the_units_people_read(data):
    for name, value, unit in (
        ("psi_m", 20.0, "degree"),
        ("d_psi", 10.0, "degree"),
        ("d_theta", 3.0, "degree"),
        ("nu_theta", 1.4, ""),
        ("svl", 0.7, "m"),
        ("speed", 1.75, "m/s"),
        ("lift_scale", 1.1, ""),
        ("max_time", 60.0, "s"),
    ):
        assert data[name].item() == pytest.approx(value, rel=1e-12), name
        assert data[name].attrs["units"] == unit, name
        assert name in data.coords
    assert data.d_psi.attrs["long_name"].endswith(", per SVL")
    assert data.launch_angles.values == pytest.approx([0, -5, -5])


def test_nodes_have_a_place_a_chord_and_a_mass(data):
    np.testing.assert_allclose(data.arc_length, 0.7 * (np.arange(20) + 0.5) / 20)
    assert data.node_mass.sum().item() == pytest.approx(data.mass.item())
    assert 0.01 < data.node_chord.min() < data.node_chord.max() < 0.03
    assert data.lift.arc_length.dims == ("node",)


def test_a_glide_comes_back_whole(glide, data):
    again = flight_of(data)
    for part in ("glider", "launch", "take_off", "settings", "max_angles", "outcome", "time"):
        ours, theirs = (jax.tree.leaves(getattr(g, part)) for g in (glide, again))
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, err_msg=part)
    times = data.time.values
    np.testing.assert_allclose(again.at(times), glide.at(times), atol=1e-9)


def test_a_glide_in_other_units_is_the_same(data):
    other = data.copy()
    for name, unit, many in (
        ("time", "ms", 1000.0),
        ("angles", "rad", np.pi / 180),
    ):
        values = (data[name].dims, many * data[name].values, {"units": unit})
        kind = other.assign_coords if name in data.coords else other.assign
        other = kind({name: values})
    ours, theirs = flight_of(data), flight_of(other)
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12)


def changed(data, **parts):
    """With other records, or with changed fields of one."""
    records = json.loads(data.attrs["parts"])
    return data.assign_attrs(
        parts=json.dumps({k: {**records[k], **v} for k, v in parts.items()})
    )


WRONG = {
    "no format": (lambda d: d.drop_attrs(deep=False), "it says no format"),
    "another kind": (
        lambda d: d.assign_attrs(format="jaxglide glides 2"),
        "it is of the kind 'glides'",
    ),
    "later": (lambda d: d.assign_attrs(format="jaxglide glide 9"), "is of version 9"),
    "no parts": (lambda d: without(d, "parts"), "it lacks 'parts'"),
    "no launch": (lambda d: without_part(d, "launch"), "it lacks 'launch'"),
    "not JSON": (lambda d: d.assign_attrs(parts="{"), "no JSON text"),
    "no glider": (
        lambda d: changed(d, glider={"class": "Ground", "level": 0.0}),
        "in Ground: there is no field 'body'",
    ),
    "no such end": (lambda d: d.assign_attrs(outcome="well"), "outcome = 'well' with the code"),
    "turned": (lambda d: d.isel(time=slice(None, None, -1)), "time does not rise"),
    "not finite": (
        lambda d: d.assign(position=d.position * np.nan),
        "position = nan m at time",
    ),
    "unit": (
        lambda d: d.assign(angles=d.angles.assign_attrs(units="m")),
        "unit of 'angles': 'm' cannot be converted to 'rad'",
    ),
    "range": (lambda d: changed(d, glider={"gravity": 1e9}), r"gravity = 1e\+09 m/s\^2 is not"),
    "by node": (
        lambda d: d.assign(launch_phase=d.launch_phase + 0 * d.arc_length),
        "'launch_phase' is over node, where it must be over nothing",
    ),
    "text": (lambda d: d.assign_attrs(accepted="many"), "not a whole flight: invalid literal"),
    "another body": (lambda d: more_states(d), "its states are 14 numbers, where what flew"),
}


def without(data, name):
    attrs = {k: v for k, v in data.attrs.items() if k != name}
    return data.drop_attrs(deep=False).assign_attrs(attrs)


def without_part(data, name):
    records = json.loads(data.attrs["parts"])
    return data.assign_attrs(parts=json.dumps({k: v for k, v in records.items() if k != name}))


def more_states(data):
    states = data.path_length.expand_dims("motion_state", -1).assign_attrs(units="1")
    return data.assign(motion_states=states)


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_glide_is_refused_in_one_sentence(data, path, case):
    change, message = WRONG[case]
    wrong = change(data)
    wrong.encoding["source"] = str(path)
    with pytest.raises(ValueError, match=rf"^{path}: .*{message}") as caught:
        flight_of(wrong)
    assert "\n" not in str(caught.value)
