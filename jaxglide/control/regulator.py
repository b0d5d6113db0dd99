"""Linear-quadratic control about a steady glide, and from the launch to it."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from .._lib.checks import check_integer, check_kind, check_range
from .._lib.types import Array, Float
from ..flight.launch import started
from ..steady import SteadyGlide, steady_glide
from ..steady.reduced import scales
from .environment import Environment
from .planning import CLOSED, LaunchPlan, PlanGoal, plan_launch
from .plant import Plant, limits
from .policy import AbstractPolicy, Sensed, deviation
from .sampled import YAW, Linear, SampledPath, controlled_state, linearised, start_of

REACH = 0.15
"""From how far the yaw is called back [rad]; beyond, a turn goes on no faster."""
SENSED = slice(3, 9)
"""Angular velocity and attitude there, which an observer is told of."""


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


def lifted(linear: Linear, Q, R):
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
    whole, told, cost = lifted(linear, Q, R)
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
    values = values[np.argsort(-np.abs(values))]
    if not np.abs(values[0]) < 1:  # SciPy may find a solution that stabilises nothing
        raise ValueError(
            "the inputs cannot stabilise this glide: under the best gains an error is "
            f"multiplied by {np.abs(values[0]):.3g} in a cycle"
        )
    return Gains(gains, P0, values)


def _filtered(A, P, noise, drift):
    """Gains of the Kalman filter along A (N, n, n), from a covariance, and that at the end."""
    gains, n = [], A.shape[1]
    C = np.eye(n)[SENSED.start :]
    for one in A:
        seen = C @ P @ C.T + np.diag(noise)
        L = np.linalg.solve(seen, C @ P).T
        kept = np.eye(n) - L @ C
        P = kept @ P @ kept.T + L @ np.diag(noise) @ L.T  # which rounding keeps positive
        P = one @ P @ one.T + np.diag(drift)
        gains.append(L)
    return np.array(gains), P


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
    A, P, last = np.asarray(linear.A), np.diag(np.asarray(drift, float)), None
    gains = np.zeros(0)
    for _ in range(cycles):
        gains, P = _filtered(A, P, noise, drift)
        if last is not None and np.allclose(gains, last, rtol=1e-9, atol=1e-12):
            break
        last = gains
    return gains


class Regulator(AbstractPolicy):
    """Linear-quadratic feedback about a steady glide, with an observer where it cannot see all.

    The first M samples are those of a planned launch, if there is one; the N of a cycle follow
    and repeat themselves.

    Attributes:
        linear: the system along the plan and about the glide, M + N samples.
        K: gains, (M + N, c, n).
        L: gains of the observer, (M + N, n, p), or None: all of the state is sensed.
        told: inputs of plan and glide, (M + N, c).
        jump: of the reference from the plan's end to the glide, (n,).
        inputs: held, (6,).
        low, high: limits of those that are set, (c,).
        turn: change of yaw in a cycle [rad].
        heading: yaw that is wanted, besides [rad].
        chosen: which inputs are set (static).
        launch: M, samples of the plan (static).
    """

    linear: Linear
    K: Float[Array, "N c n"]
    L: Float[Array, "N n p"] | None
    told: Float[Array, "N c"]
    jump: Float[Array, " n"]
    inputs: Float[Array, "6"]
    low: Float[Array, " c"]
    high: Float[Array, " c"]
    turn: Float[Array, ""]
    heading: Float[Array, ""]
    chosen: tuple[int, ...] = eqx.field(static=True)
    launch: int = eqx.field(static=True, default=0)

    def start(self):
        return jnp.zeros_like(self.linear.states[0])

    def place(self, sample):
        """Row of a sample, and cycles since launch by which the glide there has turned."""
        later, count = sample - self.launch, self.K.shape[0] - self.launch
        row = jnp.where(later < 0, sample, self.launch + later % count)
        return row, jnp.where(later < 0, 0, sample // count)

    def estimate(self, memory, sensed: Sensed) -> Float[Array, " n"]:
        """How far it is from plan or glide, by what is sensed and was estimated, (n,)."""
        k, cycles = self.place(sensed.sample)
        reference = self.linear.states[k].at[YAW].add(self.heading + self.turn * cycles)
        apart = deviation(sensed, reference, self.chosen)
        apart = apart.at[YAW].set(jnp.clip(apart[YAW], -REACH, REACH))
        if self.L is None:
            return apart
        last, _ = self.place(sensed.sample - 1)
        before = sensed.told[np.array(self.chosen)] - self.told[last]
        expected = self.linear.A[last] @ memory + self.linear.B[last] @ before
        expected += jnp.where(sensed.sample == self.launch, self.jump, 0.0)
        seen = apart[SENSED.start :]
        guess = jnp.zeros_like(apart).at[SENSED.start :].set(seen)
        moved = expected + self.L[k] @ (seen - expected[SENSED.start :])
        return jnp.where(sensed.sample == 0, guess, moved)

    def within(self, k, change: Float[Array, " c"]) -> Float[Array, "6"]:
        """Inputs that differ from those of a row by a change (c,), within the limits, (6,)."""
        wanted = jnp.clip(self.told[k] + change, self.low, self.high)
        return self.inputs.at[np.array(self.chosen)].set(wanted)

    def __call__(self, memory, sensed: Sensed):
        k, _ = self.place(sensed.sample)
        apart = self.estimate(memory, sensed)
        return self.within(k, -self.K[k] @ apart), apart


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


DRIFT = 0.01
"""Share of its scale that a state drifts by in an interval, as an observer takes it."""
_SURE = 1e-3  # rad or 1/s; no sense is taken to be better
_FADES = 8.0  # samples over which the first guess of a plan comes to the glide


def _planned(
    environment: Environment, gains: Gains, linear: Linear, turn, cost, samples: int, along
):
    """So many samples from the launch planned, along a flight or to the glide that the gains
    are of; and how far from the glide that ends."""
    plant, chosen, case = environment.plant, environment.chosen, environment.case
    begun = started(case.glider, case.launch)
    held = plant.inputs[np.array(chosen)]
    start = np.asarray(controlled_state(plant.launched(begun.state).state, held, chosen))
    cycle, count = np.asarray(linear.states), len(linear.states)
    numbers = np.arange(samples + 1)
    states = cycle[numbers % count].copy()
    states[:, YAW] += float(turn) * (numbers // count)
    last = states[-1]
    if along is None:
        fade = np.exp(-numbers / _FADES)[:, None]
        inputs = np.tile(np.asarray(held), (samples, 1))
        guess = states + fade * (start - states[0]), inputs
    else:
        guess = states, inputs = tuple(map(np.asarray, along))
    low, high = map(np.asarray, limits(plant.drive, chosen))
    Q, R = cost
    goal = PlanGoal(states, inputs, Q, R, gains.P, low, high)
    plan = plan_launch(start, plant, chosen, goal, guess)
    if not plan.gap < CLOSED:
        where = "to the glide" if along is None else "along the one given"
        raise ValueError(
            f"no flight from this launch {where} was found in {plan.iterations} steps: "
            f"{plan.gap:.2g} of a scale is missed"
        )
    return plan, plan.states[-1] - last


def _checked_path(along: SampledPath, samples: int, shape: tuple[int, ...]) -> int:
    """Samples of a path; `shape` is (n, c)."""
    check_kind("along", along, SampledPath)
    count = len(along.inputs)
    n, c = shape
    check_range("along.states", along.states, "", shape=(count + 1, n))
    check_range("along.inputs", along.inputs, "", shape=(count, c))
    if not count or count % samples:
        raise ValueError(
            f"along has {count} samples: it must be whole cycles of {samples} samples"
        )
    return count


def _observer(environment: Environment, linear: Linear, plan: LaunchPlan | None, unit):
    """Gains of the observer along plan and glide."""
    senses, c = environment.senses, len(environment.chosen)
    sure = np.array([senses.omega_noise] * 3 + [senses.angle_noise] * 3, float)
    sure[3:] = np.hypot(sure[3:], float(senses.resolution) / np.sqrt(12))
    seen = np.concatenate([np.maximum(sure, _SURE), np.full(3 * c, _SURE)]) ** 2
    drift = np.concatenate([np.asarray(unit), [1.0], np.full(3 * c, _SURE)])
    drift = (DRIFT * drift) ** 2
    L = filter_gains(linear, seen, drift)
    if plan is None:
        return L
    return np.concatenate([_filtered(plan.A, np.diag(drift), seen, drift)[0], L])


def linear_quadratic(
    environment: Environment,
    glide: SteadyGlide | None = None,
    *,
    price: float = 1.0,
    heading: float = 0.0,
    launch: int = 0,
    along: SampledPath | None = None,
) -> Regulator:
    """The linear-quadratic regulator of an environment about the steady glide of its gait.

    It weighs a scaled unit of the state as much as half the range of an input. Where the
    environment does not sense velocity, a Kalman filter estimates it. The launch can be
    planned: the inputs that make the same cost least from there on, within their limits, and
    the gains along that flight.

    Args:
        environment: a case and how it is sampled and sensed.
        glide: the steady glide, of the environment's launch phase; by default it is sought.
        price: of the inputs, above 0.
        heading: yaw to fly at [rad].
        launch: cycles over which the launch of the environment's case is planned, 0 to 20;
            with 0 the feedback about the glide acts from the start.
        along: a flight to keep to instead, as `ProgramOptimum.path` gives it; after it the
            glide.

    Raises:
        TypeError: `along` is no path.
        ValueError: there is no steady glide, the inputs cannot stabilise it, no flight leads
            to it, or a number is out of range.
    """
    check_range("price", price, "", 0, 1e6, low_open=True, shape=())
    check_range("heading", heading, "rad", -1e3, 1e3, shape=())
    check_integer("launch", launch, 0, 20)
    plant, chosen = environment.plant, environment.chosen
    if glide is None:
        glide = steady_glide(environment.held, phase=float(plant.flight.phase))
    if not bool(glide.found):
        raise ValueError(f"there is no steady glide to regulate: {glide.why}")
    samples = round(float(glide.period / plant.interval))
    linear = linearised(start_of(glide.state, plant, chosen), plant, chosen, samples)
    unit = scales(environment.held, plant.flight.sections)
    cost = weights(plant, chosen, unit, price)
    gains = riccati(linear, *cost)
    turn = jnp.asarray(glide.turn_rate * glide.period)
    held = jnp.broadcast_to(plant.inputs[np.array(chosen)], (samples, len(chosen)))
    told, K, jump, plan, whole = held, gains.K, jnp.zeros_like(linear.states[0]), None, linear
    planned = launch * samples
    if along is not None:
        if launch:
            raise ValueError("launch and along exclude each other: along plans the launch too")
        planned = _checked_path(along, samples, linear.B.shape[1:])
    if planned:
        plan, missed = _planned(environment, gains, linear, turn, cost, planned, along)
        told, K = jnp.concatenate([plan.inputs, held]), np.concatenate([plan.K, gains.K])
        parts = zip((plan.states[:-1], plan.A, plan.B), linear, strict=True)
        whole, jump = Linear(*map(jnp.concatenate, parts)), jnp.asarray(missed)
    L = None
    if not environment.senses.velocity:
        L = jnp.asarray(_observer(environment, linear, plan, unit))
    return Regulator(
        whole,
        jnp.asarray(K),
        L,
        told,
        jump,
        plant.inputs,
        *limits(plant.drive, chosen),
        turn,
        jnp.asarray(float(heading)),
        chosen,
        planned,
    )
