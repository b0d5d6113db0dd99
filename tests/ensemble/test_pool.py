"""Flights in pools of lanes: the same as alone, whoever the neighbours are."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    Actuated,
    Driven,
    Gait,
    LaggingCirculation,
    Launch,
    Polar,
    Serpenoid,
    Snake,
    Study,
    simulate,
)
from jaxglide._lib.dependence import depends
from jaxglide.air.air import UniformWind
from jaxglide.ensemble import batch
from jaxglide.ensemble.base import published_case
from jaxglide.ensemble.batch import Supply, flown, solve
from jaxglide.flight.case import Case
from jaxglide.flight.dynamics import RIGID, Glider
from jaxglide.flight.ends import AngleLimit, End, Ground, Outcome, TimeLimit

TIMES = np.array([0.0, 0.05, 0.1, 0.1, 0.3, 9.0])


def height(time, state):
    """Above half a metre [m]."""
    return state[2] - 0.5 + 0.0 * time


def random_cases(count, seed, **more):
    """Random gaits in the observed ranges."""
    rng, case = np.random.default_rng(seed), published_case()
    ranges = {case.name(p): a.observed for p, a in case.parameters.items() if a.observed}
    assert len(ranges) >= 5
    return {n: rng.uniform(*ends, count) for n, ends in ranges.items()} | more


def alone(study, k, **options):
    """A case of a study by `simulate`."""
    case = study.base.replace({n: v[k] for n, v in study.varied.items()})
    given = {"rtol": study.rtol, "atol": study.atol, "max_time": study.max_time, **options}
    return simulate(case.glider, case.launch, ends=case.ends, **given)


def compare(study, times=None, **options):
    """Every case in a pool and alone: the same steps, and numbers but for rounding."""
    pooled = solve(study, np.arange(len(study)), 16)
    for k in range(len(study)):
        glide, found = (
            alone(study, k, times=times, **options),
            {n: v[k] for n, v in pooled.items()},
        )
        for name in ("outcome", "accepted", "rejected"):
            assert int(getattr(glide, name)) == found[name], (k, name)
        np.testing.assert_allclose(found["landing_point"], glide.landing_point, 0, 1e-8)
        np.testing.assert_allclose(found["time"], glide.time, 1e-8)
        np.testing.assert_allclose(found["end_angles"], glide.end_angles, 0, 1e-7)
        np.testing.assert_allclose(found["max_angles"], glide.max_angles, 0, 1e-7)
        if times is not None:
            np.testing.assert_allclose(found["states"], glide.states, 0, 1e-7)
    return pooled


# A longer flight amplifies rounding until a step more or less is taken: see the next test.
def test_short_flights_as_alone_step_by_step():
    heights = np.random.default_rng(0).uniform(0.05, 0.8, 24)
    study = Study(
        cases=random_cases(24, 1, height=heights), setup={"polar": "smooth"}, times=TIMES
    )
    pooled = compare(study, TIMES)
    assert pooled["accepted"].max() > 3 * pooled["accepted"].min()


def test_whole_flights_as_alone_within_the_tolerance():
    study = Study(cases=random_cases(12, 2), setup={"polar": "smooth"}, rtol=1e-9, atol=1e-9)
    pooled = solve(study, np.arange(12), 16)
    assert len(np.unique(pooled["outcome"])) >= 2
    steps = []
    for k in range(12):
        glide = alone(study, k)
        assert int(glide.outcome) == pooled["outcome"][k]
        np.testing.assert_allclose(pooled["landing_point"][k], glide.landing_point, atol=1e-5)
        steps.append(int(glide.accepted + glide.rejected))
    np.testing.assert_allclose(
        (pooled["accepted"] + pooled["rejected"]).sum(), sum(steps), 0.02
    )


def test_ends_of_all_kinds_as_alone():
    """The ground, an angle, a time, an own function, no time, no steps, over at the start."""
    ends = Ground(), AngleLimit.degrees(2.0, "roll"), TimeLimit(0.2), End(height, "was low")
    base = published_case({"polar": "smooth"})
    case = Case(base.glider, base.launch, ends, base.follow)
    cases = {
        "height": [0.6, 8.0, 8.0, 8.0, 8.0, 8.0],
        "ends[0].level": [0.0, 7.99, 0.0, 0.0, 0.0, 0.0],
        "ends[1].limit": [90.0, 90.0, 2.0, 90.0, 90.0, 90.0],
        "ends[2].end_time": [9.0, 9.0, 9.0, 0.2, 9.0, 0.0],
    }
    study = Study(cases=cases, case=case, max_time=0.3)
    pooled = compare(study)
    low, timed, roll = 8, 7, Outcome.UNSTABLE_ROLL
    expected = [low, Outcome.LANDED, roll, timed, Outcome.OUT_OF_TIME, timed]
    assert pooled["outcome"].tolist() == expected
    assert pooled["time"][-1] == 0
    few = Study(cases={"height": [8.0, 9.0]}, max_steps=5)
    pooled = compare(few, max_steps=5)
    assert pooled["outcome"].tolist() == [Outcome.OUT_OF_STEPS] * 2


def leaning(time, observation):
    """Inputs of a serpenoid that turns against its roll."""
    return jnp.stack([1.7, 0.35, 1.4, 0.1, -0.3 * observation.angles[2], 1.2])


@pytest.mark.parametrize("lagging", [False, True])
def test_own_states_of_parts_as_alone(lagging):
    """A drive's own states, fed back, and the circulation's, which start with the flow."""
    gait, polar = Gait.from_degrees(nu_theta=1.4), Polar.smooth()
    motion = Driven(Serpenoid(), Actuated(leaning, gait, natural_frequency=25.0))
    glider = Glider(
        Snake.from_svl(nodes=20, node_set="gauss"),
        motion,
        LaggingCirculation(polar) if lagging else polar,
    )
    launch = Launch(0.5, 1.7, angles=(0.1, 0.0, 0.2))
    case = Case(glider, launch, (Ground(),))
    heights = np.random.default_rng(4).uniform(0.1, 0.7, 12)
    varied = {"height": heights, "natural_frequency": np.linspace(10.0, 40.0, 12)}
    pooled = compare(Study(cases=varied, case=case, times=TIMES), TIMES)
    own = pooled["states"].shape[2] - RIGID
    assert own == (33 if lagging else 13)
    first = pooled["states"][:, 0, RIGID:]
    assert np.ptp(pooled["states"][:, 1, RIGID:] - first, axis=0).max() > 1e-3


def test_what_is_not_finite_is_said_and_stops_nobody():
    def broken(time, state):
        return jnp.where(time > 0.05, jnp.nan, 1.0)

    base = published_case()
    air = UniformWind(velocity=jnp.array([0.0, 0.0, 0.0]))
    glider = Glider(base.glider.body, base.glider.gait, base.glider.aerodynamics, air)
    case = Case(glider, base.launch, (*base.ends, End(broken, "broke")))
    study = Study(cases={"height": [0.4, 0.01], "air.velocity[0]": [1.0, 0.0]}, case=case)
    found = solve(study, np.arange(2), 8)
    assert found["outcome"].tolist() == [Outcome.NON_FINITE, Outcome.LANDED]


def test_lanes_are_busy(monkeypatch):
    """More than nine tenths of the lanes' steps are of a flight, where there are many."""
    turns, fly = [], batch.fly

    def counted(program, values, fleet, shared):
        before = program.turn._cache_size()
        for found in fly(program, values, fleet, shared):
            turns.append((int(found[2].steps) * fleet.lanes, int(found[2].busy)))
            yield found
        # nothing is compiled twice: the first turn is the same program as the others
        assert program.turn._cache_size() - before <= len(set(fleet.devices))

    monkeypatch.setattr(batch, "fly", counted)
    study = Study(
        cases=random_cases(200, 3, height=np.full(200, 0.7)), setup={"polar": "smooth"}
    )
    pooled = solve(study, study.order(), 16)
    steps, busy = np.sum(turns, axis=0)
    assert busy / steps > 0.9
    # every attempt is counted, and for every flight the one that finds its first rate
    assert busy == (pooled["accepted"] + pooled["rejected"] + 1).sum()


def test_an_error_of_a_thread_is_raised(monkeypatch):
    study = Study({"nu_theta": [1.1, 1.2]}, fixed={"height": 0.1})
    monkeypatch.setattr(batch.Supply, "take", lambda self: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        list(flown(study, np.arange(2), 8))


def test_cases_are_handed_out_once_and_ever_fewer():
    supply = Supply(1000, 2, 8, 256)
    sizes, seen, done = [], [], False
    while not done:
        cases, done = supply.take()
        sizes.append(len(cases))
        seen.extend(cases)
    assert seen == list(range(1000))
    assert sizes[0] == 250
    assert sorted(sizes, reverse=True) == sizes
    assert min(sizes[:-1]) == 8
    assert supply.take()[1]


def test_what_depends_on_what():
    def function(x, y):
        return {
            "a": jnp.sin(y["one"]),
            "b": x["p"] * y["one"],
            "c": x["q"][0],
            "d": jnp.ones(2),
        }

    x = {"p": jnp.ones(()), "q": jnp.ones(2)}
    structure, moved = depends(function, x, {"one": jnp.ones(())})
    found = jax.tree.unflatten(structure, moved)
    assert found == {"a": False, "b": True, "c": True, "d": False}
