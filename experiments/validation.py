"""The page of validation: every number of the paper and of the literature beside ours.

What is cheap is computed; what needs the public recordings or an hour is read from the pages
of findings of a clone, whose own commands make it. Writes `validation.md`.
"""

import re
from pathlib import Path

from common import arguments  # first: it sets up JAX

# isort: split
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from figure_5 import trim_bend
from validation_rows import MINUS, ROWS, SOURCES, Row

from jaxglide import (
    Gait,
    Glider,
    Launch,
    Outcome,
    Polar,
    Snake,
    discretise,
    fall,
    integrate,
    simulate,
    take_off,
)
from jaxglide._lib.writing import write_text
from jaxglide.ensemble.published import (
    BENDS,
    NU_THETA,
    THETA_M,
    bending_study,
    long_summary,
    regions,
    shape_space,
    summary,
)
from jaxglide.ensemble.survey import survey
from jaxglide.ensemble.sweep import sweep
from jaxglide.flight.dynamics import ANGLES, OMEGA, POSITION, VELOCITY
from jaxglide.loads.coefficients import REYNOLDS
from jaxglide.loads.inertia import angular_momentum, inertia_tensor
from jaxglide.shape.gait import waves
from jaxglide.shape.kinematics import backbone

FINDINGS = Path(__file__).resolve().parents[1] / "docs" / "findings"
SNAKE = Snake.from_svl(0.70)
PUBLISHED = Glider(SNAKE, Gait.from_degrees(nu_theta=1.4), Polar.published())
Value = float | tuple[str, bool]
"""A number, or a statement's words and whether they bear it out."""

HEAD = """# Validation

The page that a sceptic reads first.

**What agrees.** The model is the paper's. Every share of stable glides in its table S1 is
met, its path lengths to about 1 % (they are summed one step too far), its mean distances in
figure 5 to a centimetre, and the moments, launches and paths of its research code to 0.05 %.

**What does not.** Some of the paper's sentences are simpler than its model; the rows below
say which. Above all the model, theirs and so ours, **glides half as far as the animals**, and
two thirds as far as the 36 measured flights; the paper says "slightly less".

**What was never measured.** The force on a whole snake in flight; on sections below -10° and
above 60° angle of attack, between the angles measured, and in unsteady flow; any moment at
all. Nothing here tests those, and gaits far from the observed ones lean on them.

`jaxglide figure validation` writes this page. A row marked † is not computed by it but stands
on the page of [measured flights](findings/measured.md) or of [fitted
forces](findings/fitted.md), whose commands need the public recordings. The last column
numbers the [tests](#tests) that hold the rows. Reduced models with other equations (Jafari
and others, 2014 and 2017) have no number that this one can be asked for.
""".replace("-10", f"{MINUS}10")


def animal() -> dict[str, Value]:
    """The body, its waves and its launch."""
    body = SNAKE
    start = take_off(PUBLISHED, Launch(), discretise(body))
    yaw, pitch, roll = map(float, jnp.rad2deg(start.angles))
    return {
        "mass": 1e3 * float(body.mass),
        "neck": 100 * float(body.neck_fraction),
        "shapes": float(regions().size),
        "theta_low": float(THETA_M.min()),
        "theta_high": float(THETA_M.max()),
        "speed": float(start.speed),
        "phase": float(start.phi_theta),
        **{"yaw": yaw, "pitch": pitch, "roll": roll},
    }


def sections() -> dict[str, Value]:
    """Force coefficients, over angles of attack from 0 to 60 degrees and Reynolds numbers."""
    degrees = np.arange(0.0, 61.0, 5.0)
    alpha, number = np.meshgrid(np.deg2rad(degrees), REYNOLDS, indexing="ij")
    lift, drag = map(np.asarray, Polar.published()(jnp.asarray(alpha), jnp.asarray(number)))
    at, _ = np.unravel_index(lift.argmax(), lift.shape)
    peak = lift[degrees == 35] - (lift[degrees == 30] + lift[degrees == 40]) / 2
    with_peak = REYNOLDS[peak[0] > 0.1]
    return {
        "most_lift": float(lift.max()),
        "stall": float(degrees[at]),
        "most_ratio": float((lift / drag).max()),
        "peak": (f"from Re {with_peak[0]:.0f}", len(with_peak) == len(REYNOLDS)),
    }


