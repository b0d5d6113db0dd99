"""The wind tunnel: held glides, loads by phase, glide polar; figures and closed forms."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AbstractBody,
    Gait,
    Glider,
    Launch,
    Outcome,
    Polar,
    ShearWind,
    Snake,
    UniformWind,
    discretise,
)
from jaxglide.flight.dynamics import Flight, six_degrees_of_freedom
from jaxglide.loads.inertia import angular_momentum
from jaxglide.shape.gait import wave_phase, waves
from jaxglide.shape.kinematics import backbone
from jaxglide.tunnel.fall import fall, loads_along, loads_at_end
from jaxglide.tunnel.glide_polar import body_polar, equilibrium, velocity_polar
from jaxglide.tunnel.loads import loads, over_phases
from jaxglide.tunnel.trim import trim

MOVING = np.array([0.0, 4.0, -5.0])


@pytest.fixture(scope="module")
def entries(golden):
    return golden("windtunnel")


@pytest.fixture(scope="module")
def falls(entries, glider_of):
    """The golden cases and, last, one without air, in one vmapped call."""
    gliders = [glider_of({"svl": 0.7, "f_theta": 1.2, "neck_fraction": 0.055 / 0.7, **entry})
               for entry in entries]  # fmt: skip
    airless = Glider(gliders[0].body, gliders[0].gait, Polar.published(0.0, 0.0))
    batch = jax.tree.map(lambda *leaves: jnp.stack(leaves), *gliders, airless)
    return batch, jax.jit(jax.vmap(fall))(batch)


def test_held_glides_end_where_the_published_ones_do(entries, falls):
    _, fallen = falls
    lanes, last = np.arange(len(entries)), np.asarray(fallen.last)[: len(entries)]
    ends = np.asarray(fallen.states)[lanes, last]
    times = np.asarray(fallen.times)[lanes, last]
    for entry, time, end in zip(entries, times, ends, strict=True):
        assert time == pytest.approx(entry["end_t"], abs=1e-9)
        expected = [entry[name] for name in ("end_y", "end_z", "end_vy", "end_vz")]
        np.testing.assert_allclose(end, expected, rtol=0, atol=2e-4)  # asked: 1e-3


def test_moments_are_the_published_ones(entries, falls):
    gliders, fallen = falls
    count = len(entries)
    last = np.asarray(fallen.last)[:count]
    states = np.asarray(fallen.states)[np.arange(count), last]
    gliders = jax.tree.map(lambda leaf: leaf[:count], gliders)

    def read(glider, state, time):
        velocity = jnp.stack([0 * time, state[2], state[3]])
        return loads(glider, velocity, time=time)

    times = jnp.asarray([entry["end_t"] for entry in entries])
    found = jax.jit(jax.vmap(read))(gliders, states, times)
    air, shape = over_phases(found.aerodynamic), over_phases(found.inertial)
    for name, values in (
        ("mean_moment_Nmm", air.mean),
        ("ptp_aero_Nmm", air.peak_to_peak),
        ("ptp_inertial_Nmm", shape.peak_to_peak),
    ):
        expected = np.array([entry[name] for entry in entries])
        np.testing.assert_allclose(1e3 * np.asarray(values), expected, rtol=0, atol=1e-4)
    ratio = np.array([e["ptp_inertial_Nmm"] for e in entries])
    ratio /= np.array([e["ptp_aero_Nmm"] for e in entries])
    np.testing.assert_allclose(found.inertial_ratio, ratio, rtol=1e-3)


def test_without_air_the_fall_is_ballistic(falls):
    _, fallen = falls
    time = math.sqrt(2 * 10 / 9.81)
    assert float(fallen.time[-1]) == pytest.approx(time, abs=1e-8)
    expected = [1.7 * time, 0.0, 1.7, -9.81 * time]
    np.testing.assert_allclose(fallen.state[-1], expected, atol=1e-7)
    # and the one record past the ground: on the parabola, below it
    after = 0.025 * math.ceil(time / 0.025)
    assert int(fallen.last[-1]) == math.ceil(time / 0.025)
    np.testing.assert_allclose(
        fallen.states[-1, int(fallen.last[-1])],
        [1.7 * after, 10 - 9.81 * after**2 / 2, 1.7, -9.81 * after],
        atol=1e-7,
    )


def test_records_run_to_the_first_one_past_the_ground(falls):
    _, fallen = falls
    states = np.asarray(fallen.states)
    assert (np.asarray(fallen.outcome) == Outcome.LANDED).all()
    for lane, last in zip(states, np.asarray(fallen.last), strict=True):
        assert (lane[:last, 1] >= 0).all()
        assert lane[last, 1] < 0
        assert np.isnan(lane[last + 1 :]).all()
        np.testing.assert_array_equal(lane[0], [0, 10, 1.7, 0])


@pytest.fixture(scope="module")
def glider():
    return Glider(Snake.from_svl(), Gait.from_degrees(), Polar.smooth())


@pytest.fixture(scope="module")
def held(glider):
    """One held glide of the smooth polar, with a speed of its own, and its loads."""
    fallen = fall(glider, Launch(6.0, 2.5), angles=(0.05, -0.1, 0.02), phases=5)
    return fallen, loads_along(fallen, 12), loads_at_end(fallen, 12)


def test_loads_are_of_one_held_glide(held):
    fallen = held[0]
    several = jax.tree.map(lambda x: jnp.stack([x, x]) if eqx.is_array(x) else x, fallen)
    for read in (loads_along, loads_at_end):
        for phases in (1, 3, 10**6, 12.0):
            with pytest.raises((ValueError, TypeError), match=f"^phases = {phases} is not"):
                read(fallen, phases)
        with pytest.raises(TypeError, match="fallen must be of type Fall, not None"):
            read(None)
        with pytest.raises(ValueError, match=r"fallen has shape \(2,\): it must be one"):
            read(several)


def test_records_and_end_are_one_trajectory(held):
    """Central differences of the recorded positions are the recorded velocities."""
    fallen, *_ = held
    times, last = np.asarray(fallen.times), int(fallen.last)
    states = np.asarray(fallen.states)[:last]
    speed = (states[2:, :2] - states[:-2, :2]) / (times[2:last] - times[: last - 2])[:, None]
    np.testing.assert_allclose(speed, states[1:-1, 2:], atol=2e-3)
    np.testing.assert_array_equal(states[0], [0, 6, 2.5, 0])
    assert float(fallen.time) - times[last - 1] < 0.025


def test_the_acceleration_is_the_phase_average_of_free_flight(held, glider):
    """Two ways: the held glide's curvature, and the free vector field at every phase."""
    fallen, *_ = held
    states, times = np.asarray(fallen.states), np.asarray(fallen.times)
    k = 20
    slope = (states[k + 1, 2:] - states[k - 1, 2:]) / (times[k + 1] - times[k - 1])
    state = jnp.zeros(13).at[4:6].set(states[k, 2:]).at[9:12].set(fallen.angles)
    sections = discretise(glider.body)
    phases = 2 * np.pi * np.arange(5) / 5
    rates = [
        six_degrees_of_freedom(0.0, state, Flight(glider, sections, phase)) for phase in phases
    ]
    np.testing.assert_allclose(slope, np.mean(rates, axis=0)[4:6], atol=5e-3)


