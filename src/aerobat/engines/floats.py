"""Kernels on Python floats, one vehicle after another: the reference, and the fastest for a few."""

from __future__ import annotations

import math
from collections.abc import Container
from typing import Any

import numpy as np

from aerobat.engines.engine import Engine, Init, Step, told
from aerobat.engines.trees import Tree, leaves, rows, stacked


class FloatOps:
    """Arithmetic of Python floats."""

    sqrt = staticmethod(math.sqrt)
    exp = staticmethod(math.exp)

    @staticmethod
    def minimum(x: float, y: float) -> float:
        """The smaller of two."""
        return x if x < y else y

    @staticmethod
    def maximum(x: float, y: float) -> float:
        """The larger of two."""
        return x if x > y else y

    @staticmethod
    def select(condition: bool, x: Any, y: Any) -> Any:
        """`x` if the condition holds, else `y`."""
        return x if condition else y


def scan(init: Init, step: Step, parameters: Tree, inputs: Tree, every: int = 1) -> Tree:
    """The loop over time of each vehicle, one after another; see `engine.Scan`."""
    due = set(told(len(leaves(inputs)[0]), every).tolist())
    vehicles = enumerate(rows(parameters, lambda leaf: iter(leaf.tolist())))
    return stacked([_flown(init, step, parameter, inputs, k, due) for k, parameter in vehicles], np.stack)


def _flown(init: Init, step: Step, parameter: Tree, inputs: Tree, vehicle: int, due: Container[int]) -> Tree:
    carry, outputs = None, []
    ticks = rows(inputs, lambda leaf: iter((leaf if leaf.ndim == 1 else leaf[:, vehicle]).tolist()))
    for tick, row in enumerate(ticks):
        if carry is None:
            carry = init(FloatOps, parameter, row)
        carry, output = step(FloatOps, parameter, carry, row)
        if tick in due:
            outputs.append(output)
    return stacked(outputs, np.array)


FLOATS = Engine("floats", scan)
