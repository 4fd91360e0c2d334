"""Facts of plans: the plan, its certificate, its own flights, and its assessment."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from math import degrees, inf
from typing import TYPE_CHECKING

import numpy as np

from aerobat.certification import Certificate, Finding, Side, Verdict
from aerobat.planning import Assessment, Attempt, Flyability, Plan, Tube
from aerobat.planning.flyability import FlownPassage
from aerobat.planning.heading.follow import heading_error
from aerobat.planning.time_limit import best_by_limit
from aerobat.reporting.facts import (
    REPORT,
    WARNING,
    Fact,
    Facts,
    Rows,
    facts,
    fields_of,
    line,
    picture,
    record,
)
from aerobat.simulation import Flight
from aerobat.simulation.autopilot import Recoveries
from aerobat.simulation.outcome import length

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SMALL = 1e-4  # [m] smaller errors of a simulation with a known vehicle have no meaning
ENOUGH_MARGIN = 0.05  # of a rotor's thrust: with less, few real flights succeed
MORE_MARGIN = "--pass 0.95, which keeps as much as flights need"
SEVERAL_TIMES = 2.0  # ratio to the lower bound above which no percentage is given


@picture.register(Flight)
@picture.register(Plan)
def _(shown: Plan | Flight) -> Figure:
    from aerobat.reporting.figures import draw

    return draw(shown)


@facts.register
def _(plan: Plan) -> Iterator[Fact]:
    margin, certificate, found = plan.margin, plan.certificate, plan.assessment
    yield line("", plan.problem.name + ("" if plan.vehicle is None else f" · {plan.vehicle.name}"))
    order = "" if plan.order is None else f", order {plan.order}"
    backend = f", {plan.backend}" if plan.backend else ""
    yield Fact("planner", plan.planner, "planner", f"{plan.planner}{order}, {plan.pieces}{backend}")
    yield from record(order=plan.order, intervals=plan.intervals, dt_s=plan.dt)
    beside = "" if found is None or found.poor else _beside_least(found)
    yield Fact("duration_s", plan.duration, "duration", f"{plan.duration:.2f} s{beside}", level=REPORT)
    yield Fact("rescue", plan.rescue, "rescue", level=REPORT)
    off = heading_error(plan)
    if off is not None:
        most, usual = degrees(off.largest), degrees(off.median)
        text = f"{plan.problem.heading.mode}, {usual:.3g}° off, at worst {most:.3g}° at {off.time:.2f} s"
        yield Fact("heading_error_deg", most, "heading", text, level=REPORT)
        yield from record(heading_error_median_deg=usual, heading_error_time_s=off.time)
    if plan.attempts:  # none were made for a path that another program gave
        dt = "" if plan.dt is None else f"dt {plan.dt:.4f} s "
        yield line("search", f"{plan.duration:.3f} s, {dt}after {len(plan.attempts)} attempts")
    cost = ""
    if plan.cost is not None:
        sized = "the duration" if plan.cost == plan.duration else f"{plan.cost:.7g}"
        cost = f"{sized}, {_optimality(plan)}"
    yield Fact("cost", plan.cost, "cost", cost)
    yield from record(attempts=Rows(plan.attempts), status=plan.status, bound=plan.bound, gap=plan.gap)
    yield from record(backend=plan.backend, starts_s=plan.starts, spread=plan.spread)
    if plan.spread is not None:
        coarse = f"{plan.starts[0]:.3f} to {plan.starts[-1]:.3f} s on a coarse mesh"
        yield line("starts", f"{len(plan.starts)}, {coarse}, {100 * plan.spread:.2g} % apart")
    solved = f"{plan.nodes}, solved in {1000 * plan.solve_time:.0f} ms" if plan.nodes else ""
    yield Fact("nodes", plan.nodes, "nodes", solved)
    yield Fact("solve_time_s", plan.solve_time)
    label, when = "stages", [f"{stage.name} at {stage.time:.2f} s" for stage in plan.stages]
    if plan.dt is not None:
        label, when = "stage intervals", [f"{stage.name} {stage.interval}" for stage in plan.stages]
    stages = [Facts(record(name=s.name, interval=s.interval, time_s=s.time)) for s in plan.stages]
    yield Fact("stages", stages, label, ", ".join(when))
    yield Fact("lap_ends_s", plan.laps)
    laps = ", ".join(f"{duration:.3f} s" for duration in plan.lap_times)
    yield Fact("lap_times_s", plan.lap_times, "laps", laps)
    yield Fact("min_rotor_thrust_n", margin and margin.min_thrust)
    yield Fact("max_rotor_thrust_n", margin and margin.max_thrust)
    yield Fact("rotor_margin_n", margin and margin.margin, "rotors", str(margin or ""))
    yield Fact("bounded_moments", certificate and not certificate.discontinuities)
    yield Fact("rotor_feasible", certificate and certificate.certified)
    proof = ""
    if certificate is not None:
        yield from _limiting(certificate)
        proof = ("" if certificate.certified else "not certified: ") + certificate.why
    yield Fact("certificate", certificate, "proof", proof)
    yield Fact("flyability", plan.flyability)
    yield from evidence(plan)
    yield Fact("tube", plan.tube and Facts(_tube(plan.tube, plan.duration)))
    if plan.wants_second_opinion:
        text = "it may take longer than need be; --explain asks another planner"
        yield line(WARNING, text, level=REPORT, style="red")


def evidence(plan: Plan | None) -> Iterator[Fact]:
    """Yield the facts of a plan's recoveries and assessment; their values are None without a plan."""
    yield Fact("recoveries", plan and plan.recoveries)
    found = None if plan is None else plan.assessment
    another = "" if plan is None or plan.planner == "free-knots" else ", --planner free-knots plans anew"
    if plan is not None and found is not None and not found.poor:
        suspicion = f"; suspicious: --explain asks for a second opinion{another}"
        yield line("possible", found.sentence + (suspicion if plan.wants_second_opinion else ""))
    yield Fact("assessment", found)


