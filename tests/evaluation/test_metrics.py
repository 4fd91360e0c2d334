"""Scores say what happened: built on flights whose errors are known."""

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.evaluation import Passage, score, score_flights
from aerobat.problem import Gate, Problem, at_rest, tilted_gate
from aerobat.simulation import Flight, Outcome, fly
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, load_vehicle
from shared_plans import shared_plan

SPEED = 4.0  # [m/s]


@pytest.fixture(scope="module")
def quad() -> Vehicle:
    return load_vehicle("agile-quad")


@pytest.fixture(scope="module")
def cruise(quad: Vehicle) -> Flight:
    """2 s along x at constant speed, level."""
    straight = Trajectory(np.array([2.0]), np.array([[[0.0, 0, 1], [2 * SPEED, 0, 0]]]))
    return fly(straight, quad)


def moved(flight: Flight, offset: tuple[float, float, float], turn: tuple[float, float, float]) -> Flight:
    """The same flight with every state off by `offset` [m] and turned by `turn` [rad, body axes]."""
    s = flight.states
    q = so3.multiply(s.q_world_body, so3.exp(np.array(turn)))
    return replace(flight, series={**flight.series, "position": s.position + offset, "q_world_body": q})


def problem(*gates: Gate) -> Problem:
    return Problem("cruise", at_rest((0, 0, 1)), at_rest((8, 0, 1)), gates=gates)


def passage(flight: Flight, gate: Gate, vehicle: Vehicle | None = None) -> Passage:
    (passed,) = score(flight, problem(gate), vehicle).passages
    return passed


def test_errors_are_the_distances_and_angles_by_which_a_flight_is_off(cruise: Flight) -> None:
    result = score(moved(cruise, (0.03, 0.0, 0.04), (0.0, 0.02, 0.0)), problem())
    assert result.max_position_error_m == pytest.approx(0.05, abs=1e-4)
    assert result.rms_position_error_m == pytest.approx(0.05, abs=1e-4)
    assert result.max_attitude_error_deg == pytest.approx(np.rad2deg(0.02), abs=1e-3)
    assert result.rms_attitude_error_deg == pytest.approx(np.rad2deg(0.02), abs=1e-3)
    assert result.passages == ()
    assert result.saturated_fraction == 0.0


def test_the_gate_is_missed_by_the_distance_between_path_and_centre_wherever_samples_fall(
    cruise: Flight,
) -> None:
    for x in (3.0, 3.001, 3.0037):
        gate = tilted_gate(np.array([x, 0.0, 1.0]))
        passed = passage(moved(cruise, (0.0, -0.06, 0.08), (0.1, 0.0, 0.0)), gate)
        assert passed.miss == pytest.approx(0.1, abs=1e-4)
        assert passed.time == pytest.approx(x / SPEED, abs=1e-4)
        assert passed.speed == pytest.approx(SPEED, abs=1e-3)
        assert passed.attitude_error_deg == pytest.approx(np.rad2deg(0.1), abs=0.01)


def test_clearance_is_what_the_body_leaves_of_the_opening(cruise: Flight, quad: Vehicle) -> None:
    """Level flight: half the width less the farthest propeller tip from the centre."""
    reach, _, high = quad.bounding_ellipsoid.semi_axes
    tips = max(np.hypot(*r.position_body[:2]) + r.radius for r in quad.rotors)
    assert reach == pytest.approx(tips, rel=1e-3)
    gate = tilted_gate(np.array([4.0, 0.0, 1.0]), width=1.0, height=1.0)
    assert passage(cruise, gate, quad).clearance == pytest.approx(0.5 - reach, abs=1e-3)
    off = moved(cruise, (0.0, 0.1, 0.0), (0.0, 0.0, 0.0))
    assert passage(off, gate, quad).clearance == pytest.approx(0.4 - reach, abs=1e-3)
    low = tilted_gate(np.array([4.0, 0.0, 1.0]), width=5.0, height=0.4)
    assert passage(cruise, low, quad).clearance == pytest.approx(0.2 - high, abs=1e-3)
    on_edge = moved(cruise, (0.0, 0.0, 0.0), (np.pi / 2, 0.0, 0.0))
    assert passage(on_edge, low, quad).clearance == pytest.approx(0.2 - reach, abs=1e-3)


