"""The NumPy peer of the benchmarks against the published model's figures, and itself."""

import json
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from places import GOLDEN, ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

import numpy_peer as peer


def golden(name):
    return json.loads((GOLDEN / f"{name}.json").read_text())


RHS, KINEMATICS, GLIDES = golden("rhs"), golden("kinematics"), golden("glides")


def model_of(entry):
    angles = {name: np.radians(entry[f"{name}_deg"]) for name in ("theta_m", "psi_m", "d_psi")}
    names = (
        "nu_theta",
        "f_theta",
        "svl",
        "mass",
        "n_nodes",
        "neck_fraction",
        "lift_scale",
        "drag_scale",
    )
    return peer.prepare(
        peer.Settings(**angles, **{name: entry[name] for name in names if name in entry})
    )


def relative_error(value, expected):
    return np.linalg.norm(np.subtract(value, expected)) / np.linalg.norm(expected)


@pytest.mark.parametrize("entry", RHS, ids=lambda entry: f"nu={entry['nu_theta']}")
def test_vector_field_matches_the_published_model(entry):
    model = model_of(entry)
    for case in entry["cases"]:
        y = np.concatenate(
            [np.zeros(3), case["velocity_I"], case["omega_B"], case["yaw_pitch_roll"]]
        )
        dy = peer.vector_field(case["t"], y, model, entry["phi_theta"])
        assert np.array_equal(dy[:3], case["velocity_I"])
        assert relative_error(dy[3:6], case["acceleration_I"]) < 5e-5
        assert relative_error(dy[6:9], case["omega_dot_B"]) < 5e-5
        assert relative_error(dy[9:], case["angle_rates"]) < 5e-5


@pytest.mark.parametrize("entry", KINEMATICS, ids=lambda entry: f"nu={entry['nu_theta']}")
def test_kinematics_match_the_published_model(entry):
    model = model_of(entry)
    tangent, chord, *_ = peer.tangents(
        model, entry["phi_theta"] - model.omega * entry["t"], -model.omega
    )
    nodes = entry["nodes"]
    position, velocity, acceleration = (tangent @ model.integral)[:, :, nodes].transpose(
        0, 2, 1
    )
    assert np.abs(position - entry["position"]).max() < 2e-9
    assert np.abs(velocity - entry["velocity"]).max() < 2e-9
    assert relative_error(acceleration, entry["acceleration"]) < 5e-5
    assert np.abs(tangent[0][:, nodes].T - entry["tangent"]).max() < 2e-9
    assert (
        np.abs(
            np.column_stack([chord.real, chord.imag])[nodes] - np.array(entry["chord"])[:, :2]
        ).max()
        < 2e-9
    )


@pytest.mark.parametrize(
    "entry", GLIDES, ids=lambda entry: f"nu={entry['nu_theta']},f={entry['f_theta']}"
)
def test_launch_and_glide_match_the_published_model(entry):
    model = model_of(entry)
    phase, angles = peer.launch(model)
    assert phase == pytest.approx(entry["phi_theta"], abs=1e-5)
    assert np.abs(np.degrees(angles) - entry["launch_angles_deg"]).max() < 1e-4
    assert model.launch_speed == pytest.approx(entry["launch_speed"], rel=1e-8)

    glide = peer.simulate(
        model, entry["height"], rtol=1e-8, atol=1e-8, start=(phase, angles), dense_output=True
    )
    end = glide["t"][-1]
    t = np.array(entry["t"])
    flying = t <= end
    y = glide["sol"](t[flying])
    assert 1e3 * np.abs(y[:3].T - np.array(entry["position"])[flying]).max() < 0.5  # mm
    assert (
        np.abs(np.degrees(y[9:12]).T - np.array(entry["yaw_pitch_roll_deg"])[flying]).max()
        < 0.05
    )
    # The reference stops at the first 10 ms sample past the end.
    assert entry["last_t"] - 0.0101 < end <= entry["last_t"]
    yaw = entry["last_angles_deg"][0]
    assert glide["outcome"] == ("unstable: yaw" if abs(yaw) > 85 else "landed")
    nearest_limit = min(
        glide["y"][2, -1], peer.ANGLE_LIMIT - np.abs(glide["y"][9:12, -1]).max()
    )
    assert abs(nearest_limit) < 1e-9


def test_launch_attitude_is_that_of_the_equations_of_motion_without_air_and_gravity():
    model = peer.prepare(peer.Settings(d_psi=0.3, d_theta=0.2, gravity=0.0, air_density=1e-300))
    phase, angles = peer.launch(model)
    period = 1 / model.settings.f_theta
    solution = solve_ivp(
        peer.vector_field,
        (0, period),
        np.zeros(12),
        method="DOP853",
        rtol=1e-10,
        atol=1e-11,
        args=(model, phase),
        t_eval=np.arange(200) * period / 200,
    )
    assert np.abs(angles + solution.y[9:].mean(axis=1)).max() < 1e-8


def coefficients(polar, beta, reynolds):
    """C_D + i C_L at beta in degrees."""
    table = peer.prepare(peer.Settings(polar=polar)).table
    beta, reynolds = np.broadcast_arrays(beta, reynolds)
    return peer.coefficients(table, np.array([beta / 5 + 36, (reynolds - 3000) / 2000.0]))


@pytest.mark.parametrize("polar", ["published", "smooth"])
def test_polar_passes_through_the_measurements_and_folds(polar):
    reynolds = np.arange(3000, 15001, 2000)
    for row, alpha in enumerate(range(-10, 61, 5)):
        measured = peer.DRAG[row] + 1j * peer.LIFT[row]
        assert np.allclose(coefficients(polar, alpha, reynolds), measured, rtol=0, atol=1e-13)
    beta = np.linspace(-89, 89, 357)
    folded = np.where(beta >= 0, 180 - beta, -180 - beta)
    direct = coefficients(polar, beta, 6200.0)
    assert np.allclose(coefficients(polar, folded, 6200.0), direct.conj(), rtol=0, atol=1e-10)
    assert np.allclose(
        coefficients(polar, beta, 2e4), coefficients(polar, beta, 15000.0), rtol=0, atol=1e-13
    )


def test_smooth_polar_has_no_jump_in_slope():
    beta = np.arange(-175.0, 176.0, 5.0)
    step = 1e-4
    below, at, above = (coefficients("smooth", beta + d, 7300.0) for d in (-step, 0.0, step))
    assert np.abs(above - 2 * at + below).max() / step < 1e-4  # change of slope per degree
    jump = coefficients("published", np.array([-90.0 - step, -90.0 + step]), 7300.0)
    assert abs(np.diff(jump.imag)[0]) > 0.5


def test_a_model_that_cannot_be_described_is_refused():
    with pytest.raises(ValueError, match="below 90 degrees"):
        peer.prepare(peer.Settings(psi_m=1.4, d_psi=0.3))
    with pytest.raises(ValueError, match="unknown polar"):
        peer.prepare(peer.Settings(polar="measured"))
