"""What is wrong is refused in words a user can act on; what is right gives finite results."""

import re
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxglide import (
    Gait,
    Glider,
    Launch,
    Polar,
    Snake,
    StillAir,
    discretise,
    reconstruct,
    simulate,
    six_degrees_of_freedom,
    take_off,
)
from jaxglide.flight.dynamics import Flight
from jaxglide.tunnel.fall import fall
from jaxglide.tunnel.glide_polar import body_polar, equilibrium
from jaxglide.tunnel.loads import loads
from jaxglide.tunnel.trim import trim

GLIDER = Glider(Snake.from_svl(), Gait.from_degrees())
CASES = settings(max_examples=15, deadline=None, derandomize=True, database=None)


class Argument(NamedTuple):
    """A number that may be refused: how to pass it, and what the message must say."""

    build: object
    name: str
    unit: str
    low: float
    high: float
    low_open: bool = False
    high_open: bool = False


def radians(**value):
    fields = {"theta_m": 1.7, "psi_m": 0.3, "nu_theta": 1.4, "f_theta": 1.2}
    return Gait(**(fields | value))


def glide_with(name):
    return lambda x: simulate(GLIDER, **{name: x})


def argument(build, name, *rest, **options):
    return Argument(lambda x: build(**{name: x}), name, *rest, **options)


NEXT_TO_85 = np.deg2rad(85.0)
ARGUMENTS = [
    argument(lambda length: Snake(length, 0.04), "length", "m", 0, 100, low_open=True),
    argument(lambda mass: Snake(0.7, mass), "mass", "kg", 0, 1e5, low_open=True),
    argument(lambda svl: Snake.from_svl(svl, mass=1.0), "svl", "m", 0, 100, low_open=True),
    argument(Snake.from_svl, "mass", "kg", 0, 1e5, low_open=True),
    argument(Snake.from_svl, "neck_fraction", "of SVL", 0, 0.5, low_open=True, high_open=True),
    argument(Snake.from_svl, "head_fraction", "of SVL", 0, 0.5, low_open=True, high_open=True),
    argument(Snake.from_svl, "gyration", "chords", 1e-5, 1),
    argument(Snake.from_svl, "spacing", "m", 0, 100, low_open=True),
    argument(Gait.from_degrees, "theta_m", "deg", 0, 180),
    argument(Gait.from_degrees, "psi_m", "deg", 0, 180),
    argument(Gait.from_degrees, "d_psi", "deg", -180, 180),
    argument(Gait.from_degrees, "d_theta", "deg", -180, 180),
    argument(lambda nu_theta: Gait.from_degrees(90, nu_theta=nu_theta), "nu_theta", "", 0, 10),
    argument(Gait.from_degrees, "f_theta", "Hz", 0, 50),
    argument(radians, "theta_m", "rad", 0, np.pi),
    argument(radians, "d_psi", "rad", -np.pi, np.pi),
    argument(
        lambda gravity: Glider(GLIDER.body, GLIDER.gait, gravity=gravity),
        "gravity",
        "m/s^2",
        0,
        100,
    ),
    argument(StillAir, "air_density", "kg/m^3", 0, 2000, low_open=True),
    argument(StillAir, "kinematic_viscosity", "m^2/s", 0, 1, low_open=True),
    argument(Polar.published, "lift_scale", "", 0, 100),
    argument(Polar.smooth, "drag_scale", "", 0, 100),
    argument(Launch, "height", "m", 0, 1e5, low_open=True),
    argument(Launch, "speed", "m/s", 0, 200),
    argument(Launch, "elevation", "rad", -np.pi / 2, np.pi / 2),
    argument(Launch, "heading", "rad", -np.pi, np.pi),
    argument(Launch, "phi_theta", "rad", -1e3, 1e3),
    Argument(
        lambda x: Launch(angles=[0.0, x, 0.0]),
        "angles",
        "rad",
        -NEXT_TO_85,
        NEXT_TO_85,
        low_open=True,
        high_open=True,
    ),
    # these five fly where they are allowed
    Argument(glide_with("rtol"), "rtol", "", 0, 0.1, low_open=True),
    Argument(glide_with("atol"), "atol", "", 0, 0.1, low_open=True),
    Argument(glide_with("max_time"), "max_time", "s", 0, 1e4, low_open=True),
    Argument(glide_with("step"), "step", "s", 1e-7, 1, low_open=True),
    Argument(lambda x: simulate(GLIDER, times=[0.0, x]), "times", "s", 0, np.inf),
]
each = pytest.mark.parametrize("entry", ARGUMENTS, ids=lambda entry: entry.name)


