"""How sure steady glides are: nodes, polars, coefficients; and the averaged model."""

from common import arguments, save_figure, write_table  # first: it sets up JAX

# isort: split
import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from jaxglide import (
    Gait,
    Glider,
    Launch,
    Polar,
    Snake,
    SteadyGlide,
    Uncertainty,
    averaged_glide,
    simulate,
    standard_deviation,
    steady_glide,
)
from jaxglide.loads.coefficients import ALPHA, REYNOLDS, extended_tables
from jaxglide.loads.harmonics import cross_validation

# name: gait, and a state near its steady glide
GAITS = {
    "published": (
        Gait.from_degrees(nu_theta=1.4),
        (-1.35, 6.32, -9.57, -1.75, 1.45, 0.66, -0.802, -0.180),
    ),
    "143 m": (
        Gait.from_degrees(60, 0.0, 1.738, 1.30, 5.5),
        (0.09, 8.94, -3.80, 0.017, 0.932, -0.780, -0.0863, -0.0789),
    ),
}
POLARS = {
    "band-limited": Polar.band_limited(),
    "smooth": Polar.smooth(),
    "published": Polar.published(),
}
SETS = (("gauss", (60, 120, 200)), ("published", (70,)))
FREQUENCIES = np.concatenate([np.arange(0.6, 1.2, 0.1), np.arange(1.2, 4.01, 0.2)])  # Hz
NODES = 60
SAMPLES = 100


def glider(gait: str, polar: str = "band-limited", nodes: int = NODES, kind: str = "gauss"):
    body = Snake.from_svl(0.70, nodes=nodes, node_set=kind)
    return Glider(body, GAITS[gait][0], POLARS[polar])


def found(gait: str, *settings) -> SteadyGlide:
    return steady_glide(glider(gait, *settings), GAITS[gait][1])


def degrees(angle) -> float:
    return float(np.rad2deg(angle))


def nodes_and_polars():
    """Rows: glide angle and largest moduli on each set of nodes with each polar."""
    for polar in POLARS:
        for kind, counts in SETS:
            for nodes in counts:
                row = [polar, f"{nodes} {kind}"]
                for gait in GAITS:
                    glide = found(gait, polar, nodes, kind)
                    moduli = np.abs(np.asarray(glide.multipliers))
                    row += [degrees(glide.glide_angle), float(moduli[0]), float(moduli[1])]
                print(*row)
                yield row


def drawn(rng, polar: Polar, deviations: np.ndarray, scale: float = 1.0) -> Polar:
    """A polar drawn from the covariance."""
    cells = scale * np.tensordot(rng.normal(size=len(deviations)), deviations, 1)
    return eqx.tree_at(lambda polar: polar.cells, polar, polar.cells + cells)


def numbers(glide: SteadyGlide | Uncertainty) -> dict[str, float]:
    return {
        "glide angle (deg)": degrees(glide.glide_angle),
        "speed (m/s)": float(glide.speed),
        "sink rate (m/s)": float(glide.sink_rate),
        "spectral radius": float(glide.spectral_radius),
    }


def uncertainties(size: int):
    """Rows: values, what they may be off, by first order and by samples; and the samples."""
    polar, rows, radii = POLARS["band-limited"], [], {}
    spread = polar.spread()
    assert spread is not None
    deviations = np.asarray(spread.cells)
    for gait in GAITS:
        glide = found(gait)
        by_first, by_nodes = glide.uncertainty, glide.discretisation
        assert by_first is not None
        rng, samples = np.random.default_rng(0), []
        for _ in range(size):
            other = eqx.tree_at(
                lambda g: g.aerodynamics.polar, glide.glider, drawn(rng, polar, deviations)
            )
            again = steady_glide(other, glide.state)
            if bool(again.found):
                samples.append(numbers(again))
        radii[gait] = np.array([one["spectral radius"] for one in samples])
        first = numbers(by_first)
        for name, value in numbers(glide).items():
            scatter = np.array([one[name] for one in samples])
            row = (gait, name, value, first[name], float(scatter.std(ddof=1)))
            rows.append((*row, numbers(by_nodes)[name]))
        below = float(np.mean(radii[gait] < 1))
        print(f"{gait}: {len(samples)} of {size} found, {below:.0%} of them stable")
    rows.append(landing(polar, deviations, size))
    return rows, radii


def landing(polar: Polar, deviations: np.ndarray, size: int):
    """The same of the landing distance of the published gait from 10 m."""
    base = glider("published")

    def distance(glider):
        return simulate(glider, Launch(height=10.0)).landing_point[1]

    rng, where = np.random.default_rng(0), lambda g: g.aerodynamics.polar
    ends = [
        float(distance(eqx.tree_at(where, base, drawn(rng, polar, deviations))))
        for _ in range(size)
    ]
    off = float(standard_deviation(distance, base))
    values = float(distance(base)), off, float(np.std(ends, ddof=1)), float("nan")
    return "published", "landing distance from 10 m (m)", *values


