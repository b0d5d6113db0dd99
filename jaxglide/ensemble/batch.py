"""The flights of a study in pools of lanes, one a core or a GPU."""

import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from functools import lru_cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._lib.cores import cores
from .._lib.types import Array
from ..flight.glide import PILOT, Glide, landed, ready
from ..flight.pool import Program, Task, Turn
from .study import Study, nodes_of

_LANES = 24  # most per core: more cost no less a step, and the last flights wait longer
_FLIGHTS = 5  # that a lane has one after the other, where there are as many
# Lanes are a multiple of this. Loops over other numbers end in a remainder that the compiler
# may round otherwise: a glide's last bits would depend on its neighbours.
_UNIT = 8
_BLOCK = 16  # cases made ready, and concluded, at a time on a CPU
_QUEUE = 4  # cases handed over at a time, for each lane
_MAX_LANES = 65_536  # per GPU
_LIVE = 60  # arrays of the body's size alive at once in the vector field, at most


def results(glide: Glide) -> dict[str, Array]:
    """What a sweep keeps of every glide, in SI units and radians, by name."""
    kept = {
        "outcome": glide.outcome,
        "time": glide.time,
        "landing_point": glide.landing_point,
        "path_length": glide.path_length,
        "height_lost": glide.height_lost,
        "glide_angle": glide.glide_angle,
        "velocity": glide.velocity,
        "end_angles": glide.end_angles,
        "max_angles": glide.max_angles,
        "launch_phase": glide.take_off.phi_theta,
        "launch_angles": glide.take_off.angles,
        "launch_speed": glide.take_off.speed,
        "accepted": glide.accepted.astype(jnp.int32),
        "rejected": glide.rejected.astype(jnp.int32),
    }
    if glide.states is not None:
        kept["states"] = glide.states
    return kept


def workers() -> tuple:
    """Devices that fly at the same time, a thread each: the GPUs, or the CPU once a core."""
    devices = tuple(jax.local_devices())
    if devices[0].platform != "cpu" or len(devices) > 1:
        return devices
    return devices * cores()


def on_workers(function: Callable, items: Iterable) -> list:
    """A function's values of all items, in order, a thread a core or GPU."""
    devices, x64 = workers(), jax.config.jax_enable_x64  # type: ignore[attr-defined]

    def one(numbered):
        k, item = numbered
        several = len(set(devices)) > 1
        here = jax.default_device(devices[k % len(devices)]) if several else nullcontext()
        with jax.enable_x64(x64), here:
            return function(item)

    with ThreadPoolExecutor(len(devices)) as threads:
        return list(threads.map(one, enumerate(items)))


