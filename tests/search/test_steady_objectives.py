"""Objectives of steady glides: what they read, and their derivatives without the search."""

from types import SimpleNamespace

import numpy as np
import pytest

import jaxglide as jg
from jaxglide.search import Evaluation, objectives
from jaxglide.search.steady import SteadyJudge
from jaxglide.steady.closure import Kind

slow = pytest.mark.slow

SETUP = {"polar": "smooth", "node_set": "gauss", "nodes": 40}
FREE = {"theta_m": (80, 120), "nu_theta": (1.0, 1.6), "f_theta": (0.6, 2.0)}
NAMES = "steady_glide_angle", "steady_sink_rate", "spectral_radius"


def problem_of(**changes):
    return jg.Problem(
        jg.steady_glide_angle.wanted,
        FREE,
        [jg.spectral_radius.at_most(0.95, scale=0.1), jg.steady_sink_rate.at_most(8.0)],
        **{"setup": SETUP, **changes},
    )


def test_they_read_the_steady_glide_of_a_trial():
    trial = jg.Trial(problem_of().base.glider)
    glide = SimpleNamespace(glide_angle=np.pi / 6, sink_rate=5.0, spectral_radius=0.9)
    asked = []
    trial.known = lambda glider: asked.append(glider) or glide
    values = [float(objectives.OBJECTIVES[name].value(trial)) for name in NAMES]
    np.testing.assert_allclose(values, [30.0, 5.0, 0.9])
    assert asked == [trial.glider]
    assert [objectives.OBJECTIVES[name].sense for name in NAMES] == [-1, -1, -1]


@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({}, Kind(False, True)),
        ({"fixed": {"d_theta": 3.0}}, Kind(False, False)),
        ({"fixed": {"f_theta": 0.0}}, Kind(True, False)),
    ],
)
def test_which_equation_a_problem_asks_for(changes, kind):
    free = {
        name: bounds for name, bounds in FREE.items() if name not in changes.get("fixed", {})
    }
    problem = jg.Problem(jg.spectral_radius.wanted, free, setup=SETUP, **changes)
    assert SteadyJudge(problem, gradients=False)._kind == kind


def test_an_evaluator_judges_steady_glides_apart(monkeypatch):
    told = Evaluation(np.array([[-30.0, 1.0, 2.0]]), np.zeros((1, 3, 0)))
    monkeypatch.setattr(SteadyJudge, "__call__", lambda self, points, given: told)
    assert jg.Evaluator(problem_of(), gradients=False)(np.array([[96.0, 1.4, 1.2]])) is told
    mixed = jg.Problem(jg.curvature.wanted, FREE, [jg.spectral_radius.at_most(1)], setup=SETUP)
    assert jg.Evaluator(mixed)._steady is not None
    assert jg.Evaluator(jg.Problem(jg.curvature.wanted, FREE, setup=SETUP))._steady is None


@slow
def test_values_and_gradients_against_glides_found_again():
    problem = problem_of()
    here = np.array([96.0, 1.4, 1.21])  # a frequency near which all take as many steps
    h = np.array([1e-3, 1e-5, 1e-5])
    sloped, plain = (SteadyJudge(problem, gradients) for gradients in (True, False))
    found = sloped(here[None], problem.given())
    assert found.gradients.shape == (1, 3, 3)
    glide = jg.steady_glide(problem.at(dict(zip(FREE, here, strict=True))).glider)
    told = found.values[0]
    assert told[1] >= (0.95 - float(glide.spectral_radius)) / 0.1 - 1e-6  # of several the best
    around = np.concatenate([here + s * np.diag(h) for s in (1, -1)])
    values = plain(around, problem.given()).values
    expected = (values[:3] - values[3:]) / (2 * h[:, None])
    np.testing.assert_allclose(found.gradients[0], expected.T, rtol=2e-4, atol=1e-6)
    cold = plain.roots(here[None])
    warm = plain.roots(around, np.repeat(cold.u, 6, axis=0))
    assert (warm.coarse < cold.coarse[0] / 2).all()
    assert (warm.full > 0).all()
    again = plain.judge(around, warm.u, problem.given()).values
    np.testing.assert_allclose(again, values, rtol=1e-9)


@slow
def test_where_nothing_is_found_there_are_no_numbers():
    judge = SteadyJudge(problem_of(), gradients=True)
    nothing = np.full((1, 8), np.nan)
    found = judge.judge(np.array([[96.0, 1.4, 1.2]]), nothing, problem_of().given())
    assert np.isnan(found.values).all()
    assert not found.finite.any()
