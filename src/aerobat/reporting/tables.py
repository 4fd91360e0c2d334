"""Short tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from math import degrees, isinf, isnan

from rich.console import Console
from rich.table import Table
from rich.text import Text

from aerobat.certification import Certificate, Finding, Side, Verdict
from aerobat.evaluation import Passage, Score, WaypointPassage
from aerobat.evaluation.passages import GOAL
from aerobat.evaluation.score import ObserverScore
from aerobat.planning import Assessment, Plan, Tube
from aerobat.planning.time_limit import best_by_limit
from aerobat.problem import Problem
from aerobat.simulation.outcome import digits, length
from aerobat.vehicle import Vehicle

Fact = tuple[str, str | Text]  # a name, and what is to be said


def summary_table(
    plan: Plan,
    score: Score | None,
    vehicle: str,
    controller: str | None = None,
    plant: str | None = None,
) -> Table:
    """The plan and its flight, a fact a row.

    Args:
        plan: what was planned.
        score: of its flight, where there is one.
        vehicle: the name of what flew it.
        controller: the name of the controller that did.
        plant: the name of the other simulator whose physics it flew in, if it was one.
    """
    facts: dict[str, Iterable[Fact]] = {"plan": plan_facts(plan)}
    if score is not None:
        facts["flight"] = flight_facts(score, controller, plant)
    return facts_table(f"{plan.problem.name} · {vehicle}", facts)


def facts_table(title: str, facts: Mapping[str, Iterable[Fact]]) -> Table:
    """Facts, one a row, under their headings."""
    table = Table(title=title or None, title_justify="left", show_header=False, box=None)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column()
    for heading, rows in facts.items():
        for i, (name, fact) in enumerate(rows):
            told = Text(fact) if isinstance(fact, str) else fact  # none of its brackets taken for markup
            table.add_row(heading if i == 0 else "", name, told)
    return table


def evidence_table(plan: Plan) -> Table:
    """The facts of a plan beside its proof, a fact a row: its recoveries, and its assessment."""
    assessed = () if plan.assessment is None else _assessment_facts(plan, plan.assessment)
    return facts_table("", {"beside the proof": [*_recovery_facts(plan), *assessed]})


def vehicles_table(vehicles: Iterable[Vehicle]) -> Table:
    """Vehicles, one a row."""
    table = Table("vehicle", "mass", "rotors", "thrust/weight", "what it is", box=None, pad_edge=False)
    for v in vehicles:
        mass = f"{v.mass:.3g} kg"
        table.add_row(v.name, mass, str(len(v.rotors)), f"{v.thrust_to_weight:.2f}", v.description)
    return table


def problems_table(problems: Iterable[Problem]) -> Table:
    """Problems, one a row."""
    table = Table("problem", "what it is", box=None, pad_edge=False)
    for problem in problems:
        table.add_row(problem.name, problem.description)
    return table


def print_table(table: Table) -> None:
    """Print a table to standard output, full width in a pipe."""
    console = Console()
    (console if console.is_terminal else Console(width=120)).print(table)


def certificate_table(certificate: Certificate, title: str) -> Table:
    """Proven limits, one a row, and the largest values of quantities without a limit.

    Of all rotors' thrusts, and of all their commands, those nearest to either limit; a gate that is passed as
    it is asked has one row.
    """
    headings = ("quantity", "reaches", "at", "limit", "margin", "verdict")
    table = Table(*headings, title=title, title_justify="left", box=None, pad_edge=False)
    along = [finding for finding in certificate.findings if finding.place is None]
    for finding in _nearest_rotors(along):
        if finding.limit is not None or finding.side is Side.MAX:
            table.add_row(*_finding_row(finding))
    for row in _passage_rows(finding for finding in certificate.findings if finding.place is not None):
        table.add_row(*row)
    table.caption = ("" if certificate.certified else "not certified: ") + certificate.why
    table.caption_justify = "left"
    return table


def _nearest_rotors(findings: Iterable[Finding]) -> Iterable[Finding]:
    """The findings, of all rotors' thrusts and commands those with the smallest margin on either side."""
    nearest: dict[tuple[str, Side], Finding] = {}
    for finding in findings:
        key = finding.quantity, finding.side
        known = nearest.setdefault(key, finding)
        if (finding.margin or 0.0) < (known.margin or 0.0):
            nearest[key] = finding
    return nearest.values()


def _passage_rows(findings: Iterable[Finding]) -> Iterable[tuple[str, ...]]:
    """A row a passage through a gate or waypoint; where it is not as asked, a row for all that is not."""
    for (place, time), group in groupby(findings, lambda finding: (finding.place, finding.time)):
        passage = list(group)
        wrong = [finding for finding in passage if finding.verdict is not Verdict.HOLDS]
        if wrong:
            yield from map(_finding_row, wrong)
        else:
            reached = ", ".join(f"{each.quantity} {each.shown(each.value, 2)}" for each in passage)
            yield str(place), reached, f"{time:.3f} s", "", "", Verdict.HOLDS.value


