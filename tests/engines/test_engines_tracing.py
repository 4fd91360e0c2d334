"""A traced kernel is the kernel: the same numbers from its list of operations, which people can read."""

import math
import operator
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.engines import choose, run_whole
from aerobat.engines.floats import FloatOps
from aerobat.engines.traced_loop import trace_loop
from aerobat.engines.tracing import FUNCTIONS, BranchError, Symbol, Trace

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
    result = kernel(trace, trace.input("x"), trace.input("y"))
    assert values(trace, {"x": x, "y": y})[result.number] == kernel(FloatOps, x, y)


@given(NUMBERS, st.sampled_from([-1.0, 0.0, -0.0, math.nan]))
def test_equality_of_values_is_traced_as_equality_of_floats(x: float, y: float) -> None:
    for first, second in ((x, y), (y, y), (y, 0.0)):
        trace = Trace()
        a, b = trace.input("a"), trace.input("b")
        for compare in (operator.eq, operator.ne):
            for result in (compare(a, b), compare(a, second), compare(first, b)):
                found = values(trace, {"a": first, "b": second})[result.number]
                assert found is compare(first, second)


@pytest.mark.parametrize("engine", ["floats", "compiled"])
def test_conditions_are_compared_and_counted_as_floats_do_it(engine: str) -> None:
    def told(ops: Any, parameters: Any, carry: Any, x: Any) -> Any:
        first, second = x > 0.0, x < 1.0
        same, other = (ops.select(condition, 1.0, 0.0) for condition in (first == second, first != second))
        return carry, (same, other, first + 2.0 * second, True - first)

    rows = run_whole(
        choose(engine, 1, 1),
        lambda ops, parameters, x: (0.0,),
        told,
        (np.zeros(1),),
        np.array([-1.0, 0.5, 2.0]),
    )
    expected = [0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [2.0, 3.0, 1.0], [1.0, 0.0, 0.0]
    np.testing.assert_array_equal(np.squeeze(rows), expected)


def test_what_is_common_is_computed_once() -> None:
    trace = Trace()
    x, y = trace.input("x"), trace.input("y")
    first = x * y + trace.sqrt(x)
    count = len(trace.operations)
    assert (y * x + trace.sqrt(x)).number == first.number
    assert len(trace.operations) == count
    assert (x - y).number != (y - x).number


def test_constants_are_folded_and_nothing_else_is() -> None:
    trace = Trace()
    x, ops = trace.input("x"), trace
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


class Turns(NamedTuple):
    one: Any
    other: Any


def turns_loop(ops: Any, parameters: Any, carry: Any, inputs: Any) -> Any:
    """Two parts that step at their own ticks, the second seeing the first; each costs many operations."""
    (a, b), (turns, force) = carry, inputs
    x = a
    for k in range(20):
        x = ops.sqrt(x * x + k + force)
    a = ops.select(turns.one > 0.5, x, a)
    y = b + a
    for k in range(20):
        y = 1.0 / (y + a / (k + 1.0))
    b = ops.select(turns.other > 0.5, y, b)
    return (a, b), (a, b, parameters[0] * a)


def traced_turns() -> Any:
    return trace_loop(lambda ops, parameters, inputs: (1.0, 2.0), turns_loop, (0.0,), (Turns(0.0, 0.0), 0.0))


def test_guarded_blocks_hold_every_value_once_after_what_it_is_computed_from() -> None:
    loop = traced_turns()
    blocks = loop.guarded_blocks(loop.body, loop.inputs)
    order = [number for block in blocks for number in block.numbers]
    assert sorted(order) == loop.body
    computed = set(loop.prologue)
    for number in order:
        assert computed.issuperset(set(loop.trace.operations[number].arguments) - set(loop.prologue))
        computed.add(number)


def test_where_a_guard_does_not_hold_nothing_needs_what_it_guards() -> None:
    loop = traced_turns()
    guarded = {n: block.guard for block in loop.guarded_blocks(loop.body, loop.inputs) for n in block.numbers}
    assert len({guard for guard in guarded.values() if guard is not None}) == 2
    assert sum(guard is None for guard in guarded.values()) < 20 < len(guarded) - 20
    users = [(n, i) for n in loop.body for i in loop.trace.operations[n].arguments if i in guarded]
    for user, used in users:
        operation, guard = loop.trace.operations[user], guarded[used]
        chosen = operation.name == "select" and operation.arguments[:2] == (guard, used)
        assert guard is None or chosen or guarded[user] is not None
    assert not {*loop.next_carry, *loop.outputs} & {n for n, guard in guarded.items() if guard is not None}


def test_conditions_that_vehicles_do_not_share_guard_nothing() -> None:
    loop = traced_turns()
    assert [block.guard for block in loop.guarded_blocks(loop.body, loop.inputs[2:])] == [None]


@pytest.mark.parametrize("engine", ["floats", "compiled", pytest.param("jax", marks=pytest.mark.slow)])
@pytest.mark.parametrize("vehicles", [1, 9])
def test_guards_change_no_bit_of_a_loop(engine: str, vehicles: int) -> None:
    rng = np.random.default_rng(4)
    turns = Turns(*(rng.integers(0, 2, (2, 60)).astype(float)))
    inputs = turns, rng.uniform(size=(60, vehicles))
    functions = (lambda ops, parameters, inputs: (1.0, 2.0)), turns_loop
    parameters = (rng.uniform(size=vehicles),)
    expected = run_whole(choose("floats", 1, 1), *functions, parameters, inputs)
    found = run_whole(choose(engine, 1, 1), *functions, parameters, inputs)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0.0 if engine != "jax" else 1e-12)
