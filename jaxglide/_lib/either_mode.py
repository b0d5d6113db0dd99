"""One solve, differentiable in forward and in reverse mode."""

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import ShapedArray
from jax.custom_derivatives import SymbolicZero
from jax.extend.core import Primitive
from jax.flatten_util import ravel_pytree
from jax.interpreters import ad, batching, mlir
from jax.interpreters import partial_eval as pe

_CHECKPOINTS = diffrax.RecursiveCheckpointAdjoint()
_FEW = 6  # numbers, of which forward mode costs less than reverse mode


def either_mode(
    solve: Callable[..., Any], backward: diffrax.AbstractAdjoint = _CHECKPOINTS
) -> Callable[..., Any]:
    """A function around Diffrax solves with a derivative that works in both modes.

    A Diffrax solve can be differentiated in one mode only, chosen beforehand. Here values and
    tangents are computed together, in forward mode. Where JAX is about to transpose, which it
    tells by asking for the values before the directions, the values are computed so that
    cotangents can be pulled back: in reverse mode, or, where few numbers are perturbed, with
    their Jacobian by forward mode. So `grad`, `jacfwd` and both under `vmap` work on the same
    function, each at its own cost. Derivatives of any order exist in any combination of modes;
    beyond the first, what is transposed is a Jacobian by forward mode.

    Args:
        solve: pure function of positional arguments, of `adjoint`, the Diffrax adjoint to
            solve with, and of keyword arguments that are not differentiated.
        backward: the adjoint of reverse mode.

    Returns:
        The function without `adjoint`.
    """

    @eqx.filter_custom_jvp
    def run(*arguments, **settings):
        return solve(*arguments, adjoint=diffrax.ForwardMode(), **settings)

    @run.def_jvp
    def _(primals, tangents, **settings):
        moving = jax.tree.map(lambda t: t is not None, tangents, is_leaf=lambda t: t is None)
        moved, held = eqx.partition(primals, moving)
        # What is not differentiated may be traced too: it must be given.
        arrays, static = eqx.partition((held, settings), eqx.is_array)
        (point, shape), (fixed, given) = map(jax.tree.flatten, (moved, arrays))
        kind = []

        def flat(point, fixed, adjoint):
            moved, arrays = shape.unflatten(point), given.unflatten(fixed)
            held, settings = eqx.combine(arrays, static)
            solved = solve(*eqx.combine(moved, held), adjoint=adjoint, **settings)
            floats, rest = eqx.partition(solved, eqx.is_inexact_array)
            others, plain = eqx.partition(rest, eqx.is_array)
            (floats, outside), (others, beside) = map(jax.tree.flatten, (floats, others))
            kind[:] = [(outside, beside, plain)]
            return floats, others

        rule = _Rule.of(flat, backward)
        values, others, rates = _both(rule, point, jax.tree.leaves(tangents), fixed)
        outside, beside, plain = kind[0]
        solved = eqx.combine(outside.unflatten(values), beside.unflatten(others), plain)
        tangent = outside.unflatten(rates)
        return solved, tangent

    return run


