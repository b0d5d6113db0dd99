"""Objectives: closed forms, continuation past a tumble, algebra, one glide for all."""

from itertools import combinations
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AngleLimit,
    Driven,
    Gait,
    Glider,
    Ground,
    Launch,
    Outcome,
    Polar,
    Running,
    Serpenoid,
    Snake,
    TabulatedMotion,
    TimeLimit,
)
from jaxglide.body.sections import discretise
from jaxglide.ensemble.base import published_case
from jaxglide.search import objective as _objective
from jaxglide.search.objectives import (
    OBJECTIVES,
    Constraint,
    Objective,
    Trial,
    clearance,
    curvature,
    evaluate,
    glide_ratio,
    landing_distance,
    path_length,
    sink_rate,
    stability_margin,
    undulation_power,
    varied,
)
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

BASE = published_case({"polar": "smooth", "node_set": "gauss", "nodes": 40})


def glider_of(**gait):
    return Glider(Snake.from_svl(), Gait.from_degrees(**gait), Polar.smooth())


def ended(outcome, height, velocity=(0.5, 3.0, -4.0), largest=(10.0, 30.0, 20.0), **options):
    """A trial from 10 m whose glide, of 2 s, ended 5 m forward at some height."""
    trial = Trial(glider_of(), Launch(10.0), **options)
    state = jnp.zeros(13).at[:3].set(jnp.array([0.0, 5.0, height]))
    state = state.at[3:6].set(jnp.array(velocity)).at[12].set(5.5)
    trial.__dict__["glide"] = SimpleNamespace(
        outcome=jnp.asarray(int(outcome)),
        time=jnp.asarray(2.0),
        state=state,
        path_length=state[12],
        max_angles=jnp.deg2rad(jnp.array(largest)),
    )
    return trial


def test_a_landing_is_judged_as_it_is():
    trial = ended(Outcome.LANDED, 1e-13)
    assert float(landing_distance.function(trial)) == 5.0
    assert float(path_length.function(trial)) == 5.5
    assert float(glide_ratio.function(trial)) == pytest.approx(0.55)
    assert float(sink_rate.function(trial)) == 5.0
    margin = float(stability_margin.function(trial))
    assert 85 - 30 - 2.2 <= margin <= 85 - 30


@pytest.mark.parametrize("v_z", [-4.0, 0.0, 3.0])
def test_a_tumble_is_continued_by_the_parabola(v_z):
    trial = ended(Outcome.UNSTABLE_PITCH, 6.0, (0.5, 3.0, v_z), (10.0, 85.0, 20.0))
    drop = float(trial.drop_time)
    assert drop > 0
    assert 6.0 + v_z * drop - 9.81 * drop**2 / 2 == pytest.approx(0.0, abs=1e-12)
    assert float(landing_distance.function(trial)) == pytest.approx(5.0 + 3.0 * drop)
    assert float(path_length.function(trial)) == pytest.approx(5.5 + np.hypot(0.5, 3) * drop)
    assert float(sink_rate.function(trial)) == pytest.approx(10.0 / (2.0 + drop))


def test_nothing_jumps_where_a_tumble_comes_to_the_ground():
    landed = ended(Outcome.LANDED, 0.0, largest=(10.0, 85.0, 20.0))
    for name in ("landing_distance", "path_length", "sink_rate", "stability_margin"):
        function = OBJECTIVES[name].function
        gaps = [
            abs(
                float(function(ended(Outcome.UNSTABLE_PITCH, h, largest=(10.0, 85.0, 20.0))))
                - float(function(landed))
            )
            for h in (1e-2, 1e-4)
        ]
        assert gaps[1] < 0.011 * gaps[0] < 0.011, name


def test_the_margin_falls_with_the_height_left_and_has_a_slope_there():
    def margin(height):
        trial = ended(Outcome.UNSTABLE_PITCH, height, largest=(10.0, 85.0, 20.0))
        return stability_margin.function(trial)

    assert float(margin(8.0)) < float(margin(2.0)) < 1e-9
    assert float(jax.grad(margin)(4.0)) == pytest.approx(-8.5)


