"""One way to write a file, and one way to keep others off it.

Whatever is written here stands beside its place first, is flushed and synced, and is then
renamed: a process killed at any moment, or a full disk, leaves the old file or the whole new
one, never half of either. Documents are made in memory, so that no library's own handling of
a full disk matters (HDF5's ends the process, Matplotlib's PDF writer says nothing).
"""

import contextlib
import io
import os
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr
    from filelock import BaseFileLock
    from matplotlib.figure import Figure


class WriteError(OSError):
    """A file that cannot be written; the message is one sentence that names it."""


class BusyError(OSError):
    """What another process is at work on; the message names it."""


@contextlib.contextmanager
def writing(path: str | Path) -> Iterator[None]:
    """Turn the disk's errors inside the block into one sentence about `path`.

    Raises:
        WriteError: instead of any other `OSError`.
    """
    try:
        yield
    except (WriteError, BusyError):
        raise
    except OSError as error:
        raise WriteError(f"cannot write {path}: {error.strerror or error}") from error


@contextlib.contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A place beside `path`, of the same ending, whose file takes the place of `path`.

    It does so, whole and synced, when the block ends well; otherwise it is removed and the
    old file stays as it was. For writers that need a file's name; others use `write_bytes`.

    Raises:
        WriteError: the disk is full, the folder is missing or not writable.
    """
    with writing(path):
        target = Path(os.path.realpath(path))
        _check_place(path, target)
        beside = target.with_name(f".{target.stem[:30]}-{secrets.token_hex(8)}{target.suffix}")
        try:
            beside.touch(exist_ok=False)
            yield beside
            sync(beside)
            if target.exists():
                shutil.copymode(target, beside)
            os.replace(beside, target)
            with contextlib.suppress(OSError):  # not every file system syncs folders
                sync(target.parent)
        finally:
            with contextlib.suppress(OSError):
                beside.unlink()


def _check_place(path: str | Path, target: Path) -> None:
    """A folder cannot be replaced; devices, pipes and what is read-only must not be."""
    if target.is_dir():
        raise WriteError(f"cannot write {path}: it is a folder")
    if target.exists() and not target.is_file():
        raise WriteError(f"cannot write {path}: it is no ordinary file")
    if target.exists() and not os.access(target, os.W_OK):
        raise WriteError(f"cannot write {path}: it is read-only")


def sync(path: Path) -> None:
    """See that a file, or the names in a folder, reach the disk."""
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def make_folder(path: str | Path) -> None:
    """Make a folder and those above it, unless it is there.

    Raises:
        WriteError: it cannot be made, or a file stands in its place.
    """
    with writing(path):
        Path(path).mkdir(parents=True, exist_ok=True)


def write_bytes(path: str | Path, data: bytes | memoryview) -> None:
    """Write a whole file; see `replacing`."""
    with replacing(path) as beside:
        beside.write_bytes(data)


def write_text(path: str | Path, text: str) -> None:
    """Write a whole file in UTF-8, line ends as they are; see `replacing`."""
    write_bytes(path, text.encode())


def write_netcdf(path: str | Path, data: "xr.Dataset") -> None:
    """Write a dataset as a NetCDF 4 file; see `replacing`.

    Coordinates have no value that stands for a missing one, as CF asks.
    """
    memory = io.BytesIO()
    whole = [name for name, values in data.coords.items() if values.dtype.kind == "f"]
    filled: Any = {name: {"_FillValue": None} for name in whole}
    data.to_netcdf(memory, engine="h5netcdf", encoding=filled)
    write_bytes(path, memory.getbuffer())


def write_figure(path: str | Path, figure: "Figure", dpi: float | None = None) -> None:
    """Write a Matplotlib figure in the format of the path's ending; see `replacing`.

    Args:
        path: .png, .pdf or .svg.
        figure: what to write.
        dpi: dots per inch, by default the figure's.
    """
    memory = io.BytesIO()
    options: dict[str, Any] = {} if dpi is None else {"dpi": dpi}
    kind: Any = Path(path).suffix.removeprefix(".")
    figure.savefig(memory, format=kind, **options)
    write_bytes(path, memory.getbuffer())


@contextlib.contextmanager
def alone(path: str | Path, *, wait: bool = False) -> "Iterator[BaseFileLock]":
    """Hold `path` for this process: no other one that asks gets it until the block ends.

    The lock is a file beside `path`; the system lets go of it when its process dies.

    Args:
        path: a file or folder, which need not exist.
        wait: until another process lets go, instead of raising at once.

    Raises:
        BusyError: another process holds it.
        WriteError: the lock cannot be made there.
    """
    from filelock import FileLock, Timeout

    target = Path(os.path.realpath(path))
    lock = FileLock(target.with_name(f".{target.name}.lock"), timeout=-1 if wait else 0)
    with writing(path):
        try:
            lock.acquire()
        except Timeout:
            raise BusyError(f"another process is at work on {path}: wait for its end") from None
    try:
        yield lock
    finally:
        lock.release()
