"""Force multipliers fitted to measured flights: known ones are found again."""

import numpy as np
import pytest
import xarray as xr

import jaxglide
from jaxglide.flights import fitter as fits
from jaxglide.flights.fitter import SCALES, Fitter, fitted_dataset
from jaxglide.flights.flights import fly_flights
from made_flights import dataset

pytestmark = pytest.mark.slow  # compiles for minutes

TRUE = {"lift_scale": 1.3, "drag_scale": 0.8}
NOISE = 0.01  # m
DURATION = 0.9  # s


@pytest.fixture(scope="module")
def made(golden):
    """Six flights of three animals with known multipliers, their paths with noise."""
    entries = golden("simulated_flights")
    few = [e for e in entries if not e["simulated"]["stopped_by_angle"]][:6]
    data = dataset(few)
    flown = fly_flights(data, polar="smooth", node_set="gauss", **TRUE, tolerance=1e-7)
    kept = flown.time_simulated.values <= DURATION
    paths = flown.path.values[:, kept]
    assert np.isfinite(paths).all()
    rng = np.random.default_rng(0)
    paths[:, 1:] += NOISE * rng.normal(size=paths[:, 1:].shape)
    times = np.broadcast_to(flown.time_simulated.values[kept], paths.shape[:2])
    data = data.drop_vars(["time", "position"]).assign(
        time=(("trial", "frame"), times), position=(("trial", "frame", "axis"), paths)
    )
    return data.assign_coords(snake=("trial", ["A", "A", "B", "B", "C", "C"]))


@pytest.fixture(scope="module")
def fitter(made):
    return Fitter(made)


@pytest.fixture(scope="module")
def fit(fitter):
    return fitter.fit(starts=3)


def test_known_multipliers_are_found_again_within_their_uncertainty(fit):
    for k, (name, true) in enumerate(TRUE.items()):
        error = np.log(fit.scales[name] / true)
        assert abs(error) < 3 * fit.relative_errors[k], name
        assert abs(error) < 0.02
        assert 1e-4 < fit.relative_errors[k] < 0.02


def test_all_starts_end_at_the_same_answer(fit):
    assert fit.converged.all()
    assert np.ptp(fit.starts, axis=0).min() > 0.1
    np.testing.assert_allclose(fit.ends, np.broadcast_to(fit.ends[0], (3, 2)), rtol=2e-3)
    assert np.ptp(fit.misfits) < 1e-4 * fit.misfits.min()


def test_what_is_left_is_the_noise(fit):
    """Three coordinates with the noise each; without the fit far more.

    Between two samples noise is less: on average a^2 + (1 - a)^2 is 2/3.
    """
    assert fit.misfit == pytest.approx(np.sqrt(3 * 2 / 3) * NOISE, rel=0.1)
    assert fit.misfit_before > 5 * fit.misfit
    assert (fit.errors < fit.errors_before).all()


def test_the_uncertainty_is_that_of_repeated_measurements(fitter, fit):
    """Against the least-squares formula with independent noise of known size."""
    y = fitter.start(tuple(fit.scales.values()))
    apart, slopes = fitter.sensitivities(y)
    flat = slopes.reshape(-1, 2)
    expected = np.linalg.inv(flat.T @ flat) * np.mean(apart**2)
    # few flights: the spread of their gradients is only roughly known
    ratio = np.diag(fit.covariance) / np.diag(expected)
    assert (ratio > 0.1).all()
    assert (ratio < 10).all()
    step = 1e-2  # the simulations' tolerance over it is what the difference is good for
    for k in range(2):
        shift = step * np.eye(2)[k]
        ahead, _ = fitter.sensitivities((y[0] + shift, y[1]))
        behind, _ = fitter.sensitivities((y[0] - shift, y[1]))
        difference = (ahead - behind) / (2 * step)
        scale = np.abs(slopes[..., k]).max()
        np.testing.assert_allclose(slopes[..., k], difference, atol=5e-3 * scale)


@pytest.fixture
def weighed(fitter, monkeypatch):
    """Weights of the flights in every fit that a test makes."""
    weights, solve = [], fitter.solve

    def watched(start, given=None, **how):
        weights.append(np.asarray(given, float))
        return solve(start, given, **how)

    monkeypatch.setattr(fitter, "solve", watched)
    return weights


def test_the_flights_of_one_fit_are_shared_out_over_the_cores(fitter, monkeypatch):
    """Fewer fits than cores: the flights of each run side by side, to the bit the same."""
    used, shared = [], fits.on_workers

    def on_workers(function, items):
        used.append(len(items))
        return shared(function, items)

    monkeypatch.setattr(fits, "on_workers", on_workers)
    monkeypatch.setattr(fits, "workers", lambda: (None,) * 2)
    one = fitter.fit(starts=1)
    assert set(used) == {2}  # blocks of four flights, never a fit
    used.clear()
    several = fitter.fit(starts=2)
    assert used[0] == 2  # fits
    assert set(used[1:]) == {2}  # and the errors, by blocks again
    assert len(used) < 5
    np.testing.assert_array_equal(several.ends[0], one.ends[0])


def test_left_out_animals_are_predicted(fitter, fit, weighed):
    start = fitter.start(tuple(fit.scales.values()))
    rows = fitter.leave_out(start=start)
    np.testing.assert_array_equal(weighed, 1 - np.repeat(np.eye(3), 2, axis=1))
    assert [row["animal"] for row in rows] == ["A", "B", "C"]
    for row in rows:
        assert row["flights"] == 2
        assert row["predicted"] < 1.2 * np.sqrt(2) * NOISE
        assert row["unfitted"] > 4 * row["predicted"]
        for name, true in TRUE.items():
            assert row[name] == pytest.approx(true, rel=0.03)
    assert rows[0]["lift_scale"] != rows[1]["lift_scale"]


