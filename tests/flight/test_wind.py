"""Wind that is uniform is a moving frame, and a shape that is held is a gait."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Driven,
    Gait,
    Glider,
    Ground,
    Gust,
    Launch,
    Polar,
    Programme,
    Running,
    Serpenoid,
    Snake,
    StillAir,
    Turbulence,
    UniformWind,
    discretise,
    integrate,
    reconstruct,
    take_off,
)
from jaxglide.flight.dynamics import ANGLES, OMEGA, PATH, POSITION, VELOCITY

SNAKE = Snake.from_svl(nodes=24, node_set="gauss")
GAIT = Gait.from_degrees(d_theta=15)
WIND = np.array([1.5, -2.0, 0.7])
START = np.array([0, 0, 10, 0.3, 4.0, -3.0, 0.5, -1.0, 0.8, 0.1, -0.2, 0.15, 0])
TIMES = np.linspace(0, 0.3, 7)
TURBULENT = Turbulence(2.0, 0.5, WIND, seed=2)


def fly(gait=GAIT, polar=None, air=None, start=START, **options):
    glider = Glider(SNAKE, gait, polar or Polar.smooth(), air or StillAir())
    settings = {"phase": 0.4, "save": TIMES, "step": 0.01, "ends": (Ground(),)}
    return integrate(glider, start, 0.0, 0.3, **{**settings, **options})


def blown(state, wind=WIND):
    """The same seen from axes that move with the wind."""
    return np.asarray(state) + np.r_[np.zeros(3), wind, np.zeros(7)]


def assert_moved(found, still):
    """`found` is `still` seen from axes that move with the wind, to round-off."""
    expected = np.asarray(still.states) + 0
    expected[:, POSITION] += np.outer(TIMES, WIND)
    expected[:, VELOCITY] += WIND
    states = np.asarray(found.states)
    for part in (POSITION, VELOCITY, OMEGA, ANGLES):
        np.testing.assert_allclose(states[:, part], expected[:, part], rtol=0, atol=1e-11)


@pytest.fixture(scope="module")
def still():
    return fly()


def test_a_whole_glide_in_uniform_wind_is_one_in_still_air_seen_from_a_moving_frame(still):
    found = fly(air=UniformWind(WIND), start=blown(START))
    assert_moved(found, still)
    # it is the wind that does it: without the launch's share the glide is another
    other = fly(air=UniformWind(WIND))
    assert np.abs(other.state[OMEGA] - still.state[OMEGA]).max() > 0.1
    # the path is that over the ground
    legs = np.linalg.norm(np.diff(found.states[:, :2], axis=0), axis=1).sum()
    assert float(found.state[PATH]) == pytest.approx(legs, rel=1e-2)
    assert float(found.state[PATH]) < 0.8 * float(still.state[PATH])


def test_the_landing_point_moves_with_the_wind():
    """Level wind, from 0.5 m, to the ground: the same instant, wind times time farther."""
    wind, start = WIND * [1, 1, 0], np.array(START)
    start[2] = 0.5
    landed = [fly(air=UniformWind(wind * k), start=blown(start, wind * k)) for k in (0, 1)]
    assert [one.ending for one in landed] == ["landed"] * 2
    calm, windy = landed
    assert float(windy.time) == pytest.approx(float(calm.time), abs=1e-12)
    np.testing.assert_allclose(
        windy.landing_point, calm.landing_point + wind * float(calm.time), rtol=0, atol=1e-11
    )
    assert 0.05 < float(calm.time) < 0.29


def test_a_ballistic_body_does_not_feel_the_wind():
    """Without lift and drag it is still air, in any wind, to the last bit but one."""
    nothing = Polar.smooth(0.0, 0.0)
    free = fly(polar=nothing)
    for air in (UniformWind(WIND), TURBULENT, Gust(WIND, -1.0, 4.0)):
        found = fly(polar=nothing, air=air)
        np.testing.assert_allclose(found.states, free.states, rtol=0, atol=1e-14)
    assert_moved(fly(polar=nothing, air=UniformWind(WIND), start=blown(START)), free)
    t = TIMES[:, None]
    path = START[POSITION] + START[VELOCITY] * t - [0, 0, 9.81 / 2] * t**2
    np.testing.assert_allclose(free.states[:, POSITION], path, rtol=0, atol=1e-12)


def test_a_gust_acts_where_it_stands(still):
    """Before it the glide is as in still air, and behind its front no longer."""
    far, near = (fly(air=Gust(WIND, start, 1.0)) for start in (50.0, 0.4))
    np.testing.assert_allclose(far.states, still.states, rtol=0, atol=1e-13)
    apart = np.abs(np.asarray(near.states - still.states)).max(axis=1)
    assert apart[0] == 0
    assert apart[-1] > 0.01


def test_elements_meet_the_wind_of_their_own_place():
    """Reconstructed is the velocity through the air; that over the ground is wind more."""
    air = TURBULENT
    found = fly(air=air)
    now = reconstruct(found)
    for k in (0, 3):
        state = np.asarray(found.states[k])
        R_IB = np.asarray(now.R_BI[k]).T
        r, v = (np.asarray(getattr(now.body, name)[k]) for name in ("position", "velocity"))
        ground = state[VELOCITY, None] + R_IB @ (v + np.cross(state[OMEGA], r.T).T)
        place = state[POSITION, None] + R_IB @ r
        wind = np.asarray(air.wind(jnp.asarray(place), jnp.asarray(TIMES[k])))
        np.testing.assert_allclose(
            R_IB @ np.asarray(now.air_velocity[k]), ground - wind, rtol=0, atol=1e-12
        )
        assert np.ptp(wind, axis=1).max() > 0.1


# A shape that is held


@pytest.mark.parametrize(
    "drive",
    [Running(GAIT), Programme((0.05, 0.2), [GAIT, GAIT])],
    ids=["running", "programme"],
)
def test_a_drive_that_holds_its_inputs_is_the_gait(drive, still):
    found = fly(Driven(Serpenoid(), drive))
    np.testing.assert_allclose(found.states, still.states, rtol=0, atol=1e-12)
    moved = eqx.tree_at(lambda d: d.inputs, drive, drive.inputs * 1.001)
    assert np.abs(fly(Driven(Serpenoid(), moved)).states - still.states).max() > 1e-6


def test_a_drive_that_holds_its_inputs_is_launched_as_the_gait():
    """Phase, attitude and speed follow from the cycle of the shape."""
    sections, gaits = jax.jit(discretise)(SNAKE), (GAIT, Driven(Serpenoid(), Running(GAIT)))
    start = [jax.jit(take_off)(Glider(SNAKE, gait), Launch(), sections) for gait in gaits]
    np.testing.assert_allclose(start[1].state, start[0].state, rtol=0, atol=1e-11)
    assert float(start[0].phi_theta) == pytest.approx(float(start[1].phi_theta), abs=1e-11)
    assert np.abs(start[0].angles).max() > 0.01
