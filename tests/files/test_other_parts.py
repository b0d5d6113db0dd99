"""A robot with other parts than the published snake's: saved, opened, drawn and viewed."""

import json
import warnings

import equinox as eqx
import jax
import numpy as np
import pytest

import jaxglide
from jaxglide import (
    Actuated,
    AngleLimit,
    AttitudeLaw,
    Driven,
    Gait,
    Glide,
    Glider,
    LaggingCirculation,
    Launch,
    Polar,
    Serpenoid,
    Snake,
    StillAir,
    TabulatedBody,
    TimeLimit,
    Trajectory,
    UniformWind,
    integrate,
    plot,
    simulate,
)
from jaxglide._lib.netcdf import load_netcdf
from jaxglide.air import AbstractAir
from jaxglide.files import glide_dataset
from jaxglide.flight.dynamics import PATH, RIGID, VELOCITY
from jaxglide.plot.saved import draw
from jaxglide.plot.waves import angles_in_flight
from jaxglide.view.scene import Scene

WIND = (1.0, 0.5, -0.25)
NODES, POINTS = 12, 2


def robot():
    body = TabulatedBody(
        (0.0, 0.4, 0.8),
        (0.04, 0.06, 0.04),
        (0.05, 0.06, 0.05),
        (0.6, 0.3),
        (0.01, 0.02),
        nodes=NODES,
    )
    gait = Gait.from_degrees(theta_m=70.0)
    law = AttitudeLaw(gait, 0.1 * np.ones((6, 3)))
    motion = Driven(Serpenoid(), Actuated(law, gait, 20.0))
    aerodynamics = LaggingCirculation(Polar.smooth(), 5.0)
    return Glider(body, motion, aerodynamics, UniformWind(WIND))


@pytest.fixture(scope="module")
def flown():
    ends = (AngleLimit(1.2, ("pitch", "roll")), TimeLimit(0.15))
    launch = Launch(30.0, 2.0, phi_theta=0.3, angles=(0.0, 0.0, 0.0), omega=(0.1, 0.0, 0.0))
    return simulate(robot(), launch, ends=ends, dense=True)


@pytest.fixture(scope="module")
def path(flown, tmp_path_factory):
    return jaxglide.save(flown, tmp_path_factory.mktemp("robot") / "robot.nc")


