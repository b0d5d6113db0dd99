"""How busy lanes are: from the step counts of flights, without flying them.

A batch runs until its slowest flight has ended. A lane of a pool takes up the next flight as
soon as its own has ended, and waits only when there is none left.
"""

import heapq

import numpy as np

WIDTHS = (24, 512, 65_536)
PER_LANE = (1, 5, 15, 60)  # flights


def batched(steps: np.ndarray, lanes: int) -> float:
    """Share of busy lanes in batches of fixed cases.

    Args:
        steps: attempts of every flight, in the order they are flown, (N,).
        lanes: of a batch.
    """
    slowest = [steps[k : k + lanes].max() for k in range(0, len(steps), lanes)]
    return float(steps.sum() / (lanes * np.sum(slowest)))


def pooled(steps: np.ndarray, lanes: int) -> float:
    """Share of busy lanes in a pool; the arguments are those of `batched`."""
    ends = [0] * lanes
    for count in steps.tolist():
        heapq.heapreplace(ends, ends[0] + count)
    return float(steps.sum() / (lanes * max(ends)))


def table(steps: np.ndarray, **about) -> list[dict]:
    """Rows of both for several widths, of flights drawn from those whose steps were counted."""
    random = np.random.default_rng(0)
    rows = []
    for lanes in WIDTHS:
        for each in PER_LANE:
            drawn = random.choice(steps, lanes * each)
            row = {"lanes": lanes, "flights": len(drawn), "batches": batched(drawn, lanes)}
            row["pool"] = pooled(drawn, lanes)
            row["pool_longest_first"] = pooled(np.sort(drawn)[::-1], lanes)
            rows.append({**about, **row})
    return rows
