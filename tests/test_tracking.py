"""Plans that the rotors can fly are flown: tracking errors of every maneuver, and what they depend on."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.control import Controller
from aerobat.evaluation.score import score
from aerobat.planning import Miqp, Plan, plan
from aerobat.problem import Problem, load_problem
from aerobat.simulation import Flight, StateNoise, fly
from aerobat.vehicle import Vehicle, load_vehicle

MANEUVERS = ["flip-roll", "flip-roll-translation", "flip-pitch", "half-flip", "line"]


def planned(problem: Problem, vehicle: Vehicle, order: int = 4) -> Plan:
    return plan(problem, Miqp(order=order), vehicle)


@pytest.mark.parametrize("maneuver", MANEUVERS)
@pytest.mark.parametrize("order", [4, 5])
@pytest.mark.parametrize("name", ["agile-quad", "hexarotor"])
def test_rotor_feasible_plans_are_tracked_to_millimetres(name: str, order: int, maneuver: str) -> None:
    vehicle, problem = load_vehicle(name), load_problem(maneuver)
    assert all(r.lag == 0.02 for r in vehicle.rotors)
    result = score(fly(planned(problem, vehicle, order).trajectory, vehicle), problem, vehicle)
    assert result.max_position_error_m < 0.005
    assert result.rms_attitude_error_deg < 0.5
    if problem.gates:
        (passage,) = result.passages
        assert passage.miss < 0.005
        assert passage.attitude_error_deg < 1.0
        assert passage.clearance > 0.0


@pytest.mark.parametrize("maneuver", MANEUVERS)
def test_a_vehicle_with_drag_and_slow_motors_is_tracked_to_a_centimetre(maneuver: str) -> None:
    """The Crazyflie: 72 ms of lag, and at 5 m/s a seventh of its weight in drag."""
    vehicle, problem = load_vehicle("crazyflie"), load_problem(maneuver)
    assert vehicle.drag_body.all()
    result = score(fly(planned(problem, vehicle).trajectory, vehicle), problem, vehicle)
    assert result.max_position_error_m < 0.01
    assert result.rms_attitude_error_deg < 0.5


@pytest.mark.parametrize("maneuver", MANEUVERS)
def test_the_papers_plans_are_tracked_to_centimetres_at_a_thrust_to_weight_of_five(maneuver: str) -> None:
    vehicle, problem = load_vehicle("hexarotor"), load_problem(maneuver).as_in_paper()
    assert vehicle.thrust_to_weight == pytest.approx(5.0)
    trajectory = plan(problem, Miqp(order=3)).trajectory
    assert score(fly(trajectory, vehicle), problem).max_position_error_m < 0.025


@pytest.mark.parametrize("file", ["examples/fast-half-flip.toml", "examples/power-loop.toml"])
def test_the_examples_fly(file: str) -> None:
    vehicle, problem = load_vehicle("agile-quad"), load_problem(file)
    result = score(fly(planned(problem, vehicle).trajectory, vehicle), problem, vehicle)
    assert result.max_position_error_m < 0.01
    assert result.passages[0].clearance > 0.0


def test_the_half_flip_passes_a_gate_at_90_degrees_at_twice_the_speed_of_the_papers() -> None:
    vehicle, problem = load_vehicle("agile-quad"), load_problem("examples/fast-half-flip.toml")
    found = planned(problem, vehicle)
    assert found.certified
    result = score(fly(found.trajectory, vehicle), problem, vehicle)
    assert result.passages[0].speed > 16.0
    assert result.passages[0].attitude_error_deg < 1.0


@pytest.mark.parametrize("switch", ["moment_feedforward", "motor_lag_compensation"])
def test_each_feed_forward_pays_at_least_tenfold(switch: str) -> None:
    vehicle, problem = load_vehicle("agile-quad"), load_problem("flip-roll-translation")
    trajectory = planned(problem, vehicle).trajectory
    errors = [
        score(fly(trajectory, vehicle, controller=controller), problem).max_position_error_m
        for controller in (Controller(), Controller(**{switch: False}))
    ]
    assert errors[1] > 10 * errors[0]


def test_a_plan_flies_the_same_whichever_way_the_vehicle_heads() -> None:
    """At yaws of a quarter turn a quadrotor is the same vehicle; ±180° included."""
    vehicle, problem = load_vehicle("agile-quad"), load_problem("flip-roll")
    trajectory = planned(problem, vehicle).trajectory
    straight = fly(trajectory, vehicle)
    for heading in (np.pi, -np.pi, np.pi / 2):
        turned = fly(replace(trajectory, heading=heading), vehicle)
        np.testing.assert_allclose(turned.states.position, straight.states.position, atol=1e-6)


def test_dispersed_vehicles_stay_within_a_hand_of_the_path() -> None:
    """Mass 3 %, inertia 10 %, each rotor 3 %, lag 25 % (1σ): planned for one vehicle, flown by 40 others."""
    vehicle, problem = load_vehicle("agile-quad"), load_problem("flip-roll")
    rng = np.random.default_rng(7)
    others = [dispersed(vehicle, rng) for _ in range(40)]
    trajectory = planned(problem, vehicle).trajectory
    flights = fly(trajectory, others, nominal=vehicle)
    worst = [score(flights[k], problem).max_position_error_m for k in range(len(others))]
    assert np.median(worst) < 0.05
    assert np.quantile(worst, 0.95) < 0.12


def dispersed(vehicle: Vehicle, rng: np.random.Generator) -> Vehicle:
    rotors = tuple(
        replace(r, max_thrust=r.max_thrust * (1 + 0.03 * rng.normal()), lag=r.lag * (1 + 0.25 * rng.normal()))
        for r in vehicle.rotors
    )
    return replace(
        vehicle,
        mass=vehicle.mass * (1 + 0.03 * rng.normal()),
        inertia=vehicle.inertia * (1 + 0.10 * rng.normal()),
        rotors=rotors,
    )


def test_noise_is_drawn_from_the_seed_alone() -> None:
    vehicle, problem = load_vehicle("agile-quad"), load_problem("line")
    trajectory = planned(problem, vehicle).trajectory

    def flown(seed: int) -> Flight:
        return fly(trajectory, vehicle, noise=StateNoise.fused(), seed=seed)

    np.testing.assert_array_equal(flown(1).states.position, flown(1).states.position)
    assert np.abs(flown(1).states.position - flown(2).states.position).max() > 1e-5
    assert score(flown(1), problem).max_position_error_m < 0.03
