"""The band-limited polar: the regression, its cross-validation and its covariance."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Polar, TabulatedPolar
from jaxglide.loads import harmonics
from jaxglide.loads.coefficients import ALPHA, REYNOLDS, extended_tables, faded_tables

ANGLES = np.arange(-90.0, 91.0, 5.0)  # deg
MEASURED = (ANGLES >= -10) & (ANGLES <= 60)
BETA, RE = (a.ravel() for a in np.meshgrid(np.deg2rad(ANGLES), REYNOLDS, indexing="ij"))

call = jax.jit(lambda polar, beta, reynolds: jnp.stack(polar(beta, reynolds)))


def spread_at(polar, beta, reynolds):
    """What a polar's coefficients are moved by, (P, 2, ...)."""

    def along(moved):
        return jax.jvp(lambda one: call(one, beta, reynolds), (polar,), (moved,))[1]

    return np.asarray(jax.vmap(along)(polar.spread()))


def values(beta, reynolds, harmonics=None):
    return np.asarray(call(Polar.band_limited(harmonics), beta, reynolds))


def test_the_fold_is_exact():
    """To the last digits, of the coefficients and of what they may be moved by."""
    rng = np.random.default_rng(0)
    beta, re = rng.uniform(-np.pi, np.pi, 300), rng.uniform(0, 2e4, 300)
    behind = np.angle(np.exp(1j * (np.pi - beta)))  # within a turn
    sign = np.array([[-1.0], [1.0]])
    polar = Polar.band_limited()
    np.testing.assert_allclose(values(behind, re), sign * values(beta, re), atol=1e-12)
    ours, theirs = (spread_at(polar, b, re) for b in (beta, behind))
    np.testing.assert_allclose(theirs, sign * ours, rtol=0, atol=1e-12)
    assert np.abs(ours).max() > 0.01


def test_it_has_so_many_harmonics_and_no_more():
    beta = 2 * np.pi * np.arange(72) / 72 - np.pi  # the knots
    waves = np.abs(np.fft.rfft(values(beta, 9000.0, 9), axis=1)) / 36
    assert waves[:, 10:].max() < 1e-14
    assert waves[0, 1:10].max() > 0.1


def by_least_squares(order, weights):
    """The fit of lift on sines by a general solver, at every angle, (37, 7)."""
    gamma = np.deg2rad(90 - ANGLES)
    waves = np.sin(gamma[:, None] * np.arange(1, order + 1))
    root = np.sqrt(weights)[:, None]
    lift = faded_tables()[0]
    return waves @ np.linalg.lstsq(root * waves, root * lift, rcond=None)[0]


def test_measured_angles_count_ten_times_what_is_made_up():
    expected = by_least_squares(11, np.where(MEASURED, 1.0, 0.1))
    np.testing.assert_allclose(values(BETA, RE, 11)[0], expected.ravel(), atol=1e-12)


def test_left_out_is_an_angle_at_all_reynolds_numbers():
    lift, missed = faded_tables()[0], []
    for k in np.flatnonzero(MEASURED)[1:-1]:
        weights = np.where(MEASURED, 1.0, 0.1)
        weights[k] = 0
        missed.append(lift[k] - by_least_squares(9, weights)[k])
    assert len(missed) == 13
    expected = np.sqrt(np.mean(np.square(missed)))
    assert harmonics.cross_validation(9)[0] == pytest.approx(expected, rel=1e-9)


def test_the_number_of_harmonics_has_the_least_error():
    best = harmonics.best_harmonics()
    errors = {k: np.hypot(*harmonics.cross_validation(k)) for k in range(2, 25)}
    assert min(errors, key=lambda k: errors[k]) == best
    np.testing.assert_array_equal(Polar.band_limited().cells, Polar.band_limited(best).cells)
    assert errors[6] > 1.3 * errors[best]
    assert errors[24] > 1.3 * errors[best]


def test_smooth_in_reynolds_number():
    """Once differentiable everywhere, constant outside what was measured."""
    re = np.linspace(2000, 16_000, 57)
    slope = jax.vmap(jax.grad(lambda r: Polar.band_limited()(0.4, r)[0]))(jnp.asarray(re))
    outside = (re <= 3000) | (re >= 15_000)
    np.testing.assert_allclose(slope[outside], 0, atol=1e-12)
    assert np.abs(np.diff(slope)).max() < 0.5 * np.abs(slope).max()


def test_the_covariance_is_that_of_the_fit_to_noisy_data():
    """Fits to tables with errors of the covariance said scatter as `spread` says."""
    order, draws = 12, 400
    lift = harmonics.regression(order)[0]
    rng = np.random.default_rng(1)
    at = harmonics.waves_at(ANGLES, order)[0]
    weights = np.where(MEASURED, 1.0, 0.1)
    root = np.linalg.cholesky(lift.by_reynolds)
    errors = rng.normal(size=(draws, 37, 7)) @ root.T / np.sqrt(weights)[:, None]
    weighted = np.linalg.lstsq(
        np.sqrt(weights)[:, None] * at,
        np.moveaxis(np.sqrt(weights)[:, None] * errors, 0, 1).reshape(37, -1),
        rcond=None,
    )[0]
    scattered = (at @ weighted).reshape(37, draws, 7).std(axis=1)
    moved = spread_at(Polar.band_limited(order), BETA, RE)[:, 0]
    expected = np.sqrt(np.sum(moved**2, axis=0)).reshape(37, 7)
    inner = np.abs(ANGLES) < 90  # where lift is 0 by symmetry
    np.testing.assert_allclose(scattered[inner], expected[inner], rtol=0.15)
    np.testing.assert_allclose(expected[~inner], 0, atol=1e-12)


def test_what_is_measured_is_surer_than_what_is_made_up():
    sd = np.sqrt(np.sum(spread_at(Polar.band_limited(), BETA, RE) ** 2, axis=0))
    lift, drag = sd.reshape(2, 37, 7).mean(axis=2)
    inner = (ANGLES > -90) & (ANGLES < 90) & ~MEASURED
    for one in (lift, drag):
        assert one[MEASURED].max() < one[inner].min()
    off = (
        values(BETA, RE).reshape(2, 37, 7)[:, MEASURED] - np.stack(faded_tables())[:, MEASURED]
    )
    rms = np.sqrt(np.mean(off**2, axis=(1, 2)))
    np.testing.assert_allclose(rms, [0.062, 0.031], atol=0.001)


def test_scales_scale_the_spread_too():
    one = spread_at(Polar.band_limited(), 0.3, 9000.0)
    scaled = spread_at(Polar.band_limited(lift_scale=1.36, drag_scale=0.6), 0.3, 9000.0)
    np.testing.assert_allclose(scaled, one * [1.36, 0.6], atol=1e-15)


def test_only_a_regression_knows_its_spread():
    lift, drag = extended_tables()
    table = TabulatedPolar(np.deg2rad(ALPHA), REYNOLDS, lift, drag)
    bent = Polar(Polar.band_limited().cells * 1.01)
    for polar in (Polar.published(), Polar.smooth(), table, bent):
        assert polar.spread() is None
    with pytest.raises(TypeError, match="not known within jit"):
        jax.jit(lambda polar: polar.spread())(Polar.band_limited())


@pytest.mark.parametrize("given", [1, 25])
def test_out_of_range(given):
    with pytest.raises(
        ValueError, match=rf"harmonics = {given} is not allowed: it must be in .2, 24."
    ):
        Polar.band_limited(given)
