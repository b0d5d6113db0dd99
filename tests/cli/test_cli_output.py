"""What the command line writes and prints: each file named once, pipes and terminals borne."""

import json
import os
import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest
import xarray as xr

from jaxglide import Gait, Glider, Ground, Plane, Snake, Study, cli
from jaxglide._lib.cache import cache_folder
from jaxglide.cli import glide
from jaxglide.cli._options import check_output, write
from jaxglide.cli.figure import _FIGURES, _scripts
from jaxglide.cli.sweep import _report
from places import ROOT


def run(capsys, *arguments):
    code = cli.main([str(word) for word in arguments])
    return code, *capsys.readouterr()


def sample():
    """A dataset that `jaxglide plot` draws."""
    speeds = np.linspace(1.0, 2.0, 5)
    return xr.Dataset(
        {"path_length": ("speed", speeds**2, {"units": "m", "long_name": "path length"})},
        {"speed": speeds},
    )


# Files


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["optimise", "--log", "a.nc", "--save", "a.nc"], "--save and --log both name a.nc"),
        (["optimise", "--log", "./a.nc", "--save", "a.nc"], "--save and --log both name a.nc"),
        (
            ["optimise", "--log", "a_glides.png", "--plot", "a.png"],
            "--log and --plot both name",
        ),
        (["sweep", "--vary", "speed=1", "--store", "a.nc", "--save", "a.nc"], "both name a.nc"),
        (["optimise", "--log", "no/a.jsonl"], "cannot write no/a.jsonl: there is no folder no"),
        (["compare", "a.nc", "--save", "a.nc"], "--save a.nc is the file to be read"),
        (["plot", "a.png", "--out", "a.png"], "--out a.png is the file to be read"),
        (
            ["sweep", "--vary", "speed=1", "--store", "a", "--save", "a/b.nc"],
            "no folder a",
        ),
        (
            ["sweep", "--vary", "speed=1", "--store", "folder.nc", "--save", "folder.nc/b.nc"],
            "--save folder.nc/b.nc lies in the folder of --store",
        ),
        (["glide", "--save", "folder.nc"], "cannot write folder.nc: it is a folder"),
        (["plot", "a.nc"], "a.png exists: give a name with --out, or --force to replace it"),
    ],
)
def test_files_are_settled_before_the_work(capsys, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.png").write_text("mine")
    (tmp_path / "folder.nc").mkdir()
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "")
    assert re.fullmatch(f"jaxglide: .*{re.escape(message)}.*\n", err)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "folder.nc"]
    assert (tmp_path / "a.png").read_text() == "mine"


def test_the_other_figures_of_a_search_are_announced_and_must_be_writable(tmp_path):
    parser = cli._parser()
    (tmp_path / "best_glides.png").mkdir()
    args = parser.parse_args(["optimise", "--plot", str(tmp_path / "best.png")])
    with pytest.raises(cli.UsageError, match=r"best_glides\.png: it is a folder"):
        check_output(args)
    text = parser._subparsers._group_actions[0].choices["optimise"].format_help()
    assert "FILE, and beside it FILE with _paths and _glides" in " ".join(text.split())


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_a_full_disk_is_one_sentence(capsys, tmp_path, monkeypatch, disk_of, suffix):
    monkeypatch.setattr("jaxglide.files.saved.open_dataset", lambda path: sample())
    out = tmp_path / f"a.{suffix}"
    out.write_text("old")
    with disk_of(2048):
        code, _, err = run(capsys, "plot", "a.nc", "--variable", "path_length", "--out", out)
    assert (code, err) == (1, f"jaxglide: cannot write {out}: File too large\n")
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
    assert out.read_text() == "old"
    code, told, err = run(capsys, "plot", "a.nc", "--variable", "path_length", "--out", out)
    assert (code, err) == (0, "")
    assert told.endswith(f"wrote {out}\n")
    assert out.stat().st_size > 2048


def test_json_stays_alone_on_standard_output(capsys, tmp_path, monkeypatch):
    def fake(args):
        write(sample, None, args)
        print(json.dumps({"outcome": "landed"}))
        return 0

    monkeypatch.setattr(glide, "_run", fake)
    save = tmp_path / "a.nc"
    code, out, err = run(capsys, "glide", "--json", "--save", save)
    assert (code, json.loads(out), err) == (0, {"outcome": "landed"}, f"wrote {save}\n")
    with xr.open_dataset(save, engine="h5netcdf") as data:
        assert data.identical(sample())


