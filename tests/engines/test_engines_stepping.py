"""However a loop is cut into scans and steps, kept, pickled or branched: the same bits, in every engine."""

import pickle
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.engines import ENGINE_NAMES, CompiledLoop, choose, logged_ticks
from aerobat.engines.engine import Coded, Held, expanded, first_row
from aerobat.engines.pytree import tree_leaves, tree_map
from suites import examples

FAST = ("floats", "compiled")  # to be ready
XLA = tuple(pytest.param(name, marks=pytest.mark.slow) for name in ENGINE_NAMES if name not in FAST)
VEHICLES, TICKS = 21, 1003


class Clock(NamedTuple):
    """Changes at few ticks."""

    elapsed: Any

    @property
    def piecewise_constant(self) -> bool:
        return True


class Inputs(NamedTuple):
    clock: Clock
    common: Any
    own: Any


class Row(NamedTuple):
    angle: Any
    beyond: Any


def init(ops: Any, stiffness: Any, inputs: Inputs) -> Any:
    return (0.0, ops.sqrt(stiffness) + inputs.common), False, 0.0


def step(ops: Any, stiffness: Any, carry: Any, inputs: Inputs) -> Any:
    (angle, speed), beyond, idle = carry
    force = ops.minimum(ops.maximum(-stiffness * angle, -2.0), 2.0) + inputs.common + inputs.own
    decay = ops.exp(-inputs.clock.elapsed / stiffness)
    speed = (speed + 0.01 * force) * decay
    angle = angle + 0.01 * ops.select((speed > 0.0) & (angle <= 3.0), speed, 0.9 * speed)
    row = Row(angle, ops.select(angle > 1.5, True, beyond))
    return ((angle, speed), row.beyond, idle + speed), row


def drawn(ticks: int = TICKS, vehicles: int = VEHICLES) -> Inputs:
    rng = np.random.default_rng(0)
    elapsed = np.where(np.arange(ticks) % 300 == 299, 0.0005, 0.001)
    return Inputs(Clock(elapsed), 9.0 * rng.normal(size=ticks), 9.0 * rng.normal(size=(ticks, vehicles)))


def loop_of(engine: str, inputs: Inputs) -> CompiledLoop:
    vehicles = inputs.own.shape[1]
    stiffness = np.random.default_rng(1).uniform(0.5, 2.0, vehicles)
    return choose(engine, vehicles, TICKS).compile(init, step, stiffness, first_row(inputs))


def part(inputs: Inputs, begin: int, end: int) -> Inputs:
    return tree_map(lambda leaf: leaf[begin:end], inputs)


def in_chunks(loop: CompiledLoop, inputs: Inputs, cuts: list[int]) -> tuple[Any, Row]:
    carry, rows = loop.init(first_row(inputs)), []
    for begin, end in pairwise(cuts):
        carry, row = loop.scan(carry, part(inputs, begin, end))
        rows.append(row)
    return carry, Row(*(np.concatenate(series, axis=-1) for series in zip(*rows, strict=True)))


def assert_same(a: Any, b: Any) -> None:
    for x, y in zip(tree_leaves(a), tree_leaves(b), strict=True):
        assert x.dtype == y.dtype
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("vehicles", [1, VEHICLES])
@pytest.mark.parametrize("engine", [*FAST, *XLA])
def test_one_scan_chunks_of_any_size_and_single_steps_give_the_same_bits(engine: str, vehicles: int) -> None:
    inputs = drawn(vehicles=vehicles)
    loop = loop_of(engine, inputs)
    whole = in_chunks(loop, inputs, [0, TICKS])
    assert whole[1].angle.shape == (vehicles, TICKS)
    for size in (7, 1000):
        assert_same(in_chunks(loop, inputs, [*range(0, TICKS, size), TICKS]), whole)
    carry = loop.init(first_row(inputs))
    for tick in range(60):
        carry, row = loop.step(carry, tree_map(lambda leaf, k=tick: leaf[k], inputs))
        assert_same(row, tree_map(lambda leaf, k=tick: leaf[:, k], whole[1]))


@examples(15)
@given(st.lists(st.integers(1, 199), max_size=5), st.sampled_from(FAST))
def test_any_cuts_give_the_same_bits(cuts: list[int], engine: str) -> None:
    inputs = drawn(200, 5)
    loop = loop_of(engine, inputs)
    assert_same(in_chunks(loop, inputs, [0, *sorted(set(cuts)), 200]), in_chunks(loop, inputs, [0, 200]))


