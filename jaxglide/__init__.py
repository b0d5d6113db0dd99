"""jaxglide: the flight dynamics of flying snakes, differentiable.

Set `jax.config.update("jax_enable_x64", True)` before use: results are quoted in float64.

The names stand in `__init__.pyi`, and are imported on first use, so that the command line can
answer `--help` at once and set up JAX before anything loads it.
"""

import lazy_loader

from ._lib.version import VERSION as __version__  # noqa: F401

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
