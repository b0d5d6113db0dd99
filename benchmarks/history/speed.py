"""A few figures for their history over commits: processor time, which other work on the
machine changes less than the clock.

Only public names, which older commits have too.
"""

import os
import time

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_prefer_vector_width=512")

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp
import numpy as np

from jaxglide import (
    Flight,
    Gait,
    Glider,
    Launch,
    Polar,
    Snake,
    Study,
    discretise,
    simulate,
    six_degrees_of_freedom,
    sweep,
)

POLARS = ["published", "smooth"]
EVALUATIONS = 10_240  # in each call: 1 ms of a call is 0.1 us an evaluation
STATE = np.array([0, 0, 9, 0.1, 1.7, -1.0, 0.3, 0, 0, 0.1, -0.1, 0.05, 0])


class Timed:
    """How `asv` repeats a call."""

    version = "1"  # of what is measured; figures of another version are not compared
    timer, rounds, number, warmup_time = time.process_time, 1, 1, 0
    repeat, timeout = (5, 15, 2.0), 1800


def glider(polar: str, nu_theta=1.4) -> Glider:
    gait = Gait.from_degrees(nu_theta=nu_theta)
    return Glider(Snake.from_svl(0.7), gait, Polar.from_name(polar))


class VectorField(Timed):
    """10,240 evaluations of the vector field: one lane, or 512 side by side."""

    params, param_names = (POLARS, [1, 512]), ["polar", "lanes"]

    def setup(self, polar, lanes):
        def run(state, nu_theta):
            flown = glider(polar, nu_theta)
            flight = Flight(flown, discretise(flown.body), jnp.asarray(-0.03))

            def body(i, y):
                return y + 1e-6 * six_degrees_of_freedom(1e-3 * i, y, flight)

            return jax.lax.fori_loop(0, EVALUATIONS // lanes, body, state)

        if lanes == 1:
            self.function, self.given = jax.jit(run), (STATE, 1.4)
        else:
            shapes = 1.4 + 1e-4 * np.arange(lanes)
            self.function = jax.jit(jax.vmap(run))
            self.given = np.tile(STATE, (lanes, 1)), shapes
        self.time_evaluations(polar, lanes)

    def time_evaluations(self, polar, lanes):
        jax.block_until_ready(self.function(*self.given))


class Glide(Timed):
    """One glide from 10 m at 1e-6."""

    params, param_names = POLARS, ["polar"]

    def setup(self, polar):
        self.fly = compiled(polar)

    def time_glide(self, polar):
        jax.block_until_ready(self.fly(1e-6))


class Sweep(Timed):
    """A sweep of 64 random gaits from 10 m at 1e-6, without compilation."""

    params, param_names = POLARS, ["polar"]

    def setup(self, polar):
        random = np.random.default_rng(0).uniform
        ranges = {"nu_theta": (1.0, 1.5), "theta_m": (90, 120), "f_theta": (0.6, 1.7)}
        cases = {name: random(low, high, 64) for name, (low, high) in ranges.items()}
        self.study = Study(cases=cases, setup={"polar": polar})
        self.time_64(polar)

    def time_64(self, polar):
        sweep(self.study, progress=False)


class Compilation:
    """Tracing and compiling one glide, the first work of a process [s of processor time]."""

    version = "1"
    params, param_names, unit, timeout = POLARS, ["polar"], "s", 1800

    def track_glide(self, polar):
        begin = time.process_time()
        compiled(polar)
        return time.process_time() - begin


def compiled(polar: str):
    """A compiled function of the tolerance that flies one glide."""
    made = glider(polar)
    fly = jax.jit(lambda tolerance: simulate(made, Launch(), rtol=tolerance, atol=tolerance))
    return fly.lower(1e-6).compile()
