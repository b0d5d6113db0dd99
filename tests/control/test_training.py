"""Laws that are trained: gradients, progress, the log, and how they are judged."""

import dataclasses
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AngleLimit,
    Case,
    Gait,
    Glider,
    Ground,
    Gust,
    Launch,
    Polar,
    Snake,
    evaluate_policy,
    train_policy,
)
from jaxglide.control import Constant, Environment, GainScheduled, NeuralPolicy, Senses
from jaxglide.control.regulator import SENSED, Regulator
from jaxglide.control.sampled import Linear
from jaxglide.control.training import Terms, begin, fly, parts_of, upright

SHORT = {"flights": 2, "window": 4, "samples": 8, "rate": 3e-3, "progress": False}


@pytest.fixture(scope="module")
def environment() -> Environment:
    """The default snake in gusts, one step of the solver from sample to sample."""
    body = Snake.from_svl(0.70, nodes=20, node_set="gauss")
    air = Gust([0.0, 0.0, 0.0], gust_start=0.0, gust_length=3.0)
    glider = Glider(body, Gait.from_degrees(d_psi=5), Polar.smooth(), air=air)
    vary = {
        "launch.speed": (1.5, 2.0),
        "lift_scale": (0.9, 1.1),
        "air.velocity[0]": (-1, 1),
    }
    ends = Ground(), AngleLimit.degrees(60)
    case = Case(glider, Launch(height=6.0), ends)
    return Environment(case, vary=vary, senses=Senses(0.02, 0.1), samples=16, step=0.05)


@pytest.fixture(scope="module")
def policy(environment) -> NeuralPolicy:
    return NeuralPolicy.of(environment, Constant(environment.plant.inputs), width=8, history=2)


def made_up(environment, seed=0) -> Regulator:
    """A regulator of numbers drawn, which steers somehow."""
    rng, count, n, c = np.random.default_rng(seed), 16, 15, 2

    def draw(*shape):
        return jnp.asarray(0.1 * rng.normal(size=shape))

    linear = Linear(draw(count, n), draw(count, n, n), draw(count, n, c))
    held, none = environment.plant.inputs, jnp.zeros(())
    along = jnp.broadcast_to(held[np.array(environment.chosen)], (count, c)), jnp.zeros(n)
    limits = -0.3 * jnp.ones(c), 0.5 * jnp.ones(c)
    told = *along, held, *limits, none, none, environment.chosen
    return Regulator(linear, draw(count, c, n), draw(count, n, n - SENSED.start), *told)


@pytest.mark.slow
def test_gradient_is_the_differences_of_the_loss(environment, policy):
    """Of all weights along one direction, through a window of flights that are under way."""
    learned, fixed = parts_of(policy)
    keys = jax.random.split(jax.random.PRNGKey(1), 2)
    backward = dataclasses.replace(environment.plant, backward=True)
    environment = eqx.tree_at(lambda e: e.plant, environment, backward)
    courses = begin(policy, environment, keys, jnp.full(2, 8))
    terms = Terms(4, 8, upright, None)
    rng = np.random.default_rng(0)
    learned = jax.tree.map(lambda x: x + 0.1 * rng.normal(size=x.shape), learned)
    along = jax.tree.map(lambda x: rng.normal(size=x.shape), learned)

    def at(share):
        moved = jax.tree.map(lambda x, d: x + share * d, learned, along)
        return fly(moved, fixed, environment, courses, terms)

    courses = at(0.0)[2]
    np.testing.assert_array_equal(courses.sensed.sample, 4)
    values, slopes = at(0.0)[:2]
    assert (values > 0).all()
    dots = jax.tree.map(lambda g, d: jnp.sum(g * d, range(1, g.ndim)), slopes, along)
    differences = (at(1e-5)[0] - at(-1e-5)[0]) / 2e-5
    np.testing.assert_allclose(sum(jax.tree.leaves(dots)), differences, rtol=1e-5)


