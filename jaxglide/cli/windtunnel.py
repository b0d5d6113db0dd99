"""`jaxglide windtunnel`."""

from ._options import (
    a_number,
    add_glider,
    add_output,
    build_held,
    case_of,
    print_json,
    setup_of,
    whole,
    write,
)

_TURNS = ("yaw", "pitch", "roll")


def add(commands) -> None:
    """Add the command to the parser."""
    tunnel = commands.add_parser(
        "windtunnel",
        help="hold the attitude, let the snake fall, read the moments",
        description="Let the snake fall with its attitude held, and read the moments of the "
        "air and of its own inertia over the phases of its waves at the ground. Without "
        "--speed it starts at the published 1.7 m/s.",
        epilog="Derivatives are those of the phase-averaged pitch moment at the velocity and "
        "attitude at the ground. Moments are positive nose up, right side down, nose left. "
        "Exit code: 0, or 1 if the snake did not reach the ground, 2 for wrong input.",
    )
    add_glider(tunnel)
    group = tunnel.add_argument_group("tunnel")
    for turn in _TURNS:
        text = f"held {turn} [deg] (0)"
        group.add_argument(f"--{turn}", type=a_number, default=0.0, metavar="X", help=text)
    group.add_argument("--phases", type=whole, default=60, metavar="N", help="phases (60)")
    group.add_argument(
        "--interval", type=a_number, default=0.025, metavar="X", help="of records [s] (0.025)"
    )
    group.add_argument(
        "--max-time", type=a_number, default=10.0, metavar="X", help="longest fall [s] (10)"
    )
    add_output(tunnel)
    tunnel.set_defaults(run=_run)


def _run(args) -> int:
    import numpy as np

    from .. import windtunnel as tunnel
    from ..glide import Outcome
    from ..glide_polar import equilibrium
    from ..parameters import PARAMETERS
    from ..survey import ABOUT, survey
    from ..trim import GAIT_PARAMETERS, derivatives

    glider, launch = build_held(args)
    angles = np.deg2rad([getattr(args, turn) for turn in _TURNS])
    options = {"interval": args.interval, "max_time": args.max_time}
    fallen = tunnel.fall(glider, launch, angles=angles, **options)
    read = tunnel.loads_at_end(fallen, args.phases)
    y, z, v_y, v_z = (float(value) for value in fallen.state)
    slopes = derivatives(
        glider, [0.0, v_y, v_z], angles, time=float(fallen.time), phases=args.phases
    )
    steady = equilibrium(glider, angles)
    air, shape = tunnel.over_phases(read.aerodynamic), tunnel.over_phases(read.inertial)
    outcome = Outcome(int(fallen.outcome))

    def per_degree(name):
        unit = PARAMETERS[name].unit
        value = 1e3 * float(getattr(slopes.by_gait, name)[tunnel.PITCH])
        return (np.deg2rad(value), "deg") if unit.startswith("deg") else (value, unit or "1")

    effects = {"pitch": (np.deg2rad(1e3 * float(slopes.pitch_stiffness)), "deg")}
    effects |= {name: per_degree(name) for name in GAIT_PARAMETERS}

    def data():
        from ..study import Study

        study = Study(cases={"speed": [1.7]} | case_of(args), setup=setup_of(args))
        return survey(study, phases=args.phases, angles=angles, **options)

    def figure():
        from ..plot import moments_in_time

        return moments_in_time(data(), 0)

    if outcome == Outcome.LANDED:
        write(data, figure, args)
    if args.json:
        moments = {
            turn: {
                "mean": 1e3 * float(air.mean[i]),
                "lowest": 1e3 * float(air.lowest[i]),
                "highest": 1e3 * float(air.highest[i]),
                "peak_to_peak": 1e3 * float(air.peak_to_peak[i]),
                "inertial_peak_to_peak": 1e3 * float(shape.peak_to_peak[i]),
                "inertial_ratio": float(read.inertial_ratio[i]),
            }
            for i, turn in enumerate(ABOUT)
        }
        result = {
            "outcome": str(outcome),
            "time": float(fallen.time),
            "position": [y, z],
            "velocity": [v_y, v_z],
            "moments_N_mm": moments,
            "pitch_moment_derivatives_N_mm_per_unit": {
                name: {"value": float(value), "unit": unit}
                for name, (value, unit) in effects.items()
            },
            "equilibrium": np.asarray(steady.velocity).tolist() if steady.found else None,
        }
        print_json(result)
        return int(outcome != Outcome.LANDED)
    print(
        f"Held glide from {float(launch.height):g} m: {outcome} "
        f"after {float(fallen.time):.4f} s\n"
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
    print(f"Moments there over {args.phases} phases (N mm)")
    heads = "".join(f"{head:>9}" for head in ("mean", "lowest", "highest", "p-p"))
    print(f"{'':8}{heads}{'inertial p-p':>14}{'ratio':>8}")
    for i, turn in enumerate(ABOUT):
        values = (air.mean, air.lowest, air.highest, air.peak_to_peak)
        cells = "".join(f"{1e3 * float(v[i]):9.4f}" for v in values)
        inertial = f"{1e3 * float(shape.peak_to_peak[i]):14.4f}"
        print(f"{turn:8}{cells}{inertial}{float(read.inertial_ratio[i]):8.2f}")
    print("Derivatives of the mean pitch moment")
    for name, (value, unit) in effects.items():
        print(f"  {name:10}{value:12.6f} N mm/{unit}")
    return int(outcome != Outcome.LANDED)
