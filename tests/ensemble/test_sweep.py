"""Studies, sweeps, stores: what is computed, kept, resumed and refused."""

import contextlib
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import ANY

import jax
import numpy as np
import pytest
import xarray as xr
import zarr

from jaxglide import Gait, Glide, Glider, Launch, Polar, Snake, cli, simulate
from jaxglide._lib.writing import write_netcdf
from jaxglide.ensemble import batch
from jaxglide.ensemble import cluster as on_cluster
from jaxglide.ensemble import store as stores
from jaxglide.ensemble import sweep as module
from jaxglide.ensemble.batch import solve, width_of
from jaxglide.ensemble.layout import layout
from jaxglide.ensemble.store import Store, StoreError, opened
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
from jaxglide.files.glides import glide_dataset
from jaxglide.flight.glide import ready

GRID = {"nu_theta": [1.2, 1.3, 1.4], "d_psi": [0.0, 10.0]}
SHORT = {"fixed": {"height": 0.3}, "rtol": 1e-5, "atol": 1e-4}
WIDTH = 2


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch):
    """Two glides to a chunk, in this process."""
    monkeypatch.setattr(stores, "_GLIDES", 2)


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
    assert plain.d_psi.attrs["units"] == "degree"
    assert plain.d_psi.attrs["long_name"] == "dorsoventral bending, per SVL"
    assert plain.end_angles.attrs["units"] == "degree"
    assert "landed" in plain.outcome.attrs["flag_meanings"]
    assert (plain.height.item(), plain.height.attrs["units"]) == (0.3, "m")
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
    monkeypatch.setattr(module, "flown", None)  # any computation would fail
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

    monkeypatch.setattr(module, "flown", in_parts(count))
    with pytest.raises(KeyboardInterrupt):
        sweep(study, folder, width=WIDTH, progress=False)
    xr.testing.assert_identical(sweep(study, folder, width=WIDTH, progress=False), plain)
    assert len(calls) == 4  # two, the interrupted one, and that one again


def test_float32_is_said_and_kept_apart(tmp_path, monkeypatch):
    study = Study(GRID, fixed={"height": 0.3})
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    with jax.enable_x64(False), pytest.warns(UserWarning, match="too tight for float32"):
        data = sweep(study, tmp_path / "s.zarr", progress=False)
    assert data.time.dtype == np.float32
    with pytest.raises(StoreError, match="made with precision float32, this is float64"):
        sweep(study, tmp_path / "s.zarr", progress=False)


def numbered(study, index, width):
    """Stands in for `solve`: the first parameter of every case as its time, at once."""
    assert len(index) <= width
    column = study.columns(index)[next(iter(study.varied))]
    flown = {n: a.blank(len(index)) for n, a in layout(study, "float64").items()}
    return {n: np.zeros_like(v) for n, v in flown.items()} | {"time": column}


def in_parts(solve):
    """Stands in for `flown`: as many at a time as `width` says."""

    def flown(study, index, width):
        for first in range(0, len(index), width):
            places = np.arange(first, min(first + width, len(index)))
            yield places, solve(study, index[places], width)

    return flown


@pytest.fixture
def finished(study, tmp_path, monkeypatch):
    """A finished store of six glides that nobody flew; to fly any more is an error."""
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    sweep(study, tmp_path / "s.zarr", width=4, progress=False)
    monkeypatch.setattr(module, "flown", None)
    return tmp_path / "s.zarr"


def traced(study):
    """What flies one case of a study, and arguments."""
    arrays, (structure, leaves) = batch.shared(study.base)
    program = batch._program(structure, leaves, study.max_steps, 8)

    def one(*given):
        task = program.prepare(*given)
        lane = program.pilot.start(task.posed, task.args)
        return program.conclude(task, program.pilot.finish(task.posed, lane))

    case = {name: values[0] for name, values in study.varied.items()}
    times = None if study.times is None else np.asarray(study.times)
    return one, case, arrays, times, 1e-6, 1e-6, study.max_time


def test_a_store_keeps_what_a_sweep_keeps(study):
    """Names, shapes and types that a store declares are those of what is flown."""
    for one in (study, Study(GRID, **SHORT, times=[0.1, 0.2])):
        flown = jax.eval_shape(*traced(one))
        declared = layout(one, "float64")
        assert {n: (v.shape, v.dtype) for n, v in flown.items()} == {
            n: (a.shape, a.dtype) for n, a in declared.items()
        }


