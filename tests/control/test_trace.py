"""Controlled flights traced, saved and drawn; controllers as data."""

import base64
import dataclasses
import gzip
import json
import re
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

import jaxglide
from jaxglide import (
    Case,
    Constant,
    Controller,
    CoordinatedTurn,
    Environment,
    GainScheduled,
    Gait,
    Glider,
    Launch,
    NeuralPolicy,
    Polar,
    Regulator,
    Senses,
    Snake,
    Stepped,
    Waypoints,
    controlled_flight,
    integrate,
    plot,
    retrace,
)
from jaxglide._lib.netcdf import load_netcdf
from jaxglide.control import AbstractPolicy, histories, target_of
from jaxglide.control.plant import INPUTS
from jaxglide.control.regulator import Linear, limits
from jaxglide.files import controller_dataset, controller_of
from jaxglide.plot.saved import draw
from jaxglide.view import Scene, view

KEY = jax.random.key(3)
PSI, THETA = INPUTS.index("d_psi"), INPUTS.index("d_theta")


class Bending(AbstractPolicy):
    """Bends the other way at every sample, within rate limits; the user's own."""

    inputs: Any

    def __call__(self, memory, sensed):
        by = jnp.where(sensed.sample % 2 == 0, 0.1, -0.06)
        return self.inputs.at[PSI].add(by).at[THETA].add(0.5 * by), memory


def environment_of(**more) -> Environment:
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    glider = Glider(body, Gait.from_degrees(d_psi=5), Polar.smooth())
    more = {"vary": {"speed": (1.6, 1.9)}, "senses": Senses(delay=0.03)} | more
    return Environment(Case(glider, Launch(height=3.0)), **more)


@pytest.fixture(scope="module")
def environment():
    return environment_of()


@pytest.fixture(scope="module")
def flown(environment):
    return controlled_flight(environment, Bending(environment.plant.inputs), KEY, 30)


@pytest.fixture(scope="module")
def flight(environment, flown):
    return retrace(environment, flown, KEY)


def test_a_traced_flight_is_the_one_that_was_flown(environment, flown, flight):
    """At the samples, at its end, and in what it was told, 30 ms late."""
    there = ~np.asarray(flown.over)
    times = np.asarray(flown.times)[there]
    np.testing.assert_allclose(flight.at(times), flown.states[there], atol=1e-11)
    assert flight.ending == "landed"
    assert float(flight.time) == float(flown.ended.time)
    np.testing.assert_array_equal(flight.state, flown.ended.state)
    np.testing.assert_allclose(float(flight.start[4]), 1.6, atol=0.3)
    law = flight.glider.gait.drive.law
    np.testing.assert_allclose(law.times, [0, *(times + 0.03)], rtol=1e-12)
    fine = np.asarray(flight.interpolation.ts)
    assert (np.diff(fine) > 0).all()
    assert np.diff(fine).max() < 1 / 119


def test_it_flies_again_by_what_it_was_told(flight):
    """The equations with the record of what was told as their law, steps chosen freely."""
    options = {"phase": flight.phase, "ends": flight.settings.ends, "rtol": 1e-8, "atol": 1e-8}
    again = integrate(flight.glider, flight.start, 0.0, 5.0, **options)
    assert again.ending == "landed"
    np.testing.assert_allclose(float(again.time), float(flight.time), atol=1e-6)
    np.testing.assert_allclose(again.state[:13], flight.state[:13], atol=5e-5)


def test_histories_say_what_was_told_and_reached(flight):
    times = np.array([0.0, 0.02, 0.05, 0.14])
    psi, theta = histories(flight, times)
    assert (psi.name, theta.name, psi.unit) == ("d_psi", "d_theta", "deg/SVL")
    up, down = 5 + np.rad2deg(0.1), 5 - np.rad2deg(0.06)
    np.testing.assert_allclose(psi.told, [5, 5, up, down], rtol=1e-12)
    np.testing.assert_allclose(psi.position[0], 5, rtol=1e-12)
    assert 5 < psi.position[2] < psi.position[3] < up
    np.testing.assert_allclose([psi.low, psi.high, theta.high], [-20, 30, 30], rtol=1e-12)
    still = dataclasses.replace(
        flight, glider=dataclasses.replace(flight.glider, gait=Gait.from_degrees())
    )
    assert histories(still, times) == []


