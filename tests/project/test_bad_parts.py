"""At every seam, what is wrong is refused in one sentence that names it."""

import re

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxglide import (
    AbstractAerodynamics,
    AbstractAir,
    AbstractBody,
    AbstractDrive,
    AbstractEnd,
    AbstractPolar,
    Actuated,
    AngleLimit,
    AttitudeLaw,
    Coordinates,
    Driven,
    End,
    Gait,
    Glider,
    Ground,
    Gust,
    LaggingCirculation,
    Launch,
    Plane,
    Polar,
    Programme,
    Running,
    Serpenoid,
    ShearWind,
    Snake,
    SweepTheory,
    TabulatedBody,
    TabulatedMotion,
    TabulatedPolar,
    TimeLimit,
    Turbulence,
    UniformWind,
    Waveform,
    discretise,
    integrate,
    simulate,
)

SNAKE = Snake.from_svl(nodes=12)
GAIT = Gait.from_degrees()
GLIDER = Glider(SNAKE, GAIT)
START = np.r_[0, 0, 1.0, 0, 4.0, 0, np.zeros(7)]
NAN = float("nan")


def body(position=(0.0, 1.0), chord=(0.1, 0.1), density=(0.1, 0.1), *points, **fields):
    return TabulatedBody(position, chord, density, *points, **fields)


def polar(degrees=(-10.0, 0.0, 20.0), reynolds=(1e4,), lift=None, drag=None):
    ones = np.ones((len(degrees), len(reynolds)))
    lift, drag = (ones if one is None else one for one in (lift, drag))
    return TabulatedPolar(np.deg2rad(degrees), reynolds, lift, drag)


def waveform(angles, names=("bow",)):
    return Waveform(angles, names)


def actuated(law=lambda time, seen: jnp.zeros(2), initial=(0.0, 0.0), frequency=10.0, **more):
    return Actuated(law, initial, frequency, **more)


def motion(times=(0.0, 1.0), stations=(0.0, 1.0), theta=None, psi=None):
    zero = np.zeros((2, 2))
    return TabulatedMotion(
        times, stations, zero if theta is None else theta, zero if psi is None else psi
    )


def fails(*_):
    raise RuntimeError