@pytest.mark.slow
def test_training_goes_on_after_a_kill_as_if_nothing_had_been(
    environment, policy, tmp_path, monkeypatch
):
    """It lowers the loss, is the same by the same seed, and a log goes on where it was."""
    whole = train_policy(policy, environment, updates=8, **SHORT)
    assert whole.losses[-2:].mean() < whole.losses[:2].mean()
    assert not np.array_equal(
        whole.policy.network.layers[-1].weight, policy.network.layers[-1].weight
    )
    np.testing.assert_array_equal(whole.policy.base.inputs, policy.base.inputs)

    log = tmp_path / "training.log"
    monkeypatch.setattr("jaxglide.control.training._KEPT", 3)
    asked = {"updates": 8, "log": log, **SHORT}
    kept: list[bytes] = []

    def killed(path: Path, data: bytes):
        path.write_bytes(data)
        kept.append(data)
        if len(kept) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("jaxglide.control.training.write_bytes", killed)
        with pytest.raises(KeyboardInterrupt):
            train_policy(policy, environment, **asked)
    again = train_policy(policy, environment, **asked)
    np.testing.assert_array_equal(again.losses, whole.losses)
    np.testing.assert_array_equal(again.landed, whole.landed)
    for a, b in zip(jax.tree.leaves(again.policy), jax.tree.leaves(whole.policy), strict=True):
        np.testing.assert_array_equal(a, b)

    with pytest.raises(ValueError, match="is the log of another training"):
        train_policy(policy, environment, **{**asked, "seed": 1})
    with pytest.raises(ValueError, match="is the log of another training"):
        train_policy(policy, environment, **asked, cost=lambda state: 2 * upright(state))
    log.write_bytes(log.read_bytes()[:-1] + b"x")
    with pytest.raises(ValueError, match="is damaged"):
        train_policy(policy, environment, **asked)
    log.write_text("something else")
    with pytest.raises(ValueError, match="is not the log of a training"):
        train_policy(policy, environment, **asked)


def test_laws_that_have_learnt_nothing_are_what_they_start_from(environment):
    """Sample by sample, their memories too, of whatever is sensed."""
    regulator = made_up(environment)
    laws = (
        regulator,
        GainScheduled.of(environment, regulator),
        NeuralPolicy.of(environment, regulator, history=3),
    )
    _, sensed = environment.reset(jax.random.key(0))
    rng = np.random.default_rng(0)
    memories, told = [law.start() for law in laws], environment.plant.inputs
    for sample in range(4):
        angles, omega = jnp.asarray(rng.normal(size=(2, 3)) * 0.2)
        sensed = sensed._replace(
            sample=jnp.asarray(sample), angles=angles, omega=omega, told=told
        )
        found = [law(memory, sensed) for law, memory in zip(laws, memories, strict=True)]
        told, memories = found[0][0], [memory for _, memory in found]
        for inputs, _ in found[1:]:
            np.testing.assert_allclose(inputs, told, rtol=0, atol=1e-12)
        assert np.abs(told - environment.plant.inputs).max() > 1e-3


def test_gains_change_linearly_between_knots(environment):
    """Half way between two knots the law is the mean of both, beyond the last the last."""
    regulator = made_up(environment)
    law = GainScheduled.of(environment, regulator, (0.0, 1.0))
    change = jnp.stack([jnp.zeros_like(law.forward[0]), jnp.full_like(law.forward[0], 0.1)])
    law = eqx.tree_at(lambda one: one.forward, law, change)
    _, sensed = environment.reset(jax.random.key(0))
    sensed = sensed._replace(told=environment.plant.inputs)
    index = np.array(environment.chosen)
    for sample, share in ((8, 0.5), (16, 1.0), (40, 1.0)):
        now = sensed._replace(sample=jnp.asarray(sample))
        memory = law.start()
        plain, learnt = (one(memory, now)[0][index] for one in (regulator, law))
        wanted = np.clip(plain + share * 0.1 * law.half, regulator.low, regulator.high)
        np.testing.assert_allclose(learnt, wanted, rtol=0, atol=1e-12)


def test_what_is_drawn_stands_beside_what_came_of_it(environment):
    held = Constant(environment.plant.inputs)
    found = evaluate_policy(environment, held, 5, seed=3, samples=30)
    assert found.sizes["flight"] == 5
    speed, lift = found["launch.speed"], found["aerodynamics.polar.lift_scale"]
    assert len(set(speed.values.tolist())) == 5
    assert speed.min() >= 1.5
    assert speed.max() <= 2.0
    assert speed.units == "m/s"
    assert 0.9 <= lift.min() <= lift.max() <= 1.1
    again = evaluate_policy(environment, held, 2, seed=3, samples=30)
    other = evaluate_policy(environment, held, 2, seed=4, samples=30)
    assert not np.array_equal(again.time, other.time)


def test_bad_input(environment, policy):
    with pytest.raises(ValueError, match="Constant has nothing to learn"):
        train_policy(Constant(environment.plant.inputs), environment)
    with pytest.raises(ValueError, match=r"window = 9 is not allowed: it must be in \[1, 8\]"):
        train_policy(policy, environment, window=9, samples=8)
    with pytest.raises(TypeError, match="policy"):
        train_policy(environment, environment)
    with pytest.raises(ValueError, match="rate = 0 is not allowed"):
        train_policy(policy, environment, rate=0.0)
    with pytest.raises(
        ValueError, match=r"knots = \(1, 2\) is not allowed: they ascend from 0"
    ):
        GainScheduled.of(environment, made_up(environment), (1, 2))
    with pytest.raises(ValueError, match="history"):
        NeuralPolicy.of(environment, policy, history=0)
    with pytest.raises(ValueError, match="flights"):
        evaluate_policy(environment, policy, 0)