@pytest.mark.filterwarnings("ignore::zarr.errors.UnstableSpecificationWarning")
def test_other_software_reads_a_store(study, finished):
    with xr.open_zarr(finished, consolidated=False) as data:
        data = data.load()
    assert data.landing_point.dims == ("glide", "axis")
    assert data.end_angles.dims == ("glide", "turn")
    assert data.glide_angle.attrs["units"] == "rad"
    order = study.order()
    np.testing.assert_array_equal(data.case, order)
    np.testing.assert_array_equal(data.time, study.columns(order)["nu_theta"])
    assert list(data.sizes.values()).count(3) >= 2
    assert zarr.open_group(str(finished), mode="r")["outcome"].chunks == (2,)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("study", "holds another study"),
        ("version", r"version_jaxglide \d\.\d.*this is 9\.9"),
        ("old", "made by another version of jaxglide"),
        ("foreign", "exists and is not the store of a sweep"),
        ("{" * 5000, "exists and is not the store of a sweep"),
        ("[" * 500_000, "exists and is not the store of a sweep"),
        ("{}", "exists and is not the store of a sweep"),
        ('{"attributes": [1]}', "exists and is not the store of a sweep"),
        ("precision", "made with precision float64, this is float32"),
        ("file", "exists and is not the store of a sweep"),
    ],
)
def test_another_store_is_refused(study, finished, monkeypatch, change, said):
    other, root = study, finished / "zarr.json"
    if change == "study":
        other = Study(GRID, **{**SHORT, "rtol": 2e-5})
    elif change == "version":
        told = {**stores.versions(), "version_jaxglide": "9.9"}
        monkeypatch.setattr(stores, "versions", lambda: told)
    elif change == "old":
        root.write_text(root.read_text().replace("sweep 3", "sweep 2"))
    elif change == "foreign":
        root.unlink()
    elif change == "precision":
        monkeypatch.setattr(stores.jnp, "result_type", lambda _: np.dtype("float32"))
    elif change == "file":
        finished = finished / "zarr.json"
    else:
        root.write_text(change)
    before = files(finished)
    with pytest.raises(StoreError, match=said) as raised:
        sweep(other, finished, progress=False)
    assert str(finished) in str(raised.value)
    assert "\n" not in str(raised.value)
    assert files(finished) == before


def test_every_flipped_bit_is_noticed(study, tmp_path, monkeypatch):
    """In the last chunk's filling too: it holds two glides and room for four."""
    monkeypatch.setattr(stores, "_GLIDES", 4)
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    folder = tmp_path / "s.zarr"
    sweep(study, folder, progress=False)
    monkeypatch.setattr(module, "flown", None)
    random = np.random.default_rng(0)
    for name, good in files(folder).items():
        for place in (random.integers(len(good)), len(good) - 1):
            bad = bytearray(good)
            bad[place] ^= 4
            (folder / name).write_bytes(bad)
            with pytest.raises(StoreError, match=r"s\.zarr"):
                sweep(study, folder, progress=False)
        (folder / name).write_bytes(good)
    sweep(study, folder, progress=False)


def test_a_pipe_is_not_waited_for(study, finished):
    (finished / "zarr.json").unlink()
    os.mkfifo(finished / "zarr.json")
    with pytest.raises(StoreError, match="is not the store of a sweep"):
        sweep(study, finished, progress=False)


def test_a_store_that_lies_about_its_size_is_refused(study, finished):
    """Before anything of that size is made."""
    described = finished / "time" / "zarr.json"
    text = described.read_text()
    for shape in ("[1000000000000000]", "[-1]", '"many"', "[" * 100_000):
        described.write_text(text.replace('"shape": [6]', f'"shape": {shape}'))
        with pytest.raises(StoreError, match=r"its time/zarr\.json is not what this study"):
            sweep(study, finished, progress=False)


def test_chunks_do_not_change_places(study, finished):
    for name in ("digest", *layout(study, "float64")):
        places = [sorted((finished / name / "c" / str(i)).rglob("*")) for i in (0, 1)]
        a, b = (found[0] if found else finished / name / "c" / str(i)
                for i, found in enumerate(places))  # fmt: skip
        first, second = a.read_bytes(), b.read_bytes()
        a.write_bytes(second)
        b.write_bytes(first)
    with pytest.raises(StoreError, match="chunk 0 does not match its digest"):
        sweep(study, finished, progress=False)