def test_loads_along_are_loads_at_every_record(held, glider):
    fallen, along, end = held
    last = int(fallen.last)
    for k in (0, 30, last):
        velocity = jnp.array([0.0, *fallen.states[k, 2:]])
        at = loads(glider, velocity, fallen.angles, time=fallen.times[k], phases=12)
        for name in ("force", "aerodynamic", "inertial"):
            np.testing.assert_allclose(
                getattr(along, name)[k], getattr(at, name), rtol=1e-9, atol=1e-12
            )
    assert np.isnan(np.asarray(along.aerodynamic)[last + 1 :]).all()
    velocity = jnp.array([0.0, *fallen.state[2:]])
    at = loads(glider, velocity, fallen.angles, time=fallen.time, phases=12)
    np.testing.assert_allclose(end.aerodynamic, at.aerodynamic, rtol=1e-9, atol=1e-12)


def test_elements_add_up_and_moments_are_of_forces(glider):
    whole = loads(glider, MOVING, phases=12)
    parts = loads(glider, MOVING, phases=12, per_element=True)
    assert parts.force.shape == (12, 3, 70)
    for name in ("force", "aerodynamic", "inertial"):
        summed = np.asarray(getattr(parts, name)).sum(-1)
        np.testing.assert_allclose(getattr(whole, name), summed, rtol=1e-9, atol=1e-12)
    sections, j = discretise(glider.body), 7
    neck = glider.body.neck_fraction
    phase, rate = wave_phase(glider.gait, 2 * np.pi * j / 12, 0.0)
    body = backbone(sections, waves(glider.gait, neck, sections.fraction, phase, rate))
    moment = np.cross(np.asarray(body.position), np.asarray(parts.force[j]), axis=0)
    np.testing.assert_allclose(parts.aerodynamic[j], moment, atol=1e-12)


