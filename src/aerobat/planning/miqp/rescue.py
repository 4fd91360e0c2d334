"""What else may find a plan where the intervals and the order that were asked for find none."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from aerobat.errors import BackendMissing, Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.miqp.attempts import default_order
from aerobat.planning.miqp.integrator import INPUT_NAMES
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
    stages = len(problem.stages(vehicle.max_specific_thrust).stages)
    for planner, how in _alternatives(asked, default_order(problem, vehicle), stages):
        if out_of_time():
            return None
        try:
            plan = planner.plan(problem, vehicle, recorder.progress)
        except (Infeasible, SpecError, BackendMissing):
            continue
        if plan.certified:
            attempts = (*recorder.attempts, *plan.attempts)
            wanted = f"miqp found none with {asked.intervals} intervals"
            return replace(plan, attempts=attempts, rescue=f"{wanted}; planned {how}")
    return None


def _alternatives(asked: Miqp, first: int, stages: int) -> Iterator[tuple[Planner, str]]:
    """Planners, and how they plan in words; `first` is the order that is taken where none is asked for."""
    more = {max(round(factor * asked.intervals), A_STAGE * stages) for factor in MORE_INTERVALS}
    if max(more) * MORE_INTERVALS[0] < MANY_INTERVALS:
        more.add(MANY_INTERVALS)
    for intervals in sorted(more):
        yield replace(asked, intervals=intervals, rescue=False), f"with {intervals}"
    for order in range(first, max(INPUT_NAMES) + 1):
        if order != (asked.order or first):
            yield replace(asked, order=order, rescue=False), f"with order {order}"
    if asked.search is not None:
        yield replace(asked, search=None, rescue=False), "with intervals that differ"
    from aerobat.planning.polynomial.free_knots import FreeKnots

    yield FreeKnots(reserve=max(FLYING_RESERVE, asked.reserve)), "by free-knots"
