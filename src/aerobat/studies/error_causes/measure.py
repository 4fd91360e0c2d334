"""error_causes(): each cause of error switched on alone, then all together, on the same flights."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import Annotated

from pydantic import Field

from aerobat.control import Controller
from aerobat.declaration import Seed, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.planning import Plan, Planner, as_planner, plan
from aerobat.problem import Problem, as_problem
from aerobat.studies.error_causes.cause import Cause, Trial, together
from aerobat.studies.error_causes.result import ALL, NONE, ErrorCauses, TrialResult
from aerobat.studies.flights import FlightTask, cut, fly_scores
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

Flights = Annotated[int, Field(ge=1, le=10**6, description="whole number from 1 to a million")]


@validated
def error_causes(
    problem: Problem | str,
    vehicle: Vehicle | str,
    causes: Sequence[Cause],
    *,
    planner: Planner | str = "miqp",
    conditions: Dispersion | str = "lab",
    controller: Controller | None = None,
    flights: Flights = 1000,
    seed: Seed = 0,
    workers: Workers | None = None,
    executor: Executor | None = None,
    begin: Callable[[str], None] | None = None,
) -> ErrorCauses:
    """Plan and fly a maneuver with no cause of error, with each alone, and with all together.

    Flight k has the same draws in every trial, whatever a cause scales or adds, so that errors are compared
    flight by flight. Where a cause changes the planner, the maneuver is planned again.

    Args:
        problem: what is planned, with gates, or its name.
        vehicle: what flies it, or its name.
        causes: each with a name of its own; no two change the same.
        planner: how it is planned without them, or a registered planner's name.
        conditions: under which it is flown without them, or their name.
        controller: how it is controlled without them, by default the vehicle's own.
        flights: how many, of each trial.
        seed: of all flights.
        workers: processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        begin: called with each trial's name when its turn comes.

    Raises:
        SpecError: causes overlap, share a name or name no field; or the problem has no gate.
        Infeasible: with a cause nothing is planned, which the sentence names.
    """
    problem, vehicle = as_problem(problem), as_vehicle(vehicle)
    if not problem.gates:
        raise SpecError(f"problem '{problem.name}' has no gate to judge flights by; give one")
    names = [NONE, *(cause.name for cause in causes), ALL]
    repeated = next((name for k, name in enumerate(names) if name in names[:k]), None)
    if repeated is not None:
        raise SpecError(f"causes: there are two named '{repeated}'; rename one")
    none = Trial(as_planner(planner), as_dispersion(conditions), controller or vehicle.controller)
    trials = [each.applied(none) for each in (Cause(NONE, {}), *causes, together(causes, ALL))]
    plans: dict[tuple[Planner, bool], Plan] = {}
    results = []
    with pool(workers, executor, len(cut(range(flights)))) as flying:
        for name, trial in zip(names, trials, strict=True):
            if begin is not None:
                begin(name)
            key = trial.planner, trial.vehicle_known
            if key not in plans:
                plans[key] = _planned(name, problem, trial.planner, vehicle if trial.vehicle_known else None)
            task = FlightTask(plans[key], vehicle, trial.conditions, seed, trial.controller)
            (scores,) = fly_scores(flying, (task,), range(flights))
            results.append(TrialResult(name, trial, plans[key], scores))
    return ErrorCauses(tuple(results), seed)


def _planned(cause: str, problem: Problem, planner: Planner, vehicle: Vehicle | None) -> Plan:
    try:
        return plan(problem, planner, vehicle)
    except Infeasible as infeasible:
        raise Infeasible(f"with '{cause}': {infeasible.sentence}", infeasible.attempts) from None
