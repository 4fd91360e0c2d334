"""Paths to begin a refinement at: closed forms through a course, or the plans of other planners."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, product

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.miqp.rescue import with_more_intervals
from aerobat.planning.planners import Planner
from aerobat.planning.polynomial.flying_lap import flying_lap
from aerobat.planning.polynomial.knots import start_along_normals
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart

ORDERS = (4, 3)  # of closed forms that courses begin at: minimum snap, minimum jerk,
SLOWER_PACES = (1.3, 1.7)  # times their durations, where those lead nowhere or touch a frame


def starts(task: Task, guess: Miqp) -> Iterator[tuple[Plan | None, WarmStart]]:
    """Yield paths through a task's stages, the likeliest first, each with its plan if it is one.

    Args:
        task: What is planned.
        guess: The mixed-integer planner, asked for the vehicle, then for none; courses ask it last, if it
            has as many intervals as they need.

    Raises:
        Infeasible: A stage asks more thrust than the vehicle has.
    """
    problem, on_course = task.problem, is_course(task.stages)
    if on_course:
        yield from closed_forms(task)
    if task.stages.closed or (on_course and guess.intervals_for(task.stages) <= len(task.stages.stages)):
        return
    closed_form: list[Planner] = [MinSnap()] if problem.maneuver.through_points and not on_course else []
    for planner in (*closed_form, guess):
        try:
            plan = planner.plan(problem, task.vehicle_if_any)
        except Infeasible as infeasible:
            if not infeasible.attempts and not out_of_time():  # at once: whatever the planner
                raise
            continue
        yield plan, WarmStart.of(plan, task.stages)
    if not on_course and not out_of_time():
        yield from ((None, WarmStart.of(plan, task.stages)) for plan in _without_rotors(task))


def _without_rotors(task: Task) -> Iterator[Plan]:
    """Yield the plan of a program that knows no rotors, of more intervals where few lead to none."""
    few, refusals = Miqp(), list[Infeasible]()
    finer = (planner for planner, _ in with_more_intervals(few, task.problem, task.vehicle))
    for planner in chain([few], finer):
        try:
            plan = planner.plan(task.problem)
        except Infeasible as infeasible:
            refusals.append(infeasible)
        else:
            yield plan
            return
    if not out_of_time():
        raise refusals[0]


def closed_forms(task: Task, paces: Sequence[float] = (1.0,)) -> Iterator[tuple[None, WarmStart]]:
    """Yield closed forms through a course at some paces, times their durations; no plan is one of them."""
    begun = flying_lap if task.stages.closed else start_along_normals
    for pace, order in product(paces, ORDERS):
        yield None, begun(task, order).time_scaled(pace)
