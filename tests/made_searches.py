"""Searches that fly nothing: closed forms in the place of glides."""

import numpy as np

from jaxglide.search.objectives import landing_distance
from jaxglide.search.problem import Evaluation, Problem

FREE = {"theta_m": (80.0, 120.0), "nu_theta": (1.0, 1.5)}


class Made:
    """Stands in for an `Evaluator`: values and gradients from closed forms.

    In coordinates z of 0 to 1 over the bounds: objective -(z - a)^T A (z - a), and the slack
    edge - z_0 - z_1 where a constraint is asked for.
    """

    A = np.array([[3.0, 1.0], [1.0, 2.0]])

    def __init__(self, problem, centre, edge=None, hole=None, stop_at=None):
        self.problem, self.centre, self.edge = problem, np.array(centre), edge
        self.hole, self.stop_at, self.calls = hole, stop_at, 0

    def __call__(self, points, rtol=None, atol=None):
        if self.calls == self.stop_at:
            raise KeyboardInterrupt
        self.calls += 1
        width = self.problem.high - self.problem.low
        z = (points - self.problem.low) / width
        away = z - self.centre
        values = [-np.einsum("si,ij,sj->s", away, self.A, away)]
        slopes = [-2 * away @ self.A / width]
        if self.edge is not None:
            values.append(self.edge - z.sum(axis=1))
            slopes.append(np.broadcast_to(-1 / width, z.shape))
        values, slopes = np.stack(values, axis=1), np.stack(slopes, axis=1)
        if self.hole is not None:
            inside = np.linalg.norm(z - self.hole, axis=1) < 0.1
            values[inside] = np.nan
        return Evaluation(values, slopes)


def problem_of(*constraints):
    return Problem(landing_distance, FREE, constraints)
