"""Flight to points on the map, one after another."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .._lib.checks import check_kind, check_range, is_traced
from .._lib.fields import floats
from .._lib.numerics import sincos
from .._lib.types import Array, Float, Scalar
from .policy import AbstractPolicy, Sensed
from .regulator import YAW, Regulator
from .turning import CoordinatedTurn

_STRAIGHT = 1e-6  # rad a cycle; what turns less has one heading


def course(regulator: Regulator) -> Scalar:
    """By how much the mean path of a regulator's glide is to the left of its heading [rad]."""
    states = regulator.linear.states[regulator.launch :]
    s, c = sincos(states[:, YAW])
    right, forward = states[:, 0], states[:, 1]
    x, y = jnp.mean(right * c - forward * s), jnp.mean(forward * c + right * s)
    return jnp.arctan2(-x, y)


class Waypoints(AbstractPolicy):
    """Turns to points one after another.

    The heading is such that the path leads to the next point. A point is passed within `near`
    of it, or abeam of it, seen along the way from the point before (the first one from the
    origin, above which flights begin). The last point is never passed: beyond it the flight
    comes round. The environment must sense the place, and should not end a flight by its yaw.

    Args:
        steering: about a straight glide.
        points: to the right of the origin and forward of it [m], (K, 2).
        near: from how far a point is passed [m], above 0.

    Raises:
        TypeError: what steers is no `CoordinatedTurn`.
        ValueError: a number is out of range, or the glide turns by itself.

    Examples:
        >>> import jax
        >>> from jaxglide import AngleLimit, Case, CoordinatedTurn, Environment, Gait, Glider
        >>> from jaxglide import Ground, Launch, Polar, Senses, Snake, Waypoints
        >>> from jaxglide import controlled_flight, linear_quadratic
        >>> body = Snake.from_svl(0.70, nodes=40, node_set="gauss")
        >>> glider = Glider(body, Gait.from_degrees(82, 12.6, 1.12, 1.58, 7.2), Polar.smooth())
        >>> ends = Ground(), AngleLimit(angles=("pitch", "roll"))
        >>> case = Case(glider, Launch(height=75.0), ends)
        >>> flight = Environment(case, senses=Senses(velocity=True, place=True))
        >>> steering = CoordinatedTurn(linear_quadratic(flight), pace=0.2)
        >>> course = Waypoints(steering, [[-20, 50], [0, 90]])
        >>> flown = controlled_flight(flight, course, jax.random.key(0), 250)
        >>> print(f"landed: {flown.landed}, {flown.ended.state[0]:.0f} m to the right")
        landed: True, 8 m to the right
    """

    steering: CoordinatedTurn
    points: Float[Array, "K 2"] = eqx.field(converter=floats)
    near: Scalar = eqx.field(converter=floats, default=2.0)

    def __check_init__(self):
        check_kind("steering", self.steering, CoordinatedTurn)
        check_range("points", self.points, "m", -1e5, 1e5, shape=("K", 2))
        check_range("near", self.near, "m", 0, 1e5, low_open=True, shape=())
        if not len(self.points):
            raise ValueError("points is empty: give at least one")
        turn = self.steering.regulator.turn
        if not is_traced(turn) and abs(float(turn)) > _STRAIGHT:
            raise ValueError(
                f"the glide turns by {np.rad2deg(float(turn)):.3g} deg a cycle by itself: "
                "steer about one of a gait with d_theta = 0"
            )

    def start(self):
        return self.steering.start(), jnp.zeros((), jnp.int32)

    def __call__(self, memory, sensed: Sensed):
        if sensed.place is None:
            raise ValueError("the place is not sensed: give the environment Senses(place=True)")
        remembered, k = memory
        k = k + self._passed(k, sensed.place)
        right, forward = self.points[k] - sensed.place
        heading = jnp.arctan2(-right, forward) - course(self.steering.regulator)
        inputs, remembered = self.steering.towards(heading, remembered, sensed)
        return inputs, (remembered, k)

    def _passed(self, k, place):
        """One if point k is passed and there is another behind it, else 0."""
        before = jnp.where(k > 0, self.points[k - 1], 0.0)
        to, way = self.points[k] - place, self.points[k] - before
        there = (jnp.sum(to**2) < self.near**2) | (jnp.sum(to * way) < 0)
        return (there & (k + 1 < len(self.points))).astype(jnp.int32)