@pytest.fixture(scope="module")
def again(path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return jaxglide.open(path)


def test_it_comes_back_whole(flown, again):
    assert isinstance(again, Glide)
    assert again.ending == flown.ending == "reached its time"
    for part in ("glider", "launch", "settings", "take_off", "outcome", "time", "state"):
        ours, theirs = (jax.tree.flatten(getattr(g, part)) for g in (flown, again))
        assert ours[1] == theirs[1], part
        for a, b in zip(ours[0], theirs[0], strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13, err_msg=part)
    times = flown.sample_times(201)[::10]
    np.testing.assert_allclose(again.at(times), flown.at(times), atol=1e-9)
    assert str(again) == str(flown)


def test_its_file_says_which_velocity_and_which_wind(flown, path):
    data = load_netcdf(path)
    np.testing.assert_allclose(data.wind, np.broadcast_to(WIND, data.wind.shape))
    np.testing.assert_allclose(data.velocity[-1], flown.state[VELOCITY])
    np.testing.assert_allclose(data.velocity - data.wind, data.velocity_through_air)
    assert "over the ground" in data.velocity.attrs["long_name"]
    assert "through the air" in data.velocity_through_air.attrs["long_name"]
    own = data.motion_states, data.air_states
    assert [s.shape[1] for s in own] == [13, NODES + POINTS]
    assert flown.state.shape[0] == RIGID + 13 + NODES + POINTS
    np.testing.assert_allclose(np.concatenate([s[-1] for s in own]), flown.state[PATH + 1 :])
    said = data.attrs["body"], data.attrs["gait"], data.attrs["air"], data.attrs["ends"]
    assert said == ("TabulatedBody", "Driven", "UniformWind", "AngleLimit, TimeLimit")
    assert (data.natural_frequency.item(), data.lag.item(), data.end_time) == (20, 5, 0.15)


def test_no_wind_is_written_of_air_at_rest(flown):
    still = eqx.tree_at(lambda g: g.glider.air, flown, StillAir())
    assert not {"wind", "velocity_through_air"} & set(glide_dataset(still, 3).variables)


@pytest.mark.parametrize("name", [None, "lift", "waves", "theta", "body", "angles", "wind"])
def test_it_is_drawn(path, name):
    at = {"axis": "x"} if name == "wind" else {}
    figure = draw(load_netcdf(path), name, at=at).figure
    drawn = [ax for ax in figure.axes if ax.lines or ax.collections]
    assert drawn
    if name is None:  # it meets no ground
        assert "ground" not in [p.get_label() for p in figure.axes[0].patches]
        assert figure.get_suptitle().startswith("Reached its time after 0.15 s")


def test_its_bends_are_not(path):
    with pytest.raises(ValueError, match="Driven has no bend d_psi to draw: a Gait has one"):
        draw(load_netcdf(path), "bends")


def test_forces_leave_out_point_masses(flown):
    values = plot.along_body(flown, "lift")
    assert values.sizes["node"] == NODES
    assert np.isfinite(values).all()
    total = glide_dataset(flown)["lift"].sum("node")
    np.testing.assert_allclose(values.sum("node") * 0.8 / NODES, total, rtol=1e-9)


def test_its_waves_are_those_it_flew(flown):
    times = np.array([0.0, 0.1])
    fraction, angles = angles_in_flight(flown, times)
    states = np.asarray(flown.at(times))
    amplitude = np.rad2deg(states[:, RIGID])  # position of the first actuator
    assert amplitude[1] != pytest.approx(amplitude[0], abs=0.01)
    phase = 0.3 - 2 * np.pi * states[:, RIGID + 12]
    nu = states[:, RIGID + 2]
    u = np.pi / 2 * np.cos(2 * np.pi * nu[:, None] * fraction + phase[:, None])
    wanted = amplitude[:, None] * np.sin(u)
    wanted += np.rad2deg(states[:, RIGID + 4, None]) * fraction
    np.testing.assert_allclose(angles["theta"], wanted, atol=1e-9)


def test_its_view_has_a_body_and_no_head(flown):
    scene = Scene.of(flown)
    assert scene.nodes.shape[1:] == (NODES, 3)
    assert np.isfinite(scene.lift).all()
    assert np.all(np.diff(scene.fraction) > 0)
    assert scene.svl == pytest.approx(0.8)
    assert scene.covered == 0
    assert scene.surface(3, "head").shape[0] == 0
    assert np.isfinite(scene.surface(3)).all()
    assert scene.ended == "reached its time"


def test_a_still_of_it_is_drawn(flown, tmp_path):
    from jaxglide import view

    assert view.still(flown, tmp_path / "robot.png").stat().st_size > 10_000
    page = view.view(flown, rate=30.0)
    assert '"width": []' in page.html  # of the head's stations


def test_a_piece_of_flight_comes_back(tmp_path):
    glider = Glider(Snake.from_svl(nodes=20), Gait.from_degrees(), Polar.smooth())
    state = np.zeros(13)
    state[2], state[4] = 10.0, 2.0
    piece = integrate(glider, state, 1.0, 1.2, phase=0.3, save="dense")
    again = jaxglide.open(jaxglide.save(piece, tmp_path / "piece.nc"))
    assert isinstance(again, Trajectory)
    for part in ("glider", "settings", "phase", "start_time", "start", "outcome", "state"):
        ours, theirs = (jax.tree.leaves(getattr(g, part)) for g in (piece, again))
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13, err_msg=part)
    times = np.linspace(1.0, 1.2, 5)
    np.testing.assert_allclose(again.at(times), piece.at(times), atol=1e-6)
    assert str(again) == str(piece)
    assert draw(again).figure.axes[2].get_xlim() == pytest.approx((1.0, 1.2))


class Tailwind(AbstractAir):
    """An air of a user's own."""

    strength: jax.Array

    def wind(self, position, time):
        return self.strength * jax.numpy.ones_like(position)


def test_a_part_of_ones_own_comes_back_as_a_dataset_with_its_floats(flown, tmp_path):
    own = eqx.tree_at(lambda g: g.glider.air, flown, Tailwind(jax.numpy.asarray(2.5)))
    path = jaxglide.save(own, tmp_path / "own.nc")
    said = rf"^{path}: test_other_parts.Tailwind is a part of the user's own.*its Dataset$"
    with pytest.warns(UserWarning, match=said):
        data = jaxglide.open(path)
    assert data.strength.item() == 2.5
    assert json.loads(data.attrs["parts"])["glider"]["air"]["strength"] == 2.5
    np.testing.assert_allclose(data.wind, 2.5)
    assert draw(data, "lift").figure.axes
    with pytest.raises(ValueError, match="Tailwind is a part of the user's own"):
        draw(data)
