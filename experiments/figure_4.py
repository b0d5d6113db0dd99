"""Figure 4 and table S1: the shape space from 10 m and 75 m, frozen and undulating."""

from common import arguments, save_dataset, save_figure, write_table

from jaxglide.ensemble.published import long_summary, shape_space, summary
from jaxglide.plot import shape_heatmaps


def main() -> None:
    options = arguments(__doc__)
    short = shape_space(10.0, store=options.store("figure_4_10m"))
    tall = shape_space(75.0, store=options.store("figure_4_75m"))
    rows = [(f"{name}, f {f:g} Hz", *rest) for name, f, *rest in summary(short)]
    rows += [(f"75 m: {name}", *rest) for name, *rest in long_summary(tall)]
    write_table(options.out / "table_s1", ("quantity", "region", "jaxglide", "published"), rows)
    for height, data in (("10m", short), ("75m", tall)):
        save_figure(shape_heatmaps(data), options.out / f"figure_4_{height}.png")
        save_dataset(data, options.out / f"figure_4_{height}.nc")


if __name__ == "__main__":
    main()