def shapes(options) -> dict[str, Value]:
    """The tables of the shape space."""
    short = shape_space(10.0, store=options.store("validation_10m"))
    tall = shape_space(75.0, store=options.store("validation_75m"))
    values: dict[str, Value] = {}
    for name, f_theta, region, ours, _ in summary(short):
        values[f"{name}, {f_theta:g} Hz, {region}"] = ours
    for name, region, ours, _ in long_summary(tall):
        values[f"75 m: {name}, {region}"] = ours
    increase = tall.path_length.sel(f_theta=1.2) - tall.path_length.sel(f_theta=0.0)
    lost = increase.where((increase < 0) & (increase.region == "observed"))
    return {**values, "frozen_farther": -float(lost.mean())}


def bends(options) -> dict[str, Value]:
    """Free glides at five bends."""
    data = sweep(bending_study(times=None), options.store("validation_bends"))
    forward = data.landing_point.sel(axis="y").values.reshape(3, 5, 11)
    outcome = data.outcome.values.reshape(3, 5, 11)[2]
    landed = (outcome == Outcome.LANDED).sum(axis=1)
    kinds = Outcome.UNSTABLE_YAW, Outcome.UNSTABLE_PITCH, Outcome.UNSTABLE_ROLL
    yaw, pitch, roll = ((outcome == kind).sum(axis=1) for kind in kinds)
    behind = int((forward[2, 4] < 0).sum())
    means = forward[2].mean(axis=1)
    by_psi = forward.mean(axis=(1, 2))
    middle = "{}, {} and {} of 11 land".format(*landed[1:4])
    order = " < ".join(f"{BENDS[i]:g}°" for i in means.argsort())
    told = ", ".join(f"{x:.2f}" for x in by_psi)
    numbers = {f"forward_{b:g}": float(mean) for b, mean in zip(BENDS, means, strict=True)}
    return {
        **numbers,
        "bend_down": (f"{landed[0]} land, {pitch[0]} pitch, {roll[0]} roll", pitch[0] == 11),
        "bend_middle": (middle, bool((landed[1:4] == 11).all())),
        "bend_back": (f"{behind} of 11 end behind", behind > 0),
        "bend_up": (f"{landed[4]} land, {yaw[4]} pass 85° of yaw", landed[4] == 11),
        "bend_best": (order, means.argmax() == 3 and means.argmin() == 4),
        "planar": (f"mean {told} m at ψ_m 0, 10, 20°", by_psi.argmin() == 0),
    }


def forces(options) -> dict[str, Value]:
    """The trend with bending where lift is 1.36 and drag 0.6 times as large."""
    fixed = {"lift_scale": 1.36, "drag_scale": 0.6}
    study = bending_study((20.0,), times=None, fixed=fixed)
    data = sweep(study, options.store("validation_forces"))
    means = data.landing_point.sel(axis="y").values.reshape(5, 11).mean(axis=1)
    told = ", ".join(f"{mean:.2f}" for mean in means)
    rising = bool((np.diff(means)[:3] > 0).all() and means[4] < means[3])
    return {"forces": (f"{told} m", rising)}


def moments() -> dict[str, Value]:
    """Held glides: eleven shapes at five bends."""
    held = survey(bending_study((20.0,), times=None))
    last = held["last"]
    mean = held.mean_moment.isel(record=last).sel(about="pitch").values.reshape(5, 11)
    values: dict[str, Value] = {}
    for nu, bend in ((1.0, -20), (1.2, 10), (1.4, 10), (1.5, -10), (1.5, 20)):
        where = list(BENDS).index(bend), int(np.isclose(NU_THETA, nu).argmax())
        values[f"moment_{nu}_{bend}"] = float(mean[where])
    means, effect = mean.mean(axis=1), mean[4] - mean[0]
    trims = np.array([trim_bend(nu) for nu in NU_THETA])
    others = float(np.nanmax(np.abs(held.mean_moment.sel(about=["roll", "yaw"]))))
    told = ", ".join(f"{x:.3f}" for x in means)
    rising = bool((np.diff(means) > 0).all() and means[4] > 0 > means[3])
    growing = f"{effect.min():.2f} to {effect.max():.2f} N mm"
    range_ = f"{trims.min():.1f} to {trims.max():.1f}°"
    small = others < 1e-9
    return {
        **values,
        "rises": (f"{told} N mm", rising),
        "diverges": (growing, bool((np.diff(effect) > 0).all())),
        "trims": (range_, bool((trims > 0).all())),
        "no_means": ("below 1e-9 N mm" if small else f"{others:.1e} N mm", small),
        **_ratios(held, last),
    }


