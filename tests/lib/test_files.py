"""Files are written whole or not at all, and one process at a time holds a place."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import jaxglide
from jaxglide._lib import writing as _files
from jaxglide._lib.writing import (
    BusyError,
    WriteError,
    alone,
    replacing,
    write_bytes,
    write_text,
)


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
def test_a_full_disk_is_one_sentence_and_the_old_file_stays(tmp_path, disk_of, name):
    path = tmp_path / name
    path.write_text("old")
    with disk_of(4096), pytest.raises(WriteError) as caught:
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


def test_devices_and_what_is_read_only_are_not_replaced(tmp_path, monkeypatch):
    pipe, mine = tmp_path / "pipe", tmp_path / "mine.txt"
    os.mkfifo(pipe)
    with pytest.raises(WriteError, match=f"cannot write {pipe}: it is no ordinary file"):
        write_text(pipe, "")
    assert pipe.is_fifo()
    mine.write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root may write anything
    with pytest.raises(WriteError, match=f"cannot write {mine}: it is read-only"):
        write_text(mine, "new")
    assert mine.read_text() == "old"
    assert names(tmp_path) == ["mine.txt", "pipe"]


# A process that ends at the n-th thing it asks of the disk, for every n
_KILLED = """
import io, os, pathlib, sys
import numpy as np, xarray as xr
from matplotlib.figure import Figure
from jaxglide._lib import writing as _files

path, kind = pathlib.Path(sys.argv[1]), sys.argv[2]
figure = Figure(figsize=(1, 1))
figure.text(0, 0, "a")
data = xr.Dataset({"x": ("t", np.arange(500.0))})
write = {
    "nc": lambda: _files.write_netcdf(path, data),
    "png": lambda: _files.write_figure(path, figure),
}[kind]

def asks(call):
    owner = getattr(call, "__self__", None)
    on_disk = type(owner).__module__ == "_io" and not isinstance(owner, io.BytesIO)
    return call is io.open or owner is os.open.__self__ or on_disk

def ends_at(last, event):
    count = 0
    def see(frame, kind, call):
        nonlocal count
        if kind == event and asks(call):
            count += 1
            if count == last:
                os._exit(9)
    return see

write()
whole, seen = path.read_bytes(), []
for event in ("c_call", "c_return"):
    last, code = 0, 9
    while code == 9:
        path.write_bytes(b"old")
        last += 1
        child = os.fork()
        if not child:
            sys.setprofile(ends_at(last, event))
            write()
            sys.setprofile(None)
            os._exit(0)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        left = path.read_bytes()
        seen.append("old" if left == b"old" else "new" if left == whole else "broken")
        for other in path.parent.glob(".*"):
            other.unlink()
    assert code == 0, code
    assert last > 10, last
print(*sorted(set(seen)))
"""


@pytest.mark.parametrize("kind", ["nc", "png"])
def test_a_process_killed_at_any_moment_leaves_the_old_file_or_the_new(tmp_path, kind):
    command = [sys.executable, "-c", _KILLED, str(tmp_path / f"a.{kind}"), kind]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("new old\n", "")


_HOLD = """
import sys
from jaxglide._lib.writing import alone
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
WRITERS_OF_THE_HOUSE = {"writing.py", "journal.py", "store.py"}


def writes(tree):
    """Calls in a module that write a file in another way than through `writing`."""
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