@pytest.mark.slow
def test_figures_are_not_replaced_unasked(capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "results" / "figure_s8" / "figure_s8.md"
    path.parent.mkdir(parents=True)
    path.write_text("mine")
    assert cli.main(["figure", "s8"]) == 2
    said = capfd.readouterr().err
    assert said.startswith(
        "jaxglide: results/figure_s8 holds results: give a folder with --out"
    )
    assert len(said.splitlines()) == 1
    assert path.read_text() == "mine"
    assert cli.main(["figure", "s8", "--force"]) == 0
    told = set(re.findall("wrote (.*)", capfd.readouterr().out))
    assert told == {str(p.relative_to(tmp_path)) for p in path.parent.iterdir()}
    assert path.read_text().startswith("| nodes")


def test_the_scripts_of_the_figures_travel_with_the_package():
    setup = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    folders = {path.parent.relative_to(ROOT) for path in (ROOT / "jaxglide").rglob("*.py")}
    packages = {".".join(folder.parts) for folder in folders}
    assert set(setup["packages"]) == packages | {"jaxglide.experiments"}
    assert setup["package-dir"] == {"jaxglide.experiments": "experiments"}
    shared = {"common.py", "validation_rows.py"}
    scripts = {path.name for path in _scripts().glob("*.py")} - shared
    assert set(_FIGURES.values()) == scripts


# Pipes and terminals


def process(code, *arguments, **environment):
    """Run a program that has the command line at hand, without JAX's slow part."""
    text = f"import sys\nfrom jaxglide import cli\nfrom jaxglide.cli import plot\n{code}"
    command = [sys.executable, "-c", text, *arguments]
    given = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    return command, {k: v for k, v in {**given, **environment}.items() if v is not None}


_PRINT = """
def fake(args):
    print("ψ" * int(sys.argv[1]))
    return 0
cli.configure = lambda: None
plot._run = fake
sys.exit(cli.main(["plot", "a.nc"]))
"""


@pytest.mark.parametrize("size", [1, 100_000])  # less and more than is held back
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_leaves_ends_it_in_silence(size, unbuffered):
    command, given = process(_PRINT, str(size), PYTHONUNBUFFERED=unbuffered)
    reading, writing = os.pipe()
    os.close(reading)
    try:
        pipe = subprocess.PIPE
        done = subprocess.run(command, stdout=writing, stderr=pipe, text=True, env=given)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (1, "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_output_to_a_full_disk_is_one_sentence():
    command, given = process(_PRINT, "1")
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, text=True, env=given
        )
    told = "jaxglide: cannot write standard output: No space left on device\n"
    assert (done.returncode, done.stderr) == (1, told)


def test_terminals_that_show_few_characters_are_told_what_they_can():
    command, given = process(_PRINT, "1", PYTHONIOENCODING="ascii")
    done = subprocess.run(command, capture_output=True, text=True, env=given)
    assert (done.returncode, done.stdout, done.stderr) == (0, "\\u03c8\n", "")


# The surroundings


_ALONE = """
import os, pwd
def unknown(user):
    raise KeyError(user)
pwd.getpwuid = unknown
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:1])
cli.configure()
import jax, matplotlib
from matplotlib.figure import Figure
from jaxglide.ensemble.batch import workers
print(jax.config.jax_compilation_cache_dir, len(workers()), matplotlib.get_backend())
"""


def test_no_home_one_core_and_a_notebooks_backend():
    gone = ("HOME", "XDG_CACHE_HOME", "JAX_COMPILATION_CACHE_DIR", "JAX_NUM_CPU_DEVICES")
    backend = "module://matplotlib_inline.backend_inline"
    command, given = process(_ALONE, **dict.fromkeys(gone), MPLBACKEND=backend)
    done = subprocess.run(command, capture_output=True, text=True, env=given)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "None 1 agg\n"


def test_compiled_code_is_kept_where_caches_are(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "/some/where")
    assert cache_folder() == "/some/where/jaxglide"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/my")
    assert cache_folder() == "/my/.cache/jaxglide"


def test_ends_of_the_same_words_are_counted_together(capsys):
    planes = Ground(), Plane((0, 1, 0), 1.0), Plane((1, 0, 0), 1.0)
    glider = Glider(Snake.from_svl(), Gait.from_degrees())
    study = Study({"nu_theta": [1.2, 1.3, 1.4]}, glider=glider, ends=planes)
    point = "nu_theta", "axis"
    flown = xr.Dataset(
        {"outcome": ("nu_theta", [7, 8, 0]), "landing_point": (point, np.ones((3, 3)))},
        coords={"axis": ["x", "y", "z"]},
    )
    assert _report(study, flown, 0.0, True) == 0
    counts = json.loads(capsys.readouterr().out)["outcomes"]
    assert counts == {"landed": 1, "reached the plane": 2}
