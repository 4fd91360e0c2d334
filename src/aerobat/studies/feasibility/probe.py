"""Plan one scenario: report a plan and its binding limits, or why there is no plan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf

from aerobat.certification import Finding
from aerobat.errors import Infeasible, SpecError, limits_of
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning import Plan, plan
from aerobat.planning.assessment.contradiction import contradiction
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.problem.limits import UNITS
from aerobat.studies.feasibility.quantities import NeededQuantity
from aerobat.studies.lens import Lens, Scenario

BINDING_TOLERANCE = 0.01  # of a limit's size, tolerance within which limits bind equally
TIME_LIMIT = 30.0  # [s] default time limit of planning: most scenarios take 1 s


class Feasibility(StrEnum):
    """The result of an attempt to plan a scenario."""

    PLANNED = "planned"  # certified, with a successful flight
    NOT_FLYABLE = "not flyable"  # planned, but not certified, or with an unsuccessful flight
    NO_PLAN = "no plan"  # the planner finds none, which does not prove infeasibility
    REFUSED = "refused at sight"  # provably infeasible: contradictory requirements, limits or vehicle
    NO_ANSWER = "no answer"  # within the time limit


@dataclass(frozen=True, eq=False)
class Probe:
    """The result of planning one scenario."""

    feasibility: Feasibility
    sentence: str  # the proof, or the reason why there is no plan
    limits: tuple[str, ...]  # names of the fields of the limits that bind; empty where unknown
    plan: Plan | None = None

    @property
    def is_planned(self) -> bool:
        """True where there is a plan that is certified and flies."""
        return self.feasibility is Feasibility.PLANNED


@dataclass(frozen=True, eq=False)
class ProbedTask:
    """A scenario with the variables that are changed, and the settings of planning and flights."""

    scenario: Scenario
    variables: tuple[Lens | NeededQuantity, ...]
    time_limit: float  # [s] for each plan
    flights: range = range(0)  # of each plan, under the scenario's conditions
    seed: int = 0  # of the flights

    def varied(self, values: Sequence[float]) -> Scenario:
        """Return the scenario with these values of the variables. Raises SpecError for impossible values."""
        scenario = self.scenario
        for variable, value in zip(self.variables, values, strict=True):
            scenario = variable.set(scenario, value)
        return scenario


def probe(task: ProbedTask, values: Sequence[float]) -> Probe:
    """Return the result for these values of the variables."""
    try:
        scenario = task.varied(values)
        found = contradiction(scenario.problem, scenario.vehicle)
        if found is not None:
            limits = found.limits or (f"stage '{found.stage}'",)
            return Probe(Feasibility.REFUSED, found.sentence, limits)
        return _planned(scenario, task)
    except SpecError as error:
        return Probe(Feasibility.REFUSED, str(error), error.limits)


def _planned(scenario: Scenario, task: ProbedTask) -> Probe:
    with within_time(task.time_limit):
        try:
            found = plan(scenario.problem, scenario.planner, scenario.vehicle)
        except Infeasible as error:
            reason = Feasibility.NO_PLAN if error.attempts else Feasibility.REFUSED
            return Probe(Feasibility.NO_ANSWER if out_of_time() else reason, error.sentence, error.limits)
    assert found.certificate is not None, "a plan for a vehicle is certified"
    assert found.flyability is not None, "and flown"
    if found.certified and found.flies:
        return Probe(Feasibility.PLANNED, found.certificate.why, binding_limits(found), found)
    if not found.certified:
        return Probe(Feasibility.NOT_FLYABLE, found.certificate.why, limits_of(found.certificate.why), found)
    why = f"its own flight {' and '.join(found.flyability.defects)}"
    at_fault = [f"gate '{passage.gate}'" for passage in found.flyability.passages if passage.failure]
    nearest = found.flyability.nearest
    if nearest is not None and nearest.failure is not None:
        at_fault.append(f"'{nearest.obstacle}'")
    return Probe(Feasibility.NOT_FLYABLE, why, tuple(at_fault), found)


def binding_limits(plan: Plan) -> tuple[str, ...]:
    """Return the limits to which a certified plan comes nearest, relative to their sizes, with near ties.

    Start and goal of the path do not count, since their states are prescribed.
    """
    assert plan.certificate is not None, "a plan for a vehicle has a certificate"
    ends = (0.0, plan.duration)
    nearest: dict[str, float] = {}
    for finding in plan.certificate.findings:
        if finding.margin is None or finding.place is not None or finding.time in ends:
            continue
        if finding.field:
            margin = finding.margin / _size(finding, plan)
            nearest[finding.field] = min(nearest.get(finding.field, inf), margin)
    least = min(nearest.values(), default=inf)
    return tuple(sorted(name for name, margin in nearest.items() if margin <= least + BINDING_TOLERANCE))


def least_reserve(plan: Plan) -> float | None:
    """Return the fraction of its range that every rotor provably keeps from either limit; None if unknown."""
    if plan.certificate is None or plan.certificate.worst is None:
        return None
    return reserve_shortfalls(plan.certificate, 1.0)[0].kept


def _size(finding: Finding, plan: Plan) -> float:
    """Return the scale of a finding's quantity in its unit; for positions, the extent of the path."""
    assert finding.limit is not None, "a finding about a limit has one"
    if finding.unit != UNITS[0]:
        return finding.size or abs(finding.limit) or 1.0
    lowest, highest = plan.trajectory.component_range(0)
    return max(float((highest - lowest).max()), abs(finding.limit) * 1e-9, 1e-9)
