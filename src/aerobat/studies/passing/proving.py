"""The proof of a plan on fresh flights, and the refusal where there is none."""

from __future__ import annotations

from dataclasses import replace

from aerobat.errors import Infeasible
from aerobat.planning import plan
from aerobat.planning.tube import Tube
from aerobat.studies.flights import passed
from aerobat.studies.passing.causes import main_failure_cause
from aerobat.studies.passing.result import Passing
from aerobat.studies.passing.spread import LEVEL, tube_series
from aerobat.studies.passing.steadying import steadier
from aerobat.studies.passing.task import FlownPlan, PassingTask, reserve_kept
from aerobat.studies.share import Share, percent

# proofs are attempted on separate flights: each errs with probability 2.5 % at most, both together 5 %
PROOFS = 2
TRIES = 20  # further plans that are tried for each proof
DURATION_PRICE = 0.05  # of a duration e times as long, as a fraction of the flights: less than of commands


def proven(task: PassingTask) -> Passing:
    """Search a plan that passes, and return it with its proof. Raises Infeasible where there is none."""
    found = plan(task.problem, task.planner, task.vehicle, task.progress)
    kept = reserve_kept(found, task.planner.reserve)
    first = best = FlownPlan(found, task.selecting(found), kept, task.problem)
    task.note(first)
    for attempt in range(PROOFS):
        best = steadier(task, first, best, TRIES, DURATION_PRICE)
        if best.share.fraction < task.probability:
            raise _unreachable(task, best, task.flights)
        start = len(task.flights) + attempt * task.proving
        fresh = range(start, start + task.proving)
        scores = task.scores(best.plan, fresh)
        if task.is_proof(passed(scores)):
            return _with_proof(task, first, best, passed(scores), fresh)
        best = replace(best, scores=scores)
    raise _unreachable(task, best, fresh)


def _with_proof(task: PassingTask, first: FlownPlan, best: FlownPlan, share: Share, fresh: range) -> Passing:
    """Return the best plan with the share of its fresh flights that pass, and their tube."""
    tube = Tube(
        conditions=task.conditions.name,
        seed=task.seed,
        level=LEVEL,
        **tube_series(task, best.plan, fresh),
        reserve=best.reserve,
        plain_duration=first.plan.duration,
        probability=task.probability,
        passed=share.count,
        flights=share.of,
        lower_bound=share.interval[0],
    )
    return Passing(
        plan=replace(best.plan, tube=tube),
        plain=first.plan,
        before=share if best is first else task.share(first.plan, fresh),
        after=share,
        probability=task.probability,
        fresh=fresh,
        rounds=tuple(task.rounds),
    )


def _unreachable(task: PassingTask, best: FlownPlan, flights: range) -> Infeasible:
    """Return the error with the best share of passing flights and the main cause of failures."""
    share = task.share(best.plan, flights)
    why = main_failure_cause(
        task.conditions, task.probability, lambda without: task.share(best.plan, flights, without)
    )
    return Infeasible(
        f"'{task.problem.name}' on {task.vehicle.name} is not proven to pass as often as asked, "
        f"{percent(task.probability)} %: under {task.conditions.name} {share} pass at best, with a "
        f"reserve of {best.reserve:g}{f'; {why}' if why else ''}; ask for less, or better that",
        [attempt for done in task.rounds for attempt in done.plan.attempts],
        remedy="",
    )
