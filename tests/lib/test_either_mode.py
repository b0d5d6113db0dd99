"""Derivatives of a solve in either mode and of any order, against a closed form."""

from itertools import product

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide._lib.either_mode import either_mode


def end_of_decay(start, rates, adjoint, unit=1.0):
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, rates: -rates * y * unit),
        diffrax.Dopri5(),
        0.0,
        1.0,
        0.02,
        start * jnp.ones_like(rates),
        args=rates,
        adjoint=adjoint,
    )
    return solution.ys[0], solution.stats["num_steps"]


@either_mode
def decay(start, rates, *, adjoint, unit=1.0):
    """start exp(-rate) for each rate, (n,), multiples of it, and a whole number."""
    end, steps = end_of_decay(start, rates, adjoint, unit)
    return {"end": end, "more": jnp.outer(end, jnp.arange(4.0)), "steps": steps}


@either_mode
def mean_decay(rates, *, adjoint):
    """One number of many rates."""
    return jnp.mean(end_of_decay(1.0, rates, adjoint)[0])


def total(x):
    """Sum of x0 exp(-x1) and x0 exp(-x2)."""
    return jnp.sum(decay(x[0], x[1:])["end"])


def exact(x):
    return jnp.sum(x[0] * jnp.exp(-x[1:]))


X = jnp.array([1.5, 0.3])
MODES = {"forward": jax.jacfwd, "reverse": jax.jacrev}


ORDERS = [
    ("reverse", "reverse"),
    *(
        pytest.param(modes, marks=pytest.mark.slow)
        for modes in [*product(MODES, repeat=2), ("reverse",) * 3]
        if modes != ("reverse", "reverse")
    ),
]


@pytest.mark.parametrize("modes", ORDERS, ids="-".join)
def test_derivatives_of_higher_order_in_any_mode(modes):
    found, expected = total, exact
    for mode in modes:
        found, expected = MODES[mode](found), MODES[mode](expected)
    np.testing.assert_allclose(jax.jit(found)(X), expected(X), rtol=1e-9)


def test_mixed_derivatives_by_what_is_perturbed_apart():
    """The inner derivative holds what the outer one varies."""

    def slope(rate, start):
        return jax.grad(lambda s: jnp.sum(decay(s, rate[None])["end"]))(start)

    for outer in (jax.grad, jax.jacfwd):
        assert float(outer(slope)(0.3, 1.5)) == pytest.approx(-np.exp(-0.3), rel=1e-9)
    lanes = jax.vmap(jax.grad(jax.grad(total_of_rate)))(jnp.array([0.3, 0.7]))
    np.testing.assert_allclose(lanes, np.exp([-0.3, -0.7]), rtol=1e-9)


def total_of_rate(rate):
    return jnp.sum(decay(1.0, rate[None])["end"])


def test_what_is_not_differentiated_may_be_traced():
    def end(rate, unit):
        return jax.jit(lambda unit: jnp.sum(decay(1.0, rate[None], unit=unit)["end"]))(unit)

    assert float(jax.grad(jax.grad(end))(0.3, 2.0)) == pytest.approx(4 * np.exp(-0.6), rel=1e-9)


def test_one_number_of_many_is_differentiated_in_reverse():
    rates = jnp.linspace(0.1, 1.0, 8)
    gradient = jax.jit(jax.grad(mean_decay))(rates)
    np.testing.assert_allclose(gradient, -np.exp(-rates) / 8, rtol=1e-9)


def test_a_batch_of_many_numbers_is_differentiated_in_reverse():
    """In either order of grad and vmap, what is shared by the batch among it."""
    modes = []

    @either_mode
    def solve(start, rates, *, adjoint):
        modes.append(type(adjoint))
        return jnp.mean(end_of_decay(start, rates, adjoint)[0])

    def shared(rates, starts):
        return jnp.sum(jax.vmap(solve, (0, None))(starts, rates))

    starts, rates = jnp.array([1.0, 2.0, 4.0]), jnp.linspace(0.1, 1.0, 8)
    gradients = jax.jit(jax.grad(shared, (0, 1)))(rates, starts)
    assert diffrax.RecursiveCheckpointAdjoint in modes
    np.testing.assert_allclose(gradients[0], -7 * np.exp(-rates) / 8, rtol=1e-9)
    np.testing.assert_allclose(gradients[1], [np.exp(-rates).mean()] * 3, rtol=1e-9)
    along = jax.vmap(lambda start: jax.jvp(lambda s: solve(s, rates), (start,), (1.0,)))
    value, slope = jax.jit(along)(starts)
    np.testing.assert_allclose(value, starts * slope, rtol=1e-12)
    np.testing.assert_allclose(slope, [np.exp(-rates).mean()] * 3, rtol=1e-9)
    modes.clear()
    each = jax.jit(jax.vmap(jax.grad(solve, 1), (0, None)))(starts, rates)
    assert diffrax.RecursiveCheckpointAdjoint in modes
    expected = np.multiply.outer(starts, -np.exp(-rates) / 8)
    np.testing.assert_allclose(each, expected, rtol=1e-9)
    own = jnp.stack([rates, 2 * rates, 3 * rates])
    of_own = jax.jit(jax.grad(lambda own: jnp.sum(jax.vmap(solve)(starts, own))))(own)
    np.testing.assert_allclose(of_own, -starts[:, None] * np.exp(-own) / 8, rtol=1e-9)


@pytest.mark.slow
def test_batches_in_a_batch_are_differentiated_too():
    starts, rates = jnp.array([1.0, 2.0]), jnp.linspace(0.1, 1.0, 8)
    own = jnp.stack([rates, 2 * rates])

    def means(own):
        return jax.vmap(jax.vmap(lambda start, rates: decay(start, rates)["end"].mean()))(
            jnp.stack([starts, 3 * starts]), jnp.stack([own, own])
        )

    found = jax.jit(jax.grad(lambda own: jnp.sum(means(own))))(own)
    expected = -4 * starts[:, None] * np.exp(-own) / 8
    np.testing.assert_allclose(found, expected, rtol=1e-9)