def over_frequency(gait: str):
    """Glide angle [deg] and growth of the least stable mode [1/s], full and averaged."""
    base, state = glider(gait), jnp.asarray(GAITS[gait][1])
    middle = int(np.argmin(np.abs(FREQUENCIES - 1.2)))
    order = [*range(middle, len(FREQUENCIES)), *range(middle - 1, -1, -1)]
    table, ends = np.full((len(FREQUENCIES), 4), np.nan), {}
    for k in order:
        moved = dataclasses.replace(base.gait, f_theta=float(FREQUENCIES[k]))
        here = dataclasses.replace(base, gait=moved)
        near = ends.get(k - 1, ends.get(k + 1, (state, None)))
        full = steady_glide(here, near[0])
        mean = averaged_glide(here) if near[1] is None else averaged_glide(here, near[1])
        ends[k] = (
            full.state if bool(full.found) else near[0],
            mean.state if bool(mean.found) else near[1],
        )
        growth = [float(np.real(one.exponents[0])) for one in (full, mean)]
        angles = [degrees(one.glide_angle) for one in (full, mean)]
        table[k] = *angles, *growth
    return table


def certainty_figure(radii) -> Figure:
    figure = Figure(figsize=(11, 3.4), layout="constrained")
    left, middle, right = figure.subplots(1, 3)
    orders = np.arange(2, 25)
    errors = np.array([cross_validation(int(k)) for k in orders])
    left.plot(orders, errors[:, 0], "o-", ms=3, label="$C_L$")
    left.plot(orders, errors[:, 1], "s-", ms=3, label="$C_D$")
    left.set(xlabel="harmonics", ylabel="error at an angle left out (rms)", ylim=(0, None))
    left.legend()
    beta, polar = np.deg2rad(np.arange(-90, 91.0)), Polar.band_limited()
    spread = polar.spread()
    at = lambda p: jnp.stack(p(beta, 9000.0))  # noqa: E731
    moved = jax.vmap(lambda d: jax.jvp(at, (polar,), (d,))[1])(spread)
    sd, mean = np.sqrt(np.sum(np.square(moved), axis=0)), np.asarray(at(polar))
    smooth, column = np.asarray(at(Polar.smooth())), int(np.argmin(abs(REYNOLDS - 9000)))
    for k, (name, colour) in enumerate((("$C_L$", "C0"), ("$C_D$", "C1"))):
        x = np.rad2deg(beta)
        middle.fill_between(
            x, mean[k] - 2 * sd[k], mean[k] + 2 * sd[k], color=colour, alpha=0.25
        )
        middle.plot(x, mean[k], color=colour, label=name)
        middle.plot(x, smooth[k], ":", color=colour, lw=1)
        data = extended_tables()[k][:15, column]
        middle.plot(ALPHA[:15], data, "o", ms=3, color=colour)
    middle.set(xlabel="angle of attack (deg)", ylabel="coefficient at Re 9000")
    middle.legend()
    for k, (gait, values) in enumerate(radii.items()):
        right.hist(values, bins=20, alpha=0.6, color=f"C{k + 2}", label=f"{gait} gait")
    right.axvline(1, color="k", lw=1)
    right.set(xlabel="spectral radius", ylabel="polars drawn", xscale="log")
    right.legend()
    return figure


def averaged_figure(tables) -> Figure:
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for k, (gait, table) in enumerate(tables.items()):
        for axes, first in ((left, 0), (right, 2)):
            axes.plot(FREQUENCIES, table[:, first], f"C{k}o-", ms=3, label=f"{gait} gait")
            axes.plot(FREQUENCIES, table[:, first + 1], f"C{k}--", label="averaged")
    right.axhline(0, color="k", lw=1)
    left.set(xlabel="frequency (Hz)", ylabel="glide angle (deg)", ylim=(0, None))
    right.set(xlabel="frequency (Hz)", ylabel="growth of the least stable mode (1/s)")
    left.legend()
    return figure


def main() -> None:
    options = arguments(__doc__)
    tables = {gait: over_frequency(gait) for gait in GAITS}
    names = ("glide angle (deg)", "averaged (deg)", "growth (1/s)", "averaged (1/s)")
    rows = [
        (gait, float(f), *map(float, row))
        for gait, table in tables.items()
        for f, row in zip(FREQUENCIES, table, strict=True)
    ]
    write_table(options.out / "steady_averaged", ("gait", "frequency (Hz)", *names), rows)
    save_figure(averaged_figure(tables), options.out / "steady_averaged.png")

    rows, radii = uncertainties(options.size or SAMPLES)
    header = ("gait", "number", "value", "by the coefficients", "by samples", "by nodes")
    write_table(options.out / "steady_certainty", header, rows)
    save_figure(certainty_figure(radii), options.out / "steady_certainty.png")

    each = [f"{gait}: {name}" for gait in GAITS for name in ("angle", "largest", "second")]
    rows = list(nodes_and_polars())
    write_table(options.out / "steady_nodes", ("polar", "nodes", *each), rows)


if __name__ == "__main__":
    main()
