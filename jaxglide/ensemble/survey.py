"""Wind-tunnel surveys: held glides of many cases, and their moments."""

import math
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from .._lib.checks import check_kind, check_range, warn_float32
from .._lib.defaults import HELD_SPEED, MAX_STEPS, MAX_TIME
from .._lib.units import labelled
from ..flight.ends import default_ends, outcome_words
from ..flight.pool import Program, Task
from ..tunnel.fall import FALLER, landed, read_records, ready
from ..tunnel.loads import MOMENT_PHASES, check_angles, over_phases
from .batch import Fleet, default_width, fly_all, shared, spread, workers
from .records import outcome_flags, stamp, study_coordinates
from .study import Study, nodes_of

ABOUT = ("pitch", "roll", "yaw")
"""Body axes x, y, z by the turn about them."""

# name: (dimensions after the cases', unit, long name)
_VARIABLES = {
    "outcome": ((), "", "how the fall ended"),
    "time": ((), "s", "time at the ground"),
    "landing_point": ((), "m", "forward distance y at the ground"),
    "position": (("record", "forward_up"), "m", "centre of mass y, z"),
    "velocity": (("record", "forward_up"), "m/s", "its velocity over the ground"),
    "last": ((), "", "index of the first record past the ground"),
    "aerodynamic": (("record", "phase", "about"), "N mm", "moment of the air, body axes"),
    "inertial": (("record", "phase", "about"), "N mm", "[h'] of the shape change, body axes"),
    "mean_moment": (("record", "about"), "N mm", "moment of the air, mean over phases"),
    "aerodynamic_range": (("record", "about"), "N mm", "its peak-to-peak over phases"),
    "inertial_range": (("record", "about"), "N mm", "peak-to-peak of [h'] over phases"),
    "inertial_ratio": (("record", "about"), "", "inertial over aerodynamic peak-to-peak"),
}


@lru_cache(maxsize=16)
def _faller(structure, leaves, options, block):
    static, options = jax.tree.unflatten(structure, leaves), dict(options)

    def prepare(values, arrays, angles, rtol, atol) -> Task:
        case = eqx.combine(arrays, static).replace(values)
        given = {"angles": angles, "rtol": rtol, "atol": atol}
        return ready(case.glider, case.launch, **given, **options)

    def conclude(task: Task, solved):
        fallen = landed(task, solved)
        return {
            "outcome": fallen.outcome.astype(jnp.int32),
            "time": fallen.time,
            "landing_point": fallen.state[0],
            "states": fallen.states,
            "last": fallen.last.astype(jnp.int32),
        }

    return Program(FALLER, prepare, conclude, block)


@lru_cache(maxsize=16)
def _reader(structure, leaves, phases, devices):
    static = jax.tree.unflatten(structure, leaves)

    def one(lane, arrays, angles, times):
        glider = eqx.combine(arrays, static).replace(lane["values"]).glider
        read = read_records(glider, angles, times, lane["states"], phases)
        return {"aerodynamic": read.aerodynamic, "inertial": read.inertial}

    return spread(one, devices, 3)


