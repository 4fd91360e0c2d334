"""What else may find a plan where the intervals and the order asked for find none, or a poor one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING

from aerobat.errors import BackendMissing, Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.miqp.attempts import default_order
from aerobat.planning.miqp.integrator import INPUT_NAMES, MAX_INTERVALS
from aerobat.planning.planners import Planner
from aerobat.planning.recorder import Recorder
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

if TYPE_CHECKING:
    from aerobat.planning.miqp.miqp import Miqp

MORE_INTERVALS = (1.3, 2.0)  # times as many
A_STAGE = 2  # intervals at least: fewer leave the path of a course no choice
MANY_INTERVALS = 40  # where that is more still: a narrow window at an end needs intervals on either side


def rescued_plan(asked: Miqp, problem: Problem, vehicle: Vehicle, recorder: Recorder) -> Plan | None:
    """The first plan that another setting or planner finds, which says so; None where all fail.

    Args:
        asked: The planner that found none.
        problem: What is planned.
        vehicle: What shall fly it.
        recorder: The attempts so far; those that follow are passed on to its `progress`.
    """
    others = _alternatives(asked, problem, vehicle)
    return _first(others, problem, vehicle, recorder, f"miqp found none with {asked.intervals} intervals")


def shortened_plan(asked: Miqp, problem: Problem, vehicle: Vehicle, plan: Plan, recorder: Recorder) -> Plan:
    """A shorter plan on more intervals, which says so, else the plan: it is a program's own answer.

    Args:
        asked: The planner that refined no path.
        problem: What is planned.
        vehicle: What shall fly it.
        plan: Its plan.
        recorder: The attempts so far; those that follow are passed on to its `progress`.
    """
    others = with_more_intervals(asked, problem, vehicle)
    failed = f"no path of miqp with {asked.intervals} intervals settled"
    shorter = _first(others, problem, vehicle, recorder, failed, plan.duration)
    return plan if shorter is None else shorter


def _first(
    others: Iterator[tuple[Planner, str]],
    problem: Problem,
    vehicle: Vehicle,
    recorder: Recorder,
    failed: str,
    shorter_than: float = inf,
) -> Plan | None:
    """The first certified plan of some planners, which says what failed; None where none is short enough."""
    for planner, how in others:
        if out_of_time():
            return None
        try:
            plan = planner.plan(problem, vehicle, recorder.progress)
        except (Infeasible, SpecError, BackendMissing):
            continue
        if plan.certified and plan.duration < shorter_than:
            attempts = (*recorder.attempts, *plan.attempts)
            return replace(plan, attempts=attempts, rescue=f"{failed}; planned {how}")
    return None


def _alternatives(asked: Miqp, problem: Problem, vehicle: Vehicle) -> Iterator[tuple[Planner, str]]:
    """Planners, and how they plan in words."""
    yield from with_more_intervals(asked, problem, vehicle)
    first = default_order(problem, vehicle)
    for order in range(first, max(INPUT_NAMES) + 1):
        if order != (asked.order or first):
            yield replace(asked, order=order, rescue=False), f"with order {order}"
    if asked.search is not None:
        yield replace(asked, search=None, rescue=False), "with intervals that differ"
    from aerobat.planning.polynomial.free_knots import FreeKnots

    yield FreeKnots(reserve=max(FLYING_RESERVE, asked.reserve)), "by free-knots"


def with_more_intervals(asked: Miqp, problem: Problem, vehicle: Vehicle) -> Iterator[tuple[Planner, str]]:
    """Return the planner with more intervals than were asked for, the fewest first, and how in words."""
    stages = len(problem.stages(vehicle.max_specific_thrust).stages)
    more = {max(round(factor * asked.intervals), A_STAGE * stages) for factor in MORE_INTERVALS}
    if max(more) * MORE_INTERVALS[0] < MANY_INTERVALS:
        more.add(MANY_INTERVALS)
    for intervals in sorted(n for n in more if n <= MAX_INTERVALS):
        yield replace(asked, intervals=intervals, rescue=False), f"with {intervals}"
