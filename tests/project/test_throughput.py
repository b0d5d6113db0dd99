"""The benchmark of throughput: what it says of lanes, of power, and on a GPU."""

import sys
import time

import numpy as np
import pytest

from places import ROOT

sys.path.insert(0, str(ROOT / "benchmarks"))

import lanes
import throughput

STEPS = np.array([3, 1, 1, 1, 2])


def test_batches_wait_for_their_slowest_flight():
    assert lanes.batched(STEPS, 2) == 8 / (2 * (3 + 1 + 2))
    assert lanes.batched(STEPS, 5) == 8 / (5 * 3)


def test_pools_wait_for_the_last_flights_alone():
    assert lanes.pooled(STEPS, 2) == 8 / (2 * 5)  # 3 + 2 in one lane, 1 + 1 + 1 in the other
    assert lanes.pooled(np.sort(STEPS)[::-1], 2) == 1.0
    assert lanes.pooled(STEPS, 5) == lanes.batched(STEPS, 5)


@pytest.mark.slow
def test_lanes_of_a_sweep_wait_as_long_as_the_simulated_ones(monkeypatch):
    from jaxglide import Study
    from jaxglide.ensemble import batch

    monkeypatch.setattr(batch, "cores", lambda: 1)
    heights = np.random.default_rng(0).uniform(0.05, 1.0, 64)
    study = Study(cases=throughput.cases(64) | {"height": heights})
    data, busy = throughput.busy_share(study, 16)
    steps = (data.accepted + data.rejected + 1).values[study.order()[::-1]]
    assert busy == pytest.approx(lanes.pooled(steps, 16), rel=1e-12)
    assert busy > lanes.batched(steps, 16)


def test_mean_power_is_what_the_card_tells(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with throughput.Power() as power:
        pass
    assert power.mean is None
    command = tmp_path / "nvidia-smi"
    command.write_text(
        "#!/bin/sh\necho 100.5\necho [N/A]\necho 199.5\necho 3\nexec /bin/sleep 9\n"
    )
    command.chmod(0o755)
    with throughput.Power() as power:
        time.sleep(0.5)
    assert power.mean == pytest.approx(np.mean([100.5, 199.5, 3]))


@pytest.mark.gpu
@pytest.mark.parametrize("double", [True, False])
def test_sweep_on_a_gpu_lands_where_it_lands_on_the_cpu(double):
    _, here = throughput.process(64)
    row, there = throughput.process(64, double=double, JAX_PLATFORMS="cuda")
    apart = np.linalg.norm(there["landing"] - here["landing"], axis=1)
    assert row["gpu_peak_mib"] > 0
    assert (apart <= 0.01).mean() > 0.9
