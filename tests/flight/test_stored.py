"""Reverse mode through stored stages, of a small field of its own: the same as forward mode."""

from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide.flight import stored
from jaxglide.flight.attitude import angle_rates
from jaxglide.flight.dynamics import ANGLES, OMEGA, VELOCITY
from jaxglide.flight.ends import Ground
from jaxglide.flight.solve import settings_of, solve

START = np.array([0.0, 0.0, 2.0, 0.3, 1.5, 0.4, 1.0, -2.0, 1.5, 0.3, -0.2, 0.1, 0.0])
ARGS = np.array([9.81, 0.4, 20.0])


def field(time, state, args):
    """A stone with drag, in a wind that grows, that swings less and less [SI]."""
    gravity, drag, swing = args
    velocity, omega = state[VELOCITY], state[OMEGA]
    force = -drag * (velocity - time**2) * jnp.sqrt(1 + velocity @ velocity)
    turning = -swing * state[ANGLES] * (1 + time) - omega
    return jnp.concatenate(
        [
            velocity,
            force.at[2].add(-gravity),
            turning,
            angle_rates(state[ANGLES], omega),
            jnp.sqrt(velocity[:1] ** 2 + 1),
        ]
    )


def values(given, backwards, *, turns, ends, solver=None, **more):
    """Of a flight: time, state, and largest angles."""
    start, t0, args, level, t1 = given
    kinds = (Ground(level),) if ends else ()
    options: Any = {"rtol": 1e-5, "atol": 1e-5, "max_steps": 400} | more
    settings = settings_of(
        times=None, ends=kinds, solver=solver, step=None, dense=False, max_time=t1, **options
    )
    if backwards:
        found = stored.solve_back(field, start, t0, args, settings, turns=turns)
    else:
        mode = diffrax.ForwardMode()
        found = solve(field, start, t0, args, settings, mode, turns=turns)
    peaks = [found.max_angles] if found.max_angles is not None else []
    return jnp.concatenate([found.time[None], found.state, *peaks])


@pytest.mark.parametrize(
    ("t1", "options"),
    [
        pytest.param(9.0, {"turns": True, "ends": True}, id="to the ground"),
        pytest.param(0.9, {"turns": True, "ends": False}, id="to a time"),
        pytest.param(0.9, {"turns": False, "ends": True, "solver": diffrax.Heun()}, id="Heun"),
        pytest.param(9.0, {"turns": True, "ends": True, "max_steps": 12}, id="too few steps"),
    ],
)
@pytest.mark.parametrize("kept", [512, pytest.param(5, marks=pytest.mark.slow)])
def test_backwards_as_forwards(t1, options, kept, monkeypatch):
    """By start, its time, arguments, the level of the ground and the last time.

    Not of fixed steps: Diffrax divides the time equally, and forward mode moves them with it.
    """
    monkeypatch.setattr(stored, "_KEPT", kept)
    given = tuple(map(jnp.asarray, (START, 0.1, ARGS, -1.0, t1)))

    @eqx.filter_jit
    def jacobian(mode, backwards):
        return mode(lambda given: values(given, backwards, **options))(given)

    forward, back = jacobian(jax.jacfwd, False), jacobian(jax.jacrev, True)
    for expected, found in zip(forward, back, strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)
    assert float(jnp.abs(forward[1]).max()) > 1e-3  # what is compared is not nothing
