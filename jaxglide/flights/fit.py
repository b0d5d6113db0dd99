"""Force multipliers that bring simulated flights closest to measured ones.

Least squares over the measured window of all flights at once, by exact gradients
(Levenberg-Marquardt of Optimistix). A simulation that tumbles is continued by a parabola,
so that the misfit stays smooth; the ground is taken away.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import xarray as xr

from .._lib.checks import check_integer, check_range
from .._lib.modes import either_mode
from .._lib.types import Array, Float
from .._lib.units import labelled
from ..ensemble.records import stamp
from ..flight.dynamics import POSITION, VELOCITY
from ..flight.glide import simulate
from ..loads.polar import Polar
from .flights import Measured, build_flight, check_flights, measured_of

SCALES = ("lift_scale", "drag_scale")
"""What is fitted: multipliers of the force coefficients."""
CORRECTED = ("theta_m", "psi_m", "d_psi")
"""Angles of a flight's gait that may be corrected."""

_TIMES = 24  # of a flight at which paths are compared
_DEPTH = 100.0  # m of height added, so that nothing lands
_TOLERANCE = 1e-6  # of the simulations
_STEPS = 60  # most of one fit
_PARTS = (0.4, 0.7, 1.0)  # of the window, fitted one after the other


class _Plan(eqx.Module):
    """What is part of the compiled function: angles corrected, and longest window [s]."""

    corrected: tuple[str, ...] = eqx.field(static=True)
    longest: float = eqx.field(static=True)


class _Data(NamedTuple):
    """What a fit is made to: flights, times [s] and places from the start [m], weights."""

    flights: Measured
    times: Float[Array, "N K"]
    places: Float[Array, "N K 3"]
    weights: Float[Array, " N"]
    spread: Float[Array, " c"]


def _flown(scales, change, flight: Measured, times, *, adjoint, plan) -> Array:
    """Path of one flight from its start at the times, (K, 3) [m]."""
    moved = {name: getattr(flight, name) + change[k] for k, name in enumerate(plan.corrected)}
    moved["height"] = flight.height + _DEPTH
    flight = replace(flight, **moved)
    glider, launch = build_flight(flight, Polar.smooth(*scales), None)
    options: dict[str, Any] = {"rtol": _TOLERANCE, "atol": _TOLERANCE, "adjoint": adjoint}
    options["max_steps"] = 4096
    glide = simulate(glider, launch, times=times, max_time=plan.longest, **options)
    after = jnp.maximum(times - glide.time, 0.0)[:, None]
    fall = jnp.array([0.0, 0.0, -0.5]) * glider.gravity
    state = glide.state
    parabola = state[POSITION] + state[VELOCITY] * after + fall * after**2
    assert glide.states is not None
    flying = jnp.isfinite(glide.states[:, :1])
    path = jnp.where(flying, jnp.where(flying, glide.states, 0.0)[:, POSITION], parabola)
    return path - jnp.array([0.0, 0.0, 1.0]) * flight.height


_fly_to_times = either_mode(_flown)


def _paths(y, data: _Data, plan: _Plan):
    """Paths of all flights, (N, K, 3), for logarithms of scales, and changes [sd]."""
    scales, changes = y

    def one(change, flight, times):
        change = change * data.spread
        return _fly_to_times(jnp.exp(scales), change, flight, times, plan=plan)

    return jax.vmap(one)(changes, data.flights, data.times)


def _residuals(y, args):
    """Misfit of all flights over root of their number, and changes over their sd."""
    data, plan = args
    count = data.weights.sum()
    apart = (_paths(y, data, plan) - data.places) / jnp.sqrt(data.times.shape[1] * count)
    apart = jnp.sqrt(data.weights)[:, None, None] * apart
    return apart, y[1]


@eqx.filter_jit
def _solve(start, data: _Data, plan: _Plan, prior):
    """One fit from one start."""

    def weighed(y, args):
        apart, change = _residuals(y, args)
        return apart, change * prior

    solution = optx.least_squares(
        weighed,
        optx.LevenbergMarquardt(rtol=1e-3, atol=1e-5),
        start,
        args=(data, plan),
        max_steps=_STEPS,
        throw=False,
    )
    apart = _residuals(solution.value, (data, plan))[0]
    done = solution.result == optx.RESULTS.successful
    return solution.value, jnp.sum(apart**2), solution.stats["num_steps"], done


