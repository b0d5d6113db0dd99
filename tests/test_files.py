"""Files are written whole or not at all, and one process at a time holds a place."""

import os
import resource
import subprocess
import sys
from contextlib import contextmanager

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

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
