"""`jaxglide windtunnel`."""

import sys
from typing import Any

from .._lib.parameters import HELD_SPEED, HELD_TOLERANCE, PARAMETERS, TUNNEL
from ._options import (
    add_glider,
    add_number,
    add_output,
    build_from,
    case_of,
    missing,
    print_json,
    refuse,
    setup_of,
    write,
)

_TURNS = ("yaw", "pitch", "roll")
_STILL = 1e-12
"""Peak-to-peak below this share of force times length is round-off."""


def add(commands) -> None:
    """Add the command to the parser."""
    tunnel = commands.add_parser(
        "windtunnel",
        help="hold the attitude, let the snake fall, read the moments",
        description="Let the snake fall with its attitude held, and read the moments of the "
        "air and of its own inertia over the phases of its waves at the ground. Without "
        "--speed it starts at the published 1.7 m/s, without --polar on the published polar.",
        epilog="Derivatives are those of the phase-averaged pitch moment at the velocity and "
        "attitude at the ground. Moments are positive nose up, right side down, nose left. "
        "Exit code: 0, or 1 if the snake did not reach the ground, 2 for wrong input.",
    )
    add_glider(tunnel, held=True)
    group = tunnel.add_argument_group("tunnel")
    for name, p in TUNNEL.items():
        add_number(group, name, p, default=p.default)
    add_output(tunnel)
    tunnel.set_defaults(run=_run)


def _run(args) -> int:
    import numpy as np

    from .. import tunnel
    from ..flight.ends import Outcome
    from ..tunnel.glide_polar import equilibrium
    from ..tunnel.trim import derivatives

    if args.save is None and args.plot is None:
        refuse(args, ("interval",), "records are kept with --save or --plot only")
    glider, launch = build_from(args, speed=HELD_SPEED)
    angles = np.deg2rad([getattr(args, turn) for turn in _TURNS])
    options = {"angles": angles, "interval": args.interval, "max_time": args.max_time}
    tolerances: dict[str, Any] = {"rtol": HELD_TOLERANCE, "atol": HELD_TOLERANCE}
    fallen = tunnel.fall(glider, launch, **options, **tolerances)
    outcome = Outcome(int(fallen.outcome))
    velocity = np.array([0.0, *np.asarray(fallen.state)[2:]])
    held = {"time": float(fallen.time), "phases": args.phases}
    steady = equilibrium(glider, angles)
    result = {
        "outcome": str(outcome),
        "time": float(fallen.time),
        "position": np.asarray(fallen.state)[:2].tolist(),
        "velocity": velocity[1:].tolist(),
        **_moments(tunnel.loads_at_end(fallen, args.phases), float(glider.body.length)),
        "pitch_moment_derivatives_N_mm_per_unit": _effects(
            derivatives(glider, velocity, angles, **held)
        ),
        "equilibrium": np.asarray(steady.velocity).tolist() if steady.found else None,
    }

    def data():
        from ..ensemble.study import Study
        from ..ensemble.survey import survey

        cases = {"speed": [HELD_SPEED]} | case_of(args)
        study = Study(cases=cases, setup=setup_of(args), **tolerances)
        return survey(study, phases=args.phases, **options)

    def figure():
        from ..plot import moments_in_time

        return moments_in_time(data(), 0)

    landed = outcome == Outcome.LANDED
    if landed:
        write(data, figure, args)
    if args.json:
        print_json(result)
    else:
        _print(result, steady, float(launch.height), args.phases)
    if not landed:
        nothing = ": no file was written" if args.save or args.plot else ""
        print(f"jaxglide: the held glide {outcome}{nothing}", file=sys.stderr)
    return missing(result) or int(not landed)


def _moments(read, length: float) -> dict:
    """Statistics over phases of the moments of `Loads` [N mm], by turn."""
    import numpy as np

    from ..ensemble.survey import ABOUT
    from ..tunnel.loads import over_phases

    air, shape = over_phases(read.aerodynamic), over_phases(read.inertial)
    still = _STILL * length * float(np.abs(read.force).max())
    table = {
        turn: {
            "mean": 1e3 * float(air.mean[i]),
            "lowest": 1e3 * float(air.lowest[i]),
            "highest": 1e3 * float(air.highest[i]),
            "peak_to_peak": 1e3 * float(air.peak_to_peak[i]),
            "inertial_peak_to_peak": 1e3 * float(shape.peak_to_peak[i]),
            "inertial_ratio": None
            if air.peak_to_peak[i] <= still
            else float(shape.peak_to_peak[i] / air.peak_to_peak[i]),
        }
        for i, turn in enumerate(ABOUT)
    }
    result: dict = {"moments_N_mm": table}
    undefined = [turn for turn, row in table.items() if row["inertial_ratio"] is None]
    if undefined:
        where = ", ".join(undefined)
        why = "the moment of the air does not change over the phases"
        result["note"] = f"no inertial ratio in {where}: {why}"
    return result


def _effects(slopes) -> dict:
    """Derivatives of the pitch moment [N mm per unit], by attitude and gait."""
    import numpy as np

    from ..tunnel.loads import PITCH
    from ..tunnel.trim import GAIT_PARAMETERS

    rates = {"pitch": (slopes.pitch_stiffness, "deg")}
    for name in GAIT_PARAMETERS:
        rates[name] = getattr(slopes.by_gait, name)[PITCH], PARAMETERS[name].unit
    effects = {}
    for name, (rate, unit) in rates.items():
        angle = unit.startswith("deg")
        value = 1e3 * float(rate)
        effects[name] = {
            "value": float(np.deg2rad(value)) if angle else value,
            "unit": "deg" if angle else unit or "1",
        }
    return effects


def _print(result: dict, steady, height: float, phases: int) -> None:
    import numpy as np

    (y, z), (v_y, v_z) = result["position"], result["velocity"]
    print(
        f"Held glide from {height:g} m: {result['outcome']} after {result['time']:.4f} s\n"
        f"  end              y {y:.4f}   z {z:.4f} m\n"
        f"  velocity         v_y {v_y:.4f}   v_z {v_z:.4f} m/s, "
        f"{np.rad2deg(np.arctan2(-v_z, v_y)):.2f} deg below the horizontal"
    )
    if steady.found:
        kind = "stable" if steady.stable else "unstable"
        print(
            f"  steady glide     v_y {steady.velocity[0]:.4f}   "
            f"v_z {steady.velocity[1]:.4f} m/s, "
            f"{np.rad2deg(steady.glide_angle):.2f} deg, {kind} in speed"
        )
    else:
        print("  steady glide     none found")
    print(f"Moments there over {phases} phases (N mm)")
    heads = "".join(f"{head:>9}" for head in ("mean", "lowest", "highest", "p-p"))
    print(f"{'':8}{heads}{'inertial p-p':>14}{'ratio':>8}")
    for turn, row in result["moments_N_mm"].items():
        *values, inertial, ratio = row.values()
        cells = "".join(f"{value:9.4f}" for value in values)
        print(f"{turn:8}{cells}{inertial:14.4f}{'-' if ratio is None else f'{ratio:.2f}':>8}")
    if "note" in result:
        print(f"  {result['note']}")
    print("Derivatives of the mean pitch moment")
    for name, effect in result["pitch_moment_derivatives_N_mm_per_unit"].items():
        print(f"  {name:10}{effect['value']:12.6f} N mm/{effect['unit']}")
