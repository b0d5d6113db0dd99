"""Steady glides: closure, multipliers, derivatives, symmetries, against figures and flights."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxglide as jg
from jaxglide.steady.closure import Kind, Sought, orbit, slopes
from jaxglide.steady.modes import modes_of
from jaxglide.steady.reduced import MIRROR, embed, rates, reduce
from jaxglide.steady.result import Reason

slow = pytest.mark.slow
FINE = 1 / 1200  # s

# State at phase 0 near the steady glides: right, forward, up, omega, pitch, roll.
NEAR_PUBLISHED = [-1.35, 6.32, -9.57, -1.75, 1.45, 0.66, -0.802, -0.180]
NEAR_LONG = [0.09, 8.94, -3.80, 0.017, 0.932, -0.780, -0.0863, -0.0789]


def published(nodes=60, **changes):
    snake = jg.Snake.from_svl(0.70, nodes=nodes, node_set="gauss")
    return jg.Glider(snake, jg.Gait.from_degrees(nu_theta=1.4, **changes), jg.Polar.smooth())


def long_glider(nodes=60):
    """The gait that glides 143 m from 75 m."""
    gait = jg.Gait.from_degrees(60, 0.0, 1.738, 1.30, 5.5)
    return dataclasses.replace(published(nodes), gait=gait)


def slope_at_start(glide):
    """Path below the horizontal at the start of a cycle [deg]."""
    right, forward, up = np.asarray(glide.state[:3])
    return np.rad2deg(np.arctan2(-up, np.hypot(right, forward)))


def figures(glide):
    """Speed, path at the start, pitch, roll."""
    pitch, roll = np.rad2deg(np.asarray(glide.state[6:]))
    return [float(glide.speed), slope_at_start(glide), pitch, roll]


@pytest.fixture(scope="module")
def glide():
    """The published gait's, on 60 nodes."""
    return jg.steady_glide(published(), NEAR_PUBLISHED)


@pytest.fixture(scope="module")
def posed(glide):
    given = jnp.asarray(0.0), jnp.asarray(1 / 300)
    return Sought(glide.glider, *given, Kind(frozen=False, mirrored=True))


def test_the_published_gait_on_60_nodes(glide):
    assert bool(glide.found)
    assert glide.why == "found"
    assert float(glide.residual) < 1e-12
    np.testing.assert_allclose(figures(glide), [11.548, 55.95, -45.95, -10.29], atol=0.005)
    expected = [6.885, 0.6305, 0.5535, 0.2927, 0.1824, 0.0301, 0.0017, 0.0001]
    np.testing.assert_allclose(np.abs(glide.multipliers), expected, rtol=5e-4, atol=5e-5)
    assert float(glide.spectral_radius) == abs(complex(glide.multipliers[0]))
    assert not bool(glide.stable)
    assert float(glide.turn_rate) == 0
    assert float(glide.turn_radius) == np.inf


def test_the_mean_path_is_that_of_the_cycle(glide):
    x, y, z = np.asarray(glide.states[-1, :3])
    expected = np.hypot(x, y) / -z
    assert float(glide.lift_to_drag) == pytest.approx(expected, rel=1e-12)
    assert float(glide.glide_angle) == pytest.approx(np.arctan2(-z, np.hypot(x, y)), rel=1e-12)
    assert float(glide.sink_rate) == pytest.approx(-z * 1.2, rel=1e-12)
    np.testing.assert_allclose(glide.angles[-1], glide.angles[0], atol=1e-12)


def test_multipliers_against_central_differences_of_a_whole_cycle(glide, posed):
    """Derivatives are those of half a cycle, twice: so this is also two halves and a whole."""
    unit = np.asarray(posed.scales())
    u, step = glide.state / unit, 1e-5
    found = np.empty((8, 8))
    for k in range(8):
        d = step * np.eye(8)[k]
        ends = [orbit(u + s * d, posed).missed + u + s * d for s in (1, -1)]
        found[:, k] = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(glide.slopes, found, atol=1e-6 * np.abs(found).max())
    expected = np.linalg.eigvals(found)
    expected = expected[np.argsort(-np.abs(expected))]
    np.testing.assert_allclose(glide.multipliers, expected, atol=1e-6)


