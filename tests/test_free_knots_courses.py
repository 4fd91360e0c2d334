"""Free knots through many stages: certified, smooth, near the least time, through every ball and opening."""

import numpy as np
import pytest

from aerobat.planning import FreeKnots, MinSnap, Plan
from aerobat.planning.polynomial.descent.knot_program import Multipliers
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.problem import Course, PassGate, Problem, at_rest, load_problem, tilted_gate
from aerobat.vehicle import Vehicle, load_vehicle
from random_flights import with_lags

pytest.importorskip("casadi")

QUAD = load_vehicle("agile-quad")
JERKY = with_lags(QUAD, 0.0)
# time-optimal's durations [s], to rest upright: benchmarks/courses.py
LEAST = {"race-7": 7.395, "split-s-19 with lag and 3 %": 17.967}
SHARE = 1.06
TOLERANCE = 1e-5  # [SI units], of jumps relative to the largest value


def planned(problem: Problem, vehicle: Vehicle, reserve: float = 0.0) -> Plan:
    """The plan, where the closed form's search cannot stand in for it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delattr(MinSnap, "plan")
        return FreeKnots(reserve=reserve).plan(problem, vehicle)


def assert_smooth(plan: Plan, orders: int) -> None:
    """The first so many derivatives of the path are continuous, itself the zeroth."""
    for order in range(orders):
        size = np.abs(plan.trajectory.component_range(order)).max()
        assert plan.trajectory.jumps(order).max() <= TOLERANCE * size


def assert_through_every_ball(plan: Plan) -> None:
    assert plan.vehicle is not None
    stages = plan.problem.stages(plan.vehicle.max_specific_thrust).stages
    assert [placed.name for placed in plan.stages] == [stage.name for stage in stages]
    assert (np.diff([placed.time for placed in plan.stages]) > 0.0).all()
    for placed, stage in zip(plan.stages, stages, strict=True):
        assert stage.ball is not None
        distance = np.linalg.norm(plan.trajectory.evaluate(placed.time) - stage.ball.centre)
        assert distance <= stage.ball.radius
        assert distance > 0.9 * stage.ball.radius  # corners are cut


@pytest.fixture(scope="module")
def lap() -> Plan:
    return planned(load_problem("race-7"), JERKY)


def test_a_lap_is_certified_and_near_the_least_time_without_the_closed_form(lap: Plan) -> None:
    """It fell back to the closed form's 13.3 s."""
    assert lap.certified
    assert lap.rescue == ""
    assert lap.duration < SHARE * LEAST["race-7"]


def test_a_lap_passes_every_ball_and_jerk_does_not_jump(lap: Plan) -> None:
    assert_through_every_ball(lap)
    assert_smooth(lap, 4)


def test_the_published_course_with_lag_and_reserve_is_near_the_least_time_and_snap_does_not_jump() -> None:
    plan = planned(load_problem("split-s-19"), QUAD, reserve=0.03)
    assert plan.certified
    assert plan.certificate is not None
    assert not reserve_shortfalls(plan.certificate, 0.03)
    assert plan.rescue == ""
    assert plan.duration < SHARE * LEAST["split-s-19 with lag and 3 %"]
    assert_through_every_ball(plan)
    assert_smooth(plan, 5)


def test_openings_are_crossed_anywhere_inside() -> None:
    places = (
        (3.0, 0.0, 1.5),
        (6.0, 3.0, 2.0),
        (3.0, 6.0, 2.5),
        (-1.0, 6.0, 1.5),
        (-4.0, 3.0, 2.0),
        (-1.0, 0.0, 3.0),
    )
    headings = np.radians([0.0, 90.0, 180.0, 180.0, 270.0, 0.0])
    gates = tuple(
        tilted_gate(place, heading, width=2.0, height=2.0, name=f"gate {number}")
        for number, (place, heading) in enumerate(zip(places, headings, strict=True), 1)
    )
    elements = tuple(PassGate(gate.name, crossing_point="free") for gate in gates)
    start, goal = at_rest((0.0, 0.0, 1.5)), at_rest((2.0, 0.0, 3.0))
    plan = planned(Problem("openings", start, goal, Course(elements), gates), JERKY)
    assert plan.certified
    reach = 1.0 - QUAD.body_radius
    offsets = []
    for placed, gate in zip(plan.stages, gates, strict=True):
        offset = plan.trajectory.evaluate(placed.time) - gate.position
        assert abs(offset @ gate.normal) < 1e-5
        offsets.append(max(abs(offset @ gate.lateral), abs(offset @ gate.up)))
    assert max(offsets) <= reach + 1e-5
    assert min(offsets) > 0.05  # no one's centre is asked


def test_multipliers_find_their_rows_among_more_samples() -> None:
    few, more = np.array([0.0, 0.5, 1.0]), np.array([0.0, 0.2, 0.5, 0.7, 1.0])
    sampled = (np.arange(6.0).reshape(3, 2), 10.0 + np.arange(6.0).reshape(3, 2))
    known = Multipliers(np.array([7.0]), (few, few), sampled, np.array([8.0, 9.0]))
    box, rows = known.at((more, few))
    assert box.tolist() == [7.0]
    assert rows.tolist() == [0, 1, 0, 0, 2, 3, 0, 0, 4, 5, 10, 11, 12, 13, 14, 15, 8, 9]
