"""The optimiser: known optima, constraints, bounds, resuming, and a known flight."""

import inspect
import json
import math
import warnings

import equinox as eqx
import jax
import numpy as np
import optax
import pytest
import xarray as xr

from jaxglide import AbstractEnd, Case, Gait, Glider, Launch, Polar, Snake
from jaxglide.search.ascent import Best
from jaxglide.search.evaluator import Evaluator
from jaxglide.search.objective import Trial
from jaxglide.search.objectives import Objective, landing_distance, stability_margin
from jaxglide.search.optimum import Status, optimise, verify
from jaxglide.search.polish import sample_uphill, summits
from jaxglide.search.problem import Evaluation, Problem
from made_searches import FREE, Made, problem_of

CONSTRAINED = problem_of(stability_margin.at_least(1.0))


def place(problem, point):
    return (np.array([point[n] for n in problem.names]) - problem.low) / (
        problem.high - problem.low
    )


@pytest.mark.parametrize("optimiser", ["adam", "lbfgs", optax.sgd(1.0)])
def test_an_optimum_inside_is_found(optimiser):
    problem = problem_of()
    made = Made(problem, (0.3, 0.6))
    found = optimise(problem, starts=8, steps=200, optimiser=optimiser, evaluator=made)
    np.testing.assert_allclose(place(problem, found.best), (0.3, 0.6), atol=5e-3)
    assert found.value == pytest.approx(0, abs=1e-4)
    assert found.feasible
    assert (found.values > -0.01).all()


def test_an_optimum_at_a_bound_is_found_and_said():
    problem = problem_of()
    found = optimise(problem, starts=8, steps=200, evaluator=Made(problem, (1.4, 0.5)))
    # with z_0 = 1, d/dz_1 of the quadratic vanishes at z_1 = 0.5 + 0.4/2
    np.testing.assert_allclose(place(problem, found.best), (1.0, 0.7), atol=5e-3)
    assert "(at its bound)" in str(found)
    listed = [line.split()[1] for line in str(found).splitlines() if "  start " in line]
    assert listed == [str(k) for k in np.argsort(-found.values, kind="stable")]


def test_an_optimum_under_a_constraint_is_found():
    """Maximise the quadratic where z_0 + z_1 <= 0.5, by Lagrange's equations."""
    made = Made(CONSTRAINED, (0.5, 0.6), edge=0.5)
    found = optimise(CONSTRAINED, starts=8, steps=300, evaluator=made)
    inverse = np.linalg.inv(2 * made.A)
    one, centre = np.ones(2), np.array([0.5, 0.6])
    multiplier = (centre.sum() - 0.5) / (one @ inverse @ one)
    expected = centre - multiplier * inverse @ one
    assert found.feasible
    np.testing.assert_allclose(place(CONSTRAINED, found.best), expected, atol=0.01)
    assert abs(float(found.slacks[0])) < 0.02
    assert "stability_margin >= 1 is binding" in str(found)


def test_what_cannot_be_met_is_said():
    made = Made(CONSTRAINED, (0.5, 0.6), edge=-0.5)
    found = optimise(CONSTRAINED, starts=4, steps=30, evaluator=made)
    assert not found.feasible
    assert (found.status == Status.INFEASIBLE).all()
    assert "no start met the constraints" in found.reason
    # least violation: the corner where z_0 + z_1 is least
    assert place(CONSTRAINED, found.best).sum() < 0.2


def test_steps_that_are_not_finite_are_skipped_and_counted():
    problem = problem_of()
    made = Made(problem, (0.3, 0.6), hole=np.array([0.6, 0.6]))
    found = optimise(problem, starts=32, screen=0, steps=200, evaluator=made)
    assert found.skipped > 0
    tried = ~np.isnan(found.history.point.values[..., 0])
    rounds = found.history.glides.values > 0
    np.testing.assert_array_equal(tried.sum(axis=1)[~rounds], found.history.gradients[~rounds])
    assert found.evaluations == int(found.history.gradients.sum())
    assert set(found.history.glides.values[rounds]) == {256}
    np.testing.assert_allclose(place(problem, found.best), (0.3, 0.6), atol=5e-3)


