"""Laws made better by gradients through the flight, over random flights.

Many flights go on side by side. An update takes a window of samples of each, the gradient of
what they cost in it by what the law has to learn, and a step of Adam. A flight goes on into the
next window, without a gradient through what was before, or begins anew where it is over.
"""

import dataclasses
import hashlib
import io
import json
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax

from .._lib.checks import check_integer, check_kind, check_range
from .._lib.cores import in_threads
from .._lib.fingerprint import fingerprint
from .._lib.progress import progress_bar
from .._lib.types import Array, Float, Integer, Scalar, State
from .._lib.writing import alone, write_bytes
from ..flight.dynamics import ANGLES
from .environment import Environment, Situation
from .plant import Flying
from .policy import AbstractPolicy, Sensed

WINDOW = 16
"""Samples through which gradients go back, by default: two cycles."""
STEEP = 0.75
"""Pitch up to which a flight counts as upright [rad]."""
_GROUP = 32  # flights of one computation, at most: more fit no core's cache
_KEPT = 20  # updates between two that a log keeps
_LOG = "jaxglide log of a training, 1"


def upright(state: State) -> Scalar:
    """Squares of yaw and roll, and four times that of the pitch beyond 0.75 rad."""
    yaw, pitch, roll = state[ANGLES]
    steep = jnp.maximum(jnp.abs(pitch) - STEEP, 0.0)
    return yaw**2 + roll**2 + 4 * steep**2


class Course(NamedTuple):
    """A flight that is flown window by window.

    Attributes:
        origin: key from which it was drawn, (2,).
        flying, told, key: as in `Situation`.
        sensed: at the sample.
        memory: of the policy.
        limit: sample at which it is cut off.
    """

    origin: Array
    flying: Flying
    told: Float[Array, "6"]
    key: Array
    sensed: Sensed
    memory: Any
    limit: Integer


class Trained(NamedTuple):
    """A policy, and how it came about.

    Attributes:
        policy: the law that was trained.
        losses: mean cost of a sample in every update, (U,).
        landed: share of the flights that ended in an update which landed; NaN where none
            ended, (U,).
    """

    policy: Any
    losses: np.ndarray
    landed: np.ndarray


class Terms(NamedTuple):
    """What a window needs to know; see `train_policy`."""

    window: int
    samples: int
    cost: Callable[[State], Scalar]
    value: Callable[[State], Scalar] | None


def launched(policy, environment: Environment, origin, limit) -> Course:
    """A flight at its launch, drawn from a key (2,)."""
    situation, sensed = environment.reset(origin)
    flying, told, key = situation.flying, situation.told, situation.key
    return Course(origin, flying, told, key, sensed, policy.start(), limit)


def window_loss(policy, environment: Environment, course: Course, terms: Terms):
    """Mean cost of a window's samples, and what comes after it.

    Of a flight that ended otherwise than by landing the last state counts on; the value is
    what the samples after the window would cost.

    Returns:
        loss, and the course later, whether it is over, whether it has landed.
    """
    drawn, _ = environment.reset(course.origin)
    sample = course.sensed.sample
    situation = Situation(drawn.plant, course.flying, sample, course.told, course.key)

    @jax.checkpoint
    def on(carry, _):
        situation, sensed, memory = carry
        inputs, memory = policy(memory, sensed)
        moved = environment.step(situation, inputs)
        cost = jnp.where(moved.landed, 0.0, terms.cost(moved.situation.flying.state))
        return (moved.situation, moved.sensed, memory), (cost, moved.landed)

    carry = situation, course.sensed, course.memory
    carry, (costs, landed) = jax.lax.scan(on, carry, length=terms.window)
    situation, sensed, memory = carry
    flying, total = situation.flying, jnp.sum(costs)
    if terms.value is not None:
        total += jnp.where(flying.over, 0.0, terms.value(flying.state))
    later = course._replace(
        flying=flying, told=situation.told, key=situation.key, sensed=sensed, memory=memory
    )
    return total / terms.window, (later, flying.over, landed[-1])


def _renewed(policy, environment, course: Course, over, samples: int) -> Course:
    """The course, or another flight where it is over or long enough."""
    origin = jax.random.fold_in(course.origin, 1)
    fresh = launched(policy, environment, origin, jnp.full_like(course.limit, samples))
    anew = over | (course.sensed.sample >= course.limit)
    return jax.tree.map(lambda new, old: jnp.where(anew, new, old), fresh, course)