VALUES = {
    "cyclic = True of Running is not allowed: the shape's last coordinate is bend": lambda: (
        Driven(
            Waveform(lambda x, q: (q[0] * x, q[1] * x), ("turn", "bend")), Running([0.1, 0.2])
        )
    ),
    "height = 1 m is not allowed: the launch must be above the ground at 2 m": lambda: simulate(
        GLIDER, Launch(1.0), ends=Ground(2.0)
    ),
    "height = 1 m is not allowed: the launch must be on the near side": lambda: simulate(
        GLIDER, Launch(1.0), ends=(Ground(), Plane((0, 1, 1), 0.5))
    ),
    # bodies
    "position has 1 stations: a body has at least 2": lambda: body([0.0], [0.1], [0.1]),
    "position starts at 0.1 m: it must start at 0": lambda: body((0.1, 1.0)),
    "position goes from 0.5 to 0.5 m: it must rise": lambda: body(
        (0, 0.5, 0.5, 1), np.ones(4), np.ones(4)
    ),
    "position goes from 0.5 to 0.3 m: it must rise": lambda: body(
        (0, 0.5, 0.3, 1), np.ones(4), np.ones(4)
    ),
    "position = nan m is not allowed": lambda: body((0, NAN)),
    "chord = 0 m is not allowed": lambda: body(chord=(0.1, 0)),
    "chord has 3 values: position has 2": lambda: body(chord=(0.1, 0.1, 0.1)),
    "density = -1 kg/m is not allowed": lambda: body(density=(0.1, -1)),
    "density has 1 values: position has 2": lambda: body(density=(0.1,)),
    "density and point_mass are all 0: the body has no mass": lambda: body(density=(0, 0)),
    "point_mass has 1 values: point_position has 2": lambda: body(
        (0, 1), (1, 1), (1, 1), (0.1, 0.2), (0.1,)
    ),
    "point_mass = -0.1 kg is not allowed": lambda: body(
        (0, 1), (1, 1), (1, 1), (0.1,), (-0.1,)
    ),
    "point_position = 1.2 m lies beyond the body's length of 1 m": lambda: body(
        (0, 1), (1, 1), (1, 1), (1.2, 0.1), (0.1, 0.1)
    ),
    "neck_fraction = 0.6 of SVL is not allowed": lambda: body(neck_fraction=0.6),
    "nodes = 5 is not allowed": lambda: body(nodes=5),
    "node_set = 'even' is not one of": lambda: body(node_set="even"),
    # polars
    "angle_of_attack goes from 0 to 0 deg: it must rise": lambda: polar((-10, 0, 0)),
    "angle_of_attack goes from 20 to 0 deg: it must rise": lambda: polar((-10, 20, 0)),
    "angle_of_attack has 1 values: it needs at least 2": lambda: polar((0,)),
    "angle_of_attack runs from -120 to 20 deg: it must stay": lambda: polar((-120, 20)),
    "angle_of_attack = nan rad is not allowed": lambda: polar((-10, NAN, 20)),
    "reynolds goes from 10000 to 5000: it must rise": lambda: polar(reynolds=(1e4, 5e3)),
    "reynolds = -1 is not allowed": lambda: polar(reynolds=(-1.0,)),
    "lift has shape (2, 1): it must be (3, 1)": lambda: polar(lift=np.ones((2, 1))),
    "drag = -0.1 is not allowed": lambda: polar(drag=np.full((3, 1), -0.1)),
    "harmonics = 0 is not allowed": lambda: Polar.band_limited(0),
    # aerodynamics
    "lag = 0 half chords is not allowed": lambda: LaggingCirculation(Polar.smooth(), 0.0),
    "share = 1.5 is not allowed": lambda: LaggingCirculation(Polar.smooth(), share=1.5),
    # air
    "velocity = nan m/s is not allowed": lambda: UniformWind((0, NAN, 0)),
    "velocity = 200 m/s is not allowed": lambda: UniformWind((0, 200, 0)),
    "velocity has shape (2,): it must be (3,)": lambda: UniformWind((0, 1)),
    "air_density = 0 kg/m^3 is not allowed": lambda: UniformWind((0, 1, 0), air_density=0),
    "reference_height = 0 m is not": lambda: ShearWind((1, 0, 0), 0.0),
    "shear_exponent = -1 is not": lambda: ShearWind((1, 0, 0), shear_exponent=-1),
    "gust_length = 0 m is not allowed": lambda: Gust((1, 0, 0), 0.0, 0.0),
    "intensity = inf m/s is not allowed": lambda: Turbulence(np.inf),
    "length_scale = 0 m is not allowed": lambda: Turbulence(1.0, 0.0),
    "seed = -1 is not allowed": lambda: Turbulence(1.0, seed=-1),
    "modes = 4 is not allowed": lambda: Turbulence(1.0, modes=4),
    # shapes
    "angles gives arrays of shape [(5,), (2,)]": lambda: waveform(lambda x, q: (x, x[:2])),
    "angles gives arrays of shape [(5,)] for": lambda: waveform(lambda x, q: x),
    "angles of fractions (5,) and coordinates (1,) cannot be used: it fails with "
    "RuntimeError": lambda: waveform(fails),
    "names = ('bow', 'bow') are none, or name one twice": lambda: waveform(
        lambda x, q: (x, x), ("bow", "bow")
    ),
    "names = ('phase', 'bow'): phase must be the last": lambda: waveform(
        lambda x, q: (x, x), ("phase", "bow")
    ),
    "times goes from 1 to 1 s: it must rise": lambda: motion((1.0, 1.0)),
    "times has 1 values: it needs at least 2": lambda: motion((1.0,)),
    "times has 2001 values: at most 2000 are allowed": lambda: motion(range(2001)),
    "stations goes from 0.5 to 0.2 of the length": lambda: motion(stations=(0.5, 0.2)),
    "stations = 1.5 of the length is not allowed": lambda: motion(stations=(0.5, 1.5)),
    "theta has shape (2, 3): it must be (2, 2)": lambda: motion(theta=np.zeros((2, 3))),
    "psi = inf rad is not allowed": lambda: motion(psi=np.full((2, 2), np.inf)),
    # drives and laws
    "Running gives q of shape (5,): the shape's coordinates are 6 (theta_m": lambda: Driven(
        Serpenoid(), Running(np.zeros(5))
    ),
    "inputs = nan is not allowed": lambda: Running([0.0, NAN]),
    "inputs has 1 rows: times has 2": lambda: Programme((0, 1), [GAIT]),
    "times goes from 0 to nan s: it must rise": lambda: Programme((0, NAN), [GAIT, GAIT]),
    "inputs has shape (6,): it must be (K, m)": lambda: Programme((0, 1), np.zeros(6)),
    "natural_frequency = 0 rad/s is not allowed": lambda: actuated(frequency=0.0),
    "damping = -1 is not allowed": lambda: actuated(damping=-1),
    "rate_limit has shape (3,): it must be (2,)": lambda: actuated(rate_limit=np.ones(3)),
    "rate_limit = 0 1/s is not allowed": lambda: actuated(rate_limit=[0.0, 1.0]),
    "low and high: give both or neither": lambda: actuated(low=[0.0, 0.0]),
    "low = 1 is not below high = 0, input 1": lambda: actuated(low=[-1, 1], high=[1, 0]),
    "initial = 3 is not allowed: input 1 must be in [-1, 1]": lambda: actuated(
        initial=(0, 3), low=[-1, -1], high=[1, 1]
    ),
    "law gives inputs of shape (3,): initial has (2,)": lambda: actuated(
        lambda time, seen: jnp.zeros(3)
    ),
    "law cannot be used: it fails with RuntimeError": lambda: actuated(fails),
    "gain has shape (3,): it must be (m, 3)": lambda: AttitudeLaw(np.zeros(2), np.zeros(3)),
    # ends
    "limit = 0 rad is not allowed": lambda: AngleLimit(0.0),
    "angles = ('yaw', 'yaw') is not allowed": lambda: AngleLimit(angles=("yaw", "yaw")),
    "angles = ('sway',) is not allowed": lambda: AngleLimit(angles="sway"),
    "angles = 5 is not allowed": lambda: AngleLimit(angles=5),
    "normal = (0, 0, 0) is not allowed": lambda: Plane((0, 0, 0), 1.0),
    "offset = nan m is not allowed": lambda: Plane((1, 0, 0), NAN),
    "end_time = -1 s is not allowed": lambda: TimeLimit(-1.0),
    "function of the end 'over' gives shape (3,)": lambda: End(
        lambda time, state: state[:3], "over"
    ),
    "function cannot be used: it fails with TypeError": lambda: End(lambda time: time, "over"),
    # flights
    "omega = nan rad/s is not allowed": lambda: Launch(omega=(0, NAN, 0)),
    "t1 = 1 s is not after t0 = 1 s": lambda: integrate(GLIDER, START, 1.0, 1.0),
    "t1 = nan s is not allowed": lambda: integrate(GLIDER, START, 0.0, NAN),
    "state has shape (12,): it must be (13,)": lambda: integrate(GLIDER, START[:12], 0, 1),
    "state = nan is not allowed": lambda: integrate(GLIDER, NAN * START, 0, 1),
    "save = 'sparse' is neither times nor 'dense'": lambda: integrate(
        GLIDER, START, 0, 1, save="sparse"
    ),
    "times = 0.5 s is not allowed": lambda: integrate(GLIDER, START, 1, 2, save=[0.5]),
}


