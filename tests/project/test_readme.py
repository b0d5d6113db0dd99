"""The README's commands and code do what it says, and print the numbers that it claims."""

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
from claims import agree, blocks, commands, section, sentence
from jaxglide import cli
from made_flights import dataset
from places import ROOT

README = (ROOT / "README.md").read_text()
FLIGHTS = os.environ.get("JAXGLIDE_FLIGHTS")


def command(text, folder):
    """Run `jaxglide ...` in a folder with this interpreter."""
    words = shlex.split(text)
    assert words[0] == "jaxglide"
    return subprocess.run(
        [sys.executable, "-m", "jaxglide.cli", *words[1:]],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
    )


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


# Every command of the page stands in one of these tests' lists.

GLIDE = ["jaxglide glide --save glide.nc"]
SWEEP = [
    "jaxglide sweep --vary nu_theta=1:1.5:11 --vary d_psi=0,10,20 --fix height=10 "
    "--store bends.zarr --save bends.nc",
    "jaxglide sweep bends.toml --save bends.nc",
]
PARTS = [
    "jaxglide glide --body robot.csv --wind 0,-1,0 --height 2 --end angle=85:pitch,roll "
    "--end time=0.5"
]
TUNNEL = [
    "jaxglide windtunnel --d-psi 10 --plot moments.png",
    "jaxglide trim --nu-theta 1.2",
]
GRADIENT = ["jaxglide gradient --objective landing_distance --free theta_m,nu_theta,d_psi"]
OPTIMISE = [
    "jaxglide optimise --free theta_m,nu_theta,d_psi --log best.jsonl --save best.nc "
    "--plot best.png"
]
VIEW = ["jaxglide view --compare f_theta=0 --out undulation.html"]
MEASURED = [
    "jaxglide measure flights --save gaits.nc --plots figures",
    "jaxglide compare gaits.nc --plots figures",
]
INSTALL = [
    "jaxglide glide --plot glide.png",
    "jaxglide shapes --plot shapes.png",
    "jaxglide glide --help",
]


@pytest.fixture(scope="module")
def gallery():
    """The script `experiments/gallery.py`."""
    sys.path.insert(0, str(ROOT / "experiments"))
    try:
        import gallery
    finally:
        sys.path.pop(0)
    return gallery


def test_every_command_is_executed(gallery):
    """By a test below: none can be added to the page without one."""
    here = [*INSTALL, *SWEEP, *PARTS, *TUNNEL, *GRADIENT, *OPTIMISE, *VIEW, *MEASURED]
    made = [*gallery.DATA, *gallery.PICTURES.values(), "jaxglide figure gallery"]
    assert set(commands(README)) == {*here, *made}
    shown = section(README, "Gallery")
    cells = re.findall(
        r"!\[[^]]*\]\(experiments/figures/gallery/(\w+)\.png\)[^|`]*`([^`]+)`", shown
    )
    assert dict(cells) == gallery.PICTURES
    written = [re.search(r"(\w+\.png)", text) for text in gallery.PICTURES.values()]
    names = [found[1] for found in written if found]
    assert len(set(names)) == len(names) == len(gallery.PICTURES) - 1  # s7 names a folder


def test_commands_of_the_gallery_draw_what_earlier_ones_make(gallery):
    made = set()
    for text in (*gallery.DATA, *gallery.PICTURES.values()):
        args = cli._parser().parse_args(shlex.split(text)[1:])
        made.add(str(args.save))
        if args.command == "plot":
            assert str(args.file) in made


def test_no_code_is_left_out():
    """Every block is a command, a study file, or Python that a test below executes."""
    languages = re.findall(r"^```(\w+)$", README, flags=re.MULTILINE)
    assert set(languages) == {"sh", "toml", "csv", "python"}
    assert languages.count("python") == 9
    assert languages.count("toml") == 1


def test_code_imports_from_jaxglide_alone():
    lines = [line for code in blocks(README, "python") for line in code.splitlines()]
    named = {line.split()[1] for line in lines if re.match(r"(from|import) jaxglide", line)}
    assert named == {"jaxglide"}


def test_simulate():
    snippets = blocks(section(README, "Simulate"), "python")
    assert [len(s.strip().splitlines()) for s in snippets[:2]] == [5, 3]
    printed, _ = run_block(snippets[0])
    assert "landed" in printed


def test_import_lines_in_the_text():
    lines = re.findall(r"`(from jaxglide[^`]*)`", README)
    assert lines
    for line in lines:
        exec(line, {})


@pytest.mark.slow
def test_sweep(folder):
    text = section(README, "Sweep")
    (folder / "bends.toml").write_text(blocks(text, "toml")[0])
    follow(SWEEP[0])
    with xr.open_dataset("bends.nc", engine="h5netcdf") as data:
        first = data.load()
    assert first.outcome.shape == (11, 3)
    follow(SWEEP[1])
    with xr.open_dataset("bends.nc", engine="h5netcdf") as second:
        assert first.equals(second)
    printed, namespace = run_block(blocks(text, "python")[0])
    assert "landing_point" in printed
    assert namespace["data"].outcome.shape == (3, 2)