def test_curvature_of_an_arc():
    """Without waves the body is an arc that turns d_psi over its length."""
    arc = glider_of(theta_m=0.0, psi_m=0.0, d_psi=40.0, nu_theta=1.0)
    assert float(curvature(arc)) == pytest.approx(np.deg2rad(40.0), rel=1e-9)


def test_power_of_the_undulation_grows_with_the_cube_of_frequency():
    slow, fast = (float(undulation_power(glider_of(f_theta=f))) for f in (1.0, 2.0))
    assert slow > 0
    assert fast == pytest.approx(8 * slow, rel=1e-9)
    assert float(undulation_power(glider_of(f_theta=0.0))) == 0.0


def test_clearance_of_an_arc():
    """Without waves the body is an arc of half a circle: its chord over 0.15 of the length."""
    arc = glider_of(theta_m=0.0, psi_m=0.0, d_theta=180.0, d_psi=0.0, nu_theta=1.0)
    sections = discretise(arc.body)
    steps = np.abs(sections.fraction[:, None] - sections.fraction)
    nearest = float(steps[steps > 0.15].min())
    chord = 2 * np.sin(np.pi * nearest / 2) * float(arc.body.length) / np.pi
    assert float(clearance(arc)) == pytest.approx(chord / float(sections.chord.max()), rel=1e-3)


def test_clearance_is_the_least_of_a_cycle():
    """Against positions at 24 phases, pair by pair."""
    glider = glider_of(theta_m=115.0, nu_theta=1.45)
    sections, least = discretise(glider.body), np.inf
    at = jax.jit(
        lambda p: (
            backbone(sections, waves(glider.gait, neck, sections.fraction, p, 0.0)).position
        )
    )
    neck, fraction = glider.body.neck_fraction, np.asarray(sections.fraction)
    for phase in 2 * np.pi * np.arange(24) / 24:
        place = np.asarray(at(phase)).T
        for a, b in combinations(range(len(place)), 2):
            if fraction[b] - fraction[a] > 0.15:
                least = min(least, np.linalg.norm(place[a] - place[b]))
    expected = least / float(sections.chord.max())
    assert float(clearance(glider)) == pytest.approx(expected, rel=1e-9)
    assert float(clearance(glider_of(theta_m=119.7, nu_theta=1.45))) < expected


def test_properties_of_the_cycle_are_those_of_any_motion_that_has_one():
    gait = Gait.from_degrees(theta_m=115.0, nu_theta=1.45, d_theta=5.0, f_theta=1.5)
    driven = Driven(Serpenoid(), Running(gait))
    for objective in (curvature, undulation_power, clearance):
        one, other = (
            float(objective(Glider(Snake.from_svl(), motion))) for motion in (gait, driven)
        )
        assert one == pytest.approx(other, rel=1e-11), objective.name
        assert one > 0
    table = TabulatedMotion((0.0, 1.0), (0.0, 1.0), np.zeros((2, 2)), np.ones((2, 2)))
    for objective in (curvature, undulation_power, clearance):
        with pytest.raises(ValueError, match="gait = TabulatedMotion has no cycle"):
            objective(Glider(Snake.from_svl(), table))


def test_distance_and_margin_are_those_to_the_ends_that_were_given():
    """A ground at 4 m, 60 degrees of pitch: the same as 6 m lower with that limit."""
    ends = Ground(4.0), AngleLimit.degrees(60.0, ("pitch",))
    raised = ended(Outcome.UNSTABLE_PITCH, 7.0, largest=(80.0, 60.0, 80.0), ends=ends)
    assert float(raised.height_left) == 3.0
    assert float(sink_rate.function(raised)) == pytest.approx(
        6.0 / (2.0 + float(raised.drop_time))
    )
    assert float(stability_margin.function(raised)) == pytest.approx(-60 * 3 / 6)
    both = Ground(), AngleLimit.degrees(60.0, ("pitch",)), AngleLimit.degrees(85.0, ("roll",))
    margin = float(stability_margin.function(ended(Outcome.LANDED, 0.0, ends=both)))
    assert margin == pytest.approx(60 - 30, abs=1e-3)
    for ends, message in (
        ((AngleLimit(), TimeLimit(2.0)), "ends hold no Ground"),
        ((Ground(), TimeLimit(2.0)), "ends hold no AngleLimit"),
    ):
        with pytest.raises(ValueError, match=message):
            stability_margin.function(ended(Outcome.LANDED, 0.0, ends=ends))


