"""Turns: how far inertia turns a body and how far the air, by bias and by its timing."""

from common import arguments, save_figure, write_table  # first: it sets up JAX

# isort: split
import dataclasses
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from jaxglide import (
    AngleLimit,
    Branch,
    Case,
    CoordinatedTurn,
    Environment,
    Gait,
    Glider,
    Ground,
    Launch,
    Polar,
    Senses,
    Snake,
    SteadyGlide,
    Waypoints,
    controlled_flight,
    discretise,
    elements,
    integrate,
    linear_quadratic,
    steady_branch,
    steady_glide,
)
from jaxglide.flight.attitude import angle_rates
from jaxglide.flight.dynamics import ANGLES, OMEGA, Flight
from jaxglide.loads.inertia import angular_momentum, inertia_tensor
from jaxglide.plot._style import FAINT, INK, PAGE_WIDTH, PITCH, ROLL, YAW, new_figure, style
from jaxglide.shape.gait import wave_phase, waves
from jaxglide.shape.motion import in_neck

BODY = Snake.from_svl(0.70, nodes=40, node_set="gauss")
GAITS = {
    "published": Gait.from_degrees(),
    "long": Gait.from_degrees(60, 10.0, 1.738, 1.30, 5.5),
    "flat": Gait.from_degrees(82, 12.6, 1.12, 1.58, 7.2),
    "frozen dive": Gait.from_degrees(nu_theta=1.2, f_theta=0.0),
}
COLOURS = {"published": INK, "long": ROLL, "flat": YAW, "frozen dive": PITCH}
BIAS, POINTS = 30.0, 60  # deg per SVL; points of a branch, each way
BIASES = (0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0)
HARMONICS = (1, 2)  # of the waves' phase
SMALL = np.deg2rad(1e-7)  # a bias that makes no difference but costs the mirror
PACES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)  # rad a cycle
COURSES = 64
LONGEST = 260  # samples of a flight


class Timed(Gait):
    """A gait whose biases also follow the waves.

    Args:
        swings: of d_theta and d_psi [rad per SVL], for each harmonic of the waves' phase the
            cosine's and the sine's amplitude, (2, H, 2).
    """

    swings: Any = eqx.field(converter=jnp.asarray, default=((((0.0, 0.0),) * 2,) * 2))

    def bending(self, fraction, neck_fraction, time, phase, states, observation):
        now = wave_phase(self, phase, time)
        return self._bent(fraction, neck_fraction, *now), states

    def cycle(self, fraction, neck_fraction, phase):
        return self._bent(fraction, neck_fraction, phase, 1.0)

    def _bent(self, fraction, neck_fraction, phase, rate):
        bent = waves(self, neck_fraction, fraction, phase, rate)
        x, ramp = in_neck(fraction, neck_fraction)
        m = jnp.array(HARMONICS)
        turns = jnp.stack([jnp.cos(m * phase), jnp.sin(m * phase)], axis=1)
        rates = rate * m[:, None] * jnp.stack([-turns[:, 1], turns[:, 0]], axis=1)
        seconds = -((rate * m[:, None]) ** 2) * turns
        value, dot, ddot = (
            jnp.einsum("ihc,hc->i", self.swings, basis)[:, None] * ramp * x
            for basis in (turns, rates, seconds)
        )
        return bent._replace(
            theta=bent.theta + value[0],
            theta_dot=bent.theta_dot + dot[0],
            theta_ddot=bent.theta_ddot + ddot[0],
            psi=bent.psi + value[1],
            psi_dot=bent.psi_dot + dot[1],
            psi_ddot=bent.psi_ddot + ddot[1],
        )


def timed(gait: Gait, swings=None) -> Timed:
    """The gait, with biases that follow the waves; never its own mirror image."""
    known = {field.name: getattr(gait, field.name) for field in dataclasses.fields(gait)}
    known["d_theta"] = known["d_theta"] + SMALL
    return Timed(**known) if swings is None else Timed(**known, swings=swings)


def glider_of(gait: Gait) -> Glider:
    return Glider(BODY, gait, Polar.smooth())


