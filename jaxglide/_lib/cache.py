"""JAX's cache of compiled code, kept in a folder from one process to the next."""

import os
import warnings
from pathlib import Path

LEAST = 0.2
"""Compilations that took less are not kept [s]."""


def cache_folder() -> str | None:
    """The folder of compiled code; none for a user without a home, whom no other may serve."""
    try:
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None
    return str(home / "jaxglide")


def quiet() -> None:
    """No page of hints, which XLA logs as an error where it loads what was compiled."""
    os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"
    warnings.filterwarnings("ignore", message=".*persistent compilation cache.*")


def cache(folder: str | os.PathLike | None = None) -> None:
    """Keep compiled code in a folder, where later processes find it.

    Call it once, before anything is computed. The command line does so by itself. What calls
    back to Python is not kept: a flight with `times` or a trim does, unless the environment
    says `EQX_ON_ERROR=off` when Python starts.

    Args:
        folder: by default the command line's, `jaxglide` among the user's caches.

    Raises:
        ValueError: there is no such folder, as the user has no home.

    Examples:
        >>> import tempfile
        >>> import jax
        >>> import jaxglide
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     jaxglide.cache(folder)
        ...     print(jax.config.jax_compilation_cache_dir == folder)
        ...     jax.config.update("jax_compilation_cache_dir", None)  # the folder goes
        ...
        True
    """
    quiet()
    import jax
    from jax.experimental.compilation_cache import compilation_cache

    folder = cache_folder() if folder is None else os.fspath(folder)
    if folder is None:
        raise ValueError("folder = None is not allowed of a user without a home: give one")
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST)
    compilation_cache.reset_cache()  # JAX has looked for one already, if it has compiled
