"""Time-optimal plans: the known least times, the physics integrated anew, stages and limits that hold."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.errors import SpecError
from aerobat.planning import Plan, TimeOptimal, plan
from aerobat.planning.warm_start import WarmStart
from aerobat.problem import (
    EndState,
    Limits,
    Line,
    Problem,
    Quantity,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    tilted_gate,
)
from aerobat.simulation import fly
from aerobat.states import STANDARD_GRAVITY
from aerobat.vehicle import load_vehicle
from random_flights import with_lags
from rigid_body_replay import replayed
from section_v_sets import LEAST_TIMES, section_v
from shared_plans import shared_plan

QUAD = load_vehicle("agile-quad")


@pytest.fixture(scope="module")
def flip() -> Plan:
    return TimeOptimal(segments=8, starts=1).plan(load_problem("flip-roll"), QUAD)


@pytest.fixture(scope="module")
def half_flip() -> Plan:
    return TimeOptimal(segments=8, starts=1).plan(load_problem("half-flip"), QUAD)


@pytest.mark.slow
@pytest.mark.parametrize("name", LEAST_TIMES)
def test_section_v_takes_no_longer_than_in_its_plane_and_a_rigid_body_without_control_arrives(name):
    """Feed-forward alone; in space there are faster ways than in the plane."""
    vehicle, problem = section_v(name), load_problem("section-v")
    found = TimeOptimal().plan(problem, vehicle)
    assert found.duration < 1.005 * LEAST_TIMES[name]
    assert found.certificate.certified
    position, velocity = replayed(found.trajectory, vehicle, problem.environment)
    assert np.linalg.norm(position - problem.goal.position) < 1e-3
    assert np.linalg.norm(velocity) < 1e-3


@pytest.mark.slow
def test_a_maneuver_that_lies_in_no_plane_is_planned_in_space():
    bent = Waypoints((Waypoint(position=(1.0, 1.0, 0.0)),))
    problem = Problem("bent", at_rest((0, 0, 0)), at_rest((2, 0, 0)), bent)
    found = TimeOptimal(segments=8, starts=1).plan(problem, QUAD)
    assert found.trajectory.evaluate(found.stages[0].time) == pytest.approx([1.0, 1.0, 0.0], abs=1e-6)


@pytest.mark.slow
def test_more_segments_make_shorter_plans():
    few, more = (TimeOptimal(segments=n, starts=1).plan(load_problem("power-loop"), QUAD) for n in (8, 32))
    assert few.trajectory.segments == 8
    assert 0.97 * few.duration < more.duration < few.duration


each_flip = pytest.mark.parametrize("name", [pytest.param("flip", marks=pytest.mark.slow), "half_flip"])


@each_flip
def test_a_flip_is_certified_and_flown_within_2_cm(name, request):
    found = request.getfixturevalue(name)
    assert found.certified
    assert any(attempt.feasible for attempt in found.attempts)
    flown = fly(found.trajectory, QUAD)
    assert np.linalg.norm(flown.states.position - flown.setpoint.flat.position, axis=-1).max() < 0.02


@each_flip
def test_every_stage_holds_where_it_is_said_to(name, request):
    found = request.getfixturevalue(name)
    course = found.problem.stages(QUAD.max_specific_thrust)
    assert len(found.stages) == len(course.stages)
    for placed, stage in zip(found.stages, course.stages, strict=True):
        flat = found.trajectory.on_segments([1.0], 0)[placed.interval, 0]
        assert found.trajectory.evaluate(placed.time) == pytest.approx(flat, abs=1e-9)
        for condition in stage.conditions:
            value = quantity(found, condition.quantity, placed.time) @ condition.direction
            assert condition.lower - 1e-5 <= value <= condition.upper + 1e-5


def quantity(found: Plan, which: Quantity, time: float) -> np.ndarray:
    weight = np.array([0.0, 0.0, STANDARD_GRAVITY]) * (which is Quantity.SPECIFIC_THRUST)
    return found.trajectory.evaluate(time, which.derivative) + weight


def test_the_half_flip_passes_its_gate_squarely_and_banked_as_the_gate_is(half_flip):
    (passage,) = half_flip.stages
    gate = half_flip.problem.gate(passage.gate)
    velocity = half_flip.trajectory.evaluate(passage.time, 1)
    thrust = quantity(half_flip, Quantity.SPECIFIC_THRUST, passage.time)
    assert half_flip.trajectory.evaluate(passage.time) == pytest.approx(gate.position, abs=1e-6)
    assert velocity == pytest.approx(gate.normal * np.linalg.norm(velocity), abs=1e-5)
    assert thrust @ gate.up > 0.2 * QUAD.max_specific_thrust - 1e-5
    assert thrust @ gate.up > np.cos(gate.attitude_tolerance / 2) * np.linalg.norm(thrust) - 1e-6


def test_lagging_rotors_can_follow(half_flip):
    """Thrust is continuous, and at both ends that of hovering."""
    weight = np.array([0.0, 0.0, STANDARD_GRAVITY])
    thrust = np.linalg.norm(half_flip.trajectory.on_segments([0.0, 1.0], 2) + weight, axis=-1)
    assert thrust[1:, 0] == pytest.approx(thrust[:-1, 1], abs=1e-6)
    assert thrust[[0, -1], [0, 1]] == pytest.approx(STANDARD_GRAVITY, abs=1e-6)


@pytest.mark.slow
def test_limits_hold_between_nodes_and_cost_time():
    limits = Limits(upper=np.array([np.inf, np.inf, 0.05]), velocity=5.0, acceleration=20.0, jerk=150.0)
    free = Problem("dash", at_rest((0, 0, 0)), at_rest((4, 0, 0)))
    bound = TimeOptimal(segments=8, starts=1).plan(replace(free, limits=limits), QUAD)
    for derivative in range(4):
        (lower, upper), (least, most) = limits.of(derivative), bound.trajectory.component_range(derivative)
        assert (lower - 1e-9 <= least).all()
        assert (most <= upper + 1e-9).all()
    assert bound.certificate.certified
    assert bound.duration > TimeOptimal(segments=8, starts=1).plan(free, QUAD).duration


@pytest.mark.slow
def test_who_would_come_into_a_gate_along_its_plane_flies_straighter_through_it():
    gate = tilted_gate((1.5, 1.0, 0.0), heading=np.radians(60.0))
    problem = Problem("aside", at_rest((0.0, 0.0, 0.0)), at_rest((3.0, 0.0, 0.0)), Line(), (gate,))
    found = plan(problem, TimeOptimal(reserve=0.03, starts=1), "hexarotor")
    assert found.flies, found.flyability
    assert found.flyability.passages[0].clearance > 0.0


@pytest.mark.slow
def test_ends_in_motion_are_met():
    start = EndState(np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    goal = EndState(np.array([6.0, 1.0, 1.0]), np.array([0.0, -1.0, 0.0]))
    path = TimeOptimal(segments=8, starts=1).plan(Problem("moving", start, goal), QUAD).trajectory
    for end, state in ((0.0, start), (path.duration, goal)):
        for derivative, value in enumerate(state.derivatives(3)):
            assert path.evaluate(end, derivative) == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize("name", ["line", pytest.param("half-flip", marks=pytest.mark.slow)])
def test_rotors_without_lag_begin_and_end_with_the_acceleration_that_is_asked(name):
    """Thrust may jump in an instant, but not before the first: 22 m/s² were certified at rest."""
    problem = load_problem(name)
    path = TimeOptimal(segments=8, starts=1).plan(problem, with_lags(QUAD, 0.0)).trajectory
    for end, state in ((0.0, problem.start), (path.duration, problem.goal)):
        assert path.evaluate(end, 2) == pytest.approx(state.acceleration, abs=1e-5)


@pytest.mark.slow
def test_a_reserve_is_kept_from_every_rotors_limits_and_costs_time():
    problem = load_problem("half-flip")
    kept, free = (TimeOptimal(reserve=kept, starts=2).plan(problem, QUAD) for kept in (0.05, 0.0))
    assert kept.margin.margin > 0.04 * QUAD.max_thrusts.max()
    assert kept.duration > free.duration


def test_what_cannot_be_asked_is_refused():
    problem = load_problem("flip-roll")
    with pytest.raises(SpecError, match="needs a vehicle"):
        TimeOptimal().plan(problem)
    falling = EndState(np.zeros(3), acceleration=np.array([0.0, 0.0, -STANDARD_GRAVITY]))
    with pytest.raises(SpecError, match=r"start\.acceleration asks no thrust"):
        TimeOptimal().plan(Problem("falling", falling, at_rest((1, 0, 0)), Line()), QUAD)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"segments": 1}, "segments must be 2 or more, got 1"),
        ({"reserve": 0.6}, r"TimeOptimal\.reserve must be less than 0\.5, got 0\.6"),
        ({"reserve": float("nan")}, r"TimeOptimal\.reserve must be a finite number"),
        ({"starts": 0}, "starts must be 1 or more"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, sentence):
    with pytest.raises(SpecError, match=sentence):
        TimeOptimal(**options)


def test_a_path_bent_aside_leaves_its_ends_as_they_are_and_its_pace_too():
    path = WarmStart.of(shared_plan("half-flip"), shared_plan("half-flip").problem.stages(1.0))
    aside = np.array([0.3, -0.2, 0.1])
    bent = path.bent(aside)
    duration = path.trajectory.duration
    assert bent.times == path.times
    for end in (0.0, duration):
        for derivative in range(2):
            there = path.trajectory.evaluate(end, derivative)
            assert bent.trajectory.evaluate(end, derivative) == pytest.approx(there, abs=1e-9)
    halfway = path.trajectory.evaluate(duration / 2.0)
    assert bent.trajectory.evaluate(duration / 2.0) == pytest.approx(halfway + aside)


def test_a_path_at_other_paces_goes_through_the_same_places_at_other_times():
    path = WarmStart.of(shared_plan("half-flip"), shared_plan("half-flip").problem.stages(1.0))
    paced = path.at_other_pace(np.array([2.0, 0.5]))
    assert paced.phases == pytest.approx(path.phases * [2.0, 0.5])
    for before, after in zip(path.times, paced.times, strict=True):
        assert paced.trajectory.evaluate(after) == pytest.approx(path.trajectory.evaluate(before))