def test_animals_drawn_anew_spread_about_the_fit(fitter, fit, weighed):
    start = fitter.start(tuple(fit.scales.values()))
    drawn = fitter.resample(4, start=start)
    counts = np.array(weighed)[:, ::2]  # both flights of an animal weigh the same
    np.testing.assert_array_equal(weighed, np.repeat(counts, 2, axis=1))
    np.testing.assert_array_equal(counts.sum(axis=1), 3)
    assert counts.max() > 1
    assert drawn.shape == (4, 2)
    np.testing.assert_allclose(drawn, np.broadcast_to(list(TRUE.values()), (4, 2)), rtol=0.03)
    assert np.ptp(drawn, axis=0).min() > 0


def test_a_fit_is_saved(fitter, fit, tmp_path):
    data = fitted_dataset(fitter, fit)
    data.to_netcdf(tmp_path / "fit.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "fit.nc", engine="h5netcdf") as back:
        xr.testing.assert_identical(back.load(), data)
    assert data.multiplier.values.tolist() == list(SCALES)
    assert "paths apart" in str(fit)


OFF = np.array([3.0, -2.0, 1.0, -3.0, 2.0, -1.0])  # deg per SVL, of the bends


@pytest.fixture(scope="module")
def free_bends(made):
    """A fitter of flights with bends that are off, free within the stated uncertainty."""
    return Fitter(made.assign(d_psi=made.d_psi + OFF), {"d_psi": 4.0}, noise=NOISE)


@pytest.fixture(scope="module")
def freed(free_bends):
    return free_bends.fit(starts=1)


def test_corrected_gaits_come_closer(made, fit, free_bends, freed):
    held = Fitter(made.assign(d_psi=made.d_psi + OFF)).fit(starts=1)
    assert held.misfit > 1.5 * fit.misfit
    assert freed.misfit < 0.8 * held.misfit
    changed = np.rad2deg(freed.changes[:, 0])
    # most bends are found again; one flight may lie in another valley
    assert np.median(np.abs(changed + OFF)) < 1.0 < np.median(np.abs(OFF))
    assert (np.abs(changed) < 3 * 4.0).all()
    saved = fitted_dataset(free_bends, freed)
    np.testing.assert_allclose(saved.correction.sel(angle="d_psi"), changed)


def test_of_several_starts_the_price_of_corrections_counts(free_bends, freed, monkeypatch):
    y = np.log(list(freed.scales.values())), freed.changes / np.deg2rad(4.0)
    ends = [((y[0], 9 * y[1]), 0.1, 0.4, True), (y, 0.2, 0.3, True)]
    monkeypatch.setattr(fits, "_together", lambda fit, items: ends)
    again = free_bends.fit(starts=2)
    np.testing.assert_allclose(again.changes, freed.changes)
    np.testing.assert_allclose(again.misfits, np.sqrt([0.1, 0.2]))
    _, misfit, cost, _ = free_bends.solve(y)
    assert np.sqrt(misfit) == pytest.approx(freed.misfit, rel=0.01)
    price = NOISE**2 / len(y[1]) * np.sum(y[1] ** 2)
    assert cost - misfit == pytest.approx(price, rel=0.02)


def test_the_uncertainty_allows_for_corrections(free_bends, freed):
    """The block of the scales in the inverse of the whole Hessian, written out."""
    y = np.log(list(freed.scales.values())), freed.changes / np.deg2rad(4.0)
    apart, slopes = free_bends.sensitivities(y)
    flights, points = apart.shape
    whole = np.zeros((flights, points + 1, 2 + flights))  # the last row holds the change
    for n in range(flights):
        whole[n, :points, :2] = slopes[n, :, :2]
        whole[n, :points, 2 + n] = slopes[n, :, 2]
        whole[n, points, 2 + n] = NOISE * np.sqrt(points / 3)
    left = np.concatenate([apart, NOISE * np.sqrt(points / 3) * y[1]], axis=1)
    inverse = np.linalg.inv(np.einsum("nki,nkj->ij", whole, whole))
    gradients = np.einsum("nki,nk->ni", whole, left)
    spread = gradients.T @ gradients * flights / (flights - 2)
    expected = (inverse @ spread @ inverse)[:2, :2]
    np.testing.assert_allclose(free_bends.covariance(y), expected, rtol=1e-6)
    step = 0.05  # of a standard deviation, 0.2 degrees
    shift = np.zeros((flights, 1))
    shift[0] = step
    ahead, behind = (free_bends.sensitivities((y[0], y[1] + d))[0] for d in (shift, -shift))
    difference = (ahead - behind) / (2 * step)
    size = np.linalg.norm(slopes[0, :, 2])
    assert np.linalg.norm(slopes[0, :, 2] - difference[0]) < 5e-3 * size
    np.testing.assert_allclose(difference[1:], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"uncertainty": {"wings": 1.0}}, "uncertainty of 'wings'"),
        ({"uncertainty": {"d_psi": 0.0}}, "uncertainty of d_psi = 0 deg"),
        ({"noise": -1.0}, "noise = -1 m"),
    ],
)
def test_bad_input_is_named(made, options, message):
    with pytest.raises(ValueError, match=message):
        Fitter(made, **options)
    with pytest.raises(ValueError, match="starts = 0"):
        jaxglide.fit(made, starts=0)
    with pytest.raises(ValueError, match="scales = 0"):
        Fitter(made).start((1.0, 0.0))
