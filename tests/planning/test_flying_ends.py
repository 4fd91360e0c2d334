"""Flying starts and finishes: courses that begin in motion, and goals passed at any velocity or at one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import aerobat as ab
from aerobat.declaration import from_table, to_table
from aerobat.errors import SpecError
from aerobat.links import require_flyable
from aerobat.planning import least_duration
from score_cases import QUAD

START = ab.EndState((0.0, 0.0, 1.0), velocity=(5.0, 2.0, 0.0))
PASSED = ab.EndState((9.0, 1.0, 1.0), free_velocity=True)
GIVEN = ab.EndState((9.0, 1.0, 1.0), velocity=(6.0, 0.0, 1.0))
COURSE = ab.Problem(
    "flying",
    START,
    PASSED,
    ab.Course((ab.PassGate("gate", speed=2.0), ab.PassWaypoint((6.0, -1.0, 2.0), radius=0.3))),
    (ab.tilted_gate((3.0, 1.0, 1.5)),),
)


PLANNERS = {
    "time-optimal": ab.TimeOptimal(segments=8, starts=1),
    "free-knots": ab.FreeKnots(segments=2),
    "miqp": ab.Miqp(order=5),
    "min-snap": ab.MinSnap(),
}


@cache
def planned(planner: str, is_free: bool) -> ab.Plan:
    """The course to a goal that is passed at any velocity or at one."""
    return ab.plan(replace(COURSE, goal=PASSED if is_free else GIVEN), PLANNERS[planner], QUAD)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("planner", "is_free"),
    [
        pytest.param("time-optimal", True, marks=pytest.mark.slow),
        pytest.param("time-optimal", False, marks=pytest.mark.slow),
        pytest.param("free-knots", True, marks=pytest.mark.slow),
        ("miqp", True),
        pytest.param("miqp", False, marks=pytest.mark.slow),
        ("min-snap", True),
        ("min-snap", False),
    ],
)
def test_every_planner_begins_in_motion_and_passes_a_goal_that_is_given_or_left_free(
    planner: str, is_free: bool
) -> None:
    plan = planned(planner, is_free)
    assert plan.certificate is not None
    assert plan.certificate.certified
    assert plan.duration >= least_duration(plan.problem, QUAD)
    path, goal = plan.trajectory, plan.problem.goal
    np.testing.assert_allclose(path.evaluate(0.0, 1), START.velocity, atol=1e-6)
    np.testing.assert_allclose(path.evaluate(path.duration), goal.position, atol=1e-6)
    final = path.evaluate(path.duration, 1)
    assert np.linalg.norm(final) > 5.0 if is_free else np.allclose(final, GIVEN.velocity, atol=1e-5)
    score = ab.score(ab.fly(plan), plan)
    assert score.outcome.is_success
    assert len(score.passages) == len(score.waypoints) == 1


@pytest.mark.slow
def test_the_least_time_to_a_goal_left_free_is_less_than_to_one_that_is_given() -> None:
    assert planned("time-optimal", True).duration < planned("time-optimal", False).duration


def test_a_goal_s_free_velocity_keeps_within_the_limits() -> None:
    limits = ab.Limits(velocity=3.0, acceleration=20.0)
    line = ab.Problem("line", ab.at_rest((0.0, 0.0, 1.0)), PASSED, limits=limits)
    plan = ab.plan(line, ab.Miqp(order=4), vehicle=None)
    assert np.abs(plan.trajectory.evaluate(plan.duration, 1)).max() <= 3.0 + 1e-9
    assert plan.duration >= 9.0 / 3.0


def test_the_least_duration_to_a_passed_goal_is_that_of_full_thrust_all_the_way() -> None:
    """Without drag: √(2 s/a) for twice √(s/a) to rest, of the thrust along a horizontal line."""
    still = replace(QUAD, drag_body=np.zeros(3))
    line = ab.Problem("line", ab.at_rest((0.0, 0.0, 1.0)), ab.at_rest((9.0, 0.0, 1.0)))
    passing = replace(line, goal=replace(PASSED, position=line.goal.position))
    to_rest, passed = (least_duration(problem, still) for problem in (line, passing))
    assert passed == pytest.approx(to_rest / np.sqrt(2.0), rel=1e-3)


def test_files_and_sentences_know_a_flying_finish() -> None:
    assert from_table(ab.Problem, to_table(COURSE)) == COURSE
    assert str(COURSE).endswith("pass (9, 1, 1) m")
    assert str(replace(COURSE, goal=ab.at_rest(PASSED.position))).endswith("stop at (9, 1, 1) m")


def test_a_start_has_its_velocity_and_a_goal_one_or_none() -> None:
    with pytest.raises(SpecError, match=r"start\.free_velocity is for goals, a start has its velocity; drop"):
        replace(COURSE, start=replace(PASSED, position=START.position))
    with pytest.raises(SpecError, match=r"free_velocity stands beside velocity, which gives one; drop"):
        replace(GIVEN, free_velocity=True)


def test_a_live_link_refuses_a_plan_that_ends_in_motion() -> None:
    problem = replace(
        COURSE, start=ab.at_rest(START.position), maneuver=ab.Course((COURSE.maneuver.elements[1],))
    )
    plan = ab.plan(problem, ab.MinSnap(), QUAD)
    with pytest.raises(SpecError, match=r"ends in motion; plan it to a goal at rest, where a link can hover"):
        require_flyable(plan, np.zeros(3))
