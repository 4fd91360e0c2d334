"""Scores say what happened: built on flights whose errors are known."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat import so3
from aerobat.errors import SpecError
from aerobat.evaluation.score import gate_passage, score
from aerobat.problem import Problem, at_rest, tilted_gate
from aerobat.simulation import Flight, fly
from aerobat.states import BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, load_vehicle

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
    return replace(flight, states=BodyState(s.position + offset, s.velocity, q, s.omega_body))


def problem(gate) -> Problem:
    return Problem("cruise", at_rest((0, 0, 1)), at_rest((8, 0, 1)), gates=() if gate is None else (gate,))


def test_errors_are_the_distances_and_angles_by_which_a_flight_is_off(cruise: Flight) -> None:
    result = score(moved(cruise, (0.03, 0.0, 0.04), (0.0, 0.02, 0.0)), problem(None))
    assert result.max_position_error_m == pytest.approx(0.05, abs=1e-4)
    assert result.rms_position_error_m == pytest.approx(0.05, abs=1e-4)
    assert result.max_attitude_error_deg == pytest.approx(np.rad2deg(0.02), abs=1e-3)
    assert result.rms_attitude_error_deg == pytest.approx(np.rad2deg(0.02), abs=1e-3)
    assert result.gate_miss_m is None
    assert result.saturated_fraction == 0.0


def test_the_gate_is_missed_by_the_distance_between_path_and_centre_wherever_samples_fall(
    cruise: Flight,
) -> None:
    for x in (3.0, 3.001, 3.0037):
        gate = tilted_gate(np.array([x, 0.0, 1.0]))
        passage = gate_passage(moved(cruise, (0.0, -0.06, 0.08), (0.1, 0.0, 0.0)), gate)
        assert passage.miss == pytest.approx(0.1, abs=1e-4)
        assert passage.time == pytest.approx(x / SPEED, abs=1e-4)
        assert passage.speed == pytest.approx(SPEED, abs=1e-3)
        assert passage.attitude_error_deg == pytest.approx(np.rad2deg(0.1), abs=0.01)


def test_clearance_is_what_the_rotors_leave_of_the_opening(cruise: Flight, quad: Vehicle) -> None:
    """Level flight: half the width less the outermost hub and its propeller."""
    reach = max(abs(r.position_body[1]) + r.radius for r in quad.rotors)
    gate = tilted_gate(np.array([4.0, 0.0, 1.0]), width=1.0, height=1.0)
    assert gate_passage(cruise, gate, quad).clearance == pytest.approx(0.5 - reach, abs=1e-3)
    off = moved(cruise, (0.0, 0.1, 0.0), (0.0, 0.0, 0.0))
    assert gate_passage(off, gate, quad).clearance == pytest.approx(0.4 - reach, abs=1e-3)


def test_a_vehicle_wider_than_the_opening_hits_the_frame(cruise: Flight, quad: Vehicle) -> None:
    gate = tilted_gate(np.array([4.0, 0.0, 1.0]), width=0.2, height=1.0)
    result = score(cruise, problem(gate), quad)
    assert result.gate_clearance_m < 0.0
    assert "hit the gate's frame" in result.outcome


def test_a_flight_beside_the_opening_misses_the_gate(cruise: Flight, quad: Vehicle) -> None:
    gate = tilted_gate(np.array([4.0, 0.7, 1.0]), width=1.0, height=1.0)
    assert score(cruise, problem(gate), quad).outcome.startswith("missed the gate, 0.70 m off")


def test_a_flight_that_diverges_says_when_and_why(quad: Vehicle) -> None:
    runaway = Trajectory(np.array([2.0]), np.array([[[0.0, 0, 1], [0, 0, 0], [200.0, 0, 0]]]))
    flight = fly(runaway, quad)
    assert score(flight, problem(None)).outcome == flight.diverged
    assert "diverged at" in flight.diverged


def test_a_batch_is_scored_flight_by_flight(quad: Vehicle) -> None:
    straight = Trajectory(np.array([1.0]), np.array([[[0.0, 0, 1], [SPEED, 0, 0]]]))
    flights = fly(straight, [quad, quad])
    with pytest.raises(SpecError, match=r"flight\[k\]"):
        score(flights, problem(None))
    assert score(flights[1], problem(None)).max_position_error_m < 0.01
