"""The report: a plan and its flight as plain data, the same facts for machines and for people."""

from __future__ import annotations

import json
from dataclasses import asdict
from math import degrees, inf
from typing import TYPE_CHECKING, Any

from aerobat.evaluation.score import Score
from aerobat.planning import Assessment, Flyability, Plan, Tube
from aerobat.simulation.autopilot import Recoveries
from aerobat.simulation.passages import Passage
from aerobat.vehicle import implausibilities

if TYPE_CHECKING:  # which takes long to import
    from aerobat.studies.sweep import Sweep

# numbers of a score that its sentence is made of
EVENTS = ("stop", "is_finite", "ground_time", "off_path_time", "contact", "contact_time", "path_radius_m")


def report(
    plan: Plan,
    score: Score | None = None,
    vehicle: str | None = None,
    controller: str | None = None,
    plant: str | None = None,
) -> dict[str, Any]:
    """The content of report.json; units are in the keys. `flight` is missing when nothing was flown.

    Args:
        plan: what was planned.
        score: of its flight.
        vehicle: the name of what flew it, by default the plan's.
        controller: the name of the controller that did.
        plant: the name of the other simulator whose physics it flew in, if it was one.
    """
    facts: dict[str, Any] = {
        "problem": plan.problem.name,
        "vehicle": vehicle or (None if plan.vehicle is None else plan.vehicle.name),
        "warnings": [] if plan.vehicle is None else list(implausibilities(plan.vehicle)),
        "plan": _plan(plan),
    }
    if score is not None:
        flown_by = {"controller": controller, "plant": plant}
        known = {name: value for name, value in flown_by.items() if value is not None}
        facts["flight"] = _flight(score) | known
    return facts


def to_json(facts: dict[str, Any] | list[dict[str, Any]]) -> str:
    """A report, or a list of rows, as JSON text."""
    return json.dumps(facts, indent=2, ensure_ascii=False, allow_nan=False)


def _flight(score: Score) -> dict[str, Any]:
    """A score; what is not known or not limited is None, as JSON has neither NaN nor infinity."""
    facts = {name: value for name, value in asdict(score).items() if name not in EVENTS}
    facts |= {"outcome": score.outcome.name.lower(), "sentence": score.sentence}
    facts["laps"] = [asdict(lap) for lap in score.laps]
    for judged in ("passages", "waypoints", "places", "attitudes", "laps"):
        facts[judged] = [_known(each) for each in facts[judged]]
    return facts


def evidence_facts(plan: Plan | None) -> dict[str, Any]:
    """The parts of a report that are known of a plan beside its proof; None of no plan."""
    return {
        "recoveries": plan and plan.recoveries and _recoveries(plan.recoveries),
        "assessment": plan and plan.assessment and _assessment(plan.assessment),
    }


def passage_facts(passage: Passage) -> dict[str, Any]:
    """A passage; what is not known or not limited is None."""
    return _known(asdict(passage))


def _known(facts: dict[str, Any]) -> dict[str, Any]:
    return {name: None if value in ("", inf) or value != value else value for name, value in facts.items()}


def trial_facts(trials: Sweep | None) -> dict[str, Any]:
    """Return how many flights under random conditions succeeded, as JSON has it; nothing where none were."""
    if trials is None:
        return {}
    success = trials.success
    return {
        "trials": {
            "conditions": trials.conditions.name,
            "seed": trials.seed,
            "flights": len(trials),
            "succeeded": success.count,
            "success_interval": list(success.interval),
        }
    }


def _flyability(found: Flyability) -> dict[str, Any]:
    return {
        "flies": found.flies,
        "error_m": found.error,
        "disturbance_n": found.disturbance,
        "disturbed_fraction": found.disturbed_fraction,
        "disturbed_error_m": found.disturbed_error,
        "passages": [
            {
                "gate": passage.gate,
                "attitude_error_deg": _in_degrees(passage.attitude_error),
                "attitude_tolerance_deg": _in_degrees(passage.attitude_tolerance),
                "clearance_m": passage.clearance,
                "failure": passage.failure or None,
            }
            for passage in found.passages
        ],
        "sentence": str(found),
    }


