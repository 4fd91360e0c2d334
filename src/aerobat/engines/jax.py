"""Kernels under JAX: traced once, compiled by XLA for the device that JAX finds, all vehicles at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from aerobat.arrays import Array
from aerobat.engines.engine import Engine, Init, Step, told
from aerobat.engines.loops import Loop, traced
from aerobat.engines.tracing import FUNCTIONS
from aerobat.engines.trees import Tree, leaves, refilled

Values = tuple[Any, ...]  # arrays of JAX, each (vehicles,)
State = tuple[Values, Values]  # the carry, and what the last tick told

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **FUNCTIONS,
    "sqrt": jnp.sqrt,
    "exp": jnp.exp,
    "minimum": jnp.minimum,
    "maximum": jnp.maximum,
    "select": jnp.where,
}


def scan(
    init: Init,
    step: Step,
    parameters: Tree,
    inputs: Tree,
    every: int = 1,
    precision: Literal["float64", "float32"] = "float64",
) -> Tree:
    """The loop over time, all vehicles at each tick; see `engine.Scan`.

    The precision holds in here, whatever JAX is set to elsewhere; the answer is of float64 in either.
    """
    loop = traced(init, step, parameters, inputs)
    with jax.enable_x64(precision == "float64"):
        given, rows = (
            tuple(jnp.asarray(leaf, precision) for leaf in leaves(tree)) for tree in (parameters, inputs)
        )
        due = jnp.asarray(told(len(rows[0]), every))
        outputs = [_answer(output) for output in _flown(_Program(str(loop), loop), given, rows, due)]
    return refilled(loop.told, iter(outputs))


@dataclass(frozen=True)
class _Program:
    """A loop that equals all loops with the same listing, so that JAX compiles it only once."""

    listing: str
    loop: Loop = field(compare=False)

    def begun(self, parameters: Values, row: Values) -> dict[int, Any]:
        """The values before the first tick, by their numbers."""
        loop = self.loop
        given = dict(zip((*loop.parameters, *loop.inputs), (*parameters, *row), strict=True))
        return self._computed(loop.before, given)

    def ticked(self, begun: dict[int, Any], carry: Values, row: Values) -> dict[int, Any]:
        """The values at a tick, by their numbers."""
        loop = self.loop
        found = dict(zip((*loop.carry, *loop.inputs), (*carry, *row), strict=True))
        return self._computed(loop.during, begun | found)

    def filled(self, numbers: Iterable[int], values: dict[int, Any], like: Any) -> Values:
        """Some of the values, each an array with an entry for every vehicle, as `like` is."""
        operations = self.loop.trace.operations
        kinds = {number: bool if operations[number].logical else like.dtype for number in numbers}
        return tuple(jnp.broadcast_to(jnp.asarray(values[n], kinds[n]), like.shape) for n in numbers)

    def _computed(self, numbers: Iterable[int], values: dict[int, Any]) -> dict[int, Any]:
        for number in numbers:
            operation = self.loop.trace.operations[number]
            if operation.name == "constant":
                values[number] = operation.content
            elif operation.name != "input":
                arguments = (values[i] for i in operation.arguments)
                values[number] = _FUNCTIONS[operation.name](*arguments)
        return values


@partial(jax.jit, static_argnums=0)
def _flown(program: _Program, parameters: Values, inputs: Values, due: Any) -> Values:
    """The outputs (rows, vehicles) of the ticks that are due, the first and the last among them."""
    loop, like = program.loop, parameters[0]
    begun = program.begun(parameters, tuple(leaf[0] for leaf in inputs))

    def tick(index: Any, state: State) -> State:
        values = program.ticked(begun, state[0], tuple(leaf[index] for leaf in inputs))
        return program.filled(loop.following, values, like), program.filled(loop.outputs, values, like)

    def stretch(state: State, ends: tuple[Any, Any]) -> tuple[State, Values]:
        """From after a tick that is due through the next one."""
        state = jax.lax.fori_loop(*ends, tick, state)
        return state, state[1]

    nothing = dict.fromkeys(loop.outputs, 0)
    start = program.filled(loop.first, begun, like), program.filled(loop.outputs, nothing, like)
    ends = due + 1
    begins = jnp.concatenate([jnp.zeros_like(ends[:1]), ends[:-1]])
    outputs: Values = jax.lax.scan(stretch, start, (begins, ends))[1]
    return outputs


def _answer(output: Any) -> Array:
    """(rows, vehicles) on a device -> (vehicles, rows), logical or of float64."""
    rows = np.asarray(output).T
    return rows if rows.dtype == bool else rows.astype(np.float64)


ENGINE = Engine("jax", scan)
SINGLE = Engine("jax-float32", partial(scan, precision="float32"))
