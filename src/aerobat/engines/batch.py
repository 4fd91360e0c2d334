"""Kernels on NumPy arrays, all vehicles at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import Engine, Init, Step, told
from aerobat.engines.trees import Tree, leaves, rows, stacked


class ArrayOps:
    """Arithmetic of NumPy arrays."""

    sqrt = staticmethod(np.sqrt)
    exp = staticmethod(np.exp)
    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    select = staticmethod(np.where)


def scan(init: Init, step: Step, parameters: Tree, inputs: Tree, every: int = 1) -> Tree:
    """The loop over time, all vehicles at each tick; see `engine.Scan`."""
    carry, outputs = None, []
    due = set(told(len(leaves(inputs)[0]), every).tolist())
    with np.errstate(all="ignore"):  # a vehicle that diverges may overflow; the others fly on
        for tick, row in enumerate(rows(inputs, _ticks)):
            if carry is None:
                carry = init(ArrayOps, parameters, row)
            carry, output = step(ArrayOps, parameters, carry, row)
            if tick in due:
                outputs.append(output)
    vehicles = leaves(parameters)[0].shape  # what is the same for all is told for each
    return stacked(outputs, lambda series: np.stack([np.broadcast_to(x, vehicles) for x in series], axis=-1))


def _ticks(leaf: Array) -> Iterator[Any]:
    return iter(leaf.tolist() if leaf.ndim == 1 else leaf)


NUMPY = Engine("numpy", scan)