def test_a_chunk_without_its_digest_is_computed_anew(study, finished, monkeypatch):
    before = files(finished)
    (finished / "digest" / "c" / "1" / "0").unlink()
    (finished / "time" / "c" / "1").write_bytes(b"torn")
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    sweep(study, finished, width=1, progress=False)
    assert files(finished) == before


def test_a_finished_store_needs_no_writing(study, finished, monkeypatch):
    """It may lie where nothing can be written, not even a lock."""
    monkeypatch.setattr(stores, "alone", None)
    sweep(study, finished, progress=False)


def test_the_machine_does_not_matter(study, tmp_path, monkeypatch):
    """A store begun with one width goes on with others, to the same bytes."""
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    for width in (1, 4, 5, 100):
        sweep(study, tmp_path / f"{width}.zarr", width=width, progress=False)
        assert files(tmp_path / f"{width}.zarr") == files(tmp_path / "1.zarr")
    with opened(tmp_path / "s.zarr", study) as kept:
        kept.write(1, numbered(study, study.order()[2:4], 2))
    sweep(study, tmp_path / "s.zarr", width=3, progress=False)
    assert files(tmp_path / "s.zarr") == files(tmp_path / "1.zarr")


@pytest.mark.parametrize(("glides", "chunk"), [(1, 1), (2, 2), (2000, 2), (3000, 3)])
def test_chunks_follow_from_the_study(glides, chunk):
    assert Store("s.zarr", Study({"nu_theta": np.linspace(1, 1.5, glides)})).chunk == chunk


