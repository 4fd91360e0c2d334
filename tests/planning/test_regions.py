"""Stages that are met anywhere in a ball or in an opening: what is asked, planned and proven of them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat.certification import Verdict
from aerobat.errors import SpecError
from aerobat.planning import FreeKnots, MinSnap, Miqp, Plan, TimeOptimal
from aerobat.problem import (
    Ball,
    GatePassage,
    Limits,
    Line,
    Problem,
    Stage,
    Waypoint,
    Waypoints,
    at_rest,
    tilted_gate,
)
from aerobat.vehicle import load_vehicle

QUAD = load_vehicle("agile-quad")
SMOOTH = 1e-9
offsets = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)
COURSE = Problem(
    "three balls",
    at_rest((0.0, 0.0, 1.0)),
    at_rest((0.0, -1.0, 1.0)),
    Waypoints(tuple(Waypoint(p, radius=0.3) for p in ((3.0, 1.0, 1.5), (5.0, -1.0, 2.0), (2.0, -2.0, 1.0)))),
)


def met(conditions, point) -> bool:
    return all(c.lower - SMOOTH <= c.direction @ point <= c.upper + SMOOTH for c in conditions)


@given(offsets, offsets, st.floats(0.01, 2.0))
def test_the_inscribed_polytope_lies_in_the_ball_and_the_ball_in_the_circumscribed(centre, offset, radius):
    ball, distance = Ball(centre, radius), float(np.linalg.norm(offset))
    inside = met(ball.inscribed, centre + offset)
    assert distance <= radius + 1e-6 or not inside
    assert distance > 0.794 * radius or inside
    assert met(ball.circumscribed, centre + offset) or distance > radius


def test_the_corners_of_the_inscribed_polytope_lie_on_the_ball():
    """The largest there is: a cube's corners are eight of a dodecahedron's."""
    (first, *_), corner = Ball((0.0, 0.0, 0.0), 2.0).inscribed, 2.0 / np.sqrt(3.0)
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    assert all(met(Ball((0.0, 0.0, 0.0), 2.0).inscribed, corner * sign) for sign in signs)
    assert first.upper == pytest.approx(0.7947 * 2.0, abs=1e-3)


@given(offsets, st.floats(-3, 3), st.floats(-1, 1), st.floats(-3, 3), st.floats(0, 0.7), offsets)
def test_a_free_crossing_point_is_anywhere_in_the_opening_less_body_and_margin(
    centre, heading, elevation, tilt, clearance, offset
):
    gate = tilted_gate(centre, heading, elevation, tilt, width=2.0, height=1.0)
    stage = Stage("through", gate="gate", crossing_point="free", margin=0.25 * clearance, min_speed=0.0)
    asked = stage.explicit(gate, body_radius=0.75 * clearance).conditions
    sideways, upward = abs(offset[0]), abs(offset[1])
    point = centre + offset[0] * gate.lateral + offset[1] * gate.up
    assert met(asked, point) == (
        sideways <= 1.0 - clearance + SMOOTH and upward <= max(0.5 - clearance, 0.0) + SMOOTH
    )
    assert abs(offset[2]) < 1e-6 or not met(asked, point + offset[2] * gate.normal)


ONE_BALL = replace(COURSE, maneuver=Waypoints(COURSE.maneuver.waypoints[:1]))


@cache
def narrow() -> Plan:
    return TimeOptimal(segments=8, starts=1).plan(COURSE, QUAD)


@pytest.mark.parametrize(
    "made",
    [
        lambda: MinSnap().plan(COURSE, QUAD),
        lambda: FreeKnots(segments=2).plan(ONE_BALL, QUAD),
        lambda: Miqp().plan(COURSE, QUAD),
        pytest.param(narrow, marks=pytest.mark.slow),
    ],
    ids=["min-snap", "free-knots", "miqp", "time-optimal"],
)
def test_every_planner_meets_the_balls_and_the_certificate_says_how_near(made):
    plan = made()
    waypoints = plan.problem.maneuver.waypoints
    found = {f.waypoint: f for f in plan.certificate.findings if f.waypoint is not None}
    assert plan.certified
    assert [*found] == [stage.name for stage in plan.problem.stages(QUAD.max_specific_thrust).stages]
    assert len(found) == len(waypoints)
    for placed, waypoint in zip(plan.stages, waypoints, strict=True):
        distance = np.linalg.norm(plan.trajectory.evaluate(placed.time) - waypoint.position)
        assert found[placed.name].value == pytest.approx(distance, abs=1e-9)
        assert distance <= 0.3 + 1e-6


@pytest.mark.slow
def test_the_true_ball_is_used_in_full_by_time_optimal_and_costs_nothing_to_widen():
    wide = replace(
        COURSE, maneuver=Waypoints(tuple(replace(w, radius=0.6) for w in COURSE.maneuver.waypoints))
    )
    distances = [f.value for f in narrow().certificate.findings if f.waypoint is not None]
    assert distances == pytest.approx([0.3] * 3, abs=1e-4)
    assert TimeOptimal(segments=8, starts=1).plan(wide, QUAD).duration < narrow().duration


def test_a_plan_that_misses_a_ball_is_not_certified():
    plan = MinSnap().plan(COURSE, QUAD)
    moved = (replace(COURSE.maneuver.waypoints[0], position=(3.0, 1.4, 1.5)), *COURSE.maneuver.waypoints[1:])
    elsewhere = replace(plan, problem=replace(COURSE, maneuver=Waypoints(moved)))
    (wrong,) = (f for f in elsewhere.certificate.findings if f.verdict is Verdict.VIOLATED)
    assert str(wrong) == f"'waypoint 1' distance 0.4 m of 0.3 m at {wrong.time:.3f} s, 0.1 m above its limit"


@pytest.mark.slow
def test_a_gate_with_a_free_crossing_point_is_cut_at_its_edge_less_body_and_margin():
    gate = tilted_gate((3.0, 2.0, 1.0), width=2.0, height=2.0)
    passage = GatePassage(perpendicular=False, crossing_point="free", margin=0.1)
    problem = Problem("corner", at_rest((0, 0, 1)), at_rest((6, 0, 1)), Line(passage), (gate,))
    centred = replace(problem, maneuver=Line(GatePassage(perpendicular=False)))
    free = TimeOptimal(segments=8, starts=1).plan(problem, QUAD)
    (placed,) = free.stages
    offset = free.trajectory.evaluate(placed.time) - gate.position
    assert offset @ gate.lateral == pytest.approx(-(1.0 - 0.1 - QUAD.body_radius), abs=1e-5)
    assert free.certified
    assert free.duration < TimeOptimal(segments=8, starts=1).plan(centred, QUAD).duration


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Stage("a", crossing_point="free"), "crossing_point needs gate"),
        (lambda: Stage("a", gate="g", margin=0.1), "margin needs crossing_point"),
        (lambda: Stage("a", gate="g", ball=Ball((0, 0, 0), 1.0)), "ball stands beside gate"),
        (lambda: Waypoint((0.0, np.nan, 1.0), radius=1.0), "radius needs all components of position"),
        (lambda: Waypoint((0, 0, 1), radius=1.0, gate="g"), "radius stands beside gate"),
        (lambda: GatePassage(margin=0.1), "margin needs crossing_point"),
        (lambda: Ball((0, 0, 0), 0.0), "radius must be positive"),
        (lambda: replace(COURSE, limits=Limits(upper=(9.0, 0.6, 9.0))), "'waypoint 1' asks for y from 0.7"),
    ],
)
def test_regions_that_make_no_sense_are_refused_by_their_field(make, sentence):
    with pytest.raises(SpecError, match=sentence):
        make()
