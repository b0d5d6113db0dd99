"""What people do with jaxglide, from the command line and in Python, each at a whole go."""

import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
import types

import numpy as np
import pytest
import xarray as xr

import jaxglide
from claims import agree, sentence
from jaxglide import cli
from jaxglide._lib.formats import marked
from made_flights import dataset
from places import ROOT

FLIGHTS = os.environ.get("JAXGLIDE_FLIGHTS")

slow = pytest.mark.slow


def page(*names):
    """Text of a page of the site."""
    return ROOT.joinpath("docs", *names).read_text()


def follow(*texts):
    """Run commands in the current folder, in this process; what they print."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for text in texts:
            assert cli.main(shlex.split(text)[1:]) == 0, text
    return printed.getvalue()


def run_block(code, **namespace):
    """Execute a block; what it prints, and its names."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(code, namespace)
    return printed.getvalue(), namespace


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A scratch folder, the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


BENDS = """
[grid]
nu_theta = { start = 1.0, stop = 1.5, count = 11 }
d_psi = [0, 10, 20]
[fixed]
height = 10
"""
CLUSTER = """
from dask_jobqueue import SLURMCluster
from jaxglide import Study, sweep
extra = ["--nthreads", "1"]
cluster = SLURMCluster(cores=8, processes=1, worker_extra_args=extra, memory="16GB")
cluster.scale(jobs=20)
data = sweep(Study.from_file("bends.toml"), "bends.zarr", cluster=cluster.get_client())
"""


@slow
def test_sweep(folder):
    """By options with a store, and by a study file: the same."""
    (folder / "bends.toml").write_text(BENDS)
    follow(
        "jaxglide sweep --vary nu_theta=1:1.5:11 --vary d_psi=0,10,20 --fix height=10 "
        "--store bends.zarr --save bends.nc"
    )
    with xr.open_dataset("bends.nc", engine="h5netcdf") as data:
        first = data.load()
    assert first.outcome.shape == (11, 3)
    follow("jaxglide sweep bends.toml --save bends.nc")
    with xr.open_dataset("bends.nc", engine="h5netcdf") as second:
        assert first.equals(second)


@slow
def test_a_slurm_cluster(folder, monkeypatch):
    """A local cluster of one worker stands in for dask-jobqueue's."""
    distributed = pytest.importorskip("distributed")

    asked = []

    class SLURMCluster(distributed.LocalCluster):
        def __init__(self, **options):
            assert set(options) == {"cores", "processes", "worker_extra_args", "memory"}
            super().__init__(n_workers=1, threads_per_worker=1, dashboard_address=None)

        def scale(self, jobs):
            asked.append(jobs)
            if jobs == 0:  # while it closes
                super().scale(jobs)

    stand_in = types.ModuleType("dask_jobqueue")
    stand_in.SLURMCluster = SLURMCluster
    monkeypatch.setitem(sys.modules, "dask_jobqueue", stand_in)
    (folder / "bends.toml").write_text(BENDS)
    _, namespace = run_block(CLUSTER)
    assert asked == [20]
    namespace["cluster"].close()
    assert namespace["data"].outcome.shape == (11, 3)


def test_a_plain_process_flies_on_all_cores_and_the_variable_says_another_number():
    code = "from jaxglide.ensemble.batch import workers; print(len(workers()))"
    every = str(len(os.sched_getaffinity(0)))
    plain = {
        k: v for k, v in os.environ.items() if k not in ("XLA_FLAGS", "JAX_NUM_CPU_DEVICES")
    }
    for more, count in (({}, every), ({"JAX_NUM_CPU_DEVICES": "3"}, "3")):
        done = subprocess.run(
            [sys.executable, "-c", code], env={**plain, **more}, capture_output=True, text=True
        )
        assert done.stdout.strip() == count, done.stderr


ROBOT = """position,chord,density,point_mass
0,0.03,0.05,0
0.35,0.05,0.10,0.04
0.70,0.01,0.03,0
"""
FLOWN = """
from jaxglide import AngleLimit, Gait, Glider, Ground, Launch, TabulatedBody, TimeLimit
from jaxglide import UniformWind, integrate, simulate
body, wind = TabulatedBody.from_csv("robot.csv"), UniformWind([0, -1, 0])
robot = Glider(body, Gait.from_degrees(), air=wind)
ends = Ground(), AngleLimit(angles=("pitch", "roll")), TimeLimit(0.5)
flight = simulate(robot, Launch(height=2.0), ends=ends)
print(integrate(robot, flight.state, flight.time, 2.0, phase=flight.phase, ends=Ground()))
"""


def test_a_robot_flies_alike_from_the_command_line_and_in_python(folder):
    """And on from its state until it lands."""
    (folder / "robot.csv").write_text(ROBOT)
    shown = follow(
        "jaxglide glide --body robot.csv --wind 0,-1,0 --height 2 --end angle=85:pitch,roll "
        "--end time=0.5"
    )
    assert "reached its time after 0.5000 s" in shown
    printed, namespace = run_block(FLOWN)
    assert namespace["flight"].ending == "reached its time"
    assert "landed" in printed


def test_view(folder):
    follow("jaxglide view --compare f_theta=0 --out undulation.html")
    written = (folder / "undulation.html").read_text()
    assert written.lower().startswith("<!doctype html")
    assert len(written) > 500_000