def test_parts_of_ones_own(folder):
    """The robot flies alike from the command line and in Python, and on until it lands."""
    text = section(README, "Your own parts")
    (folder / "robot.csv").write_text(blocks(text, "csv")[0])
    assert "reached its time after 0.5000 s" in follow(*PARTS)
    printed, namespace = run_block(blocks(text, "python")[0])
    assert namespace["flight"].ending == "reached its time"
    assert "landed" in printed
    for _, place in re.findall(r"\[(\w[^]]*)\]\((experiments/own_parts/\w+\.py)\)", text):
        assert (ROOT / place).exists(), place


def test_a_plain_process_has_one_device_and_the_variable_gives_more():
    code = "import jax, jaxglide.ensemble.sweep; print(len(jax.local_devices(backend='cpu')))"
    assert sentence(README, "`(JAX_NUM_CPU_DEVICES)`")
    plain = {
        k: v for k, v in os.environ.items() if k not in ("XLA_FLAGS", "JAX_NUM_CPU_DEVICES")
    }
    for more, count in (({}, "1"), ({"JAX_NUM_CPU_DEVICES": "3"}, "3")):
        done = subprocess.run(
            [sys.executable, "-c", code], env={**plain, **more}, capture_output=True, text=True
        )
        assert done.stdout.strip() == count, done.stderr


def test_view(folder):
    follow(*VIEW)
    page = (folder / "undulation.html").read_text()
    assert page.lower().startswith("<!doctype html")
    assert len(page) > 500_000


def test_pictures_of_a_glide(folder, gallery):
    """Those of the gallery that one glide makes."""
    drawn = [text for text in gallery.PICTURES.values() if "plot glide.nc" in text]
    assert len(drawn) == 5
    follow(*GLIDE, *drawn)
    assert len(list(folder.glob("*.png"))) == 5
    assert eval(sentence(README, r"`(jaxglide\.open\(.*?\))`"), {"jaxglide": jaxglide}).stable


def test_install_line_runs_a_glide(tmp_path):
    line = blocks(README, "sh")[0].strip().split(" && ")[-1]
    assert line == INSTALL[0]
    done = command(line, tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "glide.png").stat().st_size > 20_000
    assert "landed" in done.stdout
    assert done.stderr == ""
    forward = float(re.search(r" y ([\d.]+)", done.stdout)[1])
    agree(sentence(README, r"The snake lands ([\d.]+ m) forward"), forward)
    agree(sentence(README, r"about half as far as the animal: (\d+ m)"), forward)


def test_test_command_is_what_ci_runs():
    line = blocks(section(README, "Test"), "sh")[0].strip()
    assert line in (ROOT / ".ci" / "run").read_text()


def test_every_named_command_and_option_exists():
    lines = [line for block in blocks(README, "sh") for line in re.split(r"\n| && ", block)]
    texts = re.findall(r"`(jaxglide [a-z]+[^`]*)`", README)
    texts += [line for line in lines if line.startswith("jaxglide ")]
    named = {" ".join(text.split()[:2]) for text in texts}
    assert named >= {"jaxglide glide", "jaxglide shapes", "jaxglide sweep"}
    parsers = cli._parser()._subparsers._group_actions[0].choices
    for name in named:
        usage = parsers[name.split()[1]].format_usage()
        for text in texts:
            if text.startswith(f"{name} "):
                options = set(re.findall(r"--[a-z-]+", text)) - {"--help"}
                assert options <= set(re.findall(r"--[a-z-]+", usage)), text


def test_pictures_exist():
    for path in re.findall(r"!\[[^]]*\]\(([^)]+)\)", README):
        assert (ROOT / path).exists(), path


@pytest.mark.parametrize("name", re.findall(r"`(jaxglide/[a-z_/.]+)`", README))
def test_files_exist(name):
    assert (ROOT / name).exists()


def test_json():
    result = json.loads(follow("jaxglide glide --json --height 1"))
    keys = "outcome time landing_point path_length height_lost end_angles_deg max_angles_deg"
    assert set(result) == {*keys.split(), "launch", "steps"}
    assert set(result["launch"]) == {"phase", "angles_deg", "speed"}
    assert result["outcome"] == "landed"
    assert result["height_lost"] == pytest.approx(1, abs=1e-9)


# What takes longer


@pytest.mark.slow
def test_gradient_of_a_glide():
    """In order, in one namespace; the last one asserts on the gradient."""
    printed, namespace = run_block("\n".join(blocks(section(README, "Simulate"), "python")))
    assert "by differences" in printed
    assert abs(namespace["gradient"]) > 1e-3


@pytest.mark.slow
def test_trim():
    text = section(README, "Wind tunnel and trim")
    printed = follow(TUNNEL[1])
    here = sentence(text, r"bend without pitch moment, (here [\d.]+)°")
    agree(here, re.search(r"trim at d_psi = ([\d.]+)", printed)[1])
    printed, namespace = run_block(blocks(text, "python")[0])
    agree(here, re.search(r"trim at ([\d.]+)", printed)[1])
    assert namespace["loads"].aerodynamic.shape == (60, 3)


