"""Steady sweeps: what is found is what a single search finds; kept, resumed, to the bit."""

import dataclasses

import numpy as np
import pytest
import xarray as xr

import jaxglide as jg
from jaxglide.ensemble import batch, seeker, steady
from jaxglide.ensemble import store as stores
from jaxglide.ensemble.store import StoreError
from jaxglide.steady.closure import Kind
from jaxglide.steady.result import Reason

slow = pytest.mark.slow

SETUP = {"polar": "smooth", "node_set": "gauss", "nodes": 40}
GRID = {"f_theta": [0.0, 1.2], "nu_theta": [1.3, 1.4]}


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch):
    """Two cases to a chunk."""
    monkeypatch.setattr(stores, "_GLIDES", 2)


@pytest.fixture(scope="module")
def study():
    return jg.Study(GRID, setup=SETUP)


class Told:
    """A seeker that flies nothing: what it finds follows from the case alone."""

    asked = 0

    def __init__(self, case, kind, step):
        self.kind = kind

    def search(self, values, starts):
        names = [*seeker._NUMBERS, "multipliers"]
        shapes = {"state": (8,), "multipliers": (8, 2)}
        for place in range(len(values["nu_theta"])):
            Told.asked += 1
            count = 0 if self.kind.frozen and place else 3
            size = values["nu_theta"][place] + np.arange(count)
            found = {
                name: np.multiply.outer(size, np.ones(shapes.get(name, ()))) for name in names
            }
            roots, reason = np.zeros((count, 8)), Reason.FOUND if count else Reason.UPENDED
            yield place, seeker.Found(roots, found if count else {}, int(reason), 7, 5)


@pytest.fixture
def told(monkeypatch):
    monkeypatch.setattr(steady, "Seeker", Told)
    Told.asked = 0
    return Told


def files(folder):
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def test_what_a_dataset_says(study, told):
    data = jg.steady_sweep(study, most=2, progress=False)
    assert data.found.dims == ("f_theta", "nu_theta")
    np.testing.assert_array_equal(data["count"], [[3, 0], [3, 3]])
    np.testing.assert_array_equal(data.found, [[True, False], [True, True]])
    assert data.reason.values[0, 1] == Reason.UPENDED
    assert data.reason.attrs["flag_meanings"].split()[Reason.UPENDED] == "upended"
    assert data.glide_angle.dims == ("f_theta", "nu_theta", "solution")
    np.testing.assert_allclose(data.glide_angle[1, 1], np.rad2deg([1.4, 2.4]))
    np.testing.assert_array_equal(data.speed[0, 0], [1.3, 2.3])
    assert np.isnan(data.speed[0, 1]).all()
    assert data.multipliers.dims[2:] == ("solution", "mode", "part")
    assert data.attrs["format"].startswith("jaxglide steady glides")
    assert data.attrs["most"] == 2


def test_a_store_is_resumed_and_opened(study, told, tmp_path):
    whole = jg.steady_sweep(study, tmp_path / "whole", most=2, progress=False)
    xr.testing.assert_identical(whole, jg.steady_sweep(study, most=2, progress=False))
    before = files(tmp_path / "whole")
    Told.asked = 0
    xr.testing.assert_identical(
        jg.steady_sweep(study, tmp_path / "whole", most=2, progress=False), whole
    )
    assert Told.asked == 0
    (tmp_path / "whole" / "digest" / "c" / "1" / "0").unlink()
    partly = jg.open(tmp_path / "whole")
    assert partly.attrs["computed"] == 2
    assert (partly["count"].values == -1).sum() == 2
    assert partly.found.values.sum() == 1
    jg.steady_sweep(study, tmp_path / "whole", most=2, progress=False)
    assert Told.asked == 2
    assert files(tmp_path / "whole") == before
    xr.testing.assert_equal(jg.open(tmp_path / "whole"), whole)


def test_a_store_of_other_results_is_refused(study, told, tmp_path):
    jg.steady_sweep(study, tmp_path / "kept", most=2, progress=False)
    with pytest.raises(StoreError, match="was made with most 2, this is 3"):
        jg.steady_sweep(study, tmp_path / "kept", most=3, progress=False)
    with pytest.raises(StoreError, match="holds other results"):
        jg.sweep(study, tmp_path / "kept", progress=False)


def test_cases_by_the_equation_that_they_fulfil():
    base = jg.Study({"nu_theta": [1.4]}, setup=SETUP).base
    varied = {"gait.f_theta": [1.2, 1.2, 0, 0], "gait.d_theta": [3.0, 0, 3, 0]}
    found = steady.kinds(base, {n: np.array(v) for n, v in varied.items()}, 4)
    assert {kind: places.tolist() for kind, places in found.items()} == {
        Kind(True, False): [2, 3],
        Kind(False, True): [1],
        Kind(False, False): [0],
    }
    assert list(steady.kinds(base, {}, 1)) == [Kind(False, True)]


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"starts": -1}, ValueError, "starts = -1 is not allowed"),
        ({"most": 0}, ValueError, "most = 0 is not allowed"),
        ({"step": 1.0}, ValueError, "step = 1 s is not allowed"),
        ({"study": None}, TypeError, "study must be of type Study"),
    ],
)
def test_bad_input_is_named(study, change, error, message):
    with pytest.raises(error, match=message):
        jg.steady_sweep(**{"study": study, **change})


def test_a_wind_that_changes_is_refused(study):
    windy = dataclasses.replace(study.base.glider, air=jg.ShearWind([0, 1, 0]))
    with pytest.raises(TypeError, match="air must be of type StillAir or UniformWind"):
        jg.steady_sweep(jg.Study({"nu_theta": [1.4]}, glider=windy))


@slow
def test_what_is_found_is_what_a_single_search_finds(study):
    data = jg.steady_sweep(study, starts=0, progress=False)
    assert data.found.values.tolist() == [[True, False], [False, True]]
    assert np.isnan(data.speed.values[~data.found.values]).all()
    for f_theta, nu_theta in ((0.0, 1.3), (1.2, 1.4)):
        here = data.sel(f_theta=f_theta, nu_theta=nu_theta)
        count = int(here["count"])
        assert (np.diff(here.spectral_radius[:count]) >= 0).all()
        assert (here.residual[:count] < 1e-9).all()
        here = here.isel(solution=0)
        case = study.base.replace({"f_theta": f_theta, "nu_theta": nu_theta})
        single = jg.steady_glide(case.glider, here.state.values)
        np.testing.assert_allclose(here.state, single.state, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(here.spectral_radius, single.spectral_radius, rtol=1e-7)
        np.testing.assert_allclose(here.glide_angle, np.rad2deg(single.glide_angle), rtol=1e-9)
        parts = np.stack([np.real(single.multipliers), np.imag(single.multipliers)], axis=-1)
        np.testing.assert_allclose(here.multipliers, parts, atol=1e-7)


@slow
def test_resumed_it_has_the_same_bits(study, tmp_path, monkeypatch):
    """In other company and on another number of cores too."""
    jg.steady_sweep(study, tmp_path / "kept", starts=1, progress=False)
    before = files(tmp_path / "kept")
    (tmp_path / "kept" / "digest" / "c" / "1" / "0").unlink()
    one = batch.workers()[:1]
    monkeypatch.setattr(seeker, "workers", lambda: one)
    jg.steady_sweep(study, tmp_path / "kept", starts=1, progress=False)
    assert files(tmp_path / "kept") == before
