"""Section force coefficients: the tables, the folds, and how smooth each polar is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from jaxglide import Polar
from jaxglide.loads.coefficients import ALPHA, REYNOLDS, extended_tables

# A transcript of a few rows of Holden et al. (2014): alpha [deg], C_L and C_D by Re.
MEASURED = {
    -10: (
        [-0.22675, -0.41202, -0.46889, -0.54330, -0.45011, -0.45119, -0.54118],
        [0.43486, 0.46409, 0.47499, 0.52687, 0.49011, 0.50208, 0.54158],
    ),
    0: (
        [-0.50933, -0.66243, -0.69804, -0.76275, -0.71451, -0.74524, -0.76698],
        [0.33250, 0.33696, 0.34938, 0.39917, 0.37505, 0.38733, 0.43753],
    ),
    35: (
        [1.14460, 1.22730, 1.34801, 1.79514, 1.73560, 1.80036, 1.91365],
        [0.60098, 0.67866, 0.70442, 0.70741, 0.66079, 0.66094, 0.71938],
    ),
    60: (
        [0.88767, 0.97602, 0.99975, 1.14078, 1.04725, 1.07043, 1.14229],
        [1.36197, 1.55138, 1.57948, 1.77548, 1.63220, 1.65856, 1.75309],
    ),
}
LIFT_50 = np.array([1.02167, 1.12453, 1.18085, 1.34688, 1.26836, 1.27007, 1.38877])
LIFT_55 = np.array([0.95800, 1.03505, 1.08048, 1.20607, 1.13650, 1.14238, 1.23793])

# C_L(90) is zero up to the round-off of the continuation's cubic, about 2e-12.
ROUND_OFF = 1e-11

POLARS = {"published": Polar.published, "smooth": Polar.smooth}
both = pytest.mark.parametrize("name", POLARS)


@jax.jit
def _evaluate(polar, beta, reynolds):
    return jnp.stack(polar(beta, reynolds))


def coefficients(name, beta_deg, reynolds, **scales):
    """C_L and C_D, (2, ...), at beta in degrees."""
    beta, reynolds = np.broadcast_arrays(np.deg2rad(beta_deg), np.asarray(reynolds, float))
    return np.asarray(_evaluate(POLARS[name](**scales), beta, reynolds))


@both
@pytest.mark.parametrize("alpha", MEASURED)
def test_measured_values(name, alpha):
    np.testing.assert_allclose(
        coefficients(name, alpha, REYNOLDS), MEASURED[alpha], rtol=0, atol=1e-12
    )


@both
def test_both_polars_pass_through_every_knot_of_the_extended_table(name):
    lift, drag = extended_tables()
    assert lift.shape == drag.shape == (21, 7)
    value = coefficients(name, ALPHA[:, None], REYNOLDS[None, :])
    np.testing.assert_allclose(value, [lift, drag], rtol=0, atol=ROUND_OFF)


def test_continuation_to_90_degrees():
    lift, drag = extended_tables()
    alpha = np.arange(60.0, 91.0, 5.0)[:, None]
    lift_60, drag_60 = MEASURED[60]
    top = 2.0 + 0.1 * np.arange(7) / 6
    parabola = top + (drag_60 - top) * (alpha - 90) ** 2 / 900
    np.testing.assert_allclose(drag[14:], parabola, rtol=0, atol=1e-13)
    # C_L: minimum-norm cubic A^T (A A^T)^-1 b of the published constraint rows
    rows = np.array([[90.0**3, 90.0**2, 90, 1], [60.0**3, 60.0**2, 60, 1], [10800, 120, 0, 0]])
    slope = 1.5 * np.array(lift_60) - 2 * LIFT_55 + 0.5 * LIFT_50
    sides = np.stack([np.zeros(7), lift_60, slope])
    scale = np.diag([1e-6, 1e-4, 1e-2, 1])  # the same least norm, without the loss of digits
    weighted = rows @ scale
    null = np.linalg.svd(weighted)[2][-1] * np.diag(scale)  # direction that rows leave free
    particular = scale @ np.linalg.lstsq(weighted, sides, rcond=None)[0]
    cubic = particular - np.outer(null, null @ particular) / (null @ null)
    np.testing.assert_allclose(rows @ cubic, sides, rtol=0, atol=1e-9)
    expected = np.hstack([alpha**3, alpha**2, alpha, alpha**0]) @ cubic
    np.testing.assert_allclose(lift[15:], expected[1:], rtol=0, atol=1e-9)
    np.testing.assert_allclose(lift[-1], 0, atol=1e-9)
    np.testing.assert_allclose(expected[0], lift_60, atol=1e-9)


def test_published_polar_is_bilinear_on_the_folded_angle():
    """SciPy's interpolator, the fold fore and aft, and the clamps."""
    rng = np.random.default_rng(0)
    beta, reynolds = rng.uniform(-180, 180, 4000), rng.uniform(0, 20000, 4000)
    v_c, v_b = np.cos(np.deg2rad(beta)), -np.sin(np.deg2rad(beta))
    fold = np.where(v_c >= 0, 1.0, -1.0)
    alpha = np.rad2deg(np.arctan2(-v_b, np.abs(v_c)))
    points = np.stack([alpha.clip(-10, 90), reynolds.clip(3000, 15000)], axis=1)
    lift, drag = (
        RegularGridInterpolator((ALPHA, REYNOLDS), table)(points) for table in extended_tables()
    )
    value = coefficients("published", beta, reynolds)
    np.testing.assert_allclose(value, [fold * lift, drag], rtol=0, atol=1e-12)


