"""Gradients of whole glides, through the launch and the end event.

Central differences of adaptive solves carry the noise of changing step sequences, so the
differences are of fourth order with wide steps; fixed-step solves carry none and show that
the derivative is that of the very same computation.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Gait, Glider, Launch, Polar, Snake, simulate
from jaxglide.flight import stored

NAMES = ("theta_m", "psi_m", "nu_theta", "f_theta", "d_psi", "speed", "height", "mass", "lift")
# Rows of gaits: theta_m, psi_m, d_psi [deg], nu_theta, f_theta; from 2 m to keep it short.
GAITS = np.array(
    [
        [96.48753, 20.0, 10.0, 1.4, 1.2],
        [104.0, 25.0, 5.0, 1.25, 1.4],
        [113.0, 20.0, 0.0, 1.1, 1.2],
        [91.0, 15.0, 12.0, 1.5, 1.0],
        [100.0, 30.0, -5.0, 1.3, 1.5],
        [108.0, 20.0, 15.0, 1.2, 1.1],
    ]
)


def parameters(gait):
    theta_m, psi_m, d_psi, nu_theta, f_theta = gait
    angles = np.deg2rad([theta_m, psi_m, d_psi])
    values = [angles[0], angles[1], nu_theta, f_theta, angles[2], 1.75, 2.0, 0.038, 1.0]
    return np.array(values)


def build(p, polar=Polar.smooth):
    theta_m, psi_m, nu_theta, f_theta, d_psi, speed, height, mass, lift = p
    snake = Snake.from_svl(0.7, mass, nodes=36, node_set="gauss")
    gait = Gait(theta_m, psi_m, nu_theta, f_theta, d_psi)
    return Glider(snake, gait, polar(lift_scale=lift)), Launch(height, speed)


def outputs(p, **options):
    """Landing distance, path length, end time and largest |roll|."""
    glide = simulate(*build(p), **options)
    roll = glide.max_angles[2]
    return jnp.stack([glide.landing_point[1], glide.path_length, glide.time, roll])


def central(function, p, index, h):
    """Fourth-order central difference along one parameter, in steps of `h`."""
    e = np.zeros_like(p)
    e[..., index] = h
    near, far = function(p + e) - function(p - e), function(p + 2 * e) - function(p - 2 * e)
    return (8 * near - far) / (12 * h)


POINTS = np.stack([parameters(gait) for gait in GAITS])
SCALE = np.array([0.1, 0.1, 0.1, 0.1, 0.1, 1.0, 1.0, 0.01, 0.1])


@pytest.fixture(scope="module")
def forward():
    """Jacobians of fixed-step solves of all gaits: jit of vmap."""
    jacobian = jax.jacfwd(lambda p: outputs(p, step=0.01))
    return np.asarray(jax.jit(jax.vmap(jacobian))(POINTS))


def test_against_differences_of_fixed_step_solves(forward):
    values = jax.jit(jax.vmap(lambda p: outputs(p, step=0.01)))
    for index, name in enumerate(NAMES):
        difference = central(values, POINTS, index, 3e-4 * SCALE[index])
        error = np.abs(forward[:, :, index] - difference) * SCALE[index]
        largest = (np.abs(forward) * SCALE).max(axis=2)
        assert np.all(error < 1e-6 * largest), (name, error / largest)


@pytest.mark.slow
@pytest.mark.parametrize("height", [2.0, 10.0])
def test_against_differences_of_tight_solves(height):
    """Adaptive solves at 1e-11: at most 1e-4 of the largest scaled derivative.

    Two differences together, for the curvature of a 10 m glide is in one alone: 3e-4 by a
    step of 1e-3 for the bend.
    """
    tight = {"rtol": 1e-11, "atol": 1e-11}
    points = POINTS.copy()
    points[:, NAMES.index("height")] = height
    values = jax.jit(jax.vmap(lambda p: outputs(p, **tight)))
    jacobian = np.asarray(jax.jit(jax.vmap(jax.jacfwd(lambda p: outputs(p, **tight))))(points))
    largest = (np.abs(jacobian) * SCALE).max(axis=2)
    for index, name in enumerate(NAMES):
        wide, near = (central(values, points, index, h * SCALE[index]) for h in (1e-3, 5e-4))
        difference = (4 * near - wide) / 3
        error = np.abs(jacobian[:, :, index] - difference) * SCALE[index]
        assert np.all(error < 1e-4 * largest), (name, error / largest)


@pytest.mark.slow
def test_reverse_mode_of_the_default(forward):
    reverse = jax.vmap(jax.jacrev(lambda p: outputs(p, step=0.01)))(POINTS[:2])
    np.testing.assert_allclose(reverse, forward[:2], rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_reverse_mode_through_a_flight_in_parts(forward, monkeypatch):
    """Of 16 steps each, all but the last flown once more on the way back."""
    monkeypatch.setattr(stored, "_KEPT", 16)
    reverse = jax.jit(jax.jacrev(lambda p: outputs(p, step=0.01, max_steps=5000)))
    np.testing.assert_allclose(reverse(POINTS[0]), forward[0], rtol=1e-9, atol=1e-12)


@pytest.mark.slow
def test_reverse_mode_with_steps_of_the_controller():
    """Largest angles, too, which the steps follow. Where kinks of the polar lie in a step
    hangs on round-off, which differs between the two programs."""

    def value(p):
        glide = simulate(*build(p))
        return glide.landing_point[1] + glide.time + jnp.sum(glide.max_angles)

    one = POINTS[0]
    forward, reverse = (jax.jit(f(value))(one) * SCALE for f in (jax.jacfwd, jax.grad))
    assert np.all(np.abs(forward - reverse) < 1e-5 * np.abs(forward).max())


@pytest.mark.slow
def test_checkpointed_reverse_mode_agrees_with_forward(forward):
    """An independent derivative: the checkpointed adjoint, through launch and event."""
    adjoint = diffrax.RecursiveCheckpointAdjoint()
    reverse = jax.jit(jax.jacrev(lambda p: outputs(p, step=0.01, adjoint=adjoint)))
    largest = (np.abs(forward[0]) * SCALE).max(axis=1, keepdims=True)
    error = np.abs(reverse(POINTS[0]) - forward[0]) * SCALE
    assert np.all(error < 1e-6 * largest), error / largest


@pytest.mark.slow
def test_reverse_mode_with_respect_to_modules(forward):
    """`filter_grad` of a glide with respect to the body: the same as in forward mode."""
    glider, launch = build(POINTS[0])

    @eqx.filter_jit
    @eqx.filter_grad
    def gradient(snake):
        flying = Glider(snake, glider.gait, glider.aerodynamics.polar)
        return simulate(flying, launch, step=0.01).landing_point[1]

    found = gradient(glider.body)
    for leaf in jax.tree.leaves(found):
        assert np.all(np.isfinite(leaf))
    assert float(found.mass) == pytest.approx(forward[0, 0, NAMES.index("mass")], rel=1e-9)
    assert found.neck_fraction != 0


@pytest.mark.slow
def test_many_parameters_use_the_reverse_rule():
    """More parameters than outputs: the polar's 13,824 coefficients at once."""
    glider, launch = build(POINTS[0])

    def distance(cells):
        polar = Polar(cells)
        return simulate(Glider(glider.body, glider.gait, polar), launch, step=0.02).state[1]

    cells = glider.aerodynamics.polar.cells
    gradient = np.asarray(jax.jit(jax.grad(distance))(cells))
    assert np.all(np.isfinite(gradient))
    # Along the direction that scales all lift, it is the derivative by the lift scale.
    scaled = jnp.zeros_like(cells).at[:, :, 0].set(cells[:, :, 0])

    def by_scale(scale):
        polar = Polar(cells, lift_scale=scale)
        return simulate(Glider(glider.body, glider.gait, polar), launch, step=0.02).state[1]

    expected = float(jax.jacfwd(by_scale)(1.0))
    assert abs(np.sum(gradient * scaled) - expected) < 1e-8 * abs(expected)