@facts.register
def _(attempt: Attempt) -> Iterator[Fact]:
    yield from record(dt_s=attempt.dt, duration_s=attempt.duration, feasible=attempt.feasible)
    yield from record(status=attempt.status, outcome=attempt.outcome, cost=attempt.cost, nodes=attempt.nodes)
    yield from record(solve_time_s=attempt.solve_time)


@facts.register
def _(found: Flyability) -> Iterator[Fact]:
    if found.defects:
        yield line("not flyable", str(found), level=REPORT, style="red")
    else:
        yield line("margin", _margin(found), level=REPORT)
    yield from record(flies=found.flies, error_m=found.error, disturbance_n=found.disturbance)
    yield from record(disturbed_fraction=found.disturbed_fraction, disturbed_error_m=found.disturbed_error)
    yield from record(passages=found.passages, nearest=found.nearest)
    yield Fact("sentence", str(found), "flyability")


@facts.register
def _(passage: FlownPassage) -> Iterator[Fact]:
    error, tolerance = map(_in_degrees, (passage.attitude_error, passage.attitude_tolerance))
    yield from record(gate=passage.gate, attitude_error_deg=error, attitude_tolerance_deg=tolerance)
    yield from record(clearance_m=passage.clearance, failure=passage.failure or None)


@facts.register
def _(found: Recoveries) -> Iterator[Fact]:
    yield from record(reaction_s=found.reaction, ground_m=found.ground, times_s=found.times)
    yield from record(lowest_m=found.lowest, height_lost_m=found.height_lost, durations_s=found.durations)
    spans = np.array([[span.start, span.end] for span in found.no_return]).reshape(-1, 2)  # numbers, no table
    yield from record(no_return_s=spans)
    yield Fact("sentence", str(found), "recovery")


