"""compare(): all planners on one problem, side by side: duration, certificate and flight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from time import perf_counter

from aerobat.declaration import NonNegative, by_value, in_notebooks, validated
from aerobat.errors import BackendMissing, Infeasible, SpecError
from aerobat.evaluation.score import Score, score
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning import Attempt, Plan, Planner, TimeOptimal, as_planner, plan, registered_planners
from aerobat.planning.time_limit import best_by_limit
from aerobat.problem import Problem, as_problem
from aerobat.simulation import Flight, fly
from aerobat.studies.workers import Workers, pool
from aerobat.vehicle import Vehicle, as_vehicle


@by_value
class Entry:
    """The result of one planner: a plan and its flight, or the reason why there is no plan."""

    planner: str
    plan: Plan | None
    flight: Flight | None
    score: Score | None
    planning_time: float  # [s]
    outcome: str  # a sentence
    note: str = ""  # a remark on the plan, a sentence

    @property
    def certified(self) -> bool:
        """True if there is a plan that is proven to stay within the vehicle's limits."""
        return self.plan is not None and self.plan.certified


@validated
@in_notebooks
@by_value
class Comparison:
    """The results of all planners on one problem and one vehicle."""

    problem: Problem
    vehicle: Vehicle
    entries: tuple[Entry, ...]

    def __str__(self) -> str:
        """Return one line with the duration of each planner's plan."""
        found = (
            f"{entry.planner} {'no plan' if entry.plan is None else f'{entry.plan.duration:.3f} s'}"
            for entry in self.entries
        )
        return f"{self.problem.name} on {self.vehicle.name}: {', '.join(found)}"

    @validated
    def ratio(self, entry: Entry) -> float | None:
        """Return an entry's duration over the time-optimal plan's; None unless both exist."""
        optimal = next((e.plan for e in self.entries if e.planner == "time-optimal"), None)
        return None if optimal is None or entry.plan is None else entry.plan.duration / optimal.duration


@validated
def compare(
    problem: Problem | str,
    vehicle: Vehicle | str,
    planners: Sequence[tuple[str, Planner] | Planner | str] | None = None,
    progress: Callable[[Attempt], None] | None = None,
    begin: Callable[[str], None] | None = None,
    time_limit: NonNegative | None = None,
    *,
    workers: Workers = 1,
    executor: Executor | None = None,
) -> Comparison:
    """Plan a problem with each planner and fly each plan.

    If another planner's certified plan is faster than the time-optimal planner's, the time-optimal planner is
    started again from that plan (warm start); the better result is shown with a note. A planner without a
    plan, or whose solver is not installed, has an entry that says so. Raises Infeasible when no planner finds
    a plan, SpecError for invalid input.

    Args:
        problem: The problem or its name.
        vehicle: The vehicle or its name.
        planners: Planners, registered names, or pairs of a name and either; by default all registered
            planners.
        progress: Called with every attempt as it ends, of planners in this process.
        begin: Called with each planner's name when it begins, or when another process is done with it.
        time_limit: For each planner [s]; the best plan that it finds by then counts.
        workers: Processes, or dask://HOST:PORT; by default this one, where no planner slows another down.
        executor: Any of `concurrent.futures` that plans instead, as a `dask.distributed` client's.
    """
    problem, vehicle = as_problem(problem), as_vehicle(vehicle)
    if planners is None:
        compared = [(name, cls()) for name, cls in registered_planners().items()]
    else:
        compared = [_named(each) for each in planners]
    if not compared:
        raise SpecError("planners must be one planner or more; leave them out for all")
    begin = begin or (lambda name: None)
    task = _ComparisonTask(problem, vehicle, time_limit)
    found: list[Entry] = []
    with pool(workers, executor, len(compared)) as planning:
        if planning.is_here:
            for named in compared:
                begin(named[0])
                found.append(_entry(task, named, progress))
        else:
            done = {}
            for named, entry in planning.results(_entry, task, compared):
                begin(entry.planner)
                done[named] = entry
            found = [done[named] for named in compared]
    for i, (name, planner) in enumerate(compared):
        if isinstance(planner, TimeOptimal):
            begin(f"{name} again")
            left = None if time_limit is None else max(time_limit - found[i].planning_time, 0.0)
            with within_time(left):
                found[i] = _improved(task, found[i], planner, found, progress)
    entries = tuple(_with_twin(entry, found[:i]) for i, entry in enumerate(found))
    if all(entry.plan is None for entry in entries):
        raise Infeasible(
            f"no planner finds a plan for '{problem.name}' on {vehicle.name}: {entries[0].outcome}"
        )
    return Comparison(problem, vehicle, entries)


@dataclass(frozen=True)
class _ComparisonTask:
    """The data that all planners share."""

    problem: Problem
    vehicle: Vehicle
    time_limit: float | None  # [s] of each


def _named(planner: tuple[str, Planner] | Planner | str) -> tuple[str, Planner]:
    """Return the planner with its name."""
    if isinstance(planner, tuple):
        return planner[0], as_planner(planner[1])
    if isinstance(planner, str):
        return planner, as_planner(planner)
    return getattr(planner, "kind", type(planner).__name__), planner


def _improved(
    task: _ComparisonTask,
    entry: Entry,
    planner: TimeOptimal,
    others: Sequence[Entry],
    progress: Callable[[Attempt], None] | None,
) -> Entry:
    """Return the time-optimal planner's entry, warm-started from the fastest certified plan that beats it."""
    faster = [other.plan for other in others if other.certified and other.plan is not None]
    best = min(faster, key=lambda plan: plan.duration, default=None)
    alone = None if entry.plan is None or not entry.certified else entry.plan.duration
    if best is None or (alone is not None and best.duration >= alone) or out_of_time():
        return entry
    again = _entry(task, (entry.planner, replace(planner, start=best)), progress)
    found = "no plan" if alone is None else f"{alone:.3f} s"
    note = f"begun again from the plan of {best.duration:.3f} s by {best.planner}; {found} alone"
    if again.plan is None or (alone is not None and again.plan.duration >= alone):
        return replace(entry, note=f"{note}, and no shorter plan from there")
    return replace(again, note=note, planning_time=entry.planning_time + again.planning_time)


def _with_twin(entry: Entry, before: Sequence[Entry]) -> Entry:
    """Return the entry, with a note if an earlier entry has exactly the same path."""
    for other in before:
        same = entry.plan and other.plan and entry.plan.trajectory == other.plan.trajectory
        if same:
            notes = (entry.note, f"the same path as {other.planner}'s")
            return replace(entry, note="; ".join(filter(None, notes)))
    return entry


def _entry(
    task: _ComparisonTask, named: tuple[str, Planner], progress: Callable[[Attempt], None] | None = None
) -> Entry:
    """Return the result of one planner within the time limit, and the flight of its plan."""
    name, planner = named
    with within_time(task.time_limit):
        started = perf_counter()
        try:
            found = plan(task.problem, planner, task.vehicle, progress)
        except (Infeasible, BackendMissing) as error:
            outcome = error.sentence if isinstance(error, Infeasible) else str(error)
            return Entry(name, None, None, None, perf_counter() - started, outcome)
        spent = perf_counter() - started
        flight = fly(found, task.vehicle)
        flown = score(flight, found, task.vehicle)
        warnings = () if found.assessment is None else found.assessment.warnings
        note = "; ".join(filter(None, (best_by_limit(found), found.rescue, *warnings)))
        return Entry(name, found, flight, flown, spent, flown.sentence, note)