class _Rule:
    """How a function of lists of arrays is differentiated.

    Of floats, `point`, and of what is held, `fixed`, it gives floats and other arrays.

    Args:
        both: of point, direction and fixed: floats, others, and tangents of the floats.
        forward: of point and fixed: floats, others, and what is kept for the way back.
        back: of cotangents, point, fixed and what was kept: cotangents of the point.
        pull: of cotangents, point and fixed the same, differentiable in any mode.
        second: the rule of `both`, from which of point, direction and fixed move, in a row.
        jacobian: `forward` and `back` with a Jacobian by forward mode.
        batch: whether it is that of a batch.
    """

    def __init__(self, both, forward, back, pull, second, jacobian, batch=False):
        self.both = jax.jit(both)  # traced once for the same shapes
        self.back, self.pull, self.second = back, pull, second
        self.jacobian, self.batch = jacobian, batch
        self.forward = jax.custom_jvp(forward)
        self.forward.defjvp(self._forward_jvp, symbolic_zeros=True)

    def _forward_jvp(self, primals, tangents):
        """What is kept gets no tangents: `back` is never differentiated."""
        out = self.forward(*primals)

        def values(point, fixed):
            return _both(self, point, [jnp.zeros_like(x) for x in point], fixed)[0]

        rates = _jvp_of_some(values, primals, tangents)
        return out, (rates, *jax.tree.map(_no_tangent, out[1:]))

    @classmethod
    def of(cls, solve, backward: diffrax.AbstractAdjoint | None) -> "_Rule":
        """Of a function of point, fixed and an adjoint; `backward` is that of reverse mode,
        None where a Jacobian by forward mode is transposed instead."""
        forward_mode, pulled = diffrax.ForwardMode(), []

        def both(point, direction, fixed):
            function = lambda *point: solve(point, fixed, forward_mode)  # noqa: E731
            floats, rates, others = jax.jvp(
                function, tuple(point), tuple(direction), has_aux=True
            )
            return floats, others, rates

        def few(point) -> bool:
            return backward is None or sum(map(jnp.size, point)) <= _FEW

        def forward(point, fixed):
            if few(point):
                return with_jacobian(point, fixed)
            floats, back, others = jax.vjp(
                lambda point: solve(point, fixed, backward), point, has_aux=True
            )
            kept, shape = jax.tree.flatten(back)
            pulled[:] = [shape]
            return floats, others, kept

        def pull(cotangents, point, fixed):
            through = lambda *given: _both(rule, *given)  # noqa: E731
            return _transposed(_with_jacobian(through, point, fixed)[2], cotangents, point)

        def back(cotangents, point, fixed, kept):
            if few(point):
                return _transposed(kept, cotangents, point)
            return pulled[0].unflatten(kept)(cotangents)[0]

        def second(moving, sizes):
            def apart(point, fixed, _):
                moved, held = iter(point), iter(fixed)
                row = [next(moved if m else held) for m in moving]
                floats, others, rates = rule.both(*_parted(row, sizes))
                return [*floats, *rates], others

            return cls.of(apart, None)

        def with_jacobian(point, fixed):
            return _with_jacobian(rule.both, point, fixed)

        def across(cotangents, point, fixed, kept):
            return _transposed(kept, cotangents, point)

        rule = cls(both, forward, back, pull, second, (with_jacobian, across))
        return rule

    def batched(self, size: int, point, direction, fixed, kept=None) -> "_Rule":
        """Of many, along axes of point, direction and fixed, None where one holds for all; the
        axis of all else is in front. `kept` are those of what was kept, if anything was yet.
        Of batches in a batch a Jacobian is, for Diffrax's checkpoints allow no axis more."""

        def many(function, *axes):
            return jax.vmap(function, axes, axis_size=size)

        def of_direction(function):
            def cotangents(*given):
                pairs = zip(function(*given), direction, strict=True)
                return [
                    jnp.sum(x, axis=0) if axis is None else jnp.moveaxis(x, 0, axis)
                    for x, axis in pairs
                ]

            return cotangents

        def second(moving, sizes):
            axes = list(zip([*point, *direction, *fixed], moving, strict=True))
            moved, held = ([a for a, m in axes if m is which] for which in (True, False))
            return self.second(moving, sizes).batched(size, moved, moved, held)

        jacobian = (
            many(self.jacobian[0], point, fixed),
            of_direction(many(self.jacobian[1], 0, point, fixed, 0)),
        )
        if kept is None and self.batch:
            forward, back = jacobian
        else:
            forward = many(self.forward, point, fixed)
            places = 0 if kept is None else kept
            back = of_direction(many(self.back, 0, point, fixed, places))
        both = many(self.both, point, direction, fixed)
        pull = of_direction(many(self.pull, 0, point, fixed))
        return _Rule(both, forward, back, pull, second, jacobian, batch=True)


def _with_jacobian(both, point, fixed):
    """Floats and others of `both`, and the Jacobian of each float by the point, (n, ...)."""
    flat, unravel = ravel_pytree(list(point))
    along = jax.vmap(lambda e: both(point, unravel(e), fixed), out_axes=(None, None, 0))
    return along(jnp.eye(flat.size, dtype=flat.dtype))


