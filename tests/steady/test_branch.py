"""Branches of steady glides: against glides found one by one, past folds, to frozen bodies."""

import dataclasses
from functools import partial

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import jaxglide as jg
from jaxglide.flight.case import Case
from jaxglide.flight.launch import Launch
from jaxglide.steady.closure import Kind
from jaxglide.steady.glide import sought
from jaxglide.steady.pieces import Followed, Place, found_at
from jaxglide.steady.reduced import MIRROR
from jaxglide.steady.spectrum import multipliers_of

slow = pytest.mark.slow

# States near steady glides at phase 0: right, forward, up, omega, pitch, roll.
NEAR_PUBLISHED = [-1.35, 6.32, -9.57, -1.75, 1.45, 0.66, -0.802, -0.180]
NEAR_LONG = [0.09, 8.94, -3.80, 0.017, 0.932, -0.780, -0.0863, -0.0789]
NEAR_FROZEN = [0.928, 6.812, -3.401, 0.151, -0.062, -0.462, 0.126, 0.315]


def glider(theta_m=None, psi_m=20.0, nu_theta=1.4, f_theta=1.2, d_psi=10.0, d_theta=0.0):
    gait = jg.Gait.from_degrees(theta_m, psi_m, nu_theta, f_theta, d_psi, d_theta)
    snake = jg.Snake.from_svl(0.70, nodes=40, node_set="gauss")
    return jg.Glider(snake, gait, jg.Polar.smooth())


def long_glider(f_theta=1.3):
    """The gait that glides 143 m from 75 m."""
    return glider(60, 0.0, 1.738, f_theta, 5.5)


@pytest.fixture(scope="module")
def frozen():
    """Its body frozen, over some phases of the waves."""
    return jg.steady_branch(long_glider(0.0), "phi_theta", -0.1, 0.4, start=NEAR_FROZEN)


def test_multipliers_of_factors_that_are_far_apart():
    """Multiplied out, the product has lost the small ones, which span 1e79."""
    rng = np.random.default_rng(0)
    bases = rng.normal(size=(32, 8, 8))
    sizes = np.array([3, 1.2, 0.8, 0.8, 0.5, 0.3, 0.1, 0.01])
    one = np.diag(sizes)
    c, s = 0.8 * np.cos(0.3), 0.8 * np.sin(0.3)
    one[2:4, 2:4] = [[c, -s], [s, c]]
    factors = [bases[(j + 1) % 32] @ one @ np.linalg.inv(bases[j]) for j in range(32)]
    found = multipliers_of(np.array(factors))
    np.testing.assert_allclose(np.abs(found), sizes**32, rtol=1e-9)
    assert np.abs(np.angle(found[2])) == pytest.approx(2 * np.pi - (9.6 - 2 * np.pi), rel=1e-9)
    plain = np.linalg.eigvals(np.linalg.multi_dot(factors[::-1]))
    assert np.min(np.abs(plain)) > 1e20 * sizes[-1] ** 32


def test_a_branch_passes_a_fold(frozen):
    """Its number turns back there, and a multiplier passes 1."""
    assert frozen.found
    assert frozen.ends == ("reaches the end of the range", "reaches the end of the range")
    folds = np.flatnonzero(frozen.kinds == "fold")
    assert len(folds) == 1
    (fold,) = folds
    np.testing.assert_allclose(frozen.parameter[[0, -1]], -0.1, atol=1e-12)
    assert frozen.parameter.argmax() == fold
    assert np.all(np.diff(frozen.parameter[: fold + 1]) > 0)
    assert np.all(np.diff(frozen.parameter[fold:]) < 0)
    nearest = np.min(np.abs(frozen.multipliers - 1), axis=1)
    assert nearest[fold] < 1e-3
    assert nearest[fold] == nearest.min()
    pair = frozen.multipliers[list(frozen.kinds).index("pair")]
    crossing = pair[np.argsort(np.abs(np.abs(pair) - 1))[:2]]
    np.testing.assert_allclose(np.abs(crossing), 1, atol=1e-4)
    assert abs(crossing[0].imag) > 1e-3


