"""Multipliers of a cycle in pieces."""

import numpy as np

_SWEEPS = 10
_ROUNDING = 1e-13


def multipliers_of(slopes: np.ndarray) -> np.ndarray:
    """Eigenvalues of a product of matrices, the largest first, (n,).

    Multiplied out, the small ones would drown in the rounding of the large: over a slow cycle
    they are 1e100 apart. So the directions are carried round the cycle and made orthogonal
    behind every piece, a few times over: what is left of the product is then graded by its
    rows, and small eigenvalues are as exact as large ones.

    Args:
        slopes: the factors, the first to act first, (k, n, n).
    """
    start = turned = np.eye(slopes.shape[-1])
    product = np.eye(slopes.shape[-1])
    for _ in range(_SWEEPS):
        start, product = turned, np.eye(slopes.shape[-1])
        for factor in slopes:
            turned, upper = np.linalg.qr(factor @ turned)
            product = upper @ product
    turn = start.T @ turned
    turn[np.abs(turn) < _ROUNDING] = 0  # lest it mix what is large into what is small
    values = np.linalg.eigvals(turn @ product)
    return values[np.argsort(-np.abs(values), kind="stable")].astype(complex)