@pytest.mark.parametrize("message", VALUES)
def test_values_that_are_wrong(message):
    with pytest.raises(ValueError, match=f"^{re.escape(message)}") as caught:
        VALUES[message]()
    assert "\n" not in str(caught.value)


KINDS = {
    "polar must be of type AbstractPolar, not Snake": lambda: SweepTheory(SNAKE),
    "polar must be of type AbstractPolar, not int": lambda: LaggingCirculation(3),
    "shape must be of type AbstractShape, not Gait": lambda: Driven(GAIT, Running(GAIT)),
    "drive must be of type AbstractDrive, not Gait": lambda: Driven(Serpenoid(), GAIT),
    "angles = 5 is not a function": lambda: waveform(5),
    "names = (1, 2) are not names": lambda: waveform(lambda x, q: (x, x), (1, 2)),
    "law = 5 is not a function": lambda: actuated(5),
    "function = 5 is not a function": lambda: End(5, "over"),
    "word = 5 is not a text": lambda: End(lambda time, state: state[2], 5),
    "times = 'soon' is not a list of numbers": lambda: Programme("soon", [GAIT, GAIT]),
    "velocity = 'north' is not a number": lambda: UniformWind("north"),
    "chord = None is not a number": lambda: body(chord=None),
    "modes = 8.5 is not a whole number": lambda: Turbulence(1.0, modes=8.5),
    "ends[0] must be of type AbstractEnd, not int": lambda: simulate(GLIDER, ends=5),
    "ends[1] must be of type AbstractEnd, not str": lambda: simulate(
        GLIDER, ends=[TimeLimit(1.0), "ground"]
    ),
}


