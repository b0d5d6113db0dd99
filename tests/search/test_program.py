"""Open loop: programmes made by single and by multiple shooting; what they are judged by."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AngleLimit,
    Case,
    Environment,
    Evaluator,
    Gait,
    Glider,
    Launch,
    Plane,
    Polar,
    Problem,
    Repeated,
    Senses,
    Snake,
    Trial,
    controlled_flight,
    heading_change,
    height_lost,
    landing_distance,
    landing_speed,
    linear_quadratic,
    miss_distance,
    optimise_program,
    simulate,
    stability_margin,
)
from jaxglide.control.plant import INPUTS
from jaxglide.control.sampled import SampledPath, controlled_state
from jaxglide.search.pieces import Pieces
from jaxglide.search.problem import Asked
from jaxglide.search.program import ProgramSpace
from jaxglide.search.shooting import CLOSED, _Posed

D_PSI = INPUTS.index("d_psi")


@pytest.fixture(scope="module")
def case() -> Case:
    body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
    glider = Glider(body, Gait.from_degrees(), Polar.smooth())
    return Case(glider, Launch(height=2.0, speed=3.0))


@pytest.fixture(scope="module")
def alone(case):
    return simulate(case.glider, case.launch)


@pytest.fixture(scope="module")
def shot(case):
    return optimise_program(case, knots=3, shooting="multiple", pieces=3, steps=60)


def test_pieces_that_have_met_are_a_flight(case, alone, shot):
    """What multiple shooting joined is flown whole, by another tolerance."""
    assert shot.optimum.gap < CLOSED
    flown = simulate(shot.glider, case.launch, rtol=1e-10, atol=1e-10)
    assert flown.stable
    np.testing.assert_allclose(flown.landing_point[1], shot.value, rtol=0, atol=1e-5)
    assert shot.value > 1.02 * float(alone.landing_point[1])
    held = np.asarray(shot.optimum.states)[1]
    there = simulate(
        shot.glider, case.launch, rtol=1e-10, atol=1e-10, max_time=shot.optimum.times[1]
    )
    there = there.state.at[12].set(0.0)  # the path: a piece's begins anew
    np.testing.assert_allclose(there, held, rtol=0, atol=1e-5)


def test_a_place_is_told_with_its_largest_angles_and_all_slopes(case, shot):
    """Angles on the way are those of the whole flight, not those where pieces meet; slopes of
    the objective, the gaps and what is left to the limits are differences."""
    flown = simulate(shot.glider, case.launch, rtol=1e-10, atol=1e-10)
    program = ProgramSpace.of(case, ("d_psi",), 3, float(shot.knots[-1]), "time", None)
    pieces = Pieces.of(program, flown.take_off, 3)
    posed = _Posed(pieces, Asked(landing_distance, (), ()), 0.0)
    posed.to(1e-11)
    states = jnp.asarray(shot.optimum.states)
    starts = np.asarray(jax.vmap(pieces.unknown)(states))[1:].ravel()
    z = np.concatenate([starts, [shot.optimum.duration], np.deg2rad(shot.values.ravel())])
    here, limit = posed.at(z), 0.98 * np.deg2rad(85.0)
    most = limit - here.left.reshape(3, 3).min(axis=0)
    np.testing.assert_allclose(most, flown.max_angles, atol=1e-5)
    assert (most > 1.01 * np.abs(states[:, 9:12]).max(axis=0)).any()
    way, small = np.random.default_rng(0).normal(size=len(z)), 1e-5
    ends = [posed.at(z + sign * small * way) for sign in (1, -1)]
    for name, slopes in (("worth", "rates"), ("gaps", "joined"), ("left", "closer")):
        above, below = (getattr(end, name) for end in ends)
        slope = getattr(here, slopes) @ way
        np.testing.assert_allclose(slope, (above - below) / (2 * small), rtol=1e-4, atol=1e-4)


def test_a_programme_is_flown_under_feedback(case, shot):
    """The path is the flight at the samples, and the law that keeps to it lands there."""
    environment = Environment(case, shot.inputs, senses=Senses(velocity=True))
    path = shot.path(environment)
    assert path.inputs.shape == (8, 1)  # 0.6 s in whole cycles of 0.83 s
    interval = float(environment.plant.interval)
    whole = simulate(shot.glider, case.launch, rtol=1e-9, atol=1e-9, dense=True)
    for k in (0, 3, 5):  # the first in the first of three pieces, the others in later ones
        told = path.inputs[k - 1] if k else environment.plant.inputs[jnp.array([D_PSI])]
        there = controlled_state(whole.at([k * interval])[0], told, environment.chosen)
        np.testing.assert_allclose(path.states[k], there, atol=1e-4)
    law = linear_quadratic(environment, along=path)
    assert law.launch == 8
    held = controlled_flight(environment, law, jax.random.key(0), 12)
    assert held.landed
    np.testing.assert_allclose(held.ended.state[1], shot.value, atol=5e-3)
    with pytest.raises(ValueError, match="launch and along exclude each other"):
        linear_quadratic(environment, launch=2, along=path)
    with pytest.raises(ValueError, match=r"along has 7 samples: .* whole cycles of 8"):
        linear_quadratic(environment, along=SampledPath(path.states[:8], path.inputs[:7]))
    with pytest.raises(TypeError, match="along"):
        linear_quadratic(environment, along=path.states)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="sets d_psi, d_theta: the programme is of d_psi"):
        shot.path(Environment(case))


@pytest.mark.slow
def test_single_shooting_comes_to_the_same(case, shot):
    found = optimise_program(
        case, knots=3, until=float(shot.knots[-1]), starts=2, steps=60, progress=False
    )
    np.testing.assert_allclose(found.value, shot.value, rtol=2e-3)
    assert found.value < shot.value + 1e-4


@pytest.mark.slow
def test_what_is_asked_of_the_flight_is_kept(case):
    """A constraint binds, by both ways of shooting; the target is hit."""
    asked = [stability_margin.at_least(70.0, scale=10.0)]
    told: dict[str, Any] = {"knots": 4, "constraints": asked}
    single = optimise_program(case, starts=2, steps=40, progress=False, **told)
    many = optimise_program(case, shooting="multiple", pieces=4, **told)
    for found in (single, many):
        margin = float(stability_margin(found.glider, case.launch))
        assert margin > 69.5
    target = 0.05, 2.2
    near = optimise_program(
        case, ("d_psi", "d_theta"), 4, objective=miss_distance(*target), shooting="multiple"
    )
    landed = simulate(near.glider, case.launch).landing_point[:2]
    np.testing.assert_allclose(landed, target, atol=2e-3)


def test_knots_are_where_they_say_and_limits_hold(case, shot):
    """The programme's knots are the values, and its actuators' ranges theirs."""
    law: Any = shot.glider.gait.drive.law
    table = np.rad2deg(np.asarray(law.programme.inputs))
    np.testing.assert_allclose(table[:, D_PSI], shot.values[:, 0], rtol=1e-12)
    np.testing.assert_allclose(law.programme.times, shot.knots)
    others = np.delete(table, D_PSI, axis=1)
    np.testing.assert_allclose(others, np.broadcast_to(others[0], others.shape), rtol=1e-12)
    assert shot.values.min() >= -17.5 - 1e-9  # nine tenths of -20 to 30
    assert shot.values.max() <= 27.5 + 1e-9
    assert np.ptp(shot.values) > 1
    assert "landing_distance" in str(shot)
    assert "d_psi" in str(shot)


@pytest.mark.parametrize("knots", [3, pytest.param(30, marks=pytest.mark.slow)])
def test_gradients_by_the_knots_are_differences(case, knots):
    """Forward with few knots, backwards with many; the launch depends on none of them."""
    program = ProgramSpace.of(case, ("d_psi",), knots, 0.55, "time", None)
    told = {"rtol": 1e-11, "atol": 1e-11}
    problem = Problem(landing_distance, program.bounds, case=program.case, **told)
    point = np.array(list(program.guesses(2, 0)[1].values()))
    way = np.random.default_rng(0).normal(size=knots)
    slope = Evaluator(problem)(point[None]).gradients[0, 0] @ way
    ends = point + 3e-4 * np.array([way, -way])
    values = Evaluator(problem, gradients=False)(ends).values[:, 0]
    np.testing.assert_allclose(slope, (values[0] - values[1]) / 6e-4, rtol=5e-5)


def test_a_cycle_repeats_itself_smoothly():
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(5, 6))
    law = Repeated(inputs, 1.25)
    at = [law(jnp.asarray(t), None) for t in (0.8 * np.arange(10) / 5)]  # type: ignore[arg-type]
    np.testing.assert_allclose(at, np.concatenate([inputs, inputs]), atol=1e-12)
    small = 1e-5
    ends = [law(jnp.asarray(0.8 + s), None) for s in (-small, 0.0, small)]  # type: ignore[arg-type]
    before, after = (ends[1] - ends[0]) / small, (ends[2] - ends[1]) / small
    assert np.abs(before).min() > 0.1
    np.testing.assert_allclose(before, after, rtol=1e-2)


def test_over_the_phase_knots_are_parts_of_a_cycle(case):
    program = ProgramSpace.of(case, ("d_psi", "d_theta"), 4, None, "phase", None)
    assert program.knots == (0.0, 0.25, 0.5, 0.75)
    assert len(program.names) == 8
    first, second = program.guesses(2, 0)
    np.testing.assert_allclose(np.rad2deg(list(first.values()))[::2], 10.0)
    assert first != second
    moved = program.case.replace(second)
    gait: Any = moved.glider.gait
    found = [gait.drive.law.inputs[k, j] for k in range(4) for j in (3, 4)]
    np.testing.assert_allclose(found, list(second.values()))


def test_objectives_of_an_end(case, alone):
    """Of a landing they are what the flight says; after a tumble continued without air."""
    trial = Trial.of(alone)
    vx, vy, vz = np.asarray(alone.velocity)
    speed = np.sqrt(vx**2 + vy**2 + vz**2)
    np.testing.assert_allclose(landing_speed.value(trial), speed)
    turned = np.rad2deg(np.arctan2(-vx, vy))
    np.testing.assert_allclose(heading_change.value(trial), turned)
    x, y = np.asarray(alone.landing_point)[:2]
    np.testing.assert_allclose(miss_distance(x + 3, y - 4).value(trial), 5.0)
    np.testing.assert_allclose(height_lost(45.0).value(trial), 2.0 - y)
    high = Launch(height=2.0, speed=3.0)
    limit = AngleLimit(limit=np.deg2rad(12))
    tumbled = simulate(case.glider, high, ends=(*case.ends[:1], limit))
    assert not tumbled.stable
    trial, z = Trial.of(tumbled), float(tumbled.state[2])
    v = np.asarray(tumbled.velocity)
    falls = np.sqrt(np.sum(v**2) + 2 * 9.81 * z)
    np.testing.assert_allclose(landing_speed.value(trial), falls, rtol=1e-3)
    there = np.asarray(tumbled.state[:2]) + float(trial.drop_time) * v[:2]
    np.testing.assert_allclose(miss_distance(0, 0).value(trial), np.hypot(*there))


def test_heading_is_that_of_the_launch(case):
    """A launch turned to the left flies the same, turned."""
    turned = Launch(height=2.0, speed=3.0, heading=0.0, angles=[0.0, 0.0, 0.0])
    one = heading_change(case.glider, turned)
    left = Launch(height=2.0, speed=3.0, heading=0.3, angles=[0.3, 0.0, 0.0])
    np.testing.assert_allclose(heading_change(case.glider, left), one, atol=1e-4)


def test_bad_input(case):
    with pytest.raises(ValueError, match="knots = 2"):
        optimise_program(case, knots=2)
    with pytest.raises(ValueError, match="knots = 201"):
        optimise_program(case, knots=201)
    with pytest.raises(ValueError, match="f_theta sets the phase"):
        optimise_program(case, ("f_theta",), over="phase")
    with pytest.raises(ValueError, match="until is a time"):
        optimise_program(case, over="phase", until=1.0)
    with pytest.raises(ValueError, match="shooting"):
        optimise_program(case, shooting="double")
    with pytest.raises(ValueError, match="optimiser: multiple shooting"):
        optimise_program(case, until=1.0, shooting="multiple", optimiser="adam")
    plane = Case(case.glider, case.launch, (Plane(normal=[0.0, 0.0, 1.0], offset=1.0),))
    with pytest.raises(ValueError, match="ends hold no Ground"):
        optimise_program(plane, until=1.0, shooting="multiple")
    with pytest.raises(ValueError, match="glide_angle = 90"):
        height_lost(90.0)
    with pytest.raises(ValueError, match="x = nan"):
        miss_distance(float("nan"), 0.0)
    assert landing_distance.sense == 1
