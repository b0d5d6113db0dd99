"""A study's results on disk, chunk by chunk.

A store is a Zarr v3 group, written here file by file, each whole and synced, uncompressed. One
array holds each result, its first axis the glides in the order in which they are solved;
`case` holds their numbers in the study. The study alone decides the size of a chunk, not the
machine. `digest` holds a SHA-256 of every finished chunk, of its place and of what the store
is, and is written after it: a chunk without one is not finished.

All that a store is born with follows from the study, the precision and the versions, byte for
byte; it is made beside its place and renamed. A folder that holds anything else is refused
before an array is read.
"""

import contextlib
import hashlib
import json
import math
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._lib.writing import BusyError, WriteError, alone, make_folder, sync, write_bytes, writing
from .layout import GLIDES, Contents, blank, bytes_of
from .plan import AbstractPlan, Plan
from .records import versions
from .steady_records import STEADY, steady_contents

_GLIDES = 16  # in a chunk, at least: less would be lost by a kill, but the disk takes its time
_CHUNKS = 1024  # at most: every one has a file of each array
_VERSIONS = ("jaxglide", "jax", "jaxlib", "diffrax", "equinox", "optimistix")  # in the results
_LARGEST = 2**28  # bytes of a study's text
_LITTER = r"-[0-9a-f]{16}"  # what `_files.replacing` and `_create` call what is not whole yet


class StoreError(ValueError):
    """A store that is another study's, another version's, or damaged."""


def precision() -> str:
    """What JAX computes in: float32 or float64."""
    return jnp.result_type(float).name


def _metadata(shape, chunks, dims, dtype, fill, about=None) -> bytes:
    """An array's description in Zarr v3."""
    record = {
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": str(dtype),
        "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunks}},
        "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
        "fill_value": "NaN" if math.isnan(fill) else int(fill),
        "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
        "dimension_names": dims,
        "attributes": about or {},
    }
    return json.dumps(record).encode()


def _read(file: Path, most: int) -> bytes | None:
    """A file of at most that many bytes, one more if it is longer; None without one."""
    try:
        if not file.is_file():  # a pipe would be waited for
            return None
        with file.open("rb") as opened:
            return opened.read(most + 1)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OSError(f"cannot read {file}: {error.strerror or error}") from error


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files at once: waiting for the disk takes no longer than for one of them."""
    for name in files:
        make_folder((folder / name).parent)
    with ThreadPoolExecutor(16) as pool:
        list(pool.map(write_bytes, (folder / name for name in files), files.values()))


def _attributes(root: bytes | None) -> dict[str, Any]:
    """Attributes in the text of a group's `zarr.json`; none if it is not such a text."""
    with contextlib.suppress(ValueError, RecursionError, LookupError, TypeError):
        return dict(json.loads(root or b"")["attributes"])
    return {}


def is_store(path: str | Path) -> bool:
    """Whether a folder says that it is the store of a sweep, of whatever version."""
    return _is_ours(_attributes(_read(Path(path) / "zarr.json", _LARGEST)))


def _is_ours(attributes: Mapping[str, Any]) -> bool:
    return str(attributes.get("format")).startswith(("jaxglide sweep", "jaxglide steady"))


def _contents_of(attributes: Mapping[str, Any]) -> Contents | None:
    """What a store keeps, by what it says of itself; None for one of no known format."""
    if attributes.get("format") == STEADY:
        return steady_contents(*(attributes[name] for name in ("starts", "most", "step")))
    return GLIDES if attributes.get("format") == GLIDES.format else None


