"""What is known of a steady glide that was followed along a number."""

import math
from typing import TYPE_CHECKING

import equinox as eqx
import numpy as np

from .._lib.formats import marked
from .._lib.report import Report, Reported
from .._lib.types import Bool, Complex, Float
from .._lib.units import labelled
from .reduced import COMPONENTS

if TYPE_CHECKING:
    import xarray as xr

_ABOUT = {
    "period": {"units": "s", "long_name": "period"},
    "speed": {"units": "m s-1", "long_name": "speed at the start"},
    "glide_angle": {"units": "rad", "long_name": "mean path below the horizontal"},
    "forward_speed": {"units": "m s-1", "long_name": "forward speed"},
    "sink_rate": {"units": "m s-1", "long_name": "sink rate"},
    "turn_rate": {"units": "rad s-1", "long_name": "rate of turning to the left"},
    "spectral_radius": {"units": "1", "long_name": "spectral radius"},
}


class Branch(eqx.Module, Reported):
    """A steady glide followed along one number, as arrays over its points, in order.

    The order is that of the branch: the number may turn back. Angles are in radians, but for
    `parameter`.

    Attributes:
        name: of the number, briefly (static).
        unit: of `parameter`, the one that people read (static).
        found: whether there was a steady glide to start from; without one there are no points.
        parameter: values of the number, (N,).
        state: at the starts of cycles, as `SteadyGlide.state`, (N, 8).
        states: the same at the starts of the pieces that a cycle, or half of one, is cut into,
            (N, k, 8).
        period: of a cycle [s], (N,); of a frozen body a second.
        speed: at the starts of cycles [m/s], (N,).
        glide_angle: of the mean path below the horizontal [rad], (N,).
        forward_speed, sink_rate: along it [m/s], (N,).
        turn_rate: to the left [rad/s], (N,).
        multipliers: of a cycle (of a frozen body, of a second), the largest first, (N, 8).
        spectral_radius: modulus of the first, (N,).
        kinds: what is special about a point, (N,): "fold", where the number turns back; "+1",
            where a multiplier leaves or enters the unit circle through 1 and the number does
            not turn, so that other steady glides branch off; "-1" through -1, of half a cycle
            and its mirror image where that is the map: steady glides that are not their own
            mirror image branch off in pairs, one turning left and one right, otherwise
            glides of twice the period; "pair" for two complex ones, behind which the flight
            swings with a period of its own; "start"; "" for all others.
        ends: why it ends, below and above, or at its first and last point, in words (static).
        frozen, mirrored: which equation was solved (static); see `Kind`.
    """

    name: str = eqx.field(static=True)
    unit: str = eqx.field(static=True)
    found: bool = eqx.field(static=True)
    parameter: Float[np.ndarray, " N"]
    state: Float[np.ndarray, "N 8"]
    states: Float[np.ndarray, "N k 8"]
    period: Float[np.ndarray, " N"]
    speed: Float[np.ndarray, " N"]
    glide_angle: Float[np.ndarray, " N"]
    forward_speed: Float[np.ndarray, " N"]
    sink_rate: Float[np.ndarray, " N"]
    turn_rate: Float[np.ndarray, " N"]
    multipliers: Complex[np.ndarray, "N 8"]
    kinds: np.ndarray
    ends: tuple[str, str] = eqx.field(static=True)
    frozen: bool = eqx.field(static=True)
    mirrored: bool = eqx.field(static=True)

    @property
    def spectral_radius(self) -> Float[np.ndarray, " N"]:
        """Modulus of the largest multiplier, (N,)."""
        return np.abs(self.multipliers[:, 0])

    @property
    def stable(self) -> Bool[np.ndarray, " N"]:
        """Where every small change dies out, (N,)."""
        return self.spectral_radius < 1

    @property
    def exponents(self) -> Complex[np.ndarray, "N 8"]:
        """Rates at which small changes grow and turn [1/s], (N, 8)."""
        return np.log(self.multipliers) / self.period[:, None]

    @property
    def special(self) -> tuple[int, ...]:
        """Points about which something is special, by their places in the arrays."""
        return tuple(k for k, kind in enumerate(self.kinds) if kind not in ("", "start"))

    def dataset(self) -> "xr.Dataset":
        """The branch as a Dataset over `point`, to save with `jaxglide.save`.

        Multipliers as real and imaginary parts over `multiplier`, the state over `component`.
        """
        import xarray as xr

        over = {name: ("point", getattr(self, name), about) for name, about in _ABOUT.items()}
        values = {"real": np.real(self.multipliers), "imag": np.imag(self.multipliers)}
        spectra = {
            f"multipliers_{part}": (
                ("point", "multiplier"),
                value,
                {"units": "1", "long_name": f"multipliers of a cycle, {part}"},
            )
            for part, value in values.items()
        }
        told = {"long_name": "velocity, angular velocity, pitch and roll at the start"}
        variables = {
            "parameter": ("point", self.parameter, labelled(self.unit or "1", self.name)),
            "state": (("point", "component"), self.state, told),
            "kind": ("point", self.kinds.astype(str), {"long_name": "what is special"}),
            **over,
            **spectra,
        }
        data = xr.Dataset(variables, {"component": list(COMPONENTS)})
        named = {"parameter": self.name, "first": self.ends[0], "last": self.ends[1]}
        return marked(data.assign_attrs(named), "steady branch")

    def report(self) -> Report:
        if not self.found:
            return Report(f"No branch in {self.name}: {self.ends[0]}")
        low, high = float(self.parameter.min()), float(self.parameter.max())
        unit = f" {self.unit}" if self.unit else ""
        stable = int(self.stable.sum())
        rows = [
            ("range", f"{low:g} to {high:g}{unit}"),
            ("points", f"{len(self.parameter)}, {stable} of them stable"),
            ("first point", self.ends[0]),
            ("last point", self.ends[1]),
        ]
        for k in self.special:
            text = f"{self.parameter[k]:.4g}{unit}, {math.degrees(self.glide_angle[k]):.2f} deg"
            rows.append((str(self.kinds[k]), text))
        return Report(f"Branch of steady glides in {self.name}", tuple(rows))
