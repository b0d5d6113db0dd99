"""`jaxglide compare`."""

from pathlib import Path

from .._lib.defaults import CHOICES
from .._lib.writing import make_folder
from ._options import UsageError, a_number, add_output, print_json, write, write_drawing

_MEANING = {"polar": "force coefficients", "node_set": "places of the nodes"}


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    compare = new(
        description="Fly every measured flight from its measured start with its measured gait, "
        "and compare the paths (the paper's figure 3). DATA is a folder of recordings, as for "
        "`jaxglide measure`, or a file that it saved.",
        epilog="Example: jaxglide compare flights --plots figures",
    )
    compare.add_argument("data", metavar="DATA", type=Path, help="folder, or NetCDF file (.nc)")
    group = compare.add_argument_group("model")
    for name in ("polar", "node_set"):
        choices = CHOICES[name]
        flag = f"--{name.replace('_', '-')}"
        text = f"{_MEANING[name]} (default: {choices[0]})"
        group.add_argument(flag, choices=choices, default=choices[0], help=text)
    for name in ("lift", "drag"):
        text = f"multiplier on the {name} coefficient (0 to 100; default: 1)"
        group.add_argument(
            f"--{name}-scale", type=a_number, default=1.0, metavar="X", help=text
        )
    text = "draw the comparison into this folder (PNG)"
    output = add_output(compare, plot=False)
    output.add_argument("--plots", type=Path, metavar="FOLDER", help=text)
    compare.set_defaults(run=_run)


def measured_flights(path: Path, quiet: bool):
    """The flights of a folder of recordings, or of a file saved by `jaxglide measure`."""
    if path.is_dir():
        from ..measured import flights_dataset, measure_folder

        return flights_dataset(measure_folder(path, progress=not quiet))
    if not path.exists():
        raise UsageError(f"{path}: there is no such folder or file")
    from .._lib.netcdf import load_netcdf

    return load_netcdf(path)


def _draw(folder: Path, flown, args) -> None:
    from ..plot._style import new_figure
    from ..plot.flights import distances, every_flight, measured_and_simulated

    alone = new_figure(height=90.0)
    alone.set_layout_engine("constrained")
    distances(flown, alone.add_subplot())
    for name, figure in (
        ("paths", measured_and_simulated(flown)),
        ("every_flight", every_flight(flown)),
        ("distances", alone),
    ):
        write_drawing(folder / f"{name}.png", figure, args)


def _run(args) -> int:
    import numpy as np

    from ..flight.ends import Outcome
    from ..flights.agreement import compare_paths, summary
    from ..flights.flights import fly_flights

    data = measured_flights(args.data, args.json)
    if args.plots is not None:
        make_folder(args.plots)
    flown = fly_flights(
        data,
        polar=args.polar,
        node_set=args.node_set,
        lift_scale=args.lift_scale,
        drag_scale=args.drag_scale,
    )
    compared = compare_paths(flown)
    whole = np.isfinite(compared.path_error.values)
    write(lambda: flown.merge(compared), None, args)
    if args.plots is not None and whole.any():
        _draw(args.plots, flown.isel(trial=whole), args)
    outcomes = [str(Outcome(int(code))) for code in flown.outcome.values]
    code = 0 if whole.all() else 1
    if args.json:
        names = [str(name) for name in compared.data_vars]
        rows = [
            {"trial": trial, "outcome": outcomes[row]}
            | {name: compared[name].values[row].item() for name in names}
            for row, trial in enumerate(compared.trial.values.tolist())
        ]
        print_json({"flights": rows})
        return code
    print("trial  snake  measured m  simulated m  apart m  simulation")
    for row, outcome in enumerate(outcomes):
        one = compared.isel(trial=row)
        lengths = float(one.distance_measured), float(one.distance_simulated)
        back = ", did not shallow" if one.turned_simulated else ""
        cells = f"{lengths[0]:10.2f}  {lengths[1]:11.2f}  {float(one.path_error):7.2f}"
        print(f"{one.trial.item():>5}  {one.snake.item():>5}  {cells}  {outcome}{back}")
    print(summary(compared))
    return code
