"""The built-in search on small programs of every kind: exact, ordered, bounded, the same when asked again."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import inf

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper_program import FLIP_ROLL, flip

from aerobat.errors import SpecError
from aerobat.programs import AssignmentProgram, AssignmentResult, SlottedStage, solver

numbers = st.integers(-3, 3).map(float)


def arrays(draw: st.DrawFn, *shape: int) -> np.ndarray:
    size = int(np.prod(shape))
    return np.array(draw(st.lists(numbers, min_size=size, max_size=size))).reshape(shape)


def interval(draw: st.DrawFn, *shape: int) -> tuple[np.ndarray, np.ndarray]:
    low = arrays(draw, *shape)
    high = low + np.abs(arrays(draw, *shape))
    open_low, open_high = arrays(draw, *shape) > 1, arrays(draw, *shape) > 1
    return np.where(open_low, -inf, low), np.where(open_high, inf, high)


@st.composite
def stages(draw: st.DrawFn, rows: int) -> SlottedStage:
    slots = draw(st.lists(st.integers(0, 4), min_size=1, max_size=4, unique=True))
    width = draw(st.integers(1, 2))
    used = draw(st.lists(st.integers(0, rows - 1), min_size=len(slots) * width, max_size=len(slots) * width))
    low, high = interval(draw, len(slots), width)
    return SlottedStage("any", tuple(slots), np.reshape(used, (len(slots), width)), low, high)


@st.composite
def programs(draw: st.DrawFn) -> AssignmentProgram:
    """Redundant and contradicting rows, zero rows, rows used twice, orders that cannot be met: all may occur."""
    n, p, m = draw(st.integers(1, 4)), draw(st.integers(0, 2)), draw(st.integers(1, 5))
    low, high = interval(draw, m)
    some = tuple(draw(st.lists(stages(m), max_size=3)))
    places = st.integers(0, max(len(some) - 1, 0))
    order = draw(st.lists(st.tuples(places, places), max_size=2)) if some else []
    root = arrays(draw, n, n)
    return AssignmentProgram(
        equality=arrays(draw, p, n),
        target=arrays(draw, p),
        rows=arrays(draw, m, n),
        lower=5.0 * low,
        upper=5.0 * high,
        stages=some,
        precedence=tuple(order),
        hessian=draw(st.sampled_from([None, root @ root.T + np.eye(n)])),
        gradient=draw(st.sampled_from([None, arrays(draw, n)])),
        constant=draw(numbers),
    )


def fixed(program: AssignmentProgram, slots: tuple[int, ...]) -> AssignmentProgram:
    """The program with every stage left one slot."""
    placed = []
    for stage, slot in zip(program.stages, slots, strict=True):
        i = [stage.index(slot)]
        placed.append(SlottedStage(stage.name, (slot,), stage.rows[i], stage.lower[i], stage.upper[i]))
    return program.with_bounds(stages=placed)


def assert_same(result: AssignmentResult, cost: float) -> None:
    assert result.status == ("infeasible" if cost == inf else "optimal")
    assert result.cost == pytest.approx(cost, rel=1e-6, abs=1e-6)


@given(programs())
@settings(max_examples=300)
def test_the_search_equals_the_enumeration_of_all_assignments(program: AssignmentProgram) -> None:
    every = product(*(stage.slots for stage in program.stages))
    costs = [solver().solve(fixed(program, slots)).cost for slots in every if program.admits(slots)]
    assert_same(solver().solve(program), min(costs, default=inf))


@given(programs())
@settings(max_examples=200)
def test_gurobi_agrees(program: AssignmentProgram) -> None:
    assert_same(solver().solve(program), solver("gurobi").solve(program).cost)
