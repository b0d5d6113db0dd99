"""Linear-quadratic control about a steady glide: the return map with inputs, sampled.

The state that is controlled is the reduced state of a flight (see `steady.reduced`) with its
yaw, and the states of the c actuators that are set: velocity in heading axes, angular velocity,
pitch, roll, yaw, positions, rates, and what they were told at the sample before, which holds
until new inputs arrive: n = 9 + 3 c numbers.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from .._lib.checks import check_range
from .._lib.numerics import sincos
from .._lib.types import Array, Float, State
from ..flight.dynamics import ANGLES, OMEGA, RIGID, VELOCITY
from ..steady import SteadyGlide, steady_glide
from ..steady.reduced import scales
from .environment import Environment
from .plant import INPUTS, Plant
from .policy import AbstractPolicy, Sensed, deviation

YAW = 8
"""Where the yaw is in a controlled state."""
REACH = 0.15
"""From how far the yaw is called back [rad]; beyond, a turn goes on no faster."""
SENSED = slice(3, 9)
"""Angular velocity and attitude there, which an observer is told of."""


def controlled_state(state: State, told, chosen: tuple[int, ...]) -> Float[Array, " n"]:
    """The controlled state of a state of flight (s,), and of what was told, (c,)."""
    index = np.array(chosen)
    s, c = sincos(state[ANGLES][0])
    x, y, z = state[VELOCITY]
    heading = jnp.stack([x * c + y * s, y * c - x * s, z])
    own = state[RIGID:][index], state[RIGID + len(INPUTS) :][index], told
    return jnp.concatenate([heading, state[OMEGA], jnp.roll(state[ANGLES], -1), *own])


def flight_state(
    controlled: Float[Array, " n"], time, plant: Plant, chosen: tuple[int, ...]
) -> State:
    """A state of flight at the origin with a controlled state; other actuators at rest."""
    index, m = np.array(chosen), len(INPUTS)
    pitch, roll, yaw = controlled[6:9]
    s, c = sincos(yaw)
    right, forward, up = controlled[:3]
    velocity = jnp.stack([right * c - forward * s, forward * c + right * s, up])
    position, rates, _ = jnp.split(controlled[9:], 3)
    none = jnp.zeros(3)
    own = jnp.concatenate([plant.inputs, jnp.zeros(m), (plant.inputs[-1] * time)[None]])
    own = own.at[index].set(position).at[m + index].set(rates)
    angles = jnp.stack([yaw, pitch, roll])
    return jnp.concatenate([none, velocity, controlled[3:6], angles, none[:1], own])


def next_state(
    controlled, inputs, time, plant: Plant, chosen: tuple[int, ...]
) -> Float[Array, " n"]:
    """The controlled state an interval later.

    Args:
        controlled: at the sample, (n,).
        inputs: the chosen ones, held, (c,).
        time: of the sample since launch [s].
        plant: what flies; its ends are not looked at.
        chosen: which inputs are set.
    """
    plant = eqx.tree_at(lambda p: p.ends, plant, ())
    start = flight_state(controlled, time, plant, chosen)
    flying = plant.launched(start)._replace(time=time)
    index = np.array(chosen)
    before = plant.inputs.at[index].set(controlled[-len(chosen) :])
    flown = plant.after_delay(flying, before, plant.inputs.at[index].set(inputs))
    return controlled_state(flown.state, inputs, chosen)


class Linear(NamedTuple):
    """x_{k+1} - x*_{k+1} = A_k (x_k - x*_k) + B_k (u_k - u*_k), of N samples.

    Attributes:
        states: x*, (N, n).
        A: (N, n, n).
        B: (N, n, c).
    """

    states: Float[Array, "N n"]
    A: Float[Array, "N n n"]
    B: Float[Array, "N n c"]


@eqx.filter_jit
def linearised(start, plant: Plant, chosen: tuple[int, ...], samples: int) -> Linear:
    """Along the flight from a controlled state (n,), the chosen inputs held; exact."""
    held = plant.inputs[np.array(chosen)]
    times = plant.interval * jnp.arange(samples)

    def on(x, time):
        return next_state(x, held, time, plant, chosen), x

    states = jax.lax.scan(on, start, times)[1]

    def slopes(x, time):
        return jax.jacfwd(lambda x, u: next_state(x, u, time, plant, chosen), argnums=(0, 1))(
            x, held
        )

    A, B = jax.lax.map(lambda at: slopes(*at), (states, times))
    return Linear(states, A, B)


class Gains(NamedTuple):
    """Feedback gains, and the cost that is left.

    Attributes:
        K: u_k = u*_k - K_k (x_k - x*_k), (N, c, n).
        P: the cost of x_0 - x*_0 is its square in this matrix, (n, n).
        multipliers: of a cycle under control, complex, the largest first, (n,).
    """

    K: np.ndarray
    P: np.ndarray
    multipliers: np.ndarray


def _lifted(linear: Linear, Q, R):
    """One cycle as one step: x_N of x_0 and all inputs, and its cost as one square."""
    count, n, c = np.asarray(linear.B).shape
    A, B = np.asarray(linear.A), np.asarray(linear.B)
    here = np.concatenate([np.eye(n), np.zeros((n, count * c))], axis=1)
    cost = np.zeros((n + count * c,) * 2)
    for k in range(count):
        cost += here.T @ Q @ here
        told = slice(n + k * c, n + (k + 1) * c)
        cost[told, told] += R
        here = A[k] @ here
        here[:, told] += B[k]
    return here[:, :n], here[:, n:], cost


def riccati(linear: Linear, Q, R) -> Gains:
    """The linear-quadratic regulator of a periodic system.

    A cycle is one step of a system that does not change, whose Riccati equation SciPy solves;
    the gains of the samples follow from its solution backwards.

    Args:
        linear: of one cycle.
        Q, R: weights of state and inputs, (n, n) and (c, c).

    Raises:
        ValueError: the inputs cannot stabilise it.
    """
    A, B = np.asarray(linear.A), np.asarray(linear.B)
    n = A.shape[1]
    whole, told, cost = _lifted(linear, Q, R)
    parts = cost[:n, :n], cost[n:, n:], cost[:n, n:]
    try:
        P0 = solve_discrete_are(whole, told, parts[0], parts[1], s=parts[2])
    except (LinAlgError, ValueError) as error:
        raise ValueError(f"the inputs cannot stabilise this glide: {error}") from None
    P, gains, closed = P0, [], np.eye(n)
    for k in range(len(A) - 1, -1, -1):
        K = np.linalg.solve(R + B[k].T @ P @ B[k], B[k].T @ P @ A[k])
        P = Q + A[k].T @ P @ (A[k] - B[k] @ K)
        gains.append(K)
    gains = np.array(gains[::-1])
    for k in range(len(A)):
        closed = (A[k] - B[k] @ gains[k]) @ closed
    values = np.linalg.eigvals(closed)
    return Gains(gains, P0, values[np.argsort(-np.abs(values))])


def filter_gains(linear: Linear, noise, drift, cycles: int = 200) -> np.ndarray:
    """Gains of the Kalman filter that sees angular velocity, attitude and the actuators.

    The covariance is carried on, cycle after cycle, until it repeats itself.

    Args:
        linear: of one cycle.
        noise: variances of what is seen, (p,).
        drift: variances that the state gains in an interval, (n,).
        cycles: at most.

    Returns:
        L: the estimate is moved by L_k times what was seen less what was expected, (N, n, p).
    """
    A = np.asarray(linear.A)
    count, n = A.shape[:2]
    C = np.eye(n)[SENSED.start :]
    P, last = np.diag(np.asarray(drift, float)), None
    for _ in range(cycles):
        gains = []
        for k in range(count):
            seen = C @ P @ C.T + np.diag(noise)
            L = np.linalg.solve(seen, C @ P).T
            kept = np.eye(n) - L @ C
            P = kept @ P @ kept.T + L @ np.diag(noise) @ L.T  # which rounding keeps positive
            P = A[k] @ P @ A[k].T + np.diag(drift)
            gains.append(L)
        if last is not None and np.allclose(gains, last, rtol=1e-9, atol=1e-12):
            break
        last = gains
    return np.array(gains)


class Regulator(AbstractPolicy):
    """Linear-quadratic feedback about a steady glide, with an observer where it cannot see all.

    Attributes:
        linear: the system about the glide, of one cycle of N samples.
        K: gains, (N, c, n).
        L: gains of the observer, (N, n, p), or None: all of the state is sensed.
        inputs: of the glide, (6,).
        low, high: limits of those that are set, (c,).
        turn: change of yaw in a cycle [rad].
        heading: yaw that is wanted, besides [rad].
        chosen: which inputs are set (static).
    """

    linear: Linear
    K: Float[Array, "N c n"]
    L: Float[Array, "N n p"] | None
    inputs: Float[Array, "6"]
    low: Float[Array, " c"]
    high: Float[Array, " c"]
    turn: Float[Array, ""]
    heading: Float[Array, ""]
    chosen: tuple[int, ...] = eqx.field(static=True)

    def start(self):
        none = jnp.zeros_like(self.linear.states[0])
        return none, jnp.zeros(len(self.chosen))

    def __call__(self, memory, sensed: Sensed):
        count = self.K.shape[0]
        k = sensed.sample % count
        reference = (
            self.linear.states[k]
            .at[YAW]
            .add(self.heading + self.turn * (sensed.sample // count))
        )
        apart, told = deviation(sensed, reference, self.chosen), memory[1]
        apart = apart.at[YAW].set(jnp.clip(apart[YAW], -REACH, REACH))
        if self.L is not None:
            last = (sensed.sample - 1) % count
            expected = self.linear.A[last] @ memory[0] + self.linear.B[last] @ told
            first = sensed.sample == 0
            seen = apart[SENSED.start :]
            guess = jnp.zeros_like(apart).at[SENSED.start :].set(seen)
            moved = expected + self.L[k] @ (seen - expected[SENSED.start :])
            apart = jnp.where(first, guess, moved)
        index = jnp.array(self.chosen)
        base = self.inputs[index]
        wanted = jnp.clip(base - self.K[k] @ apart, self.low, self.high)
        return self.inputs.at[index].set(wanted), (apart, wanted - base)


def weights(plant: Plant, chosen: tuple[int, ...], scales, price: float = 1.0):
    """Weights of state and inputs: one for a scaled unit, one for half a range.

    Args:
        plant: what is controlled.
        chosen: which inputs are set.
        scales: of the reduced state, (8,).
        price: of the inputs.
    """
    drive = plant.drive
    half = np.asarray(drive.high - drive.low)[list(chosen)] / 2
    free = np.zeros(3 * len(chosen))
    Q = np.diag(np.concatenate([1 / np.asarray(scales) ** 2, [1.0], free + 1e-9]))
    return Q, price * np.diag(1 / half**2)


def limits(plant: Plant, chosen: tuple[int, ...]) -> tuple[Array, Array]:
    """Lowest and highest of the inputs that are set, (c,) each, within which an actuator is
    linear."""
    drive, index = plant.drive, np.array(chosen)
    middle, half = (drive.high + drive.low) / 2, 0.9 * (drive.high - drive.low) / 2
    return (middle - half)[index], (middle + half)[index]


def start_of(state, plant: Plant, chosen: tuple[int, ...]) -> Float[Array, " n"]:
    """The controlled state of a reduced one (8,), of yaw 0, its actuators at rest."""
    index = np.array(chosen)
    held = plant.inputs[index]
    return jnp.concatenate([state, jnp.zeros(1), held, 0 * held, held])


DRIFT = 0.05
"""Share of its scale that a state drifts by in an interval, as an observer takes it."""
_SURE = 1e-3  # rad or 1/s; no sense is taken to be better


def linear_quadratic(
    environment: Environment,
    glide: SteadyGlide | None = None,
    *,
    price: float = 1.0,
    heading: float = 0.0,
) -> Regulator:
    """The linear-quadratic regulator of an environment about the steady glide of its gait.

    It weighs a scaled unit of the state as much as half the range of an input. Where the
    environment does not sense velocity, a Kalman filter estimates it.

    Args:
        environment: a case and how it is sampled and sensed.
        glide: the steady glide, of the environment's launch phase; by default it is sought.
        price: of the inputs, above 0.
        heading: yaw to fly at [rad].

    Raises:
        ValueError: there is no steady glide, the inputs cannot stabilise it, or a number is
            out of range.
    """
    check_range("price", price, "", 0, 1e6, low_open=True, shape=())
    check_range("heading", heading, "rad", -1e3, 1e3, shape=())
    plant, chosen = environment.plant, environment.chosen
    if glide is None:
        glide = steady_glide(environment.held, phase=float(plant.flight.phase))
    if not bool(glide.found):
        raise ValueError(f"there is no steady glide to regulate: {glide.why}")
    start = start_of(glide.state, plant, chosen)
    samples = round(float(glide.period / plant.interval))
    linear = linearised(start, plant, chosen, samples)
    unit = scales(environment.held, plant.flight.sections)
    gains = riccati(linear, *weights(plant, chosen, unit, price))
    L, senses = None, environment.senses
    if not senses.velocity:
        sure = np.array([senses.omega_noise] * 3 + [senses.angle_noise] * 3, float)
        grain = float(senses.resolution) / np.sqrt(12)
        sure[3:] = np.hypot(sure[3:], grain)
        seen = np.concatenate([np.maximum(sure, _SURE), np.full(3 * len(chosen), _SURE)])
        moved = np.concatenate([np.asarray(unit), [1.0], np.full(3 * len(chosen), _SURE)])
        L = jnp.asarray(filter_gains(linear, seen**2, (DRIFT * moved) ** 2))
    turn = jnp.asarray(glide.turn_rate * glide.period)
    told = plant.inputs, *limits(plant, chosen), turn, jnp.asarray(float(heading))
    return Regulator(linear, jnp.asarray(gains.K), L, *told, chosen)
