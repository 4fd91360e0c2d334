"""The report of a run in a few lines: does it fly, how long, what limits it, how much margin, what happened.

`tables` has all facts of a plan and its flight; these are the ones that decide whether it is flown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf, isnan
from typing import TYPE_CHECKING

from rich.table import Table
from rich.text import Text

from aerobat.certification import Certificate, Side
from aerobat.evaluation import Score
from aerobat.planning import Assessment, Flyability, Plan
from aerobat.reporting.tables import Fact, facts_table, lap_facts, reached, tube_facts

if TYPE_CHECKING:  # which takes long to import
    from aerobat.studies.sweep import Sweep

SMALL = 1e-4  # [m]: smaller errors mean nothing in a simulation that knows the vehicle
ENOUGH_MARGIN = 0.05  # of a rotor's thrust: with less, few real flights succeed
ENOUGH_FLIGHTS = 0.95  # of all under random conditions: a plan that is proven to have fewer succeed is poor
SEVERAL_TIMES = 2.0  # times the shortest possible: no percentage beyond


def summary(plan: Plan, vehicle: str, score: Score | None = None, trials: Sweep | None = None) -> Table:
    """Return the report of a run, a fact a row, under a verdict.

    Args:
        plan: The plan, for a vehicle.
        vehicle: The name of the vehicle.
        score: The score of the plan's flight, where it was flown.
        trials: Flights under random conditions, where they were asked for.
    """
    title = f"{plan.problem.name} · {vehicle}: {_verdict(plan, score, trials)}"
    return facts_table(title, {"": _facts(plan, score, trials)})


def too_few_succeed(trials: Sweep | None) -> bool:
    """Return True where flights prove that fewer than `ENOUGH_FLIGHTS` of all succeed."""
    return trials is not None and trials.success.interval[1] < ENOUGH_FLIGHTS


def _verdict(plan: Plan, score: Score | None, trials: Sweep | None) -> str:
    """Whether the maneuver flies, in a few words."""
    if not plan.certified:
        return "not certified"
    if not plan.flies:
        return "certified, but not flyable"
    if score is not None and not score.outcome.is_success:
        return "certified, but this flight fails"
    if too_few_succeed(trials):
        return "certified, but too few real flights succeed"
    return "certified, and it flies"


def _facts(plan: Plan, score: Score | None, trials: Sweep | None) -> Iterable[Fact]:
    """Yield the facts, each with its name."""
    found = plan.assessment
    yield "duration", f"{plan.duration:.2f} s{'' if found is None or found.poor else _beside_least(found)}"
    if plan.rescue:
        yield "planner", plan.rescue
    if plan.certificate is not None:
        yield _limiting(plan.certificate)
    if plan.flyability is not None:
        yield from _margin(plan.flyability)
    if plan.tube is not None:
        yield from tube_facts(plan.tube, plan.duration)
    if found is not None:
        yield "space", reached(found, decimals=0)
    if score is not None:
        yield from _flight(score)
        yield from lap_facts(score)
    if trials is not None:
        yield "real flights", _success_of(trials)
    for warning in () if found is None else found.warnings:
        yield "warning", Text(warning, style="red")
    if plan.wants_second_opinion:
        yield "warning", Text("it may take longer than need be; --explain asks another planner", style="red")


def _limiting(found: Certificate) -> Fact:
    """Return the quantity that is nearest to its limit, or the reason why a plan is not certified."""
    worst = found.worst
    if not found.certified or worst is None or worst.limit is None:
        return "not proven", Text(found.why, style="red")
    allowed = f"{'at most' if worst.side is Side.MAX else 'at least'} {worst.shown(worst.limit, 2)}"
    return "limited by", f"{worst.name}: {worst.shown(worst.value, 2)} at {worst.time:.2f} s, {allowed}"


def _beside_least(found: Assessment) -> str:
    """Return how near a duration is to the proven lower bound."""
    if found.ratio == inf:
        return ""
    if found.ratio > SEVERAL_TIMES:
        return f", at most {found.ratio:.1f} times the shortest possible"
    return f", at most {100.0 * (found.ratio - 1.0):.0f} % above the shortest possible"


def _margin(found: Flyability) -> Iterable[Fact]:
    """Yield how much thrust the plan leaves to the controller."""
    if found.defects:
        yield "not flyable", Text(str(found), style="red")
        return
    kept = found.disturbed_fraction
    if not found.disturbance:
        yield "margin", "no thrust is left to the controller: too little for a real flight; try --reserve 0.1"
        return
    little = "" if kept >= ENOUGH_MARGIN else ": little for a real flight; try --reserve 0.1"
    moved = f"a loss as large moves the vehicle {_length(found.disturbed_error)} off its path"
    yield "margin", f"{100.0 * kept:.2g} % of a rotor's thrust{little}; {moved}"


def _flight(score: Score) -> Iterable[Fact]:
    """Yield what came of the flight."""
    if not score.outcome.is_success:
        yield "flight", Text(score.sentence, style="red")
        return
    gates = [passage for passage in score.passages if not isnan(passage.time)]
    if gates:
        name = gates[0].gate if len(gates) == 1 else f"{len(gates)} gates"
        speeds = _span([passage.speed for passage in gates], "m/s")
        clearances = [passage.clearance for passage in gates if not isnan(passage.clearance)]
        clear = f", {_length(min(clearances))} clear of the frame" if clearances else ""
        yield name, f"passed at {speeds}{clear}"
    if score.waypoints:
        nearest = max(waypoint.miss for waypoint in score.waypoints)
        yield "waypoints", f"{len(score.waypoints)} reached within {_length(nearest)}"
    yield "flight", f"on its path within {_length(score.max_position_error_m)}"


def _span(values: Sequence[float], unit: str) -> str:
    """Return one value, or the least and the greatest of several."""
    low, high = f"{min(values):.1f}", f"{max(values):.1f}"
    return f"{low} {unit}" if low == high else f"{low} to {high} {unit}"


def _length(metres: float) -> str:
    """Return a length with the digits that mean something: in mm, in cm from a centimetre on, then in m."""
    unit, size = ("m", 1.0) if metres >= 1.0 else ("cm", 1e-2) if metres >= 1e-2 else ("mm", 1e-3)
    return f"{max(metres, SMALL) / size:.2g} {unit}"


def _success_of(trials: Sweep) -> Text:
    """Return how many flights succeed, and what that says of all."""
    low, high = trials.success.interval
    name = trials.conditions.name
    found = (
        f"{trials.success.count} of {len(trials)} succeed under '{name}' conditions, so "
        f"{100.0 * low:.0f} to {100.0 * high:.0f} % of all, at 95 % confidence"
    )
    if not too_few_succeed(trials):
        return Text(found)
    remedy = f"--pass {ENOUGH_FLIGHTS:g} --conditions {name} plans for more"
    return Text(f"{found}; {remedy}", style="red")
