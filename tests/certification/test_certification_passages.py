"""Passages through gates are proven where a plan places them: in plane, inside, in direction, upright."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat import so3
from aerobat.certification import Certificate, Envelope, Finding, Verdict, certify
from aerobat.evaluation import score
from aerobat.flatness import reference
from aerobat.planning import Miqp, Plan, load_plan, plan
from aerobat.problem import (
    Condition,
    CustomManeuver,
    Gate,
    Problem,
    Stage,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    tilted_gate,
)
from aerobat.problem.condition import Attitude, across
from aerobat.problem.planned_passage import CROSSING_SPEED, PlannedPassage
from aerobat.problem.stage import PLANNED_SHARE
from aerobat.simulation import fly
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle
from random_flights import random_flight, with_lags

VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)
QUANTITIES = ["off plane", "inside by", "speed through", "attitude"]
AHEAD = np.array([1.0, 0.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def flip() -> Plan:
    return plan(load_problem("flip-roll"), Miqp(order=5), VEHICLE)


def passage_of(certificate: Certificate) -> dict[str, Finding]:
    """What is said of the instant of the passage; of the body on the way through, `frames` says it."""
    found = set(certificate.findings) - set(certificate.frames)
    return {f.quantity: f for f in certificate.findings if f.gate is not None and f in found}


def level(speed: float) -> Trajectory:
    """Two seconds along +x, through the origin's plane at one."""
    return Trajectory([2.0], [[[-speed, 0, 0], [2 * speed, 0, 0]]])


def judged(path: Trajectory, gate: Gate, **asked: object) -> dict[str, Finding]:
    attitude = {"up": gate.up, "attitude_tolerance": gate.attitude_tolerance}
    passage = PlannedPassage(gate, 1.0, **(attitude | asked))
    return passage_of(certify(path, VEHICLE, envelope=Envelope(passages=(passage,))))


def test_a_plan_is_certified_with_its_passage_and_check_says_the_same(flip, tmp_path):
    found = passage_of(flip.certificate)
    assert list(found) == QUANTITIES
    assert {finding.gate for finding in found.values()} == {"gate"}
    assert {finding.time for finding in found.values()} == {flip.stages[2].time}
    assert all(finding.verdict is Verdict.HOLDS for finding in found.values())
    assert flip.certificate == flip.for_vehicle(VEHICLE).certificate
    flip.save(tmp_path / "flip.plan")
    assert load_plan(tmp_path / "flip.plan").certificate == flip.certificate


@pytest.mark.parametrize("seed", [*range(10), pytest.param(10, marks=pytest.mark.slow), 11])
def test_each_finding_is_what_flatness_says_at_that_instant(seed):
    flight, rng = random_flight(seed), np.random.default_rng(seed)
    time = float(rng.uniform(0.1, 0.9) * flight.trajectory.duration)
    normal = rng.normal(size=3)
    up = across(normal / np.linalg.norm(normal))[0]
    position = flight.trajectory.evaluate(np.array([time]))[0] + 0.3 * rng.normal(size=3)
    gate = Gate(position, normal, up, attitude_tolerance=1.0)
    certificate = certify(
        flight.trajectory,
        flight.vehicle,
        flight.environment,
        Envelope(passages=(PlannedPassage(gate, time, gate.up, gate.attitude_tolerance),)),
    )
    times = np.linspace(0, time, 200)
    there = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment).setpoint
    offset, velocity = there.flat.position[-1] - position, there.flat.velocity[-1]
    thrust = so3.thrust_axis(there.q_world_body[-1])
    inside = min(gate.width / 2 - abs(offset @ gate.lateral), gate.height / 2 - abs(offset @ gate.up))
    expected = [abs(offset @ gate.normal), inside, velocity @ gate.normal, np.arccos(thrust @ gate.up)]
    found = passage_of(certificate)
    assert [finding.value for finding in found.values()] == pytest.approx(expected, abs=1e-7)
    limits = [1e-3, 0.0, CROSSING_SPEED, 1.0]
    assert [finding.limit for finding in found.values()] == limits
    excess = np.subtract(expected, limits) * [1.0, -1.0, -1.0, 1.0]
    holds = (excess <= 0.0).tolist()
    assert [finding.verdict is Verdict.HOLDS for finding in found.values()] == holds
    assert certificate.certified <= all(holds)


def test_a_plan_whose_gate_is_elsewhere_then_is_not_certified(flip):
    late = replace(flip, stages=tuple(replace(s, time=s.time + 0.1) for s in flip.stages))
    certificate = late.for_vehicle(VEHICLE).certificate
    assert not certificate.certified
    violated = [f.quantity for f in certificate.findings if f.verdict is Verdict.VIOLATED]
    assert violated[0] == "off plane"
    assert certificate.why.startswith("gate 'gate' off plane ")