def survey(
    study: Study,
    *,
    phases: int = MOMENT_PHASES,
    interval: float = 0.025,
    max_time: float = 10.0,
    angles=(0.0, 0.0, 0.0),
) -> xr.Dataset:
    """Held glides of all cases of a study, and the moments by phase at every record.

    All cases fall in pools of lanes on all cores, or GPUs, and all are read in one vmapped
    computation.

    Args:
        study: what to drop; tolerances below 1e-6 pay for gradients only. Without a speed
            the cases start at the published 1.7 m/s. Times and limits of its own, or a
            heading, are refused: a survey has no use for them.
        phases: number of phases.
        interval: between records [s].
        max_time: longest fall [s].
        angles: held yaw, pitch, roll [rad], (3,).

    Returns:
        Dataset over the grid's dimensions, or over `case`, and over record (time [s]),
        phase [deg] and the turns pitch, roll, yaw about the body axes; moments in N mm,
        NaN past the ground.

    Raises:
        ValueError: a wrong argument.

    Examples:
        >>> from jaxglide import Study, survey
        >>> data = survey(Study({"d_psi": [0, 10]}, fixed={"height": 2}))
        >>> print(dict(data.sizes))
        {'d_psi': 2, 'record': 30, 'forward_up': 2, 'phase': 60, 'about': 3, 'turn': 3}
    """
    _check_study(study)
    held = check_angles(angles, phases)
    check_range("interval", interval, "s", 1e-4, 10, shape=())
    check_range("max_time", max_time, "s", 0, 1e4 * interval, low_open=True, shape=())
    lanes = study.lanes(np.arange(len(study)))
    base = study.base
    if base.launch.speed is None and "launch.speed" not in map(base.path, lanes):
        base = base.replace({"launch.speed": HELD_SPEED})
    arrays, key = shared(base)
    options = {"interval": float(interval), "max_time": float(max_time)}
    limits = np.asarray(study.rtol), np.asarray(study.atol)
    kept = 6 * (math.ceil(max_time / interval) + 1)
    fleet = Fleet.of(default_width(len(study), lambda: nodes_of(base), kept))
    drop = _faller(*key, tuple(options.items()), fleet.block)
    fallen = fly_all(drop, lanes, fleet, (arrays, held, *limits))
    records = int(fallen["last"].max()) + 1
    states = fallen.pop("states")[:, :records]
    times = interval * np.arange(records)
    look = _reader(*key, phases, workers())
    read = look({"values": lanes, "states": states}, len(study), arrays, held, times)
    aerodynamic, inertial = 1e3 * read["aerodynamic"], 1e3 * read["inertial"]
    of_air, of_shape = (over_phases(jnp.asarray(m)) for m in (aerodynamic, inertial))
    values = {
        **fallen,
        "position": states[..., :2],
        "velocity": states[..., 2:],
        "aerodynamic": aerodynamic,
        "inertial": inertial,
        "mean_moment": of_air.mean,
        "aerodynamic_range": of_air.peak_to_peak,
        "inertial_range": of_shape.peak_to_peak,
        "inertial_ratio": of_shape.peak_to_peak / of_air.peak_to_peak,
    }
    return _dataset(study, values, times, phases, options | {"angles": held})


def _check_study(study: Study) -> None:
    """Refuse what a held glide has no use for; say where float32 is too coarse."""
    check_kind("study", study, Study)
    for name, default in (("times", None), ("max_time", MAX_TIME), ("max_steps", MAX_STEPS)):
        if getattr(study, name) != default:
            raise ValueError(
                f"{name} of the study has no effect on a survey: leave it out; `survey` takes "
                "how long to fall and how often to record as max_time and interval"
            )
    for name in (*study.varied, *study.fixed):
        path = study.case.path(name)
        if path == "launch.heading":
            raise ValueError("heading has no effect on a survey: a held glide stays in a plane")
        if path.startswith(("ends[", "launch.angles", "launch.omega", "launch.phi_theta")):
            raise ValueError(f"{name} has no effect on a survey: a held glide does not turn")
    if not eqx.tree_equal(study.case.ends, default_ends()):
        raise ValueError("ends have no effect on a survey: it ends at the ground")
    warn_float32(study.rtol, study.atol)


def _dataset(study: Study, values, times, phases, options) -> xr.Dataset:
    dims = study.dims
    coordinates = {
        "record": ("record", times, labelled("s", "time since launch")),
        "phase": ("phase", 360.0 / phases * np.arange(phases), labelled("deg", "phase")),
        "about": list(ABOUT),
        "forward_up": ["y", "z"],
    }
    coordinates |= study_coordinates(study) | {
        "turn": ["yaw", "pitch", "roll"],
        "held_angles": (
            "turn",
            np.rad2deg(np.asarray(options["angles"])),
            labelled("deg", "held yaw, pitch, roll"),
        ),
        "interval": ((), options["interval"], labelled("s", "between records")),
        "max_time": ((), options["max_time"], labelled("s", "longest fall")),
    }
    variables = {}
    for name, (trailing, unit, long_name) in _VARIABLES.items():
        value = np.asarray(values[name])
        shaped = value.reshape(*study.shape, *value.shape[1:])
        variables[name] = ((*dims, *trailing), shaped, labelled(unit, long_name))
    variables["outcome"][2].update(outcome_flags(outcome_words(())))
    record = {"study": study.to_json(), **study.setup}
    record |= {"rtol": study.rtol, "atol": study.atol}
    return stamp(xr.Dataset(variables, coords=coordinates), record, "held glides")
