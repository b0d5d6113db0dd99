"""`jaxglide steady`."""

import sys
from pathlib import Path
from typing import Any

from .._lib.defaults import GRADIENT_SETUP
from .._lib.fields import Parameter
from ._case import add_glider, add_number, case_of
from ._options import (
    UsageError,
    add_output,
    announce,
    drawn_files,
    missing,
    print_json,
    refuse,
    whole,
    write,
    write_drawing,
)

_STARTS = Parameter("", "points of a Sobol set, beside the likely starts", low=0, high=4096)
_STEP = Parameter("s", "longest step of the solver", low=1e-5, high=0.05)
_CYCLES = Parameter("", "cycles in the figure and in the view", low=1, high=100)
_VIEWED = 5  # cycles, by default


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    steady = new(
        description="Find the flight that repeats itself cycle after cycle, which a gait would "
        "settle into, and say what becomes of small changes in it. A gait may have several; "
        "without --all the first that is found is told, and with --continue followed.",
        epilog="Exit code: 0 for a steady glide, stable or not; 1 if none was found; 2 for "
        "wrong input.",
    )
    add_glider(steady, launched=False, usual=GRADIENT_SETUP)
    group = steady.add_argument_group("search")
    text = "every one that is found, the shallowest first; there may be more"
    group.add_argument("--all", action="store_true", help=text)
    text = "follow it along a parameter instead, past folds, and tell where it is stable"
    group.add_argument("--continue", dest="along", metavar="NAME=LOW:HIGH", help=text)
    add_number(group, "starts", _STARTS, told="4, with --all 16", kind=whole)
    add_number(group, "step", _STEP, told="1/300")
    output = add_output(steady, endings=("", "_spectrum"))
    text = "write a page (.html) that shows some cycles, flown, in 3D"
    output.add_argument("--view", metavar="FILE", type=Path, help=text)
    add_number(output, "cycles", _CYCLES, told=f"2 and {_VIEWED}", kind=whole)
    steady.set_defaults(run=_run)


def _found(args) -> list:
    """Steady glides: one, which may not be there, or all that are."""
    from ..steady import steady_glide, steady_glides

    given = {name: getattr(args, name) for name in ("starts", "step") if name in args.given}
    glider = case_of(args).glider
    return list(steady_glides(glider, **given)) if args.all else [steady_glide(glider, **given)]


def _range(text: str) -> tuple[str, float, float]:
    """Name and range of NAME=LOW:HIGH."""
    name, _, ends = text.partition("=")
    try:
        low, high = map(float, ends.split(":"))
    except ValueError:
        raise UsageError(f"--continue {text!r} is not NAME=LOW:HIGH") from None
    return name, low, high


def _follow(args) -> int:
    """A branch: its report, its diagram, its file."""
    alone = "--continue follows one steady glide"
    if args.all:
        raise UsageError(f"--all does not apply: {alone}")
    refuse(args, ("starts", "view", "cycles"), alone)
    name, low, high = _range(args.along)
    from ..steady import steady_branch

    given = {"step": args.step} if "step" in args.given else {}
    found = steady_branch(case_of(args).glider, name, low, high, **given)

    def figure():
        from ..plot import branch

        return branch(found)

    if found.found:
        write(found.dataset, figure, args)
    result = _listed(found)
    if args.json:
        print_json(result)
    else:
        print(found)
    return missing(result) if found.found else _none(args)


def _listed(found) -> dict[str, Any]:
    """What `--json` prints of a branch."""
    import numpy as np

    return {
        "parameter": found.name,
        "unit": found.unit,
        "found": bool(found.found),
        "ends": list(found.ends),
        "value": found.parameter.tolist(),
        "glide_angle_deg": np.rad2deg(found.glide_angle).tolist(),
        "sink_rate": found.sink_rate.tolist(),
        "turn_rate_deg_per_s": np.rad2deg(found.turn_rate).tolist(),
        "spectral_radius": found.spectral_radius.tolist(),
        "kind": found.kinds.tolist(),
    }