def test_a_plan_that_passes_the_gate_tilted_is_not_certified():
    # flown slower the path is the same, and the thrust another
    problem = load_problem("half-flip")
    little = problem.maneuver.with_stage_thrust(problem.gates, 7.0)
    fast = plan(replace(problem, maneuver=little), Miqp(order=5), VEHICLE)
    slow = Trajectory(1.3 * fast.trajectory.durations, fast.trajectory.coefficients)
    stages = tuple(replace(s, time=1.3 * s.time) for s in fast.stages)
    certificate = replace(fast, trajectory=slow, stages=stages).for_vehicle(VEHICLE).certificate
    (violated,) = (f for f in certificate.findings if f.verdict is Verdict.VIOLATED)
    assert (violated.quantity, violated.unit, violated.limit) == ("attitude", "rad", np.deg2rad(5.0))
    assert certificate.why == str(violated)
    assert certificate.why.startswith("gate 'gate' attitude ")
    assert "° of 5° at " in certificate.why


def test_through_the_gate_backwards_is_not_through():
    back = Gate(np.zeros(3), -AHEAD, UP, name="back")
    found = judged(level(2.0), back)
    assert [q for q, finding in found.items() if finding.verdict is Verdict.VIOLATED] == ["speed through"]
    assert str(found["speed through"]) == (
        "gate 'back' speed through -2 m/s of at least 0.001 m/s at 1.000 s, 2 m/s below its limit"
    )
    assert all(f.verdict is Verdict.HOLDS for f in judged(level(2.0), Gate(np.zeros(3), AHEAD, UP)).values())


@pytest.mark.parametrize("side", ["width", "height"])
def test_beside_the_opening_is_not_through(side):
    aside = {"width": [0, 0.4, 0], "height": [0, 0, 0.4]}[side]
    for size, verdict in ((0.9, Verdict.HOLDS), (0.7, Verdict.VIOLATED)):
        found = judged(level(1.0), Gate(np.array(aside), AHEAD, UP, **{side: size}))
        assert found["inside by"].verdict is verdict


def test_standing_in_the_gate_is_not_through_unless_the_stage_forbids_to_move():
    gate = Gate(np.zeros(3), AHEAD, UP)
    still = Trajectory([2.0], np.zeros((1, 1, 3)))
    passing = Stage("gate", (Condition("velocity", AHEAD, lower=0.0),), gate="gate")
    stopping = Stage("gate", (Condition("velocity", AHEAD, upper=0.0, lower=0.0),), gate="gate")
    for stage, verdict in ((passing, Verdict.VIOLATED), (stopping, Verdict.HOLDS)):
        asked = Envelope(passages=(PlannedPassage.of(stage, gate, 1.0),))
        assert passage_of(certify(still, VEHICLE, envelope=asked))["speed through"].verdict is verdict


@pytest.mark.slow
def test_attitude_is_asked_where_the_stage_asks_it_alone():
    ahead = Waypoint(position=np.array([2.0, 0.0, 1.0]), gate="a")
    upright = Waypoint(position=np.array([4.0, 0.0, 1.0]), gate="b", up=UP)
    gates = tuple(Gate(w.position, AHEAD, UP, name=w.gate) for w in (ahead, upright))
    problem = Problem("two", at_rest([0, 0, 0]), at_rest([6, 0, 0]), Waypoints((ahead, upright)), gates)
    made = plan(problem, Miqp(order=5), VEHICLE)
    attitudes = [f.gate for f in made.certificate.findings if f.quantity == "attitude"]
    assert attitudes == ["b"]
    passed = [f.gate for f in made.certificate.findings if f.quantity == "speed through"]
    assert passed == ["a", "b"]


def test_where_there_is_no_thrust_no_attitude_is_told():
    falling = Trajectory([2.0], [[[0, 0, 0], [2.0, 0, 0], [0, 0, -2 * 9.81]]])
    gate = Gate(falling.evaluate(np.array([1.0]))[0], AHEAD, UP)
    assert judged(falling, gate)["attitude"].verdict is Verdict.UNDECIDED
    assert "attitude" not in judged(falling, gate, attitude_tolerance=np.inf)


def test_an_attitude_of_its_own_in_a_gate_is_what_certificate_and_score_judge_by():
    """Upright, through a gate that is tilted by 40°."""
    gate = tilted_gate(np.array([3.0, 0.0, 1.0]), tilt=np.deg2rad(40.0), width=2.0, height=2.0)
    stage = Stage("gate", gate="gate", attitude=Attitude(UP, min_thrust=5.0, tolerance=0.5))
    ends = at_rest([0, 0, 1]), at_rest([6, 0, 1])
    made = plan(Problem("upright", *ends, CustomManeuver((stage,)), (gate,)), Miqp(order=5), VEHICLE)
    found = passage_of(made.certificate)["attitude"]
    (passage,) = score(fly(made), made).passages
    assert made.certified
    assert found.value <= PLANNED_SHARE * gate.attitude_tolerance < 0.5
    assert found.limit == gate.attitude_tolerance == pytest.approx(np.deg2rad(passage.attitude_tolerance_deg))
    assert np.rad2deg(found.value) == pytest.approx(passage.attitude_error_deg, abs=1.0)