@eqx.filter_jit
def _sensitivities(y, data: _Data, plan: _Plan):
    """Misfits, (N, 3 K), and their derivatives by the logarithms of the scales and by each
    flight's own changes [sd], (N, 3 K, 2 + c)."""
    scales, changes = y

    def one(change, flight, times, places):
        def apart(z):
            scales, change = jnp.split(z, [len(SCALES)])
            change = change * data.spread
            found = _fly_to_times(jnp.exp(scales), change, flight, times, plan=plan) - places
            return found.ravel(), found.ravel()

        return jax.jacfwd(apart, has_aux=True)(jnp.concatenate([scales, change]))

    slopes, found = jax.vmap(one)(changes, data.flights, data.times, data.places)
    return found, slopes


@dataclass(frozen=True)
class Fit:
    """Force multipliers and how well they are known.

    Attributes:
        scales: by name of `SCALES`.
        covariance: of their logarithms, from the Gauss-Newton Hessian with the misfits of a
            flight taken as dependent and those of flights as not; corrections of the gaits
            are free to follow, (2, 2).
        misfit: root mean square distance of paths at equal times, as fitted [m].
        misfit_before: with both multipliers 1 [m].
        errors, errors_before: the same of each flight [m], (N,).
        changes: corrections of the gaits, (N, c) [rad].
        starts: scales where fits began, (S, 2).
        ends: scales where they ended, (S, 2).
        misfits: root mean square there [m], (S,).
        converged: whether they had converged, (S,).
    """

    scales: dict[str, float]
    covariance: np.ndarray
    misfit: float
    misfit_before: float
    errors: np.ndarray
    errors_before: np.ndarray
    changes: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    misfits: np.ndarray
    converged: np.ndarray

    @property
    def relative_errors(self) -> np.ndarray:
        """Standard deviation of each multiplier over its value, (2,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> float:
        """Of the two logarithms."""
        return float(self.covariance[0, 1] / np.prod(self.relative_errors))

    def __str__(self) -> str:
        lines = [
            f"{name} {value:.3f} +- {value * sd:.3f}"
            for (name, value), sd in zip(self.scales.items(), self.relative_errors, strict=True)
        ]
        lines.append(f"correlation {self.correlation:+.2f}")
        lines.append(f"paths apart {self.misfit:.3f} m, unfitted {self.misfit_before:.3f} m")
        lines.append(
            f"{int(self.converged.sum())} of {len(self.ends)} starts converged, misfits "
            f"{self.misfits.min():.4f} to {self.misfits.max():.4f} m"
        )
        return "\n".join(lines)


class Fitter:
    """Fits force multipliers to a set of flights; compiles once.

    Args:
        data: measured flights over trial (see `jaxglide.measured.flights_dataset`).
        uncertainty: standard deviations of `CORRECTED` angles [deg], by name, where the
            fit may correct each flight's gait within them; by default it may not.
        noise: misfit [m] that weighs as much as a correction of one standard deviation.

    Raises:
        ValueError: a variable is missing, an unknown angle, a value out of range.
    """

    def __init__(
        self,
        data: xr.Dataset,
        uncertainty: Mapping[str, float] | None = None,
        noise: float = 0.05,
    ):
        uncertainty = dict(uncertainty or {})
        for name, value in uncertainty.items():
            if name not in CORRECTED:
                raise ValueError(f"uncertainty of {name!r}: it may be of {CORRECTED}")
            check_range(f"uncertainty of {name}", value, "deg", 0, 90, low_open=True)
        check_range("noise", noise, "m", 0, 100, low_open=True)
        data = check_flights(data)
        self.trials = [str(trial) for trial in data["trial"].values]
        self.animals = np.array([str(snake) for snake in data["snake"].values])
        windows = [_windows(data, part) for part in _PARTS]
        times, places = windows[-1]
        self.corrected = tuple(uncertainty)
        self._plan = _Plan(self.corrected, float(np.ceil(10 * times.max()) / 10))
        self._windows = [tuple(map(jnp.asarray, window)) for window in windows]
        self._data = _Data(
            measured_of(data),
            jnp.asarray(times),
            jnp.asarray(places),
            jnp.ones(len(self.trials)),
            jnp.deg2rad(jnp.array(list(uncertainty.values()), float)),
        )
        # of a correction against a misfit of all flights, whose number divides the latter
        self._prior = jnp.asarray(noise / np.sqrt(len(self.trials)))

    def start(self, scales: Sequence[float] = (1.0, 1.0)):
        """A start: logarithms of scales, no corrections."""
        check_range("scales", np.asarray(scales), "", 0, 100, low_open=True)
        changes = jnp.zeros((len(self.trials), len(self._plan.corrected)))
        return jnp.log(jnp.asarray(scales, float)), changes

    def solve(self, start, weights: np.ndarray | None = None):
        """Fit from one start with weights of the flights, (N,).

        Returns:
            Logarithms of scales and changes, mean square misfit, steps, whether it converged.
        """
        data = self._data
        if weights is not None:
            data = data._replace(weights=jnp.asarray(weights, float))
        return jax.tree.map(np.asarray, _solve(start, data, self._plan, self._prior))

    def sensitivities(self, y) -> tuple[np.ndarray, np.ndarray]:
        """Distances of the paths [m], (N, 3 K), and their derivatives by the logarithms of
        the scales and by each flight's own changes [sd], (N, 3 K, 2 + c), at logarithms of
        scales and changes."""
        found = _sensitivities(y, self._data, self._plan)
        return np.asarray(found[0]), np.asarray(found[1])

    def approach(self, start):
        """Fit to the first part of the window, then to more of it, then to the whole.

        Paths part from each other as they go on, and the misfit grows valleys; what fits
        the beginning lies in the right one. Returns what `solve` does.
        """
        y, whole = start, self._data
        for times, places in self._windows[:-1]:
            part = whole._replace(times=times, places=places)
            y = _solve(y, part, self._plan, self._prior)[0]
        return self.solve(y)

    def errors(self, y) -> np.ndarray:
        """Root mean square distance of each flight's paths [m], (N,)."""
        return np.sqrt(3 * np.mean(self.sensitivities(y)[0] ** 2, axis=1))

    def fit(self, starts: int = 8, seed: int = 0) -> Fit:
        """The best fit of several starts between half and twice the published forces.

        Args:
            starts: number of starts; the first is the published model.
            seed: of the others.
        """
        check_integer("starts", starts, 1, 10_000)
        drawn = np.random.default_rng(seed).uniform(np.log(0.5), np.log(2), (starts, 2))
        drawn[0] = 0.0
        found = [self.approach(self.start(np.exp(one))) for one in drawn]
        costs = np.array([cost for _, cost, _, _ in found])
        best = found[int(np.nanargmin(costs))][0]
        before, after = self.errors(self.start()), self.errors(best)
        return Fit(
            scales=dict(zip(SCALES, np.exp(best[0]).tolist(), strict=True)),
            covariance=self.covariance(best),
            misfit=float(np.sqrt(np.mean(after**2))),
            misfit_before=float(np.sqrt(np.mean(before**2))),
            errors=after,
            errors_before=before,
            changes=best[1] * np.asarray(self._data.spread),
            starts=np.exp(drawn),
            ends=np.exp([y[0] for y, *_ in found]),
            misfits=np.sqrt(costs),
            converged=np.array([bool(done) for *_, done in found]),
        )

    def covariance(self, y) -> np.ndarray:
        """Of the logarithms of the scales, (2, 2): H^-1 (sum over flights g g^T) H^-1.

        H is the Gauss-Newton Hessian and g each flight's gradient, both with the flight's
        own corrections following the scales (the Schur complement).
        """
        apart, slopes = self.sensitivities(y)
        by_scales, by_changes = np.split(slopes, [len(SCALES)], axis=2)
        prior = _TIMES * (float(self._prior) ** 2) * len(apart)
        tied = np.einsum("nki,nkj->nij", by_changes, by_changes)
        tied += prior * np.eye(len(self.corrected))
        mixed = np.einsum("nki,nkj->nij", by_changes, by_scales)
        follow = np.linalg.solve(tied, mixed)  # (N, c, 2)
        free = by_scales - by_changes @ follow
        hessian = np.einsum("nki,nkj->ij", by_scales, free)
        pull = np.einsum("nci,nc->ni", follow, prior * np.asarray(y[1]))
        gradients = np.einsum("nki,nk->ni", free, apart) - pull
        count = len(gradients)
        spread = gradients.T @ gradients * (count / max(count - 2, 1))
        inverse = np.linalg.inv(hessian)
        return inverse @ spread @ inverse

    def resample(self, count: int = 100, seed: int = 0, start=None) -> np.ndarray:
        """Scales fitted to animals drawn anew with replacement, (count, 2)."""
        check_integer("count", count, 1, 100_000)
        rng, names = np.random.default_rng(seed), np.unique(self.animals)
        start, found = self.start() if start is None else start, []
        for _ in range(count):
            drawn = rng.choice(names, len(names))
            weights = np.array([np.sum(drawn == animal) for animal in self.animals])
            found.append(np.exp(self.solve(start, weights)[0][0]))
        return np.array(found)

    def leave_out(self, start=None) -> list[dict[str, Any]]:
        """Each animal's flights predicted by a fit to those of the others.

        Returns:
            For each animal: its name, its number of flights, the scales fitted without it,
            and the root mean square distance of its paths [m], predicted and unfitted.
        """
        start = self.start() if start is None else start
        before, rows = self.errors(self.start()), []
        for animal in np.unique(self.animals):
            own = self.animals == animal
            y = self.solve(start, ~own)[0]
            # nothing is known of the left-out animal's gait beyond its measurement
            predicted = self.errors((y[0], np.zeros_like(y[1])))[own]
            rows.append(
                {
                    "animal": str(animal),
                    "flights": int(own.sum()),
                    **dict(zip(SCALES, np.exp(y[0]).tolist(), strict=True)),
                    "predicted": float(np.sqrt(np.mean(predicted**2))),
                    "unfitted": float(np.sqrt(np.mean(before[own] ** 2))),
                }
            )
        return rows


