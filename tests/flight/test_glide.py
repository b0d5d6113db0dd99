"""Whole glides: against the published code, their ends, what they keep, and what may fail.

Compilation dominates: `fly` keeps a dense trajectory and `flock` runs ten lanes at once;
both compile once for most of this file.
"""

import dataclasses
import sys

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from jaxglide import (
    Gait,
    Glider,
    Ground,
    Launch,
    Outcome,
    Polar,
    Snake,
    discretise,
    elements,
    reconstruct,
    simulate,
    six_degrees_of_freedom,
)
from jaxglide.files.glides import glide_dataset
from jaxglide.flight.attitude import angle_rates
from jaxglide.flight.dynamics import ANGLES, OMEGA, PATH, POSITION, VELOCITY, Flight
from jaxglide.flight.ends import clearance, default_ends
from jaxglide.flight.extrapolation import extrapolation
from jaxglide.flight.peaks import PeakController, Peaks
from jaxglide.flight.solve import settings_of, solve

TIMES = 0.1 * np.arange(24)
LIMIT = np.deg2rad(85)


def fly(glider, launch=None, tolerance=1e-8, times=TIMES):
    """A glide with both kinds of trajectory kept."""
    return simulate(
        glider,
        launch,
        rtol=tolerance,
        atol=tolerance,
        times=times,
        dense=True,
        max_steps=4096,
    )


@pytest.fixture(scope="module")
def tumbling():
    """Gliders that lose control about each axis, by that outcome."""
    snake = Snake.from_svl()
    return {
        Outcome.UNSTABLE_YAW: Glider(snake, Gait.from_degrees(f_theta=0.0)),
        Outcome.UNSTABLE_PITCH: Glider(snake, Gait.from_degrees(nu_theta=1.0, d_psi=-20)),
        Outcome.UNSTABLE_ROLL: Glider(snake, Gait.from_degrees(nu_theta=1.5, d_psi=-20)),
    }


@pytest.fixture(scope="module")
def glide():
    """The published gait at 1e-8."""
    return fly(Glider(Snake.from_svl(), Gait.from_degrees()))


@pytest.fixture(scope="module")
def flight(glide):
    sections = jax.jit(discretise)(glide.glider.body)
    return Flight(glide.glider, sections, glide.take_off.phi_theta)


@jax.jit
def field(times, states, flight):
    return jax.vmap(six_degrees_of_freedom, (0, 0, None))(times, states, flight)


@pytest.mark.parametrize(("tolerance", "mm", "deg"), [(1e-8, 0.5, 0.05), (1e-6, 3, 0.15)])
@pytest.mark.parametrize("index", range(4))
def test_trajectories_match_the_published_code(index, tolerance, mm, deg, golden, glider_of):
    entry = golden("glides")[index]
    glide = fly(glider_of(entry), Launch(height=entry["height"]), tolerance)
    count = len(entry["t"])
    np.testing.assert_allclose(entry["t"], TIMES[:count], rtol=0, atol=1e-9)
    end = float(glide.time)
    assert entry["last_t"] - 0.0101 < end <= entry["last_t"]  # their first sample after it
    states = np.asarray(glide.states)[:count]
    flying = TIMES[:count] <= end
    assert flying.sum() >= count - 1
    error = (states[:, POSITION] - entry["position"])[flying]
    assert 1e3 * np.abs(error).max() < mm
    error = (np.rad2deg(states[:, ANGLES]) - entry["yaw_pitch_roll_deg"])[flying]
    assert np.abs(error).max() < deg
    tumbled = np.abs(entry["last_angles_deg"]) > 85
    expected = 1 + np.argmax(tumbled) if tumbled.any() else Outcome.LANDED
    assert int(glide.outcome) == expected


def test_landing_is_exact(glide):
    assert int(glide.outcome) == Outcome.LANDED
    assert bool(glide.stable)
    assert abs(float(glide.state[2])) < 1e-10
    np.testing.assert_array_equal(glide.landing_point, glide.state[POSITION])
    assert float(glide.height_lost) == pytest.approx(10.0, abs=1e-10)
    v = glide.state[VELOCITY]
    assert float(glide.glide_angle) == pytest.approx(np.arctan2(-v[2], np.hypot(v[0], v[1])))
    assert (np.asarray(glide.max_angles) < LIMIT).all()
    # The end is the point of the trajectory at the end's time, and not before the ground.
    np.testing.assert_allclose(glide.at(glide.time[None])[0], glide.state, rtol=0, atol=1e-11)
    assert glide.at(glide.sample_times(400))[:-1, 2].min() > 0


