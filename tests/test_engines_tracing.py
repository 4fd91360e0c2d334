"""A traced kernel is the kernel: the same numbers from its list of operations, which people can read."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.engines.floats import FloatOps
from aerobat.engines.traced_loop import trace_loop
from aerobat.engines.tracing import FUNCTIONS, BranchError, Symbol, Trace, TraceOps

NUMBERS = st.floats(-5.0, 5.0)


def values(trace: Trace, given_: dict[str, float]) -> list[Any]:
    """What a listing computes, one operation after the other."""
    found: list[Any] = []
    for operation in trace.operations:
        if operation.name == "input":
            found.append(given_[str(operation.content)])
        elif operation.name == "constant":
            found.append(operation.content)
        else:
            found.append(FUNCTIONS[operation.name](*(found[i] for i in operation.arguments)))
    return found


def kernel(ops: Any, x: Any, y: Any) -> Any:
    smaller, larger = ops.minimum(x, y), ops.maximum(x, 2.0 * y)
    inside = (x > -1.0) & (y <= 3.0) & (x * y >= -2.0)
    chosen = ops.select(inside, larger - smaller / 3.0, -larger)
    return ops.sqrt(chosen * chosen + 1.0) * ops.exp(-ops.maximum(x, -x)) + (1.0 - y) / (y * y + 2.0)


@given(NUMBERS, NUMBERS)
def test_a_trace_computes_what_its_kernel_does_to_the_last_bit(x: float, y: float) -> None:
    trace = Trace()
    result = kernel(TraceOps(trace), trace.input("x"), trace.input("y"))
    assert values(trace, {"x": x, "y": y})[result.number] == kernel(FloatOps, x, y)


def test_what_is_common_is_computed_once() -> None:
    trace = Trace()
    x, y = trace.input("x"), trace.input("y")
    first = x * y + TraceOps(trace).sqrt(x)
    count = len(trace.operations)
    assert (y * x + TraceOps(trace).sqrt(x)).number == first.number
    assert len(trace.operations) == count
    assert (x - y).number != (y - x).number


def test_constants_are_folded_and_nothing_else_is() -> None:
    trace = Trace()
    x, ops = trace.input("x"), TraceOps(trace)
    two = trace.symbol(2.0)
    assert trace.operations[(two * 3.0 + ops.sqrt(two * 2.0)).number].content == 8.0
    assert (x * 1.0).number == (1.0 * x).number == (x / 1.0).number == x.number
    assert ops.select(True, x, 7.0).number == x.number
    assert ops.select(x > 0.0, x, x).number == x.number
    # 0·x may be NaN, x + 0 turns −0 into 0: left to be computed
    assert trace.operations[(0.0 * x).number].name == "multiply"
    assert trace.operations[(x + 0.0).number].name == "add"
    assert (1.0 / x).number != x.number
    assert trace.symbol(0.0).number != trace.symbol(-0.0).number


def branches(x: Any) -> Any:
    return x if x > 0.0 else -x


@pytest.mark.parametrize("ask", [branches, math.sin, float, lambda x: [*x]])
def test_a_kernel_that_asks_for_a_value_is_told_which_line_did(ask: Any) -> None:
    with pytest.raises(
        BranchError, match=r"test_engines_tracing\.py, line \d+: `.*` needs the value"
    ) as raised:
        ask(Trace().input("x"))
    assert "ops.select" in str(raised.value)
    if ask is branches:
        assert "return x if x > 0.0 else -x" in str(raised.value)


class Carry(NamedTuple):
    total: Any
    steps: Any
    idle: Any


def init(ops: Any, rate: Any, row: Any) -> Carry:
    return Carry(0.0, 0.0, rate * row)


def step(ops: Any, rate: Any, carry: Carry, row: Any) -> tuple[Carry, Any]:
    factor = ops.exp(-rate)
    carry = Carry(factor * carry.total + row, carry.steps + 1.0, carry.idle * 2.0)
    return carry, (carry.total, carry.total > 1.0)


def test_a_loop_knows_what_it_computes_once_and_carries_only_what_rows_need() -> None:
    loop = trace_loop(init, step, np.ones(3), np.ones(5))
    assert len(loop.carry) == 1  # neither the count nor what is idle is in a row
    names = [[loop.trace.operations[i].name for i in part] for part in (loop.prologue, loop.body)]
    assert "exp" in names[0]
    assert "exp" not in names[1]
    assert str(loop).splitlines()[-1].startswith("output: %")
    assert "exp %" in str(loop)
    assert isinstance(loop.row[0], Symbol)
