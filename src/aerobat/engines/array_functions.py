"""Traces as functions of NumPy arrays, and their gradients: what an optimizer takes of a kernel.

A function is the trace's operations as straight lines of NumPy, element by element. Arrays of complex numbers
give slopes by a complex step, so that the gradient's own slopes are second derivatives without cancellation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from aerobat.engines.tracing import FORMS, Symbol, TraceOps

COMPLEX_STEP = 1e-20  # so small that its square is nothing beside any number

ArrayFunction = Callable[[Sequence[Any]], tuple[Any, ...]]

_FORMS = {
    **FORMS,
    "minimum": "minimum({}, {})",
    "maximum": "maximum({}, {})",
    "less": "less({}, {})",
    "select": "where({}, {}, {})",
}


def array_function(inputs: Sequence[Symbol], outputs: Sequence[Symbol]) -> ArrayFunction:
    """Return the function of a trace from its inputs to its outputs, arrays that broadcast, real or complex.

    An output that is a constant is a float.
    """
    trace = outputs[0].trace
    given, kept = {symbol.number for symbol in inputs}, {symbol.number for symbol in outputs}
    needed = sorted(trace.needed(kept) - given)
    last_use = {argument: number for number in needed for argument in trace.operations[number].arguments}
    lines = ["def function(inputs):", f" ({''.join(f'v{symbol.number}, ' for symbol in inputs)}) = inputs"]
    for number in needed:
        operation = trace.operations[number]
        if operation.name == "constant":
            continue
        form = _FORMS[operation.name].format(*map(trace.written, operation.arguments))
        lines.append(f" v{number} = {form}")
        done = {i for i in operation.arguments if last_use[i] == number and i not in kept | given}
        freed = [f"v{i}" for i in sorted(done) if trace.operations[i].name != "constant"]
        lines += [f" del {', '.join(freed)}"] if freed else []
    lines.append(f" return ({''.join(f'{trace.written(symbol.number)}, ' for symbol in outputs)})")
    functions = {name: getattr(np, name) for name in ("sqrt", "exp", "minimum", "maximum", "where")}
    namespace: dict[str, Any] = {**functions, "less": _less}
    exec(compile("\n".join(lines), "<array function>", "exec"), namespace)
    function: ArrayFunction = namespace["function"]
    return function


def gradient(output: Symbol, inputs: Sequence[Symbol]) -> list[Symbol]:
    """Return the partial derivatives of a value of a trace by others, written into the trace.

    Args:
        output: What is differentiated, backwards through the operations that make it.
        inputs: By which; nothing looks behind them.
    """
    trace, ops = output.trace, TraceOps(output.trace)
    wanted = {symbol.number for symbol in inputs}
    needed, moved = sorted(trace.needed([output.number])), set(wanted)
    for number in needed:
        if any(argument in moved for argument in trace.operations[number].arguments):
            moved.add(number)
    slopes: dict[int, Symbol] = {output.number: trace.symbol(1.0)}
    for number in reversed(needed):
        if number in wanted or number not in moved or number not in slopes:
            continue
        operation = trace.operations[number]
        arguments = [Symbol(trace, i) for i in operation.arguments]
        slope = slopes[number]
        for argument, part in _parts(ops, operation.name, arguments, Symbol(trace, number), slope):
            known = slopes.get(argument.number)
            slopes[argument.number] = part if known is None else known + part
    return [slopes.get(symbol.number, trace.symbol(0.0)) for symbol in inputs]


def _parts(
    ops: TraceOps, name: str, arguments: list[Symbol], value: Symbol, slope: Symbol
) -> list[tuple[Symbol, Symbol]]:
    """The arguments of an operation, each with what a slope by its value adds to the slope by it."""
    match name, arguments:
        case "add", [x, y]:
            return [(x, slope), (y, slope)]
        case "subtract", [x, y]:
            return [(x, slope), (y, -slope)]
        case "multiply", [x, y]:
            return [(x, slope * y), (y, slope * x)]
        case "divide", [x, y]:
            part = slope / y
            return [(x, part), (y, -(part * value))]
        case "negate", [x]:
            return [(x, -slope)]
        case "sqrt", [x]:
            return [(x, slope * 0.5 / value)]
        case "exp", [x]:
            return [(x, slope * value)]
        case "maximum" | "minimum", [x, y]:
            takes_first = y < x if name == "maximum" else x < y
            return [(x, ops.select(takes_first, slope, 0.0)), (y, ops.select(takes_first, 0.0, slope))]
        case "select", [condition, x, y]:
            return [(x, ops.select(condition, slope, 0.0)), (y, ops.select(condition, 0.0, slope))]
    raise ValueError(f"no derivative of {name}")


def _less(x: Any, y: Any) -> Any:
    """x < y, by the real parts of complex numbers."""
    return np.real(x) < np.real(y)
