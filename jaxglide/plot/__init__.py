"""Matplotlib figures of glides and of the shape space.

Imported only when asked for (`import jaxglide.plot`). Figures are made with Matplotlib's
object-oriented interface: no window opens and no global state changes; save one with
`figure.savefig(path)`. Units are metres, seconds and degrees.
"""

from ._style import style
from .atlas import stable_atlas
from .bending import bending_grid
from .body import bent_bodies, body_shape, body_view
from .branch import branch
from .coefficients import force_coefficients, glide_polar_figure, morphology
from .compare import before_and_after
from .control import phase_portrait, response, share_landed
from .flights import distances, every_flight, measured_and_simulated
from .forces import along_body, along_body_lines, along_body_map, forces
from .glide import angles, side_view, speeds, top_view
from .heatmap import case_scatter, curve, heatmap
from .measured import measured_bending, measured_gaits
from .moments import moment_ratio, moments_in_time
from .optimise import convergence, paths, sensitivity_map
from .overview import glide_overview
from .saved import Drawing, draw
from .shapes import region_outlines, shape_heatmaps
from .spectrum import spectrum
from .steady import steady
from .trim import trim_curve
from .waves import bending_waves, wave_map, wave_maps
from .windtunnel import (
    bending_moments,
    landing_against_moment,
    moment_by_bend,
    moment_by_shape,
)

__all__ = [
    "Drawing",
    "along_body",
    "along_body_lines",
    "along_body_map",
    "angles",
    "before_and_after",
    "bending_grid",
    "bending_moments",
    "bending_waves",
    "bent_bodies",
    "body_shape",
    "body_view",
    "branch",
    "case_scatter",
    "convergence",
    "curve",
    "distances",
    "draw",
    "every_flight",
    "force_coefficients",
    "forces",
    "glide_overview",
    "glide_polar_figure",
    "heatmap",
    "landing_against_moment",
    "measured_and_simulated",
    "measured_bending",
    "measured_gaits",
    "moment_by_bend",
    "moment_by_shape",
    "moment_ratio",
    "moments_in_time",
    "morphology",
    "paths",
    "phase_portrait",
    "region_outlines",
    "response",
    "sensitivity_map",
    "shape_heatmaps",
    "share_landed",
    "side_view",
    "spectrum",
    "speeds",
    "stable_atlas",
    "steady",
    "style",
    "top_view",
    "trim_curve",
    "wave_map",
    "wave_maps",
]