@pytest.mark.parametrize("outcome", [1, 2, 3])
def test_loss_of_control_is_exact(outcome, tumbling):
    glide = fly(tumbling[outcome])
    axis = outcome - 1
    assert int(glide.outcome) == outcome
    assert not bool(glide.stable)
    angles = np.abs(glide.end_angles)
    assert angles[axis] == pytest.approx(LIMIT, abs=1e-10)
    assert np.delete(angles, axis).max() < LIMIT
    assert float(glide.state[2]) > 0.5
    assert float(glide.max_angles[axis]) == pytest.approx(LIMIT, abs=1e-10)
    before = glide.at(glide.sample_times(400))[:-1, ANGLES]
    assert np.abs(before).max() < LIMIT
    assert "unstable in " + ("yaw", "pitch", "roll")[axis] in str(glide)


@pytest.mark.parametrize(("tolerance", "deg"), [(1e-4, 0.01), (1e-6, 1e-3), (1e-8, 1e-5)])
def test_largest_angles_are_those_of_the_whole_trajectory(tolerance, deg, tumbling):
    gliders = [
        Glider(Snake.from_svl(), Gait.from_degrees(nu_theta=1.1, d_psi=0)),
        tumbling[Outcome.UNSTABLE_ROLL],
        Glider(Snake.from_svl(), Gait.from_degrees()),
    ]
    for glider in gliders:
        glide = fly(glider, tolerance=tolerance)
        dense = np.abs(glide.at(glide.sample_times(20_000))[:, ANGLES])
        end = np.abs(glide.end_angles)
        np.testing.assert_allclose(
            np.rad2deg(glide.max_angles), np.rad2deg(dense.max(axis=0)), rtol=0, atol=deg
        )
        assert (glide.max_angles >= end).all()
    # an angle whose peak lies inside the flight, so that it had to be found there
    assert (dense.max(axis=0) > end + np.deg2rad(1)).any()


def test_largest_angles_between_two_steps():
    """`Peaks` on random cubics: values and rates at both ends, extremes between them."""
    rng = np.random.default_rng(8)
    angles, rates = rng.uniform(-1.2, 1.2, (2, 300, 3)), rng.uniform(-5, 5, (2, 300, 3))
    rates[:, :50] *= 1e-3  # nearly straight
    times = 0.3, 1.1

    def state(angles, rates):
        turning = jax.jacfwd(lambda omega: angle_rates(angles, omega))(jnp.zeros(3))
        omega = jnp.linalg.solve(turning, rates)
        return jnp.zeros(13).at[OMEGA].set(omega).at[ANGLES].set(angles)

    @jax.jit
    @jax.vmap
    def largest(angles, rates):
        start, end = (state(a, r) for a, r in zip(angles, rates, strict=True))
        return Peaks.start(times[0], start).upto(times[1], end)

    found = largest(angles.swapaxes(0, 1), rates.swapaxes(0, 1))
    x = np.linspace(0, 1, 5001)[:, None, None]
    h = times[1] - times[0]
    cubic = (
        angles[0] * (1 + 2 * x) * (1 - x) ** 2
        + angles[1] * (3 - 2 * x) * x**2
        + h * rates[0] * x * (1 - x) ** 2
        - h * rates[1] * x**2 * (1 - x)
    )
    expected = np.abs(cubic).max(axis=0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)
    assert (expected > np.abs(angles).max(axis=0) + 0.1).mean() > 0.2  # peaks lie between