@facts.register
def _(found: Assessment) -> Iterator[Fact]:
    yield from record(least_duration_s=found.least_duration, ratio=found.ratio, suspicious=found.suspicious)
    yield from record(poor=found.poor, second_opinion=found.opinion, lowest_m=found.lowest)
    yield from record(max_speed_m_s=found.max_speed, max_tilt_rad=found.max_tilt)
    yield from record(max_body_rate_rad_s=found.max_body_rate, warnings=found.warnings, sentence=str(found))
    yield Fact("room_m", [found.room.lower, found.room.upper], "space", _reached(found), level=REPORT)
    for warning in found.warnings:
        yield line(WARNING, warning, level=REPORT, style="red")


@facts.register
def _(found: Certificate) -> Iterator[Fact]:
    """Yield proven limits, a row for each, and the largest values of quantities without a limit.

    Of all rotors' thrusts and commands, the table has those nearest to a limit; a gate that is passed as
    required has one row.
    """
    yield line("", "certificate")
    yield from record(certified=found.certified, margin_n=found.margin, findings=found.findings)
    yield Fact("", _finding_rows(found.findings), "findings")
    yield Fact("why", found.why, text=("" if found.certified else "not certified: ") + found.why)
    yield from record(undetermined=found.undetermined, discontinuities=found.discontinuities)
    yield from record(too_unequal=found.too_unequal)


@facts.register
def _(found: Finding) -> Iterator[Fact]:
    yield from fields_of(found)
    yield Fact("margin", found.margin)


def _finding_rows(findings: Iterable[Finding]) -> list[Facts]:
    """Return the rows of a table: findings along the path, then a row for each passage.

    A passage whose requirements do not all hold has a row for each of these instead.
    """
    along = _nearest_rotors(finding for finding in findings if finding.place is None)
    rows = [_row(each) for each in along if each.limit is not None or each.side is Side.MAX]
    placed = (finding for finding in findings if finding.place is not None)
    for (place, time), group in groupby(placed, lambda finding: (finding.place, finding.time)):
        passage = list(group)
        wrong = [finding for finding in passage if finding.verdict is not Verdict.HOLDS]
        reached = ", ".join(f"{each.quantity} {each.shown(each.value, 2)}" for each in passage)
        well = _of_finding(str(place), reached, f"{time:.3f} s", "", "", Verdict.HOLDS.value)
        rows += map(_row, wrong) if wrong else [well]
    return rows


def _nearest_rotors(findings: Iterable[Finding]) -> Iterable[Finding]:
    """Return the finding with the smallest margin for each quantity and side, of all rotors."""
    nearest: dict[tuple[str, Side], Finding] = {}
    for finding in findings:
        key = finding.quantity, finding.side
        known = nearest.setdefault(key, finding)
        if (finding.margin or 0.0) < (known.margin or 0.0):
            nearest[key] = finding
    return nearest.values()


def _row(finding: Finding) -> Facts:
    return _of_finding(
        finding.name if finding.place is None else f"{finding.place} {finding.name}",
        f"{finding.side.value} {finding.shown(finding.value)}",
        f"{finding.time:.3f} s",
        "–" if finding.limit is None else finding.shown(finding.limit),
        "" if finding.margin is None else finding.shown(finding.margin, 3),
        "" if finding.limit is None else finding.verdict.value,
    )


def _of_finding(*texts: str) -> Facts:
    names = ("quantity", "reaches", "at", "limit", "margin", "verdict")
    return Facts(Fact("", text, name) for name, text in zip(names, texts, strict=True))


def _limiting(found: Certificate) -> Iterator[Fact]:
    """Yield the rotor nearest to its limit and the next binding limit, or why a plan is not certified."""
    worst, binding = found.worst, found.binding
    if not found.certified or worst is None or worst.limit is None:
        yield line("not proven", found.why, level=REPORT, style="red")
        return
    yield line("limited by", _within(worst, worst.limit), level=REPORT)
    if binding is not None and binding.limit is not None:
        yield line("and by", _within(binding, binding.limit), level=REPORT)


def _within(found: Finding, limit: float) -> str:
    """Name a quantity with the value that it reaches, the time, and its limit."""
    allowed = f"{'at most' if found.side is Side.MAX else 'at least'} {found.shown(limit, 2)}"
    return f"{found.name}: {found.shown(found.value, 2)} at {found.time:.2f} s, {allowed}"


