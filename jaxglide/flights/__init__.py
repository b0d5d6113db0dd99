"""Measured flights: flown again, compared, fitted."""

from .agreement import compare_paths
from .fitter import Fit, Fitter, fit, fitted_dataset
from .flights import fly_flights

__all__ = ["Fit", "Fitter", "compare_paths", "fit", "fitted_dataset", "fly_flights"]
