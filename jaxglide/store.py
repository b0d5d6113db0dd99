"""A study's results on disk, chunk by chunk (floor 5).

A Zarr group holds one array per result, its first axis the glides in the order in which
they are solved, in chunks of the sweep's batches. The array `digest` holds a SHA-256 of
every finished chunk and is written after it: a chunk without one is not finished.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import zarr

from .records import versions
from .study import Study

_FORMAT = "jaxglide sweep 1"


class StoreError(ValueError):
    """A store that is another study's, another version's, or damaged; or not writable."""


def _digest(values: Mapping[str, np.ndarray]) -> np.ndarray:
    total = hashlib.sha256()
    for name in sorted(values):
        total.update(name.encode())
        total.update(np.ascontiguousarray(values[name]).tobytes())
    return np.frombuffer(total.digest(), dtype=np.uint8)


class Store:
    """A study's results in a folder.

    Args:
        path: the folder.
        study: whose results it holds.
        width: glides per chunk.
        template: one result of every name without its first axis, for shapes and types.

    Raises:
        StoreError: the folder holds something else, another study, results of another
            version, or damaged ones; or it cannot be written.
    """

    def __init__(
        self, path: str | Path, study: Study, width: int, template: Mapping[str, np.ndarray]
    ):
        self.path = Path(path)
        self.study = study
        self.width = width
        self.chunks = -(-len(study) // width)
        self.names = sorted(template)
        try:
            if self.path.exists() and any(self.path.iterdir()):
                self.group = self._open()
            else:
                self.group = self._create(template)
        except OSError as error:
            raise StoreError(f"cannot use the store {path}: {error}") from error

    def _attributes(self) -> dict:
        return {
            "format": _FORMAT,
            "study": self.study.to_json(),
            "fingerprint": self.study.fingerprint,
            "width": self.width,
            **versions(),
        }

    def _create(self, template) -> zarr.Group:
        # Attributes come last: a store without them was killed while it was made.
        group = zarr.open_group(str(self.path), mode="w", zarr_format=3)
        for name in self.names:
            value = np.asarray(template[name])
            group.create_array(
                name,
                shape=(len(self.study), *value.shape),
                chunks=(min(self.width, len(self.study)), *value.shape),
                dtype=value.dtype,
                fill_value=np.nan if value.dtype.kind == "f" else -1,
            )
        group.create_array(
            "digest", shape=(self.chunks, 32), chunks=(1, 32), dtype="uint8", fill_value=0
        )
        group.attrs.update(self._attributes())
        return group

    def _open(self) -> zarr.Group:
        try:
            group = zarr.open_group(str(self.path), mode="r+")
            found = dict(group.attrs)
        except OSError:
            raise
        except Exception as error:
            raise StoreError(f"{self.path} is not a store, or damaged: {error}") from error
        if found.get("format") != _FORMAT:
            raise StoreError(
                f"{self.path} exists and is not a finished store of a sweep: "
                "choose another place, or delete it"
            )
        if found.get("fingerprint") != self.study.fingerprint:
            raise StoreError(
                f"{self.path} holds another study: choose another place, or delete it"
            )
        for name, wanted in self._attributes().items():
            if found.get(name) != wanted:
                raise StoreError(
                    f"{self.path} was made with {name} {found.get(name)}, this is {wanted}: "
                    "finish it with the same, or choose another place"
                )
        return group

    def finished(self) -> np.ndarray:
        """Which chunks are finished, (chunks,), each verified by its digest.

        Raises:
            StoreError: a finished chunk does not match its digest, or cannot be read.
        """
        try:
            digests = np.asarray(self.group["digest"][:])  # type: ignore[index]
            done = digests.any(axis=1)
            for chunk in np.flatnonzero(done):
                if not np.array_equal(_digest(self.read(int(chunk))), digests[chunk]):
                    raise StoreError(
                        f"{self.path} is damaged: chunk {chunk} does not match its digest"
                    )
        except StoreError:
            raise
        except Exception as error:
            raise StoreError(f"{self.path} is damaged: {error}") from error
        return np.asarray(done)

    def _rows(self, chunk: int) -> slice:
        return slice(chunk * self.width, min((chunk + 1) * self.width, len(self.study)))

    def read(self, chunk: int | None = None) -> dict[str, np.ndarray]:
        """Results by name, of one chunk or of all, in solving order."""
        rows = slice(None) if chunk is None else self._rows(chunk)
        return {name: np.asarray(self.group[name][rows]) for name in self.names}  # type: ignore

    def write(self, chunk: int, values: Mapping[str, np.ndarray]) -> None:
        """Write one chunk, then mark it finished.

        Raises:
            StoreError: the disk is full or not writable; finished chunks are intact.
        """
        try:
            for name in self.names:
                self.group[name][self._rows(chunk)] = values[name]  # type: ignore[index]
            self.group["digest"][chunk] = _digest(values)  # type: ignore[index]
        except OSError as error:
            raise StoreError(
                f"cannot write chunk {chunk} to {self.path}: {error}. Finished chunks are "
                "intact; run the same study again to go on."
            ) from error
