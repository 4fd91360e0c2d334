"""Time-optimal plans through many stages: certified, flown by an independent integration, or told why not."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.errors import Infeasible, SpecError
from aerobat.evaluation import score
from aerobat.planning import Miqp, Plan, TimeOptimal
from aerobat.planning.assessment.lower_bound import least_duration
from aerobat.problem import EndState, Limits, Problem, Waypoint, Waypoints, at_rest, load_problem, tilted_gate
from aerobat.simulation import fly
from aerobat.vehicle import load_vehicle
from courses import HEADINGS, LAP, RADIUS
from random_courses import planned, random_course
from random_flights import with_lags
from rigid_body_replay import replayed_at_knots

QUAD = load_vehicle("agile-quad")
JERKY = with_lags(QUAD, 0.0)
STOP = EndState((4.75, -0.9, 1.2), free_attitude=True)


def course(points: tuple[tuple[float, float, float], ...], goal: EndState = STOP) -> Problem:
    balls = Waypoints(tuple(Waypoint(point, radius=RADIUS) for point in points))
    return Problem("course", at_rest((-5.0, 4.5, 1.2)), goal, balls)


@pytest.fixture(scope="module")
def lap() -> Plan:
    """Planned where no mixed-integer plan can be had."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delattr(Miqp, "plan")
        return TimeOptimal().plan(course(LAP), JERKY)


def assert_flown_through(plan: Plan) -> None:
    """The nonlinear rigid body under the plan's rotor thrusts, integrated by another, passes every ball."""
    states = replayed_at_knots(plan.trajectory, plan.vehicle, plan.problem.environment)
    for placed, waypoint in zip(plan.stages, plan.problem.maneuver.waypoints, strict=True):
        knot = int(np.argmin(np.abs(plan.trajectory.knots - placed.time)))
        assert np.linalg.norm(states[knot, :3] - waypoint.position) <= RADIUS + 1e-4
    assert np.linalg.norm(states[-1, :3] - plan.problem.goal.position) < 1e-3
    assert np.linalg.norm(states[-1, 3:6]) < 1e-2


def test_the_presets_hold_the_published_points():
    """Foehn, Romero, Scaramuzza, Science Robotics 6 (56), 2021."""
    published = [(-1.1, -1.6, 3.6), (9.2, 6.6, 1.0), (9.2, -4.0, 1.2), (-4.5, -6.0, 3.5), (-4.5, -6.0, 0.8)]
    published += [(4.75, -0.9, 1.2), (-2.8, 6.8, 1.2)]
    for name in ("race-7", "split-s-19", "lap-7"):
        elements = load_problem(name).maneuver.elements
        assert [tuple(element.position) for element in elements] == published
        assert {element.radius for element in elements} == {0.3}
    assert tuple(published) == LAP


@pytest.mark.slow
def test_the_published_course_is_as_fast_as_published_and_a_rigid_body_without_control_flies_it():
    """17.56 s by CPC, "the true optimum"; the issue's floor is 17.60 s."""
    plan = TimeOptimal().plan(course((*LAP, *LAP, *LAP[:5])), JERKY)
    assert plan.certified
    assert 17.53 < plan.duration < 17.60
    assert_flown_through(plan)


@pytest.mark.slow
def test_a_lap_is_certified_and_flown_without_a_mixed_integer_plan(lap):
    assert lap.certified
    assert least_duration(lap.problem, JERKY) < lap.duration
    assert_flown_through(lap)


@pytest.mark.slow
def test_a_lap_with_lag_and_reserve_keeps_it_and_flies_through():
    plan = TimeOptimal(reserve=0.03).plan(course(LAP), QUAD)
    assert plan.certified
    assert plan.margin.margin > 0.02 * QUAD.max_thrusts.max()
    assert_flown_through(plan)


@pytest.mark.slow
def test_a_goal_of_free_attitude_is_reached_sooner_and_at_rest(lap):
    upright = TimeOptimal().plan(course(LAP, at_rest(STOP.position)), JERKY)
    end, along = lap.duration, lap.trajectory
    thrust = upright.trajectory.evaluate(upright.duration, 2)
    assert lap.duration < upright.duration - 0.01
    assert along.evaluate(end) == pytest.approx(STOP.position, abs=1e-4)
    assert np.linalg.norm(along.evaluate(end, 1)) < 1e-3
    assert np.linalg.norm(along.evaluate(end, 2)[:2]) > 1.0
    assert np.linalg.norm(thrust[:2]) < 1e-3  # straight up
    with pytest.raises(SpecError, match=r"start\.free_attitude is for goals"):
        replace(lap.problem, start=EndState((0, 0, 0), free_attitude=True))


@pytest.mark.slow
def test_openings_are_crossed_anywhere_inside():
    angles = np.radians(HEADINGS)
    gates = tuple(
        tilted_gate(point, heading, width=2.4, height=2.4, name=f"gate {number}")
        for number, (point, heading) in enumerate(zip(LAP, angles, strict=True), 1)
    )
    margin = 0.4 - QUAD.body_radius
    stages = tuple(Waypoint(gate=gate.name, crossing_point="free", margin=margin) for gate in gates[:6])
    problem = replace(course(LAP), maneuver=Waypoints(stages), gates=gates)
    plan = TimeOptimal().plan(problem, JERKY)
    reached = []
    for placed, gate in zip(plan.stages, gates, strict=False):
        offset = plan.trajectory.evaluate(placed.time) - gate.position
        reached.append(max(abs(offset @ gate.lateral), abs(offset @ gate.up)))
    assert plan.certified
    assert max(reached) == pytest.approx(0.8, abs=1e-4)  # corners are cut
    assert min(reached[:5]) > 0.6  # the last lies at the goal


@pytest.mark.slow
def test_a_course_that_cannot_be_flown_names_the_leg():
    balls = [Waypoint(point, radius=RADIUS) for point in LAP]
    balls[3] = Waypoint(LAP[3], velocity=(500.0, 0.0, 0.0))
    hall = Limits(lower=np.array([-20.0, -20.0, 0.0]), upper=np.array([20.0, 20.0, 10.0]))
    problem = replace(course(LAP), maneuver=Waypoints(tuple(balls)), limits=hall)
    with pytest.raises(Infeasible, match=r"between 'waypoint [34]' and 'waypoint [45]'"):
        TimeOptimal(starts=1).plan(problem, JERKY)


@pytest.mark.slow
def test_gates_of_any_attitude_are_passed_by_the_whole_body():
    """Anywhere in the opening or at its centre, some of them with the thrust along their upright."""
    plan = planned(random_course(0, 11), QUAD)
    assert plan.planner == "free-knots"
    assert plan.certified
    passages = score(fly(plan), plan).passages
    assert [passage.gate for passage in passages] == [gate.name for gate in plan.problem.gates]
    assert [passage.failure for passage in passages] == [None] * len(passages)
    assert min(passage.clearance for passage in passages) > 0.0
