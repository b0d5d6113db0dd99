"""The vector field in C (`kernel.c`), compiled on the spot: the limit to measure against.

Published gait, nodes and polar, still air. Without a C compiler there is none (`available`).
"""

import ctypes
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from jaxglide import discretise
from jaxglide.shape.motion import in_neck

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
FLAGS = ("-O3", "-march=native", "-ffast-math", "-fopenmp-simd")
NODES, CELLS = 70, 72 * 6 * 8
SCALARS = (
    *("theta_m", "psi_m", "nu", "rate", "d_psi", "d_theta", "phase"),
    *("mass_total", "gravity", "density", "viscosity", "step"),
)
ROWS = ("ramp", "x", "mass", "share", "chord", "area")


class Model(ctypes.Structure):
    """`Model` of kernel.c."""

    _fields_ = (
        [(name, ctypes.c_double) for name in SCALARS]
        + [(name, ctypes.c_double * NODES) for name in ROWS]
        + [("cells", ctypes.c_double * CELLS)]
    )


def available() -> bool:
    """Whether there is a compiler."""
    return COMPILER is not None


@cache
def _library() -> ctypes.CDLL:
    folder = Path(tempfile.mkdtemp())
    source = Path(__file__).with_name("kernel.c")
    target = folder / "kernel.so"
    command = [str(COMPILER), *FLAGS, "-shared", "-fPIC", str(source), "-o", str(target), "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(target))


def model(glider: Any, phase: float) -> Model:
    """What the kernel needs of a `Glider` with the published nodes and polar."""
    sections, gait, polar = discretise(glider.body), glider.gait, glider.aerodynamics.polar
    x, ramp = in_neck(sections.fraction, sections.neck_fraction)
    mass = np.asarray(sections.mass)
    scalars = {
        "theta_m": gait.theta_m,
        "psi_m": gait.psi_m,
        "nu": gait.nu_theta,
        "rate": -2 * np.pi * gait.f_theta,
        "d_psi": gait.d_psi,
        "d_theta": gait.d_theta,
        "phase": phase,
        "mass_total": sections.total_mass,
        "gravity": glider.gravity,
        "density": glider.air.air_density,
        "viscosity": glider.air.kinematic_viscosity,
        "step": sections.length / NODES,
    }
    rows = {
        "ramp": ramp,
        "x": x,
        "mass": mass,
        "share": mass / mass.sum(),
        "chord": sections.chord,
        "area": sections.area,
    }
    made = Model(**{name: float(value) for name, value in scalars.items()})
    for name, row in rows.items():
        getattr(made, name)[:] = np.asarray(row).tolist()
    made.cells[:] = np.asarray(polar.cells).ravel().tolist()
    return made


def rates(time: float, state: np.ndarray, of: Model) -> np.ndarray:
    """Rate of one state, (13,)."""
    state, rate = np.ascontiguousarray(state, float), np.empty(13)
    pointer = ctypes.POINTER(ctypes.c_double)
    _library().vector_field(
        ctypes.c_double(time),
        state.ctypes.data_as(pointer),
        ctypes.byref(of),
        rate.ctypes.data_as(pointer),
    )
    return rate


def evaluate(states: np.ndarray, models, count: int) -> np.ndarray:
    """States after `count` evaluations each, as `vector_field.py` makes them."""
    states = np.array(states, float, order="C").reshape(-1, 13)
    pointer = states.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
    _library().evaluate(pointer, models, len(states), count)
    return states
