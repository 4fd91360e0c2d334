"""plan_to_pass(): plan, fly, tighten, until flights pass with the probability asked."""

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
from aerobat.studies.passing.result import Passing, Round
from aerobat.studies.passing.task import PassingTask
from aerobat.studies.passing.tightening import Tightening
from aerobat.studies.share import CONFIDENCE
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

# fresh flights that are expected to fail at the probability asked: two thirds as many failures are a proof
PROVING_FAILURES = 50


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

    The plain plan is flown many times. Where too few flights pass, their spread says by how much to narrow
    the gates for planning, and how much thrust to ask for in them; plans go on from the plain one with more
    reserve and less body rate, and the smallest reserve of a ladder is sought with which enough of the same
    flights pass. The plan found is then flown on flights that nothing was learned from: it is returned if the
    lower end of Clopper and Pearson's interval reaches the probability. A flight passes where nothing goes
    wrong, as its `Outcome` says.

    Args:
        problem: What is planned, or its name.
        planner: How, one with a `reserve`, or its registered name.
        vehicle: What flies it, or its name.
        probability: With which a flight shall pass [-].
        conditions: What varies from flight to flight, or the name of a preset or a file.
        seed: Of the flights.
        controller: The name of what flies: full, or a control law.
        flights: How many tell how to tighten, numbered from 0.
        fresh: How many prove it, numbered behind those; by default 50 over the probability of failing.
        workers: Processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: Any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        progress: Called with every attempt at a plan as it ends.
        tried: Called with every round as it ends.

    Raises:
        Infeasible: there is no plan, or none that passes so often; the message names the cause in the way.
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
    flown = range(flights)
    with pool(workers, executor, len(cut(range(max(flights, proving))))) as flying:
        task = PassingTask(
            as_problem(problem),
            method,
            as_vehicle(vehicle),
            conditions,
            seed,
            controller,
            probability,
            progress,
            flying,
        )
        return Tightening(task, flown, proving, tried or (lambda done: None)).passing()


def _least_flights(probability: float) -> int:
    """The number of flights that prove a probability if all of them pass."""
    return ceil(log(0.5 * (1.0 - CONFIDENCE)) / log(probability))


def _require_enough(name: str, flights: int, probability: float) -> None:
    """Refuse a number of flights that proves nothing even where all of them pass."""
    least = _least_flights(probability)
    if flights < least:
        raise SpecError(
            f"{name}: {flights} flights cannot prove {100 * probability:g} %; take {least} or more, or a "
            "smaller probability"
        )
