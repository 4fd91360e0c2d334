"""Kernels under JAX: traced once, compiled by XLA for JAX's device, all vehicles at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np

from aerobat.arrays import Array
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
from aerobat.engines.pytree import Tree, tree_leaves, tree_unflatten
from aerobat.engines.traced_loop import TracedLoop, trace_loop
from aerobat.engines.tracing import FUNCTIONS

Values = tuple[Any, ...]  # arrays of JAX, each (vehicles,)
State = tuple[Values, Values]  # the carry, and the outputs of the last tick

MIN_TICKS = 8  # lengths of scans are padded to this times a power of two, so that few lengths are compiled
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **FUNCTIONS,
    "sqrt": jnp.sqrt,
    "exp": jnp.exp,
    "minimum": jnp.minimum,
    "maximum": jnp.maximum,
    "select": jnp.where,
}


class JaxLoop(CompiledLoop):
    """A loop compiled by XLA. Its precision does not depend on JAX's settings; rows are float64."""

    def __init__(
        self,
        init: Init,
        step: Step,
        parameters: Tree,
        inputs: Tree,
        precision: Literal["float64", "float32"] = "float64",
    ) -> None:
        self._loop = trace_loop(init, step, parameters, expanded(inputs))
        self._precision = precision
        with jax.enable_x64(precision == "float64"):
            self._parameters = tuple(jnp.asarray(leaf, precision) for leaf in tree_leaves(parameters))

    def init(self, inputs: Tree) -> Tree:
        """Return the first carry; see `CompiledLoop.init`."""
        with jax.enable_x64(self._precision == "float64"):
            row = tuple(jnp.asarray(leaf, self._precision) for leaf in tree_leaves(expanded(inputs)))
            return self._carry(_initialized(self._loop, self._parameters, row))

    def scan(self, carry: Tree, inputs: Tree, log_stride: int = 1) -> tuple[Tree, Tree]:
        """Run some ticks; see `CompiledLoop.scan`."""
        inputs = expanded(inputs)
        logged = logged_ticks(tick_count(inputs), log_stride)
        with jax.enable_x64(self._precision == "float64"):
            state = tuple(map(jnp.asarray, tree_leaves(carry)))
            series = tuple(jnp.asarray(_padded(x), self._precision) for x in tree_leaves(inputs))
            state, outputs = _scanned(self._loop, self._parameters, state, series, _padded(logged))
            rows = [_row(output, len(logged)) for output in outputs]
            return self._carry(state), tree_unflatten(self._loop.row, rows)

    def _carry(self, values: Values) -> Tree:
        return tree_unflatten(self._loop.carry_tree, (read_only(np.array(value)) for value in values))


def _computed(loop: TracedLoop, numbers: Iterable[int], known: dict[int, Any]) -> dict[int, Any]:
    """Return values of a loop by their numbers, together with those known before."""
    values = dict(known)
    for number in numbers:
        operation = loop.trace.operations[number]
        if operation.name == "constant":
            values[number] = operation.content
        elif operation.name != "input":
            arguments = (values[i] for i in operation.arguments)
            values[number] = _FUNCTIONS[operation.name](*arguments)
    return values


def _filled(loop: TracedLoop, numbers: Iterable[int], values: dict[int, Any], like: Any) -> Values:
    """Return some values, each as an array with an entry for every vehicle, like `like`."""
    kinds = {number: bool if loop.is_logical(number) else like.dtype for number in numbers}
    return tuple(jnp.broadcast_to(jnp.asarray(values[n], kinds[n]), like.shape) for n in numbers)


# JAX compiles equal loops once: those with the same listing
@partial(jax.jit, static_argnums=0)
def _initialized(loop: TracedLoop, parameters: Values, row: Values) -> Values:
    """Return the first carry."""
    known = dict(zip((*loop.parameters, *loop.inputs), (*parameters, *row), strict=True))
    return _filled(loop, loop.first_carry, _computed(loop, loop.initialization, known), parameters[0])


@partial(jax.jit, static_argnums=0)
def _scanned(
    loop: TracedLoop, parameters: Values, carry: Values, inputs: Values, logged: Any
) -> tuple[Values, Values]:
    """Return the next carry, and the outputs (rows, vehicles) of the logged ticks, including the last."""
    like = parameters[0]
    prologue = _computed(loop, loop.prologue, dict(zip(loop.parameters, parameters, strict=True)))

    def tick(index: Any, state: State) -> State:
        row = tuple(leaf[index] for leaf in inputs)
        known = dict(zip((*loop.carry, *loop.inputs), (*state[0], *row), strict=True))
        values = _computed(loop, loop.body, prologue | known)
        return _filled(loop, loop.next_carry, values, like), _filled(loop, loop.outputs, values, like)

    def stretch(state: State, ends: tuple[Any, Any]) -> tuple[State, Values]:
        """Run the ticks after one logged tick, up to and including the next."""
        state = jax.lax.fori_loop(*ends, tick, state)
        return state, state[1]

    nothing = dict.fromkeys(loop.outputs, 0)
    start = carry, _filled(loop, loop.outputs, nothing, like)
    ends = logged + 1
    begins = jnp.concatenate([jnp.zeros_like(ends[:1]), ends[:-1]])
    (after, _), outputs = jax.lax.scan(stretch, start, (begins, ends))
    return after, outputs


def _padded(series: Any) -> Array:
    """Return a series padded with its last entry to the next of a few lengths."""
    series = np.asarray(series)
    length = MIN_TICKS
    while length < len(series):
        length *= 2
    return np.concatenate([series, np.repeat(series[-1:], length - len(series), axis=0)])


def _row(output: Any, rows: int) -> Array:
    """Return an output (rows, vehicles) on a device as (vehicles, rows), logical or float64."""
    series = np.asarray(output)[:rows].T
    return series if series.dtype == bool else series.astype(np.float64)


ENGINE = Engine("jax", JaxLoop)
SINGLE = Engine("jax-float32", partial(JaxLoop, precision="float32"))