def _beside_least(found: Assessment) -> str:
    """Return in words how near a duration is to the proven lower bound."""
    if found.ratio == inf:
        return ""
    if found.ratio < 1.0:
        return f", beyond its limits: within them {found.least_duration:.2f} s is the least"
    free = " if nothing stood in the way" if found.obstructed else ""
    if found.ratio > SEVERAL_TIMES:
        return f", at most {found.ratio:.1f} times the shortest possible{free}"
    return f", at most {100.0 * (found.ratio - 1.0):.0f} % above the shortest possible{free}"


def _margin(found: Flyability) -> str:
    """Return in words how much thrust a plan leaves to the controller."""
    kept_fraction = found.disturbed_fraction
    if not found.disturbance:
        return f"no thrust is left to the controller: too little for a real flight; try {MORE_MARGIN}"
    little = "" if kept_fraction >= ENOUGH_MARGIN else f": little for a real flight; try {MORE_MARGIN}"
    moved = f"a loss as large moves the vehicle {rough_length(found.disturbed_error)} off its path"
    if found.diverges_disturbed:
        moved = "with a loss as large it diverges from its path"
    return f"{100.0 * kept_fraction:.2g} % of a rotor's thrust{little}; {moved}"


def rough_length(metres: float) -> str:
    """Return a length as text with two digits, in mm, cm or m, of 0.1 mm at least."""
    unit, size = ("m", 1.0) if metres >= 1.0 else ("cm", 1e-2) if metres >= 1e-2 else ("mm", 1e-3)
    return f"{max(metres, SMALL) / size:.2g} {unit}"


def _tube(tube: Tube, duration: float) -> Iterator[Fact]:
    """Yield the proof that flights pass, its price for a plan of this duration [s], and the tube."""
    price = tube.price(duration)
    yield from record(conditions=tube.conditions, seed=tube.seed, probability=tube.probability)
    yield from record(passed=tube.passed, flights=tube.flights, lower_bound=tube.lower_bound)
    yield from record(reserve=tube.reserve, plain_duration_s=tube.plain_duration, price_s=price)
    yield from record(level=tube.level, times_s=tube.times, position_error_m=tube.position_error)
    yield from record(attitude_error_deg=[degrees(angle) for angle in tube.attitude_error])
    yield from record(rotor_margin=tube.rotor_margin, sentence=str(tube))
    texts = {
        "passes": f"{tube.passed} of {tube.flights} fresh flights under {tube.conditions}: "
        f"{100 * tube.lower_bound:.2f} % or more with 95 % confidence, {100 * tube.probability:g} % asked",
        "price": f"{price:.3f} s or {100 * price / tube.plain_duration:.1f} %, beside "
        f"{tube.plain_duration:.3f} s; reserve {tube.reserve:g}",
        "tube": f"{100 * tube.level:g} % within {length(tube.max_position_error)} and "
        f"{degrees(tube.max_attitude_error):.1f}°, commands {100 * tube.min_rotor_margin:.1f} % of the "
        "rotors' range from their limits",
    }
    yield from (line(label, text, level=REPORT) for label, text in texts.items())


def _reached(found: Assessment) -> str:
    """Return the extent of a path, its largest speed, tilt and body rate, in words."""
    angles = ((found.max_tilt, "° of tilt"), (found.max_body_rate, "°/s"))
    turned = [f"{degrees(angle):.0f}{unit}" for angle, unit in angles if angle is not None]
    return ", ".join([str(found.room), f"{found.max_speed:.0f} m/s", *turned])


def _optimality(plan: Plan) -> str:
    if plan.status == "time_limit" and plan.gap is None:
        return best_by_limit(plan)
    if plan.gap is None or plan.gap < 1e-6:
        return plan.status
    within = f"within {100 * plan.gap:.2g} % of the optimum"
    return within if plan.status == "time_limit" else f"{plan.status}, {within}"


def _in_degrees(angle: float | None) -> float | None:
    return None if angle is None else degrees(angle)