def _transposed(jacobian, cotangents, point) -> list:
    """Cotangents of the point, of those of the floats."""
    pairs = zip(jacobian, cotangents, strict=True)
    parts = [jnp.tensordot(slopes, c, c.ndim) for slopes, c in pairs]
    return ravel_pytree(list(point))[1](jnp.sum(jnp.stack(parts), axis=0))


def _parted(row: Sequence, sizes: Sequence[int]) -> list[list]:
    """A row in parts of these sizes."""
    row = list(row)
    return [[row.pop(0) for _ in range(size)] for size in sizes]


def _no_tangent(x):
    floating = jnp.issubdtype(x.dtype, jnp.inexact)
    return jnp.zeros_like(x) if floating else np.zeros(x.shape, jax.dtypes.float0)


def _zero(x) -> ad.Zero:
    return ad.Zero(jax.typeof(x).to_tangent_aval())


def _is_zero(tangent) -> bool:
    return isinstance(tangent, ad.Zero | SymbolicZero) or tangent.dtype == jax.dtypes.float0


def _jvp_of_some(function, primals, tangents):
    """Tangents of a function of lists, the zeros among those given left out."""
    row, rates = ([x for part in parts for x in part] for parts in (primals, tangents))
    moved = [k for k, rate in enumerate(rates) if not _is_zero(rate)]
    sizes = [len(part) for part in primals]

    def of_some(*some):
        full = list(row)
        for k, x in zip(moved, some, strict=True):
            full[k] = x
        return function(*_parted(full, sizes))

    given = tuple(row[k] for k in moved), tuple(rates[k] for k in moved)
    return jax.jvp(of_some, *given)[1]


# Values and tangents. Operands: point, direction, fixed; results: floats, others, tangents.
_BOTH = Primitive("values_and_tangents")
# Tangents of a direction alone, linear. Operands: direction, point, fixed, kept.
_ALONG = Primitive("tangents")
# Its transpose. Operands: cotangents, point, fixed, kept.
_BACK = Primitive("cotangents")


def _both(rule: _Rule, point, direction, fixed) -> tuple[list, ...]:
    sizes = len(point), len(direction), len(fixed)
    found = _BOTH.bind(*point, *direction, *fixed, rule=rule, sizes=sizes)
    count = [len(part) for part in jax.eval_shape(rule.both, point, direction, fixed)]
    return tuple(_parted(found, count))


def _run_both(*row, rule: _Rule, sizes):
    return [x for part in rule.both(*_parted(row, sizes)) for x in part]


def _run_along(*row, rule: _Rule, sizes):
    direction, point, fixed, _ = _parted(row, sizes)
    return rule.both(point, direction, fixed)[2]


def _run_back(*row, rule: _Rule, sizes):
    return rule.back(*_parted(row, sizes))


def _both_jvp(row, rates, *, rule: _Rule, sizes):
    moving = [not _is_zero(rate) for rate in rates]
    new = rule.second(moving, sizes)
    moved = [x for x, m in zip(row, moving, strict=True) if m]
    held = [x for x, m in zip(row, moving, strict=True) if not m]
    floats, others, changes = _both(new, moved, [r for r in rates if not _is_zero(r)], held)
    count = [len(part) for part in jax.eval_shape(rule.both, *_parted(row, sizes))]
    values, tangents = _parted(floats, (count[0], count[2]))
    change, turn = _parted(changes, (count[0], count[2]))
    none = [_zero(x) for x in others]
    return [*values, *others, *tangents], [*change, *none, *turn]


