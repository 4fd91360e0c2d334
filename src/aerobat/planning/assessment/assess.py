"""plan → Assessment: what the path's own polynomials, its certificate and the lower bound say."""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import Certificate, Side
from aerobat.declaration import validated
from aerobat.errors import BackendMissing, Infeasible, SpecError
from aerobat.optimization.deadline import out_of_time, within_time
from aerobat.planning.assessment.assessment import Assessment, Box, Point, SecondOpinion
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.planning.flyability import with_flyability, with_recoveries
from aerobat.planning.recorder import Progress
from aerobat.planning.result import FLYING_RESERVE, Plan
from aerobat.problem.problem import Problem
from aerobat.vehicle import Vehicle

OPINION_SEGMENTS = (2, 4)  # of free knots: two are quick and enough for a flip's five stages; else four
OPINION_TIME = 20.0  # [s] at most: a poor plan of a long course would keep free knots busy for an hour


def with_assessment(plan: Plan) -> Plan:
    """The plan with its assessment. Raises SpecError without a vehicle, whose limits say what is possible."""
    if plan.vehicle is None:
        raise SpecError("a plan without a vehicle cannot be assessed; plan it for one")
    return replace(plan, assessment=_assessment(plan, plan.vehicle))


@validated
def with_second_opinion(plan: Plan, progress: Progress | None = None) -> Plan:
    """The plan; where its assessment finds it suspicious, with what free knots make of the same problem.

    They begin from the plan. That takes seconds, OPINION_TIME at most, and no more than is left of a limit
    (`optimization.deadline.within_time`); what they found by then counts. Time-optimal plans need none, and
    a plan that a limit ended gets none.
    Raises SpecError without a vehicle.

    Args:
        plan: For a vehicle.
        progress: Called with every attempt as it ends.
    """
    plan = plan if plan.assessment is not None else with_assessment(plan)
    assessment = plan.assessment
    assert assessment is not None
    if not plan.wants_second_opinion:
        return plan
    with within_time(OPINION_TIME):
        opinion = _second_opinion(plan, progress)
    return replace(plan, assessment=replace(assessment, opinion=opinion))


def with_explanation(plan: Plan, progress: Progress | None = None) -> Plan:
    """The plan with what takes seconds to know: a second opinion, where it wants one, and its recoveries.

    Raises SpecError without a vehicle.

    Args:
        plan: For a vehicle.
        progress: Called with every attempt of the second opinion as it ends.
    """
    return with_recoveries(with_second_opinion(plan, progress))


def _second_opinion(plan: Plan, progress: Progress | None) -> SecondOpinion:
    for segments in OPINION_SEGMENTS:
        opinion = _free_knots(plan, segments, progress)
        if opinion.duration is not None:
            return opinion
    return replace(opinion, missing="the time was over") if out_of_time() else opinion


def _free_knots(plan: Plan, segments: int, progress: Progress | None) -> SecondOpinion:
    """A shorter plan by free knots that is certified and flies, if there is one."""
    from aerobat.planning.polynomial.free_knots import FreeKnots

    options = f"--planner free-knots --segments {segments}"
    planner = FreeKnots(segments=segments, start=plan, reserve=FLYING_RESERVE)
    try:
        found = planner.plan(plan.problem, plan.vehicle, progress)
    except BackendMissing as missing:
        return SecondOpinion(options, None, str(missing))
    except (Infeasible, SpecError):
        return SecondOpinion(options, None)
    shorter = found.certified and found.duration < plan.duration and with_flyability(found).flies
    return SecondOpinion(options, found.duration if shorter else None)


def _assessment(plan: Plan, vehicle: Vehicle) -> Assessment:
    lowest, highest = plan.trajectory.component_range(0)
    return Assessment(
        duration=plan.duration,
        least_duration=least_duration(plan.problem, vehicle),
        room=Box(_point(lowest), _point(highest)),
        asked=_asked(plan.problem, vehicle),
        max_speed=_largest(plan.certificate, "speed") or 0.0,
        max_tilt=_largest(plan.certificate, "tilt"),
        max_body_rate=_largest(plan.certificate, "body rate"),
        ground=plan.problem.environment.ground,
        rate_limit=vehicle.max_body_rate,
    )


def _asked(problem: Problem, vehicle: Vehicle) -> Box:
    """The box of start, goal, gates, and of what stages ask of positions along the world's axes."""
    places = [end.position for end in problem.ends.values()] + [gate.position for gate in problem.gates]
    points = np.reshape(places, (-1, 3))
    lower, upper = points.min(axis=0, initial=inf), points.max(axis=0, initial=-inf)
    for stage in problem.stages(vehicle.max_specific_thrust).stages:
        for condition in stage.where:
            axes = np.flatnonzero(condition.direction)
            if len(axes) == 1:
                for bound in (condition.lower, condition.upper):
                    if abs(bound) < inf:
                        place = bound / condition.direction[axes[0]]
                        lower[axes[0]] = min(lower[axes[0]], place)
                        upper[axes[0]] = max(upper[axes[0]], place)
    return Box(_point(lower), _point(upper))


def _largest(certificate: Certificate | None, quantity: str) -> float | None:
    """The largest value of a quantity along the path."""
    findings = () if certificate is None else certificate.findings
    asked = (f.value for f in findings if (f.quantity, f.side, f.place) == (quantity, Side.MAX, None))
    return max(asked, default=None)


def _point(vector: Array) -> Point:
    x, y, z = vector.tolist()
    return x, y, z