@pytest.mark.parametrize("message", KINDS)
def test_what_is_of_another_kind(message):
    with pytest.raises(TypeError, match=f"^{re.escape(message)}"):
        KINDS[message]()


# Parts of one's own that break their contract


class Drive(AbstractDrive):
    gives: object = eqx.field(static=True)
    starts: object = eqx.field(static=True, default=lambda: jnp.zeros(0))

    def start(self, phase):
        return self.starts()

    def __call__(self, time, phase, states, observation):
        return self.gives(states)


def moving(size=6):
    return Coordinates(*[jnp.zeros(size)] * 3)


class Air(AbstractAir):
    gives: object = eqx.field(static=True, kw_only=True)

    def wind(self, position, time):
        return self.gives(position)


class Model(AbstractAerodynamics):
    gives: object = eqx.field(static=True)

    def start(self, flow):
        return jnp.zeros(2)

    def __call__(self, flow, states):
        return self.gives(SweepTheory(Polar.smooth())(flow, states)[0], states)


class Coefficients(AbstractPolar):
    gives: object = eqx.field(static=True)
    lift_scale = drag_scale = 1.0

    def __call__(self, beta, reynolds):
        return self.gives(beta)


class Body(AbstractBody):
    gives: object = eqx.field(static=True)

    def sections(self):
        return self.gives(discretise(SNAKE))


class Over(AbstractEnd):
    gives: object = eqx.field(static=True)
    words = ("over", "out")

    def __call__(self, time, state):
        return self.gives(state)


def drive(*given):
    return lambda: Driven(Serpenoid(), Drive(*given))


def flies(ends=(), **parts):
    glider = {"body": SNAKE, "gait": GAIT, **parts}
    return lambda: integrate(Glider(**glider), START, 0.0, 0.1, ends=ends)


def thinner(sections):
    return eqx.tree_at(lambda s: s.chord, sections, sections.chord[:3])


def turned(air):
    return eqx.tree_at(lambda a: a.force, air, air.force.T)