@eqx.filter_jit
def by_inertia(gait: Gait):
    """Yaw, pitch, roll after a cycle from level, without air and angular momentum [rad]."""
    glider = Glider(BODY, gait, Polar.published(0.0, 0.0), gravity=0.0)
    flight = Flight(glider, discretise(BODY), jnp.zeros(()))
    now = elements(jnp.zeros(()), jnp.zeros(13), flight)
    tensor = inertia_tensor(flight.sections, now.body)
    spin = -jnp.linalg.solve(tensor, angular_momentum(flight.sections, now.body))
    start = jnp.zeros(13).at[OMEGA].set(spin)
    cycle: Any = 1 / gait.f_theta
    return integrate(glider, start, 0.0, cycle, rtol=1e-9, atol=1e-9).state[ANGLES]


@eqx.filter_jit
def turning(glide: SteadyGlide):
    """Rates of yaw along a cycle [rad/s]: of inertia alone, and of the angular momentum that
    the air has given; and the horizontal force over the vertical one of the air."""
    flight = Flight(glide.glider, discretise(BODY), glide.phase)

    def at(time, state):
        now = elements(time, state, flight)
        tensor = inertia_tensor(flight.sections, now.body)
        own = -jnp.linalg.solve(tensor, angular_momentum(flight.sections, now.body))
        rate = [angle_rates(state[ANGLES], w)[0] for w in (own, state[OMEGA] - own)]
        return jnp.stack(rate)

    rates = jax.vmap(at)(glide.times[:-1], glide.states[:-1])
    return jnp.mean(rates, axis=0)


def first_part(branch: Branch) -> slice:
    """Points from the start upwards, as far as the number rises."""
    start = list(branch.kinds).index("start")
    falls = np.flatnonzero(np.diff(branch.parameter[start:]) <= 0)
    return slice(start, start + int(falls[0]) + 1 if len(falls) else None)


def helices(name: str, glider: Any, branch: Branch) -> list[tuple]:
    """Rows of the coordinated turns at some biases, on the branch from the straight glide."""
    part, rows = first_part(branch), []
    known = branch.parameter[part]
    for bias in BIASES:
        if bias > known[-1]:
            break
        guess = [np.interp(bias, known, column) for column in branch.state[part].T]
        gait = dataclasses.replace(glider.gait, d_theta=jnp.deg2rad(bias))
        glide = steady_glide(dataclasses.replace(glider, gait=gait), guess)
        if not bool(glide.found):
            continue
        own, given = np.rad2deg(turning(glide)) if not glide.frozen else (0.0, np.nan)
        rate = float(np.rad2deg(glide.turn_rate))
        alone = 0.0 if glide.frozen else float(np.rad2deg(by_inertia(gait)[0] * gait.f_theta))
        lean = np.rad2deg(np.arctan(glide.forward_speed * glide.turn_rate / 9.81))
        held = rate if glide.frozen else float(given)
        angle = float(np.rad2deg(glide.glide_angle))
        figures = (rate, float(glide.turn_radius), float(lean), angle)
        radius = float(glide.spectral_radius)
        rows.append((name, bias, *figures, radius, alone, float(own), held))
    return rows


def limits(name: str, branch: Branch) -> tuple:
    """A row: how fast it turns by a small bias, and where the first part ends."""
    part = first_part(branch)
    k = part.start, part.start + 1
    slope = np.rad2deg(np.diff(branch.turn_rate[list(k)])) / np.diff(branch.parameter[list(k)])
    last = len(branch.parameter[part]) - 1 + part.start
    ends = branch.parameter[last], np.rad2deg(branch.turn_rate[last])
    stable = np.flatnonzero(branch.stable)
    if not len(stable):
        return (name, float(slope[0]), *map(float, ends), None, None, None)
    best = stable[np.argmax(np.abs(branch.turn_rate[stable]))]
    rate = abs(branch.turn_rate[best])
    fastest = np.rad2deg(rate), branch.forward_speed[best] / rate
    angle = np.rad2deg(branch.glide_angle[best])
    return (name, float(slope[0]), *map(float, (*ends, *fastest, angle)))