def test_half_a_cycle_later_it_is_its_own_mirror_image(glide):
    half = glide.states[len(glide.states) // 2]
    np.testing.assert_allclose(reduce(half), MIRROR * glide.state, rtol=1e-9, atol=1e-9)


def test_a_uniform_wind_changes_nothing(glide):
    windy = dataclasses.replace(published(), air=jg.UniformWind([1.0, -2.0, 0.5]))
    found = jg.steady_glide(windy, NEAR_PUBLISHED)
    for name in ("state", "multipliers", "glide_angle", "sink_rate"):
        np.testing.assert_array_equal(getattr(found, name), getattr(glide, name))


def test_what_is_not_found_says_why_and_is_not_a_number(glide):
    missing = jg.steady_glide(published(), [0, 0.1, 30.0, 20, -20, 20, 1.4, 3.0])
    assert not bool(missing.found)
    assert int(missing.reason) == Reason.NOT_CONVERGED
    assert str(missing).startswith(f"No steady glide: {missing.why}")
    assert np.isnan(np.asarray(missing.multipliers)).all()
    assert np.isnan(float(missing.glide_angle))
    assert missing.modes == ()
    with pytest.raises(ValueError, match="no steady glide to fly"):
        missing.fly()


def test_the_report(glide):
    said = str(glide)
    angle = np.rad2deg(float(glide.glide_angle))
    assert said.startswith(f"Steady glide, {angle:.2f} deg below the horizontal: unstable")
    assert f"spectral radius  {float(glide.spectral_radius):.4f} a cycle" in said
    assert said.count("\n  mode ") == 8
    assert "how sure: .uncertainty" in said
    assert "<b>Steady glide" in glide._repr_html_()


def test_rates_of_the_reduced_state_are_those_of_a_flight(flight, random_states):
    """From a state of any place and yaw, through `reduce`."""
    times, states = random_states(3)
    for t, state in zip(times, states, strict=True):
        rate = jg.six_degrees_of_freedom(t, state, flight)
        along = jax.jvp(reduce, (jnp.asarray(state),), (rate,))[1]
        np.testing.assert_allclose(rates(t, reduce(state), flight), along, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(reduce(embed(reduce(state))), reduce(state), rtol=1e-14)


def test_modes_of_a_known_spectrum():
    """A pair that turns in pitch, a slow spiral, and what decays in no clear component."""
    growth = 0.9 * np.exp(2j * np.pi * 0.1)
    pair = [[growth.real, -growth.imag], [growth.imag, growth.real]]
    slopes = np.diag([0.5, 0.5, 0.4, 0, 0.3, 0.2, 0, 1.01])
    slopes[np.ix_([3, 6], [3, 6])] = pair
    modes = modes_of(slopes, 2.0, frozen=False)
    assert [mode.name for mode in modes[:2]] == ["spiral", "oscillation of pitch"]
    assert modes[0].doubling == pytest.approx(2 * np.log(2) / np.log(1.01))
    assert modes[0].cycles == pytest.approx(modes[0].doubling / 2)
    assert modes[1].frequency == pytest.approx(0.05)
    assert modes[1].growth == pytest.approx(np.log(0.9) / 2)
    assert len(modes) == 7
    mixed = np.full((8, 8), 0.1)
    assert {mode.name for mode in modes_of(mixed, 1.0, frozen=True)[:1]} == {""}


@pytest.mark.parametrize(
    ("build", "error", "message"),
    [
        (lambda g: jg.steady_glide(g, [1.0, 2.0]), ValueError, r"guess has shape \(2,\)"),
        (lambda g: jg.steady_glide(g, [np.nan] * 8), ValueError, "guess = nan"),
        (lambda g: jg.steady_glide(g, step=1.0), ValueError, "step = 1 s is not allowed"),
        (lambda g: jg.steady_glide(g, starts=-1), ValueError, "starts = -1 is not allowed"),
        (lambda g: jg.steady_glides(g, apart=0.0), ValueError, "apart = 0 is not allowed"),
        (lambda g: jg.steady_glide(None), TypeError, "glider must be of type Glider"),
        (
            lambda g: jg.steady_glide(dataclasses.replace(g, air=jg.ShearWind([0, 1, 0]))),
            TypeError,
            "air must be of type StillAir or UniformWind, not ShearWind",
        ),
        (
            lambda g: jg.steady_glide(
                dataclasses.replace(g, aerodynamics=jg.LaggingCirculation(jg.Polar.smooth()))
            ),
            TypeError,
            "aerodynamics of type LaggingCirculation have states",
        ),
        (
            lambda g: jg.steady_glide(
                dataclasses.replace(g, gait=jg.Driven(jg.Serpenoid(), jg.Running(g.gait)))
            ),
            TypeError,
            "gait must be of type Gait",
        ),
    ],
)
def test_bad_input_is_named(build, error, message):
    with pytest.raises(error, match=message):
        build(published())


@slow
def test_the_two_examples_on_200_nodes():
    found = jg.steady_glide(published(200), NEAR_PUBLISHED, step=FINE)
    np.testing.assert_allclose(figures(found), [11.542, 55.85, -45.85, -10.26], atol=0.006)
    expected = [7.836, 0.6307, 0.5552, 0.2927, 0.1731, 0.0298, 0.0017, 0.0001]
    np.testing.assert_allclose(np.abs(found.multipliers), expected, rtol=2e-4, atol=6e-5)
    found = jg.steady_glide(long_glider(200), NEAR_LONG, step=FINE)
    np.testing.assert_allclose(figures(found), [9.715, 23.02, -4.95, -4.53], atol=0.006)
    expected = [1.0061, 0.7115, 0.7115, 0.7048, 0.7048, 0.0716, 0.0435, 0.0435]
    np.testing.assert_allclose(np.abs(found.multipliers), expected, atol=6e-5)
    assert [mode.name for mode in found.modes][:1] == ["spiral"]


@slow
def test_without_a_guess_the_same_is_found(glide):
    found = jg.steady_glide(published())
    np.testing.assert_allclose(found.state, glide.state, rtol=1e-9)


@slow
def test_the_step_of_the_solver_hardly_matters(glide):
    fine = jg.steady_glide(published(), NEAR_PUBLISHED, step=FINE)
    np.testing.assert_allclose(fine.state, glide.state, atol=2e-5)
    np.testing.assert_allclose(fine.multipliers, glide.multipliers, rtol=2e-3, atol=1e-5)


@slow
def test_a_small_change_grows_in_a_long_flight_as_the_multiplier_says(glide):
    """Flown by `integrate`, with steps of its own, off and on along the leading mode."""
    values, vectors = np.linalg.eig(np.asarray(glide.slopes))
    leading = np.real(vectors[:, np.argmax(np.abs(values))])
    unit = np.asarray(Sought.scales(posed_of(glide)))
    ends = []
    for size in (1e-7, -1e-7):
        start = embed(glide.state + size * leading * unit)
        times = np.array([1.0, 2.0, 3.0]) * float(glide.period)
        flown = jg.integrate(
            glide.glider, start, 0.0, times[-1], save=times, rtol=1e-11, atol=1e-11
        )
        ends.append(np.array([np.asarray(reduce(s)) / unit for s in flown.states]))
    growth = np.linalg.norm(ends[0] - ends[1], axis=1)
    expected = float(glide.spectral_radius)
    np.testing.assert_allclose(growth[1:] / growth[:-1], expected, rtol=0.01)
    np.testing.assert_allclose(growth[0] / 2e-7, expected, rtol=0.01)


def posed_of(glide):
    given = glide.phase, jnp.asarray(1 / 300)
    return Sought(glide.glider, *given, Kind(frozen=False, mirrored=True))


@slow
def test_a_whole_cycle_finds_what_half_a_one_does(glide, posed):
    whole = dataclasses.replace(posed, kind=Kind(frozen=False, mirrored=False))
    u = glide.state / posed.scales()
    np.testing.assert_allclose(slopes(u, whole), glide.slopes, rtol=1e-6, atol=1e-9)


@slow
def test_a_lateral_bias_gives_a_helix_and_its_opposite_the_mirror_image():
    left = jg.steady_glide(published(d_theta=5.0), NEAR_PUBLISHED, step=FINE)
    image = MIRROR * np.array(NEAR_PUBLISHED)
    right = jg.steady_glide(published(d_theta=-5.0), image, phase=np.pi, step=FINE)
    assert bool(left.found)
    assert bool(right.found)
    assert float(left.residual) < 1e-9
    assert abs(float(left.turn_rate)) > 1e-3
    np.testing.assert_allclose(right.state, MIRROR * left.state, atol=1e-9)
    assert float(left.turn_rate) == pytest.approx(-float(right.turn_rate), rel=1e-9)
    assert float(left.glide_angle) == pytest.approx(float(right.glide_angle), rel=1e-9)
    # places cycle after cycle lie on a circle of that radius
    flown = left.fly(2, save=left.period * np.arange(3.0), rtol=1e-10, atol=1e-10)
    a, b, c = (np.asarray(flown.states[k, :2]) for k in (0, 1, 2))
    sides = [np.linalg.norm(p - q) for p, q in ((a, b), (b, c), (c, a))]
    area = 0.5 * abs(np.linalg.det(np.array([b - a, c - a])))
    assert float(left.turn_radius) == pytest.approx(np.prod(sides) / (4 * area), rel=1e-4)


@slow
def test_the_wind_carries_the_flight_along(glide):
    wind = np.array([1.0, -2.0, 0.5])
    windy = dataclasses.replace(published(), air=jg.UniformWind(wind))
    drift = jg.steady_glide(windy, NEAR_PUBLISHED).fly(rtol=1e-10, atol=1e-10)
    still = glide.fly(rtol=1e-10, atol=1e-10)
    expected = still.state[:3] + wind * float(glide.period)
    np.testing.assert_allclose(drift.state[:3], expected, atol=1e-6)
    np.testing.assert_allclose(still.state[:3], glide.states[-1, :3], atol=1e-5)


@slow
def test_derivatives_against_glides_found_again(glide):
    """Of the glide angle and the spectral radius, by four numbers of the gait."""
    names = "theta_m", "nu_theta", "f_theta", "d_psi"
    gait = published(f_theta=1.21).gait  # where another frequency takes as many steps

    def found(values):
        changed = dataclasses.replace(gait, **dict(zip(names, values, strict=True)))
        other = jg.steady_glide(dataclasses.replace(published(), gait=changed), NEAR_PUBLISHED)
        return jnp.stack([other.glide_angle, other.spectral_radius])

    here = jnp.stack([getattr(gait, name) for name in names])
    slopes = jax.jacfwd(found)(here)
    for k in range(len(names)):
        d = 1e-5 * np.eye(len(names))[k]
        expected = (found(here + d) - found(here - d)) / 2e-5
        np.testing.assert_allclose(slopes[:, k], expected, rtol=1e-4)
    backward = jax.grad(lambda values: found(values)[0])(here)
    np.testing.assert_allclose(backward, slopes[0], rtol=1e-9)


@slow
def test_all_that_are_found_are_distinct_and_steady(glide):
    several = jg.steady_glides(published(), starts=2)
    assert any(np.allclose(other.state, glide.state, atol=1e-6) for other in several)
    for k, one in enumerate(several):
        assert float(one.residual) < 1e-9
        for other in several[:k]:
            assert np.max(np.abs(one.state - other.state)) > 1e-5