@pytest.mark.parametrize("vehicles", [1, VEHICLES])
@pytest.mark.parametrize("engine", [*FAST, *XLA])
def test_held_inputs_give_the_bits_of_inputs_told_at_every_tick(engine: str, vehicles: int) -> None:
    """Where they change, how often, in which order, and how the ticks are cut: all the same."""
    rng = np.random.default_rng(2)
    common = Held(np.arange(200) // 7, 9.0 * rng.normal(size=29))
    own = Held(rng.integers(0, 17, 200), 9.0 * rng.normal(size=(17, vehicles)))
    inputs = Inputs(drawn(200).clock, common, own)
    plain = expanded(inputs)
    assert plain.own.shape == (200, vehicles)
    expected = in_chunks(loop_of(engine, plain), plain, [0, 200])
    stiffness = np.random.default_rng(1).uniform(0.5, 2.0, vehicles)
    loop = choose(engine, vehicles, TICKS).compile(init, step, stiffness, first_row(inputs))
    for cuts in ([0, 200], [0, 1, 60, 67, 200]):
        carry, rows = loop.init(first_row(inputs)), []
        for begin, end in pairwise(cuts):
            carry, row = loop.scan(carry, shown(inputs, begin, end))
            rows.append(row)
        together = Row(*(np.concatenate(series, axis=-1) for series in zip(*rows, strict=True)))
        assert_same((carry, together), expected)
    carry = loop.init(first_row(inputs))
    for tick in range(30):
        carry, row = loop.step(carry, first_row(shown(inputs, tick, tick + 1)))
        assert_same(row, tree_map(lambda leaf, k=tick: leaf[:, k], expected[1]))


def shown(inputs: Inputs, begin: int, end: int) -> Inputs:
    """Inputs of some ticks, all that was held before and will be after among the values."""
    clock, common, own = inputs
    held = (Held(each.row[begin:end], each.values) for each in (common, own))
    return Inputs(Clock(clock.elapsed[begin:end]), *held)


class Noisy(NamedTuple):
    every: Any
    seldom: Any


def begin_walk(ops: Any, stiffness: Any, inputs: Noisy) -> Any:
    return 0.0


def walk(ops: Any, stiffness: Any, total: Any, inputs: Noisy) -> Any:
    total = total + stiffness * inputs.every + inputs.seldom[0] * inputs.seldom[1]
    return total, total


@pytest.mark.parametrize("vehicles", [3, VEHICLES])
@pytest.mark.parametrize("engine", FAST)
def test_coded_inputs_give_the_bits_of_the_numbers_that_they_stand_for(engine: str, vehicles: int) -> None:
    """Told at every tick, and held, beside a number that is told as such."""
    rng = np.random.default_rng(3)
    table = rng.normal(size=2**16)
    every, seldom = (rng.integers(0, 2**16, (n, vehicles), dtype=np.uint16) for n in (200, 29))
    held = Held(np.arange(200) // 7, (Coded(seldom, table), rng.normal(size=(29, vehicles))))
    inputs = Noisy(Coded(every, table), held)
    plain = expanded(inputs)
    np.testing.assert_array_equal(plain.every, table[every])
    stiffness = rng.uniform(0.5, 2.0, vehicles)
    ends = []
    for told in (plain, inputs):
        loop = choose(engine, vehicles, TICKS).compile(begin_walk, walk, stiffness, first_row(told))
        start = loop.init(first_row(told))
        carry, row = loop.step(start, first_row(told))
        ends.append((carry, row, *loop.scan(start, told)))
    assert_same(*ends)


@pytest.mark.parametrize("engine", [*FAST, *XLA])
def test_a_pickled_carry_goes_on_in_another_loop_as_if_nothing_had_happened(engine: str) -> None:
    inputs = drawn(200)
    end, rows = in_chunks(loop_of(engine, inputs), inputs, [0, 200])
    carry, _ = in_chunks(loop_of(engine, inputs), inputs, [0, 90])
    resumed, rest = loop_of(engine, inputs).scan(pickle.loads(pickle.dumps(carry)), part(inputs, 90, 200))
    assert_same(resumed, end)
    assert_same(rest, tree_map(lambda leaf: leaf[:, 90:], rows))


@pytest.mark.parametrize("engine", [*FAST, *XLA])
def test_branches_of_a_carry_do_not_know_of_each_other(engine: str) -> None:
    inputs = drawn(200)
    loop = loop_of(engine, inputs)
    carry, _ = in_chunks(loop, inputs, [0, 90])
    assert not any(leaf.flags.writeable for leaf in tree_leaves(carry))
    kept = tree_map(np.copy, carry)
    rest = part(inputs, 90, 200)
    pushed = rest._replace(common=rest.common + 5.0)
    first, other = loop.scan(carry, rest), loop.scan(carry, pushed)
    assert np.abs(first[1].angle - other[1].angle).max() > 0.1
    assert_same(carry, kept)
    assert_same(loop.scan(carry, rest), first)


@pytest.mark.parametrize("engine", FAST)
def test_inputs_that_are_overwritten_after_a_scan_leave_its_carry_alone(engine: str) -> None:
    def remembering(ops: Any, stiffness: Any, inputs: Inputs) -> Any:
        return inputs.own

    def shift(ops: Any, stiffness: Any, carry: Any, inputs: Inputs) -> Any:
        return inputs.own, carry

    inputs = drawn(10)
    loop = choose(engine, VEHICLES, 10).compile(remembering, shift, np.ones(VEHICLES), first_row(inputs))
    carry, _ = loop.scan(loop.init(first_row(inputs)), inputs)
    last = inputs.own[-1].copy()
    inputs.own[...] = 0.0
    np.testing.assert_array_equal(carry, last)


@pytest.mark.parametrize("engine", [*FAST, *XLA])
@pytest.mark.parametrize("log_stride", [1, 2, 7, 199, 200, 1000])
def test_logged_are_the_first_tick_each_so_many_after_it_and_the_last(engine: str, log_stride: int) -> None:
    inputs = drawn(200, 3)
    loop = loop_of(engine, inputs)
    carry = loop.init(first_row(inputs))
    end, rows = loop.scan(carry, inputs)
    same_end, some = loop.scan(carry, inputs, log_stride)
    assert logged_ticks(200, log_stride).tolist() == sorted({*range(0, 200, log_stride), 199})
    assert_same(some, tree_map(lambda leaf: leaf[:, logged_ticks(200, log_stride)], rows))
    assert_same(same_end, end)


def test_the_carry_of_machine_code_leaves_out_what_no_row_depends_on() -> None:
    inputs = drawn(10)
    carry = loop_of("compiled", inputs).init(first_row(inputs))
    assert carry[2] == ()
    assert len(tree_leaves(carry)) == 3