def bad_values(entry):
    """Values outside the range, its open bounds, and what is not finite."""
    low, high = entry.low, entry.high
    values = st.sampled_from([np.nan, np.inf, -np.inf])
    values |= st.floats(low - 1e6, low, exclude_max=not entry.low_open)
    if np.isfinite(high):
        values |= st.floats(high, 2 * abs(high) + 1e6, exclude_min=not entry.high_open)
    return values


@each
@CASES
@given(data=st.data())
def test_a_bad_number_is_refused_with_its_name_value_unit_and_range(entry, data):
    x = data.draw(bad_values(entry))
    with pytest.raises(ValueError, match=f"^{entry.name} = ") as caught:
        entry.build(x)
    message = str(caught.value)
    value, unit = f"{x:g}", f" {entry.unit}" if entry.unit else ""
    assert f"{entry.name} = {value}{unit} is not allowed" in message
    assert f"{entry.low:g}, {entry.high:g}" in message
    assert message.endswith(unit)
    assert message[-1 - len(unit)] in ")]"


@pytest.mark.parametrize("entry", ARGUMENTS[:-5], ids=lambda entry: entry.name)
def test_the_closed_bounds_themselves_are_allowed(entry):
    for bound, is_open in ((entry.low, entry.low_open), (entry.high, entry.high_open)):
        if not is_open:
            entry.build(bound)


@pytest.mark.parametrize(
    "x", ["fast", {}, 1j, 10**400], ids=["text", "dict", "complex", "huge"]
)
def test_what_is_no_number_is_refused_by_name(x):
    nameless = []
    for entry in ARGUMENTS:
        with pytest.raises((TypeError, ValueError)) as caught:
            entry.build(x)
        if entry.name not in str(caught.value):
            nameless.append((entry.name, str(caught.value)))
    assert not nameless


def test_180_degrees_is_allowed_in_float32_too():
    """The nearest float32 to pi is above it."""
    with jax.enable_x64(False):
        for name in ("theta_m", "psi_m", "d_psi", "d_theta"):
            gait = Gait.from_degrees(**{name: 180})
            assert float(getattr(gait, name)) == pytest.approx(np.pi, rel=1e-6)


@CASES
@given(nodes=st.integers(-1000, 7) | st.integers(2001, 10**6))
def test_too_few_or_too_many_nodes(nodes):
    with pytest.raises(ValueError, match=rf"^nodes = {nodes} is not allowed.*\[8, 2000\]"):
        Snake.from_svl(nodes=nodes)


@pytest.mark.parametrize("nodes", [8.5, 70.0, "70", None, True])
def test_nodes_are_whole_numbers(nodes):
    with pytest.raises(TypeError, match=f"nodes = {nodes!r} is not a whole number"):
        Snake.from_svl(nodes=nodes)


@pytest.mark.parametrize("steps", [0, -3, 10**10])
def test_number_of_steps(steps):
    with pytest.raises(ValueError, match=rf"^max_steps = {steps} is not allowed"):
        simulate(GLIDER, max_steps=steps)


def test_choices_name_what_there_is():
    with pytest.raises(
        ValueError, match="node_set = 'midpoint' is not one of published, gauss"
    ):
        Snake.from_svl(node_set="midpoint")
    with pytest.raises(ValueError, match="polar = 'measured' is not one of published, smooth"):
        Polar.from_name("measured")


def test_shapes_are_named():
    with pytest.raises(ValueError, match=r"angles has shape \(2,\): it must be \(3,\)"):
        Launch(angles=[0.1, 0.2])
    with pytest.raises(ValueError, match="times is empty"):
        simulate(GLIDER, times=[])
    with pytest.raises(ValueError, match=r"times has shape \(2, 1\)"):
        simulate(GLIDER, times=[[0.1], [0.2]])
    with pytest.raises(ValueError, match="times must increase"):
        simulate(GLIDER, times=[0.2, 0.1])


def flat(beta, reynolds):
    return 0 * beta, 1 + 0 * beta


