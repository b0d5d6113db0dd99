"""The shapes in annotations are checked while the tests run: `shapes.py`."""

import jax
import jax.numpy as jnp
import pytest
from jaxtyping import Float, TypeCheckError, jaxtyped

from jaxglide.flight.attitude import rotation_matrix
from shapes import checked


def test_the_package_is_checked():
    assert rotation_matrix(jnp.zeros(3)).shape == (3, 3)
    with pytest.raises(TypeCheckError, match="'angles'"):
        rotation_matrix(jnp.zeros(4))


def test_arrays_alone_are_checked_and_sizes_must_agree():
    @jaxtyped(typechecker=checked)
    def scaled(
        values: Float[jax.Array, " n"], by: Float[jax.Array, ""] | None, name: str
    ) -> tuple[Float[jax.Array, " n"], str]:
        return (values if by is None else by * values)[: len(name)], name

    for by in (2.0, None, jnp.asarray(2.0)):
        assert scaled(jnp.ones(3), by, [1, 2, 3])[0].shape == (3,)
    for values, by, name in ((jnp.ones(3), 2.0, "ab"), (jnp.ones((3, 1)), 2.0, "abc")):
        with pytest.raises(TypeCheckError):
            scaled(values, by, name)
    with pytest.raises(TypeCheckError, match="'by'"):
        scaled(jnp.ones(3), jnp.ones(3), "abc")
