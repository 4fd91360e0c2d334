"""Kernels on NumPy arrays, all vehicles at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import (
    CompiledLoop,
    Engine,
    Init,
    Step,
    logged_ticks,
    read_only,
    tick_count,
    told_at_every_tick,
)
from aerobat.engines.pytree import Tree, tree_leaves, tree_map, tree_rows, tree_stack


class ArrayOps:
    """Arithmetic of NumPy arrays."""

    sqrt = staticmethod(np.sqrt)
    exp = staticmethod(np.exp)
    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    select = staticmethod(np.where)


class ArrayLoop(CompiledLoop):
    """A loop run as it is written, on arrays."""

    def __init__(self, init: Init, step: Step, parameters: Tree, inputs: Tree) -> None:
        del inputs  # nothing is compiled for them
        self._init = init
        self._step = step
        self._parameters = parameters
        self._shape = tree_leaves(parameters)[0].shape

    def init(self, inputs: Tree) -> Tree:
        """See `CompiledLoop.init`."""
        row = tree_map(lambda leaf: leaf if np.ndim(leaf) else float(leaf), inputs)
        with np.errstate(all="ignore"):
            return self._carry(self._init(ArrayOps, self._parameters, row))

    def scan(self, carry: Tree, inputs: Tree, log_stride: int = 1) -> tuple[Tree, Tree]:
        """See `CompiledLoop.scan`."""
        logged = set(logged_ticks(tick_count(inputs), log_stride).tolist())
        rows = []
        with np.errstate(all="ignore"):  # a vehicle that diverges may overflow; the others fly on
            for tick, row in enumerate(tree_rows(inputs, _ticks)):
                carry, output = self._step(ArrayOps, self._parameters, carry, row)
                if tick in logged:
                    rows.append(output)
        return self._carry(carry), tree_stack(rows, lambda series: np.stack(self._each(series), axis=-1))

    def _each(self, series: Any) -> list[Array]:
        """Leaves (vehicles,) of what may be one number for all."""
        return [np.broadcast_to(leaf, self._shape) for leaf in series]

    def _carry(self, carry: Tree) -> Tree:
        """A carry that shares no memory with inputs."""
        return tree_map(lambda leaf: read_only(np.array(np.broadcast_to(leaf, self._shape))), carry)


def _ticks(leaf: Array) -> Iterator[Any]:
    return iter(leaf.tolist() if leaf.ndim == 1 else leaf)


NUMPY = Engine("numpy", told_at_every_tick(ArrayLoop))