def test_all_not_finite_is_said():
    problem = problem_of()
    made = Made(problem, (np.nan, 0.5))
    found = optimise(problem, starts=3, steps=5, evaluator=made)
    assert (found.status == Status.NOT_FINITE).all()
    assert found.skipped == found.evaluations == 15
    assert not found.feasible


def test_ctrl_c_keeps_the_best_and_the_log_goes_on(tmp_path):
    problem, log = problem_of(), tmp_path / "log.jsonl"
    options = {"starts": 4, "screen": 0, "steps": 40}
    made = Made(problem, (0.3, 0.6))
    whole = optimise(problem, **options, evaluator=made)
    assert made.calls == whole.history.sizes["step"]
    assert whole.history.glides.values[-1] == 256  # it polishes, too
    cut = Made(problem, (0.3, 0.6), stop_at=7)
    part = optimise(problem, **options, evaluator=cut, log=log)
    assert (part.status == Status.INTERRUPTED).all()
    assert part.reason == "interrupted after 7 steps"
    assert part.value == np.nanmax(whole.history.value.values[:7])
    # killed in the middle of a line
    log.write_text(log.read_text() + '{"starts": [0, 1')
    rest = Made(problem, (0.3, 0.6))
    again = optimise(problem, **options, evaluator=rest, log=log)
    assert rest.calls == made.calls - 7
    # killed while polishing
    kept = log.read_text().split("\n")
    log.write_text("\n".join(kept[:-2]) + "\n")
    last = Made(problem, (0.3, 0.6))
    again = optimise(problem, **options, evaluator=last, log=log)
    assert last.calls == 1
    xr.testing.assert_identical(
        again.history.drop_attrs(deep=False), whole.history.drop_attrs(deep=False)
    )
    assert again.best == whole.best
    # and once more, computing nothing
    none = Made(problem, (0.3, 0.6), stop_at=0)
    assert optimise(problem, **options, evaluator=none, log=log).best == whole.best