def test_a_vehicle_wider_than_the_opening_hits_the_frame(cruise: Flight, quad: Vehicle) -> None:
    gate = tilted_gate(np.array([4.0, 0.0, 1.0]), width=0.2, height=1.0)
    result = score(cruise, problem(gate), quad)
    assert result.passages[0].clearance < 0.0
    assert result.outcome is Outcome.HIT_FRAME
    assert result.sentence.startswith("hit the frame of the gate")


def test_a_flight_beside_the_opening_misses_the_gate(cruise: Flight, quad: Vehicle) -> None:
    gate = tilted_gate(np.array([4.0, 0.7, 1.0]), width=1.0, height=1.0)
    result = score(cruise, problem(gate), quad)
    assert result.outcome is Outcome.MISSED_GATE
    assert result.sentence.startswith("missed the gate, 0.70 m off")


def test_a_flight_that_diverges_says_when_and_why(quad: Vehicle) -> None:
    runaway = Trajectory(np.array([2.0]), np.array([[[0.0, 0, 1], [0, 0, 0], [200.0, 0, 0]]]))
    flight = fly(runaway, quad)
    result = score(flight, problem())
    assert result.outcome is flight.outcome is Outcome.DIVERGED
    assert result.sentence == flight.sentences[0]
    assert "diverged at" in result.sentence


def test_a_batch_is_scored_flight_by_flight(quad: Vehicle) -> None:
    straight = Trajectory(np.array([1.0]), np.array([[[0.0, 0, 1], [SPEED, 0, 0]]]))
    flights = fly(straight, [quad, quad])
    with pytest.raises(SpecError, match=r"flight\[k\]"):
        score(flights, problem())
    assert score(flights[1], problem()).max_position_error_m < 0.01


def test_every_gate_is_judged_and_the_first_thing_that_went_wrong_is_the_outcome(
    cruise: Flight, quad: Vehicle
) -> None:
    """Three gates, the first passed, the second missed, the third too narrow."""
    gates = (
        tilted_gate(np.array([2.0, 0.0, 1.0]), height=1.0, name="open"),
        tilted_gate(np.array([4.0, 0.7, 1.0]), height=1.0, name="aside"),
        tilted_gate(np.array([6.0, 0.0, 1.0]), width=0.2, height=1.0, name="narrow"),
    )
    result = score(cruise, problem(*gates), quad)
    assert [passed.gate for passed in result.passages] == ["open", "aside", "narrow"]
    assert [passed.inside for passed in result.passages] == [True, False, True]
    assert [passed.time for passed in result.passages] == pytest.approx([0.5, 1.0, 1.5], abs=1e-3)
    assert result.outcome is Outcome.MISSED_GATE
    assert result.sentence.startswith("missed gate 'aside', 0.70 m off its centre at 1.00 s")
    assert score(cruise, problem(gates[0], gates[2]), quad).outcome is Outcome.HIT_FRAME
    assert score(cruise, problem(gates[0]), quad).outcome is Outcome.THROUGH_GATES


def test_a_gate_that_a_flight_ends_before_was_not_reached(quad: Vehicle) -> None:
    runaway = Trajectory(np.array([2.0]), np.array([[[0.0, 0, 1], [0, 0, 0], [200.0, 0, 0]]]))
    flight = fly(runaway, quad)
    far = Problem("far", at_rest((0, 0, 1)), at_rest((800, 0, 1)), gates=(tilted_gate([700.0, 0.0, 1.0]),))
    result = score(flight, far, quad)
    assert np.isnan(result.passages[0].time)
    assert not result.passages[0].inside
    assert result.outcome is Outcome.DIVERGED


