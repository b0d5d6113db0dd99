"""`jaxglide shapes`."""

import sys
import time

from .._lib.fields import parameters_of
from ..flight.launch import Launch
from ._case import add_number, add_tolerances, computed
from ._options import add_output, print_json, say_where, write


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    shapes = new(
        description="Fly the 121 published shapes, frozen and undulating, and lay the table "
        "beside the published one.",
        epilog="Exit code: 0, or 1 if a glide could not be computed to its end, 2 for wrong "
        "input.",
    )
    group = shapes.add_argument_group("flights")
    add_number(group, "height", parameters_of(Launch)["height"], 10.0)
    group.add_argument(
        "--check",
        action="store_true",
        help="solve again at 1e-9 and name the shapes whose stability flips (about a minute)",
    )
    add_tolerances(shapes)
    add_output(shapes)
    shapes.set_defaults(run=_run)


def _run(args) -> int:
    from ..ensemble.published import borderline, shape_space, summary

    say_where(args, "save", "plot")
    begin = time.perf_counter()
    data = shape_space(args.height, rtol=args.rtol, atol=args.atol)
    took = time.perf_counter() - begin

    def figure():
        from ..plot import shape_heatmaps

        return shape_heatmaps(data)

    write(lambda: data, figure, args)
    rows = summary(data)
    lost = int((~computed(data.outcome)).sum())
    if lost:
        said = f"{lost} of {data.outcome.size} glides could not be computed to their end"
        print(f"jaxglide: {said}", file=sys.stderr)
    published = args.height == 10.0
    flips = None
    if args.check:
        flips = borderline(data, shape_space(args.height, rtol=1e-9, atol=1e-9))
    if args.json:
        keys = ("quantity", "f_theta", "region", "jaxglide", "published")
        table: list[dict] = [dict(zip(keys, row, strict=True)) for row in rows]
        if not published:
            for row in table:
                row["published"] = None
        result = {"height": args.height, "seconds": took, "table": table}
        print_json({**result, "borderline": flips, "not_computed": lost})
        return int(lost > 0)
    print(f"{data.outcome.size} glides from {args.height:g} m in {took:.1f} s with compilation")
    print(f"{'':22}{'f (Hz)':>8}{'region':>10}{'jaxglide':>10}{'published':>11}{'diff.':>8}")
    for name, f_theta, region, ours, theirs in rows:
        beside = f"{theirs:11.3f}{ours - theirs:8.3f}" if published else f"{'':11}{'':8}"
        print(f"{name:22}{f_theta:8.1f}{region:>10}{ours:10.3f}{beside}")
    if published:
        print("Published path lengths run up to one 10 ms step past the end of the glide.")
    else:
        print("The published table is for 10 m.")
    if flips is not None:
        print(f"{len(flips)} shapes change between stable and unstable at 1e-9:")
        for f_theta, theta_m, nu_theta in flips:
            print(f"  f {f_theta:.1f} Hz, theta_m {theta_m:.2f} deg, nu_theta {nu_theta:.2f}")
    return int(lost > 0)
