"""Measured flights: flown again, compared, fitted."""
