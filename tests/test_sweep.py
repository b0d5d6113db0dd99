"""Studies, sweeps, stores: what is computed, kept, resumed and refused."""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest
import xarray as xr
import zarr

from jaxglide import Gait, Glider, Launch, Polar, Snake, simulate
from jaxglide import sweep as module
from jaxglide.batch import solve, template
from jaxglide.store import Store, StoreError
from jaxglide.study import Study
from jaxglide.sweep import sweep

GRID = {"nu_theta": [1.2, 1.3, 1.4], "d_psi": [0.0, 10.0]}
SHORT = {"fixed": {"height": 0.3}, "rtol": 1e-5, "atol": 1e-5}
WIDTH = 2


@pytest.fixture(scope="module")
def study():
    return Study(GRID, **SHORT)


@pytest.fixture(scope="module")
def plain(study):
    return sweep(study, width=WIDTH, progress=False)


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_a_sweep_is_the_glides_it_names(study, plain):
    """Every entry equals a glide simulated alone; the grid is in its order."""
    assert plain.outcome.dims == ("nu_theta", "d_psi")
    assert plain.landing_point.dims == ("nu_theta", "d_psi", "axis")
    fly = jax.jit(
        lambda nu, d: simulate(
            Glider(
                Snake.from_svl(0.70),
                Gait.from_degrees(nu_theta=nu, d_psi=d),
                Polar.published(),
            ),
            Launch(0.3),
            rtol=1e-5,
            atol=1e-5,
        )
    )
    for nu, d in itertools.product(*GRID.values()):
        glide, entry = fly(nu, d), plain.sel(nu_theta=nu, d_psi=d)
        np.testing.assert_allclose(entry.landing_point, glide.landing_point, atol=1e-7)
        np.testing.assert_allclose(entry.end_angles, np.rad2deg(glide.end_angles), atol=1e-5)
        assert entry.outcome == glide.outcome
        assert entry.accepted == glide.accepted


def test_units_and_settings_are_recorded(study, plain):
    assert plain.d_psi.attrs["units"] == "deg/SVL"
    assert plain.end_angles.attrs["units"] == "deg"
    assert "landed" in plain.outcome.attrs["flag_meanings"]
    assert plain.attrs["height"] == 0.3
    assert plain.attrs["polar"] == "published"
    assert plain.attrs["nodes"] == 70
    assert Study.from_json(plain.attrs["study"]).fingerprint == study.fingerprint
    assert "version_jax" in plain.attrs


def test_a_list_of_cases_and_trajectories(tmp_path):
    study = Study(
        cases={"f_theta": [0.0, 1.2, 1.2], "height": [0.2, 0.3, 0.2]},
        times=[0.0, 0.1, 0.22],
        rtol=1e-5,
        atol=1e-5,
    )
    data = sweep(study, width=2, progress=False)
    assert data.position.dims == ("case", "sample", "axis")
    np.testing.assert_allclose(data.position.sel(axis="z", sample=0.0), [0.2, 0.3, 0.2])
    np.testing.assert_allclose(data.position.sel(axis="z").isel(sample=1), 
                               data.height - 0.5 * 9.81 * 0.01, atol=0.01)  # fmt: skip
    # 0.2 m are fallen in about 0.2 s: nothing after the end
    assert np.isnan(data.position.sel(axis="z").isel(sample=2, case=0))
    assert np.isfinite(data.position.sel(axis="z").isel(sample=2, case=1))
    data.to_netcdf(tmp_path / "t.nc", engine="h5netcdf")
    with xr.open_dataset(tmp_path / "t.nc", engine="h5netcdf") as back:
        xr.testing.assert_identical(back.load(), data)


def test_order_groups_flights_of_similar_length():
    study = Study({"height": [75.0, 10.0], "f_theta": [1.2, 0.0]})
    order = study.order()
    assert sorted(order) == list(range(4))
    column = study.columns(order)
    assert list(column["height"]) == [10, 10, 75, 75]
    assert column["f_theta"][0] == 0.0


