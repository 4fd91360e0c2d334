"""Machine code: the same bits whatever flies beside, how many threads there are, and how wide a block is."""

import math
import os
from dataclasses import replace
from functools import partial
from typing import Any

import llvmlite.binding as llvm
import numpy as np
import pytest

from aerobat.engines import FLOATS, Engine, run_whole
from aerobat.engines.engine import available_cores
from aerobat.engines.llvm.codegen import module
from aerobat.engines.llvm.engine import ENGINE, MachineLoop, machine_code, target_machine
from aerobat.engines.llvm.packing import InputKind, Layout
from aerobat.engines.traced_loop import trace_loop
from aerobat.simulation import fly
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle
from looping_flights import loops, near

QUAD = load_vehicle("agile-quad")


def exponential(ops: Any, parameters: Any, carry: Any, row: Any) -> Any:
    return carry, ops.exp(parameters * row)


def nothing(ops: Any, parameters: Any, row: Any) -> tuple[()]:
    return ()


@pytest.mark.parametrize("vehicles", [1, 9])
def test_the_exponential_is_right_to_the_last_digits_over_all_its_range(vehicles: int) -> None:
    x = np.concatenate([np.linspace(-707, 708, 20_001), np.linspace(-2, 2, 20_001), [0.0, -1e-300]])
    answer = run_whole(ENGINE, nothing, exponential, np.linspace(0.5, 1.0, vehicles), x)
    wanted = np.exp(np.linspace(0.5, 1.0, vehicles)[:, None] * x)
    np.testing.assert_allclose(answer, wanted, rtol=5e-16)
    edges = np.array([-np.inf, -1e9, -709.0, 710.0, np.inf])
    assert run_whole(ENGINE, nothing, exponential, np.ones(vehicles), edges)[0].tolist() == [
        0.0, 0.0, 0.0, math.inf, math.inf
    ]  # fmt: skip
    assert np.isnan(run_whole(ENGINE, nothing, exponential, np.ones(vehicles), np.array([np.nan]))).all()


@pytest.fixture(scope="module")
def batch() -> Any:
    rng = np.random.default_rng(5)
    vehicles = [replace(QUAD, mass=QUAD.mass * rng.uniform(0.9, 1.1)) for _ in range(21)]
    return vehicles, near(21)


def test_a_flight_is_the_same_to_the_last_bit_in_any_batch(batch: Any) -> None:
    """Alone in plain registers, or in a lane of a vector; parameters shared or each vehicle's own."""
    vehicles, starts = batch
    together = fly(loops(2.0), vehicles, start=starts, engine="compiled")
    for k in (0, 7, 8, 20):
        alone = fly(
            loops(2.0),
            vehicles[k],
            start=replace(starts, **{name: values[k] for name, values in vars(starts).items()}),
            engine="compiled",
        )
        np.testing.assert_array_equal(together[k].states.position, alone.states.position)
        np.testing.assert_array_equal(together[k].thrusts, alone.thrusts)


def random_walk(ops: Any, pull: Any, carry: Any, row: Any) -> Any:
    carry = carry - pull * ops.maximum(carry, -carry) * carry + row / (1.0 + ops.exp(-carry))
    return carry, (carry, carry > 0.0)


def begin(ops: Any, pull: Any, row: Any) -> Any:
    return 0.0 * pull


@pytest.mark.parametrize("threads", [1, 2, 3, 7, 50])
def test_threads_change_nothing(threads: int) -> None:
    rng = np.random.default_rng(0)
    pull, push = rng.uniform(0.1, 0.5, 100), rng.normal(size=(300, 100))
    one, many = (
        run_whole(Engine("", partial(MachineLoop, threads=count)), begin, random_walk, pull, push)
        for count in (1, threads)
    )
    np.testing.assert_array_equal(one[0], many[0])
    np.testing.assert_array_equal(one[1], many[1])
    assert one[1].dtype == bool
    oracle = run_whole(FLOATS, begin, random_walk, pull, push)
    np.testing.assert_allclose(one[0], oracle[0], rtol=0, atol=1e-12)


def test_a_second_flight_of_the_same_kind_is_not_compiled_again() -> None:
    still = Trajectory(np.array([1.0]), np.zeros((1, 1, 3)))
    fly(still, QUAD, engine="compiled")
    before = machine_code.cache_info().misses
    fly(still, replace(QUAD, mass=0.9 * QUAD.mass), engine="compiled")
    assert machine_code.cache_info().misses == before


@pytest.mark.parametrize("width", [1, 8])
def test_no_multiplication_is_fused_with_an_addition(width: int) -> None:
    """Fusing rounds once where the kernel rounds twice, and not on all machines."""
    loop = trace_loop(begin, random_walk, np.ones(3), np.ones(3))
    text = module(
        loop,
        Layout(
            width, shared_parameters=(False,), inputs=(InputKind(shared=False),), piecewise_constant=(False,)
        ),
    )
    assembly = target_machine().emit_assembly(llvm.parse_assembly(text))
    assert "mul" in assembly
    assert "fmadd" not in assembly
    assert "fma" not in assembly


def test_processors_are_counted_where_the_system_does_not_say_which_may_be_used(monkeypatch) -> None:
    """As on macOS and Windows."""
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert available_cores() == (os.cpu_count() or 1)