def timings(name: str, glider: Any, glide: SteadyGlide) -> list[tuple]:
    """Rows of the first-order effects of biases that are held, or follow the waves."""
    gait = timed(glider.gait)

    def changed(amounts):
        swings = amounts[2:].reshape(2, len(HARMONICS), 2)
        told = {"d_theta": gait.d_theta + amounts[0], "d_psi": gait.d_psi + amounts[1]}
        return dataclasses.replace(gait, **told, swings=swings)

    def flown(amounts):
        found = steady_glide(dataclasses.replace(glider, gait=changed(amounts)), glide.state)
        return jnp.stack([found.turn_rate, found.glide_angle])

    none = jnp.zeros(2 + 4 * len(HARMONICS))
    air = np.asarray(jax.jacfwd(flown)(none))
    alone = np.asarray(jax.jacfwd(lambda amounts: by_inertia(changed(amounts)))(none))[:2]
    effects = np.concatenate([air, alone * float(gait.f_theta)])
    rows = []
    for i, label in enumerate(("d_theta", "d_psi")):
        rows.append((name, label, "held", *effects[[0, 2, 1, 3], i].tolist(), None))
        pairs = effects[:, 2:].reshape(4, 2, len(HARMONICS), 2)[:, i]
        for h, harmonic in enumerate(HARMONICS):
            sizes = np.linalg.norm(pairs[:, h], axis=1)
            best = np.rad2deg(np.arctan2(pairs[0, h, 1], pairs[0, h, 0]))
            told = f"{harmonic} a cycle"
            rows.append((name, label, told, *sizes[[0, 2, 1, 3]].tolist(), float(best)))
    return rows


def around(glider: Any, glide: SteadyGlide, label: int, harmonic: int, size: float):
    """Turn rate [deg/s] in air and without, over the phase of a bias [rad]; of steady glides
    followed from one phase to the next."""
    phases = np.linspace(0, 2 * np.pi, 25)
    found, alone, guess = [], [], glide.state
    for phase in phases:
        swings = np.zeros((2, len(HARMONICS), 2))
        swings[label, HARMONICS.index(harmonic)] = np.cos(phase), np.sin(phase)
        gait = timed(glider.gait, np.deg2rad(size) * swings)
        here = steady_glide(dataclasses.replace(glider, gait=gait), guess)
        guess = here.state if bool(here.found) else glide.state
        found.append(float(np.rad2deg(here.turn_rate)))
        alone.append(float(np.rad2deg(by_inertia(gait)[0] * gait.f_theta)))
    return phases, np.array(found), np.array(alone)


def nearest(path, points):
    """Least horizontal distance of a path (N, 2) from each point [m]."""
    start, step = path[:-1], np.diff(path, axis=0)
    share = np.einsum("kni,ni->kn", points[:, None] - start, step)
    share = np.clip(share / np.maximum((step**2).sum(axis=1), 1e-12), 0, 1)
    there = start + share[..., None] * step
    return np.linalg.norm(there - points[:, None], axis=2).min(axis=1)


def flights_of(gait: Gait, **senses) -> tuple[Environment, Any]:
    ends = Ground(), AngleLimit(angles=("pitch", "roll"))
    case = Case(glider_of(gait), Launch(height=75.0), ends)
    environment = Environment(case, senses=Senses(place=True, **senses))
    return environment, linear_quadratic(environment)


def paced(name: str, environment: Environment, regulator) -> list[tuple]:
    """Rows of turns by 150 degrees to either side, at several paces, from 75 m."""

    def fly(heading, pace):
        law = CoordinatedTurn(regulator)
        law = eqx.tree_at(lambda l: (l.pace, l.regulator.heading), law, (pace, heading))  # noqa: E741
        return controlled_flight(environment, law, jax.random.key(0), LONGEST)

    sides = np.deg2rad([150.0, -150.0])
    given = np.repeat(sides, len(PACES)), np.tile(np.array(PACES), 2)
    flown: Any = jax.vmap(fly)(*map(jnp.asarray, given))
    frequency = 1 / (regulator.K.shape[0] * float(environment.plant.interval))
    rows = []
    for side in range(2):
        for k, pace in enumerate(PACES):
            at = side * len(PACES) + k
            flying = ~np.asarray(flown.over[at])
            yaw = np.rad2deg(np.asarray(flown.states[at])[flying][::8, 9])
            rate = np.rad2deg(pace) * frequency
            reached = float(yaw[-1]) if len(yaw) else np.nan
            where = ("left", "right")[side]
            rows.append((name, where, pace, rate, bool(flown.landed[at]), reached))
    return rows