def test_a_store_equals_memory_and_is_not_recomputed(study, plain, tmp_path, monkeypatch):
    folder = tmp_path / "s.zarr"
    stored = sweep(study, folder, width=WIDTH, progress=False)
    xr.testing.assert_identical(stored, plain)
    before = files(folder)
    monkeypatch.setattr(module, "solve", None)  # any computation would fail
    xr.testing.assert_identical(sweep(study, folder, width=WIDTH, progress=False), plain)
    assert files(folder) == before


def test_only_missing_chunks_are_computed(study, plain, tmp_path, monkeypatch):
    folder = tmp_path / "s.zarr"
    calls = []

    def count(*arguments):
        calls.append(arguments)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return solve(*arguments)

    monkeypatch.setattr(module, "solve", count)
    with pytest.raises(KeyboardInterrupt):
        sweep(study, folder, width=WIDTH, progress=False)
    xr.testing.assert_identical(sweep(study, folder, width=WIDTH, progress=False), plain)
    assert len(calls) == 4  # two, the interrupted one, and that one again


@pytest.mark.parametrize("change", ["study", "version", "foreign", "digest", "data", "meta"])
def test_a_wrong_or_damaged_store_is_refused(study, tmp_path, monkeypatch, change):
    folder = tmp_path / "s.zarr"
    kept = Store(folder, study, WIDTH, template(study))
    index = study.order()[:WIDTH]
    values = solve(study, index, WIDTH)
    kept.write(0, values)
    other = study
    if change == "study":
        other = Study(GRID, **{**SHORT, "rtol": 2e-5})
    elif change == "version":
        monkeypatch.setattr("jaxglide.store.versions", lambda: {"version_jaxglide": "9.9"})
    elif change == "foreign":
        (folder / "zarr.json").unlink()
    elif change == "digest":
        kept.group["digest"][0] = np.arange(32, dtype="uint8")
    elif change == "data":
        kept.group["time"][0] = 1.0
    elif change == "meta":
        (folder / "zarr.json").write_text("{")
    before = files(folder)
    with pytest.raises(StoreError, match=r"s\.zarr"):
        sweep(other, folder, width=WIDTH, progress=False)
    assert files(folder) == before


def test_a_full_disk_is_said_and_finished_chunks_stay(study, plain, tmp_path, monkeypatch):
    folder = tmp_path / "s.zarr"
    original, calls = zarr.Array.__setitem__, []

    def full(self, key, value):
        calls.append(key)
        if len(calls) > 20:
            raise OSError(28, "No space left on device")
        return original(self, key, value)

    monkeypatch.setattr(zarr.Array, "__setitem__", full)
    with pytest.raises(StoreError, match=r"No space left.*intact"):
        sweep(study, folder, width=WIDTH, progress=False)
    monkeypatch.undo()
    assert Store(folder, study, WIDTH, template(study)).finished().sum() == 1
    xr.testing.assert_identical(sweep(study, folder, width=WIDTH, progress=False), plain)


RUN = """
import sys, jax
jax.config.update("jax_enable_x64", True)
from jaxglide.study import Study
from jaxglide.sweep import sweep
sweep(Study.from_json(sys.argv[1]), sys.argv[2], width=int(sys.argv[3]), progress=False)
"""


def start(study, folder):
    command = [sys.executable, "-c", RUN, study.to_json(), str(folder), str(WIDTH)]
    return subprocess.Popen(command, env={**os.environ, **CACHE})


CACHE: dict[str, str] = {}


@pytest.mark.parametrize("kills", [2, pytest.param(20, marks=pytest.mark.slow)])
def test_killed_runs_resume_to_the_same_store(tmp_path, tmp_path_factory, kills):
    """SIGKILL at random moments; the finished store equals an uninterrupted one."""
    CACHE["JAX_COMPILATION_CACHE_DIR"] = str(tmp_path_factory.getbasetemp() / "cache")
    study = Study({"nu_theta": np.linspace(1, 1.5, 24)}, **SHORT)
    whole = tmp_path / "whole.zarr"
    begin = time.perf_counter()
    assert start(study, whole).wait() == 0
    begin = time.perf_counter()
    assert start(study, tmp_path / "again.zarr").wait() == 0
    took = time.perf_counter() - begin
    random = np.random.default_rng(0)
    killed, folder = 0, tmp_path / "killed0.zarr"
    for attempt in itertools.count():
        running = start(study, folder)
        try:
            running.wait(timeout=random.uniform(0.5, 1.0) * took)
            assert files(folder) == files(whole)
            folder = tmp_path / f"killed{attempt + 1}.zarr"
        except subprocess.TimeoutExpired:
            running.send_signal(signal.SIGKILL)
            running.wait()
            killed += 1
        if killed >= kills:
            break
    assert start(study, folder).wait() == 0
    assert files(folder) == files(whole)


