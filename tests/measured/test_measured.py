"""Every stage from markers to gait against closed forms, and what bad recordings say."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jaxglide import measured
from jaxglide.cli import main
from jaxglide.measured import backbone, bending, gaps, modes, smoothing
from made_recordings import PLACES, RATE, TIME, cut, swimming, write_study, write_tabular


def parabola(count=4):
    """Markers in free fall, exact for a filter of constant acceleration, (240, count, 3)."""
    start = np.arange(3 * count).reshape(count, 3) / 10 + [0, -4.0, 8.0]
    pull = np.array([1.0, 1.0, -4.9])
    return start + TIME[:, None, None] * [0.1, 0.5, 0.8] + pull / 2 * TIME[:, None, None] ** 2


# ---- gaps


def test_gaps_of_a_parabola_are_filled_and_nothing_else_is_touched():
    whole = parabola()
    seen = whole.copy()
    seen[50:70, 1] = np.nan
    seen[100:140, 2] = np.nan
    filled = gaps.fill_gaps(seen, RATE)
    kept = np.isfinite(seen)
    assert (filled[kept] == seen[kept]).all()
    assert np.abs(filled - whole)[:, 1].max() < 1e-3
    assert np.abs(filled - whole)[:, 2].max() < 4e-3
    states = gaps.smooth_states(whole, RATE)
    assert np.abs(states[20:-20, :, 1, 2] - (0.8 - 4.9 * TIME[20:-20, None])).max() < 0.02
    assert np.abs(states[20:-20, :, 2, 2] + 4.9).max() < 0.5


def test_the_smoother_is_the_most_likely_path():
    """Against weighted least squares over the start and the shocks of every step, which is
    what a smoother solves; a state is linear in them."""
    frames, step = 25, 1 / RATE
    rng = np.random.default_rng(0)
    seen = parabola(1)[:frames] + 0.003 * rng.normal(size=(frames, 1, 3))
    seen[8:14] = np.nan
    F = np.array([[1, step, step**2 / 2], [0, 1, step], [0, 0, 1]])
    G = np.array([step**2 / 2, step, 1])
    states = np.zeros((frames, 3, 3 + frames - 1))  # of the start and the shocks
    states[0, :, :3] = np.eye(3)
    for k in range(1, frames):
        states[k] = F @ states[k - 1]
        states[k, :, 2 + k] += G
    whole = np.isfinite(seen).all(axis=(1, 2))
    start = np.stack([seen[0, 0], gaps.START_VELOCITY, gaps.START_ACCELERATION])
    A = np.vstack([np.eye(3 + frames - 1), states[whole, 0]])
    b = np.vstack([start, np.zeros((frames - 1, 3)), seen[whole, 0]])
    deviations = [gaps.PROCESS_NOISE] * (frames - 1), [gaps.MEASUREMENT_NOISE] * whole.sum()
    weights = 1 / np.concatenate([gaps.START_DEVIATION, *deviations])[:, None]
    best = states @ np.linalg.lstsq(weights * A, weights * b)[0]
    assert np.abs(gaps.smooth_states(seen, RATE)[:, 0] - best).max(axis=(0, 2)) == (
        pytest.approx(0, abs=1e-8)
    )


# ---- smoothing


def test_the_filter_passes_a_line_and_halves_power_at_its_cutoff():
    line = np.column_stack([2 + 3 * TIME, 1 - TIME])
    assert np.abs(smoothing.low_pass(line, 5.0, RATE) - line).max() < 1e-9
    time = np.arange(4000) / RATE
    wave = np.sin(2 * np.pi * 10 * time)
    passed = smoothing.low_pass(wave, 10.0, RATE)[500:-500]
    # forward and backward: the power is halved twice
    assert np.ptp(passed) / 2 == pytest.approx(0.5, rel=2e-3)
    assert np.corrcoef(passed, wave[500:-500])[0, 1] > 0.9999  # no lag


def test_residual_analysis_finds_noise_and_signal():
    rng = np.random.default_rng(1)
    time = np.arange(2000) / RATE
    signal = np.column_stack([np.sin(2 * np.pi * 1.2 * time), np.cos(2 * np.pi * 2 * time)])
    noisy = signal + 0.01 * rng.normal(size=signal.shape)
    smoothed, cutoffs = smoothing.smooth(noisy, RATE)
    level = smoothing.noise_level(smoothing.residuals(noisy, RATE))
    assert level == pytest.approx(0.01, rel=0.1)
    assert ((cutoffs > 3) & (cutoffs < 12)).all()
    assert np.sqrt(np.mean((smoothed - signal) ** 2)) < 0.005
    crossing = [
        np.sqrt(np.mean((noisy - smoothing.low_pass(noisy, c, RATE)) ** 2, axis=0))[i]
        for i, c in enumerate(cutoffs)
    ]
    assert crossing == pytest.approx(level, rel=0.01)


def test_residuals_that_never_straighten_are_still_cut_off():
    smoothed, cutoffs = smoothing.smooth(np.column_stack([0 * TIME, TIME]), RATE)
    assert np.isfinite(cutoffs).all()
    assert np.abs(smoothed - np.column_stack([0 * TIME, TIME])).max() < 1e-9


# ---- backbone


def circle(places, radius=0.2, frames=40):
    """A body bent to a horizontal circle about (0.2, 0) behind its head, gliding forward."""
    angle = places / radius
    ring = radius * np.column_stack([1 - np.cos(angle), -np.sin(angle), 0 * angle])
    return ring + np.outer(np.arange(frames) / RATE, [0.0, 3.0, 0.0])[:, None]


def test_the_neck_lies_behind_the_head_in_its_direction_of_motion():
    time, markers = TIME[:30], np.zeros((30, 3, 3))
    markers[:, 0, :2] = np.column_stack([3 * time, 4 * time - 20 * time**2])
    markers[:, 1] = markers[:, 0] + [0.03, -0.04, 0.5]
    velocity = np.column_stack([0 * time + 3, 4 - 40 * time])
    behind = -0.025 * velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    point = backbone.neck_point(markers, RATE) - markers[:, 0]
    assert np.abs(point - np.column_stack([behind, 0 * time + 0.25])).max() < 1e-12


def test_the_backbone_of_a_circle():
    places = np.linspace(0, 0.6, 13)
    curve = backbone.fit_backbone(circle(places), np.diff(places), RATE)
    assert curve.position.shape == curve.tangent.shape == (40, backbone.SAMPLES, 3)
    assert (curve.arc[0], curve.arc[-1]) == (0, pytest.approx(0.6, rel=1e-12))
    assert np.abs(np.linalg.norm(curve.tangent, axis=-1) - 1).max() < 1e-12
    length = np.linalg.norm(np.diff(curve.position[0], axis=0), axis=1)
    assert length[40:].sum() == pytest.approx(curve.arc[-1] - curve.arc[40], rel=2e-3)
    inner = slice(30, -30)  # the ends of a natural spline are straight
    off = np.linalg.norm(curve.position[0, inner, :2] - [0.2, 0], axis=1) - 0.2
    assert np.abs(off).max() < 1e-3
    angle = curve.arc[inner] / 0.2
    along = np.column_stack([np.sin(angle), -np.cos(angle), 0 * angle])
    assert np.abs(curve.tangent[0, inner] - along).max() < 0.02
    bend = np.linalg.norm(np.diff(curve.tangent[0], axis=0), axis=1) / np.diff(curve.arc)
    assert bend[-1] < 0.1 / 0.2 < 0.9 / 0.2 < bend[100]


def test_samples_are_shared_in_proportion_to_length():
    arc = backbone.stations(np.array([0, 0.1, 0.2, 0.5, 1.0]))
    assert len(arc) == backbone.SAMPLES
    assert [np.sum((arc >= a) & (arc < b)) for a, b in ((0, 0.1), (0.2, 0.5))] == [20, 60]
    assert (np.diff(arc) > 0).all()


def test_the_centre_of_mass_is_weighted_by_density():
    places = np.linspace(0, 1, 11)
    markers = np.zeros((30, 11, 3))
    markers[..., 1] = -places + TIME[:30, None]  # straight, flying forward
    curve = backbone.fit_backbone(markers, np.diff(places), RATE)
    even = backbone.centre_of_mass(curve, np.array([[0, 1.0], [1, 1.0]]), 1.0)
    back = backbone.centre_of_mass(curve, np.array([[0, 0.0], [1, 1.0]]), 1.0)
    assert np.abs(even[:, 1] - (TIME[:30] - 1 / 2)).max() < 0.01
    assert np.abs(back[:, 1] - (TIME[:30] - 2 / 3)).max() < 0.01


# ---- bending


def test_bending_angles_of_a_body_given_by_them():
    """Tangents of known angles, under a yaw and a pitch that must be taken away."""
    arc = np.linspace(0, 1.2, backbone.SAMPLES)
    theta = 1.5 * np.sin(2 * np.pi * 1.4 * arc - TIME[:, None]) + 3.0  # wraps past pi
    psi = 0.3 * np.cos(4 * np.pi * 1.4 * arc) + 0.2 * arc - 0.1
    psi = np.broadcast_to(psi, theta.shape)
    tangent = np.stack(
        [np.cos(psi) * np.sin(theta), -np.cos(psi) * np.cos(theta), np.sin(psi)], axis=-1
    )
    knots = np.array([0, 0.025, 0.05, 0.4, 1.0, 1.2])  # head, neck point, 1, 2, vent, tail
    curve = backbone.MeasuredBackbone(arc, tangent, tangent, knots)
    frames = TIME > 0.4
    found = bending.bending_angles(curve, TIME, frames, vent=3, svl=0.8)
    along = (arc >= 0.05) & (arc <= 1.0)
    assert found.fraction == pytest.approx(arc[along] / 0.8)
    expected = theta[frames][:, along]
    expected = expected - expected.mean(axis=1, keepdims=True)
    assert np.abs(found.theta - expected).max() < 1e-12
    line = np.polynomial.Polynomial.fit(arc[along] / 0.8, psi[0, along], 1)
    assert found.slope == pytest.approx(line.convert().coef[1], rel=1e-9)
    assert np.abs(found.psi - (psi[0, along] - line(arc[along] / 0.8))).max() < 1e-12


# ---- modes


def whole_periods(frames=400, stations=120):
    """Times over two periods of 1 Hz and stations over the body, ends left out."""
    return np.arange(frames) / frames * 2, np.arange(stations) / stations


def test_a_travelling_wave_is_one_mode():
    times, fraction = whole_periods()
    wave = 0.7 * np.cos(2 * np.pi * (times[:, None] - 2 * fraction) + 0.4)
    found = modes.decompose(wave, times, fraction)
    assert found.kept == 1
    assert found.variance[0] == pytest.approx(1, abs=1e-12)
    assert found.wave_number[0] == pytest.approx(2, rel=1e-9)
    assert found.frequency[0] == pytest.approx(1, rel=1e-9)
    assert found.amplitude == pytest.approx(0.7, rel=2e-3)  # between two stations
    assert np.abs(np.linalg.norm(found.shapes, axis=1) - 1).max() < 1e-12
    # every component is as large as the largest; the one chosen is real and positive
    assert np.abs(found.shapes[0] - np.abs(found.shapes[0]).max()).min() < 1e-12
    again = (found.shapes.T @ found.activity).real.T
    assert np.abs(again - wave).max() < 1e-9


def test_modes_come_by_their_variance():
    times, fraction = whole_periods()
    strong = 0.8 * np.cos(2 * np.pi * (times[:, None] - 1 * fraction))
    weak = 0.4 * np.sin(2 * np.pi * (3 * times[:, None] - 2 * fraction))
    found = modes.decompose(strong + weak, times, fraction)
    assert found.variance[:3] == pytest.approx([0.8, 0.2, 0], abs=1e-9)
    assert found.frequency[:2] == pytest.approx([1, 3], rel=1e-6)
    assert found.wave_number[:2] == pytest.approx([1, 2], rel=1e-6)
    assert found.kept == 2
    assert modes.half_range(strong) == pytest.approx(0.8, rel=2e-3)


# ---- whole flights of made-up recordings


@pytest.fixture
def recorded():
    markers = swimming()
    markers[60:66, 3] = np.nan
    return markers


def test_both_forms_of_a_recording_give_the_same_flight(tmp_path, recorded):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    write_tabular(tmp_path / "a", recorded)
    write_study(tmp_path / "b", recorded)
    one, other = (measured.measure_folder(tmp_path / name)[0] for name in "ab")
    assert (one.trial, one.snake, other.trial, other.snake) == ("one", "A", "101", "7")
    assert one.missing == other.missing == 6
    assert [one.longest_gap, other.longest_gap] == pytest.approx([6 / 179] * 2, rel=1e-4)
    for name in ("nu_theta", "f_theta", "theta_m", "psi_m", "d_psi", "nu_psi", "f_psi"):
        assert getattr(one, name) == pytest.approx(getattr(other, name), rel=1e-3), name
    assert np.abs(one.position - other.position).max() < 1e-5
    assert one.nu_theta == pytest.approx(1.3, rel=0.04)
    assert one.f_theta == pytest.approx(1.2, rel=0.04)
    assert one.theta_range == pytest.approx(1.5, rel=0.08)
    assert one.psi_range == pytest.approx(0.3, rel=0.15)


def test_frames_before_all_markers_are_seen_are_left_out(tmp_path, recorded):
    recorded[:4, 2] = np.nan
    recorded[-9:, 5] = np.nan
    flight = measured.measure(measured.read_tabular(write_tabular(tmp_path, recorded)))
    assert len(flight.times) == len(TIME) - 13
    assert flight.missing == 6


def test_the_dataset_is_labelled(tmp_path, recorded):
    flights = [
        measured.measure(measured.read_tabular(write_tabular(tmp_path, markers)))
        for markers in (recorded, recorded[:230])
    ]
    data = measured.flights_dataset(flights)
    assert set(data.trial.values) == {"one"}
    assert data.theta_m.values[0] == np.rad2deg(flights[0].theta_m)
    assert np.isnan(data.position.values[1, 230:]).all()
    assert np.isfinite(data.position.values[0]).all()
    shape = data["shape"].isel(trial=0).sel(wave="vertical", mode=1).dropna("station")
    shape = shape.sel(part="real") + 1j * shape.sel(part="imaginary")
    assert shape.values == pytest.approx(flights[0].vertical.shapes[0])
    for variable in data.data_vars.values():
        assert set(variable.attrs) == {"units", "long_name"}


# ---- bad recordings


BAD_TABLES = {
    "a column is missing": (lambda t: cut(t, "m04_y", "other"), r"one\.csv: column 'm04_y'"),
    "no time": (lambda t: cut(t, "time_s", "t"), r"one\.csv: column 'time_s' is missing"),
    "a word": (lambda t: cut(t, "0.005587,", "0.005587,abc"), r"one\.csv: 'abc.*'m01_x'"),
    "a short row": (lambda t: t + "1.34,1.0\n", r"one\.csv, line 242: not as many columns"),
    "uneven steps": (lambda t: cut(t, "0.050279,", "0.052279,"), r"one\.csv: column 'time_s'"),
    "nothing": (lambda t: t.splitlines()[0] + "\n", r"one\.csv: no rows"),
    "a marker less": (
        lambda t: cut(t, "m11_", "marker11_"),
        r"one\.csv: 10 markers, where .*one\.toml \('tape'\) has 11",
    ),
}


@pytest.mark.parametrize("case", BAD_TABLES)
def test_a_bad_table_is_named(tmp_path, recorded, case):
    change, message = BAD_TABLES[case]
    source = write_tabular(tmp_path, recorded)
    text = source.read_text()
    if case == "a marker less":
        text = cut(text, "m11_x", "other_1")
    source.write_text(change(text))
    with pytest.raises(measured.RecordingError, match=message):
        measured.read_tabular(source)


BAD_BODIES = {
    "mass = ": ({"mass": ""}, "'mass' is missing"),
    "mass = -1": ({"mass": "-1"}, "mass is -1.0, not a positive number"),
    "tape of text": ({"tape": '["a"]'}, r"tape\[0\] = 'a' is not a number"),
    "tape in cm": ({"tape": str((100 * np.diff(PLACES)).tolist())}, "'tape' adds up to 96.8"),
    "svl in dm": ({"svl": "6.2"}, "'tape' adds up to 0.0968"),
    "vent past the end": ({"vent": "12"}, "no marker after the head is at the vent"),
    "density falls": ({"density": "[[0, 1], [0, 1]]"}, "the density's arc length must rise"),
    "unknown": ({"colour": "1"}, "no entry 'colour': known are snake, mass"),
    "no TOML": ({"mass": "= 1"}, "Invalid value"),
}


@pytest.mark.parametrize("case", BAD_BODIES)
def test_a_bad_body_is_named(tmp_path, recorded, case):
    changes, message = BAD_BODIES[case]
    with pytest.raises(measured.RecordingError, match=rf"one\.toml: .*{message}"):
        measured.read_tabular(write_tabular(tmp_path, recorded, **changes))


def test_markers_that_cannot_be_are_named(tmp_path, recorded):
    def read(markers):
        return measured.read_tabular(write_tabular(tmp_path, markers))

    for factor, ratio in ((10, "9.*"), (0.1, r"0\.09.*")):
        told = rf"one\.csv: columns 'm01_x' to 'm11_z' .* {ratio} times .*one\.toml .*unit"
        with pytest.raises(measured.RecordingError, match=told):
            read(factor * recorded)
    never = recorded.copy()
    never[:, 6] = np.nan
    with pytest.raises(measured.RecordingError, match=r"one\.csv: column 'm07_x' has no value"):
        read(never)
    never = recorded.copy()
    never[::2, 6], never[1::2, 7] = np.nan, np.nan
    with pytest.raises(measured.RecordingError, match=r"one\.csv: 30 frames .* 0 such frames"):
        measured.measure(read(never))
    high = recorded + np.array([0, 0, 20])
    with pytest.raises(measured.RecordingError, match=r"one\.csv: .* below 7\.25 m"):
        measured.measure(read(high))


BAD_STUDIES = {
    "column": ("mocap/101_7.tsv", "04 Y", "99", r"101_7\.tsv: column '04 Y' is missing"),
    "frequency": ("mocap/101_7.tsv", "FREQUENCY", "F", r"101_7\.tsv: no number FREQUENCY"),
    "rate": ("mocap/101_7.tsv", "\t179\r", "\t1790\r", r"101_7\.tsv: column 'Time' is not in"),
    "mass": ("snake_master.csv", "50.0", "5.00", r"snake_master\.csv: 5 .* 'Mass \(g\)'"),
    "svl": ("snake_master.csv", "620", "62", r"snake_master\.csv: 50 .* 62 in 'SVL \(mm\)'"),
    "trial": ("snake_master.csv", "101", "102", r"snake_master\.csv: no row with 7 .* 101"),
    "tape": ("markers/Marker-summary_100_7.csv", "Dist", "D", r"100_7\.csv: column 'Dist to"),
    "vent": ("markers/Marker-summary_100_7.csv", "vent", "body", r"100_7\.csv: no 'vent'"),
    "length": ("markers/Marker-summary_100_7.csv", ",620", ",62", r"100_7\.csv: 'Dist .*unit"),
    "density": ("snake_density.csv", "density (", "(", r"snake_density\.csv: column 'density"),
    "arc": ("snake_density.csv", "2,2.0", "2,0.9", r"snake_density\.csv: the density's arc"),
}


@pytest.mark.parametrize("case", BAD_STUDIES)
def test_a_bad_study_folder_is_named(tmp_path, recorded, case):
    name, old, new, message = BAD_STUDIES[case]
    path = write_study(tmp_path, recorded) / name
    path.write_text(cut(path.read_bytes().decode(), old, new), newline="")
    with pytest.raises(measured.RecordingError, match=message):
        measured.read_study(tmp_path, "101")


def test_a_marker_too_few_or_too_many_is_named(tmp_path, recorded):
    path = write_study(tmp_path, recorded) / "markers" / "Marker-summary_100_7.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:4] + lines[5:]) + "\n")
    told = r"101_7\.tsv: 11 markers, where .*100_7\.csv \('Dist to next, mm'\) has 10"
    with pytest.raises(measured.RecordingError, match=told):
        measured.read_study(tmp_path, "101")


# ---- the command, and what importing loads


def test_the_command(tmp_path, recorded, capsys):
    write_tabular(tmp_path, recorded)
    figures = tmp_path / "figures"
    save = tmp_path / "gaits.nc"
    code = main(["measure", str(tmp_path), "--save", str(save), "--plots", str(figures)])
    printed = capsys.readouterr().out
    assert code == 0
    assert {path.name for path in figures.iterdir()} == {"one.png", "gaits.png"}
    headings, units, row = (line for line in printed.splitlines() if "  " in line)
    assert "theta_m" in headings
    assert "Hz" in units
    assert row.split()[:3] == ["one", "A", "50.0"]
    assert save.stat().st_size > 1000
    assert main(["measure", str(tmp_path), "--trial", "one", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)["flights"][0]
    assert record["nu_theta"] == pytest.approx(1.3, rel=0.04)
    assert record["start_velocity"][1] == pytest.approx(2, abs=0.1)


def test_the_command_says_what_is_wrong(tmp_path, recorded, capsys):
    assert main(["measure", str(tmp_path / "nowhere")]) == 2
    assert main(["measure", str(tmp_path)]) == 2
    write_tabular(tmp_path, recorded)
    assert main(["measure", str(tmp_path), "--trial", "two"]) == 2
    told = capsys.readouterr().err.splitlines()
    assert "is not a folder" in told[0]
    assert "no recording there" in told[1]
    assert "no recording 'two'" in told[2]


def test_importing_it_loads_no_model():
    code = """
import sys
import jaxglide.measured
loaded = {name for name in sys.modules if name.split(".")[0] in ("jax", "matplotlib")}
assert not loaded, sorted(loaded)[:5]
ours = {name for name in sys.modules if name.startswith("jaxglide.")}
assert {name.split(".")[1] for name in ours} == {"measured", "_lib"}, ours
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    model = Path(measured.__file__).parents[1] / "flight" / "glide.py"
    assert "measured" not in model.read_text()