def test_anything_can_be_varied():
    """Multiples of a motion's own float, and of the limit of an end."""
    glider = Glider(Snake.from_svl(), Driven(Serpenoid(), Running(Gait.from_degrees())))
    halved, whole = (
        varied(curvature, {"inputs[0]": [f], "inputs[1]": [f], "inputs[3]": [f]})(glider)
        for f in (0.5, 1.0)
    )
    assert float(whole) == pytest.approx(float(curvature(glider)), rel=1e-12)
    assert 0.45 * float(whole) < float(halved) < 0.55 * float(whole)
    limit = Objective("limit", "deg", lambda trial: jnp.rad2deg(trial.limits[0].limit))
    assert float(varied(limit, {"limit": [0.5, 1.0]})(glider)) == pytest.approx(0.75 * 85)


def test_algebra_of_objectives():
    trial = ended(Outcome.LANDED, 0.0)
    total = landing_distance - 0.5 * sink_rate
    assert total.name == "landing_distance - 0.5 * sink_rate"
    assert total.unit == "mixed"
    assert float(total.function(trial)) == pytest.approx(5.0 - 2.5)
    assert sink_rate.wanted.function(trial) == -5.0
    assert sink_rate.wanted.sense == 1
    assert landing_distance.wanted is landing_distance
    at_least, at_most = landing_distance.at_least(3.0, 0.5), sink_rate.at_most(4.0)
    assert str(at_least) == "landing_distance >= 3"
    assert float(at_least.slack(trial)) == pytest.approx(4.0)
    assert str(at_most) == "sink_rate <= 4"
    assert float(at_most.slack(trial)) == pytest.approx(-1.0)


def test_names_are_those_the_command_line_offers():
    for name, objective in OBJECTIVES.items():
        assert objective.name == name


def test_objectives_together_fly_once(monkeypatch):
    count = []
    flown = ended(Outcome.LANDED, 0.0).glide

    def once(*_, **options):
        count.append(options)
        return flown

    monkeypatch.setattr(_objective, "simulate", once)
    values = evaluate([landing_distance, sink_rate], glider_of(), Launch(10.0), rtol=1e-5)
    assert count == [{"rtol": 1e-5}]
    np.testing.assert_allclose(values, [5.0, 5.0])


@pytest.mark.slow
def test_gradients_of_flown_objectives_against_differences():
    """All that fly, with respect to amplitude and bend, by steps of fixed length."""
    apart = "squared_pitch_moment", "steady_glide_angle", "steady_sink_rate", "spectral_radius"
    flown = [OBJECTIVES[n] for n in OBJECTIVES if n not in apart]

    def values(x):
        case = BASE.replace({"theta_m": x[0], "d_psi": x[1], "height": 2.0})
        return (evaluate(flown, case.glider, case.launch, step=2e-3),) * 2

    both = jax.jit(jax.jacfwd(values, has_aux=True))
    here = jnp.array([96.5, 10.0])
    jacobian, _ = both(here)
    for i, h in enumerate((1e-2, 1e-2)):
        d = h * np.eye(2)[i]
        near = both(here + d)[1] - both(here - d)[1]
        far = both(here + 2 * d)[1] - both(here - 2 * d)[1]
        expected = (8 * near - far) / (12 * h)
        np.testing.assert_allclose(jacobian[:, i], expected, rtol=2e-5, atol=1e-9)


