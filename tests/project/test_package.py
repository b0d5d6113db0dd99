"""What is built and handed on: sdist and wheel, their contents and metadata, and commands run
from an installed wheel, far from the sources."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from email import message_from_string

import pytest

import jaxglide
from places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
VERSION = jaxglide.__version__


def run(*command, cwd, **environment):
    """Output of a command that must end well, which sees no sources by PYTHONPATH."""
    given = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    done = subprocess.run(
        [str(word) for word in command],
        cwd=cwd,
        env={**given, **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


# One version, one citation


def test_there_is_one_version():
    from jaxglide._lib.formats import marked

    newest = re.search(r"^## (\S+) - (\S+)$", _text("CHANGELOG.md"), re.MULTILINE)
    cited = dict(
        re.findall(r'^(version|date-released): "?([^"\n]+)', _text("CITATION.cff"), re.M)
    )
    assert newest
    assert (newest[1], newest[1]) == (VERSION, cited["version"])
    assert newest[2] == cited["date-released"]
    assert PROJECT["dynamic"] == ["version"]
    import xarray as xr

    assert VERSION in marked(xr.Dataset(), "glide").attrs["history"]


def _text(name):
    return (ROOT / name).read_text()


def test_the_citation_follows_its_schema(tmp_path):
    command = sys.executable, "-m", "check_jsonschema", "--builtin-schema"
    schema = "vendor.citation-file-format"
    assert "ok" in run(*command, schema, ROOT / "CITATION.cff", cwd=tmp_path)
    wrong = tmp_path / "CITATION.cff"
    wrong.write_text(_text("CITATION.cff").replace("family-names: Yeaton", "surname: Yeaton"))
    with pytest.raises(AssertionError, match="surname"):
        run(*command, schema, wrong, cwd=tmp_path)
    for doi in re.findall(r"doi: (\S+)", _text("CITATION.cff")):
        assert doi in {"10.1038/s41567-020-0935-4", "10.1242/jeb.090902"}


def test_what_is_vendored_is_named_with_its_version_and_licence():
    page = _text("THIRD_PARTY.md")
    folders = sorted((ROOT / "jaxglide" / "view" / "vendor").iterdir())
    assert [folder.name for folder in folders] == ["three", "uplot"]
    for folder in folders:
        [row] = [line for line in page.splitlines() if f"`{folder.relative_to(ROOT)}/`" in line]
        kept = re.search(r"Version ([\d.]+), (\w+) licence", (folder / "README.md").read_text())
        assert kept
        assert f"| {kept[1]} | {kept[2]} |" in row
        holder = re.search(r"Copyright . (.*)", (folder / "LICENSE").read_text())
        text = (folder / "LICENSE").read_text()
        assert holder or "Copyright (c) 2022 Leon Sorokin" in text
        assert text.split()[:2] in (["The", "MIT"], ["MIT", "License"])
    assert PROJECT["license"] == "MIT"  # of all of it


# Built and installed


_JUNK = (
    "experiments/__pycache__/common.cpython-311.pyc",
    "experiments/results/figure_4/figure_4.md",
    "docs/_build/index.html",
    "tests/glide.nc",
    "results/figure_4/figure_4.png",
    "shared/recordings.zip",
)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Folder with a wheel, built from the sdist beside it, that from the sources alone."""
    folder = tmp_path_factory.mktemp("built")
    left = ".git", ".venv", "*.egg-info", "build", "dist", "__pycache__", ".*_cache", "_build"
    sources = folder / "sources"
    shutil.copytree(ROOT, sources, ignore=shutil.ignore_patterns(*left, "shared", "*.zarr"))
    for name in _JUNK:
        (sources / name).parent.mkdir(parents=True, exist_ok=True)
        (sources / name).write_text("not to be handed on")
    out = folder / "dist"
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", out, sources, cwd=folder)
    return out


@pytest.fixture(scope="module")
def installed(built, tmp_path_factory):
    """Environment with the wheel; its dependencies are those of this one."""
    folder = tmp_path_factory.mktemp("installed") / "environment"
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    [site] = (folder / "lib").glob("python*/site-packages")
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-index"
    [wheel] = built.glob("*.whl")
    run(*pip, "--no-deps", "--force-reinstall", "--ignore-installed", wheel, cwd=folder)
    return folder


def test_the_sdist_has_what_building_and_testing_need_and_nothing_else(built):
    [path] = built.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        top = f"jaxglide-{VERSION}/"
        names = {name.removeprefix(top) for name in archive.getnames()}
    for file in ("README.md", "CHANGELOG.md", "CITATION.cff", "THIRD_PARTY.md", "MANIFEST.in"):
        assert file in names
    tracked = [
        path.relative_to(ROOT).as_posix()
        for folder in ("tests", "benchmarks", "experiments", "docs", "jaxglide", ".ci")
        for path in (ROOT / folder).rglob("*")
        if path.is_file()
        and not re.search(
            r"_cache/|__pycache__|_build|jupyter_execute|\.nc$|\.zarr/|/results/", str(path)
        )
    ]
    assert len(tracked) > 200
    assert set(tracked) <= names
    assert not names & set(_JUNK)
    assert not [
        name for name in names if re.search(r"\.pyc$|_cache/|\.nc$|shared|\.git$", name)
    ]
    assert path.stat().st_size < 10e6


def test_the_metadata_are_whole(built):
    files = sorted(built.iterdir())
    assert len(files) == 2
    run(sys.executable, "-m", "twine", "check", "--strict", *files, cwd=built)
    [path] = built.glob("*.whl")
    with zipfile.ZipFile(path) as wheel:
        names = set(wheel.namelist())
        info = f"jaxglide-{VERSION}.dist-info"
        known = message_from_string(wheel.read(f"{info}/METADATA").decode())
    assert (known["Version"], known["License-Expression"]) == (VERSION, "MIT")
    licences = set(known.get_all("License-File"))
    vendored = {f"jaxglide/view/vendor/{name}/LICENSE" for name in ("three", "uplot")}
    assert licences == {"LICENSE", "THIRD_PARTY.md", *vendored}
    assert {f"{info}/licenses/{name}" for name in licences} <= names
    assert {name.split("/")[0] for name in names} == {"jaxglide", info}
    modules = {p.relative_to(ROOT).as_posix() for p in (ROOT / "jaxglide").rglob("*.py")}
    assert modules <= names
    assert {"jaxglide/py.typed", "jaxglide/__init__.pyi"} <= names


def test_commands_run_from_the_wheel(installed, tmp_path):
    command = installed / "bin" / "jaxglide"
    python = installed / "bin" / "python"
    place = run(python, "-c", "import jaxglide; print(jaxglide.__file__)", cwd=tmp_path)
    assert place.startswith(str(installed))
    assert run(command, "--version", cwd=tmp_path) == f"jaxglide {VERSION}\n"
    glide = "--height", "0.3"
    assert "landed" in run(command, "glide", *glide, "--save", "glide.nc", cwd=tmp_path)
    assert "drew" in run(command, "plot", "glide.nc", "--out", "glide.png", cwd=tmp_path)
    assert "wrote" in run(command, "view", *glide, "--out", "glide.html", cwd=tmp_path)
    sizes = {path.name: path.stat().st_size for path in tmp_path.iterdir()}
    assert set(sizes) == {"glide.nc", "glide.png", "glide.html"}
    assert sizes["glide.html"] > 500_000
    assert min(sizes.values()) > 10_000