def test_a_traced_flight_is_saved_with_its_inputs_and_opened(tmp_path, flight):
    path = jaxglide.save(flight, tmp_path / "it.nc")
    data = load_netcdf(path)
    assert data["d_psi"].attrs["units"] == "degree"
    psi, _ = histories(flight, data["time"].values)
    np.testing.assert_allclose(data["d_psi"], psi.position, rtol=1e-12)
    np.testing.assert_allclose(data["d_psi_told"], psi.told, rtol=1e-12)
    np.testing.assert_allclose([data["d_psi_low"], data["d_psi_high"]], [-20, 30])
    again = jaxglide.open(path)
    np.testing.assert_array_equal(
        again.glider.gait.drive.law.inputs, flight.glider.gait.drive.law.inputs
    )
    np.testing.assert_allclose(
        histories(again, [0.3])[0].position, histories(flight, [0.3])[0].position, atol=0.1
    )
    said = draw(data)
    assert said.said == "the flight, and what it was told"
    assert draw(data, "portrait").said == "angles against their rates"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: jax.tree.map(lambda x: x[None], f), "batch of flights of shape \\(1,\\)"),
        (lambda f: f._replace(over=jnp.ones(30, bool)), "over at its launch"),
        (lambda f: f._replace(ended=f.ended._replace(time=jnp.asarray(jnp.nan))), "not finite"),
    ],
)
def test_what_has_no_trace_is_refused(environment, flown, change, said):
    with pytest.raises(ValueError, match=said):
        retrace(environment, change(flown), KEY)


def test_stepped_inputs_are_checked():
    gait = Gait.from_degrees()
    with pytest.raises(ValueError, match="times must increase"):
        Stepped([0.1, 0.1], [gait, gait])
    with pytest.raises(ValueError, match="inputs has shape"):
        Stepped([0.1, 0.2, 0.3], [gait, gait])


# Controllers


def test_a_controller_comes_back_to_the_bit(tmp_path, environment):
    first = Controller(Constant(environment.plant.inputs + 1e-3), environment)
    again = jaxglide.open(jaxglide.save(first, tmp_path / "it.nc"))
    assert eqx.tree_equal(first, again)
    other = environment_of(samples=4, fall=3.0, actuators={"damping": 0.8}, inputs=("d_psi",))
    second = Controller(Constant(other.plant.inputs), other)
    assert eqx.tree_equal(controller_of(controller_dataset(second)), second)
    assert not eqx.tree_equal(again, second)


def made_regulator(environment, launch=0, chosen=(PSI, THETA), seen=True) -> Regulator:
    """A regulator that nobody designed."""
    rng, c = np.random.default_rng(0), len(chosen)
    count, n = 8 + launch, 9 + 3 * c
    shapes = (n,), (n, n), (n, c)
    linear = Linear(*(jnp.asarray(rng.random((count, *shape))) for shape in shapes))
    L = jnp.asarray(rng.random((count, n, n - 3))) if seen else None
    K, told, jump = (jnp.asarray(rng.random(s)) for s in ((count, c, n), (count, c), (n,)))
    low, high = limits(environment.plant.drive, chosen)
    own = environment.plant.inputs, low, high, jnp.asarray(0.1), jnp.asarray(0.2)
    return Regulator(linear, K, L, told, jump, *own, chosen, launch)


def test_laws_of_every_kind_come_back_to_the_bit():
    senses = Senses(delay=0.03, place=True)
    environment = environment_of(senses=senses)
    plain = made_regulator(environment, launch=16, seen=False)
    seeing = made_regulator(environment)
    turn = CoordinatedTurn(seeing, 0.2, 1.0, np.full((8, 2), 0.1))
    straight = dataclasses.replace(seeing, turn=jnp.zeros(()))
    laws = [
        plain,
        turn,
        Waypoints(dataclasses.replace(turn, regulator=straight), [[1.0, 2.0]]),
        seeing,
        GainScheduled.of(environment, seeing),
        GainScheduled.of(environment, plain, knots=(0.0, 3.0)),
        NeuralPolicy.of(environment, GainScheduled.of(environment, seeing), width=5, depth=3),
        NeuralPolicy.of(environment, Constant(environment.plant.inputs), depth=1, seed=4),
    ]
    for law in laws:
        first = Controller(law, environment)
        again = controller_of(controller_dataset(first))
        assert eqx.tree_equal(again, first), type(law)
        aimless = isinstance(law, Waypoints) or law is laws[-1]
        assert target_of(again.policy).heading == (None if aimless else 0.2)
    np.testing.assert_array_equal(target_of(laws[2]).points, [[1, 2]])