def _finding_row(finding: Finding) -> tuple[str, ...]:
    return (
        finding.name if finding.place is None else f"{finding.place} {finding.name}",
        f"{finding.side.value} {finding.shown(finding.value)}",
        f"{finding.time:.3f} s",
        "–" if finding.limit is None else finding.shown(finding.limit),
        "" if finding.margin is None else finding.shown(finding.margin, 3),
        "" if finding.limit is None else finding.verdict.value,
    )


def plan_facts(plan: Plan) -> Iterable[Fact]:
    """Facts of a plan, each with its name."""
    order = "" if plan.order is None else f", order {plan.order}"
    backend = f", {plan.backend}" if plan.backend else ""
    pieces = "1 interval" if plan.intervals == 1 else f"{plan.intervals} intervals"
    yield "planner", f"{plan.planner}{order}, {pieces}{backend}"
    if plan.rescue:
        yield "rescue", plan.rescue
    dt = "" if plan.dt is None else f"dt {plan.dt:.4f} s "
    yield "duration", f"{plan.duration:.3f} s, {dt}after {len(plan.attempts)} attempts"
    if plan.cost == plan.duration:  # as refined plans have it
        yield "optimality", _optimality(plan)
    elif plan.cost is not None:
        yield "cost", f"{plan.cost:.7g}, {_optimality(plan)}"
    if plan.spread is not None:
        coarse = f"{plan.starts[0]:.3f} to {plan.starts[-1]:.3f} s on a coarse mesh"
        yield "starts", f"{len(plan.starts)}, {coarse}, {100 * plan.spread:.2g} % apart"
    yield "nodes", f"{plan.nodes}, solved in {1000 * plan.solve_time:.0f} ms"
    if plan.stages and plan.dt is not None:
        yield "stage intervals", ", ".join(f"{s.name} {s.interval}" for s in plan.stages)
    elif plan.stages:
        yield "stages", ", ".join(f"{s.name} at {s.time:.2f} s" for s in plan.stages)
    if plan.laps:
        yield "laps", ", ".join(f"{duration:.3f} s" for duration in plan.lap_times)
    if plan.margin is not None:
        yield "rotors", str(plan.margin)
    if plan.certificate is not None:
        yield "proof", ("" if plan.certificate.certified else "not certified: ") + plan.certificate.why
    if plan.flyability is not None:
        yield "flyability", str(plan.flyability)
    yield from _recovery_facts(plan)
    if plan.tube is not None:
        yield from tube_facts(plan.tube, plan.duration)
    if plan.assessment is not None:
        yield from _assessment_facts(plan, plan.assessment)


def _recovery_facts(plan: Plan) -> Iterable[Fact]:
    if plan.recoveries is not None:
        yield "recovery", str(plan.recoveries)


def tube_facts(tube: Tube, duration: float) -> Iterable[Fact]:
    """The proof that flights pass, what it costs a plan of that duration [s], and their tube."""
    yield (
        "passes",
        f"{tube.passed} of {tube.flights} fresh flights under {tube.conditions}: "
        f"{100 * tube.lower_bound:.2f} % or more with 95 % confidence, {100 * tube.probability:g} % asked",
    )
    price = tube.price(duration)
    yield (
        "price",
        f"{price:.3f} s or {100 * price / tube.plain_duration:.1f} %, beside {tube.plain_duration:.3f} s; "
        f"reserve {tube.reserve:g}",
    )
    yield (
        "tube",
        f"{100 * tube.level:g} % within {length(tube.max_position_error)} and "
        f"{degrees(tube.max_attitude_error):.1f}°, commands {100 * tube.min_rotor_margin:.1f} % of the "
        "rotors' range from their limits",
    )


def _assessment_facts(plan: Plan, found: Assessment) -> Iterable[Fact]:
    """Rows about what is possible and about room and rates; warnings in red."""
    if not found.poor:
        yield "possible", found.sentence + (f"; {_suspicion(plan)}" if plan.wants_second_opinion else "")
    yield "reaches", reached(found, decimals=1)
    for warning in found.warnings:
        yield "warning", Text(warning, style="red")


def reached(found: Assessment, decimals: int) -> str:
    """Return the room that a path takes, its greatest speed with so many decimals, its tilt and its rate."""
    angles = ((found.max_tilt, "° of tilt"), (found.max_body_rate, "°/s"))
    turned = [f"{degrees(angle):.0f}{unit}" for angle, unit in angles if angle is not None]
    return ", ".join([str(found.room), f"{found.max_speed:.{decimals}f} m/s", *turned])


