"""Studies, sweeps, stores: what is computed, kept, resumed and refused."""

import contextlib
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
from jaxglide import cluster as on_cluster
from jaxglide import sweep as module
from jaxglide.batch import _CPU_LANES, default_width, solve, template
from jaxglide.cases import build, check_setup
from jaxglide.parameters import PARAMETERS
from jaxglide.store import Store, StoreError
from jaxglide.study import Study
from jaxglide.sweep import sweep

GRID = {"nu_theta": [1.2, 1.3, 1.4], "d_psi": [0.0, 10.0]}
SHORT = {"fixed": {"height": 0.3}, "rtol": 1e-5, "atol": 1e-4}
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
            atol=1e-4,
        )
    )
    for nu, d in itertools.product(*GRID.values()):
        glide, entry = fly(nu, d), plain.sel(nu_theta=nu, d_psi=d)
        np.testing.assert_allclose(entry.landing_point, glide.landing_point, atol=1e-7)
        launched = glide.take_off
        for name, angles in (
            ("end_angles", glide.end_angles),
            ("max_angles", glide.max_angles),
            ("glide_angle", glide.glide_angle),
            ("launch_angles", launched.angles),
        ):
            np.testing.assert_allclose(entry[name], np.rad2deg(angles), atol=1e-5)
        np.testing.assert_allclose(entry.launch_phase, launched.phi_theta, atol=1e-9)
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
        cases={"f_theta": [1.2, 0.0, 1.2], "height": [0.3, 0.2, 0.2]},
        times=[0.0, 0.1, 0.22],
        rtol=1e-5,
        atol=1e-5,
    )
    assert list(study.order()) == [1, 2, 0]  # not its own inverse
    data = sweep(study, width=2, progress=False)
    assert data.position.dims == ("case", "sample", "axis")
    np.testing.assert_allclose(data.position.sel(axis="z", sample=0.0), data.height)
    np.testing.assert_allclose(data.position.sel(axis="z").isel(sample=1), 
                               data.height - 0.5 * 9.81 * 0.01, atol=0.01)  # fmt: skip
    np.testing.assert_allclose(data.angles.sel(sample=0.0), data.launch_angles)
    # 0.2 m are fallen in about 0.2 s: nothing after the end
    assert np.isnan(data.position.sel(axis="z").isel(sample=2, case=1))
    assert np.isfinite(data.position.sel(axis="z").isel(sample=2, case=0))
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


def test_damage_to_any_result_is_noticed(study, tmp_path):
    kept = Store(tmp_path / "s.zarr", study, WIDTH, template(study))
    values = solve(study, study.order()[:WIDTH], WIDTH)
    for name in values:
        kept.write(0, values)
        assert list(kept.finished()) == [True, False, False]
        kept.group[name][1] = values[name][1] + 1
        with pytest.raises(StoreError, match="chunk 0 does not match"):
            kept.finished()


def test_a_store_of_another_width_is_refused(study, tmp_path):
    Store(tmp_path / "s.zarr", study, WIDTH, template(study))
    with pytest.raises(StoreError, match="made with width 2, this is 3"):
        sweep(study, tmp_path / "s.zarr", width=3, progress=False)


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


@pytest.mark.parametrize("kills", [1, pytest.param(20, marks=pytest.mark.slow)])
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


def test_every_part_of_a_study_is_kept_and_counts():
    base = {"grid": GRID, **SHORT, "times": [0.1]}
    changes = (
        {"grid": {**GRID, "d_psi": [0.0, 11.0]}},
        {"grid": dict(reversed(GRID.items()))},
        {"fixed": {"height": 0.4}},
        {"setup": {"polar": "smooth"}},
        {"setup": {"nodes": 71}},
        {"rtol": 2e-5},
        {"atol": 2e-5},
        {"max_time": 30.0},
        {"max_steps": 500},
        {"times": [0.2]},
    )
    studies = [Study(**(base | change)) for change in ({}, *changes)]
    assert len({study.fingerprint for study in studies}) == len(studies)
    for study in studies:
        assert Study.from_json(study.to_json()).to_json() == study.to_json()


def test_studies_that_ask_the_same_are_equal():
    one, same = (Study({"svl": [0.7, 0.8]}, fixed={"mass": 1}, times=[0, 1]) for _ in "ab")
    assert one == same
    assert {one: "kept"}[same] == "kept"
    assert one != Study({"svl": [0.7, 0.8]}, fixed={"mass": 2}, times=[0, 1])
    assert one != Study(cases={"svl": [0.7, 0.8]}, fixed={"mass": 1}, times=[0, 1])
    assert one != "a study"


def test_a_study_is_of_plain_numbers_whatever_it_was_given():
    values = np.array([0.7], np.float32)
    study = Study(
        {"svl": values},
        fixed={"height": np.int64(2)},
        setup={"nodes": np.int64(71), "polar": np.str_("smooth")},
        rtol=np.float32(1e-6),
        atol=jax.numpy.asarray(1e-6),
        max_time=np.int32(7),
        max_steps=np.int16(99),
        times=np.float32([0.5]),
    )
    values[0] = 0.1  # and nothing that is changed later changes it
    again = Study.from_json(study.to_json())
    assert again == study
    assert study.varied["svl"] == pytest.approx([0.7])
    assert (study.setup["nodes"], study.max_steps, study.times) == (71, 99, (0.5,))


