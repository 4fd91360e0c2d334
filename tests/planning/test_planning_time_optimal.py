"""Time-optimal plans: the known least times, the physics integrated anew, stages and limits that hold."""

import importlib.util
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from aerobat.errors import BackendMissing, Infeasible, SpecError
from aerobat.planning import Plan, plan
from aerobat.planning.time_optimal.optimal_control.collocation import CollocationMesh
from aerobat.planning.time_optimal.time_optimal import TimeOptimal
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
from aerobat.vehicle import Vehicle, load_vehicle
from random_flights import with_lags
from rigid_body_replay import replayed

QUAD = load_vehicle("agile-quad")


# rotors up to [N], inertia [kg·m²], duration [s] of the planar problem by multiple shooting of the rigid body
SETS = {
    "A": (18.0, 0.12, 1.842),
    "B": (6.5, 0.12, 2.342),
    "D": (18.0, 0.012, 1.134),
    "E": (6.5, 0.012, 1.942),
}


def section_v(name: str) -> Vehicle:
    """The vehicle of Section V with rotors from 0 N."""
    max_thrust, inertia, _ = SETS[name]
    vehicle = load_vehicle("section-v")
    rotors = tuple(replace(rotor, min_thrust=0.0, max_thrust=max_thrust) for rotor in vehicle.rotors)
    return replace(vehicle, inertia=inertia * np.eye(3), rotors=rotors)


@cache
def planar(name: str, intervals: int = 60, reserve: float = 0.0) -> Plan:
    planner = TimeOptimal(intervals, reserve, starts=1, planar=True)
    return planner.plan(load_problem("section-v"), section_v(name))


@pytest.fixture(scope="module")
def flip() -> Plan:
    return TimeOptimal(intervals=24, starts=1).plan(load_problem("flip-roll"), QUAD)


@pytest.fixture(scope="module")
def half_flip() -> Plan:
    return TimeOptimal(intervals=12, starts=1).plan(load_problem("half-flip"), QUAD)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in "ADE" else name for name in SETS]
)
def test_section_v_takes_its_least_time_and_a_rigid_body_without_control_arrives(name):
    """Feed-forward alone."""
    vehicle, problem, least = section_v(name), load_problem("section-v"), SETS[name][2]
    found = planar(name)
    assert found.duration == pytest.approx(least, rel=5e-3)
    assert found.certificate.certified
    assert np.abs(np.array(found.trajectory.component_range(0))[:, 1]).max() < 1e-5
    assert found.trajectory.evaluate(found.stages[0].time)[2] == pytest.approx(-2.0, abs=1e-6)
    position, velocity = replayed(found.trajectory, vehicle, problem.environment)
    assert np.linalg.norm(position - problem.goal.position) < 1e-3
    assert np.linalg.norm(velocity) < 1e-3


@pytest.mark.slow
def test_in_space_there_is_a_faster_way_than_in_the_plane():
    vehicle = section_v("D")
    in_space = TimeOptimal(intervals=40).plan(load_problem("section-v"), vehicle)
    assert in_space.duration < 1.11


@pytest.mark.slow
def test_a_maneuver_that_lies_in_no_plane_is_planned_in_space():
    bent = Waypoints((Waypoint(position=(1.0, 1.0, 0.0)),))
    problem = Problem("bent", at_rest((0, 0, 0)), at_rest((2, 0, 0)), bent)
    found = TimeOptimal(intervals=8, starts=1).plan(problem, QUAD)
    assert found.trajectory.evaluate(found.stages[0].time) == pytest.approx([1.0, 1.0, 0.0], abs=1e-6)


@pytest.mark.slow
def test_more_intervals_change_little():
    assert planar("B", 20).trajectory.segments < planar("B").trajectory.segments
    assert planar("B", 20).duration == pytest.approx(planar("B").duration, rel=0.015)


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
        assert found.trajectory.evaluate(placed.time) == pytest.approx(flat)
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
    bound = TimeOptimal(intervals=8, starts=1).plan(replace(free, limits=limits), QUAD)
    for derivative in range(4):
        (lower, upper), (least, most) = limits.of(derivative), bound.trajectory.component_range(derivative)
        assert (lower - 1e-9 <= least).all()
        assert (most <= upper + 1e-9).all()
    assert bound.certificate.certified
    assert bound.duration > TimeOptimal(intervals=8, starts=1).plan(free, QUAD).duration


