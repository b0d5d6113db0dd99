"""A digest of what a function computes, whatever it is called or how it is written."""

import hashlib
from collections.abc import Callable

import jax
import numpy as np


def fingerprint(function: Callable, *arguments) -> str:
    """A digest of what a function computes: of its compiled form, not of its name or text.

    Args:
        function: pure function of arrays and trees of arrays.
        *arguments: some to trace it with; their values do not matter.
    """
    traced = jax.jit(function).trace(*arguments)
    digest = hashlib.sha256(traced.lower().as_text().encode())
    for constant in traced.jaxpr.consts:
        digest.update(np.asarray(constant).tobytes())
    return digest.hexdigest()[:32]