def test_a_saved_glide_is_a_flight_again(folder):
    follow("jaxglide glide --save glide.nc")
    assert jaxglide.open("glide.nc").stable


def test_json():
    result = json.loads(follow("jaxglide glide --json --height 1"))
    keys = "outcome time landing_point path_length height_lost end_angles_deg max_angles_deg"
    assert set(result) == {*keys.split(), "launch", "steps"}
    assert set(result["launch"]) == {"phase", "angles_deg", "speed"}
    assert result["outcome"] == "landed"
    assert result["height_lost"] == pytest.approx(1, abs=1e-9)


HELD = """
import math
from jaxglide import Gait, Glider, Snake, equilibrium, fall, loads_at_end, trim
held = Glider(Snake.from_svl(0.70), Gait.from_degrees(nu_theta=1.2))
print(f"trim at {math.degrees(trim(held).value):.2f} degrees per SVL")
loads = loads_at_end(fall(held))  # of the air, over the phases of the waves
"""


@slow
def test_trim():
    """Both ways, the bend of the table of the findings."""
    said = sentence(page("findings", "bending.md"), r"\| 1\.20 \|.{40,60}\| ([\d.]+)° \|")
    printed = follow("jaxglide trim --nu-theta 1.2")
    agree(said, re.search(r"trim at d_psi = ([\d.]+)", printed)[1])
    printed, namespace = run_block(HELD)
    agree(said, re.search(r"trim at ([\d.]+)", printed)[1])
    assert namespace["loads"].aerodynamic.shape == (60, 3)


@slow
def test_wind_tunnel(folder):
    printed = follow("jaxglide windtunnel --d-psi 10 --plot moments.png")
    assert "Derivatives of the mean pitch moment" in printed
    assert "Steady glide" in printed
    assert (folder / "moments.png").stat().st_size > 20_000


@slow
def test_the_long_glide():
    """The gait that the findings show from 75 m; rounded as there."""
    flown = follow(
        "jaxglide glide --height 75 --theta-m 60 --nu-theta 1.738 --psi-m 0 --d-psi 5.5 "
        "--f-theta 1.30 --polar smooth --node-set gauss --json"
    )
    result = json.loads(flown)
    assert result["outcome"] == "landed"
    said = sentence(page("findings", "optimal.md"), r"A gait that glides (\d+) m from 75 m")
    agree(said, result["landing_point"][1], share=0.01)


@slow
def test_shapes(folder):
    printed = follow("jaxglide shapes --plot shapes.png")
    assert int(re.search(r"^(\d+) glides", printed, re.MULTILINE)[1]) == 242
    assert "published" in printed


@slow
def test_gradient():
    printed = follow(
        "jaxglide gradient --objective landing_distance --free theta_m,nu_theta,d_psi"
    )
    for name in ("theta_m", "nu_theta", "d_psi"):
        assert re.search(rf"{name}\s+.*\d", printed)


@slow
def test_optimise(folder):
    """From 64 gaits."""
    follow(
        "jaxglide optimise --free theta_m,nu_theta,d_psi --log best.jsonl --save best.nc "
        "--plot best.png"
    )
    with xr.open_dataset("best.nc", engine="h5netcdf") as found:
        assert found.sizes["start"] == 64
        met = found.best_violation <= 1e-6
        assert float(found.best_value.where(met).max()) > 7.0
    assert (folder / "best.png").exists()


OWN_OBJECTIVE = """
from jaxglide import Problem, landing_distance, optimise, sink_rate, stability_margin
problem = Problem(
    landing_distance - 0.5 * sink_rate,
    {"d_psi": (-10, 40), "nu_theta": (1, 1.5)},
    [stability_margin.at_least(10, scale=10)],
)
print(optimise(problem, starts=2, steps=2, polish=0))
"""


@slow
def test_an_objective_of_ones_own():
    """At reduced size."""
    printed, _ = run_block(OWN_OBJECTIVE)
    assert "d_psi" in printed


@slow
def test_fit(golden, folder, monkeypatch):
    """At reduced size: two flights, one start."""
    from jaxglide.flights.fitter import Fitter

    whole = Fitter.fit
    monkeypatch.setattr(Fitter, "fit", lambda self, *_: whole(self, starts=1))
    flights = dataset(golden("simulated_flights")[:2])
    jaxglide.save(marked(flights, "measured flights"), "gaits.nc")
    printed, _ = run_block('import jaxglide\nprint(jaxglide.fit(jaxglide.open("gaits.nc")))')
    assert "lift" in printed


@slow
@pytest.mark.skipif(not FLIGHTS, reason="JAXGLIDE_FLIGHTS names the public recordings")
def test_measured_flights(folder):
    (folder / "flights").symlink_to(FLIGHTS)
    follow("jaxglide measure flights --save gaits.nc --plots figures")
    command = "jaxglide compare gaits.nc --plots figures"
    printed = json.loads(follow(f"{command} --json"))["flights"]
    means = [
        np.mean([f[f"distance_{of}"] for f in printed]) for of in ("simulated", "measured")
    ]
    said = page("findings", "measured.md")
    agree(sentence(said, r"nodes 1 cm apart \| ([\d.]+)"), means[0])
    agree(sentence(said, r"of the measured ([\d.]+) m"), means[1])
    follow(command)