@pytest.mark.slow
def test_who_would_come_into_a_gate_along_its_plane_flies_straighter_through_it():
    gate = tilted_gate((1.5, 1.0, 0.0), heading=np.radians(60.0))
    problem = Problem("aside", at_rest((0.0, 0.0, 0.0)), at_rest((3.0, 0.0, 0.0)), Line(), (gate,))
    found = plan(problem, TimeOptimal(reserve=0.03, starts=1, intervals=12), "hexarotor")
    assert found.flies, found.flyability
    assert found.flyability.passages[0].clearance > 0.0


@pytest.mark.slow
def test_ends_in_motion_are_met():
    start = EndState(np.zeros(3), np.array([2.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    goal = EndState(np.array([6.0, 1.0, 1.0]), np.array([0.0, -1.0, 0.0]))
    path = TimeOptimal(intervals=30, starts=1).plan(Problem("moving", start, goal), QUAD).trajectory
    for end, state in ((0.0, start), (path.duration, goal)):
        for derivative, value in enumerate(state.derivatives(3)):
            assert path.evaluate(end, derivative) == pytest.approx(value, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "intervals"), [("line", 8), pytest.param("half-flip", 60, marks=pytest.mark.slow)]
)
def test_rotors_without_lag_begin_and_end_with_the_acceleration_that_is_asked(name, intervals):
    """Thrust may jump in an instant, but not before the first: 22 m/s² were certified at rest."""
    problem = load_problem(name)
    path = TimeOptimal(intervals, starts=1).plan(problem, with_lags(QUAD, 0.0)).trajectory
    for end, state in ((0.0, problem.start), (path.duration, problem.goal)):
        assert path.evaluate(end, 2) == pytest.approx(state.acceleration, abs=1e-5)


@pytest.mark.parametrize("continuous", [True, False])
def test_the_end_intervals_are_short_where_thrust_jumps(continuous):
    mesh = CollocationMesh.even((2, 5), continuous, np.ones(3))
    assert np.bincount(mesh.phase_of, mesh.fractions) == pytest.approx([1.0, 1.0])
    assert (mesh.fractions[0] < 0.8 * mesh.fractions[1]) is not continuous
    assert (mesh.fractions[-1] < 0.8 * mesh.fractions[-2]) is not continuous


@pytest.mark.slow
def test_a_reserve_is_kept_from_every_rotors_limits_and_costs_time():
    kept = planar("B", 20, 0.05)
    assert kept.margin.margin > 0.04 * SETS["B"][0]
    assert kept.duration > planar("B", 20).duration


def test_what_cannot_be_asked_is_refused():
    problem = load_problem("flip-roll")
    with pytest.raises(SpecError, match="needs a vehicle"):
        TimeOptimal().plan(problem)
    with pytest.raises(SpecError, match=r"limits\.crackle"):
        TimeOptimal().plan(replace(problem, limits=Limits(crackle=1e5)), QUAD)
    falling = EndState(np.zeros(3), acceleration=np.array([0.0, 0.0, -STANDARD_GRAVITY]))
    with pytest.raises(SpecError, match=r"start\.acceleration asks no thrust"):
        TimeOptimal().plan(Problem("falling", falling, at_rest((1, 0, 0)), Line()), QUAD)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"intervals": 3}, "intervals must be 4 or more, got 3"),
        ({"reserve": 0.6}, r"TimeOptimal\.reserve must be less than 0\.5, got 0\.6"),
        ({"reserve": float("nan")}, r"TimeOptimal\.reserve must be a finite number"),
        ({"iterations": 0}, "iterations must be 1 or more"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, sentence):
    with pytest.raises(SpecError, match=sentence):
        TimeOptimal(**options)


def test_a_search_that_ends_with_nothing_says_where_and_what_to_change():
    seen = []
    with pytest.raises(
        Infeasible, match=r"limit of iterations, worst on the leg from .*; ask less .* or give"
    ) as raised:
        TimeOptimal(iterations=2, starts=2).plan(load_problem("race-7"), QUAD, seen.append)
    assert list(raised.value.attempts) == seen
    assert all(not attempt.feasible for attempt in seen)


@pytest.mark.slow
def test_where_no_motion_is_found_polynomials_are_the_plan():
    """Refined from the path that the motion began from."""
    found = TimeOptimal(iterations=2, starts=1).plan(load_problem("line"), QUAD)
    assert found.certified
    assert found.planner == "time-optimal"
    assert found.duration < 1.46


def test_without_casadi_the_remedy_is_the_command_that_installs_it(monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        "aerobat.optimization.nonlinear.find_spec", lambda name: None if name == "casadi" else find(name)
    )
    with pytest.raises(BackendMissing, match=r'pip install "aerobat\[casadi\]"'):
        TimeOptimal().plan(load_problem("line"), QUAD)
