"""`jaxglide windtunnel`."""

import inspect
import sys

from .._lib.fields import Parameter, parameters_of
from ..shape.gait import Gait
from ..tunnel.fall import PUBLISHED_LAUNCH, fall
from ..tunnel.loads import MOMENT_PHASES, PHASES
from ._case import add_glider, add_number, base_of, case_of, numbers_of
from ._options import add_output, missing, print_json, refuse, whole, write

HELD_SPEED = PUBLISHED_LAUNCH[1]
_TURNS = ("yaw", "pitch", "roll")
_HELD = {name: p.default for name, p in inspect.signature(fall).parameters.items()}
_TUNNEL = {
    "interval": Parameter("s", "between records", low=1e-4, high=10),
    "max_time": Parameter("s", "longest fall", low=0, high=1e4, low_open=True),
}


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    tunnel = new(
        description="Let the snake fall with its attitude held, and read the moments of the "
        "air and of its own inertia over the phases of its waves at the ground. Without "
        "--speed it starts at the published 1.7 m/s, without --polar on the published polar.",
        epilog="Derivatives are those of the phase-averaged pitch moment at the velocity and "
        "attitude at the ground. Moments are positive nose up, right side down, nose left. "
        "Exit code: 0, or 1 if the snake did not reach the ground, 2 for wrong input.",
    )
    add_glider(tunnel, held=HELD_SPEED)
    group = tunnel.add_argument_group("tunnel")
    for name in _TURNS:
        turn = Parameter("deg", f"held {name}", low=-85, high=85, low_open=True, high_open=True)
        add_number(group, name, turn, 0.0)
    phases = Parameter("", "phases at which moments are read", low=PHASES[0], high=PHASES[1])
    add_number(group, "phases", phases, MOMENT_PHASES, kind=whole)
    for name, known in _TUNNEL.items():
        add_number(group, name, known, _HELD[name])
    add_output(tunnel)
    tunnel.set_defaults(run=_run)


def _run(args) -> int:
    import jax
    import numpy as np

    from .. import tunnel
    from ..flight.ends import Outcome
    from ..tunnel.glide_polar import equilibrium
    from ..tunnel.trim import derivatives

    if args.save is None and args.plot is None:
        refuse(args, ("interval",), "records are kept with --save or --plot only")
    case = case_of(args, speed=HELD_SPEED)
    glider, launch = case.glider, case.launch
    angles = np.deg2rad([getattr(args, turn) for turn in _TURNS])
    options = {"angles": angles, "interval": args.interval, "max_time": args.max_time}
    fallen = fall(glider, launch, **options)
    outcome = Outcome(int(fallen.outcome))
    velocity = np.array([0.0, *np.asarray(fallen.state)[2:]])
    held = {"time": float(fallen.time), "phases": args.phases}
    read, steady = tunnel.loads_at_end(fallen, args.phases), equilibrium(glider, angles)
    slopes = derivatives(glider, velocity, angles, **held)
    # in NumPy from here on: JAX would compile every number's way to the terminal
    fallen, read, steady, slopes = jax.device_get((fallen, read, steady, slopes))
    result = {
        "outcome": str(outcome),
        "time": float(fallen.time),
        "position": np.asarray(fallen.state)[:2].tolist(),
        "velocity": velocity[1:].tolist(),
        **_moments(read),
        "pitch_moment_derivatives_N_mm_per_unit": _effects(slopes),
        "equilibrium": np.asarray(steady.velocity).tolist() if steady.found else None,
    }

    def data():
        from ..ensemble.study import Study
        from ..ensemble.survey import survey

        cases = {"speed": [HELD_SPEED]} | numbers_of(args)
        tolerances = {name: _HELD[name] for name in ("rtol", "atol")}
        study = Study(cases=cases, **base_of(args), **tolerances)
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
        note = [f"  {result['note']}"] if "note" in result else []
        print(fallen, steady, read, *note, slopes, sep="\n")
    if not landed:
        nothing = ": no file was written" if args.save or args.plot else ""
        print(f"jaxglide: the held glide {outcome}{nothing}", file=sys.stderr)
    return missing(result) or int(not landed)


def _moments(read) -> dict:
    """Statistics over phases of the moments of `Loads` [N mm], by turn."""
    import numpy as np

    from ..ensemble.survey import ABOUT
    from ..tunnel.loads import over_phases

    air, shape = over_phases(read.aerodynamic), over_phases(read.inertial)
    ratio = np.asarray(read.inertial_ratio)
    table = {
        turn: {
            "mean": 1e3 * float(air.mean[i]),
            "lowest": 1e3 * float(air.lowest[i]),
            "highest": 1e3 * float(air.highest[i]),
            "peak_to_peak": 1e3 * float(air.peak_to_peak[i]),
            "inertial_peak_to_peak": 1e3 * float(shape.peak_to_peak[i]),
            "inertial_ratio": None if np.isnan(ratio[i]) else float(ratio[i]),
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
        rates[name] = getattr(slopes.by_gait, name)[PITCH], parameters_of(Gait)[name].unit
    effects = {}
    for name, (rate, unit) in rates.items():
        angle = unit.startswith("deg")
        value = 1e3 * float(rate)
        effects[name] = {
            "value": float(np.deg2rad(value)) if angle else value,
            "unit": "deg" if angle else unit or "1",
        }
    return effects
