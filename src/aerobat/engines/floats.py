"""Arithmetic of floats and arrays, and the reference engine, which runs kernels on Python floats."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from aerobat.engines.engine import (
    CompiledLoop,
    Engine,
    Init,
    Step,
    expanded,
    logged_ticks,
    read_only,
    tick_count,
)
from aerobat.engines.pytree import Tree, tree_map, tree_rows, tree_stack


class ArrayOps:
    """The operations of kernels on NumPy arrays."""

    sqrt = staticmethod(np.sqrt)
    exp = staticmethod(np.exp)
    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    select = staticmethod(np.where)


class FloatOps:
    """The operations of kernels on Python floats."""

    sqrt = staticmethod(math.sqrt)
    exp = staticmethod(math.exp)

    @staticmethod
    def minimum(x: float, y: float) -> float:
        """Return the smaller of two."""
        return x if x < y else y

    @staticmethod
    def maximum(x: float, y: float) -> float:
        """Return the larger of two."""
        return x if x > y else y

    @staticmethod
    def select(condition: bool, x: Any, y: Any) -> Any:
        """Return `x` if the condition holds, else `y`."""
        return x if condition else y


class FloatLoop(CompiledLoop):
    """A loop in plain Python."""

    def __init__(self, init: Init, step: Step, parameters: Tree, inputs: Tree) -> None:
        del inputs  # nothing is compiled
        self._init = init
        self._step = step
        self._parameters = list(tree_rows(parameters, _floats))

    def init(self, inputs: Tree) -> Tree:
        """Return the first carry; see `CompiledLoop.init`."""
        chunk = tree_map(lambda leaf: np.asarray(leaf)[None], expanded(inputs))
        carries = [
            self._init(FloatOps, parameters, next(_ticks(chunk, vehicle)))
            for vehicle, parameters in enumerate(self._parameters)
        ]
        return _stacked(carries)

    def scan(self, carry: Tree, inputs: Tree, log_stride: int = 1) -> tuple[Tree, Tree]:
        """Run some ticks; see `CompiledLoop.scan`."""
        inputs = expanded(inputs)
        logged = set(logged_ticks(tick_count(inputs), log_stride).tolist())
        carries, series = [], []
        for vehicle, state in enumerate(tree_rows(carry, _floats)):
            parameters, rows = self._parameters[vehicle], []
            for tick, row in enumerate(_ticks(inputs, vehicle)):
                state, output = self._step(FloatOps, parameters, state, row)
                if tick in logged:
                    rows.append(output)
            carries.append(state)
            series.append(tree_stack(rows, np.array))
        return _stacked(carries), tree_stack(series, np.stack)


def _floats(leaf: Any) -> Iterator[Any]:
    return iter(leaf.tolist())


def _ticks(inputs: Tree, vehicle: int) -> Iterator[Tree]:
    return tree_rows(inputs, lambda leaf: _floats(leaf if leaf.ndim == 1 else leaf[:, vehicle]))


def first_numbers(tree: Tree) -> Any:
    """Return the first number of each leaf as a float: that of the first vehicle, or of the first tick."""
    return tree_map(lambda leaf: float(np.ravel(leaf)[0]), tree)


def _stacked(carries: list[Tree]) -> Tree:
    return tree_stack(carries, lambda values: read_only(np.array(values)))


FLOATS = Engine("floats", FloatLoop)
