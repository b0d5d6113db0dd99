"""Morphology, mass distribution and the two node sets."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Snake, discretise
from jaxglide.body.sections import wing_area
from jaxglide.body.snake import PUBLISHED_NECK

GAUSS = {"node_set": "gauss", "nodes": 60}


@pytest.fixture(scope="module")
def published():
    return discretise(Snake.from_svl())


@pytest.fixture(scope="module")
def gauss():
    return discretise(Snake.from_svl(**GAUSS))


def test_numbers_of_the_published_animal(published):
    snake = Snake.from_svl(0.70)
    assert float(snake.mass) == pytest.approx(0.03804677, abs=5e-9)
    area = float(wing_area(snake))
    assert area == pytest.approx(0.012094915, abs=5e-10)
    assert float(snake.mass) * 9.81 / area == pytest.approx(30.85915, abs=5e-6)
    assert float(jnp.sum(published.area)) == area
    np.testing.assert_allclose(
        published.fraction * 0.7, 0.005 + 0.01 * np.arange(70), rtol=1e-14
    )


def test_chord_and_density_are_the_published_parabolas(published):
    x = np.asarray(published.fraction)
    chord = (x - 0.51220022) ** 2 / (4 * -4.88957129) + 0.02895101
    np.testing.assert_allclose(published.chord, 0.7 * chord, rtol=1e-13)
    np.testing.assert_allclose(published.area, published.chord * 0.01, rtol=1e-13)
    head = (x - 0.01661771) ** 2 / (4 * -0.00012991) + 1.36099325
    body = (x - 0.52583598) ** 2 / (4 * -0.10778636) + 1.11461374
    density = np.where(x <= 0.037, head, body)
    np.testing.assert_allclose(
        published.mass / published.mass[40], density / density[40], rtol=1e-13
    )


@pytest.mark.parametrize("fields", [{}, GAUSS, {"nodes": 31}], ids=["published", "gauss", "31"])
def test_mass_and_area_are_all_there(fields):
    snake = Snake.from_svl(0.8, mass=0.05, **fields)
    sections = discretise(snake)
    assert float(jnp.sum(sections.mass)) == pytest.approx(0.05, rel=1e-14)
    assert (sections.mass > 0).all()
    # The chord integrates in closed form; midpoints are off by h^2/24 of its curvature.
    x = np.array([0.0, 1.0]) - 0.51220022
    exact = np.diff(x**3)[0] / (12 * -4.88957129) + 0.02895101
    error = 0 if fields is GAUSS else -1 / (2 * -4.88957129) / (24 * snake.nodes**2)
    assert float(jnp.sum(sections.area)) == pytest.approx(0.8**2 * (exact + error), rel=1e-13)


@pytest.mark.parametrize("which", ["published", "gauss"])
def test_any_field_is_centred_on_the_centre_of_mass(which, request):
    sections = request.getfixturevalue(which)
    fields = np.random.default_rng(0).normal(size=(20, sections.mass.size))
    positions = fields @ sections.integral
    first_moment = positions @ sections.mass / jnp.sum(sections.mass)
    assert np.abs(first_moment).max() < 1e-15 * np.abs(positions).max() * positions.shape[1]
    assert np.abs(positions).max() > 0.05


def differences(sections, field):
    """Integral of `field` [m] from the first node to every node."""
    integral = field @ np.asarray(sections.integral)
    return integral - integral[0]


@pytest.mark.parametrize("power", range(5))
def test_gauss_integrates_polynomials_exactly(gauss, power):
    """Five nodes on each short panel: exact up to the fourth power."""
    x = np.asarray(gauss.fraction)
    exact = 0.7 * (x ** (power + 1) - x[0] ** (power + 1)) / (power + 1)
    np.testing.assert_allclose(differences(gauss, x**power), exact, rtol=0, atol=1e-15)


def test_gauss_starts_at_the_snout(gauss):
    """The integral of 1 is s from the snout, less its mean: its slope and its panels agree."""
    x = np.asarray(gauss.fraction)
    positions = np.ones(60) @ np.asarray(gauss.integral)
    centre = np.sum(x * gauss.mass) / np.sum(gauss.mass)
    rounding = len(x) * np.finfo(float).eps * 0.35  # of a sum of so many, up to half a length
    np.testing.assert_allclose(positions, 0.7 * (x - centre), rtol=0, atol=rounding)


def cosine_error(**fields):
    sections = discretise(Snake.from_svl(**fields))
    x = np.asarray(sections.fraction)
    exact = 0.7 * (np.sin(9 * x) - np.sin(9 * x[0])) / 9
    return np.abs(differences(sections, np.cos(9 * x)) - exact).max()


def test_published_rule_is_second_order_and_gauss_far_better():
    errors = [cosine_error(nodes=n) for n in (70, 140, 280)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders == pytest.approx([2, 2], abs=0.06)
    assert cosine_error(**GAUSS) < 1e-9 < 1e-3 * errors[-1]


def test_gauss_nodes_lie_on_panels_split_at_head_and_neck(gauss):
    x = np.asarray(gauss.fraction)
    assert (np.diff(x) > 0).all()
    assert x[0] > 0
    assert x[-1] < 1
    counts = np.histogram(x, [0, 0.037, PUBLISHED_NECK, 1])[0]
    assert counts.tolist() == [5, 5, 50]
    _, weight, _ = Snake.from_svl(**GAUSS)._quadrature()
    assert float(jnp.sum(weight)) == pytest.approx(1.0, abs=1e-14)
    for panel, width in ((slice(0, 5), 0.037), (slice(5, 10), PUBLISHED_NECK - 0.037)):
        assert float(jnp.sum(weight[panel])) == pytest.approx(width, rel=1e-13)


def test_a_neck_shorter_than_the_head_is_split_too():
    sections = discretise(Snake.from_svl(neck_fraction=0.02, **GAUSS))
    counts = np.histogram(sections.fraction, [0, 0.02, 0.037, 1])[0]
    assert counts.tolist() == [5, 5, 50]
    assert (np.diff(sections.fraction) > 0).all()


def test_nodes_beyond_the_body_weigh_nothing():
    short = discretise(Snake.from_svl(0.64, spacing=0.01, nodes=64))
    padded = discretise(Snake.from_svl(0.64, spacing=0.01, nodes=89))
    for name in ("fraction", "chord", "area", "mass"):
        whole = np.asarray(getattr(padded, name))
        np.testing.assert_allclose(whole[:64], getattr(short, name), rtol=1e-13)
    for name in ("area", "mass"):
        assert (np.asarray(getattr(padded, name))[64:] == 0).all()
    assert (np.asarray(padded.chord) > 0).all()
    field = np.random.default_rng(0).normal(size=89)
    np.testing.assert_allclose(
        (field @ padded.integral)[:64], field[:64] @ short.integral, rtol=1e-12, atol=1e-15
    )
    # an element that the vent cuts through counts
    assert (np.asarray(discretise(Snake.from_svl(0.643, spacing=0.01)).area) > 0).sum() == 65


def test_spacing_sets_the_published_grid():
    by_count = discretise(Snake.from_svl(0.70, gyration=0.25))
    by_spacing = discretise(Snake.from_svl(0.70, gyration=0.25, spacing=0.01))
    for name, value in vars(by_count).items():
        np.testing.assert_allclose(getattr(by_spacing, name), value, rtol=1e-13, atol=1e-17)
    # At other lengths the published grid's last node may pass the vent.
    sections = discretise(Snake.from_svl(0.652, nodes=66, spacing=0.01))
    np.testing.assert_allclose(sections.fraction * 0.652, 0.005 + 0.01 * np.arange(66))
    assert sections.fraction[-1] > 1
    np.testing.assert_allclose(sections.area, sections.chord * 0.01, rtol=1e-13)
    with pytest.raises(ValueError, match="spacing"):
        Snake.from_svl(spacing=0.01, **GAUSS)


def test_gauss_is_differentiable_in_every_dimension_of_the_body():
    def extent(snake):
        sections = discretise(snake)
        x = sections.fraction
        field = jnp.cos(3 * x) * jnp.minimum(x / snake.neck_fraction, 1)
        return jnp.sum(field @ sections.integral * sections.area)

    snake = Snake.from_svl(**GAUSS)
    value, gradient = jax.jit(extent), jax.jit(jax.grad(extent))(snake)
    h = 1e-6

    def moved(name, step):
        x = getattr(snake, name) + step
        return float(value(eqx.tree_at(lambda s: getattr(s, name), snake, x)))

    for name in ("length", "neck_fraction", "head_fraction"):
        slope = float(getattr(gradient, name))
        difference = (moved(name, h) - moved(name, -h)) / (2 * h)
        assert slope == pytest.approx(difference, rel=1e-5)
        assert abs(slope) > 1e-8
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(gradient))
