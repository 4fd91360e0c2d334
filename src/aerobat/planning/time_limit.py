"""A limit on the time of planning: the texts and the handling that all planners share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import out_of_time, wall, within_time
from aerobat.planning.recorder import Attempt, Recorder
from aerobat.planning.result import Plan
from aerobat.problem.problem import Problem

TIME_LIMIT = "Seconds for planning; the best plan found by then is taken, and said to be that."


def stopped(plan: Plan) -> Plan:
    """Return the plan, with the status `time_limit` if no time is left; a work limit is not told."""
    return replace(plan, status="time_limit") if out_of_time(wall) else plan


def best_in_time(
    problem: Problem, limit: float | None, recorder: Recorder, search: Callable[[], Plan | None]
) -> Plan | None:
    """Return the plan that a search finds within a time limit; None where it ends in time without a plan.

    Args:
        problem: The problem that is planned.
        limit: The planner's own limit [s]; None adds no limit.
        recorder: Records the search's attempts.
        search: A function that returns a plan or None.

    Raises:
        Infeasible: The time was over before a plan was found.
    """
    with within_time(limit):
        found = search()
        if found is not None:
            return stopped(found)
        if out_of_time():
            # miqp does not plan closed courses
            remedy = "take the planner miqp, which is quick" if problem.ends else ""
            raise too_short(problem, limit, recorder.attempts, remedy)
    return None


def best_by_limit(plan: Plan) -> str:
    """Return words on a plan that a time limit ended, with its gap if known; empty for other plans."""
    if plan.status != "time_limit":
        return ""
    if plan.assessment is None or plan.assessment.ratio == inf:
        return "the best found by the time limit"
    return (
        f"the best found by the time limit, at most {plan.assessment.ratio:.2f} times the shortest possible"
    )


def too_short(
    problem: Problem,
    limit: float | None,
    attempts: Sequence[Attempt],
    remedy: str,
) -> Infeasible:
    """Return the error of a search whose time was over before a plan was found.

    Args:
        problem: The problem that was planned.
        limit: The planner's own limit [s]; None where an outer limit ended the search.
        attempts: The attempts that were made.
        remedy: Another remedy than more time; may be empty.
    """
    given = "the time given" if limit is None else f"{limit:g} s"
    return Infeasible(
        f"no plan of '{problem.name}' was found in {given}; "
        f"{' or '.join(filter(None, ('allow more with --time-limit', remedy)))}",
        tuple(attempts),
        remedy="",
    )
