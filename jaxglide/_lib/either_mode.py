"""One solve, differentiable in forward and in reverse mode."""

from collections.abc import Callable
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.tree_util as jtu
from jax.flatten_util import ravel_pytree


def either_mode(solve: Callable[..., Any]) -> Callable[..., Any]:
    """A function around Diffrax solves with a derivative that works in both modes.

    A Diffrax solve can be differentiated in one mode only, chosen beforehand. Here the
    rule for tangents computes the Jacobian with respect to what is perturbed, in the mode
    that is cheaper, and multiplies by it; the product can be transposed, so `grad`,
    `jacfwd` and both under `vmap` work on the same function. The Jacobian by forward mode is
    such a function again: derivatives of any order exist, in any combination of modes. That by
    reverse mode, taken where more numbers are perturbed than come out, ends there: of it there
    is no further derivative.

    Args:
        solve: pure function of positional arguments, of `adjoint`, the Diffrax adjoint to
            solve with, and of keyword arguments that are not differentiated.

    Returns:
        The function without `adjoint`.
    """

    @eqx.filter_custom_jvp
    def run(*arguments, **settings):
        return solve(*arguments, adjoint=diffrax.ForwardMode(), **settings)

    @run.def_jvp
    def _(primals, tangents, **settings):
        moved, fixed = eqx.partition(
            primals,
            jtu.tree_map(lambda t: t is not None, tangents, is_leaf=lambda t: t is None),
        )
        point, unravel = ravel_pytree(moved)
        direction, _ = ravel_pytree(tangents)

        # What is not differentiated may be traced too: a rule in a rule must be given it.
        def outputs(x, fixed, settings, adjoint):
            solved = solve(*eqx.combine(unravel(x), fixed), adjoint=adjoint, **settings)
            return ravel_pytree(eqx.filter(solved, eqx.is_inexact_array))[0], solved

        forward = diffrax.ForwardMode()
        size = jax.eval_shape(lambda x: outputs(x, fixed, settings, forward)[0], point).size
        if point.size <= size:
            slopes = either_mode(jax.jacfwd(outputs, has_aux=True))
            jacobian, solved = slopes(point, fixed, settings)
        else:
            backward = diffrax.RecursiveCheckpointAdjoint()
            slopes = jax.jacrev(outputs, has_aux=True)
            jacobian, solved = slopes(point, fixed, settings, backward)
        floats, rest = eqx.partition(solved, eqx.is_inexact_array)
        tangent = ravel_pytree(floats)[1](jacobian @ direction)
        return solved, eqx.combine(tangent, jtu.tree_map(lambda _: None, rest))

    return run
