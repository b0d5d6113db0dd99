"""Flight under control: the plant, the environment, the regulator, the actuators' work."""

import dataclasses
import warnings
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.integrate import simpson

from jaxglide import (
    AngleLimit,
    Case,
    Gait,
    Glider,
    Ground,
    Launch,
    Outcome,
    Polar,
    Snake,
    integrate,
    simulate,
    steady_glide,
)
from jaxglide.control import (
    Constant,
    Environment,
    Senses,
    actuated,
    controlled_flight,
    linear_quadratic,
)
from jaxglide.control.gym import GlideEnv, GlideVectorEnv
from jaxglide.control.plant import INPUTS, Plant
from jaxglide.control.regulator import filter_gains, riccati
from jaxglide.control.sampled import YAW, controlled_state, flight_state, next_state
from jaxglide.control.work import actuator_power, energy
from jaxglide.flight.dynamics import RIGID, Flight, with_own_states

CHOSEN = (INPUTS.index("d_psi"), INPUTS.index("d_theta"))


def glider_of(**gait) -> Glider:
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    return Glider(body, Gait.from_degrees(**{"d_psi": 5, **gait}), Polar.smooth())


@pytest.fixture(scope="module")
def seeing() -> Environment:
    """The default gait from 75 m, sensed exactly."""
    case = Case(glider_of(), Launch(height=75.0))
    return Environment(case, senses=Senses(velocity=True))


@pytest.fixture(scope="module")
def glide(seeing):
    return steady_glide(seeing.held, phase=float(seeing.plant.flight.phase))


@pytest.fixture(scope="module")
def regulator(seeing, glide):
    return linear_quadratic(seeing, glide)


def test_a_plant_that_is_told_nothing_new_flies_the_gait():
    """Sampled, by equal steps: where `simulate` lands, and on the order of the solver."""
    glider, launch = glider_of(), Launch(height=3.0)
    known = simulate(glider, launch, rtol=1e-10, atol=1e-10)
    apart = []
    for step in (1 / 30, 1 / 60):
        environment = Environment(Case(glider, launch), step=step)
        flown = controlled_flight(
            environment, Constant(environment.plant.inputs), jax.random.key(0), 40
        )
        assert flown.ended.outcome == Outcome.LANDED
        assert abs(float(flown.ended.state[2])) < 1e-9
        apart.append(np.abs(np.asarray(flown.ended.state[:RIGID] - known.state)).max())
        np.testing.assert_allclose(flown.ended.time, known.time, rtol=0, atol=1e-4)
    assert apart[1] < 1e-4  # kinks of the forces, not the order, are what is left
    assert apart[0] > 2 * apart[1]


def test_the_regulators_system_is_the_return_map(seeing, glide, regulator):
    """Without control its multipliers are those of the steady glide, and one of the yaw."""
    A = np.eye(regulator.linear.A.shape[1])
    for one in np.asarray(regulator.linear.A):
        A = one @ A
    found = np.sort(np.abs(np.linalg.eigvals(A)))[::-1]
    np.testing.assert_allclose(found[0], glide.spectral_radius, rtol=3e-3)
    known = np.sort(np.abs(np.append(np.asarray(glide.multipliers), 1.0)))[::-1]
    np.testing.assert_allclose(found[1:5], known[1:5], rtol=3e-3)


def test_the_system_is_the_differences_of_the_flight(seeing, regulator):
    linear, plant = regulator.linear, seeing.plant
    x, held = linear.states[2], plant.inputs[jnp.array(CHOSEN)]
    time = 2 * plant.interval
    rng, small = np.random.default_rng(0), 1e-5
    dx = jnp.asarray(rng.normal(size=x.shape))
    du = jnp.asarray(rng.normal(size=2))
    ends = [next_state(x + s * dx, held + s * du, time, plant, CHOSEN) for s in (small, -small)]
    differences = (ends[0] - ends[1]) / (2 * small)
    np.testing.assert_allclose(
        linear.A[2] @ dx + linear.B[2] @ du, differences, rtol=1e-6, atol=1e-6
    )


