"""Stages placed in windows that move along: solutions of the whole program, with the gap that is left."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import product
from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.optimization import AssignmentProgram, SlottedStage, improved_in_windows, solver
from aerobat.optimization.moving_window import WIDTH, evenly_spread
from aerobat.planning.miqp import diagnosis
from aerobat.planning.miqp.miqp import formulate
from aerobat.planning.recorder import Attempt
from aerobat.planning.task import Task
from aerobat.reporting.facts import facts
from suites import examples

SLOTS = 6
POINTS = ((2.0, 1.0, 1.0), (4.0, -1.0, 2.0), (6.0, 1.0, 1.0), (4.0, 3.0, 0.5), (1.0, 3.0, 1.5))


def ordered_program(seed: int, stages: int) -> AssignmentProgram:
    """Ordered stages, each of which asks at least so much of one row of its slot's."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(stages * SLOTS, SLOTS + 2))
    kinds = tuple(
        SlottedStage(
            f"{i}",
            tuple(range(SLOTS)),
            np.arange(i * SLOTS, (i + 1) * SLOTS)[:, None],
            rng.uniform(0.5, 2.0, (SLOTS, 1)),
            inf,
        )
        for i in range(stages)
    )
    return AssignmentProgram(
        equality=np.zeros((0, SLOTS + 2)),
        target=np.zeros(0),
        rows=rows,
        lower=np.full(len(rows), -inf),
        upper=np.full(len(rows), inf),
        stages=kinds,
        precedence=tuple((i, i + 1) for i in range(stages - 1)),
    )


def least_cost(program: AssignmentProgram) -> float:
    """The cost of the best of all assignments, each solved by itself."""
    costs = [
        cost_of(program, slots)
        for slots in product(*(stage.slots for stage in program.stages))
        if program.is_assignment(slots)
    ]
    return min(costs, default=inf)


def cost_of(program: AssignmentProgram, slots: tuple[int, ...]) -> float:
    fixed = tuple(
        SlottedStage(stage.name, (slot,), *(part[[slot]] for part in (stage.rows, stage.lower, stage.upper)))
        for stage, slot in zip(program.stages, slots, strict=True)
    )
    return solver().solve(replace(program, stages=fixed)).cost


