"""`jaxglide plot`."""

from pathlib import Path

from ._options import UsageError, _suffix, add_force, by_name, out_of, writable, write_drawing


def add(new) -> None:
    """Options of the command; `new` makes its parser."""
    plot = new(
        description="Draw what a NetCDF file or a sweep's Zarr store holds: by default the "
        "figure that shows the whole of it, or else one of its variables.",
        epilog="Examples: jaxglide plot glide.nc --variable lift; jaxglide plot bends.nc "
        "--variable path_length --x d_psi --y nu_theta --at psi_m=20",
    )
    plot.add_argument("file", metavar="FILE", type=Path, help="file (.nc) or store (.zarr)")
    text = "figure to write (.png, .pdf, .svg); by default FILE's name with .png, here"
    output = plot.add_argument_group("output")
    output.add_argument("--out", metavar="FILE", type=Path, help=text)
    add_force(output)
    group = plot.add_argument_group("what to draw", "By default the figure that shows it all.")
    text = "variable to draw; of a glide also waves, theta, psi, body, bends and forces, of a "
    text += "steady glide also spectrum"
    group.add_argument("--variable", metavar="NAME", help=text)
    group.add_argument("--x", metavar="NAME", help="dimension across")
    group.add_argument("--y", metavar="NAME", help="dimension up")
    text = "where, in another dimension; may be repeated"
    group.add_argument("--at", action="append", default=[], metavar="NAME=VALUE", help=text)
    plot.set_defaults(run=_run, save=None, plot=None, json=False)


def _where(texts: list[str]) -> dict:
    """Coordinates given with --at, by name: numbers where they are numbers."""
    pairs = []
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise UsageError(f"--at {text!r} is not NAME=VALUE")
        try:
            pairs.append((name, float(value)))
        except ValueError:
            pairs.append((name, value))
    return by_name("--at", pairs)


def _run(args) -> int:
    out = out_of(args, Path(args.file.resolve().name).with_suffix(".png"))
    _suffix(out, "--out", (".png", ".pdf", ".svg"))
    writable(out)
    at = _where(args.at)

    from ..files.saved import open_dataset
    from ..plot.saved import draw

    data = open_dataset(args.file)
    try:
        drawing = draw(data, args.variable, x=args.x, y=args.y, at=at)
    except ValueError as error:
        said = str(error).removeprefix(f"{args.file}: ")
        raise ValueError(f"{args.file}: {said}") from error
    computed, total = data.attrs.get("computed"), data.attrs.get("total")
    if computed != total:
        print(f"{args.file} is not finished: {computed} of {total} glides are there")
    print(f"drew {drawing.said}")
    write_drawing(out, drawing.figure, args)
    return 0