def _none(args) -> int:
    """Say that none was found; the exit code."""
    nothing = ": no file was written" if args.save or args.plot or args.view else ""
    print(f"jaxglide: no steady glide was found{nothing}", file=sys.stderr)
    return 1


def _run(args) -> int:
    if args.along is not None:
        return _follow(args)
    if args.plot is None and args.view is None:
        refuse(args, ("cycles",), "nothing is drawn without --plot or --view")
    tried = _found(args)
    glides = [glide for glide in tried if glide.found]
    if glides:
        _write(glides, args)
    result: dict[str, Any] = {"glides": [_plain(glide) for glide in glides]}
    if not args.all:
        result = _plain(tried[0])
    if args.json:
        print_json(result)
    elif tried:
        print("\n\n".join(map(str, tried)))
    return missing(result) if glides else _none(args)


def _write(glides: list, args) -> None:
    """What --save, --plot and --view ask for, of one steady glide or of all."""

    def data():
        from ..files.steady import steady_dataset

        return steady_dataset(tuple(glides) if args.all else glides[0])

    write(data, None, args)
    cycles = {"cycles": args.cycles} if args.cycles else {}
    if args.plot is not None:
        from .. import plot

        orbit, multipliers = drawn_files(args)
        write_drawing(orbit, plot.steady(glides[0], **cycles), args)
        names = [_brief(glide) for glide in glides]
        write_drawing(multipliers, plot.spectrum(glides, labels=names).figure, args)
    if args.view is not None:
        from .. import view

        labels = [_brief(glide) for glide in glides]
        title = str(glides[0]).splitlines()[0] if len(glides) == 1 else "Steady glides"
        flown = [_flown(glide, args.cycles or _VIEWED) for glide in glides]
        view.view(flown, args.view, labels=labels, title=title)
        announce(args.view, args)


def _brief(glide) -> str:
    """What tells one from the others."""
    import numpy as np

    angle, turning = np.rad2deg([float(glide.glide_angle), float(glide.turn_rate)])
    side = f", {abs(turning):.0f}°/s {'left' if turning > 0 else 'right'}" if turning else ""
    return f"{angle:.1f}° down{side}"


def _flown(glide, cycles: int):
    """Some cycles that end at the ground."""
    from ..air.air import UniformWind

    air = glide.glider.air
    rising = float(air.velocity[2]) if isinstance(air, UniformWind) else 0.0
    lost = (float(glide.sink_rate) - rising) * cycles * float(glide.period)
    return glide.fly(cycles, max(lost, 0.0))


def _plain(glide) -> dict[str, Any]:
    """What `--json` prints of a steady glide: SI and radians, but where the name says so."""
    import jax
    import numpy as np

    from ..steady import COMPONENTS

    if not glide.found:
        return {"found": False, "why": glide.why, "residual": float(glide.residual)}
    modes = [mode._asdict() | {"multiplier": _parts(mode.multiplier)} for mode in glide.modes]
    angle, rate = (float(np.rad2deg(x)) for x in (glide.glide_angle, glide.turn_rate))
    radius = float(glide.turn_radius)
    glide = jax.device_get(glide)
    names = ("period", "speed", "forward_speed", "sink_rate", "lift_to_drag", "residual")
    return {
        "found": True,
        "stable": bool(glide.stable),
        "spectral_radius": float(glide.spectral_radius),
        "glide_angle_deg": angle,
        "turn_rate_deg_per_s": rate,
        "turn_radius": radius if np.isfinite(radius) else "straight",
        **{name: float(getattr(glide, name)) for name in names},
        "iterations": int(glide.iterations),
        "frozen": glide.frozen,
        "state": dict(zip(COMPONENTS, glide.state.tolist(), strict=True)),
        "multipliers": [_parts(value) for value in glide.multipliers],
        "modes": modes,
    }


def _parts(value) -> list[float]:
    return [float(value.real), float(value.imag)]
