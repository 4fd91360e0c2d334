"""plan_to_pass(): plan, fly and tighten until flights pass with a required probability."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from math import ceil, log

from aerobat.control import named_controller
from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import SpecError
from aerobat.evaluation.opening import Probability
from aerobat.planning import Attempt, Planner, as_planner
from aerobat.problem import Problem, as_problem
from aerobat.studies.flights import Flights, cut
from aerobat.studies.passing.proving import proven
from aerobat.studies.passing.result import Passing, Round
from aerobat.studies.passing.task import PassingTask
from aerobat.studies.share import CONFIDENCE
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

# expected failures among the fresh flights at the required probability: two thirds as many are a proof
PROVING_FAILURES = 50
# [s] processor time limit of a further plan: with 4, section-v's flip in pitch is refused
PLANNING_TIME = 20.0


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
    flights: Flights = 1000,
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
        flights: Number of training flights, numbered from 0.
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
    proving = fresh or max(round(PROVING_FAILURES / (1.0 - probability)), _least_flights(probability))
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
            planning_time=PLANNING_TIME,
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
            f"{name}: {flights} flights cannot prove {100 * probability:g} %; take {least} or more, or a "
            "smaller probability"
        )
