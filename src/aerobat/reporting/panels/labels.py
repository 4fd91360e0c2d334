"""Labels in a row that would overlap move apart."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array


def spread_out(wanted: Array, pitch: float, low: float, high: float) -> Array:
    """Places (k,) at least `pitch` apart, as near to the wanted ones as can be (least squares), in order.

    They stay between `low` and `high` where there is room. Isotonic regression by pooling neighbours.
    """
    order = np.argsort(wanted, kind="stable")
    steps = pitch * np.arange(len(wanted))
    pools: list[list[float]] = []
    for place in wanted[order] - steps:
        pools.append([float(place)])
        while len(pools) > 1 and np.mean(pools[-2]) >= np.mean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    level = np.array([np.mean(pool) for pool in pools for _ in pool])
    result = np.empty(len(wanted))
    result[order] = np.clip(level, low, max(low, high - steps[-1] if len(steps) else low)) + steps
    return result