def _both_partly(trace, *tracers, rule: _Rule, sizes):
    """Where the direction is not known: the values, and tangents that wait for it."""
    known = [tracer.pval.get_known() for tracer in tracers]
    point, _, fixed = _parted(known, sizes)
    if all(x is not None for x in known):
        found = _BOTH.bind(*known, rule=rule, sizes=sizes)
        return [trace.new_const(x) for x in found]
    params = {"rule": rule, "sizes": sizes}
    if any(x is None for x in (*point, *fixed)):
        return trace.default_process_primitive(_BOTH, tracers, params)
    floats, others, kept = rule.forward(point, fixed)
    waiting = tracers[sizes[0] : sizes[0] + sizes[1]]
    rest = [trace.new_const(x) for x in (*point, *fixed, *kept)]
    params["sizes"] = sizes[1], sizes[0], sizes[2], len(kept)
    tangents = trace.default_process_primitive(_ALONG, [*waiting, *rest], params)
    return [*(trace.new_const(x) for x in (*floats, *others)), *tangents]


def _along_jvp(row, rates, *, rule: _Rule, sizes):
    def tangents(direction, point, fixed, _):
        return _both(rule, point, direction, fixed)[2]

    value = _ALONG.bind(*row, rule=rule, sizes=sizes)
    return value, _jvp_of_some(tangents, _parted(row, sizes), _parted(rates, sizes))


def _along_transpose(cotangents, *row, rule: _Rule, sizes):
    given = [ad.instantiate_zeros(c) for c in cotangents]
    rest = row[sizes[0] :]
    found = _BACK.bind(*given, *rest, rule=rule, sizes=(len(given), *sizes[1:]))
    return [*found, *[None] * len(rest)]


def _back_jvp(row, rates, *, rule: _Rule, sizes):
    def cotangents(given, point, fixed, _):
        return rule.pull(given, point, fixed)

    value = _BACK.bind(*row, rule=rule, sizes=sizes)
    rates = [*rates[: sum(sizes[:3])], *map(_zero, row[sum(sizes[:3]) :])]
    return value, _jvp_of_some(cotangents, _parted(row, sizes), _parted(rates, sizes))


def _in_front(row, axes, size: int) -> list:
    """Arrays with the axis of a batch in front, of length `size`."""
    return [
        jnp.broadcast_to(x, (size, *x.shape)) if axis is None else jnp.moveaxis(x, axis, 0)
        for x, axis in zip(row, axes, strict=True)
    ]


def _batch(primitive, order):
    """The rule for a batch of a primitive; `order` says which parts are point, direction and
    fixed."""

    def rule_for(row, axes, *, rule: _Rule, sizes):
        axes = [None if axis is batching.not_mapped else axis for axis in axes]
        size = next(x.shape[a] for x, a in zip(row, axes, strict=True) if a is not None)
        parts, places = _parted(row, sizes), _parted(axes, sizes)
        point, direction, fixed = (
            [0] * len(parts[1]) if k is None else places[k] for k in order
        )
        new = rule.batched(size, point, direction, fixed, *places[3:])
        for k, part in enumerate(parts[:3]):
            if k not in order:
                parts[k] = _in_front(part, places[k], size)
        found = primitive.bind(*chain(*parts), rule=new, sizes=sizes)
        ends: list[Any] = [0] * len(found)
        if primitive is _BOTH and all(axis is None for axis in (*point, *fixed)):
            count = [len(x) for x in jax.eval_shape(new.both, *parts)]
            for k in range(count[0] + count[1]):  # values know nothing of the directions
                found[k], ends[k] = found[k][0], batching.not_mapped
        return found, ends

    batching.primitive_batchers[primitive] = rule_for


for _primitive, _run, _jvp, _order in (
    (_BOTH, _run_both, _both_jvp, (0, 1, 2)),
    (_ALONG, _run_along, _along_jvp, (1, 0, 2)),
    (_BACK, _run_back, _back_jvp, (1, None, 2)),
):
    _primitive.multiple_results = True
    _primitive.def_impl(_run)
    _primitive.def_abstract_eval(
        lambda *row, _run=_run, **params: [
            ShapedArray(x.shape, x.dtype)
            for x in jax.eval_shape(lambda *row: _run(*row, **params), *row)
        ]
    )
    mlir.register_lowering(_primitive, mlir.lower_fun(_run, multiple_results=True))
    ad.primitive_jvps[_primitive] = _jvp
    _batch(_primitive, _order)
ad.primitive_transposes[_ALONG] = _along_transpose
pe.custom_partial_eval_rules[_BOTH] = _both_partly
