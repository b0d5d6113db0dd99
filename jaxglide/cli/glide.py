"""`jaxglide glide`."""

import sys

from ._case import add_glider, add_tolerances, case_of, computed
from ._options import add_output, print_json, write

_SOLVERS = ("dopri5", "tsit5", "dopri8", "bosh3")


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    glide = new(
        description="Fly one glide until it lands or an angle reaches 85 degrees.",
        epilog="Exit code: 0 for a computed glide, landed or unstable; 1 if it could not be "
        "computed to its end; 2 for wrong input.",
    )
    add_glider(glide)
    solver = add_tolerances(glide)
    text = "Runge-Kutta method (default: dopri5)"
    solver.add_argument("--solver", choices=_SOLVERS, default="dopri5", help=text)
    add_output(glide)
    glide.set_defaults(run=_run)


def _run(args) -> int:
    import diffrax

    from ..flight.glide import simulate

    case = case_of(args)
    solvers = (diffrax.Dopri5, diffrax.Tsit5, diffrax.Dopri8, diffrax.Bosh3)
    glide = simulate(
        case.glider,
        case.launch,
        ends=case.ends,
        rtol=args.rtol,
        atol=args.atol,
        solver=dict(zip(_SOLVERS, solvers, strict=True))[args.solver](),
        dense=args.save is not None or args.plot is not None,
    )

    def data():
        from ..files.glides import glide_dataset

        return glide_dataset(glide)

    def figure():
        from ..plot import glide_overview

        return glide_overview(glide)

    whole = bool(computed(glide.outcome))
    if whole:
        write(data, figure, args)

    if args.json:
        print_json(_plain(glide))
    else:
        print(glide)
    if not whole:
        said = f"the glide {glide.ending} at {float(glide.time):.6g} s"
        nothing = ": no file was written" if args.save or args.plot else ""
        print(f"jaxglide: {said}{nothing}", file=sys.stderr)
        return 1
    return 0


def _plain(glide) -> dict:
    """What `--json` prints of a glide."""
    import jax
    import numpy as np

    def angles(values):
        degrees = np.rad2deg(np.asarray(values))
        return dict(zip(("yaw", "pitch", "roll"), map(float, degrees), strict=True))

    glide = jax.device_get(glide)
    start = glide.take_off
    return {
        "outcome": glide.ending,
        "time": float(glide.time),
        "landing_point": np.asarray(glide.landing_point).tolist(),
        "path_length": float(glide.path_length),
        "height_lost": float(glide.height_lost),
        "end_angles_deg": angles(glide.end_angles),
        "max_angles_deg": angles(glide.max_angles),
        "launch": {
            "phase": float(start.phi_theta),
            "angles_deg": angles(start.angles),
            "speed": float(start.speed),
        },
        "steps": {"accepted": int(glide.accepted), "rejected": int(glide.rejected)},
    }