@jax.jit
@jax.vmap
def swing(pitch, dip):
    """A body that nods to `pitch` [rad] and dips by `dip` [m] from 1 m, both as a sine of t."""

    def field(t, y, _):
        nod = jnp.zeros(13).at[ANGLES.start + 1].set(y[OMEGA][0])
        nod = nod.at[OMEGA.start].set(-pitch * jnp.sin(t))
        return nod.at[2].set(y[5]).at[5].set(dip * jnp.sin(t))

    def nearest(t, y, args, **_):
        return jnp.min(clearance(default_ends(), t, y))

    start = jnp.zeros(13).at[2].set(1.0).at[5].set(-dip).at[OMEGA.start].set(pitch)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(field),
        diffrax.Dopri5(),
        0.0,
        3.0,
        0.01,
        start,
        saveat=diffrax.SaveAt(t1=True, controller_state=True),
        stepsize_controller=PeakController(
            diffrax.PIDController(1e-10, 1e-10, dtmax=0.05), default_ends()
        ),
        event=diffrax.Event(nearest, optx.Bisection(1e-12, 1e-12, flip=True), False),
        throw=False,
    )
    peaks = solution.controller_state[1]
    time, state = solution.ts[0], solution.ys[0]
    return time, peaks.upto(time, state), solution.stats["num_steps"]


def test_a_limit_that_is_only_grazed_ends_the_flight():
    """Peaks that pass a limit for less than a step, and such as just do not."""
    over = np.linspace(-2e-5, 2e-5, 101)[np.arange(101) != 50]
    over = np.concatenate([over, over / 4])
    none, past = 0 * over, over > 0
    time, largest, steps = swing(LIMIT * (1 + over), none)
    crossing = np.arcsin(np.minimum(1 / (1 + over), 1))
    np.testing.assert_allclose(time[past], crossing[past], rtol=0, atol=2e-5)
    np.testing.assert_array_equal(time[~past], 3.0)
    assert largest.max() < LIMIT + 2e-10
    time, _, more = swing(none, 1 + over)
    np.testing.assert_allclose(time[past], crossing[past], rtol=0, atol=2e-5)
    np.testing.assert_array_equal(time[~past], 3.0)
    usual = swing(np.full(1, 0.5), np.full(1, 0.5))[2]
    assert max(steps.max(), more.max()) <= 1.5 * usual[0]  # cut, not crept up to


@pytest.mark.slow
@pytest.mark.parametrize(
    ("nu_theta", "d_psi"), [(1.0, 19.622), (1.1, -5.46807), (1.0, -4.20442)]
)
def test_the_outcome_agrees_with_the_largest_angles(nu_theta, d_psi):
    """Families of glides in which an angle comes to 85 degrees and turns back."""

    @jax.jit
    @jax.vmap
    def family(d_psi, speed):
        gait = Gait.from_degrees(nu_theta=nu_theta, d_psi=d_psi)
        return simulate(Glider(Snake.from_svl(), gait), Launch(speed=speed))

    count = 281
    glides = family(d_psi + np.linspace(-0.003, 0.003, count), np.full(count, 0.48))
    largest, outcome = np.asarray(glides.max_angles), np.asarray(glides.outcome)
    assert largest.max() < LIMIT + 2e-10
    ended = largest.argmax(axis=1) + 1
    np.testing.assert_array_equal(outcome, np.where(outcome == 0, 0, ended))
    assert set(outcome) >= {0}
    assert 20 < (outcome == 0).sum() < count - 20  # on both sides of the limit
    unstable = np.asarray(glides.time)[outcome > 0]
    assert unstable.max() < np.asarray(glides.time)[outcome == 0].min() - 0.1


def test_path_length_is_the_integral_of_horizontal_speed(glide):
    t = np.asarray(glide.sample_times(20_001))
    velocity = np.asarray(glide.at(t))[:, VELOCITY]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    simpson = np.ones(t.size)
    simpson[1:-1:2], simpson[2:-1:2] = 4, 2
    length = speed @ simpson * t[1] / 3
    assert float(glide.path_length) == pytest.approx(length, abs=1e-6)
    assert float(glide.path_length) > np.hypot(*np.asarray(glide.landing_point)[:2]) + 0.01


def test_the_trajectory_solves_the_equations(glide, flight):
    t = np.linspace(0.05, float(glide.time) - 0.05, TIMES.size)
    h = 1e-4
    slope = (glide.at(t + h) - glide.at(t - h)) / (2 * h)
    rates = field(t, glide.at(t), flight)
    assert (np.abs(slope - rates) / np.abs(rates).max(axis=0)).max() < 2e-3


