"""The command line (floor 7). Float64 and the compilation cache are switched on here."""

import argparse
import json
import os
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path

from .parameters import CHOICES, PARAMETERS

_XLA_FLAGS = ("--xla_cpu_prefer_vector_width=512",)
"""Measured in benchmarks/README.md; a user's own XLA_FLAGS win."""

_SOLVERS = ("dopri5", "tsit5", "dopri8", "bosh3")


_FIGURES = {
    "4": "figure_4.py",
    "5": "figure_5.py",
    "force-coefficients": "force_coefficients.py",
    "atlas": "atlas.py",
}


class UsageError(Exception):
    """A mistake of the user's: message on standard error, exit code 2."""


def configure() -> None:
    """Set up JAX for the command line: float64, all cores, a cache of compiled code."""
    given = os.environ.get("XLA_FLAGS", "")
    names = given.replace("=", " ").split()
    flags = [flag for flag in _XLA_FLAGS if flag.split("=")[0] not in names]
    os.environ["XLA_FLAGS"] = " ".join([given, *flags]).strip()
    # Loading a cached executable logs a page about tuning hints as an error.
    os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"
    import jax

    jax.config.update("jax_enable_x64", True)
    if not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        jax.config.update("jax_compilation_cache_dir", str(home / "jaxglide"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    if not os.environ.get("JAX_NUM_CPU_DEVICES"):
        jax.config.update("jax_num_cpu_devices", os.cpu_count() or 1)
    warnings.filterwarnings("ignore", message=".*persistent compilation cache.*")


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def _add_tolerances(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("solver")
    group.add_argument("--rtol", type=_number, default=1e-6, help="relative tolerance (1e-6)")
    group.add_argument("--atol", type=_number, default=1e-6, help="absolute tolerance (1e-6)")


def _add_output(parser: argparse.ArgumentParser, plot: bool = True) -> None:
    group = parser.add_argument_group("output")
    group.add_argument("--save", metavar="FILE", type=Path, help="write a NetCDF file (.nc)")
    if plot:
        text = "write a figure (.png, .pdf, .svg)"
        group.add_argument("--plot", metavar="FILE", type=Path, help=text)
    else:
        parser.set_defaults(plot=None)
    group.add_argument("--json", action="store_true", help="print one JSON object instead")


_GROUPS = {
    "gait": ("nu_theta", "theta_m", "psi_m", "d_psi", "d_theta", "f_theta"),
    "snake": ("svl", "mass", "neck_fraction"),
    "launch": ("height", "speed"),
    "air": ("lift_scale", "drag_scale", "gravity", "air_density", "kinematic_viscosity"),
}


def _add_setup(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("setup")
    for name, choices in CHOICES.items():
        flag = f"--{name.replace('_', '-')}"
        group.add_argument(flag, choices=choices, default=choices[0], help=f"({choices[0]})")
    group.add_argument("--nodes", type=_whole, metavar="N", help="nodes (70; gauss: 60)")


def _add_glider(parser: argparse.ArgumentParser) -> None:
    for title, names in _GROUPS.items():
        group = parser.add_argument_group(title)
        for name in names:
            p = PARAMETERS[name]
            unit = f" [{p.unit}]" if p.unit else ""
            default = "" if p.default is None else f" ({p.default:.4g})"
            group.add_argument(
                f"--{name.replace('_', '-')}",
                type=_number,
                metavar="X",
                help=f"{p.meaning}{unit}{default}",
            )
    _add_setup(parser)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="jaxglide",
        description="The flight dynamics of flying snakes, as a differentiable model.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    glide = commands.add_parser(
        "glide",
        help="fly one glide",
        description="Fly one glide until it lands or an angle reaches 85 degrees.",
        epilog="Exit code: 0 for a computed glide, landed or unstable; 1 if it could not be "
        "computed to its end; 2 for wrong input.",
    )
    _add_glider(glide)
    _add_tolerances(glide)
    glide.add_argument("--solver", choices=_SOLVERS, default="dopri5", help="(dopri5)")
    _add_output(glide)
    glide.set_defaults(run=_glide)
    shapes = commands.add_parser(
        "shapes",
        help="fly the published shape space",
        description="Fly the 121 published shapes, frozen and undulating, and lay the table "
        "beside the published one.",
    )
    shapes.add_argument(
        "--height", type=_number, default=10.0, metavar="X", help="launch height [m] (10)"
    )
    shapes.add_argument(
        "--check",
        action="store_true",
        help="solve again at 1e-9 and name the shapes whose stability flips (about a minute)",
    )
    _add_tolerances(shapes)
    _add_output(shapes)
    shapes.set_defaults(run=_shapes)
    sweep = commands.add_parser(
        "sweep",
        help="fly any study: a grid or a list of cases, resumable",
        description="Fly every combination of the varied parameters. Started again with the "
        "same study and --store, it computes only what is missing.",
        epilog="Example: jaxglide sweep --vary nu_theta=1:1.5:11 --vary d_psi=0,10,20 "
        "--fix height=75 --store results/bend.zarr --save bend.nc",
    )
    sweep.add_argument("file", nargs="?", type=Path, help="study file (TOML)")
    sweep.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=VALUES",
        help="a parameter and its values: a,b,c or start:stop:count",
    )
    sweep.add_argument(
        "--fix", action="append", default=[], metavar="NAME=VALUE", help="another value"
    )
    sweep.add_argument("--store", type=Path, metavar="FOLDER", help="keep results here (Zarr)")
    sweep.add_argument("--width", type=_whole, metavar="N", help="glides per batch")
    sweep.add_argument("--cluster", metavar="ADDRESS", help="scheduler of a Dask cluster")
    _add_setup(sweep)
    _add_tolerances(sweep)
    _add_output(sweep, plot=False)
    sweep.set_defaults(run=_sweep)
    figure = commands.add_parser(
        "figure",
        help="make a published figure with its table",
        description="Run one of the scripts in experiments/.",
    )
    figure.add_argument("name", choices=_FIGURES, help=", ".join(_FIGURES))
    figure.add_argument("--out", default="results", metavar="FOLDER", help="(results)")
    figure.add_argument("--resume", action="store_true", help="keep stores, go on if killed")
    figure.add_argument("--size", type=_whole, metavar="N", help="glides of the atlas")
    figure.set_defaults(run=_figure, save=None, plot=None)
    return parser


def _writable(*paths: Path | None) -> None:
    """Fail before the work, not after it."""
    for path in paths:
        if path is None:
            continue
        if not path.parent.is_dir():
            raise UsageError(f"cannot write {path}: there is no folder {path.parent}")
        if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
            raise UsageError(f"cannot write {path}")


def _suffix(path: Path | None, option: str, allowed: tuple[str, ...]) -> None:
    if path is not None and path.suffix not in allowed:
        raise UsageError(f"{option} {path}: the name must end in {' or '.join(allowed)}")


def _check_output(args) -> None:
    _suffix(args.save, "--save", (".nc",))
    _suffix(args.plot, "--plot", (".png", ".pdf", ".svg"))
    _writable(args.save, args.plot)


def _write(data, figure, args) -> None:
    if args.save is not None:
        data().to_netcdf(args.save, engine="h5netcdf")
    if args.plot is not None:
        figure().savefig(args.plot, dpi=200)
    for path in (args.save, args.plot):
        if path is not None and not args.json:
            print(f"wrote {path}")


def _glide(args) -> int:
    import diffrax
    import numpy as np

    from .cases import build, check_parameters, check_setup
    from .glide import Outcome, simulate

    given = {name: getattr(args, name) for name in PARAMETERS}
    case = {name: value for name, value in given.items() if value is not None}
    check_parameters(case)
    setup = {name: getattr(args, name) for name in (*CHOICES, "nodes")}
    glider, launch = build(case, check_setup(setup))
    solvers = (diffrax.Dopri5, diffrax.Tsit5, diffrax.Dopri8, diffrax.Bosh3)
    glide = simulate(
        glider,
        launch,
        rtol=args.rtol,
        atol=args.atol,
        solver=dict(zip(_SOLVERS, solvers, strict=True))[args.solver](),
        dense=args.save is not None or args.plot is not None,
        max_steps=20_000,
    )
    outcome = Outcome(int(glide.outcome))

    def data():
        from .records import glide_dataset

        return glide_dataset(glide)

    def figure():
        from .plot import glide_overview

        return glide_overview(glide)

    computed = outcome <= Outcome.UNSTABLE_ROLL
    if computed:
        _write(data, figure, args)

    def angles(values):
        degrees = np.rad2deg(np.asarray(values))
        return dict(zip(("yaw", "pitch", "roll"), map(float, degrees), strict=True))

    if args.json:
        start = glide.take_off
        result = {
            "outcome": str(outcome),
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
        print(json.dumps(result))
    else:
        print(glide)
    if not computed:
        print(f"jaxglide: the glide {outcome} at {float(glide.time):.6g} s", file=sys.stderr)
        return 1
    return 0


def _shapes(args) -> int:
    from .published import borderline, shape_space, summary

    begin = time.perf_counter()
    data = shape_space(args.height, rtol=args.rtol, atol=args.atol)
    took = time.perf_counter() - begin

    def figure():
        from .plot import shape_heatmaps

        return shape_heatmaps(data)

    _write(lambda: data, figure, args)
    rows = summary(data)
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
        print(
            json.dumps(
                {"height": args.height, "seconds": took, "table": table, "borderline": flips}
            )
        )
        return 0
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
    return 0


def _values(text: str) -> tuple[str, list[float]]:
    """Name and values of NAME=a,b,c or NAME=start:stop:count."""
    name, equals, values = text.partition("=")
    try:
        if not equals:
            raise ValueError
        if ":" not in values:
            return name, [float(value) for value in values.split(",")]
        start, stop, count = values.split(":")
        if not 1 <= int(count) <= 10**7:
            raise ValueError
        step = (float(stop) - float(start)) / max(int(count) - 1, 1)
        return name, [float(start) + step * i for i in range(int(count))]
    except ValueError:
        raise UsageError(f"{text!r} is not NAME=a,b,c nor NAME=start:stop:count") from None


def _sweep(args) -> int:
    import numpy as np

    from .glide import Outcome
    from .study import Study
    from .sweep import sweep

    if args.file is not None:
        if args.vary or args.fix:
            raise UsageError("give a study file or --vary and --fix, not both")
        study = Study.from_file(args.file)
    else:
        if not args.vary:
            raise UsageError("nothing to vary: give a study file or --vary NAME=VALUES")
        fixed = {}
        for name, values in map(_values, args.fix):
            if len(values) != 1:
                raise UsageError(f"--fix {name} takes one value")
            fixed[name] = values[0]
        setup = {name: getattr(args, name) for name in (*CHOICES, "nodes")}
        grid = dict(map(_values, args.vary))
        study = Study(grid, fixed=fixed, setup=setup, rtol=args.rtol, atol=args.atol)
    if args.width is not None and args.width < 1:
        raise UsageError(f"--width {args.width} is not at least 1")
    begin = time.perf_counter()
    data = sweep(study, args.store, width=args.width, cluster=args.cluster)
    took = time.perf_counter() - begin
    _write(lambda: data, None, args)
    codes = data.outcome.values
    counts = {str(o): int((codes == o).sum()) for o in Outcome if (codes == o).any()}
    computed = all(o <= Outcome.UNSTABLE_ROLL for o in Outcome if str(o) in counts)
    if args.json:
        print(json.dumps({"glides": len(study), "seconds": took, "outcomes": counts}))
        return 0 if computed else 1
    print(f"{len(study)} glides in {took:.1f} s, shape {'x'.join(map(str, study.shape))}")
    for outcome, count in counts.items():
        print(f"  {outcome:18} {count}")
    best = int(data.landing_point.sel(axis="y").values.ravel().argmax())
    where = {name: float(v[0]) for name, v in study.columns(np.array([best])).items()}
    point = data.landing_point.sel(axis="y").values.ravel()[best]
    told = ", ".join(f"{name} {value:g}" for name, value in where.items())
    print(f"farthest forward   {point:.3f} m at {told}")
    return 0 if computed else 1


def _figure(args) -> int:
    folder = Path(__file__).parents[1] / "experiments"
    script = folder / _FIGURES[args.name]
    if not script.exists():
        raise UsageError("the figures' scripts are in a clone of the repository, not here")
    if args.size is not None and args.size < 32:
        raise UsageError(f"--size {args.size} is not at least 32")
    options = ["--out", args.out, *(["--resume"] if args.resume else [])]
    options += [] if args.size is None else ["--size", str(args.size)]
    return subprocess.run([sys.executable, str(script), *options]).returncode


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 failed, 2 wrong input)."""
    args = _parser().parse_args(argv)
    try:
        _check_output(args)
        configure()
        return args.run(args)
    except (UsageError, ValueError, TypeError) as error:
        print(f"jaxglide: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"jaxglide: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("jaxglide: interrupted", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