def test_before_the_first_step_ctrl_c_is_raised():
    problem = problem_of()
    for screen in (0, 8):
        cut = Made(problem, (0.3, 0.6), stop_at=screen // 8)
        with pytest.raises(KeyboardInterrupt):
            optimise(problem, starts=4, screen=screen, evaluator=cut)


def test_screening_starts_from_the_best_of_many(tmp_path):
    problem, log = problem_of(), tmp_path / "log.jsonl"
    options = {"starts": 4, "screen": 64, "steps": 3, "polish": 0, "log": log}
    made = Made(problem, (0.3, 0.6))
    found = optimise(problem, **options, evaluator=made, screener=Made(problem, (0.3, 0.6)))
    assert made.calls == 3
    first = found.history.point.values[0]
    screened = json.loads(log.read_text().split("\n")[1])
    assert np.shape(screened["gradients"]) == (64, 1, 0)
    tried = np.array(screened["values"])[:, 0]
    assert tried.shape == (64,)
    np.testing.assert_allclose(found.history.value.values[0], np.sort(tried)[::-1][:4])
    assert len(np.unique(first, axis=0)) == 4
    none = Made(problem, (0.3, 0.6), stop_at=0)
    again = optimise(problem, **options, evaluator=none, screener=none)
    assert again.best == found.best


def test_guesses_are_the_first_starts():
    problem = problem_of()
    best = {"theta_m": 92.0, "nu_theta": 1.3}  # at z = (0.3, 0.6)
    bound = {"theta_m": 80.0, "nu_theta": 1.25}
    for screen in (0, 16):
        made = Made(problem, (0.3, 0.6))
        options = {"starts": 4, "screen": screen, "steps": 40, "polish": 0, "evaluator": made}
        found = optimise(problem, guesses=[best, bound], **options)
        first = found.history.point.values[0]
        np.testing.assert_allclose(first[0], [92.0, 1.3], rtol=1e-12)
        np.testing.assert_allclose(first[1], [80.0, 1.25], rtol=1e-4)
        assert len(np.unique(first, axis=0)) == 4
        assert found.history.point.values[1, 1, 0] > 80.05  # at once: it has a slope there
        assert found.value > -1e-12
        np.testing.assert_allclose(found.values, 0.0, atol=1e-3)  # the bound was left


@pytest.mark.parametrize(
    ("guess", "message"),
    [
        ({"theta_m": 90.0}, "a guess lacks nu_theta"),
        ({"theta_m": 130.0, "nu_theta": 1.2}, r"guess of theta_m.*130.*deg.*80.*120"),
        ({"theta_m": np.nan, "nu_theta": 1.2}, "guess of theta_m"),
        ({"theta_m": 90.0, "nu_theta": 1.2, "psi_m": 20.0}, "'psi_m', which is not free"),
    ],
)
def test_bad_guesses_are_named(guess, message):
    made = Made(problem_of(), (0.3, 0.6))
    with pytest.raises(ValueError, match=message):
        optimise(problem_of(), guesses=[guess], evaluator=made)
    with pytest.raises(ValueError, match="2 guesses are more than 1 starts"):
        optimise(problem_of(), starts=1, guesses=[{}, {}], evaluator=made)


class Rugged(Made):
    """The same with a ridge, too narrow to be followed, along z_0 + 0.29 = z_1."""

    def __call__(self, points, rtol=None, atol=None):
        found = super().__call__(points, rtol, atol)
        z = (points - self.problem.low) / (self.problem.high - self.problem.low)
        ridge = np.exp(-(((z[:, 0] + 0.29 - z[:, 1]) / 5e-4) ** 2))
        found.values[:, 0] += 1 + ridge
        return found


def test_polishing_finds_what_gradients_pass_by():
    problem = problem_of()
    plain, rounds = (
        optimise(problem, starts=2, steps=60, polish=n, evaluator=Rugged(problem, (0.3, 0.6)))
        for n in (0, 20)
    )
    assert plain.value < 1.1
    assert rounds.value > 1.95
    assert "rounds of sampling around the best gained" in rounds.reason
    assert "gained" not in plain.reason
    checked = verify(problem, rounds.best, screener=Rugged(problem, (0.3, 0.6)))
    assert checked.gain < 0.01
    np.testing.assert_array_equal(rounds.history.best_value.max(), rounds.value)


def test_polishing_stays_within_bounds_and_constraints():
    made = Rugged(CONSTRAINED, (0.9, 0.9), edge=0.5)
    made.A = np.diag([0.1, 0.1])
    found = optimise(CONSTRAINED, starts=4, steps=100, evaluator=made)
    assert found.feasible
    assert float(found.slacks[0]) >= -1e-3
    assert place(CONSTRAINED, found.best).sum() <= 0.501
    beyond = Rugged(problem_of(), (1.3, 1.3))
    best = optimise(problem_of(), starts=4, steps=60, evaluator=beyond).best
    assert (place(problem_of(), best) <= 1).all()


def polished(problem, value, rounds=8, middle=(0.5, 0.5)):
    """Rounds done, best values after each, clouds (rounds, K, n) in z, and the best in z.

    `value` gives objective and slacks, (K, 1 + m), of points z.
    """
    z0 = np.array([middle])

    def note(*_):
        told.append(float(best.values[best.leader]))

    best = Best(1, 2, len(problem.constraints), 1e-3)
    width, clouds, told = problem.high - problem.low, [], []

    def evaluate(points):
        clouds.append((points - problem.low) / width)
        values = value(clouds[-1])
        return Evaluation(values, np.zeros((*values.shape, 2)))

    start = value(z0)
    first = Evaluation(start, np.zeros((*start.shape, 2)))
    best.update(np.array([0]), problem.low + z0 * width, first)
    done = sum(
        sample_uphill(problem, best, lead, evaluate, rounds, 0, note)
        for lead in summits(problem, best)
    )
    return done, told, np.array(clouds), (best.points[0] - problem.low) / width


def test_sampling_goes_on_while_it_gains_and_ends_when_it_does_not():
    problem = problem_of()
    done, told, clouds, best = polished(problem, lambda z: 1 + z[:, :1])
    assert done == len(told) == len(clouds) == 8
    assert (np.diff(told) > 1e-3).all()
    assert best[0] > 0.5 + 8 * 0.019  # nearly the whole radius a round
    done, told, clouds, _ = polished(problem, lambda z: 2 - z[:, :1] * 1e-3)
    assert done == len(told) == 3


def test_sampling_starts_from_the_three_best_ends_that_are_apart():
    problem = problem_of()
    z = np.array([[0.5, 0.5], [0.2, 0.2], [0.505, 0.5], [0.8, 0.2], [0.1, 0.9], [0.3, 0.3]])
    values = np.array([[5.0], [3.0], [4.9], [4.0], [9.0], [2.0]])
    best = Best(6, 2, 0, 1e-3)
    points = problem.low + z * (problem.high - problem.low)
    best.update(np.arange(6), points, Evaluation(values, np.zeros((6, 1, 2))))
    best.violation[4] = 1.0  # not feasible
    assert summits(problem, best) == [0, 3, 1]
    best.violation[:] = 1.0
    assert summits(problem, best) == []


def test_rounds_that_are_left_go_to_the_next_best_start():
    """The best start sits on a flat, another below it on a slope that leads higher."""
    problem = problem_of()

    class Cliff(Made):
        def __call__(self, points, rtol=None, atol=None):
            z = (points - self.problem.low) / (self.problem.high - self.problem.low)
            slope = np.where(z[:, 0] > 0.5, 1.0, 0.5 + z[:, 0] * z[:, 1] * 4)
            return Evaluation(slope[:, None], np.zeros((len(z), 1, 2)))

    options = {"starts": 16, "screen": 0, "steps": 1}
    options["evaluator"] = Cliff(problem, (0.3, 0.6))
    few, some, many = (optimise(problem, polish=n, **options) for n in (3, 5, 40))
    assert many.value > few.value + 0.1
    rounds = [
        int(one.reason.split(" rounds of sampling")[0].split()[-1]) for one in (few, some, many)
    ]
    assert rounds[:2] == [3, 5]
    assert 10 < rounds[2] <= 40


def test_clouds_lie_within_the_radius_half_of_them_in_narrower_ones():
    _, _, clouds, _ = polished(problem_of(), lambda z: 1 + 0 * z[:, :1], rounds=1)
    reach = np.abs(clouds[0] - 0.5).max(axis=1)
    assert len(reach) == 256
    assert 0.0195 < reach.max() <= 0.02 + 1e-12
    assert np.median(reach[::2]) > 0.012
    assert 0.0002 < np.quantile(reach[1::2], 0.1) < 0.001


def test_sampling_moves_to_the_best_that_meets_the_constraints():
    """Uphill in z_0 as far as the edge, z_0 <= 0.55."""

    def value(z):
        return np.stack([1 + z[:, 0], 0.55 - z[:, 0]], axis=1)

    _, told, _, best = polished(CONSTRAINED, value)
    assert 0.549 < best[0] <= 0.551
    assert told[-1] == pytest.approx(1.55, abs=2e-3)
    none = polished(CONSTRAINED, lambda z: value(z) - [0, 1])
    assert none[0] == 0


def test_verification_solves_finely_and_finds_better_neighbours():
    problem, asked = problem_of(), []

    class Watched(Made):
        def __call__(self, points, rtol=None, atol=None):
            asked.append((len(points), rtol, atol))
            found = super().__call__(points, rtol, atol)
            return Evaluation(found.values + 1.0, found.gradients)

    made = Watched(problem, (0.3, 0.6))
    summit = {"theta_m": 92.0, "nu_theta": 1.3}
    checked = verify(problem, summit, samples=64, screener=made)
    assert asked == [(65, 1e-9, 1e-9)]
    assert checked.value == pytest.approx(1.0)
    assert -1e-3 < checked.gain <= 0
    assert str(checked).startswith("landing_distance 1 m at 1e-9\n  of 64 points nearby")
    beside = verify(problem, {"theta_m": 92.0, "nu_theta": 1.2}, samples=64, screener=made)
    assert beside.gain == pytest.approx(beside.nearby / beside.value - 1)
    assert beside.gain > 0.01
    assert place(problem, dict(zip(problem.names, beside.at, strict=True)))[1] > 0.4
    outside = verify(CONSTRAINED, summit, samples=8, screener=Made(CONSTRAINED, (0, 0), -1.0))
    assert np.isnan([outside.nearby, outside.gain]).all()
    assert "none of 8 points nearby meets the constraints" in outside._repr_html_()


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ([90.0], r"point has shape \(1,\): it must be \(2,\)"),
        ({"theta_m": 90.0}, "a point lacks nu_theta"),
        ({"theta_m": 90.0, "nu_theta": 1.6}, r"point of nu_theta = 1.6 .*\[1, 1.5\]"),
    ],
)
def test_a_bad_point_to_verify_is_named(point, message):
    with pytest.raises(ValueError, match=message):
        verify(problem_of(), point, screener=Made(problem_of(), (0, 0)))


