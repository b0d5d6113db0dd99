"""The right picture for a saved result."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .._lib.datasets import checked
from .._lib.formats import kind_of
from ..files.glides import glide_dataset
from ..files.restore import flight_of
from ..files.steady import steady_dataset, steady_of
from ..flight.trajectory import AbstractTrajectory
from ..steady import SteadyGlide
from ._schemas import COMPARED, MEASURED
from .atlas import stable_atlas
from .bending import bending_grid
from .body import bent_bodies, body_shape
from .branch import branch
from .control import drawn_names, phase_portrait, response, share_landed
from .flights import measured_and_simulated
from .forces import along_body_map, forces
from .glide import angles, side_view
from .heatmap import case_scatter, curve, heatmap, numeric, selected, variable_of, varied
from .measured import measured_gaits
from .moments import moments_in_time
from .optimise import convergence, paths
from .overview import glide_overview
from .shapes import shape_heatmaps
from .spectrum import spectrum
from .steady import steady
from .waves import wave_map, wave_maps
from .windtunnel import moment_by_bend


class Drawing(NamedTuple):
    """A figure, and in words what it shows."""

    figure: Figure
    said: str


class Wanted(NamedTuple):
    """What a user asks for: a variable, dimensions across and up, coordinates of others."""

    variable: str | None
    x: str | None
    y: str | None
    at: dict[str, Any]

    @property
    def nothing(self) -> bool:
        """Whether nothing in particular was asked for."""
        return not (self.variable or self.x or self.y or self.at)


def draw(
    data: xr.Dataset | AbstractTrajectory | SteadyGlide | tuple[SteadyGlide, ...],
    variable: str | None = None,
    *,
    x: str | None = None,
    y: str | None = None,
    at: Mapping[str, Any] | None = None,
) -> Drawing:
    """The figure for a saved result, or for one of its variables.

    Args:
        data: a result, such as `files.open` gives.
        variable: what to draw; by default what best shows the whole result.
        x, y: dimensions across and up; by default those of the variable that vary.
        at: coordinates, by name, of its other dimensions, such as `{"axis": "y"}`.

    Returns:
        The figure, and in words what it shows.

    Raises:
        ValueError: no such variable, dimension or coordinate, or a dimension is left over;
            the message says which there are.
    """
    wanted = Wanted(variable, x, y, dict(at or {}))
    if isinstance(data, AbstractTrajectory):
        data = glide_dataset(data)
    elif isinstance(data, SteadyGlide | tuple):
        data = steady_dataset(data)
    draw_kind = {
        "glide": _glide,
        "trajectory": _glide,
        "steady glide": _steady,
        "steady branch": _branch,
        "controlled flights": _landed,
        "optimisation": _optimisation,
        "held glides": _held,
        "measured flights": _measured,
        "compared flights": _compared,
        "shape space": _shapes,
        "glides": _sweep,
    }.get(kind_of(data) or "", _variable)
    return draw_kind(data, wanted)


def _alone(ax: Axes, said: str) -> Drawing:
    return Drawing(ax.figure, said)  # type: ignore


def _glide(data: xr.Dataset, wanted: Wanted) -> Drawing:
    name = wanted.variable
    if wanted.x or wanted.y or wanted.at:
        return _variable(data, wanted)
    controlled = any(str(one).endswith("_told") for one in data)
    if name is None and controlled:
        return Drawing(response(flight_of(data)), "the flight, and what it was told")
    if name is None:
        return Drawing(glide_overview(flight_of(data)), "the glide")
    if name == "portrait":
        return Drawing(phase_portrait(flight_of(data)), "angles against their rates")
    if name == "forces":
        return Drawing(forces(data), "forces over time and body")
    if name in ("position", "angles"):
        ax = (side_view if name == "position" else angles)(flight_of(data))
        return _alone(ax, f"{name} of the glide")
    if name in _SHAPES:
        return _shape(flight_of(data), name)
    if name in data and set(data[name].dims) == {"time", "node"}:
        return _alone(along_body_map(data, name), f"{name} over time and body")
    return _variable(data, wanted)


def _steady(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if wanted.variable not in (None, "spectrum") or wanted.x or wanted.y or wanted.at:
        return _variable(data, wanted)
    found = steady_of(data)
    if wanted.variable == "spectrum":
        return _alone(spectrum(found), "multipliers and the unit circle")
    one = found[0] if isinstance(found, tuple) else found
    return Drawing(steady(one), "two cycles of the steady glide")


def _branch(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if wanted.nothing:
        return Drawing(branch(data), "the branch, and where it is stable")
    return _variable(data, wanted)


def _landed(data: xr.Dataset, wanted: Wanted) -> Drawing:
    drawn = drawn_names(data)
    if wanted.variable or wanted.y or wanted.at or not drawn:
        return _variable(data, wanted)
    by = wanted.x or drawn[0]
    return _alone(share_landed(data, by), f"share of flights that land over {by}")


_SHAPES = ("theta", "psi", "waves", "body", "bends")


def _shape(glide: AbstractTrajectory, name: str) -> Drawing:
    """The waves of a glide, and the shapes of the body that they make."""
    gait, body, phase = glide.glider.gait, glide.glider.body, float(glide.phase)
    if name == "body":
        return Drawing(body_shape(gait, body, phase=phase), "the body at launch")
    if name == "bends":
        return Drawing(bent_bodies(gait, body, phase=phase), "the body at five bends")
    if name == "waves":
        return Drawing(wave_maps(glide), "the waves over time and body")
    return _alone(wave_map(glide, wave=name), f"the wave {name} over time and body")


def _optimisation(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if wanted.nothing:
        return Drawing(convergence(data), "the search, step by step")
    if wanted.x and wanted.y and not wanted.variable and not wanted.at:
        figure = paths(data, parameters=(wanted.x, wanted.y))
        return Drawing(figure, f"paths of the starts over {wanted.x} and {wanted.y}")
    return _variable(data, wanted._replace(variable=wanted.variable or "value"))


def _held(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if not wanted.nothing:
        return _variable(data, wanted)
    many = all(np.unique(data[n]).size > 1 for n in ("d_psi", "nu_theta") if n in data.coords)
    level = "psi_m" not in data.coords or np.unique(data["psi_m"]).size == 1
    if {"d_psi", "nu_theta"} <= set(data.coords) and many and level:
        return _alone(moment_by_bend(data), "mean pitch moment by bend and shape")
    return Drawing(moments_in_time(data), "moments in time of the first case")


def _measured(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if wanted.nothing:
        return Drawing(measured_gaits(checked(data, MEASURED)), "the gaits of all flights")
    return _variable(data, wanted)


def _compared(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if wanted.nothing:
        figure = measured_and_simulated(checked(data, COMPARED))
        return Drawing(figure, "measured and simulated paths")
    return _variable(data, wanted)


def _shapes(data: xr.Dataset, wanted: Wanted) -> Drawing:
    if wanted.nothing:
        return Drawing(shape_heatmaps(data), "height lost and path length over the shapes")
    return _sweep(data, wanted)


def _sweep(data: xr.Dataset, wanted: Wanted) -> Drawing:
    whole = wanted.variable in (None, "position", "angles") and not (wanted.x or wanted.y)
    listed = {"sample", "case"} <= set(data.dims)
    if whole and listed and {"psi_m", "d_psi", "nu_theta"} <= set(data.coords):
        quantity = "pitch" if wanted.variable == "angles" else "path"
        return Drawing(bending_grid(data, quantity), f"{quantity}s by bend and shape")
    if wanted.nothing and len(varied(data["outcome"])) > 2:
        return Drawing(stable_atlas(data), "share of stable glides over every pair")
    if wanted.variable is None:
        at = {"axis": "y", **wanted.at}
        wanted = wanted._replace(variable="landing_point", at=at)
    return _variable(data, wanted)


def _variable(data: xr.Dataset, wanted: Wanted) -> Drawing:
    """Any variable over one or two of its dimensions, or over the cases of a list."""
    if wanted.variable is None:
        raise ValueError(f"name a variable: {', '.join(numeric(data))}")
    name, at = wanted.variable, wanted.at
    values = selected(variable_of(data, name), at)
    where = "".join(
        f", {n} {v:g}" if isinstance(v, float) else f", {n} {v}" for n, v in at.items()
    )
    if "case" in values.dims and values.sizes["case"] > 1:
        found = [str(n) for n, c in data.coords.items() if c.dims == ("case",)]
        x = wanted.x or next((n for n in found if np.unique(data[n]).size > 1), found[0])
        rest = (n for n in found if n != x and np.unique(data[n]).size > 1)
        y = wanted.y or (None if wanted.x else next(rest, None))
        ax = case_scatter(data, name, x, y, at=at)
        return _alone(ax, f"{name}{where} over the cases' {x}" + (f" and {y}" if y else ""))
    free = [n for n in varied(values) if n not in (wanted.x, wanted.y)]
    x = wanted.x or (free.pop() if free else None)
    y = wanted.y or (free.pop() if free and not wanted.x else None)
    if x is None:
        raise ValueError(f"{name}{where} is a single number: there is nothing to draw over")
    if y is None:
        return _alone(curve(data, name, x, at=at), f"{name}{where} over {x}")
    return _alone(heatmap(data, name, x, y, at=at), f"{name}{where} over {x} and {y}")