def test_a_lane_that_goes_wrong_keeps_its_gradient_to_itself():
    """No gravity, and so no launch speed and no end; not a number; out of time."""

    @jax.jit
    @jax.vmap
    @jax.grad
    def gradient(p):
        gravity, psi_m, height = p
        snake = Snake.from_svl(0.7, 0.038, nodes=36, node_set="gauss")
        glider = Glider(snake, Gait(1.7, psi_m, 1.4, 1.2), Polar.smooth(), gravity=gravity)
        return simulate(glider, Launch(height), max_time=1.0).state[1]

    good = [9.81, 0.35, 1.0]
    bad = [[0.0, 0.35, 1.0], [9.81, np.nan, 1.0], [9.81, 0.35, 50.0], [np.nan, 0.35, 1.0]]
    found = np.asarray(gradient(np.array([good, *bad])))
    np.testing.assert_array_equal(found[0], gradient(np.array([good] * 5))[0])
    assert np.abs(found[0]).min() > 0
    assert np.isfinite(found[[1, 3]]).all()
    assert found[3, 2] == 0  # the ground is never met


@pytest.mark.slow
def test_gradients_of_a_straight_body_are_finite():
    snake = Snake.from_svl(gyration=0.25)
    glider = Glider(snake, Gait.from_degrees(0, 0, d_psi=0), Polar.smooth())

    @eqx.filter_jit
    @eqx.filter_grad
    def gradient(given):
        return simulate(*given).time

    leaves = jax.tree.leaves(gradient((glider, Launch())))
    assert all(np.isfinite(leaf).all() for leaf in leaves)


