"""The kernel in C that the benchmarks measure against computes the same vector field."""

import sys

import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import Flight, Gait, Glider, Snake, discretise, six_degrees_of_freedom
from places import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

import c_kernel

pytestmark = pytest.mark.skipif(not c_kernel.available(), reason="there is no C compiler")


def test_kernel_and_vector_field_agree():
    gait = Gait.from_degrees(nu_theta=1.3, d_psi=8, d_theta=3)
    glider = Glider(Snake.from_svl(0.65), gait)
    flight = Flight(glider, discretise(glider.body), jnp.asarray(-0.03))
    model = c_kernel.model(glider, -0.03)
    states = np.random.default_rng(0).uniform(-0.6, 0.6, (20, 13))
    states[:, 3:6] += [0.0, 3.0, -4.0]
    for time, state in enumerate(states):
        expected = six_degrees_of_freedom(0.1 * time, state, flight)
        found = c_kernel.rates(0.1 * time, state, model)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10)