def test_riccati_is_the_cheapest_of_all_gains(regulator):
    """Its cost of a disturbance is that of the flight under it, and other gains cost more."""
    linear = jax.tree.map(np.asarray, regulator.linear)
    n, c = linear.A.shape[1], linear.B.shape[2]
    Q, R = np.eye(n), 2.0 * np.eye(c)
    gains = riccati(linear, Q, R)
    assert np.abs(gains.multipliers[0]) < 1
    start = np.random.default_rng(1).normal(size=n)

    def cost(K):
        x, total = start, 0.0
        for k in range(400):
            j = k % len(linear.A)
            u = -K[j] @ x
            total += x @ Q @ x + u @ R @ u
            x = linear.A[j] @ x + linear.B[j] @ u
        return total

    least = cost(gains.K)
    np.testing.assert_allclose(least, start @ gains.P @ start, rtol=1e-9)
    for seed in range(4):
        other = gains.K * (1 + 0.02 * np.random.default_rng(seed).normal(size=gains.K.shape))
        assert cost(other) > least


def test_an_observer_that_cannot_see_velocity_settles(regulator):
    linear = jax.tree.map(np.asarray, regulator.linear)
    n = linear.A.shape[1]
    L = filter_gains(linear, np.full(n - 3, 1e-4), np.full(n, 1e-3))
    closed = np.eye(n)
    for k in range(len(linear.A)):
        closed = linear.A[k] @ (np.eye(n) - L[k] @ np.eye(n)[3:]) @ closed
    assert np.abs(np.linalg.eigvals(closed)).max() < 1


def test_states_there_and_back(seeing):
    rng = np.random.default_rng(2)
    x = jnp.asarray(0.3 * rng.normal(size=15))
    state = flight_state(x, 0.1, seeing.plant, CHOSEN)
    np.testing.assert_allclose(controlled_state(state, x[-2:], CHOSEN), x, atol=1e-14)