def _suspicion(plan: Plan) -> str:
    """The remedies for not knowing whether a plan need take so long."""
    another = "" if plan.planner == "free-knots" else ", --planner free-knots plans anew"
    return f"suspicious: --explain asks for a second opinion{another}"


def _optimality(plan: Plan) -> str:
    if plan.status == "time_limit" and plan.gap is None:
        return best_by_limit(plan)
    if plan.gap is None or plan.gap < 1e-6:
        return plan.status
    within = f"within {100 * plan.gap:.2g} % of the optimum"
    return within if plan.status == "time_limit" else f"{plan.status}, {within}"


def flight_facts(score: Score, controller: str | None = None, plant: str | None = None) -> Iterable[Fact]:
    """Facts of a flight, each with its name."""
    yield "outcome", score.sentence
    if controller is not None:
        yield "controller", controller
    if plant is not None:
        yield "plant", plant
    yield "position error", _pair(100 * score.max_position_error_m, 100 * score.rms_position_error_m, "cm")
    yield "attitude error", _pair(score.max_attitude_error_deg, score.rms_attitude_error_deg, "°")
    if score.observer is not None:
        yield "observer", _observer(score.observer)
    several = bool(score.laps)
    for passage in score.passages:
        yield _of_lap(passage.gate, passage.lap, several), _passed(passage)
    for waypoint in score.waypoints:
        met = (
            f"{length(waypoint.miss)} from it, {length(waypoint.radius)} allowed, "
            f"at {waypoint.speed:.2f} m/s at {waypoint.time:.2f} s"
        )
        missed = "not reached" if isnan(waypoint.time) else met
        yield _of_lap(waypoint.waypoint, waypoint.lap, several), missed
    if score.places or score.attitudes:
        yield "tolerance", _within_tolerance(score)
    yield from lap_facts(score)
    yield "saturated", f"{100 * score.saturated_fraction:.1f} % of the time"


def lap_facts(score: Score) -> Iterable[Fact]:
    """Yield the duration and the end of each lap."""
    for lap in score.laps:
        split = "not flown" if isnan(lap.duration) else f"{lap.duration:.3f} s, until {lap.end:.3f} s"
        yield f"lap {lap.lap}", split


def _within_tolerance(score: Score) -> str:
    """How far at most a flight is off the goal and the stages that are kept to the problem's tolerance."""
    told = []
    if score.places:
        miss, allowed = max((place.miss, place.radius) for place in score.places)
        told.append(f"{length(miss)} of {length(allowed)} off {_names(score.places)}")
    if score.attitudes:
        angle, tolerance = max((each.angle_deg, each.tolerance_deg) for each in score.attitudes)
        told.append(f"{angle:.2f}° of {tolerance:.3g}° off the attitudes of {len(score.attitudes)} stages")
    times = [place.time for place in score.places] + [attitude.time for attitude in score.attitudes]
    return "not all reached" if any(map(isnan, times)) else f"{', '.join(told)}, at most"


def _names(places: Sequence[WaypointPassage]) -> str:
    """What is to be come to beside gates and waypoints, in words."""
    stages = len(places) - sum(place.waypoint == GOAL for place in places)
    return GOAL if not stages else f"{stages} stages" + (f" and {GOAL}" if len(places) > stages else "")


def _observer(found: ObserverScore) -> str:
    """The filter's errors, and where it had to do without poses."""
    errors = (
        f"{length(found.rms_position_error_m)} and {digits(found.rms_attitude_error_deg)}° RMS off the truth"
    )
    if not found.coasted:
        return errors
    begin = found.until_s - found.longest_without_pose_s
    return f"{errors}; no poses from {begin:.2f} to {found.until_s:.2f} s, the IMU alone"


def _of_lap(name: str, lap: int, several: bool) -> str:
    """The name of what is passed, with its lap where there are several."""
    return f"{name}, lap {lap}" if several else name


def _passed(passage: Passage) -> str:
    """A gate's passage in words."""
    if isnan(passage.time):
        return "not passed"
    clearance = "" if isnan(passage.clearance) else f", {_clearance(passage)}"
    tolerance = passage.attitude_tolerance_deg
    allowed = "" if isinf(tolerance) else f" of {tolerance:.3g}° allowed"
    return (
        f"{length(passage.miss)} off, {passage.attitude_error_deg:.2f}°{allowed}, "
        f"at {passage.speed:.2f} m/s{clearance}"
    )


def _clearance(passage: Passage) -> str:
    """The least clearance in words, with its edge and its instant."""
    centimetres = 100 * passage.clearance
    found = f"{-centimetres:.1f} cm into" if centimetres < 0.0 else f"{centimetres:.1f} cm clear of"
    return f"{found} the {passage.closest_edge} edge at {passage.closest_time:.2f} s"


def _pair(largest: float, rms: float, unit: str) -> str:
    return f"{digits(largest)} {unit} at most, {digits(rms)} {unit} RMS"
