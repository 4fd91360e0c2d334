"""error_causes(): flights with no cause of error, with each alone, and with all, and the effect of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

import numpy as np

from aerobat.arrays import Array
from aerobat.control import Controller
from aerobat.declaration import Label, Positive, Seed, by_value, short, unknown_name, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import Score
from aerobat.evaluation.opening import Probability
from aerobat.planning import Plan, Planner, as_planner, plan
from aerobat.problem import Problem, as_problem
from aerobat.simulation.outcome import length
from aerobat.studies.error_causes.cause import Cause, Trial, together
from aerobat.studies.flights import Flights, FlightTask, cut, fly_scores
from aerobat.studies.share import Share
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

NONE, ALL = "none", "all together"


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
    flight by flight. If a cause changes the planner, the maneuver is planned again.

    Args:
        problem: the problem, which needs gates, or its name.
        vehicle: the vehicle or its name.
        causes: each with a name of its own; no two may change the same field.
        planner: the planner without causes, or a registered planner's name.
        conditions: the conditions without causes, or their name.
        controller: the controller settings without causes, by default the vehicle's own.
        flights: number of flights in each trial.
        seed: of all flights.
        workers: processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        begin: called with each trial's name when the trial begins.

    Raises:
        SpecError: causes overlap, share a name or name no field; or the problem has no gate.
        Infeasible: there is no plan with some cause, which the sentence names.
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


@by_value
class Cost:
    """The median increase of an error due to a cause, over pairs of flights with and without the cause.

    The interval contains the true median of the differences with the given confidence, whatever their
    distribution: its ends are order statistics, by the sign test. With too few pairs it is infinite.
    """

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, without: Array, with_cause: Array, confidence: float) -> Cost:
        """Return the cost from errors of the same flights, (flights,); two infinite errors differ by zero."""
        from scipy.stats import binom  # takes a quarter of a second

        with np.errstate(invalid="ignore"):
            differences = np.sort(np.nan_to_num(with_cause - without, nan=0.0, posinf=np.inf, neginf=-np.inf))
        rank = int(binom.ppf(0.5 * (1.0 - confidence), len(differences), 0.5))  # of the ends, from 1
        ends = (differences[rank - 1], differences[-rank]) if rank else (-np.inf, np.inf)
        return cls(float(np.quantile(differences, 0.5, method="higher")), float(ends[0]), float(ends[1]))


@short
@by_value
class TrialResult:
    """The flights of one trial. Errors are arrays (flights,), infinite where a gate was not crossed."""

    cause: str  # the cause's name, NONE or ALL
    trial: Trial
    plan: Plan
    scores: Score

    def __str__(self) -> str:
        """Return one line with the cause and the scores."""
        return f"{self.cause}: {self.scores}"

    @property
    def position_error(self) -> Array:
        """The largest position error of each flight [m]."""
        return np.asarray(np.nan_to_num(self.scores.max_position_error_m, nan=np.inf))

    @property
    def gate_error(self) -> Array:
        """The distance from the gate's centre where its plane is crossed [m], the largest over the gates."""
        return self._worst("miss")

    @property
    def gate_attitude_error(self) -> Array:
        """The angle of the thrust axis off the required attitude [deg], the largest over the gates."""
        return self._worst("attitude_error_deg")

    @property
    def clearance(self) -> Array:
        """The smallest clearance of body and frame [m], negative: penetration; −∞ where a gate is missed."""
        return -self._worst("clearance", -1.0)

    @property
    def cleared(self) -> Share:
        """The share of flights whose body went through all gates and touched no frame, whatever its tilt."""
        return Share.where(self.clearance >= 0.0)

    @validated
    def cleared_opening(self, width: Positive, height: Positive) -> Share:
        """Return the share of flights whose body would have cleared gates with this opening [m]."""
        fits = (self._worst("needed_width") <= width) & (self._worst("needed_height") <= height)
        return Share.where(fits)

    def _worst(self, field: str, sign: float = 1.0) -> Array:
        """Return the maximum of a passage's field over the gates, times a sign; infinite where unknown."""
        values = [sign * getattr(passage, field) for passage in self.scores.passages]
        return np.asarray(np.max(np.nan_to_num(values, nan=np.inf), axis=0))


@short
@by_value
class ErrorCauses:
    """The same flights with no cause of error, with each alone, and with all together."""

    results: tuple[TrialResult, ...]  # NONE first, then the causes in their order, ALL last
    seed: int

    def __len__(self) -> int:
        return len(self.results[0].scores)

    def __str__(self) -> str:
        """Return one line with the median error and the cost of each cause."""
        costs = ", ".join(f"{r.cause} {length(self.cost(r.cause).median)}" for r in self.results[1:])
        median = float(np.median(self.none.position_error))
        return f"{len(self)} flights, position error {length(median)} at the median; more with {costs}"

    @property
    def none(self) -> TrialResult:
        """The result without causes."""
        return self.results[0]

    @property
    def together(self) -> TrialResult:
        """The result with all causes."""
        return self.results[-1]

    @validated
    def of(self, cause: Label) -> TrialResult:
        """Return the result of one cause, by its name. Raises SpecError where there is no such cause."""
        for result in self.results:
            if result.cause == cause:
                return result
        raise unknown_name("cause", cause, [result.cause for result in self.results])

    @validated
    def cost(self, cause: Label, confidence: Probability = 0.95) -> Cost:
        """Return the cost of a cause in position error [m], flight by flight against no cause.

        Raises SpecError where there is no such cause.
        """
        return Cost.of(self.none.position_error, self.of(cause).position_error, confidence)
