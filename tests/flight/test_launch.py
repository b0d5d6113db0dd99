"""Take-off: phase and attitude, against figures, brute force, and the equations of motion."""

from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Gait, Glider, Launch, Polar, Snake, StillAir, discretise, take_off
from jaxglide.flight.dynamics import ANGLES, Flight, six_degrees_of_freedom
from jaxglide.loads.inertia import angular_momentum
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

COUNT = 20
GRID = 6000


@jax.jit
def launched(glider):
    return take_off(glider, Launch(), discretise(glider.body))


@pytest.fixture(scope="module")
def gaits():
    """Random gaits over the observed ranges and well past them, leaves (20,)."""
    rng = np.random.default_rng(7)
    low = [60, 0, 0.9, 0.5, -35, -30]
    high = [130, 50, 1.8, 2.0, 35, 30]
    values = rng.uniform(low, high, size=(COUNT, 6)).T
    angles = {
        name: jnp.deg2rad(values[i])
        for i, name in ((0, "theta_m"), (1, "psi_m"), (4, "d_psi"), (5, "d_theta"))
    }
    return jax.vmap(lambda waves: Gait(**waves))(
        {"nu_theta": values[2], "f_theta": values[3], **angles}
    )


@pytest.fixture(scope="module")
def launches(gaits):
    snake, polar, air = Snake.from_svl(), Polar.published(), StillAir()
    return jax.jit(jax.vmap(lambda gait: launched(Glider(snake, gait, polar, air))))(gaits)


@pytest.mark.parametrize("index", range(4))
def test_against_the_published_code(index, golden, glider_of):
    entry = golden("glides")[index]
    start = launched(glider_of(entry))
    assert float(start.phi_theta) == pytest.approx(entry["phi_theta"], abs=1e-5)
    angles = np.rad2deg(start.angles)
    np.testing.assert_allclose(angles, entry["launch_angles_deg"], rtol=0, atol=1e-4)
    assert float(start.speed) == pytest.approx(entry["launch_speed"], rel=1e-9)
    expected = [0, 0, 10, 0, start.speed, 0, 0, 0, 0, *start.angles, 0]
    np.testing.assert_array_equal(start.state, expected)


def test_launch_does_not_depend_on_frequency():
    starts = [
        launched(Glider(Snake.from_svl(), Gait.from_degrees(f_theta=f)))
        for f in (1.2, 0.0, 0.3, 5.0)
    ]
    for start in starts[1:]:
        np.testing.assert_array_equal(start.phi_theta, starts[0].phi_theta)
        np.testing.assert_array_equal(start.angles, starts[0].angles)


def test_phase_is_the_first_minimum_downhill(gaits, launches):
    """|h| on a fine grid round the circle, walked downhill from 0 one point at a time."""
    snake = Snake.from_svl()
    sections = discretise(snake)
    phases = 2 * np.pi / GRID * np.arange(GRID)

    @jax.jit
    @jax.vmap
    def momentum(gait):
        def size(phase):
            body = backbone(
                sections, waves(gait, snake.neck_fraction, sections.fraction, phase, 1.0)
            )
            return jnp.sum(angular_momentum(sections, body) ** 2)

        return jax.lax.map(size, phases, batch_size=100)

    found = []
    for square in np.asarray(momentum(gaits)):
        step = 1 if square[1] < square[-1] else -1
        k = 0
        while square[(k + step) % GRID] < square[k % GRID]:
            k += step
        # vertex of the parabola through the lowest three
        left, here, right = (square[(k + i) % GRID] for i in (-1, 0, 1))
        found.append(2 * np.pi / GRID * (k + 0.5 * (left - right) / (left - 2 * here + right)))
    found = np.array(found)
    assert np.abs(launches.phi_theta - found).max() < 1e-5
    assert np.abs(found).max() > 1  # some lie far away,
    assert found.min() < -0.1 < 0.1 < found.max()  # on either side


def test_phase_is_a_stationary_point_to_round_off(gaits, launches):
    snake = Snake.from_svl()
    sections = discretise(snake)

    def half_square(phase, gait):
        body = backbone(
            sections, waves(gait, snake.neck_fraction, sections.fraction, phase, 1.0)
        )
        return 0.5 * jnp.sum(angular_momentum(sections, body) ** 2)

    slope, curvature = (
        jax.jit(jax.vmap(derivative))(launches.phi_theta, gaits)
        for derivative in (jax.grad(half_square), jax.grad(jax.grad(half_square)))
    )
    assert (curvature > 0).all()
    assert np.abs(slope / curvature).max() < 1e-11  # Newton's step left to take