def courses() -> np.ndarray:
    """Two points each: at 40 to 60 m within 25 degrees, and 40 m on, at up to 60 degrees."""
    rng = np.random.default_rng(0)
    first = np.deg2rad(rng.uniform(-25, 25, COURSES))
    second = first + np.deg2rad(rng.uniform(-60, 60, COURSES))
    far = rng.uniform(40, 60, COURSES)
    ways = [np.stack([np.sin(a), np.cos(a)], axis=1) for a in (first, second)]
    points = far[:, None] * ways[0]
    return np.stack([points, points + 40 * ways[1]], axis=1)


def steered(environment: Environment, regulator, points, pace: float):
    """Paths over the ground to points, (K, 2, 2), and whether they landed."""
    law = CoordinatedTurn(regulator, pace)

    def fly(points, key):
        policy = Waypoints(law, points)
        return controlled_flight(environment, policy, key, LONGEST)

    keys = jax.random.split(jax.random.key(0), len(points))
    flown: Any = jax.vmap(fly)(jnp.asarray(points), keys)
    paths = [
        np.vstack([flown.states[k, ~np.asarray(flown.over[k]), :2], end[None, :2]])
        for k, end in enumerate(np.asarray(flown.ended.state))
    ]
    return paths, np.asarray(flown.landed)


@style()
def turns_figure(branches: dict[str, Branch], alone: dict[str, np.ndarray]) -> Figure:
    """Turn rate, radius and glide angle over bias."""
    figure = new_figure(PAGE_WIDTH, 62.0)
    figure.set_layout_engine("constrained")
    rates, radii, angles = figure.subplots(1, 3)
    for name, branch in branches.items():
        colour, turn = COLOURS[name], np.rad2deg(branch.turn_rate)
        radius = branch.forward_speed / np.maximum(np.abs(branch.turn_rate), 1e-6)
        for ax, x, y in (
            (rates, branch.parameter, turn),
            (radii, np.abs(turn), radius),
            (angles, np.abs(turn), np.rad2deg(branch.glide_angle)),
        ):
            ax.plot(x, y, color=colour, linewidth=0.7)
            ax.plot(x, np.where(branch.stable, y, np.nan), color=colour, linewidth=2.2)
        if name in alone:
            rates.plot(*alone[name], "--", color=colour, linewidth=0.7)
        angles.plot([], [], color=colour, label=name)
    angles.plot([], [], "--", color=FAINT, label="without air")
    rates.set_xlabel("lateral bias (° per SVL)")
    rates.set_ylabel("turn rate to the left (°/s)")
    rates.set_ylim(-60, 60)
    radii.set_xlabel("turn rate (°/s)")
    radii.set_ylabel("radius (m)")
    radii.set_yscale("log")
    radii.set_ylim(2, 300)
    angles.set_xlabel("turn rate (°/s)")
    angles.set_ylabel("glide angle (°)")
    angles.legend(loc="center right", bbox_to_anchor=(1.0, 0.45))
    return figure


@style()
def timing_figure(swept: dict[str, Any], paths, points) -> Figure:
    """Turn rate over the phase of a bias, and flights to points."""
    figure = new_figure(PAGE_WIDTH, 62.0)
    figure.set_layout_engine("constrained")
    axes = figure.subplots(1, 3)
    for ax, (title, (phases, air, alone)) in zip(axes, swept.items(), strict=False):
        ax.plot(np.rad2deg(phases), air, color=YAW, label="steady glide")
        ax.plot(np.rad2deg(phases), alone, "--", color=FAINT, label="without air")
        ax.set_title(title)
        ax.set_xlabel("phase of the bias against the waves (°)")
        ax.set_ylabel("turn rate to the left (°/s)")
        ax.set_xticks((0, 90, 180, 270, 360))
    axes[0].legend()
    ax = axes[2]
    for colour, path, ends in zip((YAW, ROLL, PITCH, INK), paths, points, strict=False):
        ax.plot(*path.T, color=colour)
        ax.plot(*ends.T, "o", color=colour, markersize=3)
    ax.set_aspect("equal")
    ax.set_xlabel("to the right (m)")
    ax.set_ylabel("forward (m)")
    return figure


