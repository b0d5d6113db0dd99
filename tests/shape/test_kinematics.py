"""The backbone's motion and the aerofoil frame."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Gait, Snake, discretise
from jaxglide.loads.inertia import angular_momentum, inertia, inertia_tensor
from jaxglide.shape.gait import wave_phase, waves
from jaxglide.shape.kinematics import backbone

GAITS = {
    "published": Gait.from_degrees(),
    "lively": Gait.from_degrees(
        theta_m=118, psi_m=45, nu_theta=1.1, f_theta=1.7, d_psi=-20, d_theta=30
    ),
}
SNAKES = {
    "published": Snake.from_svl(),
    "gauss": Snake.from_svl(neck_fraction=0.075, nodes=60, node_set="gauss"),
    "flat": Snake.from_svl(gyration=0.25),
}


@jax.jit
def body_at(snake, gait, phi_theta, time):
    sections = discretise(snake)
    body = backbone(
        sections,
        waves(gait, snake.neck_fraction, sections.fraction, *wave_phase(gait, phi_theta, time)),
    )
    return sections, body


@pytest.mark.parametrize("index", [0, 1])
def test_against_the_published_code(index, golden, glider_of, relative_error):
    entry = golden("kinematics")[index]
    glider = glider_of(entry)
    sections, body = body_at(glider.body, glider.gait, entry["phi_theta"], entry["t"])
    nodes = entry["nodes"]
    for name in ("position", "velocity", "tangent", "chord"):
        value = np.asarray(getattr(body, name))[:, nodes].T
        np.testing.assert_allclose(value, entry[name], rtol=0, atol=1e-8)
    # The published accelerations are differenced and rounded to 1e-4.
    acceleration = np.asarray(body.acceleration)[:, nodes].T
    assert np.abs(acceleration - entry["acceleration"]).max() < 1e-4
    tensor = inertia_tensor(sections, body)
    assert relative_error(tensor, entry["inertia"]) < 1e-7
    momentum = angular_momentum(sections, body)
    assert relative_error(momentum, entry["angular_momentum"]) < 1e-7


@jax.jit
def by_differentiation(snake, gait, time):
    """The body, and first and second time derivatives of it by forward mode."""

    def body(t):
        return body_at(snake, gait, 0.2, t)[1]

    def rate(t):
        return jax.jvp(body, (t,), (1.0,))[1]

    first, second = jax.jvp(rate, (time,), (1.0,))
    sections, now = body_at(snake, gait, 0.2, time)
    tensor, tensor_rate = jax.jvp(lambda t: inertia_tensor(sections, body(t)), (time,), (1.0,))
    momentum, momentum_rate = jax.jvp(
        lambda t: angular_momentum(sections, body(t)), (time,), (1.0,)
    )
    expected = tensor, tensor_rate, momentum, momentum_rate
    return now, first, second, inertia(sections, now), expected


@pytest.mark.parametrize("snake", SNAKES)
@pytest.mark.parametrize("gait", GAITS)
def test_velocity_acceleration_and_inertia_rates_are_derivatives(snake, gait):
    for time in (0.0, 0.37):
        now, first, second, rates, expected = by_differentiation(
            SNAKES[snake], GAITS[gait], time
        )
        np.testing.assert_allclose(now.velocity, first.position, rtol=0, atol=1e-10)
        np.testing.assert_allclose(now.acceleration, second.position, rtol=0, atol=1e-10)
        np.testing.assert_allclose(now.acceleration, first.velocity, rtol=0, atol=1e-10)
        assert np.abs(now.acceleration).max() > 1
        for value, derivative in zip(rates, expected, strict=True):
            scale = np.abs(derivative).max()
            assert scale > 0
            np.testing.assert_allclose(value, derivative, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("snake", SNAKES)
@pytest.mark.parametrize("gait", GAITS)
def test_frames_are_orthonormal_and_the_chord_is_level(snake, gait):
    for time in (0.0, 0.23, 0.61):
        _, body = body_at(SNAKES[snake], GAITS[gait], 0.2, time)
        frame = np.stack([body.tangent, body.chord, body.normal]).transpose(2, 0, 1)
        identity = np.broadcast_to(np.eye(3), frame.shape)
        np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), identity, atol=1e-15)
        np.testing.assert_allclose(np.linalg.det(frame), 1, atol=1e-15)
        level = np.cross([0, 0, 1], np.asarray(body.tangent).T)
        level /= np.linalg.norm(level, axis=1)[:, None]
        np.testing.assert_allclose(body.chord.T, level, rtol=0, atol=1e-15)
        assert (body.normal[2] > 0).all()  # the back is up


def test_neighbouring_nodes_are_a_tangent_apart():
    """The body has its length: positions differ by the mean tangent times the spacing."""
    sections, body = body_at(SNAKES["published"], GAITS["lively"], 0.2, 0.1)
    mean = (body.tangent[:, 1:] + body.tangent[:, :-1]) / 2
    np.testing.assert_allclose(np.diff(body.position, axis=1), 0.01 * mean, atol=1e-15)
    for field in (body.position, body.velocity, body.acceleration):
        assert np.abs(field @ sections.mass).max() < 1e-14 * max(1, np.abs(field).max())


def test_the_inertia_is_that_of_two_half_masses_either_side():
    """Section by section, at +-gyration x chord along the chord, in motion."""
    snake, gait = SNAKES["flat"], GAITS["lively"]

    def points(time):
        sections, body = body_at(snake, gait, 0.2, time)
        offset = 0.25 * sections.chord * body.chord
        half = sections.mass / 2
        position = jnp.concatenate([body.position + offset, body.position - offset], axis=1)
        return jnp.concatenate([half, half]), position

    mass, r = points(0.37)
    _, v = jax.jvp(lambda t: points(t)[1], (0.37,), (1.0,))
    sections, body = body_at(snake, gait, 0.2, 0.37)
    tensor = jnp.sum(mass * r * r) * jnp.eye(3) - (mass * r) @ r.T
    np.testing.assert_allclose(inertia_tensor(sections, body), tensor, rtol=0, atol=1e-18)
    momentum = jnp.sum(jnp.cross(r, mass * v, axis=0), axis=1)
    np.testing.assert_allclose(angular_momentum(sections, body), momentum, rtol=0, atol=1e-17)
    thin = inertia_tensor(eqx.tree_at(lambda s: s.axial_inertia, sections, 0.0), body)
    assert np.abs(tensor - thin).max() > 1e-3 * np.abs(tensor).max()


def test_beyond_vertical_the_body_carries_its_frame_along():
    """psi past 90 degrees: neighbours keep belly and back on the same sides."""
    gait = Gait(theta_m=0.0, psi_m=0.0, nu_theta=1.0, f_theta=0.0, d_psi=np.deg2rad(150))
    sections, body = body_at(SNAKES["published"], gait, 0.0, 0.0)
    psi = np.deg2rad(150) * np.asarray(sections.fraction)
    assert psi.max() > np.pi / 2 + 0.5
    np.testing.assert_allclose(body.chord, np.eye(3)[0][:, None] + 0 * psi, atol=1e-15)
    np.testing.assert_allclose(body.normal[2], np.cos(psi), atol=1e-15)


def test_the_frame_is_smooth_where_the_tangent_is_vertical():
    """psi_m exactly 90 degrees: value and slope as just before and just after."""
    snake = SNAKES["published"]
    sections = discretise(snake)

    @jax.jit
    def frames(psi_m):
        # psi = -psi_m cos(2a) with nu = 0: every node behind the neck at psi_m itself
        gait = Gait(theta_m=1.0, psi_m=psi_m, nu_theta=0.0, f_theta=1.0)
        body = backbone(
            sections, waves(gait, snake.neck_fraction, sections.fraction, jnp.pi / 2, 0.0)
        )
        return jnp.stack([body.tangent, body.chord, body.normal])

    vertical, h = jnp.asarray(np.pi / 2), 1e-5
    value, slope = jax.jvp(frames, (vertical,), (jnp.ones(()),))
    assert value[0, 2, -1] == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(np.linalg.norm(value, axis=1), 1, atol=1e-15)
    difference = (frames(vertical + h) - frames(vertical - h)) / (2 * h)
    np.testing.assert_allclose(slope, difference, rtol=0, atol=1e-9)
