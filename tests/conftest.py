"""What the tests share: float64, the golden figures, and the gliders they belong to."""

import atexit
import contextlib
import importlib.util
import json
import os
import resource
import shutil
import tempfile
from pathlib import Path

if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
    # One cache for all processes of a test run: many compile the same functions.
    _cache = tempfile.mkdtemp(prefix="jaxglide-tests-")
    atexit.register(shutil.rmtree, _cache, ignore_errors=True)
    os.environ["JAX_COMPILATION_CACHE_DIR"] = _cache
    os.environ["JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"] = "0.5"
    os.environ["TF_CPP_MIN_LOG_LEVEL"] = "3"  # loading from it logs tuning hints as errors

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import install_import_hook

from places import GOLDEN, ROOT

jax.config.update("jax_enable_x64", True)

MAPPED = 30_000
"""Mappings of memory from which on a process gives up its compiled programs."""

# The rooms whose annotations are checked: those of the model and what is built on it.
ROOMS = "body shape air loads flight tunnel steady ensemble search flights view"
install_import_hook([f"jaxglide.{room}" for room in ROOMS.split()], "shapes.checked")

import jaxglide as jg  # noqa: E402


def pytest_configure(config):
    """Compiling takes most of the time: without XLA's fusion emitters it takes half of that.

    What takes long to run keeps them, and so do the processes of the smoke set.
    """
    if "not slow" in config.option.markexpr:
        flags = os.environ.get("XLA_FLAGS", "").split()
        flags.append("--xla_cpu_use_fusion_emitters=false")
        os.environ["XLA_FLAGS"] = " ".join(dict.fromkeys(flags))


def load_golden(name):
    """Entries of `tests/golden/<name>.json`."""
    return json.loads((GOLDEN / f"{name}.json").read_text())


def published_glider(entry):
    """The glider of a golden entry: 70 midpoint nodes and the published polar."""
    gait = jg.Gait.from_degrees(
        theta_m=entry["theta_m_deg"],
        psi_m=entry["psi_m_deg"],
        d_psi=entry["d_psi_deg"],
        nu_theta=entry["nu_theta"],
        f_theta=entry["f_theta"],
    )
    snake = jg.Snake.from_svl(
        entry["svl"], mass=entry.get("mass"), neck_fraction=entry["neck_fraction"]
    )
    scales = entry.get("lift_scale", 1.0), entry.get("drag_scale", 1.0)
    return jg.Glider(snake, gait, jg.Polar.published(*scales))


def norm_error(value, expected):
    """Error of a vector relative to its norm."""
    expected = np.asarray(expected)
    return np.linalg.norm(np.asarray(value) - expected) / np.linalg.norm(expected)


@pytest.fixture(autouse=True, scope="module")
def _few_programs():
    """Compiled programs are given up before they are too many.

    Each takes mappings of memory, of which Linux allows a process 65,530; at that many the
    compiler dies.
    """
    yield
    mapped = Path("/proc/self/maps")
    if mapped.exists() and mapped.read_bytes().count(b"\n") > MAPPED:
        jax.clear_caches()


@pytest.fixture(autouse=True)
def _keep_jax_settings(monkeypatch):
    """The tests set up JAX themselves; the command line need not."""
    monkeypatch.setattr("jaxglide.cli.configure", lambda: None)


@contextlib.contextmanager
def file_size_limit(size):
    """Stands in for a full disk: no file may grow beyond `size` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture(scope="session")
def disk_of():
    return file_size_limit


@pytest.fixture(scope="session")
def golden():
    return load_golden


@pytest.fixture(scope="session")
def glider_of():
    return published_glider


@pytest.fixture(scope="session")
def relative_error():
    return norm_error


@pytest.fixture(scope="session")
def peer():
    """The same model in plain NumPy, written independently: `benchmarks/numpy_peer.py`."""
    path = ROOT / "benchmarks" / "numpy_peer.py"
    spec = importlib.util.spec_from_file_location("numpy_peer", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def flight():
    """The published gait on 70 nodes, at its launch phase, as the vector field takes it."""
    glider = jg.Glider(jg.Snake.from_svl(), jg.Gait.from_degrees())
    return jg.Flight(glider, jax.jit(jg.discretise)(glider.body), jnp.asarray(-0.02781640625))


@pytest.fixture(scope="session")
def fixed_launch():
    """The published launch with nothing left to compute: the same for every node set."""
    angles = np.deg2rad([-0.22388, -4.55923, -4.52628])
    return jg.Launch(height=10.0, speed=1.7534, phi_theta=-0.027816, angles=angles)


@pytest.fixture(scope="session")
def smooth_glider():
    """The published gait on 60 Gauss nodes with the smooth polar."""
    snake = jg.Snake.from_svl(nodes=60, node_set="gauss")
    return jg.Glider(snake, jg.Gait.from_degrees(), jg.Polar.smooth())


@pytest.fixture(scope="session")
def random_states():
    """Function of (count, seed): times (count,) and states (count, 13) of lively flight."""

    def draw(count, seed=0):
        rng = np.random.default_rng(seed)
        states = np.concatenate(
            [
                np.array([0, 0, 10]) + rng.normal(size=(count, 3)),
                np.array([0, 3, -4]) + 3 * rng.normal(size=(count, 3)),
                4 * rng.normal(size=(count, 3)),
                rng.uniform(-1.2, 1.2, size=(count, 3)),
                rng.uniform(0, 5, size=(count, 1)),
            ],
            axis=1,
        )
        return rng.uniform(0, 3, count), states

    return draw
