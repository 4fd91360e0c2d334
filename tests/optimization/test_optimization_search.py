"""The built-in search on small programs of every kind: exact, ordered, bounded, the same every time."""

from __future__ import annotations

from dataclasses import replace
from itertools import count, product
from math import inf
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.optimization import AssignmentProgram, AssignmentResult, SlottedStage, deadline, solver
from aerobat.optimization.branch_and_bound.candidates import Candidates
from aerobat.optimization.branch_and_bound.dual_ascent import DualDirections, dual_ascent
from aerobat.optimization.branch_and_bound.least_distance import LeastDistanceQP, NotConverged, QPSolution
from aerobat.optimization.branch_and_bound.lower_bounds import DualBounds
from aerobat.optimization.branch_and_bound.null_space import NullSpace, split_coupled
from paper_program import FLIP_ROLL, flip
from suites import examples

numbers = st.integers(-3, 3).map(float)


def arrays(draw: st.DrawFn, *shape: int) -> np.ndarray:
    size = int(np.prod(shape))
    return np.array(draw(st.lists(numbers, min_size=size, max_size=size))).reshape(shape)


def interval(draw: st.DrawFn, *shape: int) -> tuple[np.ndarray, np.ndarray]:
    low = arrays(draw, *shape)
    high = low + np.abs(arrays(draw, *shape))
    open_low, open_high = arrays(draw, *shape) > 0, arrays(draw, *shape) > 0
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
    """Redundant and contradicting rows, zero rows, rows used twice, orders that cannot be met."""
    n, p, m = draw(st.integers(1, 5)), draw(st.integers(0, 2)), draw(st.integers(1, 6))
    low, high = interval(draw, m)
    some = tuple(draw(st.lists(stages(m), max_size=3)))
    places = st.integers(0, max(len(some) - 1, 0))
    order = draw(st.lists(st.tuples(places, places), max_size=2)) if some else []
    return AssignmentProgram(
        equality=arrays(draw, p, n),
        target=arrays(draw, p),
        rows=arrays(draw, m, n),
        lower=5.0 * low - 5.0,
        upper=5.0 * high + 5.0,
        stages=some,
        precedence=tuple(order),
    )


def fixed(program: AssignmentProgram, slots: tuple[int, ...]) -> AssignmentProgram:
    """The program with every stage left one slot."""
    placed = []
    for stage, slot in zip(program.stages, slots, strict=True):
        i = [stage.index(slot)]
        placed.append(SlottedStage(stage.name, (slot,), stage.rows[i], stage.lower[i], stage.upper[i]))
    return replace(program, stages=tuple(placed))


def enumerated(program: AssignmentProgram) -> float:
    every = product(*(stage.slots for stage in program.stages))
    costs = [solver().solve(fixed(program, slots)).cost for slots in every if program.is_assignment(slots)]
    return min(costs, default=inf)


def assert_same(result: AssignmentResult, cost: float) -> None:
    assert result.status == ("infeasible" if cost == inf else "optimal")
    assert result.cost == pytest.approx(cost, rel=1e-6, abs=1e-6)


def deep_program(seed: int, kinds: int = 3) -> AssignmentProgram:
    """Stages of five slots that compete for few variables: many nodes."""
    rng = np.random.default_rng(seed)
    n, slots = 6, 5
    rows = rng.normal(size=(n + slots * kinds, n))
    rows[:n] = np.eye(n)
    low = np.full(len(rows), -inf)
    high = np.full(len(rows), inf)
    low[:n], high[:n] = -4.0, 4.0
    placed = []
    for kind in range(kinds):
        own = n + slots * kind + np.arange(slots)
        desired = rng.uniform(0.5, 4.0, slots)
        used = np.stack([own, rng.permutation(own)], axis=1)
        lower = np.stack([desired, np.full(slots, -6.0)], axis=1)
        upper = np.stack([np.where(rng.random(slots) < 0.5, desired, inf), np.full(slots, 1.0)], axis=1)
        placed.append(SlottedStage(str(kind), tuple(range(slots)), used, lower, upper))
    order = ((0, 1),) if rng.random() < 0.5 else ()
    equality, target = rng.normal(size=(1, n)), rng.normal(size=1)
    return AssignmentProgram(equality, target, rows, low, high, tuple(placed), order)


@given(programs())
@examples(200)
def test_the_search_equals_the_enumeration_of_all_assignments(program: AssignmentProgram) -> None:
    assert_same(solver().solve(program), enumerated(program))


