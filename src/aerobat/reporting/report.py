"""Facts of a run: its plan and its flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from aerobat.evaluation.score import Score
from aerobat.planning import Plan
from aerobat.reporting.facts import REPORT, Fact, Facts, facts, line, record
from aerobat.simulation.outcome import counted
from aerobat.studies.share import Trials
from aerobat.vehicle import implausibilities

PAGE = "docs/report.md"  # explains every line of a report, and its words


@dataclass(frozen=True, eq=False)
class Report:
    """A run's plan and flight. Facts of the level REPORT decide whether it is flown."""

    plan: Plan
    score: Score | None = None  # of its flight, where it was flown
    controller: str | None = None  # the name of what flew it
    plant: str | None = None  # the name of the other simulator whose physics it flew in, if it was one
    trials: Trials | None = None  # flights under random conditions, where they were flown

    @property
    def is_well(self) -> bool:
        """True if the plan is certified and flies, and its flight and enough trials, if any, succeed."""
        is_reliable = self.trials is None or self.trials.proven
        flew_well = self.score is None or (self.score.outcome.is_success and is_reliable)
        return self.plan.certified and self.plan.flies and flew_well


@facts.register
def _(report: Report) -> Iterator[Fact]:
    plan, trials = report.plan, report.trials
    name = None if plan.vehicle is None else plan.vehicle.name
    yield line("", f"{plan.problem.name} · {name}: {_verdict(report)}", level=REPORT)
    warnings = [] if plan.vehicle is None else implausibilities(plan.vehicle)
    yield from record(problem=plan.problem.name, vehicle=name, warnings=warnings)
    yield Fact("plan", plan, "plan")
    if report.score is not None:
        flown_by = {"controller": report.controller, "plant": report.plant}
        known = (Fact(key, value, key) for key, value in flown_by.items() if value is not None)
        yield Fact("flight", Facts((*facts(report.score), *known)), "flight")
    if trials is not None:
        yield _of_trials(trials)
    yield line("", f"{PAGE} explains every line")


def _of_trials(trials: Trials) -> Fact:
    """Return the fact of the flights under random conditions, with the remedy if too few succeed."""
    name, share = trials.conditions.name, trials.share
    low, high = share.interval
    values = record(
        conditions=name,
        seed=trials.seed,
        flights=share.of,
        succeeded=share.count,
        success_interval=[low, high],
        needed=trials.NEEDED,
        proven=trials.proven,
    )
    of_all = f"{share.range} of all, at 95 % confidence"
    failed = f"; the others: {counted(trials.failures)}" if trials.failures else ""
    remedy = "" if trials.proven else f"{failed}; plan for more with --pass {trials.NEEDED:g}"
    sentence = f"{name}: {share.count} of {share.of} flights succeed, so {of_all}{remedy}"
    style = "" if trials.proven else "red"
    return Fact("trials", Facts(values), "conditions", sentence, level=REPORT, style=style)


def _verdict(report: Report) -> str:
    """Return the outcome of a run in a few words."""
    if not report.plan.certified:
        return "not certified"
    if not report.plan.flies:
        return "certified, but not flyable"
    if report.score is not None and not report.score.outcome.is_success:
        return "certified, but this flight fails"
    if report.trials is not None and not report.trials.proven:
        conditions = f"under '{report.trials.conditions.name}' conditions"
        if report.trials.refuted:
            return f"certified, but too few flights succeed {conditions}"
        return f"certified, but not proven to succeed often enough {conditions}"
    if report.trials is None and report.plant is not None:  # the conditions are this flight's alone
        return "certified, and this flight succeeds"
    return "certified, and it flies" + ("" if report.trials is not None else " undisturbed")
