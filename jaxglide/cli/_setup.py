"""JAX for the command line, not loaded here: float64, a cache of compiled code."""

import contextlib
import os
import sys
from typing import Any

from .._lib.cache import LEAST, cache_folder, quiet

_XLA_FLAGS = ("--xla_cpu_prefer_vector_width=512",)
"""Measured in benchmarks/README.md; a user's own XLA_FLAGS win."""


def configure() -> None:
    """Set up JAX for the command line: float64, a cache of compiled code."""
    given = os.environ.get("XLA_FLAGS", "")
    names = given.replace("=", " ").split()
    flags = [flag for flag in _XLA_FLAGS if flag.split("=")[0] not in names]
    os.environ["XLA_FLAGS"] = " ".join([given, *flags]).strip()
    quiet()
    # Checks within compiled code call back to Python, and what does is not kept in the cache.
    # Arguments are checked before; nothing raises from there on.
    os.environ.setdefault("EQX_ON_ERROR", "off")
    # No figure is shown here, and a notebook's backend may be one that is not installed.
    os.environ["MPLBACKEND"] = "agg"
    settings: dict[str, Any] = {
        "jax_enable_x64": True,
        "jax_persistent_cache_min_compile_time_secs": LEAST,
    }
    if not os.environ.get("JAX_COMPILATION_CACHE_DIR") and (folder := cache_folder()):
        settings["jax_compilation_cache_dir"] = folder
    _set(settings)


def _set(settings: dict[str, Any]) -> None:
    """Settings of JAX, which reads them from the environment where it is not loaded yet."""
    if "jax" not in sys.modules:
        os.environ.update({name.upper(): str(value) for name, value in settings.items()})
        return
    import jax

    for name, value in settings.items():
        with contextlib.suppress(RuntimeError):  # JAX is at work already: its devices stay
            jax.config.update(name, value)
