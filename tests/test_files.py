"""Files are written whole or not at all, and one process at a time holds a place."""

import ast
import os
import re
import resource
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import jaxglide
from jaxglide import _files
from jaxglide._files import BusyError, WriteError, alone, replacing, write_bytes, write_text


@contextmanager
def file_size_limit(size):
    """Stands in for a full disk: no file may grow beyond `size` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def figure():
    drawn = Figure()
    drawn.add_subplot().plot(np.arange(100))
    return drawn


WRITERS = {
    "a.bin": lambda path: write_bytes(path, bytes(20_000)),
    "a.txt": lambda path: write_text(path, "ψ" * 10_000),
    "a.nc": lambda path: _files.write_netcdf(path, xr.Dataset({"x": ("t", np.arange(5000.0))})),
    "a.png": lambda path: _files.write_figure(path, figure(), dpi=200),
    "a.svg": lambda path: _files.write_figure(path, figure()),
    "a.pdf": lambda path: _files.write_figure(path, figure()),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_is_one_sentence_and_the_old_file_stays(tmp_path, name):
    path = tmp_path / name
    path.write_text("old")
    with file_size_limit(4096), pytest.raises(WriteError) as caught:
        WRITERS[name](path)
    assert str(caught.value) == f"cannot write {path}: File too large"
    assert names(tmp_path) == [name]
    assert path.read_text() == "old"
    WRITERS[name](path)
    assert path.stat().st_size > 4096
    assert names(tmp_path) == [name]


def test_what_fails_half_way_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.gif"
    path.write_text("old")

    def fail():
        with replacing(path) as beside:
            assert beside.suffix == ".gif"
            beside.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["a.gif"]


def test_modes_and_links_are_kept(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert real.stat().st_mode & 0o777 == 0o640
    mask = os.umask(0o022)
    try:
        write_text(tmp_path / "fresh.txt", "new")
    finally:
        os.umask(mask)
    assert (tmp_path / "fresh.txt").stat().st_mode & 0o777 == 0o644


def test_places_that_cannot_be_written_are_named(tmp_path):
    missing = tmp_path / "missing" / "a.txt"
    with pytest.raises(WriteError, match=f"cannot write {missing}: No such file"):
        write_text(missing, "")
    with pytest.raises(WriteError, match="it is a folder"):
        write_text(tmp_path, "")


_HOLD = """
import sys
from jaxglide._files import alone
with alone(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_one_process_at_a_time_and_a_dead_one_lets_go(tmp_path):
    path = tmp_path / "store.zarr"
    command = [sys.executable, "-c", _HOLD, str(path)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with (
            pytest.raises(BusyError, match=f"another process is at work on {path}"),
            alone(path),
        ):
            pass
        other.kill()
        other.wait()
    with alone(path), pytest.raises(BusyError), alone(path):
        pass


# Names of methods that write, and the modules whose task it is
WRITING = {"savefig", "to_netcdf", "to_zarr", "write_text", "write_bytes", "tofile", "to_csv"}
WRITING |= {"save", "savez", "dump", "print_figure"}
WRITERS_OF_THE_HOUSE = {"_files.py", "_journal.py", "store.py"}


def writes(tree):
    """Calls in a module that write a file in another way than through `_files`."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "attr", getattr(node.func, "id", None))
        modes = [ast.unparse(a) for a in (*node.args, *(k.value for k in node.keywords))]
        if name == "open" and any(re.fullmatch(r"""['"][rbt+]*[wax+].*""", m) for m in modes):
            yield ast.unparse(node)
        if name in WRITING and isinstance(node.func, ast.Attribute) and modes[:1] != ["memory"]:
            yield ast.unparse(node)


def test_files_are_written_in_one_way():
    root = Path(jaxglide.__file__).parents[1]
    folders = [root / name for name in ("jaxglide", "experiments", "benchmarks")]
    found = {
        path.relative_to(root): list(writes(ast.parse(path.read_text())))
        for folder in folders
        for path in folder.rglob("*.py")
        if path.name not in WRITERS_OF_THE_HOUSE
    }
    assert len(found) > 100
    assert not {path: calls for path, calls in found.items() if calls}
    text = "a.savefig(p); open(p, 'w'); p.open(mode='ab'); i.save(memory); p.open('rb')"
    assert len(list(writes(ast.parse(text)))) == 3