@both
def test_section_is_symmetric_fore_and_aft(name):
    beta = np.linspace(-89.99, 89.99, 501)
    behind = np.where(beta >= 0, 180 - beta, -180 - beta)
    lift, drag = coefficients(name, beta, 6200)
    np.testing.assert_allclose(
        coefficients(name, behind, 6200), [-lift, drag], rtol=0, atol=ROUND_OFF
    )


@both
def test_reynolds_number_is_clamped(name):
    beta = np.linspace(-180, 180, 145)
    for outside, limit in ((0.0, 3000), (2999, 3000), (15001, 15000), (1e7, 15000)):
        np.testing.assert_array_equal(
            coefficients(name, beta, outside), coefficients(name, beta, limit)
        )


@both
def test_multipliers_scale_lift_and_drag_separately(name):
    beta, reynolds = np.linspace(-180, 180, 100), 7100
    lift, drag = coefficients(name, beta, reynolds)
    np.testing.assert_allclose(
        coefficients(name, beta, reynolds, lift_scale=1.36, drag_scale=0.6),
        [1.36 * lift, 0.6 * drag],
        rtol=1e-14,
    )


def test_published_lift_jumps_at_minus_90_only():
    knots = np.arange(-180.0, 181.0, 5.0)
    wrap = np.where(knots == 180, -180, knots)
    below = coefficients("published", np.where(knots == -180, 180, knots) - 1e-9, 7300)
    above = coefficients("published", wrap + 1e-9, 7300)
    jump = np.abs(above - below)
    at_90 = knots == -90
    assert jump[0, at_90] == pytest.approx(2 * 0.5, abs=0.15)  # from -C_L(-10) to C_L(-10)
    assert jump[:, ~at_90].max() < 1e-8
    assert jump[1].max() < 1e-8
    slopes = np.abs(
        np.diff(coefficients("published", 10 + np.array([-1e-6, 0, 1e-6]), 7300), 2)
    )
    assert slopes.max() > 1e-9  # a corner at a knot


def test_below_the_table_the_published_polar_holds_and_the_smooth_one_fades():
    below = np.arange(-90.0, -10.0, 5.0) + 1e-9
    lift_10, drag_10 = coefficients("published", -10, 7000)
    lift, drag = coefficients("published", below, 7000)
    np.testing.assert_allclose(
        [lift, drag], [0 * lift + lift_10, 0 * drag + drag_10], rtol=1e-12
    )
    lift, drag = coefficients("smooth", below, 7000)
    fade = np.sin(np.deg2rad(90 * (below + 90) / 80))
    np.testing.assert_allclose(lift, lift_10 * fade, rtol=0, atol=1e-9)
    np.testing.assert_allclose(drag, drag_10, rtol=0, atol=1e-9)


@jax.jit
@jax.vmap
def _derivatives(cell):
    """Of the smooth polar at (beta/5 deg, Re/2000): value, Jacobian, Hessian."""

    def polar(u):
        return jnp.stack(Polar.smooth()(u[0] * np.pi / 36, u[1] * 2000.0))

    return polar(cell), jax.jacfwd(polar)(cell), jax.hessian(polar)(cell)


def derivatives(beta_deg, reynolds):
    cells = np.broadcast_arrays(beta_deg / 5, np.asarray(reynolds) / 2000)
    return _derivatives(np.stack(cells, axis=-1))


@pytest.mark.parametrize("reynolds", [3000.0, 5200.0, 9000.0, 15000.0])
def test_smooth_polar_is_twice_differentiable_round_the_circle(reynolds):
    knots = np.arange(-180.0, 180.0, 5.0)
    below = np.where(knots == -180, 180, knots) - 1e-8
    for left, right in zip(
        derivatives(below, reynolds), derivatives(knots + 1e-8, reynolds), strict=True
    ):
        assert np.abs(left - right).max() < 1e-7
        assert np.abs(left).max() > 1e-2


def test_smooth_polar_is_twice_differentiable_in_reynolds_number():
    beta = np.linspace(-179, 179, 72)  # as many as knots: one compilation
    for knot in REYNOLDS[1:-1]:
        sides = (derivatives(beta, knot - 1e-5), derivatives(beta, knot + 1e-5))
        for left, right in zip(*sides, strict=True):
            assert np.abs(left - right).max() < 1e-7
    # constant outside the table, joined with zero slope
    for limit, inside in ((3000.0, 1e-5), (15000.0, -1e-5)):
        _, slope, _ = derivatives(beta, limit + inside)
        assert np.abs(slope[..., 1]).max() < 1e-7
        _, slope, curvature = derivatives(beta, limit - inside)
        assert np.abs(slope[..., 1]).max() == 0
        assert np.abs(curvature[..., 1]).max() == 0


def test_smooth_polar_stays_close_to_the_published_one_between_knots():
    rng = np.random.default_rng(1)
    beta, reynolds = rng.uniform(-10, 90, 5000), rng.uniform(3000, 15000, 5000)
    smooth, published = (coefficients(name, beta, reynolds) for name in POLARS)
    assert np.abs(smooth - published).max() < 0.12
    assert np.abs(smooth - published).mean() < 0.015


@both
def test_a_bad_angle_gives_nan_and_not_another_cells_value(name):
    assert np.isnan(coefficients(name, np.nan, 7000)).all()
    assert np.isnan(coefficients(name, 10, np.nan)).all()


def test_unknown_polar_is_refused():
    with pytest.raises(ValueError, match="published, smooth"):
        Polar.from_name("measured")
