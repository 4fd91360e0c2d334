"""Sequences cut in two at one stage's slot: exact, bounded at any price, cheap where three gates are free."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.optimization import AssignmentProgram, AssignmentResult, LinearDynamics, SlottedStage, solver
from aerobat.optimization.branch_and_bound import solver as builtin
from aerobat.optimization.branch_and_bound.direct_search import DirectSearch
from aerobat.optimization.branch_and_bound.search import SearchLimits
from aerobat.optimization.branch_and_bound.time_decomposition import cut_stage
from aerobat.optimization.branch_and_bound.time_decomposition import search as time_decomposition
from aerobat.optimization.branch_and_bound.time_decomposition.cut import Cut, Timeline
from aerobat.optimization.branch_and_bound.time_decomposition.joint import JointQP
from aerobat.planning.miqp.integrator import IntegratorChain
from growth_with_stages import flips
from suites import examples

NO_LIMITS = SearchLimits()
seeds = st.integers(0, 10**6)


def chain_program(seed: int, anchors: int = 3, order: int = 3, slots: int = 12) -> AssignmentProgram:
    """One axis of a chain from rest at 0 through points whose slots are free, in order, to rest.

    Between the points the acceleration is bounded once, and on all intervals the input and the velocity.
    """
    rng = np.random.default_rng(seed)
    chain = IntegratorChain(order, slots)
    rows = np.concatenate([*(chain.forced[:, d] for d in range(order)), np.eye(slots)])
    bound = np.concatenate([np.full(slots, limit) for limit in (inf, rng.uniform(0.4, 1.0), inf)])
    bound = np.concatenate([bound, np.full((order - 3) * slots, inf), np.full(slots, rng.uniform(0.5, 2.0))])
    stages = []
    for i in range(anchors):
        point = rng.uniform(-1.0, 1.0)
        stages.append(
            SlottedStage(f"point {i}", tuple(range(slots - 1)), np.arange(slots - 1)[:, None], point, point)
        )
        if i < anchors - 1:
            places = 2 * slots + np.arange(slots - 1)
            low = rng.uniform(-0.1, 0.1)
            stages.append(SlottedStage(f"turn {i}", tuple(range(slots - 1)), places[:, None], low, inf))
    return AssignmentProgram(
        equality=chain.forced[-1],
        target=np.zeros(order),
        rows=rows,
        lower=-bound,
        upper=bound,
        stages=tuple(stages),
        precedence=tuple((i, i + 1) for i in range(len(stages) - 1)),
        constant=0.5,
        dynamics=LinearDynamics(chain.transition, chain.gain[:, None], np.arange(slots)[:, None]),
    )


@pytest.mark.parametrize("order", [3, 4, 5])
def test_the_states_of_the_dynamics_are_those_of_the_chain(order: int) -> None:
    chain = IntegratorChain(order, 9)
    dynamics = LinearDynamics(chain.transition, chain.gain[:, None], np.arange(9)[:, None])
    for slot in range(9):
        np.testing.assert_allclose(dynamics.state(slot), chain.forced[slot, :, : slot + 1], rtol=1e-12)


@examples(30)
@given(seeds, st.sampled_from([3, 4]), st.sampled_from([3, 5]), st.sampled_from([0, 500]))
def test_cut_or_whole_the_optimum_is_the_same(seed: int, anchors: int, order: int, pairs: int) -> None:
    """Slots finished by lists of pairs, and those searched as a whole because there are too many."""
    program = chain_program(seed, anchors, order)
    assert cut_stage(program) is not None
    whole = DirectSearch().claim(program, NO_LIMITS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(time_decomposition, "MAX_PAIRS", pairs)
        cut = solve_cut(program)
    assert cut.status == ("infeasible" if whole.slots is None else "optimal")
    if whole.x is not None:
        assert cut.cost == pytest.approx(program.cost(whole.x), rel=1e-7)
        assert cut.gap < 1e-8


@examples(20)
@given(seeds, st.integers(20, 80))
def test_a_cut_search_that_is_ended_early_bounds_the_optimum_from_both_sides(seed: int, nodes: int) -> None:
    program = chain_program(seed)
    whole = DirectSearch().claim(program, NO_LIMITS)
    ended = solve_cut(program, node_limit=nodes)
    assert ended.bound <= whole.bound * (1.0 + 1e-9)
    assert ended.cost >= whole.bound * (1.0 - 1e-9)


@examples(20)
@given(seeds, st.integers(3, 8), st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_at_any_price_the_halves_minima_add_up_to_no_more_than_the_optimum(
    seed: int, slot: int, costate: list[float]
) -> None:
    program = chain_program(seed)
    cut, optimum = halves(program, slot)
    price = cut.price(np.array(costate))
    before, behind = (half.minimum(price, NO_LIMITS) for half in (cut.before, cut.behind))
    assert before.bound + behind.bound <= optimum * (1.0 + 1e-7)


@examples(20)
@given(seeds, st.integers(3, 8))
def test_at_its_optimal_price_a_solution_is_what_its_halves_prefer_with_their_stages_held(
    seed: int, slot: int
) -> None:
    """Strong duality, of the QP that is left."""
    program = at_slot(chain_program(seed), slot)
    whole = DirectSearch().claim(program, NO_LIMITS)
    if whole.slots is None:
        return
    joint = JointQP(program, 1.0).solve(whole.slots, inf)
    assert joint is not None
    cut = Cut(timeline(held(program, whole.slots)), 2, slot)
    price = cut.optimal_price(joint.x, joint.multipliers)
    before, behind = (half.minimum(price, NO_LIMITS) for half in (cut.before, cut.behind))
    assert before.bound + behind.bound == pytest.approx(joint.cost, rel=1e-7)
    assert before.minimum is not None
    assert behind.minimum is not None
    np.testing.assert_allclose(before.minimum.state, behind.minimum.state, atol=1e-6)
    np.testing.assert_allclose(cut.price(cut.costate(price)), price, atol=1e-9 * np.abs(price).max())


@examples(20)
@given(seeds, st.floats(1.0, 1.5))
def test_all_assignments_below_a_cutoff_are_listed_and_no_others(seed: int, factor: float) -> None:
    program = chain_program(seed, slots=9)
    costs = {slots: cost for slots, cost in all_costs(program).items() if cost < inf}
    if not costs:
        return
    cutoff = factor * min(costs.values()) + 1e-6
    listed = DirectSearch().below(program, NO_LIMITS, cutoff)
    assert listed.are_all
    assert len(listed.found) == len({slots for _, slots in listed.found})
    assert {slots for _, slots in listed.found} == {slots for slots, cost in costs.items() if cost < cutoff}
    for cost, slots in listed.found:
        assert cost == pytest.approx(costs[slots], rel=1e-7)
    assert not DirectSearch().below(program, SearchLimits(nodes=1), cutoff).are_all


@examples(20)
@given(seeds, st.floats(0.5, 1.5))
def test_with_a_cutoff_only_what_is_cheaper_is_found_and_the_bound_is_no_higher(
    seed: int, factor: float
) -> None:
    program = chain_program(seed, slots=9)
    optimum = min(all_costs(program).values())
    if optimum == inf:
        return
    answer = DirectSearch().claim(program, NO_LIMITS, cutoff=factor * optimum)
    assert (answer.x is not None) == (factor > 1.0)
    assert answer.bound == pytest.approx(min(factor, 1.0) * optimum, rel=1e-7)


def test_rows_that_see_more_of_the_past_than_the_state_and_stages_that_reach_ahead_are_refused() -> None:
    program = chain_program(1)
    rows = program.rows.copy()
    rows[10, 0] += 0.1
    with pytest.raises(SpecError, match="through the state alone"):
        _ = Cut(timeline(replace(program, rows=rows)), 2, 5).behind
    ahead = replace(program.stages[0], rows=program.stages[0].rows[::-1])
    with pytest.raises(SpecError, match="last input is that of its slot"):
        _ = Cut(timeline(program.with_bounds(stages=(ahead, *program.stages[1:]))), 2, 5).before


def test_sequences_without_dynamics_without_an_order_or_of_few_anchors_are_searched_whole() -> None:
    program = chain_program(1)
    assert cut_stage(program) == 2
    assert cut_stage(replace(program, dynamics=None)) is None
    assert cut_stage(replace(program, precedence=())) is None
    assert cut_stage(replace(program, hessian=np.eye(program.num_variables))) is None
    assert cut_stage(chain_program(1, anchors=2)) is None


@pytest.mark.slow
def test_three_flips_through_three_free_gates_are_proven_with_a_tenth_of_the_relaxations_of_the_whole() -> (
    None
):
    """The whole search takes 34572, and ten times as long."""
    result = solver().solve(flips(gates=3, intervals=60, duration=6.0))
    assert result.status == "optimal"
    assert result.slots == (13, 16, 19, 29, 35, 36, 38, 41, 44, 46, 47, 57)
    assert result.cost == pytest.approx(0.0866577708, rel=1e-8)
    assert result.nodes < 10000


def solve_cut(program: AssignmentProgram, node_limit: int | None = None) -> AssignmentResult:
    """Solve a program that is cut at once when something is found."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(builtin, "DIRECT_NODES", 6)
        patch.setattr(builtin, "MIN_NODES", 0)
        return solver().solve(program, node_limit=node_limit)


