"""Pieces of a flight with a programme: where each ends, and its slopes; see `shooting`."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.cores import in_threads
from .._lib.types import Array, Float, Scalar
from ..control.plant import INPUTS
from ..flight.dynamics import PATH, RIGID
from ..flight.integrate import integrate
from ..flight.launch import TakeOff

UNIT = np.repeat([10.0, 5.0, 5.0, 1.0], 3)
"""What the first twelve numbers of a state are measured in [m, m/s, rad/s, rad]."""
COARSE, FINE = 1e-7, 1e-9
"""Tolerances of the pieces' flights, while a programme is sought and in the end."""
_GROUP = 4  # pieces of one computation


class Pieces(eqx.Module):
    """A flight in pieces.

    Attributes:
        program: a `ProgramSpace`.
        launched: what the launch comes to.
        tolerance: of their flights.
        moving: own states that are unknown at the pieces' starts: those of the inputs that
            are set (static).
        count: of pieces (static).
    """

    program: Any
    launched: TakeOff
    tolerance: Scalar
    moving: tuple[int, ...] = eqx.field(static=True)
    count: int = eqx.field(static=True)

    @classmethod
    def of(cls, program, begun: TakeOff, count: int) -> "Pieces":
        """A programme's flight from a launch in so many pieces."""
        m = len(INPUTS)
        chosen = [INPUTS.index(name) for name in program.inputs]
        moving = [*chosen, *(m + k for k in chosen)]
        moving += [2 * m] if "f_theta" in program.inputs else []
        if begun.state.shape[0] > RIGID + 2 * m + 1:
            raise ValueError("multiple shooting cannot fly air forces with states of their own")
        return cls(program, begun, jnp.asarray(COARSE), tuple(moving), count)

    @property
    def size(self) -> int:
        """Numbers of an unknown state."""
        return 12 + len(self.moving)

    @property
    def start(self) -> Array:
        """State at launch, (s,)."""
        return self.launched.state

    def full(self, u, time) -> Array:
        """A state of flight with scaled unknown ones, (s,), of a path that starts here."""
        own = self.start[RIGID:].at[-1].set(self.start[RIGID + len(INPUTS) - 1] * time)
        own = own.at[np.array(self.moving, int)].set(u[12:])
        return jnp.concatenate([u[:12] * UNIT, jnp.zeros(1), own])

    def unknown(self, state) -> Array:
        """The scaled unknown numbers of a state of flight."""
        own = state[RIGID:][np.array(self.moving, int)]
        return jnp.concatenate([state[:12] / UNIT, own])

    def end(self, u, first, k, duration, values) -> Float[Array, " n"]:
        """Where a piece ends: the unknown numbers of the next, the path flown [m], and the
        largest yaw, pitch and roll on the way [rad]."""
        glider = self.program.case.replace(
            dict(zip(self.program.names, values, strict=True))
        ).glider
        t0, t1 = duration * k / self.count, duration * (k + 1) / self.count
        start = jnp.where(first, self.start, self.full(u, t0))
        told: dict[str, Any] = dict.fromkeys(("rtol", "atol"), self.tolerance)
        told |= {"phase": self.launched.phi_theta}
        flown = integrate(glider, start, t0, t1, **told)
        path, turned = flown.state[PATH, None], flown.max_angles
        return jnp.concatenate([self.unknown(flown.state), path, turned])


@eqx.filter_jit
def _some_ends(pieces: Pieces, starts, numbers, duration, values):
    """Ends of some pieces, and their slopes by start, duration and values."""

    def one(u, k):
        def to(u, duration, values):
            found = pieces.end(u, k == 0, k, duration, values)
            return found, found

        return jax.jacfwd(to, (0, 1, 2), has_aux=True)(u, duration, values)

    (by_u, by_duration, by_values), ends = jax.vmap(one)(starts, numbers)
    return ends, by_u, by_duration, by_values


def ends_of(pieces: Pieces, starts, duration, values) -> list[np.ndarray]:
    """Ends of all pieces (M, u + 4), and their slopes by start, duration and values."""
    numbers = np.arange(pieces.count)
    parts = [numbers[k : k + _GROUP] for k in range(0, pieces.count, _GROUP)]
    parts = [np.resize(part, _GROUP) for part in parts]  # of one length: one compilation
    told = jnp.asarray(duration), jnp.asarray(values)

    def some(part):
        return _some_ends(pieces, jnp.asarray(starts[part]), jnp.asarray(part, float), *told)

    found = in_threads(some, parts)
    return [
        np.concatenate([np.asarray(x) for x in every])[: pieces.count]
        for every in zip(*found, strict=True)
    ]
