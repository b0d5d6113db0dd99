"""Cycles that repeat one: beside the helix they lie on, and beside a solved flight."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from made_steady import HEADING, made_steady, on_the_way

import jaxglide as jg
from jaxglide.flight.dynamics import ANGLES
from jaxglide.steady.repeat import repeated


@pytest.mark.parametrize("turn_rate", [0.0, 0.9, -0.9, 12.0])
def test_what_repeats_a_cycle_goes_on_along_its_helix(turn_rate):
    glide = made_steady(turn_rate)
    flown = repeated(glide, 3)
    assert float(flown.time) == pytest.approx(3 * float(glide.period), rel=1e-12)
    times = np.linspace(0, float(flown.time), 3 * 64 + 1)
    wanted = on_the_way(times, turn_rate, heading=0.0, f_theta=1 / float(glide.period))
    wanted[:, ANGLES.start] += HEADING  # it is the mean path that starts forward
    found = np.array(flown.at(times))
    found[:, ANGLES.start] -= (
        2 * np.pi * np.round((found - wanted)[0, ANGLES.start] / 2 / np.pi)
    )
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_a_wind_does_not_show():
    glide = made_steady()
    windy = dataclasses.replace(glide.glider, air=jg.UniformWind([1.0, 2.0, 3.0]))
    flown = repeated(dataclasses.replace(glide, glider=windy), 2)
    np.testing.assert_array_equal(flown.state, repeated(glide, 2).state)
    assert isinstance(flown.glider.air, jg.StillAir)


def test_what_was_not_found_is_not_repeated():
    with pytest.raises(ValueError, match=r"no steady glide to draw: the search came to no end"):
        repeated(made_steady(found=False))


@pytest.mark.slow
def test_a_helix_is_flown_as_it_is_repeated():
    snake = jg.Snake.from_svl(0.70, nodes=40, node_set="gauss")
    gait = jg.Gait.from_degrees(60, 0.0, 1.738, 0.0, 5.5)  # frozen, so it turns
    glide = jg.steady_glide(jg.Glider(snake, gait, jg.Polar.smooth()))
    assert abs(float(glide.turn_rate)) > 0.1
    flown, drawn = glide.fly(2, rtol=1e-9, atol=1e-9), repeated(glide, 2)
    yaw = float(drawn.start[ANGLES][0])
    s, c = np.sin(yaw), np.cos(yaw)
    x, y, z = np.asarray(flown.landing_point)
    np.testing.assert_allclose(
        drawn.landing_point, [c * x - s * y, s * x + c * y, z], atol=1e-4
    )
    turned = jnp.asarray([yaw, 0, 0])
    np.testing.assert_allclose(drawn.end_angles, flown.end_angles + turned, atol=1e-4)
