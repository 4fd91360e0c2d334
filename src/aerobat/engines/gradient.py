"""Gradients of traces by reverse-mode differentiation; the gradient is recorded in the same trace."""

from __future__ import annotations

from collections.abc import Sequence

from aerobat.engines.tracing import Symbol, Trace


def gradient(output: Symbol, inputs: Sequence[Symbol]) -> list[Symbol]:
    """Return the partial derivatives of a value of a trace, recorded in the trace.

    Args:
        output: The value to differentiate.
        inputs: The values to differentiate by; operations behind them are ignored.
    """
    trace = output.trace
    wanted = {symbol.number for symbol in inputs}
    needed, dependent = sorted(trace.needed([output.number])), set(wanted)
    for number in needed:
        if any(argument in dependent for argument in trace.operations[number].arguments):
            dependent.add(number)
    slopes: dict[int, Symbol] = {output.number: trace.symbol(1.0)}
    for number in reversed(needed):
        if number in wanted or number not in dependent or number not in slopes:
            continue
        operation = trace.operations[number]
        arguments = [Symbol(trace, i) for i in operation.arguments]
        slope = slopes[number]
        for argument, term in _contributions(trace, operation.name, arguments, Symbol(trace, number), slope):
            known = slopes.get(argument.number)
            slopes[argument.number] = term if known is None else known + term
    return [slopes.get(symbol.number, trace.symbol(0.0)) for symbol in inputs]


def _contributions(
    trace: Trace, name: str, arguments: list[Symbol], value: Symbol, slope: Symbol
) -> list[tuple[Symbol, Symbol]]:
    """Return the arguments of an operation, each with its contribution to the derivative by that argument."""
    match name, arguments:
        case "add", [x, y]:
            return [(x, slope), (y, slope)]
        case "subtract", [x, y]:
            return [(x, slope), (y, -slope)]
        case "multiply", [x, y]:
            return [(x, slope * y), (y, slope * x)]
        case "divide", [x, y]:
            quotient = slope / y
            return [(x, quotient), (y, -(quotient * value))]
        case "negate", [x]:
            return [(x, -slope)]
        case "sqrt", [x]:
            return [(x, slope * 0.5 / value)]
        case "exp", [x]:
            return [(x, slope * value)]
        case "maximum" | "minimum", [x, y]:
            takes_first = y < x if name == "maximum" else x < y
            return [(x, trace.select(takes_first, slope, 0.0)), (y, trace.select(takes_first, 0.0, slope))]
        case "select", [condition, x, y]:
            return [(x, trace.select(condition, slope, 0.0)), (y, trace.select(condition, 0.0, slope))]
    raise ValueError(f"no derivative of {name}")