def _windows(data: xr.Dataset, part: float) -> tuple[np.ndarray, np.ndarray]:
    """Times in the first `part` of each flight's window, (N, K) [s], and places from its
    start, (N, K, 3) [m]."""
    times, places = [], []
    for trial in range(data.sizes["trial"]):
        t, p = data["time"].values[trial], data["position"].values[trial]
        seen = np.isfinite(t) & np.isfinite(p).all(axis=1)
        t, p = t[seen], p[seen]
        chosen = t[0] + part * (t[-1] - t[0]) * np.arange(1, _TIMES + 1) / _TIMES
        times.append(chosen - t[0])
        places.append(np.stack([np.interp(chosen, t, axis) for axis in (p - p[0]).T], axis=1))
    return np.array(times), np.array(places)


def fitted_dataset(fitter: Fitter, fit: Fit) -> xr.Dataset:
    """A fit as a labelled dataset."""
    variables = {
        "scale": (("multiplier",), list(fit.scales.values()), "", "fitted multiplier"),
        "covariance": (("multiplier", "other"), fit.covariance, "", "of the logarithms"),
        "error": (("trial",), fit.errors, "m", "rms distance of the paths, fitted"),
        "error_before": (("trial",), fit.errors_before, "m", "the same, unfitted"),
        "start": (("start_", "multiplier"), fit.starts, "", "where fits began"),
        "end": (("start_", "multiplier"), fit.ends, "", "where they ended"),
        "misfit": (("start_",), fit.misfits, "m", "rms distance there"),
        "correction": (("trial", "angle"), np.rad2deg(fit.changes), "deg", "of the gaits"),
    }
    data = xr.Dataset(
        {
            name: (dims, values, labelled(unit, long_name))
            for name, (dims, values, unit, long_name) in variables.items()
        },
        coords={"multiplier": list(SCALES), "other": list(SCALES), "trial": fitter.trials}
        | {"angle": list(fitter.corrected), "snake": ("trial", fitter.animals)},
    )
    return stamp(data, {"misfit": fit.misfit, "misfit_before": fit.misfit_before}, "fit")