def parts_of(policy) -> tuple[Any, Any]:
    """What a policy learns, and the rest."""
    learns = [getattr(policy, name) for name in policy.learns]
    nothing = jax.tree.map(lambda _: False, policy)
    if not jax.tree.leaves(learns):
        raise ValueError(f"{type(policy).__name__} has nothing to learn")

    def fields(tree):
        return [
            getattr(tree, name) for name in policy.learns if getattr(policy, name) is not None
        ]

    free = eqx.tree_at(
        fields, nothing, replace_fn=lambda part: jax.tree.map(lambda _: True, part)
    )
    arrays = jax.tree.map(lambda x, yes: yes and eqx.is_inexact_array(x), policy, free)
    return eqx.partition(policy, arrays)


class _Run(NamedTuple):
    """Where a training is.

    Attributes:
        learned: what the policy learns.
        state: of the optimiser.
        courses: flights of all groups, (G, F, ...).
        losses, landed: so far, (U,).
    """

    learned: Any
    state: Any
    courses: Any
    losses: Float[Array, " U"]
    landed: Float[Array, " U"]


class _Log:
    """A training kept as it was, in a file: a line that says which, and its numbers.

    Args:
        path: the file; None keeps nothing.
        asked: digest of what is trained and how.

    Raises:
        ValueError: it is the log of something else.
    """

    def __init__(self, path: str | Path | None, asked: str):
        self.path = None if path is None else Path(path)
        self.asked = asked

    def recall(self, template: _Run) -> tuple[int, _Run]:
        """Updates done, and the run there; `template` where there is no file."""
        if self.path is None or not self.path.exists():
            return 0, template
        head, _, body = self.path.read_bytes().partition(b"\n")
        try:
            known = json.loads(head)
            kind, asked, done = known["kind"], known["asked"], known["done"]
        except (ValueError, KeyError, TypeError):
            known, kind, asked, done = {}, None, None, 0
        if kind != _LOG:
            raise ValueError(f"{self.path} is not the log of a training")
        if asked != self.asked:
            raise ValueError(f"{self.path} is the log of another training")
        if hashlib.sha256(body).hexdigest() != known.get("digest"):
            raise ValueError(f"{self.path} is damaged: remove it to begin anew")
        return int(done), eqx.tree_deserialise_leaves(io.BytesIO(body), template)

    def keep(self, done: int, run: _Run) -> None:
        """Put the run in the place of the one before."""
        if self.path is None:
            return
        body = io.BytesIO()
        eqx.tree_serialise_leaves(body, run)
        digest = hashlib.sha256(body.getvalue()).hexdigest()
        head = {"kind": _LOG, "asked": self.asked, "done": done, "digest": digest}
        write_bytes(self.path, json.dumps(head).encode() + b"\n" + body.getvalue())


def _digest(*trees) -> str:
    """A digest of trees: of their arrays and their structure."""
    digest = hashlib.sha256()
    for tree in trees:
        arrays, rest = eqx.partition(tree, eqx.is_array)
        digest.update(str(jax.tree.structure(arrays)).encode())
        digest.update(str([x for x in jax.tree.leaves(rest) if not callable(x)]).encode())
        for array in jax.tree.leaves(arrays):
            digest.update(np.asarray(array).tobytes())
    return digest.hexdigest()[:32]


