"""Datasets of measured flights, made up."""

import numpy as np
import xarray as xr


def dataset(entries, up=0.0):
    """The flights as `jaxglide.measured.flights_dataset` labels them; paths are straight."""
    gait = {
        ours: ("trial", np.array([e["gait"][theirs] for e in entries]))
        for ours, theirs in {
            "nu_theta": "nu_theta",
            "f_theta": "f_theta",
            "theta_m": "theta_max",
            "psi_m": "psi_max",
            "d_psi": "d_psi_avg",
        }.items()
    }
    start = np.array([e["start_m"] for e in entries]) + np.array([0.0, 0.0, up])
    velocity = np.array([e["start_velocity_m_s"] for e in entries])
    times = np.broadcast_to(np.linspace(0.0, 1.0, 21), (len(entries), 21))
    return xr.Dataset(
        {
            **gait,
            "svl": ("trial", np.array([e["svl_m"] for e in entries])),
            "mass": ("trial", np.array([1e-3 * e["mass_g"] for e in entries])),
            "start_position": (("trial", "axis"), start),
            "start_velocity": (("trial", "axis"), velocity),
            "time": (("trial", "frame"), times),
            "position": (
                ("trial", "frame", "axis"),
                start[:, None] + times[:, :, None] * velocity[:, None],
            ),
        },
        coords={
            "trial": [str(e["trial"]) for e in entries],
            "snake": ("trial", [str(e["snake"]) for e in entries]),
        },
    )


def made(measured, simulated):
    """A dataset of one flight with the two paths given, (T, 3)."""
    measured, simulated = np.array(measured, float), np.array(simulated, float)
    return xr.Dataset(
        {
            "position": (("trial", "frame", "axis"), measured[None]),
            "path": (("trial", "time_simulated", "axis"), simulated[None]),
            "end": (("trial", "axis"), simulated[None, -1]),
        },
        coords={"trial": ["1"], "snake": ("trial", ["A"])},
    )


def paths_of(turn_back):
    """Two flights: measured straight ahead, simulated shorter or back to the start."""
    down = np.linspace(8.0, 0.5, 16)
    ahead = (8.0 - down) * 0.6
    measured = np.stack([0.1 * ahead + 1.0, ahead - 4.0, down], axis=1)
    ways = (0.5 * ahead, ahead * (1.4 - 0.2 * ahead) if turn_back else 0.7 * ahead)
    simulated = np.stack([np.stack([1 + 0 * way, way - 4.0, down], axis=1) for way in ways])
    return xr.Dataset(
        {
            "position": (("trial", "frame", "axis"), np.stack([measured, measured])),
            "path": (("trial", "time_simulated", "axis"), simulated),
            "end": (("trial", "axis"), simulated[:, -1]),
        },
        coords={"trial": ["101", "202"], "snake": ("trial", ["A", "B"])},
    )