class Store:
    """The store of a study in a folder, which need not exist yet; see `opened` and `load`.

    Args:
        path: the folder.
        study: whose results it holds.
        root: bytes of the group's `zarr.json`; by default those of a new store.
        contents: what it keeps of every case.
    """

    def __init__(
        self,
        path: str | Path,
        study: AbstractPlan,
        root: bytes | None = None,
        contents: Contents = GLIDES,
    ):
        self.path = Path(path)
        self.study, self.contents = study, contents
        told = versions()
        self.attributes = _attributes(root) or {
            "format": contents.format,
            "study": study.to_json(),
            **contents.settings,
            "precision": precision(),
            **{name: told[name] for name in map("version_{}".format, _VERSIONS)},
        }
        group = {"zarr_format": 3, "node_type": "group", "attributes": self.attributes}
        self._root = root or json.dumps(group).encode()
        self._identity = hashlib.sha256(self._root).digest()
        self.size = math.prod(study.shape)
        self.chunk = min(max(_GLIDES, -(-self.size // _CHUNKS)), self.size)
        self.chunks = -(-self.size // self.chunk)
        self.layout = contents.layout(study, self.attributes["precision"])

    def rows(self, chunk: int) -> slice:
        """Places of a chunk's glides in the order in which they are solved."""
        return slice(chunk * self.chunk, min((chunk + 1) * self.chunk, self.size))

    def _born(self) -> dict[str, bytes]:
        """Every file of a new store, by name."""
        n, c = self.size, self.chunk
        files = {"zarr.json": self._root}
        for name, a in self.layout.items():
            shapes = (n, *a.shape), (c, *a.shape), ("glide", *a.dims)
            files[f"{name}/zarr.json"] = _metadata(*shapes, a.dtype, a.fill, a.about)
        shapes = (self.chunks, 32), (1, 32), ("chunk", "byte")
        files["digest/zarr.json"] = _metadata(*shapes, "uint8", 0)
        files["case/zarr.json"] = _metadata((n,), (n,), ("glide",), "int64", -1)
        files["case/c/0"] = self.study.order().astype("<i8").tobytes()
        return files

    def exists(self) -> bool:
        """Whether there is anything at its place."""
        return self.path.exists() and not (self.path.is_dir() and not any(self.path.iterdir()))

    def check(self) -> None:
        """Raise `StoreError` unless the folder holds a store of this study."""
        root = _read(self.path / "zarr.json", max(_LARGEST, len(self._root)))
        found = _attributes(root)
        away = "choose another place, or delete it"
        if not _is_ours(found):
            raise StoreError(f"{self.path} exists and is not the store of a sweep: {away}")
        if found.get("format") != self.contents.format:
            raise StoreError(
                f"{self.path} holds other results, or was made by another version of jaxglide: "
                f"{away}"
            )
        if found.get("study") != self.attributes["study"]:
            raise StoreError(f"{self.path} holds another study: {away}")
        for name, wanted in self.attributes.items():
            if found.get(name) != wanted:
                was = str(found.get(name))[:50]
                raise StoreError(
                    f"{self.path} was made with {name} {was}, this is {wanted}: finish it "
                    "with the same, or choose another place"
                )
        for name, wanted in self._born().items():
            if _read(self.path / name, len(wanted)) != wanted:
                said = f"its {name} is not what this study makes"
                raise StoreError(f"{self.path} is damaged: {said}: {away}")

    def create(self) -> None:
        """Make the store, whole and synced, where nothing is.

        Raises:
            WriteError: the disk is full or not writable; then there is nothing.
        """
        target = Path(os.path.realpath(self.path))
        if target == Path.cwd():  # which cannot be replaced under those who stand in it
            raise StoreError(f"{self.path} is the current folder: give another one")
        beside = target.with_name(f".{target.name}-{secrets.token_hex(8)}")
        try:
            with writing(self.path):
                _write(beside, self._born())
                sync(beside)
                with contextlib.suppress(FileNotFoundError):
                    target.rmdir()  # an empty one: some systems do not rename over it
                beside.rename(target)
                sync(target.parent)
        except WriteError as error:  # of a file that nobody asked for
            said = str(error).replace(str(beside), str(self.path))
            raise WriteError(said) from error
        finally:
            shutil.rmtree(beside, ignore_errors=True)

    def tidy(self) -> None:
        """Remove what killed processes left unfinished; only for who holds the lock."""
        target = Path(os.path.realpath(self.path))
        for folder in target.parent.iterdir():
            if re.fullmatch(re.escape(f".{target.name}") + _LITTER, folder.name):
                shutil.rmtree(folder, ignore_errors=True)
        for folder, _, files in os.walk(target):
            for name in files:
                if re.fullmatch(r"\.\w+" + _LITTER, name):
                    (Path(folder) / name).unlink(missing_ok=True)

    def _file(self, name: str, chunk: int) -> str:
        return f"{name}/c/{chunk}" + "/0" * len(self.layout[name].shape)

    def _digest(self, files: Mapping[str, bytes]) -> bytes:
        """Of what the store is and of a chunk's files; their names tell its place."""
        total = hashlib.sha256(self._identity)
        for name, content in files.items():
            total.update(f"{name} {len(content)} ".encode() + content)
        return total.digest()

    def finished(self) -> np.ndarray:
        """Which chunks say that they are finished, (chunks,)."""
        files = (self.path / f"digest/c/{chunk}/0" for chunk in range(self.chunks))
        return np.array([file.exists() for file in files])

    def read(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Results by name in solving order, (N, ...), and which chunks are there, (chunks,).

        Raises:
            StoreError: a finished chunk does not match its digest.
            OSError: one cannot be read.
        """
        kind, done = self.attributes["precision"], self.finished()
        flown = blank(self.study, kind, self.contents)
        for chunk in map(int, np.flatnonzero(done)):
            values = self._read_chunk(chunk)
            if values is None:
                raise StoreError(
                    f"{self.path} is damaged: chunk {chunk} does not match its digest; without "
                    f"the file {self.path / f'digest/c/{chunk}/0'} it is computed anew"
                )
            for name, value in values.items():
                flown[name][self.rows(chunk)] = value
        return flown, done

    def _read_chunk(self, chunk: int) -> dict[str, np.ndarray] | None:
        """Results of one chunk, or None if they are not what was written."""
        rows, files, values = self.rows(chunk), {}, {}
        for name, array in self.layout.items():
            shape = (self.chunk, *array.shape)
            size = math.prod(shape) * array.dtype.itemsize
            file = self._file(name, chunk)
            content = _read(self.path / file, size)
            if content is None or len(content) != size:
                return None
            files[file] = content
            whole = np.frombuffer(content, array.dtype).reshape(shape)
            values[name] = whole[: rows.stop - rows.start]
        told = _read(self.path / f"digest/c/{chunk}/0", 32)
        return values if told == self._digest(files) else None

    def write(self, chunk: int, values: Mapping[str, np.ndarray]) -> None:
        """Write one chunk, then mark it finished.

        Args:
            chunk: its number.
            values: its results by name, each (glides, ...).

        Raises:
            WriteError: the disk is full or not writable; finished chunks are intact.
        """
        files = {}
        for name, array in self.layout.items():
            whole = array.blank(self.chunk)
            whole[: len(values[name])] = values[name]
            files[self._file(name, chunk)] = whole.tobytes()
        try:
            _write(self.path, files)
            _write(self.path, {f"digest/c/{chunk}/0": self._digest(files)})
        except WriteError as error:
            raise WriteError(
                f"{error}; finished chunks of {self.path} are kept: run the same study again"
            ) from error


def check_memory(what: str | Path, size: int) -> None:
    """Raise `StoreError` for results that this machine's memory does not hold twice."""
    memory = 2**34  # where the system does not tell
    with contextlib.suppress(AttributeError, ValueError, OSError):
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if 2 * size > memory:
        raise StoreError(
            f"{what} holds {size / 1e9:.3g} GB: more than half of this machine's memory of "
            f"{memory / 1e9:.3g} GB"
        )


@contextlib.contextmanager
def opened(
    path: str | Path, study: AbstractPlan, tell: bool = True, contents: Contents = GLIDES
) -> Iterator[Store]:
    """The store of a study, made if there is none, held until the block ends.

    Another process that asks for it waits, and then finds what this one did. A complete store
    is not held: it may lie where nothing can be written.

    Args:
        path: the folder.
        study: whose results it holds.
        tell: say on standard error that this process waits for another.
        contents: what it keeps of every case.

    Raises:
        StoreError: the folder holds something else, another study, or results of another
            precision or version.
        WriteError: it cannot be written.
    """
    store = Store(path, study, contents=contents)
    if store.exists():
        store.check()
        if store.finished().all():
            yield store
            return
    make_folder(store.path.parent)
    with contextlib.ExitStack() as stack:
        try:
            stack.enter_context(alone(path))
        except BusyError:
            if tell:
                print(f"waiting for another process at work on {path}", file=sys.stderr)
            stack.enter_context(alone(path, wait=True))
        store.tidy()
        if store.exists():
            store.check()
        else:
            store.create()
        yield store


def load(path: str | Path) -> Store:
    """A store by what it says of itself, to be read.

    Raises:
        StoreError: it is not one of this format, or its parts do not fit together.
    """
    root = _read(Path(path) / "zarr.json", _LARGEST)
    found = _attributes(root)
    try:
        contents = _contents_of(found)
        if contents is None:
            raise StoreError(f"{path} is not a store that this version of jaxglide makes")
        study = Plan.from_json(found["study"])
        if found["precision"] not in ("float32", "float64"):
            raise ValueError(f"precision {found['precision']}")
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise StoreError(f"{path} is damaged: its study cannot be read ({error})") from error
    store = Store(path, study, root, contents)
    check_memory(path, bytes_of(study, found["precision"], contents))
    store.check()
    return store
