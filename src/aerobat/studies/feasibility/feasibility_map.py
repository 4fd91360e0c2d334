"""feasibility_map(): for which values of two fields there is a plan, and which limits bind where."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from itertools import chain, product
from math import isnan, nan, prod
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import NonNegative, PathName, Seed, by_value, in_notebooks, to_table, validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.errors import SpecError
from aerobat.planning import Planner, as_planner
from aerobat.problem import Problem, as_problem
from aerobat.studies.feasibility.axis import MAX_CELLS, Axis
from aerobat.studies.feasibility.probe import TIME_LIMIT, Feasibility, ProbedTask, least_reserve, probe
from aerobat.studies.flights import Flights, FlightTask, fly_scores, passed
from aerobat.studies.kept import KeptParts, fingerprint
from aerobat.studies.lens import Lens, Scenario, lens
from aerobat.studies.share import Share
from aerobat.studies.workers import Pool, Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle


@by_value
class Cell:
    """The result for one value of each field."""

    values: tuple[float, ...]  # in the axes' order
    feasibility: Feasibility
    duration: float | None  # [s] of the plan; None where there is none
    limits: tuple[str, ...]  # names of the fields of the limits that bind; empty where unknown
    reserve: float | None  # fraction of its range that every rotor provably keeps from either limit
    sentence: str  # the proof, or the reason why there is no plan
    passed: Share | None = None  # of flights under the scenario's conditions; None without conditions

    @property
    def is_planned(self) -> bool:
        """True where there is a plan that is certified and flies."""
        return self.feasibility is Feasibility.PLANNED

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays that files keep of the cell."""
        numbers = [nan if number is None else number for number in (self.duration, self.reserve)]
        passed = [] if self.passed is None else [self.passed.count, self.passed.of]
        words = [self.feasibility.value, self.sentence, *self.limits]
        return {"numbers": np.array(numbers), "passed": np.array(passed, dtype=int), "words": np.array(words)}

    @classmethod
    def of(cls, values: tuple[float, ...], arrays: Mapping[str, NDArray[Any]]) -> Cell | None:
        """Return the cell of these values from the arrays of a file; None where the arrays are no cell."""
        if set(arrays) != {"numbers", "passed", "words"}:
            return None
        duration, reserve = (None if isnan(number) else number for number in arrays["numbers"].tolist())
        feasibility, sentence, *limits = arrays["words"].tolist()
        passed = Share(*arrays["passed"].tolist()) if len(arrays["passed"]) else None
        return cls(values, Feasibility(feasibility), duration, tuple(limits), reserve, sentence, passed)


@in_notebooks
@by_value
class FeasibilityMap:
    """The feasibility of a problem over the values of one or two fields: a cell for each, row by row."""

    problem: Problem
    vehicle: Vehicle
    axes: tuple[Axis, ...]
    cells: tuple[Cell, ...]  # row-major: the first field's first value with each of the second's, and so on

    def __str__(self) -> str:
        """Return one line with the number of cells of each kind."""
        over = " and ".join(axis.name for axis in self.axes)
        counts = ", ".join(f"{count} {feasibility}" for feasibility, count in self.counts.items())
        return f"{self.problem.name} on {self.vehicle.name} over {over}: {counts}"

    @property
    def counts(self) -> Mapping[Feasibility, int]:
        """The number of cells of each kind, in the order of the kinds."""
        counted = Counter(cell.feasibility for cell in self.cells)
        return {each: counted[each] for each in Feasibility if counted[each]}

    @property
    def table(self) -> Mapping[str, NDArray[Any]]:
        """The cells as a table, a row for each: a column for each field by its name, then the results.

        Columns `feasibility`, `limits` and `sentence` are text; `duration_s`, `reserve` and `passed` are
        numbers, NaN where there is no plan, or no flight.
        """
        columns = {axis.name: np.array([c.values[i] for c in self.cells]) for i, axis in enumerate(self.axes)}
        columns |= {
            "feasibility": np.array([cell.feasibility.value for cell in self.cells]),
            "duration_s": np.array([nan if c.duration is None else c.duration for c in self.cells]),
            "limits": np.array([", ".join(cell.limits) for cell in self.cells]),
            "reserve": np.array([nan if c.reserve is None else c.reserve for c in self.cells]),
            "passed": np.array([nan if c.passed is None else c.passed.fraction for c in self.cells]),
            "sentence": np.array([cell.sentence for cell in self.cells]),
        }
        return MappingProxyType(columns)