def main() -> None:
    options = arguments(__doc__)
    branches, alone, turned, ends, timing = {}, {}, [], [], []
    glides = {}
    for name, gait in GAITS.items():
        glider = glider_of(gait)
        glides[name] = glide = steady_glide(glider)
        branch = steady_branch(glider, "d_theta", -BIAS, BIAS, start=glide, points=POINTS)
        branches[name] = branch
        turned += helices(name, glider, branch)
        ends.append(limits(name, branch))
        if glide.frozen:
            continue
        biases = np.linspace(-BIAS, BIAS, 13)
        bent = [dataclasses.replace(gait, d_theta=jnp.deg2rad(b)) for b in biases]
        rates = [float(np.rad2deg(by_inertia(one)[0] * gait.f_theta)) for one in bent]
        alone[name] = biases, np.array(rates)
        timing += timings(name, glider, glide)
    figures = ("turning (deg/s)", "radius (m)", "lean (deg)", "path (deg)", "spectral radius")
    rates = ("without air (deg/s)", "by inertia (deg/s)", "by the air (deg/s)")
    header = ("gait", "bias (deg)", *figures, *rates)
    write_table(options.out / "turning", header, turned)
    fastest = ("fastest stable (deg/s)", "its radius (m)", "its path (deg)")
    header = ("gait", "deg/s per deg", "first end (deg)", "turning there (deg/s)", *fastest)
    write_table(options.out / "turning_limits", header, ends)
    effects = ("turn in air (1/s)", "turn without (1/s)", "path in air", "pitch without (1/s)")
    header = ("gait", "bias", "timing", *effects, "best phase (deg)")
    write_table(options.out / "turning_timing", header, timing)
    flat = glider_of(GAITS["flat"])
    swept = {
        "d_θ, 0.5° twice a cycle": around(flat, glides["flat"], 0, 2, 0.5),
        "d_ψ, 0.1° once a cycle": around(flat, glides["flat"], 1, 1, 0.1),
    }
    environment, regulator = flights_of(GAITS["flat"], velocity=True)
    rows = paced("flat", environment, regulator)
    steep, other = flights_of(Gait.from_degrees(d_psi=5), velocity=True)
    rows += paced("published, d_psi 5", steep, other)
    header = ("gait", "side", "pace (rad a cycle)", "deg/s", "landed", "yaw at last (deg)")
    write_table(options.out / "turning_paces", header, rows)
    points, sensed = courses(), []
    noisy, observer = flights_of(GAITS["flat"], angle_noise=0.02, delay=0.02)
    paths = []
    for label, flown, law in (
        ("all", environment, regulator),
        ("attitude, noise, delay", noisy, observer),
    ):
        for pace in (0.1, 0.2):
            paths, landed = steered(flown, law, points, pace)
            apart = np.array([nearest(p, q) for p, q in zip(paths, points, strict=True)])
            within = 100 * (apart < 2).mean(axis=0)
            medians = np.median(apart, axis=0)
            shares = (*within.tolist(), *medians.tolist())
            sensed.append((label, pace, len(points), int(landed.sum()), *shares))
    names = ("first within 2 m (%)", "second within 2 m (%)", "first (m)", "second (m)")
    header = ("senses", "pace (rad a cycle)", "flights", "landed", *names)
    write_table(options.out / "turning_points", header, sensed)
    shown = np.array([[[-20, 50], [0, 90]], [[10, 50], [50, 70]], [[-30, 30], [-70, 30]]])
    paths, _ = steered(environment, regulator, shown, 0.2)
    save_figure(turns_figure(branches, alone), options.out / "turning.png")
    save_figure(timing_figure(swept, paths, shown), options.out / "turning_timing.png")


if __name__ == "__main__":
    main()