WRONG_SHAPES = {
    "chord has shape (2,): it must be (3,)": lambda: Snake(0.7, 0.04, chord=(0.05, 0.05)),
    "chord has shape (70,): it must be (3,)": lambda: Snake(0.7, 0.04, chord=np.ones(70)),
    "body_density has shape (1, 3): it": lambda: Snake(0.7, 0.04, body_density=[[1, 1, 1]]),
    "length has shape (2,): it must be one number": lambda: Snake([0.7, 0.8], 0.04),
    "cells has shape (36, 1, 2, 2, 2): it must be (72, 6, 2, k, k)": lambda: Polar(
        np.zeros((36, 1, 2, 2, 2))
    ),
    "cells has shape (72, 6, 2, 2, 4): it": lambda: Polar(np.zeros((72, 6, 2, 2, 4))),
    "lift_scale has shape (3,): it must be one number": lambda: Polar.smooth([1, 1, 1]),
    "height has shape (2,): it must be one number": lambda: Launch(height=[10, 20]),
    "angles has shape (1, 3): it must be (3,)": lambda: Launch(angles=[[0.1, 0.2, 0.3]]),
    "nu_theta has shape (2,): it must be one number": lambda: radians(nu_theta=[1.2, 1.4]),
    "gravity has shape (1,): it must be one number": lambda: Glider(
        GLIDER.body, GLIDER.gait, gravity=[9.81]
    ),
    "rtol has shape (2,): it must be one number": lambda: simulate(GLIDER, rtol=[1e-6] * 2),
    "mass has shape (2,): it must be one number": lambda: simulate(
        eqx.tree_at(lambda g: g.body.mass, GLIDER, jnp.ones(2))
    ),
    "time has shape (1,): it": lambda: loads(GLIDER, [0.0, 3.0, -4.0], time=[0.1]),
    "velocity has shape (2,): it must be (3,)": lambda: loads(GLIDER, [3.0, -4.0]),
    "speed has shape (2,): it must be one number": lambda: body_polar(GLIDER, [3, 4], 0.5),
    "angle_of_attack has shape (1, 1): it must be (A,)": lambda: body_polar(GLIDER, 3, [[0.5]]),
    "bounds has shape (3,): it must be (2,)": lambda: trim(GLIDER, bounds=(0, 0.1, 0.2)),
}


@pytest.mark.parametrize("message", WRONG_SHAPES)
def test_annotated_shapes_are_enforced(message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}"):
        WRONG_SHAPES[message]()


def test_shapes_hold_inside_transformations_lane_by_lane():
    """Under `vmap` a lane's shape counts; what comes out may be batched."""
    gaits = jax.vmap(lambda nu: Gait(1.7, 0.3, nu, 1.2))(jnp.array([1.2, 1.4]))
    assert gaits.nu_theta.shape == (2,)
    lanes = eqx.filter_vmap(lambda gait: Glider(GLIDER.body, gait))(gaits)
    assert lanes.gait.theta_m.shape == (2,)
    with pytest.raises(ValueError, match=r"^\w+ has shape \(2,\): it must be one number"):
        simulate(lanes)
    with pytest.raises(ValueError, match=r"^nu_theta has shape \(2,\)"):
        jax.jit(lambda nu: Gait(1.7, 0.3, nu, 1.2))(jnp.ones(2))


NONSENSE = {
    r"^chord = -0.2825 at s/L = 0 is not allowed.*\(0, 1\]": lambda: Snake(
        0.7, 0.04, chord=(0.5, 0.03, -0.2)
    ),
    r"^chord = 1.98438 at s/L = 0 is not": lambda: Snake(0.7, 0.04, chord=(0.5, 2.0, -4.0)),
    r"^chord = \(0.5, 0.03, 0\) is not allowed: p must": lambda: Snake(
        0.7, 0.04, chord=(0.5, 0.03, 0.0)
    ),
    r"^head_density = -0.1999 at s/L = 0 is": lambda: Snake(
        0.7, 0.04, head_density=(0.02, -0.2, 1.0)
    ),
    r"^body_density = -\S+ at s/L = 1 is not allowed.*\(0, inf\)": lambda: Snake(
        0.7, 0.04, body_density=(0.2, 1.1, -0.1)
    ),
    r"^nodes = 70 at a spacing of 0.005 m reach 0.35 m only": lambda: Snake.from_svl(
        spacing=0.005
    ),
    r"^C_D of cells = -1 is not allowed": lambda: Polar(
        Polar.smooth().cells.at[3, 2, 1].set(-1)
    ),
    r"^cells = 1e\+06 is not allowed": lambda: Polar(Polar.smooth().cells.at[3, 2].set(1e6)),
    r"^gyration = None is not allowed of a straight body": lambda: Glider(
        Snake.from_svl(), Gait.from_degrees(0, 0, d_psi=0)
    ),
    r"^phases = 3 is not allowed.*\[4, 3600\]": lambda: loads(GLIDER, [0, 3, -4], phases=3),
    r"^phases = 1000000000 is not allowed": lambda: loads(GLIDER, [0, 3, -4], phases=10**9),
}


