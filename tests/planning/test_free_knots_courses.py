"""Free knots through many stages: certified, smooth, near the least time, through every ball and opening."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.certification import Finding, Side, Verdict
from aerobat.errors import Infeasible
from aerobat.planning import FreeKnots, MinSnap, Plan, plan
from aerobat.planning.flyability import own_flight
from aerobat.planning.gate_clearance import more_direct
from aerobat.planning.multi_start import MultiStart
from aerobat.planning.refinement.refine import Refinement
from aerobat.planning.rotor_margin import reserve_shortfalls
from aerobat.planning.task import Task
from aerobat.problem import (
    Course,
    PassGate,
    Problem,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    tilted_gate,
)
from aerobat.vehicle import Vehicle, load_vehicle
from random_courses import random_course
from random_flights import with_lags

QUAD = load_vehicle("agile-quad")
JERKY = with_lags(QUAD, 0.0)
# time-optimal's durations [s], to rest upright: benchmarks/courses.py
LEAST = {"split-s-19 with lag and 3 %": 17.967}
SHARE = 1.01
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


@pytest.mark.slow
def test_the_published_course_with_lag_and_reserve_is_near_the_least_time_and_snap_does_not_jump() -> None:
    plan = planned(load_problem("split-s-19"), QUAD, reserve=0.03)
    assert plan.certified
    assert plan.certificate is not None
    assert not reserve_shortfalls(plan.certificate, 0.03)
    assert plan.rescue == ""
    assert plan.duration < SHARE * LEAST["split-s-19 with lag and 3 %"]
    assert_through_every_ball(plan)
    assert_smooth(plan, 5)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 4])
def test_tilted_gates_are_passed_with_the_whole_body_anywhere_or_upright_as_asked(count: int) -> None:
    """None was planned: the start passed them from any side, and samples missed how sharply bodies turn."""
    places = ((3.0, 0.0, 1.5), (6.0, 3.0, 2.5), (3.0, 7.0, 3.5), (-1.0, 5.0, 2.0))
    attitudes = ((0.0, 20.0, 0.0), (90.0, 0.0, 60.0), (180.0, -20.0, -120.0), (250.0, 10.0, 0.0))
    gates = tuple(
        tilted_gate(place, *np.radians(attitude).tolist(), 1.2, 0.9, f"gate {number}")
        for number, (place, attitude) in enumerate(zip(places[:count], attitudes, strict=False), 1)
    )
    free = PassGate("gate 1", crossing_point="free", margin=0.1)
    asked = (free, PassGate("gate 2", upright=True), replace(free, gate="gate 3"), PassGate("gate 4"))[:count]
    start, goal = at_rest((0.0, 0.0, 1.5)), at_rest((-1.0, 0.0, 2.0))
    plan = planned(Problem("tilted", start, goal, Course(asked), gates), JERKY)
    assert plan.certified
    assert_smooth(plan, 4)
    assert len(plan.stages) == len(gates)
    offsets = [
        plan.trajectory.evaluate(placed.time) - gate.position
        for placed, gate in zip(plan.stages, gates, strict=True)
    ]
    assert min(np.linalg.norm(offset) for offset in offsets[0::2]) > 0.05  # no one's centre is asked
    assert max(np.linalg.norm(offset) for offset in offsets[1::2]) < 1e-5
    flight = own_flight(Task.of(plan.problem, JERKY), plan.trajectory, plan.stages)
    assert all(passage.clearance is not None and passage.clearance > 0.0 for passage in flight.passages)


def test_a_path_is_made_more_direct_by_less_where_the_body_only_touches_the_frame() -> None:
    task = Task.of(load_problem("flip-roll"), QUAD)
    stages = task.stages.stages

    def raised_by(clearance: float) -> float:
        hit = Finding("clearance", "m", Side.MIN, clearance, clearance, 0.0, 0.0, Verdict.VIOLATED)
        (body,) = more_direct((), stages, task, [hit])
        (again,) = more_direct((body,), stages, task, [hit])
        return again.lateral_acceleration / body.lateral_acceleration

    assert 1.0 < raised_by(-0.001) < raised_by(-0.1)


@pytest.mark.slow
def test_a_course_whose_fast_starts_lead_nowhere_is_planned_from_a_slower_one():
    """Ten gates of any attitude: closed forms near the vehicle's limits missed the first one."""
    course = random_course(0, 24)
    found = plan(course)
    assert found.certified
    assert found.flies
    assert [placed.gate for placed in found.stages] == [gate.name for gate in course.gates]


@pytest.mark.slow
def test_a_corkscrew_that_no_closed_form_leads_to_begins_at_a_program_of_more_intervals() -> None:
    """With a Crazyflie and the reserve of the command line it was refused; the MIQP takes 4.75 s."""
    found = plan("corkscrew", vehicle="crazyflie")
    assert found.planner == "free-knots"
    assert found.flies
    assert found.duration < 4.75


def test_no_start_of_a_refused_course_is_refined_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Refinement, "is_promising", lambda *_: False)
    monkeypatch.setattr("aerobat.planning.multi_start.starts", lambda *_: ())
    monkeypatch.setattr(MultiStart, "_of_more", lambda *_: ())
    points = tuple(Waypoint((float(k), k % 2, 2.0)) for k in range(1, 7))
    course = Problem("zigzag", at_rest((0.0, 0.0, 2.0)), at_rest((7.0, 0.0, 2.0)), Waypoints(points))
    with pytest.raises(Infeasible) as refusal:
        plan(course, "free-knots")
    durations = [attempt.duration for attempt in refusal.value.attempts]
    assert len(durations) == len(set(durations)) > 5
