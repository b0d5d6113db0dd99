"""Polars from tables."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Polar, TabulatedPolar
from jaxglide.loads.coefficients import ALPHA, REYNOLDS, extended_tables

LIFT, DRAG = extended_tables()


@pytest.fixture(scope="module")
def table():
    return TabulatedPolar(np.deg2rad(ALPHA), REYNOLDS, LIFT, DRAG)


call = jax.jit(lambda polar, beta, reynolds: jnp.stack(polar(beta, reynolds)))


def test_the_published_table_is_the_published_polar(table):
    """Between its knots, beyond them, and from behind."""
    rng = np.random.default_rng(0)
    beta, reynolds = rng.uniform(-np.pi, np.pi, 2000), rng.uniform(0, 20_000, 2000)
    expected = call(Polar.published(1.36, 0.6), beta, reynolds)
    scaled = TabulatedPolar(table.angle_of_attack, REYNOLDS, LIFT, DRAG, 1.36, 0.6)
    np.testing.assert_allclose(call(scaled, beta, reynolds), expected, rtol=0, atol=1e-12)
    assert np.ptp(expected[0]) > 3


def test_a_table_holds_at_its_knots(table):
    beta, reynolds = (
        a.ravel() for a in np.meshgrid(np.deg2rad(ALPHA), REYNOLDS, indexing="ij")
    )
    found = call(table, beta, reynolds)
    np.testing.assert_allclose(found, [LIFT.ravel(), DRAG.ravel()], rtol=0, atol=1e-13)


def test_one_reynolds_number_is_for_all():
    polar = TabulatedPolar(
        [-0.5, 0.0, 1.0], [5000], [[-0.2], [0.1], [1.3]], [[0.4], [0.2], [1]]
    )
    beta = np.array([-0.5, -0.25, 0.5, 1.0, 1.2, np.pi - 0.5])
    for reynolds in (0.0, 1e6):
        lift, drag = call(polar, beta, reynolds)
        np.testing.assert_allclose(lift, [-0.2, -0.05, 0.7, 1.3, 1.3, -0.7], atol=1e-14)
        np.testing.assert_allclose(drag, [0.4, 0.3, 0.6, 1.0, 1.0, 0.6], atol=1e-14)
    assert polar.measured_reynolds == (0.0, np.inf)
    np.testing.assert_allclose(polar.measured_angles, np.rad2deg([-0.5, 1.0]))


def test_a_table_of_the_full_circle_is_taken_as_it_is():
    angles = np.deg2rad([-180, -90, 0, 90, 180])
    polar = TabulatedPolar(angles, [0], np.c_[[0, 1, 2, 3, 0]], np.c_[[1, 2, 3, 4, 1]])
    lift, drag = call(polar, np.deg2rad([-135, 135.0]), 1e4)
    np.testing.assert_allclose([lift, drag], [[0.5, 1.5], [1.5, 2.5]], atol=1e-14)


def test_files_with_and_without_reynolds_numbers(tmp_path, table):
    path = tmp_path / "polar.csv"
    rows = ["angle_of_attack,reynolds,lift,drag"]
    rows += [
        f"{a},{re},{LIFT[i, j]},{DRAG[i, j]}"
        for j, re in enumerate(REYNOLDS)
        for i, a in enumerate(ALPHA)
    ]
    path.write_text("\n".join(rows))
    found = TabulatedPolar.from_csv(path, lift_scale=2.0)
    np.testing.assert_allclose(found.angle_of_attack, table.angle_of_attack, rtol=1e-15)
    for name in ("reynolds", "lift", "drag"):
        np.testing.assert_allclose(getattr(found, name), getattr(table, name), rtol=1e-15)
    assert float(found.lift_scale) == 2.0
    path.write_text("angle_of_attack,lift,drag\n-10,-0.5,0.4\n0,-0.1,0.3\n20,1.0,0.5\n")
    assert TabulatedPolar.from_csv(path).lift.shape == (3, 1)
