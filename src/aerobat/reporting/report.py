"""Facts of a run: its plan and its flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from aerobat.evaluation.score import Score
from aerobat.planning import Plan
from aerobat.reporting.facts import REPORT, Fact, Facts, facts, kept
from aerobat.vehicle import implausibilities

if TYPE_CHECKING:  # which takes long to import
    from aerobat.studies.sweep import Sweep


@dataclass(frozen=True, eq=False)
class Report:
    """A run's plan and flight. Facts of the level REPORT decide whether it is flown."""

    plan: Plan
    score: Score | None = None  # of its flight, where it was flown
    controller: str | None = None  # the name of what flew it
    plant: str | None = None  # the name of the other simulator whose physics it flew in, if it was one
    trials: Sweep | None = None  # flights under random conditions, where they were asked for


@facts.register
def _(report: Report) -> Iterator[Fact]:
    plan, trials = report.plan, report.trials
    name = None if plan.vehicle is None else plan.vehicle.name
    yield Fact("", text=f"{plan.problem.name} · {name}: {_verdict(report)}", level=REPORT)
    warnings = [] if plan.vehicle is None else implausibilities(plan.vehicle)
    yield from kept(problem=plan.problem.name, vehicle=name, warnings=warnings)
    yield Fact("plan", plan, "plan")
    if report.score is not None:
        flown_by = {"controller": report.controller, "plant": report.plant}
        known = (Fact(key, value, key) for key, value in flown_by.items() if value is not None)
        yield Fact("flight", Facts((*facts(report.score), *known)), "flight")
    if trials is not None:
        low, high = trials.success.interval
        values = kept(
            conditions=trials.conditions.name,
            seed=trials.seed,
            flights=len(trials),
            succeeded=trials.success.count,
            success_interval=[low, high],
        )
        of_all = f"{100.0 * low:.0f} to {100.0 * high:.0f} % of all, at 95 % confidence"
        under = f"under '{trials.conditions.name}' conditions"
        succeed = f"{trials.success.count} of {len(trials)} succeed {under}, so {of_all}"
        yield Fact("trials", Facts(values), "real flights", succeed, level=REPORT)


def _verdict(report: Report) -> str:
    """The outcome of a run in a few words."""
    if not report.plan.certified:
        return "not certified"
    if not report.plan.flies:
        return "certified, but not flyable"
    if report.score is not None and not report.score.outcome.is_success:
        return "certified, but this flight fails"
    return "certified, and it flies"
