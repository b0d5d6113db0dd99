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