@pytest.mark.parametrize("message", NONSENSE)
def test_bodies_and_polars_make_sense(message):
    with pytest.raises(ValueError, match=message):
        NONSENSE[message]()


WRONG_KINDS = {
    "body must be of type AbstractBody, not Gait": lambda: Glider(GLIDER.gait, GLIDER.body),
    "aerodynamics must be of type AbstractAerodynamics, not function": lambda: Glider(
        GLIDER.body, GLIDER.gait, flat
    ),
    "air must be of type AbstractAir, not float": lambda: Glider(
        GLIDER.body, GLIDER.gait, air=9.81
    ),
    "glider must be of type Glider, not None": lambda: simulate(None),
    "glider must be of type Glider, not str": lambda: simulate("x"),
    "launch must be of type Launch, not float": lambda: simulate(GLIDER, 10.0),
    "solver must be of type AbstractERK, not str": lambda: simulate(GLIDER, solver="tsit5"),
    "adjoint must be of type AbstractAdjoint, not str": lambda: simulate(GLIDER, adjoint="x"),
    "glide must be of type AbstractTrajectory, not Glider": lambda: reconstruct(GLIDER),
}


@pytest.mark.parametrize("message", WRONG_KINDS)
def test_wrong_kinds_are_named(message):
    with pytest.raises(TypeError, match=f"^{message}$"):
        WRONG_KINDS[message]()


@pytest.mark.parametrize("take", [fall, trim, equilibrium, loads, body_polar])
def test_every_front_door_wants_a_glider(take):
    given = {loads: ([0, 3, -4],), body_polar: (5.0, 0.5)}.get(take, ())
    with pytest.raises(TypeError, match=r"^glider must be of type Glider, not Snake$"):
        take(GLIDER.body, *given)


def test_a_module_changed_behind_the_constructors_back_is_checked_again():
    broken = eqx.tree_at(lambda g: g.body.mass, GLIDER, jnp.asarray(-1.0))
    with pytest.raises(ValueError, match="mass = -1 kg"):
        simulate(broken)
    with pytest.raises(ValueError, match="height = nan m"):
        simulate(GLIDER, eqx.tree_at(lambda x: x.height, Launch(), jnp.asarray(np.nan)))


@jax.jit
def start_and_rates(values, body, air, state):
    theta_m, psi_m, nu_theta, f_theta, d_psi, d_theta = values
    gait = Gait(theta_m, psi_m, nu_theta, f_theta, d_psi, d_theta)
    snake = Snake(body[0], body[1], body[2], gyration=0.25)  # straight ones fly too
    still = StillAir(air_density=air[1], kinematic_viscosity=air[2])
    glider = Glider(snake, gait, Polar.published(body[3], body[4]), still, air[0])
    sections = discretise(snake)
    start = take_off(glider, Launch(), sections)
    flight = Flight(glider, sections, start.phi_theta)
    return start, six_degrees_of_freedom(0.1, state, flight), sections


def within(*bounds):
    return st.tuples(*(st.floats(low, high) for low, high in bounds))


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(
    degrees=within((0, 180), (0, 180), (0, 10), (0, 50), (-180, 180), (-180, 180)),
    body=within((0.01, 100), (1e-5, 1e5), (1e-3, 0.499), (0, 100), (0, 100)),
    air=within((0, 100), (1e-6, 2000), (1e-9, 1)),
    motion=within(*[(-200, 200)] * 3, *[(-100, 100)] * 3, *[(-1.48, 1.48)] * 3),
)
def test_valid_input_gives_finite_results(degrees, body, air, motion):
    values = [*np.deg2rad(degrees[:2]), *degrees[2:4], *np.deg2rad(degrees[4:])]
    state = np.array([0, 0, 10, *motion, 0])
    start, rates, sections = start_and_rates(
        np.array(values), np.array(body), np.array(air), state
    )
    for leaf in jax.tree.leaves((start, rates, sections)):
        assert np.isfinite(leaf).all()
    assert float(jnp.sum(sections.mass)) == pytest.approx(body[1], rel=1e-12)


@settings(max_examples=200, deadline=None, derandomize=True, database=None)
@given(
    point=within((-np.pi, np.pi), (0, 1e12)) | st.tuples(st.just(np.pi), st.just(np.inf)),
)
def test_polars_are_finite_and_bounded_everywhere(point):
    for polar in POLARS:
        lift, drag = (float(c) for c in _coefficients(polar, *point))
        assert abs(lift) < 2.1
        assert 0.2 < drag < 2.2


POLARS = [Polar.published(), Polar.smooth()]
_coefficients = jax.jit(lambda polar, beta, reynolds: polar(beta, reynolds))
