"""Kernels as Python bytecode: traced once, written out as straight lines of floats, vehicle after vehicle.

The numbers are those of `floats` to the last bit, at four times their pace, and
ready long before machine code is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from itertools import repeat
from typing import Any

import numpy as np

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
from aerobat.engines.pytree import Tree, tree_leaves, tree_map, tree_unflatten
from aerobat.engines.traced_loop import TracedLoop, trace_loop
from aerobat.engines.tracing import FORMS

Row = tuple[Any, ...]
Function = Callable[..., Any]

_FORMS = {
    **FORMS,
    "minimum": "{0} if {0} < {1} else {1}",
    "maximum": "{0} if {0} > {1} else {1}",
    "less": "{} < {}",
    "less_equal": "{} <= {}",
    "and": "{} & {}",
    "select": "{1} if {0} else {2}",
}
_NAMES = {"sqrt": math.sqrt, "exp": math.exp, "inf": math.inf, "nan": math.nan}


class BytecodeLoop(CompiledLoop):
    """A loop as two Python functions, for its vehicles' parameters."""

    def __init__(self, init: Init, step: Step, parameters: Tree, inputs: Tree) -> None:
        self._loop, self._init, self._scan = _program(init, step, _bare(parameters), _bare(inputs))
        self._parameters = list(zip(*map(_floats, tree_leaves(parameters)), strict=True))

    def init(self, inputs: Tree) -> Tree:
        """See `CompiledLoop.init`."""
        rows = [np.asarray(leaf)[None] for leaf in tree_leaves(inputs)]
        carries = [
            self._init(parameters, next(_ticks(rows, vehicle)))
            for vehicle, parameters in enumerate(self._parameters)
        ]
        return self._carry(carries)

    def scan(self, carry: Tree, inputs: Tree, log_stride: int = 1) -> tuple[Tree, Tree]:
        """See `CompiledLoop.scan`."""
        ticks = tick_count(inputs)
        is_logged = np.zeros(ticks, dtype=bool)
        is_logged[logged_ticks(ticks, log_stride)] = True
        leaves = tree_leaves(inputs)
        before = zip(*map(_floats, tree_leaves(carry)), strict=True) if self._loop.carry else repeat(())
        carries, columns = [], []
        for vehicle, (parameters, state) in enumerate(zip(self._parameters, before, strict=False)):
            state, rows = self._scan(parameters, state, _ticks(leaves, vehicle), is_logged.tolist())
            carries.append(state)
            columns.append([np.array(column) for column in zip(*rows, strict=True)])
        outputs = [np.stack(column) for column in zip(*columns, strict=True)]
        return self._carry(carries), tree_unflatten(self._loop.row, outputs)

    def _carry(self, carries: list[Row]) -> Tree:
        leaves = (read_only(np.array(leaf)) for leaf in zip(*carries, strict=True))
        return tree_unflatten(self._loop.carry_tree, leaves)


@lru_cache(maxsize=32)
def _program(init: Init, step: Step, parameters: Tree, inputs: Tree) -> tuple[TracedLoop, Function, Function]:
    """A loop and its functions, for bare trees; once for functions that are the same."""
    loop = trace_loop(init, step, parameters, inputs)
    namespace: dict[str, Any] = dict(_NAMES)
    exec(compile(source(loop), "<bytecode engine>", "exec"), namespace)
    return loop, namespace["init"], namespace["scan"]


def source(loop: TracedLoop) -> str:
    """The module of a loop: `init(parameters, inputs)` and `scan(parameters, carry, ticks, is_logged)`."""
    value = [loop.trace.written(number) for number in range(len(loop.trace.operations))]

    def listed(numbers: Iterable[int]) -> str:
        return "(" + "".join(f"{value[number]}, " for number in numbers) + ")"

    def lines(numbers: Iterable[int], indent: str) -> Iterator[str]:
        for number in numbers:
            operation = loop.trace.operations[number]
            if operation.name in _FORMS:
                form = _FORMS[operation.name].format(*(value[i] for i in operation.arguments))
                yield f"{indent}{value[number]} = {form}"

    def guarded_lines(indent: str) -> Iterator[str]:
        for block in loop.guarded_blocks(loop.body, loop.inputs):
            if block.guard is None:
                yield from lines(block.numbers, indent)
            else:
                yield f"{indent}if {value[block.guard]}:"
                yield from lines(block.numbers, indent + " ")

    unpack_parameters = f" {listed(loop.parameters)} = parameters"
    return "\n".join(
        [
            "def init(parameters, inputs):",
            unpack_parameters,
            f" {listed(loop.inputs)} = inputs",
            *lines(loop.initialization, " "),
            f" return {listed(loop.first_carry)}",
            "def scan(parameters, carry, ticks, is_logged, sqrt=sqrt, exp=exp):",
            unpack_parameters,
            *lines(loop.prologue, " "),
            f" {listed(loop.carry)} = carry",
            " rows = []",
            f" for {listed(loop.inputs)}, logged in zip(ticks, is_logged):",
            *guarded_lines("  "),
            f"  if logged: rows.append({listed(loop.outputs)})",
            f"  {listed(loop.carry)} = {listed(loop.next_carry)}",
            f" return {listed(loop.carry)}, rows",
        ]
    )


def _bare(tree: Tree) -> Tree:
    """The tree without its numbers."""
    return tree_map(lambda leaf: 0, tree)


def _floats(leaf: Any) -> list[Any]:
    numbers: list[Any] = leaf.tolist()
    return numbers


def _ticks(leaves: list[Any], vehicle: int) -> Iterator[Row]:
    """Inputs of one vehicle, tick by tick."""
    columns = (_floats(leaf if leaf.ndim == 1 else leaf[:, vehicle]) for leaf in leaves)
    return zip(*columns, strict=True)


BYTECODE = Engine("bytecode", told_at_every_tick(BytecodeLoop))
