"""Pictures of large sweeps: where in the space of gaits a glide is stable."""

from itertools import combinations

import xarray as xr
from matplotlib.figure import Figure

from ..flight.ends import Outcome
from ._labels import label_of
from ._style import new_figure, style


def stable_atlas(data: xr.Dataset) -> Figure:
    """Share of stable glides over every pair of swept parameters, averaged over the rest.

    Args:
        data: a sweep over a grid of at least two parameters, with `outcome`, below 0 where
            a glide was not computed.

    Returns:
        The figure: a triangle of maps, one a pair of parameters.

    Raises:
        ValueError: fewer than two parameters were swept.
    """
    names = [str(name) for name in data.outcome.dims if data.sizes[name] > 1]
    if len(names) < 2 or "case" in names:
        raise ValueError("an atlas needs a sweep over a grid of at least two parameters")
    computed = data.outcome >= 0
    stable = (100.0 * (data.outcome == Outcome.LANDED)).where(computed)
    count = len(names) - 1
    with style():
        figure = new_figure(width=180.0, height=14 + 40.0 * count)
        figure.set_layout_engine("constrained")
        axes = figure.subplots(count, count, squeeze=False)
        for ax in axes.ravel():
            ax.set_axis_off()
        mesh = None
        for x, y in combinations(names, 2):
            ax = axes[names.index(y) - 1, names.index(x)]
            ax.set_axis_on()
            share = stable.mean([n for n in names if n not in (x, y)]).transpose(y, x)
            share = share.sortby([x, y])
            across, up = share[x].values, share[y].values
            mesh = ax.pcolormesh(
                across, up, share.values, shading="nearest", vmin=0, vmax=100, cmap="viridis"
            )
            if names.index(y) == count:
                ax.set_xlabel(label_of(data[x]))
            if names.index(x) == 0:
                ax.set_ylabel(label_of(data[y]))
        assert mesh is not None
        figure.colorbar(mesh, ax=axes, shrink=0.5, label="stable glides (%)")
        total = int(computed.sum())
        figure.suptitle(f"{total} glides: {float(stable.mean()):.1f} % land", fontsize=7.5)
    return figure
