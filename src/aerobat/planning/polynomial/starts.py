"""Starts of refinements: the plans of other planners."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.miqp import Miqp
from aerobat.planning.planners import Planner
from aerobat.planning.polynomial.min_snap import MinSnap
from aerobat.planning.result import Plan
from aerobat.planning.task import Task
from aerobat.planning.warm_start import WarmStart


def starts(task: Task, guess: Miqp) -> Iterator[tuple[Plan | None, WarmStart]]:
    """Yield the paths of other planners, the likeliest first, each with its plan if it is one.

    Args:
        task: The task that is planned.
        guess: The mixed-integer planner, which plans for the vehicle, then for none. Courses use it only if
            it has more intervals than they have stages.

    Raises:
        Infeasible: A stage asks more thrust than the vehicle has.
    """
    problem, on_course = task.problem, is_course(task.stages)
    if task.stages.closed or (on_course and guess.intervals_for(task.stages) <= len(task.stages.stages)):
        return
    closed_form: list[Planner] = [MinSnap()] if problem.maneuver.through_points and not on_course else []
    for planner in (*closed_form, guess):
        try:
            plan = planner.plan(problem, task.vehicle_if_any)
        except Infeasible as infeasible:
            if not infeasible.attempts and not out_of_time():  # refused without attempts: no planner can help
                raise
            continue
        yield plan, WarmStart.of(plan, task.stages)
    if not on_course and not out_of_time():
        yield from _without_rotors(task, guess)


def _without_rotors(task: Task, guess: Miqp) -> Iterator[tuple[Plan | None, WarmStart]]:
    """Yield the path of a program without a vehicle.

    Where the default number of intervals gives no path, more intervals are tried, up to the first path that
    the vehicle can fly, too.
    """
    problem = task.problem
    try:
        yield None, WarmStart.of(Miqp().plan(problem), task.stages)
        return
    except Infeasible as infeasible:
        refusal = infeasible
    found = False
    for finer in guess.with_more_intervals(problem, task.vehicle):
        with suppress(Infeasible):
            yield None, WarmStart.of(finer.plan(problem), task.stages)
            found = True
            plan = finer.plan(problem, task.vehicle)
            yield plan, WarmStart.of(plan, task.stages)
            return
    if not (found or out_of_time()):
        raise refusal
