"""Sweeps that are killed, race, or find the disk full, their physics replaced: a program.

It forks before JAX has threads, so that a whole life takes a tenth of a second. It prints one
line of JSON: how many lives, how many file operations the longest had, and what went wrong.
"""

import contextlib
import io
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import h5netcdf  # noqa: F401  imported before the forks
import jax
import numpy as np
import tqdm.auto  # noqa: F401

from jaxglide import cli
from jaxglide.ensemble import sweep as module
from jaxglide.ensemble.layout import layout
from jaxglide.ensemble.store import precision
from jaxglide.ensemble.study import Study

jax.config.update("jax_enable_x64", True)
STUDY = Study({"nu_theta": np.linspace(1, 1.5, 40)}, fixed={"height": 0.3}, times=[0.1, 0.2])
TOML = "[grid]\nnu_theta = {start = 1, stop = 1.5, count = 40}\n[fixed]\nheight = 0.3\n"
TOML += "[solver]\ntimes = [0.1, 0.2]\n"
CHANGES = {"os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.truncate", "os.chmod"}
WIDTH = 12  # not a chunk's


def fake(study, index, width):
    """Numbers that follow from the case, in place of its flight."""
    assert len(index) <= width
    column = study.columns(index)["nu_theta"]
    found = {name: a.blank(len(index)) for name, a in layout(study, precision()).items()}
    for place, values in enumerate(found.values()):
        told = np.sin(place + column) if values.dtype.kind == "f" else 0 * column
        values[...] = told.reshape(-1, *(1,) * (values.ndim - 1))
    return found


def flown(study, index, width):
    """The same, as many at a time."""
    for first in range(0, len(index), width):
        places = np.arange(first, min(first + width, len(index)))
        yield places, fake(study, index[places], width)


module.flown = flown


def forked(life, *arguments):
    """Number of a process that lives `life(*arguments)` and ends with what it returns."""
    pid = os.fork()
    if pid:
        return pid
    code = 99
    try:
        code = life(*arguments)
    finally:
        os._exit(code or 0)


def ended(pid):
    """How a process ended: its exit code, or minus the signal."""
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def count_operations(folder, kill_at=None, told=None):
    """Count this process's changes of files in `folder`; be killed at one of them."""
    done = 0

    def one():
        nonlocal done
        done += 1
        if done == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)
        if told is not None:
            os.pwrite(told, str(done).encode(), 0)

    def hook(event, arguments):
        writes = event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)
        if (writes or event in CHANGES) and str(arguments[0]).startswith(str(folder)):
            one()

    def synced(handle, fsync=os.fsync):
        one()
        fsync(handle)

    sys.addaudithook(hook)
    os.fsync = synced


def live(folder, delay=0.0, **shim):
    time.sleep(delay)
    if shim:
        count_operations(folder, **shim)
    data = module.sweep(STUDY, folder / "s.zarr", width=WIDTH, progress=False)
    flown = fake(STUDY, np.arange(40), 40)
    return 0 if np.array_equal(data.time, flown["time"]) else 5


def files(folder):
    """Bytes of every file by name, locks apart; what killed births left shows here too."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".s.zarr.lock"
    }


def whole(folder):
    """An undisturbed life: its files and how many operations it took."""
    folder.mkdir()
    with tempfile.TemporaryFile() as told:
        assert ended(forked(lambda: live(folder, told=told.fileno()))) == 0
        told.seek(0)
        return files(folder), int(told.read())


def kills(top, expected, points, again):
    """Lives killed at each of the points, perhaps twice, that another finishes."""
    wrong = []
    for point in points:
        folder = top / f"kill{point}"
        folder.mkdir()
        codes = [ended(forked(lambda f=folder, p=point: live(f, kill_at=p)))]
        if again:
            second = random.randrange(1, 60)
            codes.append(ended(forked(lambda f=folder, p=second: live(f, kill_at=p))))
        if not set(codes) <= {0, -signal.SIGKILL} or codes[0] == 0:
            wrong.append([point, codes])
        code = ended(forked(live, folder))
        if code or files(folder) != expected:
            wrong.append([point, code, sorted(set(files(folder)) ^ set(expected))[:3]])
        shutil.rmtree(folder)
    return wrong


def pairs(top, expected, count):
    """Two lives on one new store at about the same time."""
    wrong = []
    for pair in range(count):
        folder = top / f"pair{pair}"
        folder.mkdir()
        both = [forked(live, folder, random.uniform(0, 0.2)) for _ in range(2)]
        codes = [ended(pid) for pid in both]
        if codes != [0, 0] or files(folder) != expected:
            wrong.append([pair, codes])
        shutil.rmtree(folder)
    return wrong


def command(folder, limit):
    """The command line with room for files of so many bytes; its code and complaint."""
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    complaint = io.StringIO()
    with contextlib.redirect_stderr(complaint), contextlib.redirect_stdout(io.StringIO()):
        arguments = [folder / "study.toml", "--store", folder / "s.zarr", "--width", WIDTH]
        code = cli.main(["sweep", *map(str, arguments)])
    said = complaint.getvalue().splitlines()
    if limit is None or (len(said) == 1 and f"cannot write {folder / 's.zarr'}" in said[0]):
        return code
    return 50


def full(top, expected, limits):
    """Commands that find the disk full, in turn, and one that finds room again."""
    wrong = []
    for limit in limits:
        folder = top / f"full{limit}"
        folder.mkdir()
        (folder / "study.toml").write_text(TOML)
        codes = [ended(forked(command, folder, limit))]
        left = sorted(path.name for path in folder.iterdir())
        codes.append(ended(forked(command, folder, None)))
        (folder / "study.toml").unlink()
        born = "s.zarr" in left
        if codes != [1, 0] or files(folder) != expected or born != (limit > 2000):
            wrong.append([limit, codes, left])
    return wrong


def main():
    what, number = sys.argv[1], int(sys.argv[2])
    random.seed(int(sys.argv[3]))
    with tempfile.TemporaryDirectory() as top:
        top = Path(top)
        expected, operations = whole(top / "whole")
        if what == "kills":
            points = range(1, operations + 1)
            every = number >= operations
            points = points if every else sorted(random.sample(points, number))
            lives, wrong = len(points), kills(top, expected, points, every)
        elif what == "pairs":
            lives, wrong = number, pairs(top, expected, number)
        else:
            limits = (0, 100, 1000, 3000)
            lives, wrong = len(limits), full(top, expected, limits)
    print(json.dumps({"lives": lives, "operations": operations, "wrong": wrong}))


if __name__ == "__main__":
    main()
