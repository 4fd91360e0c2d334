"""A limit on the time of planning: what all planners say of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import inf

from aerobat.errors import Infeasible
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning.recorder import Attempt, Recorder
from aerobat.planning.result import Plan
from aerobat.problem.problem import Problem

TIME_LIMIT = "Seconds for planning; the best plan found by then is taken, and said to be that."


def stopped(plan: Plan) -> Plan:
    """The plan; where no time is left, as the best that was found by then."""
    return replace(plan, status="time_limit") if out_of_time() else plan


def best_in_time(
    problem: Problem, limit: float | None, recorder: Recorder, search: Callable[[], Plan | None]
) -> Plan | None:
    """The plan that a search finds within a limit, the best by then; None where there is none at all.

    Args:
        problem: What is planned.
        limit: The planner's own [s]; None adds none.
        recorder: Keeps the search's attempts.
        search: Finds a plan.

    Raises:
        Infeasible: The time was over before anything was found.
    """
    with within_time(limit):
        found = search()
        if found is not None:
            return stopped(found)
        if out_of_time():
            # closed courses are no problem of miqp's
            remedy = "take the planner miqp, which is quick" if problem.ends else ""
            raise too_short(problem, limit, recorder.attempts, remedy)
    return None


def best_by_limit(plan: Plan) -> str:
    """Return words on a plan that a limit ended, with its gap where that is known; empty for other plans."""
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
    """The error of a search whose time was over before anything was found.

    Args:
        problem: What was planned.
        limit: The planner's own [s]; None where another's ended it.
        attempts: What was tried.
        remedy: What else may help; empty where nothing does.
    """
    given = "the time given" if limit is None else f"{limit:g} s"
    return Infeasible(
        f"no plan of '{problem.name}' was found in {given}; "
        f"{' or '.join(filter(None, ('allow more with --time-limit', remedy)))}",
        tuple(attempts),
        remedy="",
    )