class Supply:
    """Cases that are handed out to threads: many at first, few in the end.

    Args:
        count: how many.
        threads: to how many threads.
        least, most: fewest and most cases at a time.
    """

    def __init__(self, count: int, threads: int, least: int, most: int):
        self._count, self._given, self._lock = count, 0, threading.Lock()
        self._threads, self._least, self._most = threads, least, most

    def take(self) -> tuple[np.ndarray, bool]:
        """The next cases, and whether there are none after them."""
        with self._lock:
            left = self._count - self._given
            fair = -(-left // (2 * self._threads))
            count = min(left, self._most, max(self._least, fair))
            self._given += count
            return np.arange(self._given - count, self._given), self._given == self._count


def _at(tree, places) -> Any:
    return jax.tree.map(lambda x: x[places], tree)


class Fleet(NamedTuple):
    """How many fly at once, and where.

    Attributes:
        devices: one a thread and pool.
        lanes: of each pool.
    """

    devices: tuple
    lanes: int

    @classmethod
    def of(cls, width: int) -> "Fleet":
        """Pools of so many lanes together, or a few more."""
        devices = workers()
        return cls(devices, _rounded(-(-width // len(devices))))

    @property
    def block(self) -> int:
        """Cases that a program makes ready, and concludes, at a time."""
        return _BLOCK if self.devices[0].platform == "cpu" else self.lanes


def fly(
    program: Program, values: Any, fleet: Fleet, shared=()
) -> Iterator[tuple[np.ndarray, Any, Turn]]:
    """Fly cases in a pool on each device, and yield what has ended as it comes.

    Args:
        program: of the pools.
        values: of all N cases, a tree of arrays (N, ...).
        fleet: the pools.
        shared: what all cases share, trees of arrays.

    Yields:
        Numbers of cases, (n,), their results, a tree of arrays (n, ...), and the turn they
        came with.
    """
    devices, lanes = fleet
    count, room = len(jax.tree.leaves(values)[0]), _QUEUE * lanes
    supply = Supply(count, len(devices), program.block, room)
    told: queue.SimpleQueue = queue.SimpleQueue()
    stop, x64 = threading.Event(), jax.config.jax_enable_x64  # type: ignore[attr-defined]

    one = _at(values, 0)

    def queued(cases, given, device):
        """Cases made ready block by block, and filled up: one program serves any number."""
        blocks = []
        for k in range(0, max(len(cases), 1), program.block):
            places = np.resize(cases[k : k + program.block], program.block)
            blocks.append(program.prepared(jax.device_put(_at(values, places), device), *given))
        joined = jax.tree.map(lambda *parts: np.concatenate(parts), *blocks)
        return jax.tree.map(lambda x: np.resize(x, (room, *x.shape[1:])), joined)

    def turns(device) -> None:
        given = jax.device_put(shared, device)
        pool, last = program.empty(jax.device_put(one, device), *given, lanes=lanes), False
        pool = jax.device_put(pool, device)  # kept there as a turn's: else it compiles twice
        waiting = None
        while not (last or stop.is_set()):
            cases, last = supply.take()
            if waiting is None or len(cases):
                waiting = queued(cases, given, device)
            numbers = np.resize(cases, room).astype(np.int32)
            batch = numbers, waiting, one, np.int32(len(cases)), np.asarray(last)
            batch = jax.device_put(batch, device)
            pool, turn = program.turn(pool, *batch, *given)
            told.put(jax.tree.map(np.asarray, turn))

    def work(device) -> None:
        try:
            with jax.enable_x64(x64):
                turns(device)
            told.put(None)
        except BaseException as error:
            told.put(error)

    with ThreadPoolExecutor(len(devices)) as threads:
        for device in devices:
            threads.submit(work, device)
        try:
            working = len(devices)
            while working:
                turn = told.get()
                if isinstance(turn, BaseException):
                    raise turn
                working -= turn is None
                if turn is not None and turn.found:
                    ended = _at((turn.case, turn.results), slice(int(turn.found)))
                    yield *ended, turn
        finally:
            stop.set()


def together(parts: Iterable[tuple[np.ndarray, Any]]) -> Any:
    """Results of all cases in their order, (N, ...), from those of some and their places."""
    places, found = zip(*parts, strict=True)
    back = np.argsort(np.concatenate(places))
    return jax.tree.map(lambda *each: np.concatenate(each)[back], *found)


def fly_all(program: Program, values: Any, fleet: Fleet, shared=()) -> Any:
    """Results of cases flown in pools, a tree of arrays (N, ...), in their order; see `fly`."""
    return together((cases, found) for cases, found, _ in fly(program, values, fleet, shared))


@lru_cache(maxsize=16)
def _program(structure, leaves: tuple, max_steps: int, block: int) -> Program:
    static = jax.tree.unflatten(structure, leaves)

    def prepare(values, arrays, times, rtol, atol, max_time) -> Task:
        case = eqx.combine(arrays, static).replace(values)
        return ready(
            case.glider,
            case.launch,
            ends=case.ends,
            rtol=rtol,
            atol=atol,
            times=times,
            max_time=max_time,
            max_steps=max_steps,
        )

    def conclude(task: Task, solved) -> dict[str, Array]:
        return results(landed(task, solved))

    return Program(PILOT, prepare, conclude, block)


def spread(one: Callable, devices: tuple, common: int):
    """Compiled function of a batch whose lanes are shared out over the `workers`.

    Every thread runs the same program by itself: divided among several, XLA would put
    together otherwise what it computes, and round otherwise.

    Args:
        one: pure function of one case (a dict of arrays) and of what all cases share, trees
            of arrays, which get no dimension for the lanes.
        devices: the workers.
        common: number of shared arguments.
    """
    jitted = jax.jit(jax.vmap(one, in_axes=(0,) + (None,) * common))
    every, compiling = len(devices), threading.Lock()

    @lru_cache(maxsize=32)
    def compiled(device, structure, shapes, x64):  # once, for all threads of a device
        arguments = jax.tree.unflatten(structure, [jax.ShapeDtypeStruct(*s) for s in shapes])
        with jax.enable_x64(x64), jax.default_device(device):
            return jitted.lower(*arguments).compile()

    def run(columns: Mapping[str, Any], width: int, *shared) -> dict[str, np.ndarray]:
        count = len(jax.tree.leaves(columns)[0])
        lanes = -(-width // every) * every
        x64 = jax.config.jax_enable_x64  # type: ignore[attr-defined]

        def fly(k: int) -> dict[str, np.ndarray]:
            # Filled up with repeats, so that one compiled function serves every batch.
            # Neighbours go to different devices: each gets as many long flights as the others.
            source = np.minimum(np.arange(k, lanes, every), count - 1)
            batch = jax.tree.map(lambda v: v[source], dict(columns))
            with jax.enable_x64(x64):
                arguments = jax.device_put((batch, *shared), devices[k])
                leaves, structure = jax.tree.flatten(arguments)
                shapes = tuple((leaf.shape, leaf.dtype) for leaf in leaves)
                with compiling:
                    program = compiled(devices[k], structure, shapes, x64)
                flown = program(*arguments)
                return {name: np.asarray(values) for name, values in flown.items()}

        if every == 1:
            parts = [fly(0)]
        else:
            with ThreadPoolExecutor(every) as pool:  # which compile at once, and wait at once
                parts = list(pool.map(fly, range(every)))
        together = {n: np.stack([part[n] for part in parts], axis=1) for n in parts[0]}
        return {n: v.reshape(lanes, *v.shape[2:])[:count] for n, v in together.items()}

    return run


def shared(part: Any) -> tuple[Any, tuple]:
    """The arrays of what all lanes share, a case for one, and what a compiled function is
    kept by: the rest of it."""
    arrays, static = eqx.partition(part, eqx.is_array)
    leaves, structure = jax.tree.flatten(static)
    # of no device: they go to whatever devices the lanes are on
    return jax.tree.map(np.asarray, arrays), (structure, tuple(leaves))


def default_width(count: int, nodes: Callable[[], int], kept: int = 0, size: int = 1) -> int:
    """Lanes of all pools together: by cache on CPU cores, by memory on GPUs.

    Args:
        count: of cases.
        nodes: gives those of the body, which only GPUs ask for.
        kept: numbers kept of each flight's states.
        size: of a lane, in flights: more than one with rates.
    """
    devices = workers()
    each = -(-count // len(devices))
    if devices[0].platform == "cpu":
        most, each = _LANES // size, each // _FLIGHTS
    else:
        memory = (devices[0].memory_stats() or {}).get("bytes_limit", 8 * 2**30)
        per_lane = 8 * size * (_LIVE * nodes() + (_QUEUE + 3) * (20 * 13 + kept))
        most = int(min(_MAX_LANES, 0.5 * memory / per_lane)) // _UNIT * _UNIT
    return len(devices) * max(_UNIT, min(most, _rounded(each)))


def width_of(study: Study) -> int:
    """`default_width` of a study."""
    states = study.state_size * len(study.times or ())
    return default_width(len(study), lambda: nodes_of(study.base), states)


def _rounded(lanes: int) -> int:
    return -(-lanes // _UNIT) * _UNIT


def flown(
    study: Study, index: np.ndarray, width: int
) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Fly some cases of a study, and yield what has ended as it comes.

    Args:
        study: the study.
        index: case numbers, (n,), those expected to take long last.
        width: lanes of all pools together.

    Yields:
        Places in `index`, and what `results` keeps of the cases there: to the bit the same
        whatever the pools and the neighbours.
    """
    fleet = Fleet.of(width)
    arrays, key = shared(study.base)
    times = None if study.times is None else np.asarray(study.times, float)
    limits = (np.asarray(getattr(study, name)) for name in ("rtol", "atol", "max_time"))
    program = _program(*key, study.max_steps, fleet.block)
    last = len(index) - 1
    # the long ones first: what flies last is soon over
    values = study.lanes(index[::-1])
    for cases, found, _ in fly(program, values, fleet, (arrays, times, *limits)):
        yield last - cases, found


def solve(study: Study, index: np.ndarray, width: int) -> dict[str, np.ndarray]:
    """What `flown` gives, of all cases together, in the order of `index`, by name."""
    return together(flown(study, index, width))