def test_studies_from_files(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text(
        "[grid]\nnu_theta = { start = 1.0, stop = 1.5, count = 3 }\nd_psi = [0, 10]\n"
        "[fixed]\nheight = 75\n[setup]\npolar = 'smooth'\n[solver]\nrtol = 1e-7\n"
    )
    study = Study.from_file(path)
    assert study.shape == (3, 2)
    np.testing.assert_allclose(study.varied["nu_theta"], [1, 1.25, 1.5])
    assert study.setup["polar"] == "smooth"
    assert (study.rtol, study.fixed["height"]) == (1e-7, 75)
    assert Study.from_json(study.to_json()).fingerprint == study.fingerprint
    assert json.loads(study.to_json())["rtol"] == 1e-7


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "either a grid or cases"),
        ({"grid": {}}, "at least one"),
        ({"grid": {"wings": [1]}}, "no parameter 'wings'"),
        ({"grid": {"svl": [0.5, -1]}}, r"svl = -1 m"),
        ({"grid": {"svl": []}}, "svl"),
        ({"grid": {"svl": ["a"]}}, "svl"),
        ({"cases": {"svl": [1, 2], "mass": [1]}}, "differ in length"),
        ({"grid": {"svl": [1]}, "fixed": {"svl": 1}}, "both varied and fixed"),
        ({"grid": {"svl": [1]}, "fixed": {"height": 0}}, "height = 0 m"),
        ({"grid": {"svl": [1]}, "setup": {"polar": "flat"}}, "published, smooth"),
        ({"grid": {"svl": [1]}, "setup": {"nodes": 5}}, "nodes = 5"),
        ({"grid": {"svl": [1]}, "rtol": 0}, "rtol = 0"),
        ({"grid": {"svl": [1]}, "times": [1, 0.5]}, "times must increase"),
    ],
)
def test_wrong_studies(arguments, message):
    with pytest.raises(ValueError, match=message):
        Study(**arguments)


def test_a_batch_is_filled_up_without_changing_results(study, plain):
    whole = sweep(study, width=6, progress=False)
    np.testing.assert_allclose(whole.landing_point, plain.landing_point, atol=1e-9)
    uneven = sweep(study, width=4, progress=False)
    np.testing.assert_allclose(uneven.landing_point, plain.landing_point, atol=1e-9)


def test_a_cluster_survives_the_loss_of_a_worker(tmp_path):
    """Two real worker processes, one killed in the middle; the store is complete."""
    distributed = pytest.importorskip("distributed")
    study = Study({"nu_theta": np.linspace(1, 1.5, 40)}, **SHORT)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        finished = []

        class Killer:
            """Stands in for the progress bar: kills a worker after the third batch."""

            def __enter__(self):
                return self

            def __exit__(self, *_):
                pass

            def update(self, count):
                finished.append(count)
                if len(finished) == 3:
                    os.kill(pids[0], signal.SIGKILL)

        patch = pytest.MonkeyPatch()
        patch.setattr(module, "_progress", lambda *_: Killer())
        with patch.context():
            data = sweep(study, tmp_path / "c.zarr", width=WIDTH, cluster=client)
        patch.undo()
    assert sum(finished) == 40
    here = sweep(study, width=WIDTH, progress=False)
    np.testing.assert_allclose(data.landing_point, here.landing_point, atol=1e-9)
    assert np.array_equal(data.outcome, here.outcome)


def test_a_cluster_needs_a_store_and_a_scheduler(study, tmp_path):
    with pytest.raises(ValueError, match="needs a store"):
        sweep(study, width=WIDTH, progress=False, cluster="tcp://127.0.0.1:1")
