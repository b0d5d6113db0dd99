"""Parts as plain records, and back by a registry alone."""

import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Actuated,
    AngleLimit,
    AttitudeLaw,
    Driven,
    End,
    Gait,
    Glider,
    Ground,
    Gust,
    LaggingCirculation,
    Launch,
    Plane,
    Planned,
    Polar,
    Programme,
    Running,
    Serpenoid,
    ShearWind,
    Snake,
    StillAir,
    SweepTheory,
    TabulatedBody,
    TabulatedMotion,
    TabulatedPolar,
    TimeLimit,
    Turbulence,
    UniformWind,
    Waveform,
)
from jaxglide._lib.records import OwnPartError, decode, encode, own_parts
from jaxglide.air import AbstractAir
from jaxglide.flight.parts import PARTS, from_text, to_text
from jaxglide.flight.solve import settings_of

GAIT = Gait.from_degrees(d_theta=1 / 3)
PROGRAMME = Programme((0.0, 0.4, 1.0), [GAIT, Gait.from_degrees(), GAIT])
ANSWER = AttitudeLaw(GAIT, np.ones((6, 3)) / 7, angles=(0.1, 0.0, -0.1))


def limited(law):
    low, high = -np.ones(6), np.full(6, 5.0)
    return Actuated(law, GAIT, 30.0, 0.7, rate_limit=np.full(6, 9.0), low=low, high=high)


def table():
    angles, lift = np.deg2rad([-10.0, 0.0, 50.0]), np.array([[-0.1], [0.1], [1.2]])
    return TabulatedPolar(angles, [5000.0], lift, np.abs(lift) + 0.1, lift_scale=1.1)


PARTS_OF_THE_PACKAGE = {
    "snake": lambda: Snake.from_svl(0.7, gyration=0.25, node_set="gauss", nodes=20),
    "spaced": lambda: Snake(0.7, 0.03, nodes=100, spacing=0.01),
    "robot": lambda: TabulatedBody(
        (0.0, 0.3, 1.0), (0.05, 0.06, 0.05), (0.1, 0.2, 0.1), (0.4,), (0.2,), gyration=0.3
    ),
    "gait": lambda: GAIT,
    "running": lambda: Driven(Serpenoid(), Running(GAIT)),
    "programme": lambda: Driven(Serpenoid(), PROGRAMME),
    "answering": lambda: Driven(Serpenoid(), limited(ANSWER)),
    "planned": lambda: Driven(Serpenoid(), limited(Planned(PROGRAMME))),
    "motion": lambda: TabulatedMotion((0.0, 1.0), (0.0, 0.5, 1.0), *np.ones((2, 2, 3))),
    "sweep theory": lambda: SweepTheory(Polar.published(1.36, 0.6)),
    "lag": lambda: LaggingCirculation(table(), 5.0, 0.3),
    "band": lambda: Polar.band_limited(5, drag_scale=0.9),
    "bent polar": lambda: Polar(Polar.smooth().cells * 1.25),
    "still": lambda: StillAir(air_density=1.0),
    "uniform": lambda: UniformWind((1.0, 0.1, 1e-3)),
    "shear": lambda: ShearWind((0.0, 2.0, 0.0), 9.0),
    "gust": lambda: Gust((0.0, 0.0, 3.0), gust_start=2.0, kinematic_viscosity=1e-5),
    "turbulence": lambda: Turbulence(0.5, seed=7, modes=16),
    "ground": lambda: Ground(-3.0),
    "limit": lambda: AngleLimit(1.0, ("pitch", "roll")),
    "plane": lambda: Plane((0.0, 1.0, 0.0), 4.0),
    "time": lambda: TimeLimit(2.5),
    "launch": lambda: Launch(4.0, angles=(0.0, 0.1, 0.2), omega=(1.0, 0.0, 0.0)),
}


def leaves(module):
    return jax.tree.flatten(module)


@pytest.mark.parametrize("name", PARTS_OF_THE_PACKAGE)
def test_every_part_of_the_package_comes_back_to_the_last_bit(name):
    part = PARTS_OF_THE_PACKAGE[name]()
    again = from_text(to_text({"it": part}))["it"]
    (ours, kind), (theirs, other) = leaves(part), leaves(again)
    assert kind == other  # classes and static fields
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.dtype == b.dtype


def test_a_whole_glider_and_its_settings_come_back():
    glider = Glider(Snake.from_svl(), GAIT, table(), UniformWind((1.0, 0.0, 0.0)), 3.7)
    settings = settings_of(
        rtol=1e-7,
        atol=1e-8,
        max_time=9.0,
        times=np.array([0.1, 0.3]),
        ends=(Ground(), TimeLimit(3.0)),
        solver=None,
        step=None,
        max_steps=99,
        dense=True,
    )
    again = from_text(to_text({"glider": glider, "settings": settings}))
    for part, one in (("glider", glider), ("settings", settings)):
        (ours, kind), (theirs, other) = leaves(one), leaves(again[part])
        assert kind == other
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a, b)


