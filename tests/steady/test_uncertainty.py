"""How sure steady glides are: exact derivatives, samples, finer nodes."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import jaxglide as jg
from jaxglide.steady.uncertainty import in_sum

slow = pytest.mark.slow
NEAR_LONG = [0.09, 8.94, -3.80, 0.017, 0.932, -0.780, -0.0863, -0.0789]
NAMES = ("speed", "glide_angle", "forward_speed", "sink_rate", "spectral_radius")


def with_polar(polar, nodes=40):
    """The gait that glides 143 m from 75 m."""
    body = jg.Snake.from_svl(0.70, nodes=nodes, node_set="gauss")
    return jg.Glider(body, jg.Gait.from_degrees(60, 0.0, 1.738, 1.30, 5.5), polar)


def numbers(glide):
    moduli = np.abs(np.asarray(glide.multipliers))
    return {name: float(getattr(glide, name)) for name in NAMES} | {"moduli": moduli}


def moved(polar, cells):
    return eqx.tree_at(lambda polar: polar.cells, polar, polar.cells + cells)


@pytest.fixture(scope="module")
def polar():
    return jg.Polar.band_limited()


@pytest.fixture(scope="module")
def glide(polar):
    return jg.steady_glide(with_polar(polar), NEAR_LONG)


@pytest.fixture(scope="module")
def unsure(glide):
    return glide.uncertainty


def test_deviations_add_up_as_squares_and_multipliers_that_meet_have_none():
    """A real one far from the others, and a pair that is nearly real."""
    found = {"multipliers": np.array([2.0, 0.5 + 0.01j, 0.5 - 0.01j]), "speed": np.array(9.0)}
    pair = [0.02 + 0.01j, 0.02 - 0.01j]
    rates = {
        "multipliers": np.array([[0.3, *pair], [0.4, *pair]]),
        "speed": np.array([3.0, 4.0]),
    }
    off = in_sum(found, rates)
    assert off["speed"] == pytest.approx(5)
    assert off["spectral_radius"] == pytest.approx(0.5)
    np.testing.assert_allclose(off["moduli"], [0.5, np.nan, np.nan])
    apart = {"multipliers": np.array([2.0, 0.5 + 0.1j, 0.5 - 0.1j])}
    here = np.sqrt(2) * (0.02 * 0.5 + 0.01 * 0.1) / np.hypot(0.5, 0.1)
    moduli = in_sum(apart, {"multipliers": rates["multipliers"]})["moduli"]
    np.testing.assert_allclose(moduli, [0.5, here, here])


def test_what_a_coefficient_may_be_off_by_itself(polar):
    """Through the general function: the covariance at an angle is that of the polar."""
    beta, reynolds = np.array([0.2, 1.0]), np.array([5000.0, 9000.0])

    def coefficients(glider):
        lift, drag = glider.aerodynamics.polar(beta, reynolds)
        return {"lift": lift, "drag": drag[0]}

    off = jg.standard_deviation(coefficients, with_polar(polar))
    cells = np.asarray(polar.spread().cells)
    each = [
        np.stack([np.asarray(p(beta, reynolds)) for p in (moved(polar, c), polar)])
        for c in cells[::31]
    ]
    assert off["lift"].shape == (2,)
    assert off["drag"].shape == ()
    partly = np.sqrt(sum((a - b) ** 2 for a, b in each))
    assert (partly[0] <= off["lift"] + 1e-12).all()
    scaled = jg.standard_deviation(coefficients, with_polar(jg.Polar.band_limited(None, 2.0)))
    np.testing.assert_allclose(scaled["lift"], 2 * off["lift"], rtol=1e-9)
    assert 0.03 < off["lift"][0] < 0.05
    assert 0.02 < off["drag"] < 0.04


def test_without_a_spread_nobody_knows():
    with pytest.raises(ValueError, match="polar of type Polar has no spread"):
        jg.standard_deviation(lambda glider: glider.gravity, with_polar(jg.Polar.smooth()))


@slow
def test_to_first_order_it_is_what_glides_found_again_say(polar, glide, unsure, monkeypatch):
    """Along one mixture of all deviations, by central differences."""
    z = np.random.default_rng(0).normal(size=len(polar.spread().cells))
    cells = np.tensordot(z, np.asarray(polar.spread().cells), 1)
    parts = lambda polar: (polar.cells, polar.lift_scale, polar.drag_scale)  # noqa: E731
    one = eqx.tree_at(parts, polar, (jnp.asarray(cells)[None], jnp.zeros(1), jnp.zeros(1)))
    monkeypatch.setattr(jg.Polar, "spread", lambda polar: one)
    along = glide.uncertainty
    step = 0.01
    ends = [
        numbers(jg.steady_glide(with_polar(moved(polar, sign * step * cells)), glide.state))
        for sign in (1, -1)
    ]
    for name in NAMES:
        expected = abs(ends[0][name] - ends[1][name]) / (2 * step)
        assert float(getattr(along, name)) == pytest.approx(expected, rel=1e-3), name
    moduli = np.abs(ends[0]["moduli"] - ends[1]["moduli"]) / (2 * step)
    np.testing.assert_allclose(along.moduli[:6], moduli[:6], rtol=1e-3)


@slow
def test_samples_of_the_polar_scatter_as_it_says(polar, glide, unsure):
    """Fifty polars drawn from the covariance: a standard deviation known to 10 %."""
    cells, rng = np.asarray(polar.spread().cells), np.random.default_rng(0)
    found = []
    for _ in range(50):
        drawn = moved(polar, np.tensordot(rng.normal(size=len(cells)), cells, 1))
        other = jg.steady_glide(with_polar(drawn), glide.state)
        assert bool(other.found)
        found.append(numbers(other))
    for name in NAMES:
        scatter = np.std([one[name] for one in found], ddof=1)
        assert scatter == pytest.approx(float(getattr(unsure, name)), rel=0.25), name
    below = np.mean([one["spectral_radius"] < 1 for one in found])
    assert 0.3 < below < 0.8  # nobody can say whether this gait is stable
    assert "spectral radius" in str(unsure)


@slow
def test_finer_nodes_and_steps_are_what_they_say(polar, glide):
    finer = jg.steady_glide(with_polar(polar, 80), glide.state, step=float(glide.step) / 2)
    here, there, off = numbers(glide), numbers(finer), glide.discretisation
    for name in NAMES:
        expected = abs(here[name] - there[name])
        assert float(getattr(off, name)) == pytest.approx(expected, rel=1e-6), name
    assert 0 < float(off.spectral_radius) < 0.01


@slow
def test_only_a_band_limited_polar_knows(glide):
    smooth = jg.steady_glide(with_polar(jg.Polar.smooth()), NEAR_LONG)
    assert smooth.uncertainty is None
    missing = jg.steady_glide(glide.glider, [0, 0.1, 30.0, 20, -20, 20, 1.4, 3.0])
    with pytest.raises(ValueError, match="there is no steady glide"):
        _ = missing.uncertainty


@slow
def test_a_landing_is_less_sure_than_a_steady_glide(polar):
    """By its gradient, and by samples of a tenth of the deviations."""
    body = jg.Snake.from_svl(0.70, nodes=40, node_set="gauss")
    glider = jg.Glider(body, jg.Gait.from_degrees(), polar)

    def distance(glider):
        return jg.simulate(glider, jg.Launch(height=10.0)).landing_point[1]

    off = float(jg.standard_deviation(distance, glider))
    cells, rng = np.asarray(polar.spread().cells), np.random.default_rng(0)
    ends = [
        distance(
            dataclasses.replace(
                glider,
                aerodynamics=jg.SweepTheory(
                    moved(polar, 0.1 * np.tensordot(rng.normal(size=len(cells)), cells, 1))
                ),
            )
        )
        for _ in range(60)
    ]
    assert 10 * np.std(ends) == pytest.approx(off, rel=0.25)
    assert 0.5 < off < 1.2