def test_times_and_dense_agree(glide):
    flying = float(glide.time) >= TIMES
    assert 10 < flying.sum() < TIMES.size
    np.testing.assert_allclose(
        glide.at(TIMES[flying]), glide.states[flying], rtol=0, atol=1e-12
    )
    np.testing.assert_array_equal(glide.states[0], glide.take_off.state)
    np.testing.assert_array_equal(glide.times, TIMES)


def test_after_the_end_there_is_nothing(glide):
    flying = float(glide.time) >= TIMES
    assert np.isfinite(glide.states[flying]).all()
    assert np.isnan(glide.states[~flying]).all()
    end = float(glide.time)
    outside = glide.at([-1e-9, 0.0, end, end + 1e-9, 100.0])
    assert np.isnan(outside).all(axis=1).tolist() == [True, False, False, True, True]


def test_a_time_at_the_very_end_is_kept(glide):
    end = float(glide.time)
    times = np.append(TIMES[:22], [end, np.nextafter(end, 9)])
    again = fly(glide.glider, times=times)
    np.testing.assert_allclose(again.states[22], glide.state, rtol=0, atol=1e-10)
    assert np.isnan(again.states[23]).all()


def test_steps_are_counted(glide):
    ends = np.asarray(glide.interpolation.ts)
    assert int(glide.accepted) == np.isfinite(ends).sum() - 1
    assert 0 < int(glide.rejected) < int(glide.accepted)
    coarse = fly(glide.glider, tolerance=1e-4)
    assert 20 < int(coarse.accepted) < int(glide.accepted) / 4


def test_a_glide_prints_its_numbers(glide):
    text = str(glide)
    assert text.startswith("Glide from 10 m: landed after 2.24")
    x, y, _ = (float(v) for v in glide.landing_point)
    for expected in (
        f"x {x:.4f}   y {y:.4f}",
        f"{float(glide.path_length):.4f} m horizontally",
        f"{float(glide.take_off.phi_theta):.6f} rad",
        f"{np.rad2deg(float(glide.end_angles[1])):.3f}",
        f"{np.rad2deg(float(glide.max_angles[2])):.3f}",
        f"{int(glide.accepted)} accepted, {int(glide.rejected)} rejected",
    ):
        assert expected in text
    assert max(len(line) for line in text.splitlines()) < 80


