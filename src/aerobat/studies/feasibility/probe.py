"""One scenario planned: whether there is a plan, which limits bind, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf
from typing import Protocol

from aerobat.certification import Finding
from aerobat.errors import Infeasible, SpecError, limits_of
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning import Plan, plan
from aerobat.planning.assessment.contradiction import contradiction
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.problem.limits import UNITS
from aerobat.studies.lens import Scenario

AS_NEAR = 0.01  # of a limit's size: closer than plans that use all of it come to tell apart
TIME_LIMIT = 30.0  # [s] of planning, where no other is given: most scenarios take one


class Feasibility(StrEnum):
    """An answer to whether there is a plan."""

    PLANNED = "planned"  # certified, and it flies
    NOT_FLYABLE = "not flyable"  # planned, but not certified, or its own flight is not as it should be
    NO_PLAN = "no plan"  # the planner finds none, which proves nothing
    REFUSED = "refused at sight"  # what is asked contradicts itself, the limits or the vehicle
    NO_ANSWER = "no answer"  # in the time given


@dataclass(frozen=True, eq=False)
class Probe:
    """The answer for one scenario."""

    feasibility: Feasibility
    sentence: str  # the proof, or why there is none
    limits: tuple[str, ...]  # that bind, by the names of their fields; none where that is not known
    plan: Plan | None = None

    @property
    def is_planned(self) -> bool:
        """True where there is a plan that is certified and flies."""
        return self.feasibility is Feasibility.PLANNED


class Variable(Protocol):
    """Something of a scenario that can be set to a number."""

    def set(self, whole: Scenario, value: float) -> Scenario:
        """The scenario with it at a value. Raises SpecError where that cannot be."""


@dataclass(frozen=True, eq=False)
class ProbedTask:
    """A scenario of which something varies, and how each is planned."""

    scenario: Scenario
    variables: tuple[Variable, ...]
    time_limit: float  # [s] of each
    flights: range = range(0)  # of each plan, under the scenario's conditions
    seed: int = 0  # of the flights

    def varied(self, values: Sequence[float]) -> Scenario:
        """The scenario where the variables have these values. Raises SpecError where that cannot be."""
        scenario = self.scenario
        for variable, value in zip(self.variables, values, strict=True):
            scenario = variable.set(scenario, value)
        return scenario


def probe(task: ProbedTask, values: Sequence[float]) -> Probe:
    """The answer where the variables have these values."""
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
    """The limits that a certified plan comes nearest to, as parts of their sizes, and all that are as near.

    Where it begins and ends does not count: there it is as it was asked to be.
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
    return tuple(sorted(name for name, margin in nearest.items() if margin <= least + AS_NEAR))


def least_reserve(plan: Plan) -> float | None:
    """The fraction of its range that every rotor is proven to keep from either limit; None where unknown."""
    if plan.certificate is None or plan.certificate.worst is None:
        return None
    return reserve_shortfalls(plan.certificate, 1.0)[0].kept


def _size(finding: Finding, plan: Plan) -> float:
    """The size of what a limit is about, in its unit: of positions how far the path goes."""
    assert finding.limit is not None, "a finding about a limit has one"
    if finding.unit != UNITS[0]:
        return finding.size or abs(finding.limit) or 1.0
    lowest, highest = plan.trajectory.component_range(0)
    return max(float((highest - lowest).max()), abs(finding.limit) * 1e-9, 1e-9)