def _groups(flights: int) -> int:
    """Groups of equal size, at most `_GROUP`."""
    return next(k for k in range(-(-flights // _GROUP), flights + 1) if flights % k == 0)


@eqx.filter_jit
def begin(policy, environment: Environment, keys, limits) -> Course:
    """A group of flights at their launches, from keys (F, 2) and limits (F,)."""
    return jax.vmap(lambda key, limit: launched(policy, environment, key, limit))(keys, limits)


@eqx.filter_jit
def fly(learned, fixed, environment: Environment, courses: Course, terms: Terms):
    """A window of a group of F flights.

    Returns:
        losses (F,), their gradients (F, ...), the flights later, how many ended and landed.
    """

    def one(course):
        def loss(learned):
            policy = eqx.combine(learned, fixed)
            return window_loss(policy, environment, course, terms)

        (value, (later, over, landed)), slopes = jax.value_and_grad(loss, has_aux=True)(learned)
        policy = eqx.combine(learned, fixed)
        renewed = _renewed(policy, environment, later, over, terms.samples)
        return value, slopes, renewed, over, landed

    values, slopes, renewed, over, landed = jax.vmap(one)(courses)
    return values, slopes, renewed, jnp.sum(over), jnp.sum(landed)


@eqx.filter_jit
def _updated(learned, state, slopes, optimiser):
    """What is learnt, and the optimiser's state, after the gradients of all groups.

    Few flights, about to tumble, have gradients a thousand times those of the others: none
    counts for more than the median.
    """
    slopes = jax.tree.map(lambda *each: jnp.concatenate(each), *slopes)
    squares = [jnp.sum(g**2, range(1, g.ndim)) for g in jax.tree.leaves(slopes)]
    sizes = jnp.sqrt(sum(squares))
    good = jnp.isfinite(sizes) & (sizes > 0)
    usual = jnp.nanmedian(jnp.where(good, sizes, jnp.nan))
    share = jnp.where(good, jnp.minimum(1.0, usual / sizes), 0.0) / len(sizes)

    def mean(slope):
        weight = share.reshape(-1, *[1] * (slope.ndim - 1))
        return jnp.sum(jnp.where(weight > 0, weight * slope, 0.0), axis=0)

    changes, state = optimiser.update(jax.tree.map(mean, slopes), state, learned)
    return optax.apply_updates(learned, changes), state


def train_policy(
    policy: AbstractPolicy,
    environment: Environment,
    *,
    updates: int = 100,
    flights: int = 32,
    window: int = WINDOW,
    samples: int = 120,
    rate: float = 3e-4,
    seed: int = 0,
    cost: Callable[[State], Scalar] = upright,
    value: Callable[[State], Scalar] | None = None,
    log: str | Path | None = None,
    progress: bool | None = None,
) -> Trained:
    """Make a law better by gradients through random flights of an environment.

    Args:
        policy: where it starts; what its class `learns` is changed.
        environment: what is flown; its `vary` says what is random.
        updates: steps of Adam, whose rate falls to none in the end, 1 to 1,000,000.
        flights: side by side, 1 to 100,000.
        window: samples of each in an update, through which gradients go back.
        samples: after which a flight begins anew; with `window` as large, whole flights.
        rate: of learning, above 0.
        seed: of the flights.
        cost: of a sample, of the state of flight (s,); by default how far from upright.
        value: what a state at the end of a window will cost yet, in units of `cost`.
        log: file that keeps the training, so that a killed one goes on where it was.
        progress: show a bar.

    Returns:
        The law after the last update, and how it came about.

    Raises:
        TypeError: a part is of another type.
        ValueError: a number out of range, nothing to learn, or another training's log.
        OSError: the log cannot be read or written.
    """
    check_kind("policy", policy, AbstractPolicy)
    check_kind("environment", environment, Environment)
    check_integer("updates", updates, 1, 1_000_000)
    check_integer("flights", flights, 1, 100_000)
    check_integer("samples", samples, 1, 100_000)
    check_integer("window", window, 1, samples)
    check_range("rate", rate, "", 0, 10, low_open=True, shape=())
    learned, fixed = parts_of(policy)
    backward = dataclasses.replace(environment.plant, backward=True)
    environment = eqx.tree_at(lambda e: e.plant, environment, backward)
    terms = Terms(window, samples, cost, value)
    optimiser = optax.adam(optax.cosine_decay_schedule(rate, updates))
    groups = _groups(flights)
    keys = jax.random.split(jax.random.PRNGKey(seed), flights).reshape(groups, -1, 2)
    # the first flights end early, each at another sample: windows at all times then mix
    cuts = np.random.default_rng(seed).integers(1, samples // window + 1, keys.shape[:2])
    limits = jnp.asarray(np.minimum(window * cuts, samples), jnp.int32)
    none = jnp.full(updates, jnp.nan)
    courses = [begin(policy, environment, *group) for group in zip(keys, limits, strict=True)]
    run = _Run(learned, optimiser.init(learned), courses, none, none)
    state = courses[0].flying.state[0]
    judged = [None if judge is None else fingerprint(judge, state) for judge in (cost, value)]
    asked = _digest(policy, environment), updates, flights, window, samples, rate, seed, judged
    told = fixed, environment, terms, optimiser
    with nullcontext() if log is None else alone(log):
        kept = _Log(log, _digest(asked))
        done, run = kept.recall(run)
        with progress_bar(updates, "update", progress, done) as bar:
            for k in range(done, updates):
                run = _advanced(run, k, *told, first=k == done)
                bar.update(1)
                if k % _KEPT == _KEPT - 1 or k == updates - 1:
                    kept.keep(k + 1, run)
    found = eqx.combine(run.learned, fixed)
    return Trained(found, np.asarray(run.losses), np.asarray(run.landed))


def _advanced(run: _Run, k: int, fixed, environment, terms, optimiser, first: bool) -> _Run:
    """A run after its update k."""
    parts = in_threads(
        lambda courses: fly(run.learned, fixed, environment, courses, terms),
        run.courses,
        first=first,
    )
    values, slopes, courses, over, landed = zip(*parts, strict=True)
    learned, state = _updated(run.learned, run.state, slopes, optimiser)
    ended = float(np.sum(over))
    share = float(np.sum(landed)) / ended if ended else np.nan
    losses, shares = run.losses.at[k].set(np.mean(values)), run.landed.at[k].set(share)
    return _Run(learned, state, list(courses), losses, shares)