def test_changed_values_compile_nothing(glide, monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("traced again")

    fly(glide.glider)
    monkeypatch.setattr(sys.modules["jaxglide.flight.glide"], "_fly_either_mode", refuse)
    snake = Snake.from_svl(0.8, mass=0.05, neck_fraction=np.float32(0.07))
    other = Glider(
        snake, Gait.from_degrees(theta_m=100, nu_theta=1), Polar.published(1.36, 0.6)
    )
    changed = fly(other, Launch(height=7), tolerance=1e-7, times=TIMES + 0.01)
    assert float(changed.height_lost) == pytest.approx(7.0, abs=1e-9)
    with pytest.raises(AssertionError, match="traced again"):
        simulate(other, max_steps=4095)


def test_nothing_calls_back_to_python():
    """JAX does not keep what does in its cache of compiled code: every start would compile."""

    def ended(time):
        given = dict.fromkeys(("times", "solver", "step"))
        settings = settings_of(
            rtol=1e-6,
            atol=1e-6,
            max_time=time,
            ends=Ground(),
            max_steps=9,
            dense=False,
            **given,
        )
        start = jnp.zeros(13).at[2].set(1.0)
        fall = lambda t, y, args: 0 * y  # noqa: E731
        return solve(fall, start, jnp.zeros(()), None, settings, diffrax.ForwardMode()).time

    assert "callback" not in str(jax.make_jaxpr(ended)(1.0))


def test_a_straight_body_flies():
    """It only pitches, and how much inertia it has about its own axis does not matter."""
    straight = Gait.from_degrees(0, 0, d_psi=0)
    thin, flat = (fly(Glider(Snake.from_svl(gyration=g), straight)) for g in (1e-3, 0.25))
    assert int(thin.outcome) == Outcome.LANDED
    assert abs(float(thin.state[0])) < 1e-9
    assert np.asarray(thin.max_angles)[[0, 2]].max() < 1e-9
    assert float(thin.max_angles[1]) > 0.2
    np.testing.assert_allclose(flat.state, thin.state, rtol=0, atol=1e-7)


# --- reconstruct -----------------------------------------------------------------------


def test_reconstruction_is_consistent_with_the_motion(glide, flight):
    times = np.linspace(0, float(glide.time), TIMES.size)
    now = jax.tree.map(np.asarray, reconstruct(glide, times))
    states = np.asarray(glide.at(times))
    rates = np.asarray(field(times, states, flight))
    air, mass = now.aerodynamics, float(glide.glider.body.mass)
    force_I = np.einsum("nji,njk->ni", now.R_BI, air.force)
    acceleration = rates[:, VELOCITY] + [0, 0, 9.81]
    np.testing.assert_allclose(force_I, mass * acceleration, rtol=0, atol=1e-13)
    moment = np.cross(now.body.position, air.force, axis=1)
    np.testing.assert_allclose(now.moment, moment, rtol=0, atol=1e-15)
    assert air.angle_of_attack.shape == (TIMES.size, 70)
    assert np.abs(air.angle_of_attack).max() <= np.pi / 2
    reynolds = air.speed * np.asarray(flight.sections.chord) / 1.568e-5
    np.testing.assert_allclose(air.reynolds, reynolds, rtol=1e-13)
    normal_speed = np.sqrt(2 * air.dynamic_pressure / 1.165)
    np.testing.assert_allclose(np.cos(air.sweep_angle) * air.speed, normal_speed, rtol=1e-9)
    magnitude = np.linalg.norm(air.force, axis=1)
    np.testing.assert_allclose(np.hypot(air.lift, air.drag), magnitude, rtol=1e-9)
    # the elements' momenta add up to the body's
    weighted = now.air_velocity * np.asarray(flight.sections.mass)
    momentum = np.einsum("nji,njk->ni", now.R_BI, weighted)
    np.testing.assert_allclose(momentum, mass * states[:, VELOCITY], rtol=0, atol=1e-14)


def test_extrapolation_counts_body_and_time_beyond_the_measurements(glide, flight):
    shares = extrapolation(glide, TIMES.size)
    air = reconstruct(glide, np.linspace(0, float(glide.time), TIMES.size)).aerodynamics
    angle, reynolds = np.rad2deg(air.angle_of_attack), np.asarray(air.reynolds)
    slow, fast, steep = reynolds < 3000, reynolds > 15000, (angle < -10) | (angle > 60)
    # nodes 1 cm apart all stand for as much of the body
    assert shares.reynolds == pytest.approx((slow | fast).mean())
    assert shares.angle_of_attack == pytest.approx(steep.mean())
    assert shares.either == pytest.approx((slow | fast | steep).mean())
    assert 0.1 < shares.angle_of_attack < shares.either < 1
    assert f"{100 * shares.either:.0f} % of body and flight lies beyond" in str(shares)
    thin = eqx.tree_at(lambda g: g.glider.air.kinematic_viscosity, glide, 1e-9)
    assert extrapolation(thin).reynolds == pytest.approx(1.0)
    assert extrapolation(thin).either == pytest.approx(1.0)


def test_reconstruction_at_the_times_asked_for(glide, flight):
    kept = reconstruct(glide)
    flying = float(glide.time) >= TIMES
    direct = jax.jit(elements)(TIMES[7], glide.states[7], flight)
    for value, expected in zip(jax.tree.leaves(kept), jax.tree.leaves(direct), strict=True):
        np.testing.assert_allclose(value[7], expected, rtol=1e-9, atol=1e-12)
    force = np.asarray(kept.aerodynamics.force)
    assert np.isfinite(force[flying]).all()
    assert np.isnan(force[~flying]).all()


@pytest.mark.slow
def test_reconstruction_inside_transformations(glide):
    """Under jit, vmap and jacfwd times are not known: the same there, NaN outside."""
    times = np.linspace(0, float(glide.time), TIMES.size)

    def lift(times):
        return reconstruct(glide, times).aerodynamics.lift

    expected = lift(times)
    np.testing.assert_allclose(jax.jit(lift)(times), expected, rtol=0, atol=1e-12)
    both = jax.vmap(lift)(np.stack([times, times + 0.01]))
    np.testing.assert_allclose(both[0], expected, rtol=0, atol=1e-12)
    assert np.isnan(both[1, -1]).all()
    assert np.isfinite(both[1, :-1]).all()
    inner, h = times[5:7], 1e-5
    slope = jax.jacfwd(lambda shift: lift(inner + shift))(0.0)
    difference = (lift(inner + h) - lift(inner - h)) / (2 * h)
    np.testing.assert_allclose(slope, difference, rtol=0, atol=1e-4 * np.abs(slope).max())


def test_a_dense_trajectory_has_room_for_the_flight_only(glide):
    """Not for all of the steps it might have taken."""
    room = glide.interpolation.ts.size
    assert int(glide.accepted) < room < 1100
    assert sum(x.nbytes for x in jax.tree.leaves(glide.interpolation)) < 2e6
    assert glide.settings.max_steps == 4096


@pytest.mark.parametrize(
    ("steps", "most", "tried"),
    [
        (10, 100_000, [1024]),
        (1025, 100_000, [1024, 8192]),
        (10**6, 100_000, [1024, 8192, 65536, 100_000]),
        (10**6, 500, [500]),
    ],
)
def test_room_grows_with_the_flight_up_to_the_most(steps, most, tried, glide, monkeypatch):
    rooms = []

    def solve(glider, launch, settings, adjoint):
        rooms.append(settings.max_steps)
        short = steps > settings.max_steps
        outcome = Outcome.OUT_OF_STEPS if short else Outcome.LANDED
        return dataclasses.replace(glide, settings=settings, outcome=outcome)

    monkeypatch.setattr(sys.modules["jaxglide.flight.glide"], "_simulate", solve)
    found = simulate(glide.glider, dense=True, max_steps=most)
    assert rooms == tried
    assert found.settings.max_steps == most
    assert (found.outcome == Outcome.OUT_OF_STEPS) == (steps > most)


# --- many lanes ------------------------------------------------------------------------

COUNT = 10
MAX_TIME, MAX_STEPS = 2.3, 600
GOOD = [0, 1, 6, 9]
TRACES = []


@jax.jit
@jax.vmap
def flock(gait, lift_scale, launch, tolerance):
    TRACES.append(1)
    glider = Glider(Snake.from_svl(), gait, Polar.smooth(lift_scale))
    return simulate(
        glider, launch, rtol=tolerance, atol=tolerance, max_time=MAX_TIME, max_steps=MAX_STEPS
    )


def lanes(bad=True):
    """Arguments of `flock`: good glides in lanes `GOOD`; elsewhere bad ones, or copies of 0.

    The modules are filled leaf by leaf, since their constructors refuse what is bad here.
    """
    columns = {
        "theta_m": np.deg2rad(96.48753),
        "psi_m": np.deg2rad(20.0),
        "nu_theta": 1.4,
        "f_theta": 1.2,
        "d_psi": np.deg2rad(10.0),
        "d_theta": 0.0,
        "height": 10.0,
        "speed": 1.7534,
        "phi_theta": -0.028,
        "lift": 1.0,
        "tolerance": 1e-6,
    }
    c = {name: np.full(COUNT, value) for name, value in columns.items()}
    angles = np.tile(np.deg2rad([-0.22, -4.56, -4.53]), (COUNT, 1))
    for name, value in (
        ("theta_m", 1.98),
        ("nu_theta", 1.1),
        ("d_psi", 0),
        ("phi_theta", -0.28),
    ):
        c[name][1] = value
    c["height"][6] = 1e-9  # a start all but on the ground
    c["f_theta"][9] = 0.0
    if bad:
        c["psi_m"][2] = np.nan
        c["height"][3] = 14.0  # out of time
        c["tolerance"][4] = 1e-13  # out of steps
        angles[5] = [1.6, 0.1, 0.2]  # beyond 85 degrees before it starts
        c["speed"][7] = np.nan
        c["lift"][8] = np.nan

    def fill(module, names, *arrays):
        values = [jnp.asarray(c[name]) for name in names] + list(arrays)
        leaves, structure = jax.tree.flatten(module)
        assert len(leaves) == len(values)
        return jax.tree.unflatten(structure, values)

    gait = fill(Gait.from_degrees(), list(columns)[:6])
    launch = Launch(1.0, 1.0, 0.0, np.zeros(3))
    level = jnp.zeros(len(angles))
    launch = fill(launch, ("height", "speed", "phi_theta"), jnp.asarray(angles), level, level)
    return gait, c["lift"], launch, c["tolerance"]


@pytest.fixture(scope="module")
def mixed():
    return flock(*lanes())


def test_every_way_to_end_is_told_and_none_raises(mixed):
    expected = {
        0: Outcome.LANDED,
        1: Outcome.LANDED,
        2: Outcome.NON_FINITE,
        3: Outcome.OUT_OF_TIME,
        4: Outcome.OUT_OF_STEPS,
        5: Outcome.UNSTABLE_YAW,
        6: Outcome.LANDED,
        7: Outcome.NON_FINITE,
        8: Outcome.NON_FINITE,
        9: Outcome.UNSTABLE_YAW,
    }
    assert dict(enumerate(map(Outcome, np.asarray(mixed.outcome)))) == expected
    steps = np.asarray(mixed.accepted + mixed.rejected)
    assert float(mixed.time[3]) == MAX_TIME
    assert 3 < float(mixed.state[3, 2]) < 5
    assert steps[4] == MAX_STEPS
    assert 0 < float(mixed.time[4]) < MAX_TIME
    assert float(mixed.time[5]) == 0
    np.testing.assert_array_equal(mixed.state[5], mixed.take_off.state[5])
    assert steps[[2, 5, 7, 8]].max() < 60  # hopeless lanes do not keep the others waiting
    assert steps[np.array(GOOD)].max() < 300


def test_bad_lanes_do_not_disturb_their_neighbours(mixed):
    clean = flock(*lanes(bad=False))
    for name in ("outcome", "time", "state", "max_angles", "accepted", "rejected"):
        value, expected = (np.asarray(getattr(glide, name))[GOOD] for glide in (mixed, clean))
        np.testing.assert_array_equal(value, expected)
    assert int(clean.outcome[2]) == Outcome.LANDED
    np.testing.assert_array_equal(clean.state[2], clean.state[0])


@pytest.mark.parametrize(("lane", "tolerance"), [(9, 1e-10), (1, 2e-3)])
def test_lanes_are_the_single_glides(lane, tolerance, mixed):
    """The frozen glide to round-off. The other takes steps of its own: which ones are accepted
    amplifies round-off, so that only the solver's accuracy is left to compare."""
    gait, _, launch, _ = jax.tree.map(lambda x: x[lane], lanes())
    alone = simulate(
        Glider(Snake.from_svl(), gait, Polar.smooth()),
        launch,
        max_time=MAX_TIME,
        max_steps=MAX_STEPS,
    )
    assert int(alone.outcome) == int(mixed.outcome[lane])
    assert float(alone.time) == pytest.approx(float(mixed.time[lane]), abs=tolerance)
    np.testing.assert_allclose(alone.state, mixed.state[lane], rtol=0, atol=tolerance)
    if lane == 9:
        assert int(alone.accepted) == int(mixed.accepted[lane])


def test_a_start_just_above_the_ground_lands_at_once(mixed, flight):
    """Free fall from h: t = sqrt(2h/g), with the air's force at the start."""
    start, time = mixed.take_off, float(mixed.time[6])
    glider = eqx.tree_at(lambda g: g.aerodynamics.polar, flight.glider, Polar.smooth())
    rates = six_degrees_of_freedom(
        0.0, start.state[6], Flight(glider, flight.sections, start.phi_theta[6])
    )
    assert time == pytest.approx(np.sqrt(-2e-9 / float(rates[5])), rel=1e-3)
    assert abs(float(mixed.state[6, 2])) < 1e-10
    assert float(mixed.path_length[6]) == pytest.approx(1.7534 * time, rel=1e-6)


def test_a_batch_is_not_taken_for_one_glide(mixed):
    assert mixed.sample_times(3).shape == (COUNT, 3)
    np.testing.assert_array_equal(mixed.sample_times(3)[:, -1], mixed.time)
    with pytest.raises(ValueError, match=r"holds glides of shape \(10,\): take one"):
        reconstruct(mixed, [0.1])
    with pytest.raises(ValueError, match=r"holds glides of shape \(10,\): take one"):
        glide_dataset(mixed)


def test_a_batch_prints_a_summary(mixed):
    text = str(mixed)
    assert text.startswith(f"{COUNT} glides")
    words = [line.rsplit(maxsplit=1) for line in text.splitlines()[1:]]
    assert {what.strip(): int(count) for what, count in words} == {
        "landed": 3,
        "unstable in yaw": 2,
        "ran out of time": 1,
        "ran out of steps": 1,
        "not finite": 3,
    }


def test_a_batch_is_traced_once(mixed):
    count = len(TRACES)
    gait, lift, launch, tolerance = lanes()
    flock(
        gait, 1.1 * lift, eqx.tree_at(lambda x: x.height, launch, launch.height / 2), tolerance
    )
    assert len(TRACES) == count == 1


# --- options ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("extra", "outcome"), [(1e-6, Outcome.LANDED), (-1e-6, Outcome.OUT_OF_TIME)]
)
def test_the_longest_flight_may_end_just_after_or_before_the_landing(
    extra, outcome, smooth_glider, fixed_launch
):
    """A final step cut to fit, then rejected, must not be tried for ever."""
    tight = {"rtol": 1e-8, "atol": 1e-8}
    free = simulate(smooth_glider, fixed_launch, **tight)
    max_time = float(free.time) + extra
    cut = simulate(smooth_glider, fixed_launch, max_time=max_time, **tight)
    assert int(cut.outcome) == outcome
    assert int(cut.accepted + cut.rejected) <= int(free.accepted + free.rejected) + 5
    if outcome == Outcome.LANDED:
        assert float(cut.time) == pytest.approx(float(free.time), abs=1e-8)
        assert abs(float(cut.state[2])) < 1e-10
    else:
        assert float(cut.time) == max_time
        assert float(cut.state[2]) == pytest.approx(-float(free.state[5]) * 1e-6, rel=1e-2)