@validated
def feasibility_map(
    problem: Problem | str,
    over: Mapping[str, Any],
    vehicle: Vehicle | str = "agile-quad",
    planner: Planner | str | None = None,
    *,
    time_limit: NonNegative = TIME_LIMIT,
    conditions: Dispersion | str | None = None,
    flights: Flights = 100,
    seed: Seed = 0,
    workers: Workers | None = None,
    executor: Executor | None = None,
    keep: PathName | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> FeasibilityMap:
    """Plan a problem for all values of one or two fields, and report which limits bind.

    Every cell is planned independently, as `plan` would with these values. Unlike `plan`, a refusal tries no
    changes that would help, and contradictory requirements are refused without a search.

    Args:
        problem: the problem or its name.
        over: the values of each field, by its name: `{"angle": [0, 45, 90], "speed": range(2, 21, 2)}`. Names
            are those of `lens`, as `limits.velocity`, `gates[0].width`, `vehicle.mass`, `planner.reserve`;
            the last part alone where no other field has it; `angle` for the tilt of a half-flip's gate.
        vehicle: the vehicle or its name.
        planner: the planner or its registered name, by default the one that suits each problem.
        time_limit: for each cell [s].
        conditions: conditions or their name, under which each plan is flown; their fields can be varied too.
        flights: number of flights of each plan under conditions.
        seed: of the flights.
        workers: processes, by default one a core; 1 plans in this process; dask://HOST:PORT on a cluster.
        executor: any of `concurrent.futures` that plans instead, as a `dask.distributed` client's.
        keep: a folder for finished cells, from which an interrupted map is resumed; it stays.
        progress: called, as cells finish, with the number of finished cells and of planned ones.

    Raises SpecError for names of no field, for values that a field cannot take, and for a folder that keeps
    another map's cells.
    """
    chosen = None if planner is None else as_planner(planner)
    varied = None if conditions is None else as_dispersion(conditions)
    scenario = Scenario(as_problem(problem), as_vehicle(vehicle), chosen, varied)
    axes = tuple(Axis.of(name, values) for name, values in over.items())
    fields = _fields(axes, scenario)
    task = ProbedTask(scenario, fields, time_limit, range(flights), seed)
    places = list(product(*(axis.values for axis in axes)))
    kept = KeptParts.of(keep, "cells", "map", lambda: _inputs_summary(axes, task))
    known = kept.known(places, Cell.of)
    missing = [values for values in places if values not in known]
    cells: dict[tuple[float, ...], Cell] = {}
    planned = 0
    with pool(workers, executor, len(missing)) as planning:
        for values, cell in chain(known.items(), kept.keeping(planning.results(_cell, task, missing))):
            cells[values] = cell
            planned += cell.is_planned
            if progress is not None:
                progress(len(cells), planned)
    axes = tuple(replace(axis, unit=field.unit) for axis, field in zip(axes, fields, strict=True))
    found = tuple(cells[values] for values in places)
    return FeasibilityMap(scenario.problem, scenario.vehicle, axes, found)


def _inputs_summary(axes: Sequence[Axis], task: ProbedTask) -> dict[str, Any]:
    """Return a summary of everything, beside their values, that the results of cells depend on."""
    parts = vars(task.scenario).items()  # the problem, the vehicle and so on
    return {
        **{name: None if part is None else fingerprint(to_table(part)) for name, part in parts},
        "fields": [axis.name for axis in axes],
        "time limit": task.time_limit,
        "flights": [task.flights.stop, task.seed],
    }


def _fields(axes: Sequence[Axis], scenario: Scenario) -> tuple[Lens, ...]:
    """Return the fields of axes. Raises SpecError for axes that are no map of a scenario."""
    if not 1 <= len(axes) <= 2:
        raise SpecError(f"over must name one field or two, got {len(axes)}")
    cells = prod(len(axis.values) for axis in axes)
    if cells > MAX_CELLS:
        raise SpecError(f"over: {cells} cells are too many, {MAX_CELLS} at most; take larger steps")
    fields = tuple(lens(axis.name, scenario) for axis in axes)
    if len({field.place for field in fields}) < len(fields):
        raise SpecError(f"over: {axes[0].name} and {axes[1].name} are the same field; drop one of them")
    for field, axis in zip(fields, axes, strict=True):
        field.require(scenario, axis.values)
    return fields


def _cell(task: ProbedTask, values: tuple[float, ...]) -> Cell:
    found = probe(task, values)
    plan, share = found.plan, None
    if plan is not None and found.is_planned and task.scenario.conditions is not None:
        varied = task.varied(values)
        assert varied.conditions is not None, "a field of conditions is varied, not whether there are any"
        flown = FlightTask(plan, varied.vehicle, varied.conditions, task.seed, varied.vehicle.controller)
        (scores,) = fly_scores(Pool(), (flown,), task.flights)
        share = passed(scores)
    return Cell(
        values=values,
        feasibility=found.feasibility,
        duration=None if plan is None else plan.duration,
        limits=found.limits,
        reserve=None if plan is None else least_reserve(plan),
        sentence=found.sentence,
        passed=share,
    )