def test_points_of_a_branch_are_steady_glides(frozen):
    """Beyond the fold too: found again one by one, with all that is said of them."""
    for k in (0, len(frozen.parameter) - 1):
        phase = float(frozen.parameter[k])
        glide = jg.steady_glide(long_glider(0.0), frozen.state[k] + 1e-3, phase=phase)
        np.testing.assert_allclose(frozen.state[k], glide.state, atol=1e-9)
        np.testing.assert_allclose(frozen.multipliers[k], glide.multipliers, rtol=1e-7)
        assert frozen.glide_angle[k] == pytest.approx(float(glide.glide_angle), abs=1e-7)
        assert frozen.turn_rate[k] == pytest.approx(float(glide.turn_rate), rel=1e-6)


def test_a_branch_says_what_it_is_and_can_be_saved(frozen, tmp_path):
    said = str(frozen)
    assert said.startswith("Branch of steady glides in phi_theta\n")
    assert "fold" in said
    assert "rad, " in said
    again = jg.open(jg.save(frozen.dataset(), tmp_path / "branch.nc"))
    np.testing.assert_array_equal(again.parameter, frozen.parameter)
    values = again.multipliers_real + 1j * again.multipliers_imag
    np.testing.assert_array_equal(values, frozen.multipliers)
    assert list(again.kind.values) == list(frozen.kinds)


def test_without_a_start_there_is_no_branch():
    far = [0, 0.1, 30.0, 20, -20, 20, 1.4, 3.0]
    none = jg.steady_branch(long_glider(0.0), "phi_theta", -0.1, 0.4, start=far)
    assert not none.found
    assert str(none) == "No branch in phi_theta: the start leads to no steady glide"
    assert none.spectral_radius.shape == (0,)


@pytest.mark.parametrize(
    ("name", "ends", "more", "message"),
    [
        ("f_thet", (0, 3), {}, "there is no parameter 'f_thet'"),
        ("height", (0, 3), {}, "launch.height does not change a steady glide"),
        ("f_theta", (2, 3), {}, r"f_theta = 1.3 Hz of the glider must be in the range"),
        ("f_theta", (3, 1), {}, r"f_theta = 1.3 Hz of the glider must be in the range"),
        ("f_theta", (0, 90), {}, r"high of f_theta = 90 Hz is not allowed"),
        ("f_theta", (0, 3), {"points": 0}, "points = 0 is not allowed"),
        ("f_theta", (0, 3), {"arc": 2}, "arc = 2 is not allowed"),
        ("f_theta", (0, 3), {"start": [1.0]}, r"start has shape \(1,\)"),
    ],
)
def test_bad_input_is_named(name, ends, more, message):
    with pytest.raises(ValueError, match=message):
        jg.steady_branch(long_glider(), name, *ends, **more)


def test_a_frozen_body_has_no_waves_to_slow_down():
    with pytest.raises(ValueError, match="a frozen body has no waves"):
        jg.steady_branch(long_glider(0.0), "f_theta", 0, 3)


def followed_of(glider, name, kind, pieces, span=1.0):
    posed = sought(glider, 0.3, 1 / 300)
    case = Case(posed.glider, Launch(phi_theta=0.3))
    path = case.path(name)
    return Followed.of(case, path, span, posed.scales(), kind, pieces), case.value(path) / span


@slow
@pytest.mark.parametrize("name", ["f_theta", "d_psi"])
def test_the_derivative_by_the_number_against_differences(name):
    followed, p = followed_of(glider(), name, Kind(False, True), 8, 2.0)
    u = jnp.asarray(NEAR_PUBLISHED) / followed.unit * jnp.ones((8, 1))
    steps = jnp.asarray(16.0)

    def missed(p):
        return found_at(Place(u, jnp.asarray(p)), followed, steps)

    expected = (missed(p + 1e-5).missed - missed(p - 1e-5).missed) / 2e-5
    np.testing.assert_allclose(missed(p).by_p, expected, atol=1e-7 * np.abs(expected).max())