def test_limits_reach_the_solver(monkeypatch):
    given = {}

    def fly(*arguments, **options):
        given.update(options)
        return simulate(*arguments, **options)

    monkeypatch.setattr("jaxglide.batch.simulate", fly)
    template(Study(GRID, max_time=7.0, max_steps=77, times=[0.1]))
    assert (given["max_time"], given["max_steps"], given["times"]) == (7.0, 77, (0.1,))


def test_every_parameter_reaches_its_place():
    case = {"nu_theta": 1.1, "theta_m": 80.0, "psi_m": 21.0, "d_psi": 11.0, "d_theta": 12.0,
            "f_theta": 1.3, "svl": 0.6, "mass": 0.03, "neck_fraction": 0.09, "height": 9.0,
            "speed": 2.0, "elevation": 5.0, "heading": 7.0,
            "lift_scale": 1.5, "drag_scale": 0.5,
            "gravity": 9.0, "air_density": 1.2, "kinematic_viscosity": 1.7e-5}  # fmt: skip
    assert set(case) == set(PARAMETERS)
    glider, launch = build(case, check_setup({}))
    found = {}
    for part in (glider.snake, glider.gait, glider.polar, glider.environment, launch):
        found |= vars(part)
    for name in ("theta_m", "psi_m", "d_psi", "d_theta", "elevation", "heading"):
        found[name] = np.rad2deg(found[name])
    found["svl"] = found["length"]
    for name, value in case.items():
        assert float(found[name]) == pytest.approx(value), name


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
        ({"grid": {"svl": [1]}, "times": []}, "times must be a list of numbers, not empty"),
        ({"grid": {"svl": [1]}, "times": "1"}, "times = '1' is not a list of numbers"),
        ({"grid": {"svl": [True]}}, r"svl = \[True\] is not a list of numbers"),
        ({"grid": {"svl": ["1"]}}, "is not a list of numbers"),
        ({"grid": {"svl": [[1], [1, 2]]}}, "is not a list of numbers"),
        ({"grid": {"svl": [10**400]}}, "is not a list of numbers"),
        ({"grid": ["svl"]}, r"grid = \['svl'\] is not values by name"),
        ({"grid": {"svl": [1]}, "fixed": 1}, "fixed = 1 is not values by name"),
        ({"grid": {"svl": [1]}, "fixed": {"height": [1, 2]}}, "is not one number"),
        ({"grid": {"svl": [1]}, "fixed": {"height": "1"}}, "height = '1' is not a number"),
        ({"grid": {"svl": [1]}, "rtol": [1e-6]}, "is not one number"),
        ({"grid": {"svl": [1]}, "max_time": None}, "max_time = None is not a number"),
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


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="about CPU cores")
@pytest.mark.parametrize("count", [1, 24, 25, 100, 1000])
def test_default_batches_are_few_and_equal(count):
    devices = len(jax.local_devices())
    width = default_width(Study({"nu_theta": np.linspace(1, 1.5, count)}))
    batches = -(-count // width)
    assert batches == -(-count // (_CPU_LANES * devices))
    assert 0 <= width * batches - count < batches * devices


def test_lanes_come_back_in_order_from_several_devices():
    """Also where the cases or the lanes do not divide evenly among the devices."""
    program = """
import jax, numpy as np
jax.config.update("jax_num_cpu_devices", 3)
from jaxglide.batch import spread
devices = tuple(jax.devices("cpu"))
assert len(devices) == 3
run = spread(lambda case, shift: {"y": case["x"] + shift}, devices, 1)
for count, width in ((6, 6), (5, 6), (4, 4), (9, 9), (1, 7)):
    x = np.arange(count, dtype="float32")
    np.testing.assert_array_equal(run({"x": x}, width, 10.0)["y"], x + 10)
"""
    environment = {**os.environ, "JAX_PLATFORMS": "cpu"}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)


def numbered(study, index, width):
    """Stands in for `solve`: the number of every case as its time, at once."""
    empty = {n: np.zeros((len(index), *v.shape), v.dtype) for n, v in template(study).items()}
    return empty | {"time": np.asarray(index, float)}


def test_progress_counts_glides(tmp_path, monkeypatch):
    """Seven in batches of three, one batch done before: the last batch has one glide."""
    study = Study({"nu_theta": np.linspace(1, 1.5, 7)}, **SHORT)
    Store(tmp_path / "s.zarr", study, 3, template(study)).write(
        0, numbered(study, study.order()[:3], 3)
    )
    seen = []

    class Bar(contextlib.nullcontext):
        def __enter__(self):
            return self

        def update(self, count):
            seen.append(count)

    def begin(total, unit, show, done):
        seen.append((total, unit, done))
        return Bar()

    monkeypatch.setattr(module, "progress_bar", begin)
    monkeypatch.setattr(module, "solve", numbered)
    data = sweep(study, tmp_path / "s.zarr", width=3)
    assert seen == [(7, "glide", 3), 3, 1]
    np.testing.assert_array_equal(data.time, np.arange(7))


def test_a_worker_flies_the_batch_it_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxglide.batch.solve", numbered)
    study = Study({"height": [0.4, 0.2, 0.3]})
    kept = Store(tmp_path / "s.zarr", study, 2, template(study))
    for chunk in (1, 0):
        told = study.to_json(), str(tmp_path / "s.zarr"), 2, chunk, True
        assert on_cluster._task(*told) == chunk
    np.testing.assert_array_equal(kept.read()["time"], [1, 2, 0])


@pytest.mark.slow
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
        patch.setattr(module, "progress_bar", lambda *_: Killer())
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