def test_a_flight_below_the_ground_has_hit_it(quad: Vehicle) -> None:
    dive = Trajectory(np.array([1.0]), np.array([[[0.0, 0, 1], [0, 0, -4]]]))
    flight = fly(dive, quad, environment=Environment(ground=0.0))
    result = score(flight, problem())
    assert result.outcome is Outcome.HIT_GROUND
    assert result.sentence == "hit the ground at 0.25 s"


def test_a_slow_vehicle_that_sinks_a_little_on_the_ground_has_landed_and_a_fast_one_has_hit_it(
    quad: Vehicle,
) -> None:
    air = Environment(ground=0.0)
    for speed, depth, hits in ((0.5, 0.05, False), (3.0, 0.05, True), (0.5, 0.15, True)):
        way = 1.0 + depth  # [m]
        descent = Trajectory(np.array([way / speed]), np.array([[[0.0, 0, 1], [0, 0, -way]]]))
        flight = fly(descent, quad, environment=air)
        found = score(flight, problem()).outcome
        swept = score_flights(descent, quad, problem=problem(), environment=air)[0].outcome
        assert [each is Outcome.HIT_GROUND for each in (found, swept)] == [hits, hits], (speed, depth)


def test_a_flight_through_its_gates_says_how_fast_and_how_far_off_at_the_worst(cruise: Flight) -> None:
    off = moved(cruise, (0.0, -0.03, 0.04), (0.0, 0.02, 0.0))
    near = tilted_gate(np.array([2.0, 0.0, 1.0]), name="near")
    aside = tilted_gate(np.array([4.0, 0.03, 1.0]), name="aside")
    path = ", 5.00 cm off its path at most"
    one = score(off, problem(near))
    assert one.sentence == f"through the gate at 4.0 m/s, 5.00 cm off its centre{path}"
    assert str(one) == f"{one.sentence}; attitude error 1.15° RMS, saturated 0.0 % of the time"
    both = score(off, problem(near, aside))
    assert both.sentence == f"through both gates, the worst at 4.0 m/s, 7.21 cm off its centre{path}"


def test_a_flight_that_went_wrong_says_by_how_much(cruise: Flight, quad: Vehicle) -> None:
    reach = quad.bounding_ellipsoid.semi_axes[1]
    narrow = score(cruise, problem(tilted_gate(np.array([4.0, 0.0, 1.0]), width=0.2, height=1.0)), quad)
    depth = f"{100 * (reach - 0.1):.1f} cm"
    assert narrow.sentence == f"hit the frame of the gate, {depth} into its left edge at 1.00 s"
    error = "position error 5.00 cm at most, attitude error 0.00° RMS, saturated 25.0 % of the time"
    clipped = np.zeros_like(cruise.series["saturated"])
    clipped[: len(clipped) // 4] = True
    off = moved(cruise, (0.0, -0.03, 0.04), (0.0, 0.0, 0.0))
    off = replace(off, series={**off.series, "saturated": clipped})
    beside = score(off, problem(tilted_gate(np.array([4.0, 3.97, 1.04]))))
    assert str(beside) == f"missed the gate, 4.00 m off its centre at 1.00 s; {error}"


def test_scores_of_many_flights_are_a_sequence_of_scores(quad: Vehicle) -> None:
    straight = Trajectory(np.array([0.2]), np.array([[[0.0, 0, 1], [SPEED / 5, 0, 0]]]))
    scores = score_flights(straight, [quad, quad], problem=problem())
    assert list(scores) == [scores[0], scores[1]] == [scores[-2], scores[-1]]
    for k in (2, -3):
        with pytest.raises(IndexError, match=f"there are 2 flights, no flight {k}"):
            scores[k]


def test_a_flight_is_not_judged_by_the_plan_of_another() -> None:
    flip, line = shared_plan("half-flip"), shared_plan("line")
    with pytest.raises(ab.SpecError, match="from the flight's set-points half of the time"):
        ab.score(ab.fly(flip), line)
