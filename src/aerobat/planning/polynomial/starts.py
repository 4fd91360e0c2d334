"""Paths to begin a refinement at: closed forms through a course, or the plans of other planners."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import out_of_time
from aerobat.planning.courses import is_course
from aerobat.planning.miqp.miqp import Miqp
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
    if task.stages.closed or (on_course and guess.intervals <= len(task.stages.stages)):
        return
    closed_form: list[Planner] = [MinSnap()] if problem.maneuver.through_points and not on_course else []
    asked = [(planner, task.vehicle_if_any) for planner in (*closed_form, guess)]
    for planner, vehicle in asked if on_course else [*asked, (Miqp(), None)]:
        if vehicle is None and out_of_time():
            return
        try:
            plan = planner.plan(problem, vehicle)
        except Infeasible as infeasible:
            # at once, or without rotors: whatever the planner
            is_refused = vehicle is None or not infeasible.attempts
            if is_refused and not out_of_time():
                raise
            continue
        yield None if vehicle is None else plan, WarmStart.of(plan, task.stages)


def closed_forms(task: Task, paces: Sequence[float] = (1.0,)) -> Iterator[tuple[None, WarmStart]]:
    """Yield closed forms through a course at some paces, times their durations; no plan is one of them."""
    begun = flying_lap if task.stages.closed else start_along_normals
    for pace, order in product(paces, ORDERS):
        yield None, begun(task, order).time_scaled(pace)
