"""`jaxglide trim`."""

from .._lib.fields import Parameter
from ..tunnel.fall import PUBLISHED_LAUNCH
from ._case import add_glider, build_from, check_number
from ._options import UsageError, a_number, add_output, missing, print_json, refuse, write

HELD_SPEED = PUBLISHED_LAUNCH[1]
_BEND = -20.0, 20.0  # deg per SVL


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    trim = new(
        description="Find the value of a parameter at which the pitch moment, averaged "
        "over the phases of the waves at the end of a held glide, vanishes. Without --speed "
        "the glide starts at the published 1.7 m/s, without --polar it is flown on the "
        "published polar, as by `jaxglide windtunnel`.",
        epilog="Exit code: 0 for a trim, 1 if the moment does not change sign in the range, 2 "
        "for wrong input.",
    )
    add_glider(trim, held=HELD_SPEED)
    group = trim.add_argument_group("trim")
    group.add_argument(
        "--parameter", default="d_psi", metavar="NAME", help="what is varied (default: d_psi)"
    )
    for end, words, bend in (("low", "lower", _BEND[0]), ("high", "upper", _BEND[1])):
        text = (
            f"{words} end of the scan (within the parameter's range; default: as observed in "
        )
        text += f"animals, of a bend {bend:g})"
        group.add_argument(f"--{end}", type=a_number, metavar="X", help=text)
    add_output(trim, save=False)
    trim.set_defaults(run=_run)


def _bounds(args, known: Parameter) -> tuple[float, float]:
    """The range to scan, in the parameter's unit."""
    low, high = known.observed or (None, None)
    if args.parameter in ("d_psi", "d_theta"):
        low, high = _BEND
    if args.low is not None:
        low = check_number("--low", args.low, known)
    if args.high is not None:
        high = check_number("--high", args.high, known)
    if low is None or high is None:
        raise UsageError(f"give --low and --high of {args.parameter}")
    if low >= high:
        raise UsageError(f"--low {low:g} is not below --high {high:g}")
    return low, high


def _run(args) -> int:
    import jax
    import numpy as np

    from ..flight.case import Case
    from ..tunnel.trim import trim

    name = args.parameter
    refuse(args, (name,), f"{name} is what trim looks for, between --low and --high")
    glider, launch = build_from(args, speed=HELD_SPEED)
    known = Case(glider, launch).parameter(name)
    low, high = _bounds(args, known)
    unit, factor = known.unit, known.factor
    found = jax.device_get(trim(glider, name, (factor * low, factor * high), launch=launch))
    value = float(found.value) / factor

    def figure():
        from ..plot import trim_curve

        return trim_curve(found).figure

    write(None, figure, args)
    scanned = np.asarray(found.scanned) / factor
    moments = 1e3 * np.asarray(found.moments)
    result = {
        "parameter": name,
        "unit": unit,
        "value": value if found.found else None,
        "moment_N_mm": 1e3 * float(found.moment) if found.found else None,
        "crossings": int(found.crossings),
        "scanned": scanned.tolist(),
        "moments_N_mm": moments.tolist(),
    }
    if args.json:
        print_json(result)
    else:
        print(found)
    return missing(result) or int(not found.found)
