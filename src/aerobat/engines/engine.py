"""The interface of engines: arithmetic, and loops over time that are compiled once and run in parts."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from aerobat.arrays import Array
from aerobat.engines.pytree import Tree, tree_leaves, tree_like, tree_map, tree_replace
from aerobat.kernels.ops import Ops

Init: TypeAlias = Callable[[Ops, Tree, Tree], Tree]
Step: TypeAlias = Callable[[Ops, Tree, Tree, Tree], tuple[Tree, Tree]]


class Held(NamedTuple):
    """Inputs with a zero-order hold, constant for several ticks and stored once; kernels see the values."""

    row: Any  # indices into `values` for each tick, (ticks,); () for one tick with its own values
    values: Tree  # leaves (samples,) or (samples, vehicles)

    def expanded(self) -> Tree:
        """Return the values at each tick."""
        if isinstance(self.row, tuple):
            return expanded(self.values)
        return tree_map(lambda leaf: leaf[self.row], expanded(self.values))


class Coded(NamedTuple):
    """Dictionary-encoded inputs: entries of a table, stored as indices; kernels see the tree of entries."""

    # leaves (ticks, vehicles), or (vehicles,) for one tick, in a `Held` (samples, vehicles); uint16
    codes: Tree
    table: Array  # (65536,), shared by all `Coded` inputs of a loop

    def expanded(self) -> Tree:
        """Return the entries."""
        return tree_map(lambda leaf: self.table[leaf], self.codes)


class CompiledLoop(ABC):
    """A loop over time, `carry, row = step(ops, parameters, carry, inputs)`, for given parameters.

    A carry is a plain tree of read-only arrays (vehicles,). It can be stored, pickled, and continued any
    number of times. The results are bitwise the same, however the ticks are divided into scans and steps.
    """

    @abstractmethod
    def init(self, inputs: Tree) -> Tree:
        """Return the carry before the first tick; leaves of `inputs` are numbers or arrays (vehicles,).

        Inputs that are `Held` or `Coded` must also be so at compilation, here and in `scan`.
        """

    @abstractmethod
    def scan(self, carry: Tree, inputs: Tree, log_stride: int = 1) -> tuple[Tree, Tree]:
        """Return the carry after some ticks, and the rows of the logged ticks (see `logged_ticks`).

        Args:
            carry: carry from `init`, or from an earlier scan or step; it is not changed.
            inputs: leaves (ticks,), the same for all vehicles, or (ticks, vehicles), as at compilation;
                leaves of a `Held` have as many rows as it has samples.
            log_stride: ticks from one logged row to the next.

        The rows' leaves are (vehicles, logged ticks).
        """

    def step(self, carry: Tree, inputs: Tree) -> tuple[Tree, Tree]:
        """Return the carry after one tick, and its row with leaves (vehicles,); inputs as for `init`."""
        carry, rows = self.scan(carry, tree_map(lambda leaf: np.asarray(leaf)[None], expanded(inputs)))
        return carry, tree_map(lambda leaf: leaf[..., 0], rows)


class Compile(Protocol):
    """A function that compiles `init` and `step` to a loop."""

    def __call__(self, init: Init, step: Step, parameters: Tree, inputs: Tree) -> CompiledLoop:
        """Return the loop that starts with `init(ops, parameters, inputs)` and continues with `step`.

        Args:
            init: function that returns the carry before the first tick.
            step: function that returns the next carry and the row of one tick; both are written in `ops`.
            parameters: leaves (vehicles,).
            inputs: inputs of one tick; leaves are numbers where all vehicles have the same, else (vehicles,).
                Leaves below a tuple with a true attribute `piecewise_constant` change at few ticks: a hint to
                the compiler, which changes no result.
        """


@dataclass(frozen=True)
class Engine:
    """A way to run kernels. All engines give the same numbers up to rounding."""

    name: str
    compile: Compile


def logged_ticks(ticks: int, log_stride: int) -> NDArray[np.intp]:
    """Return the ticks whose rows a scan returns: the first, every `log_stride`-th after it, and the last."""
    logged = np.arange(0, ticks, log_stride)
    return logged if logged[-1] == ticks - 1 else np.append(logged, ticks - 1)


def run_whole(
    engine: Engine, init: Init, step: Step, parameters: Tree, inputs: Tree, log_stride: int = 1
) -> Tree:
    """Return the rows of the logged ticks of a loop that is run once from start to end."""
    loop = engine.compile(init, step, parameters, first_row(inputs))
    return loop.scan(loop.init(first_row(inputs)), inputs, log_stride)[1]


def first_row(inputs: Tree) -> Tree:
    """Return the inputs of the first tick."""
    return _row(inputs, 0)


def _row(inputs: Tree, index: int) -> Tree:
    match inputs:
        case Held():
            return Held((), _row(inputs.values, inputs.row[index]))
        case Coded():
            return Coded(_row(inputs.codes, index), inputs.table)
        case tuple():
            return tree_like(inputs, (_row(each, index) for each in inputs))
    return np.asarray(inputs)[index]


def expanded(inputs: Tree) -> Tree:
    """Return inputs as kernels see them: `Held` values repeated at every tick, `Coded` values as entries."""
    return tree_replace(inputs, (Held, Coded), lambda node: node.expanded())


def tick_count(inputs: Tree) -> int:
    """Return the number of ticks of a scan's inputs."""
    return len(tree_leaves(inputs)[0])


def read_only(array: Any) -> Any:
    """Return the same array, write-protected."""
    array.flags.writeable = False
    return array


def available_cores() -> int:
    """Return the number of processors that this process may use, or of all where the system does not say."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
