"""why(): which bound makes a problem infeasible, and which changes give it a plan.

Every remedy was tried and comes with its plan.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import reduce

from aerobat.declaration import by_value, short, validated
from aerobat.errors import BackendMissing, Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, within_time, work
from aerobat.planning import Plan, Planner, as_planner, plan, registered_planners, suited_planner
from aerobat.planning.planners import planner_with_reserve
from aerobat.problem import Problem, as_problem
from aerobat.studies.feasibility.probe import TIME_LIMIT
from aerobat.studies.why.changes import Change, Request, changes
from aerobat.vehicle import Vehicle, as_vehicle

# work limit [s] of the plan of each change: twice that of a refusal
CHANGE_WORK = 10.0
Tried = Callable[[str, bool], None]


@short
@by_value
class Remedy:
    """Changes with which a problem has a plan, and the plan."""

    changes: tuple[str, ...]  # in words, to be made together; empty where another planner suffices
    plan: Plan

    def __str__(self) -> str:
        """Return the changes, and the planner that succeeds."""
        return f"{_in_words(self.changes)} (by {self.plan.planner} in {self.plan.duration:.3f} s)"


@short
@by_value
class Why:
    """Why a problem has no plan, and the remedies."""

    problem: str  # its name
    refusal: str  # a sentence that names the binding bound; empty where there is a plan
    limits: tuple[str, ...]  # names of the fields of the bounds in `refusal`
    remedies: tuple[Remedy, ...]  # each sufficient by itself
    tried: tuple[str, ...]  # the changes that were tried, each alone

    @property
    def advice(self) -> str:
        """The changes that help, as a sentence without a full stop."""
        if self.remedies:
            return f"'{self.problem}' is planned {', or '.join(map(str, self.remedies))}"
        if not self.tried:
            return f"'{self.problem}' leaves nothing to change that might help"
        return f"'{self.problem}' is not planned {', '.join(self.tried)}, nor with all of that together"

    def __str__(self) -> str:
        """Return the refusal and the advice."""
        return "; ".join(filter(None, (self.refusal, self.advice)))


@validated
def why(
    problem: Problem | str,
    planner: Planner | str | None = None,
    vehicle: Vehicle | str | None = None,
    progress: Tried | None = None,
) -> Why:
    """Find out why a problem has no plan, and which changes give it one.

    Changes are tried one at a time: without each limit, with stronger rotors, with stages at any time, and so
    on. If no change suffices alone, a smallest sufficient set of them is searched. Each change is planned by
    `planner`, by the planner that suits the problem, and by all other registered ones. This ends with the
    first plan that is certified and flies, or after 10 s of work. The whole search takes up to
    minutes.

    Args:
        problem: The problem or its name.
        planner: The planner or its registered name; left out, the planner that suits the problem.
        vehicle: The vehicle or its name.
        progress: Called with each change, and whether it helps, as they are tried.

    Raises:
        SpecError: The input is invalid, such as a vehicle that does not fit through its gate.
    """
    chosen = None if planner is None else as_planner(planner)
    flown_by = None if vehicle is None else as_vehicle(vehicle)
    task = Request(as_problem(problem), flown_by, chosen)
    try:
        found = plan(task.problem, task.planner, task.vehicle)
    except Infeasible as refusal:
        return explained(refusal, task, progress)
    return Why(task.problem.name, "", (), (Remedy((), found),), ())


def explained(refusal: Infeasible, task: Request, progress: Tried | None = None) -> Why:
    """Return the explanation of a task's refusal by its planner.

    `progress` is called with each change, and whether it helps, as they are tried.
    """
    search = _RemedySearch(task, progress or (lambda words, helps: None))
    # a refusal without attempts is proven, so that no other planner would help without a change
    unchanged = search.remedy([]) if refusal.attempts else None
    found = search.by_changes() if unchanged is None else [unchanged]
    return Why(task.problem.name, refusal.sentence, refusal.limits, tuple(found), tuple(search.tried))


class _RemedySearch:
    """The search for changes with which a task has a plan."""

    def __init__(self, task: Request, progress: Tried) -> None:
        self.task, self.progress = task, progress
        self.tried: list[str] = []

    def by_changes(self) -> list[Remedy]:
        """Return the changes that suffice alone; if there are none, a smallest sufficient set."""
        found = list(changes(self.task))
        alone = []
        for change in found:
            if out_of_time():
                break
            self.tried.append(change.words)
            alone.append(self.remedy([change]))
        helpful = [each for each in alone if each is not None]
        return helpful or (self._fewest(found) if len(found) > 1 else [])

    def _fewest(self, found: list[Change]) -> list[Remedy]:
        """Return a set of sufficient changes of which none can be left out (greedy elimination)."""
        best = self.remedy(found)
        kept = found if best is not None else []
        for change in list(kept):
            fewer = [each for each in kept if each is not change]
            again = self.remedy(fewer) if len(fewer) > 1 and not out_of_time() else None
            if again is not None:
                kept, best = fewer, again
        return [] if best is None else [best]

    def remedy(self, several: list[Change]) -> Remedy | None:
        """Return the plan with several changes, or with none by another planner; None where there is none."""
        changed = reduce(lambda task, change: change.apply(task), several, self.task)
        planners = _planners(changed, refused=not several)
        with within_time(CHANGE_WORK if several else TIME_LIMIT, work):
            found = next(filter(None, (_planned(changed, planner) for planner in planners)), None)
        words = tuple(change.words for change in several)
        self.progress(_in_words(words), found is not None)
        return None if found is None else Remedy(words, found)


def _planners(task: Request, refused: bool) -> Iterator[Planner]:
    """Yield the planners to try: the task's unless it has refused, the one that suits, all others.

    All keep the task's reserve. Without a vehicle no others are tried, since only miqp holds the problem's
    limits.
    """
    suits = suited_planner(task.problem, task.vehicle)
    suited = planner_with_reserve(suits, task.reserve)
    asked = suited if task.planner is None else task.planner
    if not refused:
        yield asked
    if suited != asked:
        yield suited
    others = [name for name, cls in registered_planners().items() if cls not in (type(asked), type(suited))]
    for name in sorted(others, key=lambda name: name != "time-optimal") if task.vehicle is not None else ():
        yield planner_with_reserve(name, task.reserve)


def _planned(task: Request, planner: Planner) -> Plan | None:
    """Return the planner's plan; None where there is none.

    For a vehicle, the plan must be certified, keep the task's reserve and fly as it should.
    """
    if out_of_time():
        return None
    try:
        found = plan(task.problem, planner, task.vehicle)
    except (Infeasible, SpecError, BackendMissing):
        return None
    if task.vehicle is None:
        return found
    return found if found.keeps(task.reserve) and found.flies else None


def _in_words(changes: tuple[str, ...]) -> str:
    """Join changes in words; without any, the task as it is."""
    return " and ".join(changes) or "as it is"