def test_known_polars_are_named_and_others_written_out():
    assert encode(Polar.smooth(1.1)) == {
        "class": "Polar",
        "cells": "smooth",
        "lift_scale": 1.1,
        "drag_scale": 1.0,
    }
    assert encode(Polar.band_limited(12))["cells"] == "12 harmonics"
    moved = Polar(Polar.published().cells.at[3, 2, 0, 1, 1].add(1e-9))
    assert np.shape(encode(moved)["cells"]) == (72, 6, 2, 2, 2)
    with pytest.raises(ValueError, match="cells = 'mine' is not one of"):
        Polar("mine")


class Gust2(AbstractAir):
    """A user's own air, with what no record holds."""

    strength: jax.Array
    shape: object = eqx.field(static=True, default=None)

    def wind(self, position, time):
        return self.strength * jnp.ones_like(position)


class Shadow:
    """A user's own classes may be named as the package's are."""

    class Gust(Gust2):
        pass


def upwards(time, state):
    return 20.0 - state[2]


@pytest.mark.parametrize(
    ("part", "own"),
    [
        (lambda: Gust2(jnp.asarray(2.0), shape=object()), "test_part_records.Gust2"),
        (lambda: Shadow.Gust(jnp.asarray(2.0)), "test_part_records.Shadow.Gust"),
        (lambda: End(upwards, "rose"), "test_part_records.upwards"),
        (lambda: Waveform(upwards_wave, ("phase",)), "test_part_records.upwards_wave"),
    ],
)
def test_a_part_of_ones_own_is_named_and_not_made(part, own):
    record = json.loads(json.dumps(encode(part())))
    assert own in set(own_parts(record, PARTS))
    with pytest.raises(OwnPartError, match=rf"{own} is a part of the user's own"):
        decode(record, {**PARTS, "Gust": lambda **fields: pytest.fail("made")})


def upwards_wave(fraction, q):
    return q * fraction, 0 * fraction


def test_floats_of_a_part_of_ones_own_are_written():
    assert encode(Gust2(jnp.asarray(2.5)))["strength"] == 2.5
    assert encode(Gust2(jnp.asarray([np.nan, 1.0])))["strength"] == ["nan", 1.0]


@pytest.mark.parametrize(
    ("record", "said"),
    [
        ({"class": "Gait"}, "in Gait: the field 'theta_m' is missing"),
        ({"class": "Ground", "level": 0.0, "depth": 1.0}, "in Ground: there is no field 'dep"),
        ({"class": "Ground", "level": 1e9}, r"in Ground: level = 1e\+09 m is not allowed"),
        ({"class": "Ground", "level": "low"}, "in Ground: level = 'low' is not a number"),
        ({"class": "SweepTheory", "polar": 3.0}, "in SweepTheory: .*polar"),
        ({"class": "Glider", "body": {"class": "Ground"}, "gait": 1}, "in Glider: .*body"),
        ({"level": 0.0}, "names no class"),
        ({"class": ["Ground"]}, "names no class"),
    ],
)
def test_a_wrong_record_is_told_in_one_sentence(record, said):
    with pytest.raises(ValueError, match=said) as caught:
        decode(record, PARTS)
    assert "\n" not in str(caught.value)


def test_a_nest_without_end_is_refused():
    deep = {"class": "Ground"}
    for _ in range(100):
        deep = {"class": "Ground", "level": deep}
    with pytest.raises(ValueError, match="nested too deeply"):
        decode(deep, PARTS)
    with pytest.raises(ValueError, match="no JSON text"):
        from_text("[" * 100_000)


JUNK = [
    None,
    True,
    -1,
    0,
    1e300,
    10**400,
    "x",
    "nan",
    [],
    [[1.0], [2.0, 3.0]],
    {},
    "9 harmonics",
]
JUNK += [{"class": "Gait"}, {"class": "Ground", "level": 0.0}, [1.0, 0.5], {"function": "f"}]


def leaves_of(record, path=()):
    """Paths of everything in a record."""
    inside = record.items() if isinstance(record, dict) else ()
    inside = enumerate(record) if isinstance(record, list) else inside
    for key, one in inside:
        yield (*path, key)
        yield from leaves_of(one, (*path, key))


def complaint(records):
    """What is said against records; nothing if they are read."""
    try:
        from_text(json.dumps(records))
    except ValueError as error:
        return str(error)
    return ""


@pytest.mark.filterwarnings("ignore:A JAX array is being set as static")
@pytest.mark.parametrize("name", [n for n in PARTS_OF_THE_PACKAGE if n != "bent polar"])
def test_no_damage_to_a_record_leads_to_anything_but_a_sentence(name):
    whole = encode(PARTS_OF_THE_PACKAGE[name]())
    rng = np.random.default_rng(0)
    paths = list(leaves_of(whole))
    for k in rng.permutation(len(paths))[:12]:
        for junk in [JUNK[i] for i in rng.permutation(len(JUNK))[:6]]:
            record = json.loads(json.dumps(whole))
            *above, last = paths[k]
            inner = record
            for key in above:
                inner = inner[key]
            inner[last] = junk
            said = complaint({"it": record})
            assert "\n" not in said, said
            assert len(said) < 600, said
