"""Conditions over continuous time: what fails between nodes is found, and what holds is proven."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerobat import so3
from aerobat.certification import Envelope, Finding, Side, Verdict, certify
from aerobat.environment import Environment
from aerobat.flatness import force_balance, reference
from aerobat.planning.evidence import Evidence
from aerobat.planning.task import Task
from aerobat.problem import Condition, load_problem
from aerobat.states import STANDARD_GRAVITY
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.vehicle import load_vehicle
from random_flights import random_flight, with_lags
from suites import examples

VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)
UP = np.array([0.0, 0.0, 1.0])
QUANTITIES = ("position", "velocity", "acceleration", "specific_thrust")
NEVER_UPSIDE_DOWN = Condition("specific_thrust", UP, lower=0.0)


def condition_findings(flight, *conditions: Condition) -> list[Finding]:
    certificate = certify(
        flight.trajectory, flight.vehicle, flight.environment, Envelope(conditions=conditions)
    )
    return [finding for finding in certificate.findings if " along (" in finding.quantity]


def sampled_values(flight, condition: Condition, count: int = 100_000) -> np.ndarray:
    """direction · quantity at equally spaced times, by the equations themselves."""
    times = np.linspace(0.0, flight.trajectory.duration, count)
    derivative = QUANTITIES.index(str(condition.quantity))
    along = flight.trajectory.evaluate(times, min(derivative, 2)) @ condition.direction
    if derivative < 3:
        return along
    drag = flight.vehicle.drag_body[:2].mean() / flight.vehicle.mass
    airspeed = flight.trajectory.evaluate(times, 1) - flight.environment.wind
    mean = flight.trajectory.evaluate(times, 2) + flight.environment.gravity * UP + drag * airspeed
    found = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment)
    axis = so3.thrust_axis(found.setpoint.q_world_body)
    return np.sum(mean * axis, axis=1) * (axis @ condition.direction)


@examples(30, few=4)
@given(seed=st.integers(0, 2**32 - 1), quantity=st.sampled_from(QUANTITIES), share=st.floats(-0.2, 1.2))
def test_of_100_000_samples_none_violates_a_condition_that_is_proven(seed, quantity, share):
    rng = np.random.default_rng(seed)
    flight = random_flight(seed % 1000)
    direction = rng.normal(size=3)
    values = sampled_values(flight, Condition(quantity, direction, lower=0.0))
    size = np.abs(values).max()
    bound = values.min() + share * np.ptp(values)
    upper, lower = Condition(quantity, direction, upper=bound), Condition(quantity, direction, lower=bound)
    above, below = condition_findings(flight, upper, lower)
    assert (above.side, below.side) == (Side.MAX, Side.MIN)
    assert above.value == pytest.approx(values.max(), abs=1e-5 * size)
    assert below.value == pytest.approx(values.min(), abs=1e-5 * size)
    assert above.bound >= values.max() - 1e-9 * size
    assert below.bound <= values.min() + 1e-9 * size
    for finding, beyond in ((above, values.max() - bound), (below, bound - values.min())):
        if finding.verdict is Verdict.HOLDS:
            assert beyond <= 1e-8 * size
        else:
            assert beyond >= -1e-5 * size


def test_a_path_that_is_upright_at_its_knots_and_upside_down_between_them_is_refused():
    # a_z + g is 5 m/s² at both ends, and −6 m/s² in the middle
    g = STANDARD_GRAVITY
    upwards = [0.0, 0.0, (5 - g) / 2, -44 / 6, 88 / 24]
    path = Trajectory([1.0], np.multiply.outer([upwards], UP))
    certificate = certify(path, VEHICLE, envelope=Envelope(conditions=(NEVER_UPSIDE_DOWN,)))
    finding = next(f for f in certificate.findings if f.quantity == "specific thrust along (0, 0, 1)")
    assert (finding.verdict, finding.unit, finding.side) == (Verdict.VIOLATED, "m/s²", Side.MIN)
    assert finding.value == pytest.approx(-6.0)
    assert finding.time == pytest.approx(0.5)
    assert not certificate.certified


def test_a_certificate_of_a_problem_holds_what_its_maneuver_asks_throughout():
    # from rest to rest sideways, upside down on the way
    states = np.zeros((2, 5, 3))
    states[1, 0, 1] = 40.0
    path = minimum_effort(states, [2.0])
    diving = Trajectory(path.durations, path.coefficients + 0.8 * path.coefficients[..., [0, 2, 1]])
    asked = Evidence(Task.of(load_problem("half-flip"), VEHICLE), diving).certificate
    names = [f.quantity for f in asked.findings if f.verdict is Verdict.VIOLATED]
    assert "specific thrust along (0, 0, 1)" in names
    line = Evidence(Task.of(load_problem("line"), VEHICLE), diving).certificate
    assert not any("specific thrust" in finding.quantity for finding in line.findings)


@pytest.mark.parametrize("place", [0.0, 1000.0])
@pytest.mark.parametrize("wind", [0.0, 7.0])
def test_a_condition_met_exactly_holds_and_one_beyond_it_does_not(place, wind):
    flight = random_flight(7)
    vehicle = replace(flight.vehicle, drag_body=flight.vehicle.drag_body[[0, 0, 2]])
    coefficients = flight.trajectory.coefficients.copy()
    coefficients[:, 0] += place
    path = Trajectory(flight.trajectory.durations, coefficients)
    environment = Environment(wind=[wind, 0.0, 0.0])
    balance = force_balance(environment, vehicle)
    for quantity in QUANTITIES:
        for direction in (UP, np.array([3.0, 0.0, -4.0])):
            free = Condition(quantity, direction, lower=-1e9)
            least = certify(path, vehicle, environment, Envelope(conditions=(free,))).findings[-1].value
            for beyond, verdict in ((0.0, Verdict.HOLDS), (1e-6 * abs(least), Verdict.VIOLATED)):
                exact = Condition(quantity, direction, lower=least + beyond)
                assert exact.bound(balance).lower == least + beyond
                found = certify(path, vehicle, environment, Envelope(conditions=(exact,)))
                assert found.findings[-1].verdict is verdict, (quantity, found.findings[-1])


def test_thrust_that_just_vanishes_along_a_direction_is_not_negative():
    # falling freely along z from t = 1 on, for an instant: f_z = g (t − 1)², met exactly
    g = STANDARD_GRAVITY
    coefficients = np.multiply.outer([[0.0, 0.0, 0.0, -8 * g / 3, 16 * g / 12]], UP)
    coefficients[0, 2, 0] = 9.0
    path = Trajectory([2.0], coefficients)
    certificate = certify(path, VEHICLE, envelope=Envelope(conditions=(NEVER_UPSIDE_DOWN,)))
    assert certificate.findings[-1].verdict is Verdict.HOLDS