def test_a_network_of_another_kind_is_refused(environment):
    law = NeuralPolicy.of(environment, Constant(environment.plant.inputs))
    other = eqx.tree_at(lambda p: p.network.activation, law, jax.nn.relu)
    with pytest.raises(ValueError, match="only a network of tanh"):
        controller_dataset(Controller(other, environment))
    data = controller_dataset(Controller(law, environment))
    with pytest.raises(ValueError, match="its layers are of shapes"):
        controller_of(data.isel(network_weights_1_1=slice(4)))


def test_a_regulator_of_another_model_is_refused(environment):
    other = environment_of(samples=4)
    with pytest.raises(ValueError, match="has 8 samples in a cycle, not 4"):
        Controller(made_regulator(environment), other)
    one = made_regulator(environment, chosen=(PSI,))
    with pytest.raises(ValueError, match="it sets d_psi, not d_psi, d_theta"):
        Controller(one, environment)
    short = eqx.tree_at(lambda r: r.K, made_regulator(environment), jnp.zeros((8, 2, 12)))
    with pytest.raises(ValueError, match="another model"):
        Controller(short, environment)


@pytest.fixture(scope="module")
def saved(environment):
    return controller_dataset(Controller(Constant(environment.plant.inputs), environment))


def edited(data: xr.Dataset, old: str, new: str) -> xr.Dataset:
    text = data.attrs["parts"]
    assert old in text
    return data.assign_attrs(parts=text.replace(old, new))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda d: edited(d, '"Snake"', '"os.system"'),
            "os.system is a part of the user's own",
        ),
        (lambda d: edited(d, '"samples": 8', '"samples": 0'), "samples = 0 is not allowed"),
        (lambda d: edited(d, '"Polar"', '"Polarr"'), "Polarr"),
        (lambda d: d.assign_attrs(parts="{"), "no JSON text"),
        (lambda d: d.assign_attrs(format="jaxglide controller 1"), "is of version 1"),
        (lambda d: d.assign_attrs(format="jaxglide glide 2"), "of the kind 'glide'"),
        (lambda d: d.drop_vars("inputs"), "it lacks inputs"),
        (lambda d: d.assign(inputs=d["inputs"] * np.nan), "inputs is not finite"),
        (lambda d: d.isel(inputs_0=slice(5)), r"inputs of shape \(5,\)"),
        (
            lambda d: d.assign(launch_rate=1.01 * d["launch_rate"]),
            "of another model: its flight",
        ),
        (lambda d: d.isel(state=slice(13)), "another model: its flight has 13 states, here 26"),
    ],
)
def test_a_file_that_is_no_whole_controller_is_told_in_a_sentence(saved, change, said):
    with pytest.raises(ValueError, match=said) as told:
        controller_of(change(saved))
    assert "\n" not in str(told.value)


def test_a_policy_of_another_model_is_refused(environment):
    class Steering(Constant):
        chosen: tuple[int, ...] = eqx.field(static=True, default=(PSI,))

    with pytest.raises(ValueError, match="it sets d_psi, not d_psi, d_theta"):
        Controller(Steering(environment.plant.inputs), environment)
    with pytest.raises(TypeError, match="policy"):
        Controller(environment, environment)


def test_a_policy_of_the_users_own_comes_back_as_a_dataset(tmp_path, environment):
    own = Controller(Bending(environment.plant.inputs), environment)
    path = jaxglide.save(own, tmp_path / "own.nc")
    with pytest.warns(UserWarning, match="Bending is a part of the user's own"):
        assert isinstance(jaxglide.open(path), xr.Dataset)


# Figures and views


