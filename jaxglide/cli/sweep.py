"""`jaxglide sweep`."""

import time
from pathlib import Path
from typing import Any

from .._lib.fields import Parameter
from ._case import (
    PARTS,
    SETUP,
    add_number,
    add_setup,
    add_tolerances,
    base_of,
    computed,
    fixed_of,
)
from ._options import (
    UsageError,
    add_output,
    announce,
    by_name,
    print_json,
    refuse,
    say_where,
    whole,
    write,
)


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    sweep = new(
        description="Fly every combination of the varied parameters. Started again with the "
        "same study and --store, it computes only what is missing.",
        epilog="Example: jaxglide sweep --vary nu_theta=1:1.5:11 --vary d_psi=0,10,20 "
        "--fix height=75 --store results/bend.zarr --save bend.nc",
    )
    sweep.add_argument("file", nargs="?", metavar="FILE", type=Path, help="study file (TOML)")
    group = sweep.add_argument_group("study", "The same as in a study file.")
    group.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUES",
        help="a parameter and its values: a,b,c or start:stop:count; may be repeated",
    )
    text = "another parameter's value; may be repeated"
    group.add_argument("--fix", action="append", default=[], metavar="NAME=VALUE", help=text)
    group = sweep.add_argument_group("run")
    text = "keep results here (Zarr), to go on from them"
    group.add_argument("--store", type=Path, metavar="FOLDER", help=text)
    width = Parameter("", "glides in flight at once", low=1, high=10**7)
    add_number(group, "width", width, told="chosen for the devices", kind=whole)
    group.add_argument("--cluster", metavar="ADDRESS", help="scheduler of a Dask cluster")
    add_setup(sweep)
    add_tolerances(sweep)
    add_output(sweep, plot=False)
    sweep.set_defaults(run=_run)


def _varied(text: str) -> tuple[str, Any]:
    """Name, and a list or span of values, of NAME=a,b,c or NAME=start:stop:count."""
    from ..ensemble.study import Span

    name, equals, values = text.partition("=")
    try:
        if not equals:
            raise ValueError
        if ":" not in values:
            return name, [float(value) for value in values.split(",")]
        start, stop, count = values.split(":")
        if int(count) < 1:
            raise ValueError
        return name, Span(float(start), float(stop), int(count))
    except ValueError:
        raise UsageError(f"{text!r} is not NAME=a,b,c nor NAME=start:stop:count") from None


def _study(args):
    """The study of the file or of the options; a file decides all that a study holds."""
    from ..ensemble.study import Study, expanded

    if args.file is not None:
        if args.vary or args.fix:
            raise UsageError("give a study file or --vary and --fix, not both")
        refuse(args, (*SETUP, *PARTS, "rtol", "atol"), f"{args.file} decides it")
        return Study.from_file(args.file)
    if not args.vary:
        raise UsageError("nothing to vary: give a study file or --vary NAME=VALUES")
    grid = expanded(by_name("--vary", map(_varied, args.vary)))
    tolerances = {"rtol": args.rtol, "atol": args.atol}
    return Study(grid, fixed=fixed_of(args), **base_of(args), **tolerances)


def _run(args) -> int:
    from ..ensemble.sweep import sweep

    study = _study(args)
    say_where(args, "store", "save")
    begin = time.perf_counter()
    data = sweep(study, args.store, width=args.width, cluster=args.cluster)
    took = time.perf_counter() - begin
    if args.store is not None:
        announce(args.store, args)
    write(lambda: data, None, args)
    return _report(study, data, took, args.json)


def _report(study, data, took: float, as_json: bool) -> int:
    """Print how the glides ended; returns the exit code: 1 unless all were computed."""
    import numpy as np

    codes = data.outcome.values.ravel()
    counts: dict[str, int] = {}
    for code, words in study.outcomes.items():  # several ends may have the same words
        if count := int((codes == code).sum()):
            counts[words] = counts.get(words, 0) + count
    done = computed(codes)
    code = 0 if done.all() else 1
    if as_json:
        print_json({"glides": len(study), "seconds": took, "outcomes": counts})
        return code
    print(f"{len(study)} glides in {took:.1f} s, shape {'x'.join(map(str, study.shape))}")
    for outcome, count in counts.items():
        print(f"  {outcome:18} {count}")
    if not done.any():
        print("farthest forward   none: no glide was computed to its end")
        return code
    # Not where a failed one happened to stop.
    forward = np.where(done, data.landing_point.sel(axis="y").values.ravel(), -np.inf)
    best = int(forward.argmax())
    where = {name: float(v[0]) for name, v in study.columns(np.array([best])).items()}
    told = ", ".join(f"{name} {value:g}" for name, value in where.items())
    print(f"farthest forward   {forward[best]:.3f} m at {told}")
    return code