def _recoveries(found: Recoveries) -> dict[str, Any]:
    """The recoveries from instants at `times_s`; those that never come to a hover last None."""
    return {
        "reaction_s": found.reaction,
        "ground_m": found.ground,
        "times_s": found.times.tolist(),
        "lowest_m": found.lowest.tolist(),
        "height_lost_m": found.height_lost.tolist(),
        "durations_s": [None if duration == inf else duration for duration in found.durations.tolist()],
        "no_return_s": [[span.start, span.end] for span in found.no_return],
        "sentence": str(found),
    }


def _assessment(found: Assessment) -> dict[str, Any]:
    return {
        "least_duration_s": found.least_duration,
        "ratio": None if found.ratio == inf else found.ratio,
        "suspicious": found.suspicious,
        "poor": found.poor,
        "second_opinion": found.opinion and asdict(found.opinion),
        "room_m": [list(found.room.lower), list(found.room.upper)],
        "lowest_m": found.lowest,
        "max_speed_m_s": found.max_speed,
        "max_tilt_rad": found.max_tilt,
        "max_body_rate_rad_s": found.max_body_rate,
        "warnings": list(found.warnings),
        "sentence": str(found),
    }


def _tube(tube: Tube, duration: float) -> dict[str, Any]:
    """A tube, its series over time at `times_s`, and its price beside a plan of that duration [s]."""
    return {
        "conditions": tube.conditions,
        "seed": tube.seed,
        "probability": tube.probability,
        "passed": tube.passed,
        "flights": tube.flights,
        "lower_bound": tube.lower_bound,
        "reserve": tube.reserve,
        "plain_duration_s": tube.plain_duration,
        "price_s": tube.price(duration),
        "level": tube.level,
        "times_s": list(tube.times),
        "position_error_m": list(tube.position_error),
        "attitude_error_deg": [degrees(angle) for angle in tube.attitude_error],
        "rotor_margin": list(tube.rotor_margin),
        "sentence": str(tube),
    }


def _in_degrees(angle: float | None) -> float | None:
    return None if angle is None else degrees(angle)


def _plan(plan: Plan) -> dict[str, Any]:
    margin = plan.margin
    return {
        "planner": plan.planner,
        "order": plan.order,
        "intervals": plan.intervals,
        "dt_s": plan.dt,
        "duration_s": plan.duration,
        "cost": plan.cost,
        "status": plan.status,
        "rescue": plan.rescue,
        "bound": plan.bound,
        "gap": plan.gap,
        "backend": plan.backend,
        "starts_s": list(plan.starts),
        "spread": plan.spread,
        "nodes": plan.nodes,
        "solve_time_s": plan.solve_time,
        "stages": [{"name": s.name, "interval": s.interval, "time_s": s.time} for s in plan.stages],
        "lap_ends_s": list(plan.laps),
        "lap_times_s": list(plan.lap_times),
        "attempts": [
            {
                "dt_s": a.dt,
                "duration_s": a.duration,
                "feasible": a.feasible,
                "status": a.status,
                "outcome": a.outcome,
                "cost": a.cost,
                "nodes": a.nodes,
                "solve_time_s": a.solve_time,
            }
            for a in plan.attempts
        ],
        "min_rotor_thrust_n": margin and margin.min_thrust,
        "max_rotor_thrust_n": margin and margin.max_thrust,
        "rotor_margin_n": margin and margin.margin,
        "bounded_moments": plan.certificate and not plan.certificate.discontinuities,
        "rotor_feasible": plan.certificate and plan.certificate.certified,
        "certificate": plan.certificate and plan.certificate.record(),
        "flyability": plan.flyability and _flyability(plan.flyability),
        **evidence_facts(plan),
        "tube": plan.tube and _tube(plan.tube, plan.duration),
    }