def test_a_view_shows_histories_and_targets_of_a_steered_flight(flight):
    @dataclasses.dataclass
    class Wanted:
        heading: float = 0.2

    scene = Scene.of(flight, rate=60, policy=Wanted())
    psi, _ = histories(flight, scene.times)
    np.testing.assert_array_equal(scene.inputs[:, 0], psi.position)
    np.testing.assert_array_equal(scene.told[:, 0], psi.told)
    page = view(flight, policies=[Wanted()]).html
    (about,) = re.findall(r'id="about">(.*?)</script>', page)
    (told,) = json.loads(about)["glides"]
    assert [one["name"] for one in told["steered"]] == ["dorsoventral bending", "lateral bias"]
    assert told["heading"] == pytest.approx(np.rad2deg(0.2))
    (data,) = re.findall(r'id="data">(.*?)</script>', page)
    numbers = np.frombuffer(gzip.decompress(base64.b64decode(data)), "<f4")
    count = scene.inputs.size
    np.testing.assert_allclose(numbers[-count:], scene.told.ravel(), rtol=1e-6)
    np.testing.assert_allclose(numbers[-2 * count : -count], scene.inputs.ravel(), rtol=1e-6)
    with pytest.raises(ValueError, match="policies has 2 for 1 glides"):
        view(flight, policies=[None, None])


def line(ax, label):
    """Points of a line by its label, (T, 2)."""
    (found,) = [one for one in ax.lines if one.get_label() == label]
    return np.asarray(found.get_xydata())


def test_the_response_shows_what_was_told_reached_and_allowed(flight):
    @dataclasses.dataclass
    class Wanted:
        heading: float = 0.2

    figure = plot.response(flight, Wanted())
    side, _, angles, psi, theta, power = figure.axes
    times = line(psi, "told")[:, 0]
    one, other = histories(flight, times)
    np.testing.assert_allclose(line(psi, "told")[:, 1], one.told)
    np.testing.assert_allclose(line(theta, "reached")[:, 1], other.position)
    limits = [x.get_ydata()[0] for x in psi.lines if x.get_label() == "limit"]
    np.testing.assert_allclose(limits, [-20, 30])
    np.testing.assert_allclose(line(angles, "heading")[:, 1], np.rad2deg(0.2))
    watts = line(power, "power")[:, 1]
    np.testing.assert_allclose(line(power, "mean")[0, 1], watts.mean())
    assert np.abs(watts).max() > 1
    assert line(side, "path")[-1, 1] == pytest.approx(0, abs=1e-6)
    still = dataclasses.replace(
        flight, glider=dataclasses.replace(flight.glider, gait=Gait.from_degrees())
    )
    with pytest.raises(ValueError, match="not under control"):
        plot.response(still)


def test_points_are_drawn_from_above(flight):
    @dataclasses.dataclass
    class Wanted:
        points: Any

    figure = plot.response(flight, Wanted(np.array([[1.0, 2.0], [0.0, 9.0]])))
    np.testing.assert_allclose(line(figure.axes[1], "points"), [[1, 2], [0, 9]])
    assert figure.axes[1].get_ylim()[1] > 9


def test_a_portrait_shows_rates_and_a_dot_a_cycle(flight):
    figure = plot.phase_portrait(flight, ("roll",))
    (ax,) = figure.axes
    path = line(ax, "path")
    times = np.asarray(flight.sample_times(len(path)))
    np.testing.assert_allclose(path[:, 0], np.rad2deg(flight.at(times)[:, 11]), rtol=1e-12)
    slopes = np.gradient(path[:, 0], times)
    assert np.abs(slopes - path[:, 1]).mean() < 0.02 * np.abs(path[:, 1]).max()
    frequency = float(flight.glider.gait.drive.initial[-1])
    assert len(line(ax, "return map")) == int(np.ceil(float(flight.time) * frequency))
    with pytest.raises(ValueError, match="turns"):
        plot.phase_portrait(flight, ("height",))


def test_shares_that_landed_are_of_the_flights_in_a_bin():
    number = np.linspace(0, 1, 40)
    landed = np.stack([number > 0.5, number > -1])
    data = xr.Dataset(
        {"landed": (("law", "flight"), landed), "launch.speed": ("flight", number)},
        {"law": ["none", "lqr"]},
    )
    data["launch.speed"] = data["launch.speed"].expand_dims(law=2)
    ax = plot.share_landed(data, "launch.speed", bins=4)
    none, lqr = (np.asarray(one.get_xydata()) for one in ax.lines)
    np.testing.assert_allclose(none[:, 1], [0, 0, 100, 100])
    np.testing.assert_allclose(lqr[:, 1], 100)
    np.testing.assert_allclose(none[:, 0], [number[k : k + 10].mean() for k in (0, 10, 20, 30)])
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words == ["none, 50 % in all", "lqr, 100 % in all"]
    with pytest.raises(ValueError, match=r"known are launch\.speed"):
        plot.share_landed(data, "mass")