@pytest.mark.slow
def test_the_long_glide():
    """The gait of the picture, to the digits that the page of experiments gives, from 75 m."""
    flown = follow(
        "jaxglide glide --height 75 --theta-m 60 --nu-theta 1.738 --psi-m 0 --d-psi 5.5 "
        "--f-theta 1.30 --polar smooth --node-set gauss --json"
    )
    result = json.loads(flown)
    assert result["outcome"] == "landed"
    said = sentence(README, r"finds gaits that land, this one after (\d+) m")
    agree(said, result["landing_point"][1], share=0.01)  # its gait is rounded


@pytest.mark.slow
def test_wind_tunnel(folder):
    printed = follow(TUNNEL[0])
    assert "Derivatives of the mean pitch moment" in printed
    assert "Steady glide" in printed
    assert (folder / "moments.png").stat().st_size > 20_000


@pytest.mark.slow
def test_shapes(folder):
    printed = follow(INSTALL[1])
    assert int(re.search(r"^(\d+) glides", printed, re.MULTILINE)[1]) == 242
    assert "published" in printed
    agree(sentence(README, r"shape space \((\d+) body shapes"), 242 / 2)


@pytest.mark.slow
def test_gradient():
    printed = follow(*GRADIENT)
    for name in ("theta_m", "nu_theta", "d_psi"):
        assert re.search(rf"{name}\s+.*\d", printed)


@pytest.mark.slow
def test_optimise(folder):
    """From 64 gaits; the table of the page of experiments has the distance of such a search."""
    follow(*OPTIMISE)
    with xr.open_dataset("best.nc", engine="h5netcdf") as found:
        assert found.sizes["start"] == 64
        met = found.best_violation <= 1e-6
        assert float(found.best_value.where(met).max()) > 7.0
    assert (folder / "best.png").exists()


@pytest.mark.slow
def test_an_objective_of_ones_own(monkeypatch):
    """At reduced size: two starts, two steps."""
    import jaxglide
    from jaxglide.search import optimum

    whole = optimum.optimise
    small = {"starts": 2, "steps": 2, "polish": 0}
    for place in (jaxglide, optimum):
        monkeypatch.setattr(place, "optimise", lambda problem: whole(problem, **small))
    printed, _ = run_block(blocks(section(README, "Optimise"), "python")[0])
    assert "d_psi" in printed


@pytest.mark.slow
def test_a_cluster(folder, monkeypatch):
    """The block for SLURM; a local cluster of one worker stands in for dask-jobqueue's."""
    distributed = pytest.importorskip("distributed")

    class SLURMCluster(distributed.LocalCluster):
        def __init__(self, **options):
            assert set(options) == {"cores", "processes", "worker_extra_args", "memory"}
            super().__init__(n_workers=1, threads_per_worker=1, dashboard_address=None)

        def scale(self, jobs):
            assert jobs == 20

    stand_in = types.ModuleType("dask_jobqueue")
    stand_in.SLURMCluster = SLURMCluster
    monkeypatch.setitem(sys.modules, "dask_jobqueue", stand_in)
    text = section(README, "Sweep")
    (folder / "bends.toml").write_text(blocks(text, "toml")[0])
    _, namespace = run_block(blocks(text, "python")[1])
    namespace["cluster"].close()
    assert namespace["data"].outcome.shape == (11, 3)


@pytest.mark.slow
def test_fit(golden, folder, monkeypatch):
    """At reduced size: two flights, one start."""
    from jaxglide.flights.fitter import Fitter

    whole = Fitter.fit
    monkeypatch.setattr(Fitter, "fit", lambda self, **_: whole(self, starts=1))
    flights = dataset(golden("simulated_flights")[:2])
    flights.to_netcdf("gaits.nc", engine="h5netcdf")
    printed, _ = run_block(blocks(section(README, "Measured flights"), "python")[0])
    assert "lift" in printed


@pytest.mark.slow
@pytest.mark.skipif(not FLIGHTS, reason="JAXGLIDE_FLIGHTS names the public recordings")
def test_measured_flights(folder):
    (folder / "flights").symlink_to(FLIGHTS)
    follow(MEASURED[0])
    printed = json.loads(follow(f"{MEASURED[1]} --json"))["flights"]
    means = [
        np.mean([f[f"distance_{of}"] for f in printed]) for of in ("simulated", "measured")
    ]
    agree(sentence(README, r"animals: ([\d.]+ m where they flew [\d.]+ m)"), *means)
    follow(MEASURED[1])


@pytest.mark.slow
def test_gallery(folder):
    """All pictures, by the commands of the page."""
    done = command("jaxglide figure gallery --out pictures", folder)
    assert done.returncode == 0, done.stderr
    shown = {path.name for path in (ROOT / "experiments/figures/gallery").iterdir()}
    assert {path.name for path in (folder / "pictures").iterdir()} == shown
