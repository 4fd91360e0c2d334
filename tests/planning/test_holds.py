"""Rests on the way: a path in parts that is one, at rest where and as long as is asked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat.errors import SpecError

GATE = ab.tilted_gate((3.0, 0.0, 1.0), name="red")
PLACE = (6.0, 0.0, 1.0)
COURSE = ab.Course((ab.PassGate("red"), ab.Hold(PLACE, 0.75), ab.PassWaypoint((6.0, 3.0, 2.0), radius=0.2)))
PROBLEM = ab.Problem("rest", ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((6.0, 6.0, 1.0)), COURSE, (GATE,))


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["miqp", "min-snap"])
def test_a_plan_rests_where_and_as_long_as_is_asked(planner) -> None:
    plan = ab.plan(PROBLEM, planner, "agile-quad")
    assert plan.certified
    assert [stage.name for stage in plan.stages] == ["red", "hold", "waypoint"]
    hold = plan.stages[1]
    times = np.linspace(hold.time, hold.time + 0.75, 50)
    assert np.allclose(plan.trajectory.evaluate(times), PLACE, atol=1e-6)
    assert np.abs(plan.trajectory.evaluate(times, 1)).max() < 1e-6
    for k in range(3):
        (before, behind), (ahead, beyond) = (
            plan.trajectory.evaluate([t - 1e-7, t + 1e-7], k) for t in (hold.time, hold.time + 0.75)
        )
        assert np.allclose(before, behind, atol=1e-3)
        assert np.allclose(ahead, beyond, atol=1e-3)
    score = ab.score(ab.fly(plan, rate=200.0), plan)
    assert score.outcome.is_success
    assert [passage.gate for passage in score.passages] == ["red"]


def test_a_plan_that_rests_is_those_of_its_parts_joined() -> None:
    """Without a vehicle, in whose path nothing but place and time is handed on."""
    planner = ab.Miqp(order=4)
    whole = ab.plan(PROBLEM, planner, vehicle=None)
    first = replace(PROBLEM, name="first", goal=ab.at_rest(PLACE), maneuver=ab.PassGate("red"))
    second = replace(
        PROBLEM, name="second", start=ab.at_rest(PLACE), maneuver=ab.Course((COURSE.elements[2],)), gates=()
    )
    one, other = ab.plan(first, planner, vehicle=None), ab.plan(second, planner, vehicle=None)
    assert whole.duration == pytest.approx(one.duration + 0.75 + other.duration, rel=1e-9)
    late = whole.trajectory.evaluate(one.duration + 0.75 + np.linspace(0.0, other.duration, 20))
    assert np.allclose(late, other.trajectory.evaluate(np.linspace(0.0, other.duration, 20)), atol=1e-6)


def test_the_lower_bound_counts_the_rests() -> None:
    longer = replace(COURSE, elements=(COURSE.elements[0], ab.Hold(PLACE, 5.75), COURSE.elements[2]))
    short, long = (
        ab.planning.least_duration(replace(PROBLEM, maneuver=course), ab.load_vehicle("agile-quad"))
        for course in (COURSE, longer)
    )
    assert long - short == pytest.approx(5.0)


def test_a_course_may_begin_and_end_with_a_rest() -> None:
    course = ab.Course((ab.Hold((0.0, 0.0, 0.0), 0.5), ab.Hold((1.0, 0.0, 0.0), 0.25)))
    problem = ab.Problem("short", ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((1.0, 0.0, 0.0)), course)
    plan = ab.plan(problem, vehicle="agile-quad")
    assert [stage.time for stage in plan.stages] == pytest.approx([0.0, plan.duration - 0.25])
    assert plan.certified


def test_what_cannot_rest_is_refused() -> None:
    with pytest.raises(SpecError, match="hold needs conditions that fix the position along x, y and z"):
        ab.Stage("high", (ab.Condition("position", (0, 0, 1), 1.0, 1.0),), hold=1.0)
    still = ab.Course((ab.Hold((0.0, 0.0, 0.0), 0.5),))
    nowhere = ab.Problem("still", ab.at_rest((0.0, 0.0, 0.0)), ab.at_rest((0.0, 0.0, 0.0)), still)
    with pytest.raises(SpecError, match="nothing moves between the rests"):
        ab.plan(nowhere, ab.Miqp(order=4), vehicle=None)