def test_the_inertial_moment_is_the_rate_of_angular_momentum(glider):
    """By central differences in time of sum m r x r' at the same launch phase."""
    found = np.asarray(loads(glider, MOVING, time=0.3, phases=12).inertial)
    sections = discretise(glider.body)
    neck = sections.neck_fraction

    def momentum(j, time):
        phase, rate = wave_phase(glider.gait, 2 * np.pi * j / 12, time)
        body = backbone(
            sections,
            waves(glider.gait, neck, sections.fraction, phase, rate),
        )
        return np.asarray(angular_momentum(sections, body))

    step = 1e-5
    for j in (0, 5, 11):
        slope = (momentum(j, 0.3 + step) - momentum(j, 0.3 - step)) / (2 * step)
        np.testing.assert_allclose(found[j], slope, rtol=1e-6, atol=1e-9)


def test_mean_roll_and_yaw_vanish_and_statistics_are_right(glider):
    values = loads(glider, MOVING, phases=60).aerodynamic
    stats = over_phases(values)
    assert np.abs(stats.mean[1:]).max() < 1e-12
    assert abs(float(stats.mean[0])) > 1e-5
    table = np.asarray(values)
    np.testing.assert_allclose(stats.mean, np.mean(table, axis=0), atol=1e-15)
    np.testing.assert_array_equal(stats.lowest, np.min(table, axis=0))
    np.testing.assert_array_equal(stats.highest, np.max(table, axis=0))
    np.testing.assert_array_equal(stats.peak_to_peak, np.ptp(table, axis=0))


# --- the glide polar -------------------------------------------------------------------


def test_lift_and_drag_are_the_force_along_and_across_the_path(glider):
    alpha, speed = np.deg2rad([20.0, 50.0]), 6.0
    found = body_polar(glider, speed, alpha, phases=12)
    for i, angle in enumerate(alpha):
        along = np.array([0, np.cos(angle), -np.sin(angle)])
        force = np.asarray(loads(glider, speed * along, phases=12).force).mean(axis=0)
        assert float(found.drag[i]) == pytest.approx(-force @ along, rel=1e-9)
        lift = force @ [0, np.sin(angle), np.cos(angle)]
        assert float(found.lift[i]) == pytest.approx(lift, rel=1e-9)
        assert float(found.lift_to_drag[i]) == pytest.approx(lift / -(force @ along))
        scale = 0.5 * 1.165 * speed**2 * float(discretise(glider.body).area.sum())
        assert float(found.lift_coefficient[i]) == pytest.approx(lift / scale)
        assert float(found.drag_coefficient[i]) == pytest.approx(-force @ along / scale)


def test_at_the_equilibrium_nothing_accelerates_and_lift_over_drag_is_cot_gamma(glider):
    steady = equilibrium(glider)
    assert bool(steady.found)
    v_y, v_z = map(float, steady.velocity)
    field = velocity_polar(glider, [v_y, 0.9 * v_y], [v_z])
    assert field.shape == (2, 1, 2)
    assert np.abs(field[0, 0]).max() < 1e-6
    assert np.abs(field[1, 0]).max() > 0.1
    gamma = float(steady.glide_angle)
    assert gamma == pytest.approx(math.atan2(-v_z, v_y))
    polar = body_polar(glider, math.hypot(v_y, v_z), gamma, phases=10)
    assert float(polar.lift_to_drag[0]) == pytest.approx(1 / math.tan(gamma), rel=1e-6)


@pytest.mark.slow
def test_a_long_held_glide_comes_to_the_stable_equilibrium(glider):
    steady = equilibrium(glider)
    assert bool(steady.stable)
    fallen = fall(glider, Launch(100.0, 5.0), max_time=40.0, interval=1.0)
    assert int(fallen.outcome) == Outcome.LANDED
    np.testing.assert_allclose(fallen.state[2:], steady.velocity, atol=0.02)


def test_of_several_equilibria_the_stable_shallow_one_is_given(glider):
    """At 7 degrees nose up there are five, from 25 degrees (stable) to 147."""
    steady = equilibrium(glider, np.deg2rad((0.0, 7.0, 0.0)))
    assert bool(steady.stable)
    assert 23 < np.rad2deg(float(steady.glide_angle)) < 27
    assert not bool(equilibrium(glider, np.deg2rad((0.0, 20.0, 0.0))).found)  # only backwards


def test_without_air_there_is_no_equilibrium(glider):
    bare = eqx.tree_at(lambda g: g.aerodynamics.polar, glider, Polar.smooth(0.0, 0.0))
    steady = equilibrium(bare)
    assert not bool(steady.found)
    assert not bool(steady.stable)
    assert np.isnan(np.asarray(steady.velocity)).all()