def _ratios(held, last) -> dict[str, Value]:
    """Inertial over aerodynamic moments."""
    ratio, size = held.inertial_ratio, held.inertial_range
    first, end = float(ratio.isel(record=0).min()), ratio.isel(record=last)
    yaw = ratio.sel(about="yaw")
    median = float(yaw.median())  # over cases and records
    above = [int((end.sel(about=turn) > 1).sum()) for turn in ("pitch", "roll")]
    spread = float((size.max("record") / size.min("record") - 1).max())
    return {
        "launch_ratio": (f"at least {first:.0f} times", first > 1),
        "yaw_ratio": (f"at least {float(yaw.min()):.2f} times", float(yaw.min()) > 1),
        "yaw_median": (f"{median:.1f} times, median over time", median > 10),
        "last_ratio": ("{} and {} of 55 keep it".format(*above), max(above) == 0),
        "inertia": (f"by up to {100 * spread:.0f} %", spread < 0.05),
    }


def glides() -> dict[str, Value]:
    """Whole glides: against the research code, and against animals."""
    flown = simulate(PUBLISHED, times=np.array([1.5]), rtol=1e-9, atol=1e-9)
    then = np.asarray(flown.states)[0]
    low = simulate(PUBLISHED, Launch(9.62), times=np.arange(0, 4, 0.01), rtol=1e-9, atol=1e-9)
    speeds = np.asarray(low.states)[:, VELOCITY]
    speeds = np.vstack([speeds[np.isfinite(speeds).all(axis=1)], low.state[VELOCITY]])
    along = np.hypot(speeds[:, 0], speeds[:, 1])
    angle = np.rad2deg(np.arctan2(-speeds[:, 2], along))[50:]  # past the ballistic start
    x, y, _ = map(float, low.landing_point)
    held = fall(PUBLISHED, Launch(10.0, 1.7))
    v_y, v_z = map(float, held.state[2:4])
    steep = float(np.rad2deg(np.arctan2(-v_z, v_y)))
    return {
        "path_y": float(then[POSITION][1]),
        "path_z": float(then[POSITION][2]),
        "path_pitch": float(np.rad2deg(then[ANGLES][1])),
        "animal_distance": float(np.hypot(x, y)),
        "animal_sink": float(-speeds[-1, 2]),
        "animal_forward": float(along[-1]),
        "animal_speed": float(np.linalg.norm(speeds[-1])),
        "animal_angle": float(angle.min()),
        "transient": (f"held level, still {steep:.0f}° down at the ground", steep > 40),
    }


def turning() -> dict[str, Value]:
    """Yaw in a cycle without air and angular momentum, by lateral bias."""
    body = Snake.from_svl(nodes=60, node_set="gauss")
    nothing = Polar.published(0.0, 0.0)
    place = discretise(body)

    @jax.jit
    def turn(d_theta):
        gait = eqx.tree_at(lambda g: g.d_theta, Gait.from_degrees(), d_theta)
        rate = -2 * jnp.pi * gait.f_theta
        bent = backbone(place, waves(gait, place.neck_fraction, place.fraction, 0.0, rate))
        spin = jnp.linalg.solve(inertia_tensor(place, bent), angular_momentum(place, bent))
        state = jnp.zeros(13).at[OMEGA].set(-spin)
        glider = Glider(body, gait, nothing, gravity=0.0)
        return integrate(glider, state, 0.0, 1 / 1.2, ends=(), rtol=1e-8, atol=1e-8).state

    bias = (0, 10, 20, 30, 45, 60)
    yaw = [float(jnp.rad2deg(turn(jnp.deg2rad(1.0 * b))[ANGLES][0])) for b in bias]
    return {f"turn_{b}": y for b, y in zip(bias, yaw, strict=True)}


def _cells(page: str, beginning: str) -> list[list[str]]:
    """Cells but the first of the rows of a page of findings that begin so; one at least."""
    lines = (FINDINGS / f"{page}.md").read_text().splitlines()
    found = [line for line in lines if line.startswith(f"| {beginning}")]
    if not found:
        raise ValueError(f"docs/findings/{page}.md has no row {beginning!r}")
    return [[cell.strip() for cell in line.strip("| ").split("|")][1:] for line in found]