def test_a_planar_gait_launches_where_its_momentum_vanishes():
    """Without a vertical wave |h| falls to zero, and its slope with it."""
    start = launched(Glider(Snake.from_svl(), Gait.from_degrees(psi_m=0, d_psi=0)))
    nearly = launched(Glider(Snake.from_svl(), Gait.from_degrees(psi_m=1e-7, d_psi=0)))
    assert np.isfinite(start.state).all()
    assert float(nearly.phi_theta) == pytest.approx(float(start.phi_theta), abs=1e-6)
    np.testing.assert_allclose(start.angles[1:], 0, atol=1e-12)  # it only yaws
    assert abs(start.angles[0]) > 1e-3


def weightless(gait):
    return Glider(Snake.from_svl(), gait, Polar.published(0.0, 0.0), gravity=0.0)


@jax.jit
def free_cycle(glider, phi_theta):
    """Attitudes (200, 3) over one cycle of the full equations, without air and gravity."""
    period = 1 / glider.gait.f_theta
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(six_degrees_of_freedom),
        diffrax.Dopri8(),
        t0=0.0,
        t1=period,
        dt0=period / 100,
        y0=jnp.zeros(13),
        args=Flight(glider, discretise(glider.body), phi_theta),
        saveat=diffrax.SaveAt(ts=period * jnp.arange(200) / 200),
        stepsize_controller=diffrax.PIDController(1e-11, 1e-12, dtmax=period / 100),
    )
    return solution.ys[:, ANGLES]


@pytest.mark.parametrize("index", [0, 5, 12])
def test_attitude_is_minus_the_mean_over_a_free_cycle(index, gaits, launches):
    gait = jax.tree.map(lambda x: x[index], gaits)
    cycle = free_cycle(weightless(gait), launches.phi_theta[index])
    mean = np.mean(cycle, axis=0)
    assert np.abs(launches.angles[index] + mean).max() < 1e-7
    assert np.abs(mean).max() > np.deg2rad(2)


def phase_and_angles(values, adjoint=None):
    """Launch angles and phase (4,) of gait and body parameters (6,)."""
    theta_m, psi_m, nu_theta, d_psi, d_theta, neck = values
    gait = Gait(theta_m, psi_m, nu_theta, 1.2, d_psi, d_theta)
    snake = Snake.from_svl(neck_fraction=neck, node_set="gauss", nodes=40)
    start = take_off(Glider(snake, gait), Launch(), discretise(snake), adjoint)
    return jnp.append(start.angles, start.phi_theta)


VALUES = jnp.array([1.8, 0.4, 1.33, 0.2, 0.1, 0.08])


@pytest.fixture(scope="module")
def derived():
    """Derivatives of the launch in forward mode, and the launch."""
    return jax.jit(jax.jacfwd(lambda x: (phase_and_angles(x),) * 2, has_aux=True))


def test_implicit_derivatives_match_differences(derived):
    value, h = lambda x: derived(x)[1], 1e-5
    steps = h * np.eye(VALUES.size)
    differences = np.stack([value(VALUES + d) - value(VALUES - d) for d in steps], 1) / (2 * h)
    scale = np.abs(differences).max(axis=1, keepdims=True)
    assert (np.abs(derived(VALUES)[0] - differences) / scale).max() < 1e-6
    assert (np.abs(differences).max(axis=0) > 1e-3).all()


@pytest.mark.slow
def test_implicit_derivatives_are_the_same_in_reverse_mode(derived):
    in_reverse = partial(phase_and_angles, adjoint=diffrax.RecursiveCheckpointAdjoint())
    reverse, forward = jax.jit(jax.jacrev(in_reverse))(VALUES), derived(VALUES)[0]
    scale = np.abs(forward).max(axis=1, keepdims=True)
    assert (np.abs(reverse - forward) / scale).max() < 1e-9


def test_what_the_launch_gives_is_used():
    glider = Glider(Snake.from_svl(), Gait.from_degrees())
    launch = Launch(height=20.0, speed=3.0, phi_theta=0.5, angles=[0.1, -0.2, 0.3])
    start = jax.jit(lambda g: take_off(g, launch, discretise(g.body)))(glider)
    expected = [0, 0, 20, 0, 3, 0, 0, 0, 0, 0.1, -0.2, 0.3, 0]
    np.testing.assert_allclose(start.state, expected, rtol=0, atol=0)
    assert float(start.phi_theta) == 0.5


def test_published_speed_grows_with_the_root_of_wing_loading():
    heavy = Snake.from_svl(mass=4 * float(Snake.from_svl().mass))
    speeds = [
        float(launched(Glider(snake, Gait.from_degrees())).speed)
        for snake in (Snake.from_svl(), heavy)
    ]
    assert speeds[0] == pytest.approx(1.75340, abs=5e-6)
    assert speeds[1] == pytest.approx(2 * speeds[0], rel=1e-14)
