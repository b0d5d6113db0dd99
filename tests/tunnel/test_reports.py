"""What results of the tunnel say of themselves; nothing is computed here."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Driven, Gait, Glider, Launch, Outcome, Running, Serpenoid, Snake
from jaxglide.tunnel import BodyPolar, Derivatives, Equilibrium, Fall, Loads, Trim

GLIDER = Glider(Snake.from_svl(), Gait.from_degrees())


def fallen(outcome=Outcome.LANDED):
    return Fall(
        glider=GLIDER,
        launch=Launch(2.5),
        angles=jnp.deg2rad(jnp.array([0.0, 5.0, 0.0])),
        outcome=jnp.asarray(int(outcome)),
        time=jnp.asarray(0.75),
        state=jnp.array([1.0, 0.0, 3.0, -4.0]),
        interval=jnp.asarray(0.025),
        states=jnp.zeros((2, 4)),
    )


def trimmed(found=True, crossings=1):
    return Trim(
        "d_psi",
        "deg/SVL",
        jnp.deg2rad(7.5),
        jnp.asarray(2e-9),
        jnp.asarray(found),
        jnp.asarray(crossings),
        jnp.deg2rad(jnp.array([-20.0, 20.0])),
        jnp.array([-1e-3, 2e-3]),
    )


def slopes(gait):
    """As for a motion whose every float changes the pitch moment by 1e-3 N m per unit."""
    arrays, rest = eqx.partition(gait, eqx.is_inexact_array)
    by_gait = jax.tree.map(lambda x: jnp.full((3, *x.shape), 1e-3), arrays)
    return Derivatives(jnp.zeros(3), 2e-3 * jnp.ones((3, 3)), eqx.combine(by_gait, rest))


MOMENTS = 1e-3 * jnp.array([[1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
LINES = [
    (fallen(), "Held glide from 2.5 m: landed after 0.7500 s"),
    (fallen(), "53.13 deg below the horizontal"),
    (fallen(), "yaw 0.000   pitch 5.000   roll 0.000 deg"),
    (fallen(Outcome.OUT_OF_TIME), "ran out of time after"),
    (trimmed(), "trim at d_psi = 7.500000 deg/SVL, where +2.0e-06 N mm are left"),
    (trimmed(), "at -20 deg/SVL   -1.0000 N mm"),
    (trimmed(crossings=3), "changes sign 3 times: this is the lowest"),
    (trimmed(False), "no trim: the moment does not change sign between -20 and 20 deg/SVL"),
    (Loads(MOMENTS, MOMENTS, 0.5 * MOMENTS), "Moments over 2 phases (N mm)"),
    (Loads(MOMENTS, MOMENTS, 0.5 * MOMENTS), "2.0000   1.0000   3.0000   2.0000        1.0000"),
    (Loads(MOMENTS, MOMENTS, 0.5 * MOMENTS), "    0.50\n"),
    (slopes(GLIDER.gait), f"d_psi                {np.deg2rad(1.0):.6f} N mm/deg"),
    (slopes(GLIDER.gait), "nu_theta             1.000000 N mm/1"),
    (slopes(Driven(Serpenoid(), Running(GLIDER.gait))), "drive.inputs[5]      1.000000 N mm/1"),
    (slopes(GLIDER.gait), f"pitch                {2 * np.deg2rad(1.0):.6f} N mm/deg"),
    (
        Equilibrium(jnp.array([4.0, -3.0]), jnp.arctan2(3.0, 4.0), jnp.array(True), True),
        "Steady glide: 36.87 deg below the horizontal, stable in speed",
    ),
    (
        Equilibrium(jnp.array([jnp.nan] * 2), jnp.nan, jnp.array(False), jnp.array(False)),
        "Steady glide: none found",
    ),
    (BodyPolar(*jnp.full((6, 2), 0.5)), "28.6 deg             0.5000"),
]


@pytest.mark.parametrize(("result", "line"), LINES)
def test_a_result_says_what_it_is(result, line):
    assert line in str(result)
    shown = result._repr_html_()
    assert shown.startswith(f"<p><b>{str(result).splitlines()[0]}")


@pytest.mark.parametrize(
    ("result", "line"),
    [
        (fallen(), "3 held glides\n  landed             3"),
        (trimmed(), "3 trims\n  found            3"),
        (slopes(GLIDER.gait), "3 derivatives of the mean moment"),
        (Loads(MOMENTS, MOMENTS, MOMENTS), "Loads of shape (3, 2)"),
        (
            Equilibrium(jnp.zeros(2), jnp.zeros(()), jnp.array(True), jnp.array(True)),
            "3 steady glides\n  found            3",
        ),
        (BodyPolar(*jnp.full((6, 2), 0.5)), "3 polars"),
    ],
)
def test_of_many_it_says_how_many(result, line):
    many = jax.tree.map(lambda x: jnp.stack([jnp.asarray(x)] * 3), result)
    assert str(many) == line