@pytest.mark.slow
def test_gradients_of_bodies_bent_past_the_vertical():
    """By wave number, over vertical amplitudes to either side of 90 degrees."""
    snake = Snake.from_svl(nodes=60, node_set="gauss")

    def forward(nu_theta, psi_m):
        gait = Gait(jnp.deg2rad(90.0), psi_m, nu_theta, 1.2, jnp.deg2rad(10.0))
        glider = Glider(snake, gait, Polar.smooth())
        return simulate(glider, Launch(2.0), rtol=1e-9, atol=1e-9).landing_point[1]

    value, slope = (jax.jit(jax.vmap(f)) for f in (forward, jax.jacfwd(forward)))
    psi_m, nu, h = np.deg2rad([60.0, 75, 85, 95, 110]), np.full(5, 1.3), 1e-3
    difference = (value(nu + h, psi_m) - value(nu - h, psi_m)) / (2 * h)
    np.testing.assert_allclose(slope(nu, psi_m), difference, rtol=1e-3)


@pytest.mark.slow
def test_second_derivatives_exist():
    """Forward over reverse: the Hessian of the landing distance is symmetric."""

    def distance(q):
        p = jnp.asarray(POINTS[0]).at[jnp.array([0, 2])].set(q)
        return outputs(p, step=0.02)[0]

    at = POINTS[0][[0, 2]]
    hessian = np.asarray(jax.jit(jax.jacfwd(jax.grad(distance)))(at))
    assert np.all(np.isfinite(hessian))
    np.testing.assert_allclose(hessian, hessian.T, rtol=1e-6)
    reverse = jax.jit(jax.jacrev(jax.grad(distance)))(at)
    np.testing.assert_allclose(reverse, hessian, rtol=1e-6)
    h = 1e-4 * np.eye(2)
    slope = jax.jit(jax.grad(distance))
    difference = np.stack([slope(at + e) - slope(at - e) for e in h]) / 2e-4
    np.testing.assert_allclose(hessian, difference, rtol=0, atol=1e-4 * np.abs(hessian).max())


@pytest.mark.slow
def test_second_derivatives_with_steps_of_the_controller():
    snake = Snake.from_svl(nodes=40, node_set="gauss")
    glider = Glider(snake, Gait.from_degrees(), Polar.smooth())

    def distance(height):
        launch = Launch(height, 1.7, phi_theta=0.3, angles=(0.0, 0.0, 0.0))
        return simulate(glider, launch, rtol=1e-9, atol=1e-9).landing_point[1]

    slope, h = jax.jit(jax.grad(distance)), 1e-4
    difference = (slope(0.4 + h) - slope(0.4 - h)) / (2 * h)
    for twice in (jax.grad(jax.grad(distance)), jax.jacfwd(jax.jacfwd(distance))):
        assert float(twice(0.4)) == pytest.approx(float(difference), rel=1e-4)


@pytest.mark.slow
def test_second_derivatives_in_a_batch():
    """Of flights of different lengths in one batch, against differences of their slopes.

    These vary so fast with nu_theta that a width of 1e-4 is off by per cents.
    """
    snake = Snake.from_svl(nodes=20, node_set="gauss")
    launch = Launch(0.4, 1.7, phi_theta=0.3, angles=(0.0, 0.0, 0.0))

    def distance(p):
        nu, d_psi, height = p
        gait = Gait.from_degrees(95.0, nu_theta=nu, d_psi=d_psi)
        start = eqx.tree_at(lambda launch: launch.height, launch, height)
        return simulate(Glider(snake, gait, Polar.smooth()), start, step=0.01).landing_point[1]

    points = np.array([[1.1, 3.0, 0.2], [1.3, 8.0, 0.35], [1.45, -5.0, 0.5]])
    hessian = np.asarray(jax.jit(jax.vmap(jax.hessian(distance)))(points))
    slopes = jax.jit(jax.vmap(jax.jacfwd(distance)))
    for k, width in enumerate((2e-6, 2e-4, 2e-6)):
        step = width * np.eye(3)[k]
        difference = (slopes(points + step) - slopes(points - step)) / (2 * width)
        largest = np.abs(difference).max(axis=1, keepdims=True)
        assert np.all(np.abs(hessian[:, k] - difference) < 1e-4 * largest)


@pytest.mark.slow
def test_published_polar_is_only_piecewise_smooth():
    """Its gradient differs from differences by more than the smooth polar's: see README."""

    def distance(p):
        return simulate(*build(p, Polar.published), rtol=1e-9, atol=1e-9).landing_point[1]

    exact = float(jax.jit(jax.jacfwd(distance))(POINTS[0])[0])
    value = jax.jit(distance)
    steps = {h: float(central(value, POINTS[0], 0, h)) for h in (1e-3, 3e-3)}
    mismatch = max(abs(d - exact) for d in steps.values()) / abs(exact)
    assert 1e-7 < mismatch < 0.05