# --- wind ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def windy(glider):
    def blown(air):
        return eqx.tree_at(lambda g: g.air, glider, air)

    return blown


def test_a_held_glide_meets_the_wind_of_its_place(windy):
    """A wind that is the same all the way down but for the last tenth of a millimetre."""
    wind, low = [0.0, -2.0, 0.5], Launch(0.5, 1.7)
    shear = ShearWind(wind, reference_height=0.01, shear_exponent=0.0)
    there, everywhere = (fall(windy(air), low) for air in (shear, UniformWind(wind)))
    # near the ground parts of the body are in the air that rests
    early = there.states[:7], everywhere.states[:7]
    np.testing.assert_allclose(*early, rtol=0, atol=1e-9)
    read = [loads_along(one, phases=4).aerodynamic[4] for one in (there, everywhere)]
    assert np.abs(read[1]).max() > 1e-5
    np.testing.assert_allclose(*read, rtol=0, atol=1e-9)


def test_the_polar_of_a_body_knows_no_wind(windy, glider):
    blown = body_polar(windy(UniformWind([0.0, -2.0, 1.0])), 5.0, [0.3], phases=4)
    still = body_polar(glider, 5.0, [0.3], phases=4)
    np.testing.assert_array_equal(blown.lift_coefficient, still.lift_coefficient)


def test_a_body_of_ones_own_needs_nothing_but_its_sections(glider):
    class Bare(AbstractBody):
        snake: Snake

        def sections(self):
            return discretise(self.snake)

    bare = equilibrium(Glider(Bare(glider.body), glider.gait, glider.aerodynamics))
    assert float(bare.glide_angle) == float(equilibrium(glider).glide_angle)


# --- bad input -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda g: fall(g, angles=(0, 2, 0)), r"angles = 2 rad.*\(-1.48353, 1.48353\)"),
        (lambda g: fall(g, angles=(0, 0)), r"angles has shape \(2,\)"),
        (lambda g: fall(g, Launch(omega=(0, 0, 1))), "omega of the launch has no effect"),
        (lambda g: fall(g, phases=0), "phases = 0"),
        (lambda g: fall(g, interval=0.0), "interval = 0 s"),
        (lambda g: fall(g, max_time=-1), "max_time = -1 s"),
        (lambda g: fall(g, rtol=float("nan")), "rtol = nan"),
        (lambda g: loads(g, [0, 1]), r"velocity has shape \(2,\)"),
        (lambda g: loads(g, [0, 1, np.inf]), "velocity = inf m/s"),
        (lambda g: body_polar(g, 0.0, [0.1]), "speed = 0 m/s"),
        (lambda g: body_polar(g, 5.0, [4.0]), "angle_of_attack = 4 rad"),
        (lambda g: velocity_polar(g, [np.nan], [0]), "v_y = nan m/s"),
    ],
)
def test_bad_input_is_named(glider, call, message):
    with pytest.raises(ValueError, match=message):
        call(glider)


def test_a_fall_that_does_not_land_says_so(glider):
    fallen = fall(glider, Launch(10.0, 1.7), max_time=1.0)
    assert int(fallen.outcome) == Outcome.OUT_OF_TIME
    assert float(fallen.time) == pytest.approx(1.0)
    assert float(fallen.state[1]) > 4
    assert int(fallen.last) == 40


@pytest.mark.slow
@pytest.mark.parametrize("ask", ["equilibrium", "trim"])
def test_a_lane_without_an_answer_keeps_its_gradient_to_itself(ask):
    """No air at all, no gravity, not a number: nothing raises, the good lane is as alone."""

    def answer(p):
        gravity, psi_m, scale = p
        polar = Polar.smooth(scale, scale)
        gait = Gait(1.7, psi_m, 1.4, 1.2, 0.17)
        glider = Glider(Snake.from_svl(), gait, polar, gravity=gravity)
        if ask == "equilibrium":
            return equilibrium(glider, phases=4).velocity[0]
        launch, options = Launch(1.0, 1.7), {"phases": 4, "interval": 0.1, "max_time": 1.0}
        return trim(glider, launch=launch, points=2, **options).value

    gradient = jax.jit(jax.vmap(jax.grad(answer)))
    good = [9.81, 0.35, 1.0]
    lanes = [good, [9.81, 0.35, 0.0], [0.0, 0.35, 1.0], [9.81, np.nan, 1.0]]
    found = np.asarray(gradient(np.array(lanes)))
    np.testing.assert_array_equal(found[0], gradient(np.array([good] * 4))[0])
    assert np.isfinite(found[0]).all()
    assert np.abs(found[0]).max() > 0
