"""Force multipliers that bring simulated flights closest to measured ones.

Least squares over the measured window of all flights at once, by exact gradients (the trust
regions of SciPy's `least_squares`); see `misfit`. On all cores: fits of several starts, or of
several choices of animals, run at the same time, or else the flights of each.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
import scipy.optimize
import xarray as xr

from .._lib.checks import check_integer, check_range
from .._lib.report import Report, Reported
from .._lib.units import labelled
from ..ensemble.batch import on_workers, workers
from ..ensemble.records import stamp
from .flights import check_flights, measured_of
from .misfit import SCALES, FitData, FitPlan, distances, sensitivities

CORRECTED = ("theta_m", "psi_m", "d_psi")
"""Angles of a flight's gait that may be corrected."""

_TIMES = 24  # of a flight at which paths are compared
_PARTS = (0.4, 0.7, 1.0)  # of the window, fitted one after the other
_SIDE_BY_SIDE = 4  # flights that are simulated together: the same for any number of cores
_EVALUATIONS = 100  # most of one fit
_PRECISION = 1e-6  # of a fit: relative change of the sum of squares and of what is fitted


@dataclass(frozen=True)
class Fit(Reported):
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

    def report(self) -> Report:
        rows = [
            (name, f"{value:.3f} +- {value * sd:.3f}")
            for (name, value), sd in zip(self.scales.items(), self.relative_errors, strict=True)
        ]
        done, each = int(self.converged.sum()), self.misfits
        rows += [
            ("correlation", f"{self.correlation:+.2f}"),
            ("paths apart", f"{self.misfit:.3f} m, unfitted {self.misfit_before:.3f} m"),
            ("starts", f"{done} of {len(self.ends)} converged"),
            ("misfits", f"{each.min():.4f} to {each.max():.4f} m"),
        ]
        return Report(f"Force multipliers fitted to {len(self.errors)} flights", tuple(rows))


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
        self.corrected = tuple(uncertainty)
        spread = np.deg2rad(list(uncertainty.values()))
        self._plan = FitPlan(self.corrected, jnp.asarray(spread))
        flights, count = measured_of(data), len(self.trials)
        places = np.arange(-(-count // _SIDE_BY_SIDE) * _SIDE_BY_SIDE).clip(max=count - 1)
        self._blocks = places.reshape(-1, _SIDE_BY_SIDE)  # of flights, the last filled up
        whole = [FitData(flights, *map(jnp.asarray, window)) for window in windows]
        self._windows = [
            [jax.tree.map(itemgetter(block), data) for block in self._blocks] for data in whole
        ]
        # of a correction against a misfit of all flights, whose number divides the latter
        self._prior = noise / np.sqrt(count)

    def start(self, scales: Sequence[float] = (1.0, 1.0)):
        """A start: logarithms of scales, no corrections."""
        check_range("scales", np.asarray(scales), "", 0, 100, low_open=True)
        changes = np.zeros((len(self.trials), len(self.corrected)))
        return np.log(np.asarray(scales, float)), changes

    def solve(self, start, weights: np.ndarray | None = None, *, part: int = -1, each=None):
        """Fit from one start with weights of the flights, (N,).

        Args:
            start: logarithms of scales and changes [sd], (2,) and (N, c).
            weights: of the flights, (N,); by default all the same.
            part: which part of the window; by default the whole.
            each: calls a function with each of several flights; by default on all cores.

        Returns:
            Logarithms of scales and changes; mean square misfit, and the same with the price
            of the changes, which is least there; whether it converged.
        """
        count, own = start[1].shape
        weights = np.ones(count) if weights is None else np.asarray(weights, float)
        weigh = np.sqrt(weights / (_TIMES * weights.sum()))[:, None]

        def parted(x):
            return x[: len(SCALES)], x[len(SCALES) :].reshape(count, own)

        def residuals(x):
            apart = self._each(distances, parted(x), part, each)
            return np.concatenate([(weigh * apart).ravel(), self._prior * x[len(SCALES) :]])

        def slopes(x):
            _, found = self._each(sensitivities, parted(x), part, each)
            found = weigh[..., None] * found
            by_scales, by_changes = np.split(found, [len(SCALES)], axis=2)
            blocks = np.asarray(scipy.linalg.block_diag(*by_changes))
            apart = np.hstack([by_scales.reshape(-1, len(SCALES)), blocks])
            prior = self._prior * np.eye(count * own, len(x), len(SCALES))
            return np.vstack([apart, prior])

        exact: Any = slopes
        found = scipy.optimize.least_squares(
            residuals,
            np.concatenate([np.ravel(x) for x in start]),
            exact,
            ftol=_PRECISION,
            xtol=_PRECISION,
            gtol=_PRECISION**2,
            max_nfev=_EVALUATIONS,
        )
        misfit = np.sum(found.fun[: -count * own or None] ** 2)
        return parted(found.x), misfit, 2 * found.cost, found.status > 0

    def _each(self, function, y, part: int = -1, each=None) -> Any:
        """A function of the flights at logarithms of scales and changes, block by block."""

        def of_block(k: int):
            data = self._windows[part][k]
            found = function(jnp.asarray(y[0]), y[1][self._blocks[k]], data, self._plan)
            return jax.device_get(found)

        found = (each or on_workers)(of_block, range(len(self._blocks)))
        return jax.tree.map(lambda *x: np.concatenate(x)[: len(self.trials)], *found)

    def sensitivities(self, y) -> tuple[np.ndarray, np.ndarray]:
        """Distances of the paths [m], (N, 3 K), and their derivatives by the logarithms of
        the scales and by each flight's own changes [sd], (N, 3 K, 2 + c), at logarithms of
        scales and changes."""
        return self._each(sensitivities, y)

    def approach(self, start, *, each=None):
        """Fit to the first part of the window, then to more of it, then to the whole.

        Paths part from each other as they go on, and the misfit grows valleys; what fits
        the beginning lies in the right one. Returns what `solve` does.
        """
        for part in range(len(_PARTS)):
            found = self.solve(start, part=part, each=each)
            start = found[0]
        return found

    def errors(self, y) -> np.ndarray:
        """Root mean square distance of each flight's paths [m], (N,)."""
        return np.sqrt(3 * np.mean(self._each(distances, y) ** 2, axis=1))

    def fit(self, starts: int = 8, seed: int = 0) -> Fit:
        """The cheapest fit of several starts between half and twice the published forces.

        Args:
            starts: number of starts; the first is the published model.
            seed: of the others.
        """
        check_integer("starts", starts, 1, 10_000)
        drawn = np.random.default_rng(seed).uniform(np.log(0.5), np.log(2), (starts, 2))
        drawn[0] = 0.0
        found = _together(self.approach, [self.start(np.exp(one)) for one in drawn])
        ends, misfits, costs, converged = zip(*found, strict=True)
        best = ends[int(np.nanargmin(costs))]
        before, after = self.errors(self.start()), self.errors(best)
        return Fit(
            scales=dict(zip(SCALES, np.exp(best[0]).tolist(), strict=True)),
            covariance=self.covariance(best),
            misfit=float(np.sqrt(np.mean(after**2))),
            misfit_before=float(np.sqrt(np.mean(before**2))),
            errors=after,
            errors_before=before,
            changes=best[1] * np.asarray(self._plan.spread),
            starts=np.exp(drawn),
            ends=np.exp([y[0] for y in ends]),
            misfits=np.sqrt(misfits),
            converged=np.array(converged),
        )

    def covariance(self, y) -> np.ndarray:
        """Of the logarithms of the scales, (2, 2): H^-1 (sum over flights g g^T) H^-1.

        H is the Gauss-Newton Hessian and g each flight's gradient, both with the flight's
        own corrections following the scales (the Schur complement).
        """
        apart, slopes = self.sensitivities(y)
        by_scales, by_changes = np.split(slopes, [len(SCALES)], axis=2)
        prior = _TIMES * self._prior**2 * len(apart)
        tied = np.einsum("nki,nkj->nij", by_changes, by_changes)
        tied += prior * np.eye(len(self.corrected))
        mixed = np.einsum("nki,nkj->nij", by_changes, by_scales)
        follow = np.linalg.solve(tied, mixed)  # (N, c, 2)
        free = by_scales - by_changes @ follow
        hessian = np.einsum("nki,nkj->ij", by_scales, free)
        pull = np.einsum("nci,nc->ni", follow, prior * y[1])
        gradients = np.einsum("nki,nk->ni", free, apart) - pull
        count = len(gradients)
        spread = gradients.T @ gradients * (count / max(count - 2, 1))
        inverse = np.linalg.inv(hessian)
        return inverse @ spread @ inverse

    def resample(self, count: int = 100, seed: int = 0, start=None) -> np.ndarray:
        """Scales fitted to animals drawn anew with replacement, (count, 2)."""
        check_integer("count", count, 1, 100_000)
        rng, names = np.random.default_rng(seed), np.unique(self.animals)
        start = self.start() if start is None else start
        drawn = [rng.choice(names, len(names)) for _ in range(count)]
        weights = [np.array([np.sum(one == a) for a in self.animals]) for one in drawn]
        found = _together(partial(self.solve, start), weights)
        return np.exp([y[0] for y, *_ in found])

    def leave_out(self, start=None) -> list[dict[str, Any]]:
        """Each animal's flights predicted by a fit to those of the others.

        Returns:
            For each animal: its name, its number of flights, the scales fitted without it,
            and the root mean square distance of its paths [m], predicted and unfitted.
        """
        start = self.start() if start is None else start
        before = self.errors(self.start())

        names = np.unique(self.animals)
        found = _together(partial(self.solve, start), [self.animals != name for name in names])
        rows = []
        for name, (y, *_) in zip(names, found, strict=True):
            own = self.animals == name
            # nothing is known of the left-out animal's gait beyond its measurement
            predicted = self.errors((y[0], np.zeros_like(y[1])))[own]
            rows.append(
                {
                    "animal": str(name),
                    "flights": int(own.sum()),
                    **dict(zip(SCALES, np.exp(y[0]).tolist(), strict=True)),
                    "predicted": float(np.sqrt(np.mean(predicted**2))),
                    "unfitted": float(np.sqrt(np.mean(before[own] ** 2))),
                }
            )
        return rows


def _together(fit: Callable, items: Sequence) -> list:
    """Fits of all items: at the same time, or, where there are fewer than cores, one after
    the other and the flights of each at the same time."""
    if len(items) < len(workers()):
        return [fit(item) for item in items]
    here = partial(fit, each=lambda function, blocks: list(map(function, blocks)))
    return on_workers(here, items)


def fit(
    data: xr.Dataset,
    uncertainty: Mapping[str, float] | None = None,
    noise: float = 0.05,
    *,
    starts: int = 8,
    seed: int = 0,
) -> Fit:
    """Force multipliers that bring simulated flights closest to measured ones.

    Args:
        data, uncertainty, noise: as in `Fitter`.
        starts, seed: as in `Fitter.fit`.

    Raises:
        ValueError: a variable is missing, an unknown angle, a value out of range.
    """
    return Fitter(data, uncertainty, noise).fit(starts, seed)


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