def _number(text: str) -> float:
    return float(re.findall(rf"[{MINUS}-]?[\d.]+", text)[0].replace(MINUS, "-"))


def stated() -> dict[str, Value]:
    """What the pages of findings say; nothing outside a clone."""
    if not FINDINGS.is_dir():
        return {}
    values: dict[str, Value] = {}
    for row in ROWS:
        if row.page == "measured" and not row.words:
            values[row.key] = _number(_cells("measured", row.key)[0][0])
        elif row.published[-1:].isdigit() and row.words:
            values[row.key] = _range(row)
    flown = _cells("measured", "published polar, nodes")[0]
    share, back = flown[1], int(_number(flown[4]))
    values["distance"] = f"{_number(flown[0]):.2f} m: {share} of it", float(share) > 0.9
    values["shallow"] = f"{36 - back} of 36", back < 18
    lift, drag, _ = _cells("fitted", "fitted |")[0]
    return {**values, "lift": _number(lift), "drag": _number(drag)}


def _range(row: Row) -> Value:
    """Lowest and highest over flights, and whether they round into the published range."""
    ends = _cells("measured", row.key)
    low, high = (_number(end[0]) for end in ends)
    least, most = (_number(end[1]) for end in ends)
    half = 0.05 if most < 10 else 0.5
    text = "–".join(end[0] for end in ends)  # noqa: RUF001
    return text, least - half <= low and high <= most + half


def shown(row: Row, value: Value | None) -> str:
    """The cell of ours: the words, or a number to the digits published, or a few more."""
    if value is None:
        return "see there"
    if isinstance(value, tuple):
        return value[0].replace("-", MINUS).replace(f"e{MINUS}", "e-")
    if row.page:
        return f"{value:g}".replace("-", MINUS)
    digits = _digits(row.published)
    if not row.loose and round(value, digits) != _number(row.published):
        digits = max(digits, min(digits + 1, 2))
    return f"{value:.{digits}f}".replace("-", MINUS)


def _digits(published: str) -> int:
    return len(published.split(" ")[0].partition(".")[2])


def agreement(row: Row, ours: str, holds: bool = True) -> str:
    """How ours agrees with the published cell, from the two texts; of words, as told."""
    if ours == "see there":
        return ""
    if row.words:
        return "holds" if holds else f"differs: {row.why}"
    value, (published, *spread) = _number(ours), map(_number, row.published.split(" ± "))
    if round(value, _digits(row.published)) == published:
        return "to the last digit"
    if spread and abs(value - published) <= spread[0]:
        return "within its spread"
    change = 100 * (value / published - 1)
    if abs(change) < 0.05:
        return "to 0.05 %"
    told = f"{change:+.1f} %".replace("-", MINUS)
    return f"{told}: {row.why}" if row.why else told


def page(values: dict[str, Value]) -> str:
    """The page, in Markdown."""
    lines, section = [HEAD], ""
    tests = list(dict.fromkeys(row.test for row in ROWS))
    for row in ROWS:
        if row.section != section:
            section = row.section
            heads = ("quantity", "source", "published", "ours", "agreement", "test")
            lines += [f"\n## {section}\n", f"| {' | '.join(heads)} |", "| --- " * 6 + "|"]
        value = values.get(row.key)
        ours = shown(row, value)
        told = agreement(row, ours, value[1] if isinstance(value, tuple) else True)
        mark = " †" if row.page else ""
        cells = (
            row.quantity,
            row.source,
            row.published,
            f"{ours}{mark}",
            told,
            f"[{tests.index(row.test) + 1}](#tests)",
        )
        lines.append(f"| {' | '.join(cells)} |")
    lines.append("\n## Sources\n")
    lines += [f"- [{letter}] {text}." for letter, text in SOURCES.items()]
    lines.append("\n## Tests\n\nBelow `tests/`:\n")
    lines += [f"{number}. `{test}`" for number, test in enumerate(tests, 1)]
    return "\n".join(lines) + "\n"


def main() -> None:
    options = arguments(__doc__)
    values = {**animal(), **sections(), **shapes(options), **bends(options)}
    values |= {**forces(options), **moments(), **glides(), **turning(), **stated()}
    path = options.out / "validation.md"
    write_text(path, page(values))
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