def test_the_default_snake_is_brought_down_from_75_m(seeing, regulator):
    """It tumbles by itself; with feedback it lands, near the heading that is wanted."""
    alone = controlled_flight(seeing, Constant(seeing.plant.inputs), jax.random.key(0), 120)
    assert alone.ended.outcome in (Outcome.UNSTABLE_PITCH, Outcome.UNSTABLE_ROLL)
    assert alone.ended.state[2] > 20
    held = controlled_flight(seeing, regulator, jax.random.key(0), 120)
    assert held.landed
    assert np.abs(held.ended.state[9]) < np.deg2rad(20)
    turned = dataclasses.replace(regulator, heading=jnp.full((), 0.5))
    turned = controlled_flight(seeing, turned, jax.random.key(0), 120)
    assert turned.landed
    assert abs(float(turned.ended.state[9]) - 0.5) < np.deg2rad(20)
    # the sampled flight is the flight: by Diffrax's own steps it comes to the same, nearly
    # where the actuators run into the limits of their rates, which steps of 8 ms cannot resolve
    count = int(np.sum(~np.asarray(held.over)))
    states, inputs = np.asarray(held.states), np.asarray(held.inputs)
    for k, near in ((0, 6e-2), (5, 6e-2), (count - 2, 2e-4)):
        glider = seeing.plant.told(inputs[k]).glider
        times = float(held.times[k]), float(held.times[k + 1])
        phase = float(seeing.plant.flight.phase)
        on = integrate(glider, states[k], *times, phase=phase, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(on.state, states[k + 1], rtol=0, atol=near)
        fine = Plant.of(glider, phase, times[1] - times[0], (), 1e-4)
        flying = fine.launched(jnp.asarray(states[k]))._replace(time=held.times[k])
        reached = fine.advance(flying, held.inputs[k]).state
        np.testing.assert_allclose(on.state, reached, rtol=0, atol=1e-5)


def test_limits_of_the_actuators_hold(seeing, regulator):
    held = controlled_flight(seeing, regulator, jax.random.key(0), 120)
    low, high = (np.asarray(getattr(seeing.plant.drive, n)) for n in ("low", "high"))
    told = np.asarray(held.inputs)[~np.asarray(held.over)][:, list(CHOSEN)]
    assert (told >= low[list(CHOSEN)]).all()
    assert (told <= high[list(CHOSEN)]).all()
    assert np.ptp(told, axis=0).min() > np.deg2rad(1)


def test_a_batch_is_its_flights(seeing, regulator):
    case = Case(seeing.held, Launch(height=4.0))
    varied = Environment(
        case, vary={"launch.speed": (1.5, 2.0)}, senses=Senses(0.03, 0.1, 0.01, True, 0.05)
    )
    keys = jax.random.split(jax.random.key(3), 3)
    policy = Constant(varied.plant.inputs)
    many = jax.jit(jax.vmap(lambda key: controlled_flight(varied, policy, key, 20)))(keys)
    one = controlled_flight(varied, policy, keys[1], 20)
    assert len(set(np.asarray(many.states[:, 0, 4]).tolist())) == 3
    np.testing.assert_allclose(many.ended.state[1], one.ended.state, rtol=0, atol=1e-9)


def test_other_numbers_compile_nothing():
    """Environments, launches and steps asked for one after the other, outside of `jit`."""
    count = []

    def heard(event, *_, **__):
        count.append(event.endswith("backend_compile_duration"))

    def flown(speed):
        environment = Environment(Case(glider_of(), Launch(height=4.0, speed=speed)))
        situation, _ = environment.reset(jax.random.key(0))
        for _ in range(2):
            situation = environment.step(situation, environment.plant.inputs).situation
        return float(situation.flying.state[4])

    jax.monitoring.register_event_duration_secs_listener(heard)
    first = flown(1.7)
    assert sum(count) > 0
    count.clear()
    assert flown(1.9) > first
    assert sum(count) == 0


def test_delay_and_noise_are_what_they_say():
    """Sensed angles scatter by the noise and are rounded; inputs arrive late."""
    case = Case(glider_of(), Launch(height=10.0))
    senses = Senses(angle_noise=0.02, omega_noise=0.3, resolution=0.005, delay=0.05)
    environment = Environment(case, senses=senses)
    keys = jax.random.split(jax.random.key(0), 400)
    situation, sensed = jax.vmap(environment.reset)(keys)
    true = np.asarray(situation.flying.state)
    off = np.asarray(sensed.angles) - true[:, 9:12]
    np.testing.assert_allclose(off.std(axis=0), 0.02, rtol=0.15)
    grains = np.asarray(sensed.angles) / 0.005
    np.testing.assert_allclose(grains, np.round(grains), atol=1e-9)
    np.testing.assert_allclose((sensed.omega - true[:, 6:9]).std(axis=0), 0.3, rtol=0.15)
    assert np.isnan(sensed.velocity).all()
    here = jax.tree.map(lambda x: x[0], situation)
    told = environment.plant.inputs.at[3].add(0.1)
    flown = environment.step(here, told).situation.flying
    np.testing.assert_allclose(flown.time, environment.plant.interval, rtol=1e-12)
    late = flown.state
    prompt = Environment(case)
    at_once = prompt.step(prompt.reset(keys[0])[0], told).situation.flying.state
    w, share = 25.0, 0.05

    def reached(time):
        return 0.1 * (1 - np.exp(-w * time) * (1 + w * time))

    interval = float(environment.plant.interval)
    for state, time in ((at_once, interval), (late, interval - share)):
        moved = float(state[RIGID + 3] - environment.plant.inputs[3])
        np.testing.assert_allclose(moved, reached(time), atol=2e-3)


def _start(glider) -> tuple[jax.Array, Flight]:
    flight = Flight(glider, glider.body.sections(), jnp.asarray(0.3))
    rigid = jnp.zeros(RIGID).at[jnp.array([2, 4, 5, 7])].set(jnp.array([9.0, 6.0, -4.0, 1.0]))
    return with_own_states(jnp.zeros(()), rigid, flight), flight


def test_a_frozen_body_in_the_air_does_no_work():
    start, flight = _start(glider_of(f_theta=0.0))
    air = np.asarray(energy(jnp.zeros(()), start, flight))
    assert abs(float(actuator_power(jnp.zeros(()), start, flight))) < 1e-12 * abs(air)
    moving = glider_of(f_theta=1.2)
    assert abs(float(actuator_power(jnp.zeros(()), *_start(moving)))) > 1e-3


def test_without_air_all_energy_comes_from_the_actuators():
    glider = glider_of()
    start, flight = _start(Glider(glider.body, glider.gait, Polar.smooth(0.0, 0.0)))
    times = np.linspace(0.0, 0.2, 81)
    told = {"phase": 0.3, "save": times, "rtol": 1e-11, "atol": 1e-11}
    path: Any = integrate(flight.glider, start, 0.0, 0.2, **told)
    power = jax.vmap(lambda t, y: actuator_power(t, y, flight))(jnp.asarray(times), path.states)
    gained = energy(jnp.asarray(0.2), path.states[-1], flight) - energy(
        jnp.asarray(0.0), start, flight
    )
    np.testing.assert_allclose(simpson(power, x=times), gained, rtol=1e-5)
    assert abs(float(gained)) > 1e-4


def test_bad_input():
    glider = glider_of()
    with pytest.raises(ValueError, match=r"d_psi = 45 deg/SVL is not allowed"):
        actuated(glider_of(d_psi=45))
    with pytest.raises(ValueError, match="inputs"):
        actuated(glider, ("d_phi",))
    for inputs in ((), ("d_psi", "d_psi")):
        with pytest.raises(ValueError, match="one or more, each once"):
            actuated(glider, inputs)
    with pytest.raises(ValueError, match="f_theta = 0 Hz is not allowed"):
        Environment(Case(glider_of(f_theta=0.0)))
    with pytest.raises(TypeError, match="has no inputs to be set"):
        Plant.of(glider, 0.0, 0.1)
    with pytest.raises(ValueError, match="delay"):
        Environment(Case(glider), senses=Senses(delay=0.5))
    with pytest.raises(ValueError, match="speed"):
        Environment(Case(glider), vary={"launch.speed": (2.0, 1.0)})
    limit = AngleLimit(angles=("pitch", "roll"))
    assert Environment(Case(glider, Launch(), (Ground(), limit))).case.ends[1] is limit


def test_a_glide_that_no_gain_stabilises_is_told(regulator):
    """Two growing modes and inputs that reach neither: no law, and one sentence."""
    linear = regulator.linear
    deaf = linear._replace(B=jnp.zeros_like(linear.B))
    Q, R = np.eye(linear.A.shape[1]), np.eye(linear.B.shape[2])
    with pytest.raises(ValueError, match="the inputs cannot stabilise this glide"):
        riccati(deaf, Q, R)


def test_yaw_is_where_it_says(seeing):
    state = jnp.zeros(RIGID + 13).at[9].set(0.7)
    assert controlled_state(state, jnp.zeros(2), CHOSEN)[YAW] == 0.7


def test_gymnasiums_checker_is_content(seeing):
    case = Case(seeing.held, Launch(height=3.0))
    vary = {"launch.height": (3.0, 6.0), "launch.speed": (1.5, 2.0)}
    environment = Environment(case, vary=vary)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_env(GlideEnv(environment, samples=30))
    many = GlideVectorEnv(environment, 6, samples=10)
    first, info = many.reset(seed=1)
    assert not info
    told, gone = np.zeros((6, 2), np.float32), np.zeros(6)
    ways = np.zeros((2, 6), int)  # how often each landed, and was cut off
    since = np.zeros(6, int)
    for _ in range(11):
        seen, reward, over, cut, info = many.step(told)
        since, ended = since + 1, over | cut
        gone += reward * (ways.sum(axis=0) == 0)
        assert (cut == (~over & (since == 10))).all()
        assert bool(info) == ended.any()
        if ended.any():  # the launch of the next is seen, and the last of the old is told
            np.testing.assert_array_equal(info["_final_obs"], ended)
            np.testing.assert_array_equal(seen[ended], first[ended])
            last = info["final_obs"]
            assert (np.abs(last - first)[ended].max(axis=1) > 0.1).all()
            np.testing.assert_array_equal(last[~ended], seen[~ended])
            np.testing.assert_array_equal(info["final_info"]["landed"], over)
        ways += np.stack([over, cut])
        since[ended] = 0
    assert (ways.sum(axis=0) == 1).all()
    assert ways.any(axis=1).all()
    assert (gone > 1).all()
    assert len(set(gone.tolist())) == 6
    again, _ = many.reset(seed=1)
    np.testing.assert_array_equal(first, again)
