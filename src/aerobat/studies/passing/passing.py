"""plan_to_pass(): plan, fly and tighten until flights pass with a required probability."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from math import ceil, log

from aerobat.control import named_controller
from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation.opening import Probability
from aerobat.planning import Attempt, Planner, as_planner, plan
from aerobat.planning.result import reserve_kept
from aerobat.planning.tube import Tube
from aerobat.problem import Problem, as_problem
from aerobat.studies.flights import Flights, cut, passed
from aerobat.studies.passing.causes import main_failure_cause
from aerobat.studies.passing.result import Passing, Round
from aerobat.studies.passing.spread import LEVEL, tube_series
from aerobat.studies.passing.steadying import steadier
from aerobat.studies.passing.task import FlownPlan, PassingTask
from aerobat.studies.share import CONFIDENCE, Share, percent
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

# expected failures among the fresh flights at the required probability: two thirds as many are a proof
PROVING_FAILURES = 50
LEAST_TRAINING = 1000  # least number of flights on which plans are tried by default
MOST_TRAINING = 100_000  # most of them, which take a minute and a half on two cores
# work limit [s] of a further plan: with 4, section-v's flip in pitch is refused
PLANNING_WORK = 20.0
# proofs are attempted on separate flights: each errs with probability 2.5 % at most, both together 5 %
PROOFS = 2
TRIES = 20  # further plans that are tried for each proof
DURATION_PRICE = 0.05  # of a duration e times as long, as a fraction of the flights: less than of commands


@validated
def plan_to_pass(
    problem: Problem | str,
    planner: Planner | str = "miqp",
    vehicle: Vehicle | str = "agile-quad",
    *,
    probability: Probability = 0.99,
    conditions: Dispersion | str = "lab",
    seed: Seed = 0,
    controller: str = "full",
    flights: Flights | None = None,
    fresh: Flights | None = None,
    workers: Workers | None = None,
    executor: Executor | None = None,
    progress: Callable[[Attempt], None] | None = None,
    tried: Callable[[Round], None] | None = None,
) -> Passing:
    """Plan a problem so that flights under conditions pass with a probability, proven on fresh flights.

    The plain plan is flown many times. If too few flights pass, their spread determines how much to narrow
    the gates for planning, and how much thrust to require in them. Further plans go on from the best one so
    far, with lower body rates, more thrust in gates and larger reserves. The search ends when enough of the
    same flights pass. The resulting plan is flown on fresh flights, which the search has not used: it is
    returned if the lower end of the Clopper–Pearson interval reaches the probability. A flight passes if its
    `Outcome` is a success.

    Args:
        problem: The problem or its name.
        planner: A planner with a `reserve`, or its registered name.
        vehicle: The vehicle or its name.
        probability: With which a flight must pass [-].
        conditions: The distributions that flights draw from, or the name of a preset or a file.
        seed: Of the flights.
        controller: The name of the controller: full, or a control law.
        flights: Number of training flights, numbered from 0; by default 1000, or as many as a proof needs.
        fresh: Number of flights of the proof, with the next numbers; by default 50 / (1 − probability).
        workers: Processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: Any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        progress: Called with every attempt at a plan as it ends.
        tried: Called with every round as it ends.

    Raises:
        Infeasible: there is no plan, or no plan that passes so often; the message names the main cause.
        SpecError: the planner keeps no reserve, or so few flights cannot prove such a probability.
    """
    method, conditions = as_planner(planner), as_dispersion(conditions)
    if not hasattr(method, "reserve"):
        raise SpecError(
            "planner keeps no reserve, by which plans are tightened; take miqp, free-knots or time-optimal"
        )
    least = _least_flights(probability)
    proving = fresh or max(round(PROVING_FAILURES / (1.0 - probability)), least)
    flights = flights or min(max(least, LEAST_TRAINING), MOST_TRAINING)
    _require_enough("flights", flights, probability)
    _require_enough("fresh", proving, probability)
    named_controller(controller)
    with pool(workers, executor, len(cut(range(max(flights, proving))))) as flying:
        task = PassingTask(
            problem=as_problem(problem),
            planner=method,
            vehicle=as_vehicle(vehicle).without_dead_rotors(),
            conditions=conditions,
            seed=seed,
            controller=controller,
            probability=probability,
            flights=range(flights),
            proving=proving,
            planning_work=PLANNING_WORK,
            progress=progress,
            flying=flying,
            tried=tried,
        )
        return proven(task)


def _least_flights(probability: float) -> int:
    """Return the number of flights that prove a probability if all of them pass."""
    return ceil(log(0.5 * (1.0 - CONFIDENCE)) / log(probability))


def _require_enough(name: str, flights: int, probability: float) -> None:
    """Raise SpecError for a number of flights that proves nothing even if all of them pass."""
    least = _least_flights(probability)
    if flights < least:
        raise SpecError(
            f"{name}: {flights} flights cannot prove {100 * probability:.12g} %; take {least} or more, or a "
            "smaller probability"
        )


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
        plan=replace(best.plan if best is first else best.without_second_opinion, tube=tube),
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