@examples(25)
@given(seed=st.integers(0, 10_000), stages=st.integers(1, 5))
def test_windows_end_between_the_optimum_and_what_they_begin_with(seed: int, stages: int) -> None:
    program = ordered_program(seed, stages)
    begun = solver().solve(program, node_limit=1)
    found = improved_in_windows(program, begun)
    best = least_cost(program)
    assert begun.bound <= best * (1 + 1e-9)
    assert best * (1 - 1e-9) <= found.cost <= begun.cost
    assert found.bound <= best * (1 + 1e-9)
    assert found.cost == pytest.approx(cost_of(program, found.slots or ()), rel=1e-9)
    if stages <= WIDTH:
        assert found.cost == pytest.approx(best, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_no_window_of_the_answer_can_be_placed_better(seed: int) -> None:
    program = ordered_program(seed, 5)
    found = improved_in_windows(program, solver().solve(program, node_limit=1))
    assert found.status in ("optimal", "locally optimal")
    slots = found.slots or ()
    for first in (0, 2):
        window = range(first, first + WIDTH)
        others = [
            (*slots[:first], *placed, *slots[first + WIDTH :])
            for placed in product(*(program.stages[i].slots for i in window))
        ]
        costs = [cost_of(program, each) for each in others if program.is_assignment(each)]
        assert min(costs) >= found.cost * (1 - 1e-8)


def test_a_proven_answer_and_one_without_an_order_stay_as_they_are() -> None:
    program = ordered_program(1, 4)
    proven = solver().solve(program)
    assert improved_in_windows(program, proven) is proven
    unordered = replace(program, precedence=())
    begun = solver().solve(unordered, node_limit=1)
    assert improved_in_windows(unordered, begun) is begun


@given(st.lists(st.sets(st.integers(0, 9), min_size=1), min_size=1, max_size=6))
def test_slots_are_spread_in_order_wherever_there_is_one(slots: list[set[int]]) -> None:
    stages = tuple(
        SlottedStage("any", tuple(sorted(own)), np.zeros((len(own), 1), dtype=int), -inf, inf)
        for own in slots
    )
    program = AssignmentProgram(np.zeros((0, 1)), np.zeros(0), np.ones((1, 1)), [-inf], [inf], stages)
    ordered = replace(program, precedence=tuple((i, i + 1) for i in range(len(slots) - 1)))
    spread = evenly_spread(ordered)
    possible = any(ordered.is_assignment(each) for each in product(*map(sorted, slots)))
    assert (spread is not None) == possible
    assert spread is None or ordered.is_assignment(spread)


def course() -> ab.Problem:
    goal = ab.at_rest((0.0, 0.0, 1.0))
    through = ab.Waypoints(tuple(ab.Waypoint(point) for point in POINTS))
    return ab.Problem(name="five", start=ab.at_rest((0.0, 0.0, 1.0)), goal=goal, maneuver=through)


def test_a_course_costs_a_fraction_of_what_a_short_search_of_the_whole_finds() -> None:
    program = formulate(Task.of(ab.load_problem("race-7")), 4, 28).program(9.0 / 28)
    short = solver().solve(program, node_limit=500)
    placed = improved_in_windows(program, short)
    assert placed.cost < 0.4 * short.cost
    assert placed.nodes - short.nodes < 2000


@pytest.mark.parametrize("intervals", [18, pytest.param(28, marks=pytest.mark.slow)])
def test_windows_place_seven_points_as_the_search_that_proves_it(intervals: int) -> None:
    program = formulate(Task.of(ab.load_problem("race-7")), 4, intervals).program(9.0 / intervals)
    placed = improved_in_windows(program, solver().solve(program, node_limit=50))
    proven = solver().solve(program, start=placed.slots)
    assert proven.status == "optimal"
    assert placed.cost == pytest.approx(proven.cost, rel=1e-9)


def test_where_searches_end_without_an_answer_no_plan_is_denied(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnosis, "_binding", lambda *_: iter(()))
    ended = Attempt(2.0, False, "unknown", "", None, 500, 1.0)
    formulation = formulate(Task.of(course()), 4, 24)
    said = diagnosis.why_infeasible(formulation, [ended, replace(ended, status="infeasible")])
    assert "1 of 2 programs" in said
    assert "exclude each other" not in said


def test_a_plan_placed_in_windows_states_its_gap() -> None:
    plan = ab.plan(course(), ab.Miqp(order=4, intervals=24), vehicle=None)
    assert plan.status in ("optimal", "locally optimal")
    assert plan.gap is not None
    assert plan.bound is not None
    assert plan.cost is not None
    assert plan.bound <= plan.cost
    assert plan.gap == pytest.approx(1.0 - plan.bound / plan.cost, abs=1e-9)
    said = {fact.label: fact.words for fact in facts(plan)}
    if plan.gap > 1e-6:
        assert any("% of the optimum" in str(each) for each in said.values())


def test_a_course_without_room_for_its_stages_is_refused_at_once_with_the_leg_and_what_frees_it() -> None:
    problem, vehicle = ab.load_problem("split-s-19"), ab.load_vehicle("agile-quad")
    with pytest.raises(
        ab.Infeasible, match=r"has no plan with 20 intervals: its 19 stages spread"
    ) as refused:
        ab.plan(problem, ab.Miqp(rescue=False), vehicle)
    assert len(refused.value.attempts) == 1
    leg = r"the leg from '(.*)' of lap 1 to '(.*)' of lap 1 has no path; with (\d+) intervals"
    said = re.search(leg, str(refused.value))
    assert said is not None
    names = [stage.name for stage in problem.stages(1.0).stages]
    assert names.index(said[2]) == names.index(said[1]) + 1
    for intervals, has_room in ((20, False), (int(said[3]), True)):
        formulation = formulate(Task.of(problem, vehicle), 5, intervals)
        assert (diagnosis.leg_without_room(formulation, 0.5) is None) == has_room
