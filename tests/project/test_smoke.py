"""One run of every kind of command, whole processes: what the oldest allowed versions of all
dependencies must be able to do (`.ci/lowest`).
"""

import json
import subprocess
import sys

import pytest

from made_recordings import swimming, write_tabular

pytestmark = pytest.mark.smoke


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("smoke")


def run(folder, line):
    """Output of `jaxglide LINE` in a folder; it must end well and complain of nothing."""
    done = subprocess.run(
        [sys.executable, "-m", "jaxglide.cli", *line.split()],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    assert "Traceback" not in done.stderr
    return done.stdout


def sizes(folder, *names):
    return [(folder / name).stat().st_size for name in names]


def test_glide(folder):
    said = run(folder, "glide --height 2 --save glide.nc --plot glide.pdf")
    assert "landed after" in said
    assert min(sizes(folder, "glide.nc", "glide.pdf")) > 10_000
    run(folder, "plot glide.nc --variable forces --out forces.svg")
    assert min(sizes(folder, "forces.svg")) > 10_000


def test_sweep(folder):
    line = "sweep --vary nu_theta=1.2:1.4:3 --fix height=0.5 --store s.zarr --json"
    first, again = (json.loads(run(folder, line)) for _ in range(2))
    assert first["outcomes"] == again["outcomes"] == {"landed": 3}
    run(folder, "plot s.zarr --out sweep.png")
    assert min(sizes(folder, "sweep.png")) > 5_000


def test_optimise(folder):
    line = "optimise --starts 2 --screen 4 --steps 2 --polish 1 --fix height=1 --margin none "
    line += "--clearance none --optimiser lbfgs --log best.jsonl --save best.nc --json "
    line += "--plot best.png"
    found = json.loads(run(folder, line))
    assert found["feasible"]
    assert found["value"] > 0.5
    assert min(sizes(folder, "best.jsonl", "best.nc", "best.png")) > 1_000


def test_tunnel_and_trim(folder):
    assert "trim at d_psi" in run(folder, "trim --nu-theta 1.4")
    tunnel = run(folder, "windtunnel --height 2 --plot moments.png --json")
    assert json.loads(tunnel)["outcome"] == "landed"


def test_view(folder):
    run(folder, "view --height 1 --out page.html")
    run(folder, "view --height 1 --out still.png")
    run(folder, "view --height 0.3 --out moving.mp4 --playback 1")
    assert min(sizes(folder, "page.html", "still.png", "moving.mp4")) > 10_000


def test_measure(folder):
    data = folder / "recordings"
    data.mkdir()
    write_tabular(data, swimming())
    assert "one" in run(folder, "measure recordings --save gaits.nc")
    assert len(json.loads(run(folder, "compare gaits.nc --json"))["flights"]) == 1