def test_another_solver_gives_the_same_glide(smooth_glider, fixed_launch):
    tight = {"rtol": 1e-11, "atol": 1e-11}
    dopri5 = simulate(smooth_glider, fixed_launch, **tight)
    tsit5 = simulate(smooth_glider, fixed_launch, solver=diffrax.Tsit5(), **tight)
    assert int(dopri5.outcome) == int(tsit5.outcome) == Outcome.LANDED
    np.testing.assert_allclose(tsit5.state, dopri5.state, rtol=0, atol=1e-7)
    assert int(tsit5.accepted) != int(dopri5.accepted)


def test_a_fixed_step_is_kept(smooth_glider, fixed_launch):
    fixed = simulate(smooth_glider, fixed_launch, step=0.01)
    free = simulate(smooth_glider, fixed_launch, rtol=1e-10, atol=1e-10)
    assert int(fixed.outcome) == Outcome.LANDED
    assert int(fixed.accepted) == np.ceil(float(fixed.time) / 0.01)
    assert int(fixed.rejected) == 0
    assert abs(float(fixed.state[2])) < 1e-10
    np.testing.assert_allclose(fixed.landing_point, free.landing_point, rtol=0, atol=1e-3)


def test_what_was_not_kept_is_refused(mixed, glide):
    plain = jax.tree.map(lambda x: x[0], mixed)
    with pytest.raises(ValueError, match="dense=True"):
        plain.at([0.1])
    with pytest.raises(ValueError, match="give times"):
        reconstruct(plain)
    with pytest.raises(ValueError, match="dense=True"):
        reconstruct(plain, [0.1])
    with pytest.raises(ValueError, match=r"times = 3 s .*\[0, 2.24"):
        reconstruct(glide, [0.1, 3.0])


def test_float32_with_a_tight_tolerance_warns():
    with jax.enable_x64(False):
        glider = Glider(Snake.from_svl(), Gait.from_degrees())
        with pytest.warns(UserWarning, match="jax_enable_x64"):
            jax.eval_shape(lambda: simulate(glider, rtol=1e-6, atol=1e-6).state)


def test_state_is_named_by_its_slices(glide):
    state = np.asarray(glide.state)
    parts = [state[POSITION], state[VELOCITY], state[OMEGA], state[ANGLES], state[PATH:]]
    np.testing.assert_array_equal(np.concatenate(parts), state)
    np.testing.assert_array_equal(glide.velocity, state[VELOCITY])
    np.testing.assert_array_equal(glide.end_angles, state[ANGLES])
    assert float(glide.path_length) == state[PATH]
