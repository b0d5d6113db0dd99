"""One way to time things: warm-up, blocking on outputs, median and quartiles, JSON.

By the clock, and in processor time, which other work on the machine changes less.
"""

import json
import os
import platform
import time
from importlib import metadata
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxglide._lib.writing import make_folder, write_text

RESULTS = Path(__file__).parent / "results"


def measure(function, *arguments, repeats: int = 15, inner: int = 1) -> dict[str, float]:
    """Time `function(*arguments)`; outputs are waited for.

    Args:
        function: what to time.
        repeats: timed calls after one that compiles and one that warms up.
        inner: how many units of work one call does; times are per unit.

    Returns:
        first_s (compilation and the first call), median_s, lower_s and upper_s (quartiles),
        processor_s (median of the time of all threads).
    """
    begin = time.perf_counter()
    jax.block_until_ready(function(*arguments))
    first = time.perf_counter() - begin
    jax.block_until_ready(function(*arguments))
    times = []
    for _ in range(repeats):
        begin = np.array([time.perf_counter(), time.process_time()])
        jax.block_until_ready(function(*arguments))
        times.append([time.perf_counter(), time.process_time()] - begin)
    clock, processor = np.array(times).T / inner
    lower, median, upper = np.quantile(clock, [0.25, 0.5, 0.75])
    found = {"first_s": first, "median_s": median, "lower_s": lower, "upper_s": upper}
    return {**found, "processor_s": float(np.median(processor))}


def machine() -> dict[str, Any]:
    """What the numbers were measured on."""
    model = platform.processor()
    info = Path("/proc/cpuinfo")
    if info.exists():
        lines = info.read_text().splitlines()
        model = next(
            (x.split(":")[1].strip() for x in lines if x.startswith("model name")), model
        )
    names = ("jaxglide", "jax", "jaxlib", "diffrax", "equinox", "numpy", "scipy")
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "devices": [f"{d.platform} {d.device_kind}" for d in jax.devices()],
        "python": platform.python_version(),
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
        "versions": {name: metadata.version(name) for name in names},
    }


def report(name: str, rows: list[dict[str, Any]]) -> None:
    """Print rows as a table and write them with the machine to results/NAME.json."""
    make_folder(RESULTS)
    record = {"benchmark": name, "machine": machine(), "rows": rows}
    write_text(RESULTS / f"{name}.json", json.dumps(record, indent=1) + "\n")
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns] + [[_format(row.get(column)) for column in columns] for row in rows]
    widths = [max(len(line[i]) for line in cells) for i in range(len(columns))]
    for line in cells:
        print("  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)))


def _format(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else "" if value is None else str(value)