def timeline(program: AssignmentProgram) -> Timeline:
    assert program.dynamics is not None
    return Timeline(program, program.dynamics)


def halves(program: AssignmentProgram, slot: int) -> tuple[Cut, float]:
    """The program cut at its third stage in a slot, and its optimum with that stage there, constant aside."""
    fixed = at_slot(program, slot)
    optimum = DirectSearch().claim(fixed, NO_LIMITS).bound - program.constant
    return Cut(timeline(program), 2, slot), optimum


def at_slot(program: AssignmentProgram, slot: int) -> AssignmentProgram:
    stages = list(program.stages)
    stages[2] = stages[2].restricted([stages[2].index(slot)])
    return program.with_bounds(stages=stages)


def held(program: AssignmentProgram, slots: Sequence[int]) -> AssignmentProgram:
    stages = [
        stage.restricted([stage.index(slot)]) for stage, slot in zip(program.stages, slots, strict=True)
    ]
    return program.with_bounds(stages=stages)


def all_costs(program: AssignmentProgram) -> dict[tuple[int, ...], float]:
    """The optimum of every assignment; infinite where there is none."""
    qp = JointQP(program, 1.0)
    costs = {}
    for slots in combinations(range(8), len(program.stages)):
        joint = qp.solve(slots, 1e9)
        costs[slots] = inf if joint is None else joint.cost + program.constant
    return costs