@pytest.mark.parametrize("seed", range(20))
def test_a_deep_search_equals_the_enumeration_of_all_assignments(seed: int) -> None:
    program = deep_program(seed)
    result = solver().solve(program)
    assert_same(result, enumerated(program))
    assert result.nodes < 60  # of the hundred assignments, more or less, and their relaxations


@pytest.mark.parametrize("seed", range(20))
def test_gurobi_agrees_on_a_deeper_search(seed: int) -> None:
    program = deep_program(seed, kinds=5)
    assert_same(solver().solve(program), solver("gurobi").solve(program).cost)


@given(programs())
@examples(100)
def test_gurobi_agrees(program: AssignmentProgram) -> None:
    assert_same(solver().solve(program), solver("gurobi").solve(program).cost)


@given(programs(), st.integers(0, 2**32 - 1))
@examples(100)
def test_the_units_of_the_rows_do_not_matter(program: AssignmentProgram, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, equality = (10.0 ** rng.uniform(-3, 3, len(m)) for m in (program.rows, program.equality))
    scaled = replace(
        program,
        rows=rows[:, None] * program.rows,
        lower=rows * program.lower,
        upper=rows * program.upper,
        equality=equality[:, None] * program.equality,
        target=equality * program.target,
        stages=tuple(
            replace(s, lower=rows[s.rows] * s.lower, upper=rows[s.rows] * s.upper) for s in program.stages
        ),
    )
    assert_same(solver().solve(scaled), solver().solve(program).cost)


def enlarged(program: AssignmentProgram, factor: float) -> AssignmentProgram:
    """The program whose solution is `factor` times as large."""
    return replace(
        program,
        lower=factor * program.lower,
        upper=factor * program.upper,
        target=factor * program.target,
        stages=tuple(replace(s, lower=factor * s.lower, upper=factor * s.upper) for s in program.stages),
    )


@given(programs(), st.floats(-8, 8))
@examples(100)
def test_the_units_of_the_variables_do_not_matter(program: AssignmentProgram, exponent: float) -> None:
    factor = 10.0**exponent
    result = solver().solve(enlarged(program, factor))
    assert_same(replace(result, cost=result.cost / factor**2), solver().solve(program).cost)


@pytest.mark.parametrize("backend", ["builtin", "gurobi", "scip"])
@pytest.mark.parametrize("factor", [1e-9, 1e6])
def test_the_units_of_a_flip_do_not_matter(backend: str, factor: float) -> None:
    short = flip(replace(FLIP_ROLL, ordered=True), intervals=9, dt=0.3)
    result, usual = solver(backend).solve(enlarged(short, factor)), solver().solve(short)
    assert (result.status, result.slots) == ("optimal", usual.slots)
    assert result.cost / factor**2 == pytest.approx(usual.cost, rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_no_completion_costs_less_than_the_lower_bounds_of_its_candidates(seed: int) -> None:
    """Where the search does not look there is nothing to find."""
    program = deep_program(seed)
    block, _ = split_coupled(program, np.concatenate([stage.rows.ravel() for stage in program.stages]))
    null_space = NullSpace(program, block, np.zeros(len(program.rows), dtype=bool))
    root = null_space.bounds(program, program.lower, program.upper).in_units(1.0)
    candidates, qp = Candidates(program, null_space), LeastDistanceQP(null_space.rows)
    dual_bounds = DualBounds(candidates, null_space.rows)
    bounds = candidates.bounds(program, null_space, root).in_units(1.0)
    rng, lower, upper = np.random.default_rng(seed), root.lower, root.upper
    for p in rng.permutation(15)[:3]:
        solution = qp.solve(lower, upper)
        if solution is None:
            return
        single, steps = dual_bounds.single_bounds(solution, bounds, dual_bounds.root_bounds(bounds))
        pairs = dual_bounds.pairwise_bounds(solution, single, steps, np.arange(15))
        assert (single.value >= solution.value).all()
        for q in range(15):
            own = tightened(lower, upper, candidates.rows[:, q], bounds.lower[:, q], bounds.upper[:, q])
            exact = qp.solve(*own)
            assert exact is None or single.value[q] <= exact.value * (1 + 1e-9)
            for other in np.flatnonzero(candidates.compatible[q]):
                rows, low, high = (of[:, other] for of in (candidates.rows, bounds.lower, bounds.upper))
                both = qp.solve(*tightened(*own, rows, low, high))
                assert both is None or pairs[q, other] <= both.value * (1 + 1e-9)
        assert np.isinf(pairs[~candidates.compatible]).all()
        lower, upper = tightened(lower, upper, candidates.rows[:, p], bounds.lower[:, p], bounds.upper[:, p])


@given(st.lists(st.floats(0.1, 10.0), min_size=2, max_size=6), st.floats(0.1, 1e3))
def test_multipliers_that_vanish_together_end_no_ascent_and_none_changes_its_sign(
    multipliers: list[float], slope: float
) -> None:
    """Orthonormal active rows, and a candidate along whose direction all of them vanish at a step of 1."""
    equalities = np.zeros(len(multipliers), dtype=bool)
    for sign in (1.0, -1.0):
        start = sign * np.array(multipliers)
        directions = DualDirections(start[:, None], np.array([slope + 1.0]), np.array([1.0]))
        result, steps, _ = dual_ascent(np.eye(len(start)), start, equalities, directions)
        assert (sign * result >= 0.0).all()
        assert steps[0] > 1.0  # beyond the tie


def tightened(
    lower: np.ndarray, upper: np.ndarray, rows: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = lower.copy(), upper.copy()
    np.maximum.at(lower, rows, low)
    np.minimum.at(upper, rows, high)
    return lower, upper


def test_an_ordered_flip_is_in_order_and_costs_no_less() -> None:
    ordered, free = (solver().solve(flip(replace(FLIP_ROLL, ordered=o))) for o in (True, False))
    assert ordered.slots is not None
    assert list(ordered.slots) == sorted(ordered.slots)
    assert ordered.cost >= free.cost


def test_a_series_of_programs_with_the_same_matrices_is_solved_as_if_each_were_alone() -> None:
    series, kept = flip(FLIP_ROLL), solver()
    for scale in (1.0, 0.9, 1.1, 0.2, 1.0):
        series = replace(series, lower=scale * flip(FLIP_ROLL).lower, upper=scale * flip(FLIP_ROLL).upper)
        together, alone = kept.solve(series), solver().solve(series)
        assert (together.status, together.slots, together.nodes) == (alone.status, alone.slots, alone.nodes)
        assert together.cost == alone.cost


def test_a_kept_solver_notices_another_order_of_the_same_stages() -> None:
    program, kept = flip(FLIP_ROLL), solver()
    ordered = replace(program, precedence=tuple((i, i + 1) for i in range(4)))
    assert ordered.rows is program.rows
    kept.solve(program)
    result, alone = kept.solve(ordered), solver().solve(ordered)
    assert (result.slots, result.cost) == (alone.slots, alone.cost)


def test_the_same_program_has_the_same_answer_twice() -> None:
    first, second = (solver().solve(flip(FLIP_ROLL)) for _ in range(2))
    assert np.array_equal(first.x, second.x)
    assert first.nodes == second.nodes


@pytest.mark.parametrize("backend", ["builtin", "gurobi", "scip"])
def test_without_any_time_nothing_is_claimed(backend: str) -> None:
    with deadline.within_time(0.0):
        result = solver(backend).solve(flip(FLIP_ROLL))
    assert (result.status, result.x, result.gap) == ("unknown", None, inf)
    assert result.bound <= 273196.13


def test_without_time_a_start_is_still_a_solution_with_its_gap() -> None:
    start, best = (7, 6, 10, 13, 5), 273196.1243
    with deadline.within_time(0.0):
        result = solver().solve(flip(FLIP_ROLL), start=start)
    assert (result.status, result.slots) == ("time_limit", start)
    assert result.bound <= best <= result.cost
    assert result.gap == pytest.approx((result.cost - result.bound) / result.cost)


@pytest.mark.parametrize("ticks", range(1, 40, 3))
def test_when_time_runs_out_the_optimum_is_between_bound_and_cost(
    ticks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = count()
    monkeypatch.setattr(deadline, "clock", lambda: float(next(clock)))
    with deadline.within_time(ticks):
        result = solver().solve(flip(FLIP_ROLL))
    assert result.bound * (1 - 1e-9) <= 273196.1243 <= result.cost * (1 + 1e-9)
    assert result.status in ({"optimal"} if result.gap < 1e-9 else {"time_limit", "unknown"})
    assert (result.x is not None) == (ticks > 6)  # one dive down four stages


@pytest.mark.parametrize("nodes", [1, 4, 16, 64])
@pytest.mark.parametrize("seed", range(4))
def test_a_search_of_so_many_nodes_ends_there_and_the_optimum_is_between_bound_and_cost(
    nodes: int, seed: int
) -> None:
    program = deep_program(seed)
    exact, limited = solver().solve(program), solver().solve(program, node_limit=nodes)
    assert limited.nodes <= nodes
    assert limited.bound <= exact.cost * (1 + 1e-9)
    assert limited.cost >= exact.cost * (1 - 1e-9)
    assert limited.status in (("optimal",) if exact.nodes <= nodes else ("time_limit", "unknown", "optimal"))


def test_relaxations_that_fail_use_a_limit_up(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, solve = count(), LeastDistanceQP.solve

    def faulty(*arguments: Any, **options: Any) -> QPSolution | None:
        if next(calls):
            raise NotConverged
        return solve(*arguments, **options)

    monkeypatch.setattr(LeastDistanceQP, "solve", faulty)
    result = solver().solve(deep_program(8), node_limit=60)
    assert result.status == "unknown"
    assert result.nodes < 10


@pytest.mark.parametrize("backend", ["builtin", "gurobi"])
@pytest.mark.parametrize(
    "start", [(5, 6, 10, 13, 7), (1, 2, 10, 3, 4), (5, 5, 10, 5, 5), (99, 99, 99, 99, 99)]
)
def test_a_start_good_or_bad_does_not_change_the_answer(start: tuple[int, ...], backend: str) -> None:
    result = solver(backend).solve(flip(FLIP_ROLL), start=start)
    assert result.status == "optimal"
    assert result.cost == pytest.approx(273196.1243, rel=1e-9)


@pytest.mark.parametrize("failing", range(12))
def test_a_relaxation_that_cannot_be_solved_leaves_a_gap_and_no_false_claim(
    failing: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, solve, program = count(), LeastDistanceQP.solve, deep_program(8)
    cost = solver().solve(program).cost

    def faulty(*arguments: Any, **options: Any) -> QPSolution | None:
        if next(calls) == failing:
            raise NotConverged
        return solve(*arguments, **options)

    monkeypatch.setattr(LeastDistanceQP, "solve", faulty)
    result = solver().solve(program)
    assert result.bound <= cost * (1 + 1e-9)
    assert result.cost >= cost * (1 - 1e-9)
    if result.status == "optimal":
        assert result.cost == pytest.approx(cost)
    else:
        assert result.status in ("time_limit", "unknown")


@given(st.integers(0, 2**32 - 1), st.floats(-2.0, 4.0), st.floats(-16.0, -8.0))
def test_equalities_that_follow_from_others_change_nothing_and_contradictions_are_found(
    seed: int, magnitude: float, rounding: float
) -> None:
    """More equalities than variables: the point of least norm on the independent ones, or none.

    By however much rounding has them differ, and in whatever units.
    """
    rng = np.random.default_rng(seed)
    own = np.linalg.qr(rng.normal(size=(5, 3)))[0].T
    rows = np.vstack([own, rng.normal(size=(4, 3)) @ own])
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    target = rows @ rng.normal(size=5)
    scale = 10.0**magnitude / np.abs(target).max()
    noise = 10.0**rounding * rng.uniform(-1.0, 1.0, size=7) * np.abs(target).max()
    seen = scale * (target + noise)
    found = LeastDistanceQP(rows).solve(seen, seen)
    assert found is not None
    np.testing.assert_allclose(found.y, np.linalg.lstsq(rows, seen)[0], atol=1e-6 * 10.0**magnitude)
    off = seen + 1e-4 * 10.0**magnitude * (np.arange(7) == 6)
    assert LeastDistanceQP(rows).solve(off, off) is None


@pytest.mark.parametrize("failures", [1, 2, 3])
def test_a_relaxation_that_fails_is_tried_cold_and_then_with_care(
    failures: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = np.array([[1.0, 0.0], [0.6, 0.8]])
    lower, upper = np.array([1.0, -5.0]), np.array([2.0, -0.5])
    exact = LeastDistanceQP(rows).solve(lower, upper)
    assert exact is not None
    calls, run = count(), LeastDistanceQP._run

    def faulty(*arguments: Any) -> tuple[np.ndarray, int, np.ndarray]:
        y, flag, multipliers = run(*arguments)
        return y, -2 if next(calls) < failures else flag, multipliers

    monkeypatch.setattr(LeastDistanceQP, "_run", faulty)
    if failures == 3:
        with pytest.raises(NotConverged):
            LeastDistanceQP(rows).solve(lower, upper, warm_start=exact)
    else:
        again = LeastDistanceQP(rows).solve(lower, upper, warm_start=exact)
        assert again is not None
        np.testing.assert_allclose(again.y, exact.y, atol=1e-12)