CONTRACTS = {
    "Drive must give Coordinates and the rates": drive(lambda y: moving()),
    "Drive gives q of shape (5,): the shape's coordinates are 6": drive(
        lambda y: (moving(5), y)
    ),
    "Drive cannot be used: it fails with RuntimeError": drive(fails),
    "start of Drive is no array but of type list": drive(lambda y: (moving(), y), list),
    "start of Drive has shape (): it must be (k,)": drive(
        lambda y: (moving(), y), lambda: jnp.zeros(())
    ),
    "Drive's rates of its states has shape (1,): it must be (2,)": drive(
        lambda y: (moving(), y[:1]), lambda: jnp.zeros(2)
    ),
    "wind of Air has shape (3,): it must be (3, 12)": flies(
        air=Air(gives=lambda r: jnp.zeros(3))
    ),
    "wind of Air has shape (12, 3): it must be (3, 12)": flies(air=Air(gives=lambda r: r.T)),
    "wind of Air is no array but of type list": flies(air=Air(gives=list)),
    "Model must give Aerodynamics and the rates": flies(
        aerodynamics=Model(lambda air, y: (air.force, y))
    ),
    "force of Model has shape (12, 3): it must be (3, 12)": flies(
        aerodynamics=Model(lambda air, y: (turned(air), y))
    ),
    "Model's rates of its states has shape (1,): it must be (2,)": flies(
        aerodynamics=Model(lambda air, y: (air, y[:1]))
    ),
    "Coefficients must give C_L and C_D": flies(
        aerodynamics=Coefficients(lambda beta: 0.0 * beta)
    ),
    "C_D of Coefficients has shape (3,): it must be (12,)": flies(
        aerodynamics=Coefficients(lambda beta: (beta, beta[:3]))
    ),
    "sections of Body must be of type Sections, not None": flies(body=Body(lambda s: None)),
    "chord of Body has shape (3,): it must be (12,)": flies(body=Body(thinner)),
    "what Over gives has shape (1,): it must be (2,)": flies(Over(lambda y: y[2:3])),
    "what Over gives is no array but of type float": flies(Over(lambda y: 1.0)),
}


@pytest.mark.parametrize("message", CONTRACTS)
def test_parts_of_ones_own_that_break_their_contract(message):
    with pytest.raises((TypeError, ValueError), match=f"^{re.escape(message)}") as caught:
        CONTRACTS[message]()
    assert "\n" not in str(caught.value)


def test_wind_of_ones_own_that_is_not_finite_ends_the_flight_at_once():
    flown = integrate(
        Glider(SNAKE, GAIT, air=Air(gives=lambda r: jnp.nan * r)), START, 0.0, 0.1
    )
    assert flown.ending == "not finite"


TABLES = {
    "column .density. is missing": "position,chord\n0,0.1\n1,0.1\n",
    "position goes from 0.5 to 0.5 m": "position,chord,density\n0,1,1\n0.5,1,1\n0.5,1,1\n",
    "the body has no mass": "position,chord,density\n0,1,0\n1,1,0\n",
}


@pytest.mark.parametrize("message", TABLES)
def test_files_of_bodies(message, tmp_path):
    path = tmp_path / "robot.csv"
    path.write_text(TABLES[message])
    with pytest.raises(ValueError, match=rf"robot\.csv.*{message}") as caught:
        TabulatedBody.from_csv(path)
    assert "\n" not in str(caught.value)


POLARS = {
    r"angle_of_attack = 0 deg stands twice": "0,1,1\n0,1,1\n5,1,1\n",
    r"angle_of_attack goes from 5 to 0 deg: it must rise": "5,1,1\n0,1,1\n",
    r"drag = -1 is not allowed": "0,1,-1\n5,1,1\n",
}


@pytest.mark.parametrize("message", POLARS)
def test_files_of_polars(message, tmp_path):
    path = tmp_path / "polar.csv"
    path.write_text("angle_of_attack,lift,drag\n" + POLARS[message])
    with pytest.raises(ValueError, match=rf"polar\.csv.*{message}") as caught:
        TabulatedPolar.from_csv(path)
    assert "\n" not in str(caught.value)


def test_files_of_polars_that_lack_an_angle(tmp_path):
    path = tmp_path / "polar.csv"
    path.write_text("angle_of_attack,reynolds,lift,drag\n0,1e4,1,1\n5,1e4,1,1\n0,2e4,1,1\n")
    with pytest.raises(ValueError, match="= 5 deg is missing at reynolds = 20000"):
        TabulatedPolar.from_csv(path)