@pytest.mark.slow
def test_varied_objectives_are_means_and_worst_values():
    case = {"height": 0.5}
    pairs = [(0.9, 1.1), (1.1, 0.9)]
    factors = {"lift_scale": [a for a, _ in pairs], "mass": [b for _, b in pairs]}

    @jax.jit
    def both(lift, mass):
        changed = BASE.replace({**case, "lift_scale": lift, "mass": mass, "speed": 2.0})
        trial = Trial(changed.glider, changed.launch)
        mean = varied(landing_distance, factors).function(trial)
        worst = varied(sink_rate, factors, "worst").function(trial)
        return mean, worst, landing_distance.function(trial), sink_rate.function(trial)

    mass = float(Snake.from_svl().mass)
    mean, worst, _, _ = both(1.0, mass)
    each = np.array([both(a, b * mass)[2:] for a, b in pairs])
    assert float(mean) == pytest.approx(each[:, 0].mean(), abs=2e-5)
    assert float(worst) == pytest.approx(each[:, 1].max(), abs=2e-4)
    assert each[0, 0] != pytest.approx(each[1, 0], abs=1e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: landing_distance.at_least(np.nan), "bound of landing_distance = nan m"),
        (lambda: landing_distance.at_least(1, scale=0), "scale of landing_distance = 0"),
        (
            lambda: varied(path_length, {"wings": [1.0]})(glider_of()),
            "there is no parameter 'wings'",
        ),
        (
            lambda: varied(path_length, {"phi_theta": [1.0]})(glider_of()),
            "phi_theta is left out: there is nothing to multiply",
        ),
        (lambda: varied(path_length, {"mass": [0.0]}), "factors of mass = 0"),
        (lambda: varied(path_length, {"mass": [1.0], "speed": [1, 1]}), "one length"),
        (lambda: varied(path_length, {"mass": [1.0]}, "best"), "how = 'best' is not one of"),
        (lambda: varied(path_length, {"mass": []}), "one list each"),
        (lambda: varied(path_length, {"mass": 1.0}), "one list each"),
        (lambda: varied(path_length, {}), "one list each"),
        (lambda: landing_distance.at_least("far"), "bound of landing_distance = 'far' is not"),
        (lambda: landing_distance.at_most([1, 2]), "is .*, not one number"),
        (lambda: Constraint(len, 1.0, 1, 1.0), "is not an Objective"),
        (lambda: Constraint(landing_distance, 1.0, 2, 1.0), "side = 2 is neither"),
        (lambda: Objective("far", "m", 3.0), "needs a name and a function"),
        (lambda: Objective("far", "m", len, 0), "sense = 0 is neither"),
        (lambda: landing_distance * "2", "unsupported|can't multiply"),
        (lambda: landing_distance + "2", "unsupported operand"),
        (lambda: landing_distance * landing_distance, "unsupported operand"),
        (lambda: np.ones(2) * landing_distance, "unsupported operand"),
        (lambda: landing_distance * np.nan, "a number beside an objective = nan"),
        (lambda: landing_distance / 0, "landing_distance cannot be divided by 0"),
        (lambda: evaluate([], None), "no objectives"),
        (lambda: Objective("all", "m", lambda _: jnp.ones(3)).value(None), "not one number"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises((ValueError, TypeError), match=message):
        make()


def test_numbers_are_added_to_objectives():
    trial = ended(Outcome.LANDED, 0.0)
    for made, value, name in (
        (landing_distance * 2 + 1, 11.0, "2 * landing_distance + 1"),
        (1 - landing_distance, -4.0, "-landing_distance + 1"),
        (landing_distance - 0.25, 4.75, "landing_distance - 0.25"),
        (np.float64(3) * landing_distance / 2, 7.5, "0.5 * 3 * landing_distance"),
        (sum([landing_distance, path_length]), 10.5, "landing_distance + path_length"),
    ):
        assert float(made.value(trial)) == pytest.approx(value), name
        assert made.name == name
        assert made.unit == "m"
    assert (sink_rate + 1).sense == (sink_rate + sink_rate).sense == -1
    assert (1 - sink_rate).sense == (landing_distance - sink_rate).sense == 1


def test_weights_and_bounds_are_named_exactly():
    assert (landing_distance * 0.1234567891).name == "0.1234567891 * landing_distance"
    assert str(landing_distance.at_least(10.0000001)) == "landing_distance >= 10.0000001"


def test_without_gravity_a_tumble_goes_straight_on():
    """From 6 m at 4 m/s downwards 1.5 s; upwards it never lands."""

    def trial(v_z):
        made = ended(Outcome.UNSTABLE_ROLL, 6.0, (0.5, 3.0, v_z))
        made.glider = eqx.tree_at(lambda g: g.gravity, made.glider, jnp.zeros(()))
        return made

    assert float(trial(-4.0).drop_time) == pytest.approx(1.5)
    assert float(landing_distance.value(trial(-4.0))) == pytest.approx(9.5)
    assert np.isinf(float(landing_distance.value(trial(4.0))))
