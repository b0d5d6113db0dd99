"""What the experiments share: command line, tables, figures."""

import argparse
import json
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from jaxglide._lib.writing import (
    WriteError,
    make_folder,
    write_figure,
    write_netcdf,
    write_text,
)
from jaxglide.cli import configure

configure()  # before anything loads JAX


def _say(kind, error, trace) -> None:
    """A full disk is one sentence; everything else shows where it happened."""
    if issubclass(kind, WriteError):
        print(f"jaxglide: {error}", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)


sys.excepthook = _say


@dataclass
class Options:
    """Where results go, and how large the experiment is.

    Attributes:
        out: folder of tables and figures, made if need be.
        resume: whether stores are kept in it, so that a killed run goes on.
        size: number asked for with --size, or None.
    """

    out: Path
    resume: bool
    size: int | None

    def store(self, name: str) -> Path | None:
        """Folder of a sweep's store, or None."""
        return self.out / f"{name}.zarr" if self.resume else None


def arguments(description: str | None) -> Options:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=description)
    script = Path(sys.argv[0]).stem
    parser.add_argument("--out", type=Path, help=f"folder (results/{script})")
    parser.add_argument("--resume", action="store_true", help="keep stores, go on if killed")
    parser.add_argument("--size", type=int, help="number of glides, where it can be chosen")
    text = "replace the results in the default folder"
    parser.add_argument("--force", action="store_true", help=text)
    given = parser.parse_args()
    out = given.out or Path("results") / script
    make_folder(out)
    if not (given.out or given.force or given.resume) and any(out.iterdir()):
        ways = "give a folder with --out, --force to replace them, or --resume to go on"
        parser.exit(2, f"jaxglide: {out} holds results: {ways}\n")
    print(f"jaxglide: results go to {out}", file=sys.stderr)
    return Options(out, given.resume, given.size)


def flights() -> xr.Dataset:
    """The measured flights of the public data folder that JAXGLIDE_FLIGHTS names."""
    folder = os.environ.get("JAXGLIDE_FLIGHTS")
    if not folder:
        raise SystemExit("set JAXGLIDE_FLIGHTS to a folder with the study's public recordings")
    from jaxglide.measured import flights_dataset, measure_folder

    return flights_dataset(measure_folder(folder, progress=True))


def _text(value) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def write_table(path: Path, header: Sequence[str], rows: Sequence[Sequence]) -> None:
    """Print a table and write it as Markdown and JSON (`path` without ending).

    Where the last two columns are ours and the published value, their difference is added.
    """
    if header[-2:] == ("jaxglide", "published"):
        header = (*header, "difference")
        rows = [(*row, row[-2] - row[-1]) for row in rows]
    if len(set(header)) < len(header):
        raise ValueError(f"two columns have one name, and one would be lost: {header}")
    lines = [list(header), ["---"] * len(header)]
    lines += [[_text(value) for value in row] for row in rows]
    text = "\n".join("| " + " | ".join(line) + " |" for line in lines)
    print(text)
    write_text(path.with_suffix(".md"), text + "\n")
    print(f"wrote {path.with_suffix('.md')}")
    records = [dict(zip(header, map(_plain, row), strict=True)) for row in rows]
    write_text(path.with_suffix(".json"), json.dumps(records, indent=1) + "\n")
    print(f"wrote {path.with_suffix('.json')}")


def _plain(value):
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and value != value else value


def save_dataset(data: xr.Dataset, path: Path) -> None:
    """Write a dataset and say so."""
    write_netcdf(path, data)
    print(f"wrote {path}")


def save_figure(figure, path: Path) -> None:
    """Write a figure and say so."""
    write_figure(path, figure)
    print(f"wrote {path}")
