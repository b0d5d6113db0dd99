"""`jaxglide measure`."""

from pathlib import Path

from .._lib.writing import make_folder
from ._options import UsageError, add_output, print_json, write, write_drawing

# name in the dataset: (heading, unit, format, factor)
_COLUMNS = {
    "mass": ("mass", "g", ".1f", 1000.0),
    "svl": ("SVL", "cm", ".1f", 100.0),
    "nu_theta": ("nu_theta", "", ".3f", 1.0),
    "f_theta": ("f_theta", "Hz", ".3f", 1.0),
    "theta_m": ("theta_m", "deg", ".1f", 1.0),
    "psi_m": ("psi_m", "deg", ".1f", 1.0),
    "d_psi": ("d_psi", "deg", ".1f", 1.0),
    "nu_psi": ("nu_psi", "", ".3f", 1.0),
    "f_psi": ("f_psi", "Hz", ".3f", 1.0),
    "nu_ratio": ("nu_ratio", "", ".2f", 1.0),
    "f_ratio": ("f_ratio", "", ".2f", 1.0),
    "theta_variance": ("var_theta", "%", ".0f", 100.0),
    "psi_variance": ("var_psi", "%", ".0f", 100.0),
    "missing": ("filled", "", ".0f", 1.0),
    "longest_gap": ("gap", "ms", ".0f", 1000.0),
}
_NOTES = """\
theta_m, psi_m: amplitudes, from the modes; d_psi: bend over the snout-vent length;
ratios: vertical to horizontal; var: variance that the first mode explains;
filled: positions of markers that were not seen; gap: the longest"""


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    measure = new(
        description="Measure the gait, path and launch of recorded flights, as the published "
        "study did. DATA is a copy of the study's public data, a folder laid out like it, or "
        "one of NAME.csv files with NAME.toml or body.toml (see jaxglide/measured/tabular.py).",
        epilog="Example: jaxglide measure flights --save gaits.nc --plots figures",
    )
    measure.add_argument("data", metavar="DATA", type=Path, help="folder of recordings")
    group = measure.add_argument_group("recordings")
    text = "only this recording; may be repeated (default: all)"
    group.add_argument("--trial", action="append", metavar="NAME", help=text)
    text = "draw every flight and the gaits of all into this folder (PNG)"
    output = add_output(measure, plot=False)
    output.add_argument("--plots", type=Path, metavar="FOLDER", help=text)
    measure.set_defaults(run=_run)


def _summary(data):
    """The dataset with what the table adds."""
    first = data.variance.isel(mode=0)
    return data.assign(
        nu_ratio=data.nu_psi / data.nu_theta,
        f_ratio=data.f_psi / data.f_theta,
        theta_variance=first.sel(wave="horizontal"),
        psi_variance=first.sel(wave="vertical"),
    )


def _print_table(data) -> None:
    """Headings, units, and a row a flight."""
    columns = [("trial", "", *data.trial.values), ("snake", "", *data.snake.values)]
    for name, (heading, unit, form, factor) in _COLUMNS.items():
        cells = [format(factor * float(value), form) for value in data[name].values]
        columns.append((heading, unit, *cells))
    widths = [max(map(len, column)) for column in columns]
    for row in zip(*columns, strict=True):
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)))


def _records(data) -> list[dict]:
    """A record a flight, in the units of the dataset."""
    records = []
    for trial in data.trial.values:
        one = data.sel(trial=trial)
        record = {"trial": str(trial), "snake": str(one.snake.item())}
        record |= {name: float(one[name]) for name in _COLUMNS}
        for name in ("start_position", "start_velocity"):
            record[name] = one[name].values.tolist()
        records.append(record)
    return records


def _draw(folder: Path, flights, data, args) -> None:
    """Draw every flight and all gaits."""
    from ..plot.measured import measured_bending, measured_gaits

    for flight in flights:
        write_drawing(folder / f"{flight.trial}.png", measured_bending(flight), args)
    write_drawing(folder / "gaits.png", measured_gaits(data), args)


def _run(args) -> int:
    from ..measured import find_trials, flights_dataset, measure_folder

    if not args.data.is_dir():
        raise UsageError(f"{args.data} is not a folder")
    known = find_trials(args.data)
    if args.plots is not None and "gaits" in (args.trial or known):
        raise UsageError("--plots: the recording 'gaits' has the name of the figure of all")
    for trial in args.trial or ():
        if trial not in known:
            raise UsageError(f"no recording {trial!r} in {args.data}: {', '.join(known)}")
    if args.plots is not None:
        make_folder(args.plots)
    flights = measure_folder(args.data, args.trial, progress=not args.json)
    data = flights_dataset(flights)
    write(lambda: data, None, args)
    if args.plots is not None:
        _draw(args.plots, flights, data, args)
    if args.json:
        print_json({"flights": _records(_summary(data))})
        return 0
    _print_table(_summary(data))
    print(_NOTES)
    return 0
