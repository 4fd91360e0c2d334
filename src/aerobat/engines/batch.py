"""Kernels on NumPy arrays, all vehicles at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import Engine, Init, Step
from aerobat.engines.trees import Tree, rows, stacked


class ArrayOps:
    """Arithmetic of NumPy arrays."""

    sqrt = staticmethod(np.sqrt)
    exp = staticmethod(np.exp)
    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    select = staticmethod(np.where)


def scan(init: Init, step: Step, parameters: Tree, inputs: Tree) -> Tree:
    """The loop over time, all vehicles at each tick; see `engine.Scan`."""
    carry, outputs = None, []
    with np.errstate(all="ignore"):  # a vehicle that diverges may overflow; the others fly on
        for row in rows(inputs, _ticks):
            if carry is None:
                carry = init(ArrayOps, parameters, row)
            carry, output = step(ArrayOps, parameters, carry, row)
            outputs.append(output)
    return stacked(outputs, lambda leaves: np.stack(leaves, axis=-1))


def _ticks(leaf: Array) -> Iterator[Any]:
    return iter(leaf.tolist() if leaf.ndim == 1 else leaf)


NUMPY = Engine("numpy", scan)