def test_litter_of_killed_processes_is_removed(study, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    token = "0123456789abcdef"
    (tmp_path / f".s.zarr-{token}" / "time").mkdir(parents=True)
    (tmp_path / f".other.zarr-{token}").mkdir()
    with opened(tmp_path / "s.zarr", study) as kept:
        kept.write(0, numbered(study, study.order()[:2], 2))
    (tmp_path / "s.zarr" / "time" / "c" / f".1-{token}").write_bytes(b"torn")
    sweep(study, tmp_path / "s.zarr", progress=False)
    left = {path.name for path in tmp_path.iterdir()} - {".s.zarr.lock"}
    assert left == {"s.zarr", f".other.zarr-{token}"}
    assert not any(token in name for name in files(tmp_path / "s.zarr"))


def lives(what, number, seed=0):
    """Run `store_lives.py`; returns what it tells."""
    program = Path(__file__).parent / "store_lives.py"
    command = [sys.executable, str(program), what, str(number), str(seed)]
    folder = "/dev/shm" if Path("/dev/shm").is_dir() else None
    environment = {**os.environ, **({"TMPDIR": folder} if folder else {})}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_disk_is_full_and_then_has_room():
    """At the birth of a store or in a chunk: one sentence, code 1; then the same bits."""
    assert lives("full", 4)["wrong"] == []


@pytest.mark.parametrize("number", [10, pytest.param(10**6, marks=pytest.mark.slow)])
def test_killed_at_any_file_operation_a_sweep_ends_in_the_same_bits(number):
    told = lives("kills", number)
    assert told["operations"] > 300
    assert told["lives"] == min(number, told["operations"])
    assert told["wrong"] == []


@pytest.mark.parametrize("number", [3, pytest.param(200, marks=pytest.mark.slow)])
def test_two_processes_on_one_new_store_both_finish(number):
    assert lives("pairs", number) == {"lives": number, "operations": ANY, "wrong": []}


def test_who_waits_says_so(study, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    path = tmp_path / "s.zarr"
    running = threading.Thread(target=sweep, args=(study, path), kwargs={"progress": None})
    with opened(path, study) as kept:
        running.start()
        for _ in range(200):
            said = capsys.readouterr().err
            if "waiting" in said:
                break
            time.sleep(0.05)
        assert said == f"waiting for another process at work on {path}\n"
        running.join(0.5)
        assert running.is_alive()
        assert not kept.finished().any()
    running.join(60)
    assert kept.finished().all()


RUN = """
import sys, jax
jax.config.update("jax_enable_x64", True)
from jaxglide.ensemble.study import Study
from jaxglide.ensemble.sweep import sweep
sweep(Study.from_json(sys.argv[1]), sys.argv[2], width=int(sys.argv[3]), progress=False)
"""


def start(study, folder):
    command = [sys.executable, "-c", RUN, study.to_json(), str(folder), str(WIDTH)]
    return subprocess.Popen(command, env={**os.environ, **CACHE})


CACHE: dict[str, str] = {}


@pytest.mark.slow
def test_killed_runs_resume_to_the_same_store(tmp_path, tmp_path_factory):
    """Real flights, SIGKILL at twenty random moments; the store equals an undisturbed one."""
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
        if killed >= 20:
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
    values = np.array([0.7])
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


def test_a_batch_is_no_one_glide_to_label():
    several = object.__new__(Glide)
    for name in ("time", "interpolation"):
        object.__setattr__(several, name, np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"this holds glides of shape \(2, 3\): take one"):
        glide_dataset(several)


def test_limits_reach_the_solver(monkeypatch):
    given = {}

    def fly(*arguments, **options):
        given.update(options)
        return ready(*arguments, **options)

    monkeypatch.setattr("jaxglide.ensemble.batch.ready", fly)
    batch._program.cache_clear()
    limited = Study(GRID, max_time=7.0, max_steps=77, times=[0.1])
    fly, *arguments = traced(limited)
    fly(*arguments)
    assert (given["max_time"], given["max_steps"], given["times"]) == (7.0, 77, [0.1])


def test_every_parameter_reaches_its_place():
    case = {"nu_theta": 1.1, "theta_m": 80.0, "psi_m": 21.0, "d_psi": 11.0, "d_theta": 12.0,
            "f_theta": 1.3, "svl": 0.6, "mass": 0.03, "neck_fraction": 0.09, "height": 9.0,
            "speed": 2.0, "elevation": 5.0, "heading": 7.0,
            "lift_scale": 1.5, "drag_scale": 0.5,
            "gravity": 9.0, "air_density": 1.2, "kinematic_viscosity": 1.7e-5}  # fmt: skip
    study = Study({"nu_theta": [1.1]}, fixed={n: x for n, x in case.items() if n != "nu_theta"})
    flown = study.base.replace({"nu_theta": 1.1})
    glider, launch = flown.glider, flown.launch
    found = {}
    for part in (
        glider,
        glider.body,
        glider.gait,
        glider.aerodynamics.polar,
        glider.air,
        launch,
    ):
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


BITS = """
import sys, jax, numpy as np
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", 2)
from jaxglide.ensemble import batch
from jaxglide.ensemble.batch import solve
from jaxglide.ensemble.study import Study
study, index = Study.from_json(sys.argv[1]), np.arange(6)
wide = solve(study, index, 20)
both = jax.devices()
jax.local_devices = lambda: both[:1]
batch.cores = lambda: 1
whole = solve(study, index, 6)
parts = [solve(study, part, width) for part, width in ((index[:1], 1), (index[1:], 24))]
for name, values in whole.items():
    assert np.array_equal(values, wide[name], equal_nan=True), name
    assert np.array_equal(values, np.concatenate([p[name] for p in parts])), name
    print(name)
"""


def test_results_do_not_depend_on_the_batch_or_the_devices(study, plain):
    """To the bit: a batch of another width, filled up with repeats, and two devices.

    With XLA as users have it: it is what rounds a remainder of a loop as the loop itself.
    """
    environment = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"}
    command = [sys.executable, "-c", BITS, study.to_json()]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert {"landing_point", "end_angles", "accepted"} <= set(done.stdout.split())


@pytest.mark.skipif(jax.default_backend() != "cpu", reason="about CPU cores")
@pytest.mark.parametrize(
    ("count", "width"),
    [(1, 16), (80, 16), (100, 32), (242, 48), (1000, 48), (10**5, 48)],
)
def test_lanes_by_default(count, width, monkeypatch):
    """Five flights or so a lane, on two cores."""
    monkeypatch.setattr(batch, "workers", lambda: jax.devices()[:1] * 2)
    assert width_of(Study({"nu_theta": np.linspace(1, 1.5, count)})) == width


def test_lanes_come_back_in_order_from_several_devices():
    """Also where the cases or the lanes do not divide evenly among the devices."""
    program = """
import jax, numpy as np
jax.config.update("jax_num_cpu_devices", 3)
from jaxglide.ensemble.batch import spread
devices = tuple(jax.devices("cpu"))
assert len(devices) == 3
run = spread(lambda case, shift: {"y": case["x"] + shift}, devices, 1)
for count, width in ((6, 6), (5, 6), (4, 4), (9, 9), (1, 7)):
    x = np.arange(count, dtype="float32")
    np.testing.assert_array_equal(run({"x": x}, width, 10.0)["y"], x + 10)
"""
    environment = {**os.environ, "JAX_PLATFORMS": "cpu"}
    subprocess.run([sys.executable, "-c", program], env=environment, check=True)


def test_progress_counts_glides(tmp_path, monkeypatch):
    """Seven in chunks of two, one of them done before, flown in batches of three."""
    study = Study({"nu_theta": np.linspace(1, 1.5, 7)}, **SHORT)
    with opened(tmp_path / "s.zarr", study) as kept:
        kept.write(1, numbered(study, study.order()[2:4], 2))
    seen = []

    class Bar(contextlib.nullcontext):
        def __enter__(self):
            return self

        def update(self, count):
            seen.append((count, list(np.flatnonzero(kept.finished()))))

    def begin(total, unit, show, done):
        seen.append((total, unit, done))
        return Bar()

    monkeypatch.setattr(module, "progress_bar", begin)
    monkeypatch.setattr(module, "flown", in_parts(numbered))
    data = sweep(study, tmp_path / "s.zarr", width=3)
    assert seen == [(7, "glide", 2), (3, [0, 1]), (2, [0, 1, 2, 3])]
    np.testing.assert_array_equal(data.time, study.varied["nu_theta"])


# On a cluster


@pytest.fixture(scope="module")
def client():
    """Workers in threads of this process."""
    distributed = pytest.importorskip("distributed")
    with distributed.Client(
        processes=False, n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as client:
        yield client


def test_a_cluster_fills_the_same_store(study, finished, tmp_path, monkeypatch, client):
    """Whatever the batches, and without a store too."""
    monkeypatch.setattr("jaxglide.ensemble.batch.solve", numbered)
    for width in (None, 1, 4):
        folder = tmp_path / f"{width}.zarr"
        sweep(study, folder, width=width, progress=False, cluster=client)
        assert files(folder) == files(finished)
    data = sweep(study, width=4, progress=False, cluster=client.scheduler.address)
    xr.testing.assert_identical(data, sweep(study, finished, progress=False))


def test_a_task_carries_its_own_cases(monkeypatch, client):
    monkeypatch.setattr("jaxglide.ensemble.batch.solve", numbered)
    study = Study(cases={"nu_theta": np.linspace(1, 1.5, 1003)}, fixed={"height": 0.3})
    sizes, submit = [], client.submit

    def measured(function, *arguments, **options):
        sizes.append(len(json.dumps(arguments)))
        return submit(function, *arguments, **options)

    monkeypatch.setattr(client, "submit", measured)
    data = sweep(study, width=100, progress=False, cluster=client)
    np.testing.assert_array_equal(data.time, study.varied["nu_theta"])
    assert len(sizes) == 11
    assert max(sizes) < 0.2 * len(study.to_json())


def test_workers_that_die_are_said_and_chunks_kept(study, tmp_path, monkeypatch, client):
    from distributed import KilledWorker

    def dying(study, index, width):
        if study.columns(index)["nu_theta"][0] > 1.35:
            raise KilledWorker("batch", SimpleNamespace(address="tcp://a:1"), 3)
        return numbered(study, index, width)

    monkeypatch.setattr("jaxglide.ensemble.batch.solve", dying)
    monkeypatch.setattr(on_cluster, "_RETRIES", 0)
    with pytest.raises(on_cluster.ClusterError, match=r"died at a batch, 4 in all.*again$"):
        sweep(study, tmp_path / "s.zarr", width=2, progress=False, cluster=client)
    with opened(tmp_path / "s.zarr", study) as kept:
        done = kept.finished()
    assert not done[2]
    flown = []

    def here(study, index, width):
        flown.extend(index)
        return numbered(study, index, width)

    monkeypatch.setattr(module, "flown", in_parts(here))
    sweep(study, tmp_path / "s.zarr", progress=False)
    assert len(flown) == 6 - 2 * done.sum()


def test_workers_of_another_version_are_refused(study, monkeypatch, client):
    monkeypatch.setattr("jaxglide.ensemble.batch.solve", numbered)
    monkeypatch.setattr(on_cluster, "_RETRIES", 0)
    told = iter([{**on_cluster.versions(), "version_jax": "0.1"}] * 3)
    real = on_cluster.versions
    monkeypatch.setattr(on_cluster, "versions", lambda: next(told, None) or real())
    with pytest.raises(on_cluster.ClusterError, match="a worker has version_jax"):
        sweep(study, width=2, progress=False, cluster=client)


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


DYING = """
import os
import jaxglide.ensemble.batch
jaxglide.ensemble.batch.solve = lambda *_: os._exit(9)
"""


@pytest.mark.slow
def test_a_cluster_whose_workers_die_is_said(study, tmp_path):
    """Real worker processes that end at their first batch, as those out of memory do."""
    distributed = pytest.importorskip("distributed")
    dask = pytest.importorskip("dask")
    (tmp_path / "dying.py").write_text(DYING)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            preload=[str(tmp_path / "dying.py")],
        ) as cluster,
        distributed.Client(cluster) as client,
        pytest.raises(on_cluster.ClusterError, match="died at a batch, 1 in all"),
    ):
        sweep(study, tmp_path / "c.zarr", progress=False, cluster=client)
    with opened(tmp_path / "c.zarr", study) as kept:
        assert not kept.finished().any()


@pytest.mark.parametrize(
    ("address", "error", "said"),
    [
        ("tcp://127.0.0.1:1", on_cluster.ClusterError, "no scheduler answers at tcp"),
        ("nonsense://x", ValueError, "'nonsense://x' is not a scheduler's address"),
        (5, ValueError, "5 is not a scheduler's address"),
    ],
)
def test_a_cluster_that_is_not_there_leaves_no_store(
    study, tmp_path, monkeypatch, address, error, said
):
    pytest.importorskip("distributed")
    assert issubclass(on_cluster.ClusterError, OSError)  # code 1 on the command line
    monkeypatch.setattr(on_cluster, "_PATIENCE", "1s")
    with pytest.raises(error, match=said):
        sweep(study, tmp_path / "s.zarr", progress=False, cluster=address)
    assert list(tmp_path.iterdir()) == []
    write_netcdf(tmp_path / "a.nc", xr.Dataset({"x": 1.0}))  # Dask is not asked for it


def test_failed_glides_are_not_the_farthest(capsys, monkeypatch):
    """Neither where they stopped nor NaN."""
    outcomes = np.array([0, 4, 6])

    def fly(study, *_, **__):
        point = np.array([[0, 1.0, 0], [0, 99.0, 0], [0, np.nan, 0]])
        variables = {
            "outcome": ("nu_theta", outcomes),
            "landing_point": (("nu_theta", "axis"), point),
        }
        return xr.Dataset(variables, {"axis": list("xyz")})

    monkeypatch.setattr(module, "sweep", fly)
    arguments = ["sweep", "--vary", "nu_theta=1:1.2:3"]
    assert cli.main(arguments) == 1
    told = capsys.readouterr().out
    assert "farthest forward   1.000 m at nu_theta 1\n" in told
    outcomes[0] = 5
    assert cli.main(arguments) == 1
    told = capsys.readouterr().out
    assert "farthest forward   none: no glide was computed to its end" in told
    assert "nan" not in told


def test_a_study_larger_than_memory_makes_no_store(tmp_path):
    """Nothing is allocated for it, nor made."""
    times = np.linspace(0, 10, 20_000)
    large = Study({"nu_theta": np.linspace(1, 1.5, 10**6)}, times=times)
    with pytest.raises(StoreError, match=r"the study holds .* GB: more than half"):
        sweep(large, tmp_path / "s.zarr", progress=False)
    assert list(tmp_path.iterdir()) == []


def test_the_current_folder_is_not_made_a_store(study, tmp_path, monkeypatch):
    """It would be taken away under those who stand in it."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(StoreError, match="is the current folder"):
        sweep(study, ".", progress=False)
    assert not list(tmp_path.iterdir())
