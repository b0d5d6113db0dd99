"""Figure S8: chord and mass along the body of a 70 cm snake, on both sets of nodes."""

from common import arguments, save_figure, write_table

from jaxglide import Snake, discretise
from jaxglide._lib.defaults import NODES
from jaxglide.plot import morphology


def main() -> None:
    options = arguments(__doc__)
    rows = []
    for node_set, nodes in NODES.items():
        snake = Snake.from_svl(0.70, nodes=nodes, node_set=node_set)
        sections = discretise(snake)
        x, area, mass = sections.fraction, sections.area, sections.mass
        loading = float(mass.sum() * 9.81 / area.sum())
        middles = float(mass @ x / mass.sum()), float(area @ x / area.sum())
        sizes = 1e3 * float(mass.sum()), 1e4 * float(area.sum()), loading
        rows.append((node_set, nodes, *sizes, *middles))
        save_figure(morphology(snake), options.out / f"figure_s8_{node_set}.png")
    sizes = ("mass (g)", "area (cm^2)", "wing loading (N/m^2)")
    middles = ("middle of mass (SVL)", "middle of area (SVL)")
    write_table(options.out / "figure_s8", ("nodes", "number", *sizes, *middles), rows)


if __name__ == "__main__":
    main()
