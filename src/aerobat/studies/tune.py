"""tune(): controller gains for one vehicle, optimized over many simulated flights under conditions.

The search is Nelder–Mead (SciPy) over the logarithms of the gains. It is derivative-free, so the kinks of a
quantile and the jumps of the failure cost do no harm. Six gains take one or two hundred cost evaluations.
The search is deterministic, and all sets of gains fly the same draws (common random numbers), so that
differences in cost come from the gains. The best set is validated on flights that the search has not seen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import replace
from math import inf
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from aerobat.arrays import Array, frozen
from aerobat.control import Controller
from aerobat.declaration import NonNegative, Seed, by_value, in_notebooks, unknown_name, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import SpecError
from aerobat.evaluation import Score
from aerobat.flatness import vehicle_of
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning import Plan
from aerobat.simulation.outcome import DIVERGENCE_RADIUS, length
from aerobat.studies.flights import FlightTask, cut, fly_scores
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle

TUNED = (
    "position_gain",
    "velocity_gain",
    "integral_gain",
    "attitude_frequency",
    "attitude_damping",
    "attitude_integral_gain",
)
TUNABLE = (*TUNED, "jerk_filter", "lead_time_constant")
MAX_FACTOR = 4.0  # [-] largest factor by which a gain is raised or lowered
QUANTILE = 0.95  # quantile over flights of the largest position error that is minimized
_FIRST_FACTOR = 1.4  # [-] factor on each gain in turn in the initial simplex
_RESOLUTION = 0.01  # [-] relative tolerance of the gains at which the search ends
_RESAMPLES = 1000  # number of bootstrap samples of the fresh flights

Flights = Annotated[int, Field(ge=2, le=100_000, description="whole number from 2 to 100000")]
Evaluations = Annotated[int, Field(ge=1, le=100_000, description="whole number from 1 to 100000")]


@by_value
class FlightCosts:
    """Errors and failures of many flights of some plans with one set of gains; arrays (plans, flights)."""

    max_position_error_m: Array  # of a diverged flight, DIVERGENCE_RADIUS
    failed: Array  # 1 where a flight was lost, missed a gate or hit its frame, else 0

    @classmethod
    def of(cls, scores: Sequence[Score]) -> FlightCosts:
        """Return the costs of flights from their scores, one for each plan."""
        radius = DIVERGENCE_RADIUS
        errors = [
            np.where(np.isfinite(each.stop), radius, np.minimum(each.max_position_error_m, radius))
            for each in scores
        ]
        failed = [1.0 - each.succeeded for each in scores]
        return cls(frozen(errors, "max_position_error_m"), frozen(failed, "failed"))

    @property
    def error_quantile_m(self) -> float:
        """The 95 % quantile over flights of the largest position error, averaged over plans [m]."""
        return float(np.quantile(self.max_position_error_m, QUANTILE, axis=-1).mean())

    @property
    def failed_fraction(self) -> float:
        """The fraction of all flights that failed [-]."""
        return float(self.failed.mean())

    @property
    def cost(self) -> float:
        """The minimized cost [m]: `error_quantile_m`, plus 5 cm for each 1 % of failed flights."""
        return self.error_quantile_m + DIVERGENCE_RADIUS * self.failed_fraction

    def resampled(self, flights: NDArray[np.int64]) -> FlightCosts:
        """Return the costs of the flights with these numbers, which may repeat."""
        return FlightCosts(self.max_position_error_m[:, flights], self.failed[:, flights])

    def __str__(self) -> str:
        """Return one line with error and failures."""
        error = f"95 % of flights within {length(self.error_quantile_m)} of their path"
        return f"{error}, {100 * self.failed_fraction:.3g} % failed"


@in_notebooks
@by_value
class Tuning:
    """The gains that a search found for a vehicle, and their validation on fresh flights."""

    vehicle: Vehicle  # with its original gains
    controller: Controller  # with the best gains on the training flights
    gains: tuple[str, ...]  # names of the gains that were searched
    evaluations: int  # number of sets of gains that were flown
    training: tuple[FlightCosts, FlightCosts]  # with the old gains and the new, flights 0 to n − 1
    fresh: tuple[FlightCosts, FlightCosts]  # with the old gains and the new, flights n to 2n − 1
    interval: tuple[float, float]  # [m] 95 % confidence interval of the change in cost on fresh flights

    @property
    def is_better(self) -> bool:
        """True if the new gains lower the cost of fresh flights with 95 % confidence."""
        return self.interval[1] < 0.0

    @property
    def tuned_vehicle(self) -> Vehicle:
        """The vehicle with the new gains. Raises SpecError where they are no better."""
        if not self.is_better:
            raise SpecError(f"the gains of '{self.vehicle.name}' stay as they are: {self.verdict}")
        return replace(self.vehicle, controller=self.controller)

    @property
    def verdict(self) -> str:
        """A sentence on whether the gains are better, and by how much the cost changes."""
        low, high = (f"{100 * bound:+.2f}" for bound in self.interval)
        found = "better" if self.is_better else "no better"
        return f"the gains found are {found} on fresh flights, cost {low} to {high} cm (95 % confidence)"

    def __str__(self) -> str:
        """Return one line with the verdict and the costs before and after."""
        before, after = self.fresh
        return f"{self.vehicle.name}: {self.verdict}; before, {before}; after, {after}"


@validated
def tune(
    plan: Plan | Sequence[Plan],
    conditions: Dispersion | str = "lab",
    flights: Flights = 200,
    seed: Seed = 0,
    *,
    vehicle: Vehicle | str | None = None,
    gains: Sequence[str] = TUNED,
    evaluations: Evaluations = 150,
    time_limit: NonNegative | None = None,
    workers: Workers | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, float], None] | None = None,
) -> Tuning:
    """Search the controller gains with which a vehicle flies plans best under conditions.

    Each gain may change by a factor of up to 4 from the vehicle's own. The cost is the 95 % quantile of the
    largest position error of flights, plus 5 cm for each 1 % of flights that are lost, miss a gate or hit its
    frame. The best gains and the vehicle's own are then flown on as many flights with other numbers; the
    result tells whether the new gains are better there.

    Args:
        plan: The plan, or several plans for one vehicle.
        conditions: The distributions that flights draw from, or the name of a preset or a file.
        flights: The number of flights of each plan for each set of gains.
        seed: Of the flights' draws.
        vehicle: The vehicle or its name, by default the plans' own.
        gains: The settings of its controller that may change: any of TUNABLE.
        evaluations: The largest number of sets of gains to try.
        time_limit: Of the search [s]; the best gains until then are validated.
        workers: Processes, by default one a core; 1 flies in this process; dask://HOST:PORT on a cluster.
        executor: Any of `concurrent.futures` that flies instead, as a `dask.distributed` client's.
        progress: Called after each set of gains with the number of sets so far and the lowest cost [m].
    Raises SpecError for plans of several vehicles, and for gains that are unknown or zero.
    """
    plans = (plan,) if isinstance(plan, Plan) else tuple(plan)
    flown = _vehicle_of(plans, vehicle)
    names = _checked(gains, flown.controller)
    own, varied = flown.controller, as_dispersion(conditions)
    training, others = range(flights), range(flights, 2 * flights)
    with pool(workers, executor, len(plans) * len(cut(training))) as flying:

        def fly(controller: Controller, numbers: range = training) -> FlightCosts:
            tasks = tuple(FlightTask(each, flown, varied, seed, controller) for each in plans)
            return FlightCosts.of(fly_scores(flying, tasks, numbers))

        with within_time(time_limit):
            found, costs, tried = _search(fly, own, names, evaluations, progress)
        trained = fly(own), costs
        fresh = fly(own, others), fly(found, others)
    return Tuning(flown, found, names, tried, trained, fresh, _confidence(*fresh, seed))


def _vehicle_of(plans: Sequence[Plan], vehicle: Vehicle | str | None) -> Vehicle:
    """Return the one vehicle that flies all plans."""
    if not plans:
        raise SpecError("plan must be one plan or more")
    first = vehicle_of(plans[0], vehicle)
    if any(vehicle_of(plan, vehicle) != first for plan in plans[1:]):
        raise SpecError("plan: the plans are of several vehicles; give vehicle, or tune for each by itself")
    return first


def _checked(gains: Sequence[str], controller: Controller) -> tuple[str, ...]:
    """Return the names of gains without repetition. Raises SpecError for unknown names and zero gains."""
    if not gains or isinstance(gains, str):
        raise SpecError(f"gains must be one or more of {', '.join(TUNABLE)}")
    for name in gains:
        if name not in TUNABLE:
            raise unknown_name("gain", name, TUNABLE)
        if getattr(controller, name) == 0.0:
            raise SpecError(f"gains: {name} is 0, which no factor changes; leave it out")
    return tuple(dict.fromkeys(gains))


class _Ended(Exception):
    """The search has used its time or its evaluations."""


def _search(
    fly: Callable[[Controller], FlightCosts],
    own: Controller,
    names: tuple[str, ...],
    evaluations: int,
    progress: Callable[[int, float], None] | None,
) -> tuple[Controller, FlightCosts, int]:
    """Return the best gains, their costs, and the number of sets that were tried.

    The vehicle's own gains are tried first. The search ends at convergence, or when time or evaluations are
    used.
    """
    from scipy.optimize import minimize

    best: tuple[Controller, FlightCosts] | None = None
    tried = 0

    def cost(logarithms: Array) -> float:
        nonlocal best, tried
        if tried and (tried >= evaluations or out_of_time()):
            raise _Ended
        factors = dict(zip(names, np.exp(logarithms).tolist(), strict=True))
        changed = {name: getattr(own, name) * factor for name, factor in factors.items()}
        controller = replace(own, **changed)
        costs = fly(controller)
        tried += 1
        if best is None or costs.cost < best[1].cost:
            best = controller, costs
        if progress is not None:
            progress(tried, best[1].cost)
        return costs.cost

    size, reach = len(names), np.log(MAX_FACTOR)
    first = np.vstack([np.zeros(size), np.log(_FIRST_FACTOR) * np.eye(size)])
    options = {
        "initial_simplex": first,
        "adaptive": True,
        "xatol": _RESOLUTION,
        "fatol": inf,
        "maxiter": evaluations,
    }
    with suppress(_Ended):
        minimize(cost, first[0], method="Nelder-Mead", bounds=[(-reach, reach)] * size, options=options)
    assert best is not None, "the vehicle's own gains are tried"
    return *best, tried


def _confidence(before: FlightCosts, after: FlightCosts, seed: int) -> tuple[float, float]:
    """Return the 95 % interval of the change in cost, by a paired bootstrap over flights."""
    rng = np.random.default_rng(seed)
    count: int = before.failed.shape[-1]
    picks = (rng.integers(count, size=(count,)) for _ in range(_RESAMPLES))
    differences = [after.resampled(pick).cost - before.resampled(pick).cost for pick in picks]
    low, high = np.quantile(differences, [0.025, 0.975])
    return float(low), float(high)
