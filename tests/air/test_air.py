"""Winds by their definitions, and turbulence by its spectrum."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, kv

from jaxglide import Gust, ShearWind, StillAir, Turbulence, UniformWind

WIND = np.array([1.0, -2.0, 0.5])


def along(axis, places):
    """Points on an axis, (3, n)."""
    points = np.zeros((3, len(places)))
    points[axis] = places
    return jnp.asarray(points)


def slope(air, place, time=0.3):
    """Gradient of the wind at a place, (3, 3): of component by direction."""
    return jax.jacfwd(lambda p: air.wind(p[:, None], jnp.asarray(time))[:, 0])(
        jnp.asarray(place, float)
    )


def test_still_air_has_the_published_density_and_viscosity():
    air = StillAir()
    assert (float(air.air_density), float(air.kinematic_viscosity)) == (1.165, 1.568e-5)
    assert air.wind(jnp.zeros((3, 4)), jnp.asarray(0.0)) is None
    assert float(UniformWind(WIND, air_density=1000.0).air_density) == 1000.0


def test_uniform_wind_is_the_same_everywhere():
    found = UniformWind(WIND).wind(along(1, [0, 5, -3.0]), jnp.asarray(2.0))
    np.testing.assert_array_equal(found, np.tile(WIND[:, None], 3))


def test_shear_follows_a_power_law_of_height():
    air = ShearWind(WIND, reference_height=8.0, shear_exponent=0.25)
    heights = np.array([0.08, 0.5, 8.0, 40.0])
    found = np.asarray(air.wind(along(2, heights), jnp.asarray(0.0)))
    np.testing.assert_allclose(found, WIND[:, None] * (heights / 8) ** 0.25, rtol=1e-14)
    assert not np.any(air.wind(along(2, [0.0, -1.0]), jnp.asarray(0.0)))
    # linear below a hundredth of the reference height, and joined on
    low = np.asarray(air.wind(along(2, [0.02, 0.04, 0.08]), jnp.asarray(0.0)))
    np.testing.assert_allclose(low[:, 1:], low[:, :1] * [2, 4], rtol=1e-14)
    for height in (-0.5, 0.0, 0.01, 0.08, 3.0):
        assert np.isfinite(slope(air, [0, 0, height])).all()
    exponent = jax.grad(
        lambda e: ShearWind(WIND, 8.0, e).wind(along(2, [3.0]), jnp.asarray(0.0))[1, 0]
    )
    assert float(exponent(0.25)) == pytest.approx(
        -2 * (3 / 8) ** 0.25 * np.log(3 / 8), rel=1e-12
    )


def test_a_gust_is_one_minus_cosine_and_smooth_at_its_ends():
    air = Gust(WIND, gust_start=2.0, gust_length=4.0)
    found = np.asarray(air.wind(along(1, [-9, 2, 3, 4, 5, 6, 99.0]), jnp.asarray(0.0)))
    share = [0, 0, 0.5, 1, 0.5, 0, 0]
    np.testing.assert_allclose(found, np.outer(WIND, share), rtol=0, atol=1e-15)
    assert np.abs(slope(air, [0, 3, 0])[:, 1]).max() == pytest.approx(2 * np.pi / 4)
    for edge in (2.0, 6.0):
        for side in (-1e-9, 0.0, 1e-9):
            np.testing.assert_allclose(slope(air, [0, edge + side, 0]), 0, atol=1e-7)


# Turbulence: von Karman's E(k), whose one-dimensional spectra and correlations are known

SCALE = 2.0  # integral length [m]
KARMAN = SCALE * gamma(1 / 3) / (np.sqrt(np.pi) * gamma(5 / 6))  # l, 1.339 of it
SEEDS = range(60)


def turbulence(seed, **more):
    return Turbulence(intensity=1.5, length_scale=SCALE, seed=seed, **more)


@pytest.fixture(scope="module")
def lines():
    """Wind along 1 km of the y axis, seed by seed, over its intensity, (60, 3, n); step [m]."""
    step, count = 0.05, 8000
    points = along(1, step * np.arange(count))
    found = [turbulence(seed).wind(points, jnp.asarray(0.0)) / 1.5 for seed in SEEDS]
    return np.stack(found), step


def energy_spectrum(k):
    """E(k) over the variance of a component, with k in 1/m."""
    constant = 55 / 9 * gamma(5 / 6) / (np.sqrt(np.pi) * gamma(1 / 3))
    return constant * KARMAN * (k * KARMAN) ** 4 / (1 + (k * KARMAN) ** 2) ** (17 / 6)


def longitudinal(k1):
    """One-sided spectrum of the component along the line, of E(k) for isotropic air.

    E11(k1) = integral from k1 of E(k)/k (1 - k1^2/k^2) dk.
    """
    inside = lambda s: energy_spectrum(k1 * np.exp(s)) * (1 - np.exp(-2 * s))  # noqa: E731
    return quad(inside, 0, 30, limit=200)[0]


def transverse(k1):
    """The same of a component across it: E22 = (E11 - k1 dE11/dk1)/2."""
    h = 1e-4 * k1
    return (longitudinal(k1) - k1 * (longitudinal(k1 + h) - longitudinal(k1 - h)) / 2 / h) / 2


def test_the_derived_spectra_are_von_karmans():
    for k1 in (0.02, 0.7, 9.0):
        x = (k1 * KARMAN) ** 2
        along_it = 2 * SCALE / np.pi / (1 + x) ** (5 / 6)
        across = SCALE / np.pi * (1 + 8 / 3 * x) / (1 + x) ** (11 / 6)
        assert longitudinal(k1) == pytest.approx(along_it, rel=1e-7)
        assert transverse(k1) == pytest.approx(across, rel=1e-5)
    assert pytest.approx(1.339, abs=5e-4) == KARMAN / SCALE


def test_the_variance_is_the_square_of_the_intensity(lines):
    wind, _ = lines
    square = np.mean(wind**2, axis=2)
    np.testing.assert_allclose(square.mean(axis=0), 1, rtol=0, atol=0.06)
    # all three components of a field together have it but for the line's length
    np.testing.assert_allclose(square.sum(axis=1).mean(), 3, rtol=0, atol=0.06)
    assert np.abs(wind.mean(axis=(0, 2))).max() < 0.05
    mixed = np.mean(wind[:, [0, 1, 2]] * wind[:, [1, 2, 0]], axis=(0, 2))
    assert np.abs(mixed).max() < 0.05


def test_the_spectra_along_a_line_are_von_karmans(lines):
    """In bands over two and a half decades, to the five-thirds slope."""
    wind, step = lines
    count = wind.shape[2]
    window = np.hanning(count)
    waves = np.abs(np.fft.rfft(wind * window, axis=2)) ** 2
    spectrum = waves.mean(axis=0) * step / (np.pi * np.sum(window**2))  # one-sided, by k1
    k1 = 2 * np.pi * np.fft.rfftfreq(count, step)
    edges = np.geomspace(0.05, 15.0, 9) / KARMAN * SCALE
    found, expected = [], []
    for low, high in itertools.pairwise(edges):
        band = (k1 >= low) & (k1 < high)
        found.append(spectrum[:, band].mean(axis=1))
        exact = [
            (transverse(k), longitudinal(k)) for k in k1[band][:: max(1, band.sum() // 20)]
        ]
        expected.append(np.mean(exact, axis=0)[[0, 1, 0]])
    ratio = np.array(found) / np.array(expected)
    np.testing.assert_allclose(ratio, 1, rtol=0, atol=0.2)
    np.testing.assert_allclose(ratio.mean(axis=0), 1, rtol=0, atol=0.07)
    steep = np.polyfit(np.log(edges[4:-1]), np.log(np.array(found)[4:]), 1)[0]
    np.testing.assert_allclose(steep, -5 / 3, rtol=0, atol=0.15)


def test_correlations_along_a_line_are_von_karmans(lines):
    wind, step = lines
    for apart in (1.0, 2.0, 5.0):
        r, shift = apart / KARMAN, round(apart / step)
        f = 2 ** (2 / 3) / gamma(1 / 3) * r ** (1 / 3) * kv(1 / 3, r)
        g = f - 2 ** (2 / 3) / gamma(1 / 3) / 2 * r ** (4 / 3) * kv(2 / 3, r)
        product = np.mean(wind[:, :, shift:] * wind[:, :, :-shift], axis=(0, 2))
        np.testing.assert_allclose(product, [g, f, g], rtol=0, atol=0.06)


def test_turbulence_has_no_divergence_but_turns():
    air = turbulence(3)
    for place in np.random.default_rng(0).normal(size=(5, 3)) * 10:
        gradient = np.asarray(slope(air, place))
        assert abs(np.trace(gradient)) < 1e-12 * np.abs(gradient).max()
        assert np.abs(gradient - gradient.T).max() > 0.1


def test_one_seed_is_one_field_that_drifts_with_the_wind():
    points = jnp.asarray(np.random.default_rng(1).normal(size=(3, 20)))
    now = turbulence(5).wind(points, jnp.asarray(0.0))
    np.testing.assert_array_equal(turbulence(5).wind(points, jnp.asarray(0.0)), now)
    assert np.abs(turbulence(6).wind(points, jnp.asarray(0.0)) - now).max() > 0.5
    np.testing.assert_array_equal(turbulence(5).wind(points, jnp.asarray(9.0)), now)
    drifting = turbulence(5, velocity=WIND)
    later = drifting.wind(points + 2.0 * WIND[:, None], jnp.asarray(2.0))
    np.testing.assert_allclose(later, now + WIND[:, None], rtol=0, atol=1e-12)
    double = Turbulence(3.0, SCALE, seed=5).wind(points, jnp.asarray(0.0))
    np.testing.assert_allclose(double, 2 * now, rtol=1e-14)
    wider = Turbulence(1.5, 3 * SCALE, seed=5).wind(3 * points, jnp.asarray(0.0))
    np.testing.assert_allclose(wider, now, rtol=0, atol=1e-12)
