"""min_requirements(): the smallest thrust-to-weight ratio, ceiling and gates that allow a plan."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from math import isfinite
from typing import Annotated

from pydantic import Field as Bounds

from aerobat.declaration import NonNegative, by_value, validated
from aerobat.errors import Infeasible
from aerobat.planning import Plan, Planner, as_planner
from aerobat.problem import Problem, as_problem
from aerobat.studies.feasibility.probe import TIME_LIMIT, Feasibility, Probe, ProbedTask, probe
from aerobat.studies.feasibility.quantities import NeededQuantity, named_quantities
from aerobat.studies.lens import Scenario
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle

GROWTH = 1.5  # factor between tried values while no plan is found
MAX_STEPS = 5  # largest number of such steps: up to 7.6 times the original value
Tolerance = Annotated[float, Bounds(ge=1e-4, le=0.5, description="number from 0.0001 to 0.5")]


@by_value
class Requirement:
    """The smallest value of a quantity with a plan, which proves it, and a refused value just below.

    Without a plan, the refused value is the largest one tried. Where feasibility is not monotone, smaller
    values may be feasible again; the result makes no statement about them.
    """

    quantity: str  # thrust-to-weight, ceiling or gate
    unit: str
    value: float | None  # smallest value with a plan, infinite for no limit; None where no plan was found
    plan: Plan | None  # certified, with a successful flight
    refused: float  # a value without a plan, close below `value`
    feasibility: Feasibility  # of the refused value
    refusal: str  # the reason, a sentence
    trials: int  # number of plans that were tried

    def __str__(self) -> str:
        """Return one line with the value, its plan and the refusal."""
        if self.value is None or self.plan is None:
            return f"{self.quantity}: none will do, {self.shown(self.refused)} neither: {self.refusal}"
        return (
            f"{self.quantity}: {self.shown(self.value)}, planned in {self.plan.duration:.3f} s; at "
            f"{self.shown(self.refused)} {self.feasibility}: {self.refusal}"
        )

    def shown(self, value: float) -> str:
        """Return a value of the quantity with its unit, as text."""
        return f"{value:.4g} {self.unit}".rstrip() if isfinite(value) else "no limit"


@validated
def min_requirements(
    problem: Problem | str,
    vehicle: Vehicle | str = "agile-quad",
    of: Sequence[str] | None = None,
    planner: Planner | str | None = None,
    *,
    tolerance: Tolerance = 0.01,
    time_limit: NonNegative = TIME_LIMIT,
    workers: Workers | None = None,
    executor: Executor | None = None,
    progress: Callable[[str, float, bool], None] | None = None,
) -> tuple[Requirement, ...]:
    """Find, by bisection, the smallest value of each quantity with which a problem has a plan.

    The other quantities keep their values. Each result comes with a plan, certified and flown, and with a
    value lower by about the tolerance at which no plan was found. If there is no plan at the original value,
    larger values are tried, up to 7.6 times as large.

    Args:
        problem: the problem or its name.
        vehicle: the vehicle or its name.
        of: any of "thrust-to-weight", the rotors' full thrust over the weight; "ceiling", the height that the
            path stays below; "gate", the openings of all gates as fractions of their sizes; "gate-height",
            their heights alone, which makes slits of them. By default all that the problem has but the last.
        planner: the planner or its registered name, by default the one that suits each problem.
        tolerance: relative gap between the answer and the refused value; for a ceiling, relative to its
            height above the highest point required, or to a metre where that is more.
        time_limit: of each plan [s]; a value without a plan by then counts as refused.
        workers: processes, by default one a core; 1 plans in this process; dask://HOST:PORT on a cluster.
        executor: any of `concurrent.futures` that plans instead, as a `dask.distributed` client's.
        progress: called with each quantity, value and whether it has a plan, as values are tried.

    Raises:
        SpecError: quantities are unknown, or the problem does not have one of them.
        Infeasible: no quantity has a sufficient value; the sentence says why.
    """
    chosen = None if planner is None else as_planner(planner)
    scenario = Scenario(as_problem(problem), as_vehicle(vehicle), chosen)
    searches = [_Search(q, scenario, tolerance) for q in named_quantities(of, scenario.problem)]
    tasks = tuple(ProbedTask(scenario, (search.quantity,), time_limit) for search in searches)
    runs = [search.run() for search in searches]
    parts = deque((number, next(run)) for number, run in enumerate(runs))  # one value of each at a time
    with pool(workers, executor, len(searches)) as planning:
        for (number, value), found in planning.results(_probe, tasks, parts):
            if progress is not None:
                progress(searches[number].quantity.name, value, found.is_planned)
            with suppress(StopIteration):
                parts.append((number, runs[number].send(found)))
    least = tuple(search.requirement for search in searches)
    if all(each.plan is None for each in least):
        raise Infeasible(f"'{scenario.problem.name}' has no plan on {scenario.vehicle.name}: {least[0]}")
    return least


def _probe(tasks: tuple[ProbedTask, ...], part: tuple[int, float]) -> Probe:
    number, value = part
    return probe(tasks[number], (value,))


@dataclass(eq=False)
class _Search:
    """The bisection of one quantity, between a refused value and one with a plan."""

    quantity: NeededQuantity
    scenario: Scenario
    tolerance: float
    planned: tuple[float, Probe] | None = None  # smallest value with a plan so far
    refused: tuple[float, Probe] | None = None  # largest refused value so far
    trials: int = 0

    def run(self) -> Generator[float, Probe, None]:
        """Yield the values to try, one after another; the caller sends the probe of each."""
        quantity = self.quantity
        floor = quantity.floor(self.scenario)
        yield from self._climb(quantity.own(self.scenario))
        if self.planned is not None and not isfinite(self.planned[0]):
            yield from self._climb(self._used + self._gap(self._used))
        while self.planned is not None and isfinite(self.planned[0]):
            least, most = self.planned[0], floor if self.refused is None else self.refused[0]
            gap = self._gap(least)
            if least - most > gap:
                # a value that the plan itself needs, such as its highest point, is feasible without a trial
                is_loose = self._used - most > gap
                yield from self._try(0.5 * (most + (min(least, self._used) if is_loose else least)))
            elif self.refused is None:
                yield from self._try(floor if least > floor else floor - gap)
            else:
                return

    @property
    def requirement(self) -> Requirement:
        """The result of the search."""
        assert self.refused is not None, "a search ends beside a refusal"
        value, found = (None, None) if self.planned is None else self.planned
        at, refusal = self.refused
        return Requirement(
            quantity=self.quantity.name,
            unit=self.quantity.unit,
            value=value,
            plan=None if found is None else found.plan,
            refused=at,
            feasibility=refusal.feasibility,
            refusal=refusal.sentence,
            trials=self.trials,
        )

    @property
    def _used(self) -> float:
        """The amount of the quantity that the last plan needs."""
        assert self.planned is not None, "there is a plan"
        assert self.planned[1].plan is not None
        return self.quantity.used(self.planned[1].plan)

    def _gap(self, value: float) -> float:
        """Return the gap between answer and refused value at which the search ends."""
        return self.tolerance * max(value - self.quantity.floor(self.scenario), self.quantity.least_size)

    def _climb(self, value: float) -> Generator[float, Probe, None]:
        """Yield a value to try, and larger ones while they are refused."""
        floor = self.quantity.floor(self.scenario)
        for _ in range(MAX_STEPS + 1):
            is_planned = yield from self._try(value)
            if is_planned or not isfinite(value):
                return
            value = floor + GROWTH * max(value - floor, self.quantity.least_size)

    def _try(self, value: float) -> Generator[float, Probe, bool]:
        found = yield value
        self.trials += 1
        if found.is_planned:
            self.planned = value, found
        else:
            self.refused = value, found
        return found.is_planned
