"""Many flights at once: studies, sweeps, surveys, and the stores that keep them."""