@slow
@pytest.mark.parametrize("whole", [False, True])
def test_a_branch_against_glides_found_one_by_one(whole):
    """In pieces and in one shot, over half a cycle and a whole one: the same."""
    start = jg.steady_glide(glider(), NEAR_PUBLISHED)
    branch = jg.steady_branch(glider(), "d_psi", 8, 12, start=start, whole=whole, arc=0.2)
    assert branch.mirrored is not whole
    for k in (0, len(branch.parameter) - 1):
        other = glider(d_psi=branch.parameter[k])
        glide = jg.steady_glide(other, branch.state[k])
        np.testing.assert_allclose(branch.state[k], glide.state, atol=2e-4)
        sizes = np.abs(branch.multipliers[k]), np.abs(glide.multipliers)
        np.testing.assert_allclose(*sizes, rtol=2e-3, atol=2e-5)
        for name in ("glide_angle", "speed", "sink_rate", "forward_speed", "period"):
            assert getattr(branch, name)[k] == pytest.approx(
                float(getattr(glide, name)), rel=1e-4
            )


@slow
def test_helices_on_both_sides_of_a_straight_glide():
    """The lateral bias brings the gait that glides far into a turn, from the straight glide."""
    start = jg.steady_glide(long_glider(), NEAR_LONG)
    branch = jg.steady_branch(long_glider(), "d_theta", -2, 2, start=start)
    assert not branch.mirrored
    at = list(branch.kinds).index("start")
    assert abs(branch.turn_rate[at]) < 1e-9
    left, right = branch.parameter.argmax(), branch.parameter.argmin()
    assert branch.turn_rate[left] == pytest.approx(-branch.turn_rate[right], rel=1e-4)
    assert abs(branch.turn_rate[left]) > 1e-2
    # not the glide angle: starts of cycles lie on a wider helix in one phase than in another
    assert branch.sink_rate[left] == pytest.approx(branch.sink_rate[right], rel=1e-5)
    tilted = dataclasses.replace(long_glider(), gait=glider(60, 0, 1.738, 1.3, 5.5, 2).gait)
    glide = jg.steady_glide(tilted, branch.state[left])
    assert float(glide.turn_rate) == pytest.approx(branch.turn_rate[left], rel=1e-3)


@slow
def test_slow_waves_lead_along_frozen_glides():
    """Phase by phase, the difference falls nearly in proportion to the frequency.

    The gait is one whose frozen glides go on through all phases without a fold.
    """
    diving = partial(glider, 1, 0.0, 1.738, d_psi=-20)
    near = [-0.01, 0.65, -5.14, 0.0, -0.005, 0.027, -0.175, -0.016]
    still = jg.steady_branch(diving(f_theta=0), "phi_theta", 0, np.pi, start=near, arc=0.02)
    assert still.parameter[-1] == pytest.approx(np.pi)
    np.testing.assert_allclose(still.state[-1], MIRROR * still.state[0], atol=1e-9)
    # in flight the phase falls: from 0 it is that of the other half, mirrored
    phases = np.pi * (1 - np.arange(16) / 16)
    frozen = np.array(CubicSpline(still.parameter, still.state)(phases)) * MIRROR
    branch = jg.steady_branch(diving(f_theta=0.04), "f_theta", 0.02, 0.08, start=frozen)
    assert branch.found
    assert branch.spectral_radius[0] > 1e40  # one shot over the cycle would be hopeless
    at = [0, list(branch.kinds).index("start"), -1]
    np.testing.assert_allclose(branch.parameter[at], [0.02, 0.04, 0.08], rtol=1e-12)
    apart = branch.states[at] - frozen
    angles = np.rad2deg(np.abs(apart[..., 6:]).max(axis=(1, 2)))
    np.testing.assert_allclose(angles, [0.69, 1.29, 2.42], atol=0.01)  # as the findings say
    moving = np.abs(apart[..., :3]).max(axis=(1, 2))
    for differences in (angles, moving):
        ratios = differences[1:] / differences[:-1]
        assert np.all((ratios > 1.5) & (ratios < 2.1))  # 2 where it is in proportion