def test_ctrl_c_while_polishing_keeps_the_best():
    problem = problem_of()
    made = Made(problem, (0.3, 0.6), stop_at=3)
    found = optimise(problem, starts=4, screen=0, steps=3, evaluator=made)
    assert "interrupted while sampling around the best" in found.reason
    assert found.feasible


def test_the_history_is_labelled(tmp_path):
    found = optimise(
        CONSTRAINED, starts=4, steps=6, polish=2, evaluator=Made(CONSTRAINED, (0.3, 0.4), 0.5)
    )
    data = found.history
    assert dict(data.sizes) == {"step": 8, "start": 4, "parameter": 2}
    assert data.gradients.values.tolist() == [4] * 6 + [0] * 2
    assert data.glides.values.tolist() == [0] * 6 + [256] * 2
    assert int(np.isfinite(data.value.values[6:]).sum()) == 2
    assert data.parameter.values.tolist() == ["theta_m", "nu_theta"]
    assert data.unit.values.tolist() == ["degree", "1"]
    assert data.value.attrs == {"units": "m", "long_name": "landing_distance"}
    assert json.loads(data.attrs["problem"])["constraints"] == [
        "stability_margin >= 1 (scale 1)"
    ]
    inside = (data.point >= data.low) & (data.point <= data.high)
    assert bool(inside.isel(step=slice(6)).all())
    assert len(np.unique(data.point.values[0], axis=0)) == 4
    data.to_netcdf(tmp_path / "h.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "h.nc", engine="h5netcdf") as back:
        xr.testing.assert_identical(back.load(), data)


# --- through the whole simulation ------------------------------------------------------


@pytest.fixture(scope="module")
def thrown():
    """Without air a body thrown at 6 m/s from 2 m: how far, by its elevation."""
    fixed = {"lift_scale": 0.0, "drag_scale": 0.0, "speed": 6.0, "height": 2.0}
    setup = {"polar": "smooth", "node_set": "gauss", "nodes": 20}
    return Problem(landing_distance, {"elevation": (0.0, 80.0)}, fixed=fixed, setup=setup)


@pytest.fixture(scope="module")
def evaluator(thrown):
    return Evaluator(thrown)


def flown(degrees):
    """Closed form of the distance [m] and its slope [m/deg]."""
    a, v, g, h = np.deg2rad(degrees), 6.0, 9.81, 2.0

    def distance(a):
        up = v * np.sin(a)
        return v * np.cos(a) * (up + np.sqrt(up**2 + 2 * g * h)) / g

    step = 1e-5
    return distance(a), np.deg2rad((distance(a + step) - distance(a - step)) / (2 * step))


def test_values_and_gradients_of_many_flights_are_the_closed_forms(evaluator):
    points = np.array([[5.0], [20.0], [35.0], [50.0], [70.0]])
    found = evaluator(points)
    expected = np.array([flown(x) for (x,) in points])
    assert found.values.shape == (5, 1)
    np.testing.assert_allclose(found.values[:, 0], expected[:, 0], rtol=1e-8)
    np.testing.assert_allclose(found.gradients[:, 0, 0], expected[:, 1], rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_the_best_elevation_of_a_throw(thrown, evaluator):
    """tan(best) = v/sqrt(v^2 + 2 g h), through the whole simulation."""
    found = optimise(thrown, starts=4, steps=60, screen=16, polish=4, evaluator=evaluator)
    best = math.degrees(math.atan(6 / math.sqrt(36 + 2 * 9.81 * 2)))
    assert found.best["elevation"] == pytest.approx(best, abs=0.5)
    assert found.value == pytest.approx(flown(best)[0], rel=1e-4)
    assert found.value <= flown(best)[0] * (1 + 1e-9)
    checked = verify(thrown, found.best, samples=7, radius=0.05)
    assert checked.value == pytest.approx(found.value, rel=1e-8)
    assert checked.gain < 1e-3
    # away from the optimum the neighbourhood says so
    poor = verify(thrown, {"elevation": 10.0}, samples=7, radius=0.05)
    assert poor.gain > 0.01
    assert poor.nearby == pytest.approx(flown(poor.at[0])[0], rel=1e-8)


class Wall(AbstractEnd):
    """A part from outside that describes none of its floats: a wall across the path."""

    place: float = 1.5  # m

    @property
    def words(self):
        return ("hit the wall",)

    def __call__(self, time, state):
        return self.place - state[1:2]


SPEED = 6.0
TRACED = []


def compiled() -> list[Trial]:
    """Trials that were traced to be flown, not to see what an objective asks for."""
    return [trial for trial in TRACED if type(trial) is Trial]


def at_the_wall(trial):
    TRACED.append(trial)
    return trial.glide.state[2]


@pytest.fixture(scope="module")
def thrown_at_a_wall():
    """Problem by bounds of elevation and place, and by height: how high it hits the wall."""
    objective = Objective("height at the wall", "m", at_the_wall)
    glider = Glider(
        Snake.from_svl(nodes=12, node_set="gauss"), Gait.from_degrees(), Polar.smooth(0.0, 0.0)
    )
    case = Case(glider, Launch(2.0, SPEED), Wall())

    def make(**fixed):
        free = {"launch.elevation": (0.0, 80.0), "place": (1.0, 2.0)}
        return Problem(objective, free, fixed=fixed, case=case)

    return make


def hit(degrees, place, height=2.0):
    """Closed form of the height [m] at the wall, and its slopes by elevation and place."""
    a, g = np.deg2rad(degrees), 9.81
    drop = g * place**2 / (2 * (SPEED * np.cos(a)) ** 2)
    turn = place / np.cos(a) ** 2 - 2 * drop * np.tan(a)
    return height + place * np.tan(a) - drop, np.stack(
        [np.deg2rad(turn), np.tan(a) - 2 * drop / place], axis=-1
    )


@pytest.mark.slow
def test_a_float_of_a_part_of_ones_own_is_searched_over(thrown_at_a_wall):
    """Highest where tan(elevation) = v^2/(g place), and at the nearest place."""
    problem = thrown_at_a_wall(height=2.0, speed=SPEED)
    evaluate = Evaluator(problem)
    points = np.array([[10.0, 1.2], [40.0, 1.5], [60.0, 1.9]])
    found = evaluate(points)
    value, slopes = hit(*points.T)
    np.testing.assert_allclose(found.values[:, 0], value, rtol=1e-8)
    np.testing.assert_allclose(found.gradients[:, 0], slopes, rtol=1e-6, atol=1e-9)
    best = optimise(problem, starts=4, steps=60, evaluator=evaluate)
    highest = math.degrees(math.atan(SPEED**2 / 9.81))
    assert best.best["place"] == pytest.approx(1.0, abs=1e-3)
    assert best.best["launch.elevation"] == pytest.approx(highest, abs=0.5)
    assert best.value == pytest.approx(hit(highest, 1.0)[0], rel=1e-5)
    assert "place" in str(best)
    case = problem.at(best.best)
    assert float(case.ends[0].place) == best.best["place"]
    assert best.history.attrs["problem"].count("test_optimise.Wall") == 1


def test_other_fixed_values_and_another_base_compile_nothing(thrown_at_a_wall):
    points = np.array([[10.0, 1.2], [40.0, 1.5], [60.0, 1.9]])
    one = thrown_at_a_wall(height=2.0, speed=SPEED)
    Evaluator(one)(points)
    count = len(compiled())
    two = thrown_at_a_wall(height=3.0, speed=SPEED)
    found = Evaluator(two)(points)
    np.testing.assert_allclose(found.values[:, 0], hit(*points.T, 3.0)[0], rtol=1e-8)
    heavy = eqx.tree_at(lambda c: c.glider.gravity, one.case, np.float64(0.0))
    three = Problem(one.objective, one.free, fixed=one.fixed, case=heavy)
    straight = 2.0 + points[:, 1] * np.tan(np.deg2rad(points[:, 0]))
    np.testing.assert_allclose(Evaluator(three)(points).values[:, 0], straight, rtol=1e-8)
    assert len(compiled()) == count > 0
    assert one != two
    assert one != three
    texts = [json.dumps(p.describe()) for p in (one, two, three)]
    assert len(set(texts)) == 3


def test_float32_is_said_once_by_a_search_and_by_what_it_is_made_of(monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    # without the checks of shapes, whose file would be the caller's
    search, check = inspect.unwrap(optimise), inspect.unwrap(verify)
    monkeypatch.setattr("jaxglide.search.evaluator.fly_all", interrupted)
    with jax.enable_x64(False), warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("default")
        problem = problem_of()
        loose = Problem(landing_distance, FREE, rtol=1e-5, atol=1e-5)
        with pytest.raises(KeyboardInterrupt):
            search(problem)
        with pytest.raises(KeyboardInterrupt):
            check(problem, [90.0, 1.2])
        with pytest.raises(KeyboardInterrupt):
            check(loose, [90.0, 1.2])
        with pytest.raises(KeyboardInterrupt):
            search(loose)
    assert [one.filename for one in said] == [__file__] * 3
    assert len({one.lineno for one in said}) == 3
    texts = [str(one.message).split(" are too tight for float32")[0] for one in said]
    assert texts == ["rtol = 1e-07, atol = 1e-07"] * 2 + ["rtol = 1e-09, atol = 1e-09"]


def test_points_that_cannot_be_evaluated_are_named():
    evaluate = Evaluator(problem_of())
    for points, message in (
        (np.ones(2), r"points of shape \(2,\) are not \(S, 2\)"),
        (np.ones((4, 3)), r"points of shape \(4, 3\)"),
        (np.empty((0, 2)), r"points of shape \(0, 2\) .* or are none"),
        ([[90.0, np.nan]], "nu_theta = nan is not allowed"),
        ([[200.0, 1.2]], "theta_m = 200 deg is not allowed"),
    ):
        with pytest.raises(ValueError, match=message):
            evaluate(points)
    with pytest.raises(ValueError, match="rtol = 0 is not allowed"):
        evaluate([[90.0, 1.2]], rtol=0.0)
    with pytest.raises(TypeError, match="is not a Problem"):
        Evaluator(landing_distance)


# --- bad input -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (({},), "no parameter is free"),
        ((("speed",),), "give bounds of 'speed'"),
        (({"foo": (0, 1)},), "no parameter 'foo'"),
        (({"theta_m": (100, 90)},), "bounds of theta_m are .* not lowest and highest"),
        (({"theta_m": (100, 900)},), "theta_m = 900 deg"),
        (({"theta_m": 90},), "bounds of theta_m are 90, not"),
        (({"theta_m": (80, 90, 100)},), "bounds of theta_m are .*, not"),
        (({"theta_m": ("80", "x")},), "theta_m = .* is not a number"),
        ((("theta_m", "theta_m"),), "theta_m is named twice"),
        (("speed",), "give bounds of 'speed'"),
        (("launch.speed",), "give bounds of 'launch.speed': ranges observed are of theta_m,"),
        ((("theta_m", "gait.theta_m"),), "name one float twice"),
        ((FREE, (), {"gait.theta_m": 90.0}), "gait.theta_m is both free and fixed"),
        (({"cells": (0, 1)},), r"cells is an array of shape .*: name a number in it"),
        ((FREE, [landing_distance]), "is not a Constraint"),
        ((FREE, (), {"height": [1, 2]}), r"height = \[1, 2\] is not one number"),
        ((FREE, (), {"height": "low"}), "height = 'low' is not a number"),
        ((FREE, (), 5), "fixed = 5 is not values by name"),
        ((FREE, (), None, "smooth"), "setup = 'smooth' is not values by name"),
        (({3: (0, 1)},), "3 is not the name of a parameter"),
    ],
)
def test_bad_problems_are_named(arguments, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Problem(landing_distance, *arguments)
    with pytest.raises(TypeError, match="is not an Objective"):
        Problem(len, FREE)
    with pytest.raises(TypeError, match="case must be of type Case, not Glider"):
        Problem(landing_distance, FREE, case=problem_of().case.glider)
    with pytest.raises(ValueError, match="give a case or setup, not both"):
        Problem(landing_distance, FREE, case=problem_of().case, setup={"nodes": 20})


def test_problems_are_equal_that_ask_the_same():
    one, two = problem_of(), problem_of()
    assert one == two
    assert hash(one) == hash(two)
    others = [
        Problem(landing_distance, dict(reversed(FREE.items()))),
        Problem(landing_distance, FREE, rtol=1e-6),
        Problem(landing_distance, FREE, fixed={"height": 3.0}),
        CONSTRAINED,
    ]
    case = Case(one.case.glider, Launch(10.0), follow=one.case.follow)
    assert Problem(landing_distance, FREE, case=case) != one  # which has a setup
    parts = Problem(landing_distance, FREE, glider=case.glider, launch=case.launch)
    assert parts == Problem(landing_distance, FREE, case=Case(case.glider))
    assert one not in others
    assert one != "a problem"


def test_numbers_of_numpy_are_plain_in_a_problem_and_its_log(tmp_path):
    setup = {"polar": "smooth", "node_set": "gauss", "nodes": np.int64(20)}
    free = {"theta_m": np.float32([80, 120]), "nu_theta": np.array([1.0, 1.5])}
    fixed = {"height": np.float32(3)}
    problem = Problem(landing_distance, free, (), fixed, setup, np.float32(1e-6))
    made = Made(problem, (0.3, 0.6))
    options = {"starts": np.int64(2), "steps": np.int32(2), "rate": np.float32(0.1)}
    log = tmp_path / "log.jsonl"
    found = optimise(problem, **options, seed=np.int64(1), log=log, evaluator=made)
    assert json.loads(found.history.attrs["problem"])["free"]["theta_m"] == [80, 120]
    assert json.loads(log.read_text().split("\n")[0])["asked"]["setup"]["nodes"] == 20


class Flat:
    """An evaluator that answers in shapes of its own."""

    def __init__(self, values, parameters):
        self.shape = values, parameters

    def __call__(self, points):
        shape = len(points), *self.shape
        return Evaluation(np.ones(shape[:2]), np.ones(shape))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"starts": 0}, "starts = 0"),
        ({"steps": 0}, "steps = 0"),
        ({"optimiser": "newton"}, "optimiser = 'newton' is not one of adam, lbfgs"),
        ({"rate": np.nan}, "rate = nan"),
        ({"tolerance": -1.0}, "tolerance = -1"),
        ({"patience": 0}, "patience = 0"),
        ({"polish": -1}, "polish = -1"),
        ({"seed": -1}, "seed = -1 is not allowed"),
        ({"starts": 8, "screen": 8}, "screen = 8 .* more than starts = 8, or 0"),
        ({"optimiser": "lbfgs", "rate": 0.1}, "rate = 0.1 is Adam's"),
        ({"optimiser": optax.adam}, "neither one of adam, lbfgs nor an optax"),
        ({"optimiser": optax.lbfgs()}, r"its update\(gradient, state, parameters\) fails"),
        ({"guesses": {"theta_m": 90.0}}, "not a list of values by name"),
        ({"evaluator": Made(problem_of(), (0, 0))}, "evaluator is that of another problem"),
        ({"evaluator": lambda points: (points, points)}, "gave a tuple, not an Evaluation"),
        ({"evaluator": Flat(3, 2)}, r"values of shape \(64, 3\): \(64, 1\) was asked for"),
        ({"evaluator": Flat(1, 3)}, r"gradients of shape \(64, 1, 3\): \(64, 1, 2\) was"),
    ],
)
def test_bad_options_are_named(options, message):
    problem = Problem(landing_distance, FREE, fixed={"height": 3.0})
    options = {"evaluator": Made(problem, (0, 0)), "screen": 0, **options}
    with pytest.raises((ValueError, TypeError), match=message):
        optimise(problem, **options)


def test_fixed_and_free_do_not_mix():
    with pytest.raises(ValueError, match="theta_m is both free and fixed"):
        Problem(landing_distance, FREE, fixed={"theta_m": 90.0})
