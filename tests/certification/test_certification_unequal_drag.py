"""Drag that differs along body x and y: references and certificates are those of an ODE of the attitude."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.certification import Certificate, Envelope, Side, certify, unequal_drag
from aerobat.flatness import reference, reference_of
from aerobat.problem import Condition
from aerobat.trajectory import Trajectory
from aerobat.trajectory.polynomial import hermite
from exact_drag import Exact, exact
from random_flights import Flight, random_flight, with_lags
from suites import examples

QUAD = ab.load_vehicle("agile-quad")
UP = np.array([0.0, 0.0, 1.0])


def unequal_flight(seed: int, lags: bool = False) -> Flight:
    flight = random_flight(seed % 1000, lags)
    rng = np.random.default_rng(seed)
    drag = flight.vehicle.mass * rng.uniform(0.0, 0.5) * rng.uniform(0.8, 1.2, 3)
    return replace(flight, vehicle=replace(flight.vehicle, drag_body=drag))


def exactly(flight: Flight, count: int) -> Exact:
    start = reference(flight.trajectory, flight.vehicle, [0.0], environment=flight.environment)
    return exact(flight.trajectory, flight.vehicle, flight.environment, start.setpoint.q_world_body[0], count)


def outside(certificate: Certificate, sampled: Exact) -> dict[tuple[str, Side], float]:
    """By how much samples are outside what a certificate encloses, of the largest of their kind."""
    series = {
        "collective thrust": sampled.thrust,
        "tilt": np.arccos(np.clip(so3.thrust_axis(sampled.q)[:, 2], -1, 1)),
        "body rate": np.linalg.norm(sampled.omega, axis=1),
        "moment": np.linalg.norm(sampled.moment, axis=1),
    }
    for i in range(sampled.rotors.shape[1]):
        series |= {
            f"thrust of rotor {i}": sampled.rotors[:, i],
            f"command of rotor {i}": sampled.commands[:, i],
        }
    found = {}
    for finding in certificate.findings:
        if finding.name in series:
            outwards = 1 if finding.side is Side.MAX else -1
            values = series[finding.name]
            beyond = (outwards * (values - finding.bound)).max() / np.abs(values).max()
            found[finding.name, finding.side] = float(beyond)
    return found


@examples(12)
@given(seed=st.integers(0, 2**32 - 1))
def test_references_are_those_of_the_attitudes_ode(seed):
    flight = unequal_flight(seed)
    sampled = exactly(flight, 2000)
    assert sampled.lacking.max() < 1e-7
    inner = np.concatenate([np.flatnonzero(np.diff(sampled.times) > 0.0)[1:-1], []]).astype(int)
    times = sampled.times[inner]
    found = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment)
    off = so3.angle_between(found.setpoint.q_world_body, sampled.q[inner])
    assert off.max() < 1e-7
    thrusts = found.setpoint.wrench.thrust
    np.testing.assert_allclose(thrusts, sampled.thrust[inner], atol=1e-7 * np.abs(thrusts).max())


@examples(8)
@given(seed=st.integers(0, 2**32 - 1), lags=st.booleans())
def test_no_sample_of_the_attitudes_ode_is_outside_what_is_certified(seed, lags):
    flight = unequal_flight(seed, lags)
    certificate = certify(flight.trajectory, flight.vehicle, flight.environment)
    assume(not certificate.undetermined)
    found = outside(certificate, exactly(flight, 20_000))
    assert found
    # differences of samples are good to 1e-6
    assert all(beyond < 1e-5 for beyond in found.values()), found


def test_the_attitude_in_a_gate_is_that_of_the_vehicle_not_that_of_its_mean_drag():
    drag = QUAD.mass * np.array([0.3, 0.3, 0.2])
    plan = ab.plan(ab.load_problem("half-flip"), vehicle=replace(QUAD, drag_body=drag))
    vehicle = replace(QUAD, drag_body=QUAD.mass * np.array([0.6, 0.0, 0.2]))
    certificate = plan.for_vehicle(vehicle).certificate
    (passage,) = (finding for finding in certificate.findings if finding.quantity == "attitude")
    sampled = exactly(Flight(vehicle, plan.trajectory, plan.problem.environment), 2000)
    there = np.abs(sampled.times - passage.time).argmin()
    axis = so3.thrust_axis(sampled.q[there])
    assert passage.value == pytest.approx(np.arccos(axis @ plan.problem.gates[0].up), abs=0.02)
    assert np.rad2deg(passage.value) > 2.5  # of the mean drag it is 0.4°


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "drag"),
    [("half-flip", (0.6, 0.0, 0.2)), ("race-7", (0.05, 0.55, 0.2)), ("race-7", (0.3, 0.29, 0.2))],
)
def test_a_plan_of_unequal_drag_is_flown_as_certified(name, drag):
    vehicle = replace(QUAD, drag_body=QUAD.mass * np.array(drag))
    plan = ab.plan(ab.load_problem(name), vehicle=vehicle)
    flight = Flight(vehicle, plan.trajectory, plan.problem.environment)
    found = outside(plan.certificate, exactly(flight, 100_000))
    assert all(beyond < 1e-4 for beyond in found.values()), found
    assert plan.certificate.certified
    assert ab.score(ab.fly(plan), plan.problem, vehicle).outcome.is_success


def test_thrust_too_small_beside_the_difference_leaves_the_certificate_undecided():
    # thrust of 1 m/s² at 20 m/s, to which a difference of 0.2/s in drag adds 2 m/s²
    falling = Trajectory([1.0], [[[0.0, 0.0, 0.0], [20.0, 0.0, 0.0], [-2.0, 0.0, -4.4]]])
    vehicle = replace(QUAD, drag_body=QUAD.mass * np.array([0.2, 0.0, 0.0]))
    certificate = certify(falling, vehicle)
    assert not certificate.certified
    assert certificate.why == (
        "cannot decide: at 0.000 s thrust is too small beside what unequal drag along body x and y adds; "
        "keep more thrust there, or set drag_body[1] to drag_body[0]"
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_difference_that_is_next_to_nothing_changes_next_to_nothing(seed):
    flight = random_flight(seed, lags=True)
    drag = 0.3 * flight.vehicle.mass
    equal = replace(flight.vehicle, drag_body=[drag, drag, 0.5 * drag])
    other = replace(flight.vehicle, drag_body=[drag, (1 + 1e-9) * drag, 0.5 * drag])
    thrust = Envelope(conditions=(Condition("specific_thrust", UP + 0.5, lower=0.0),))
    one, another = (certify(flight.trajectory, v, flight.environment, thrust) for v in (equal, other))
    values = {(finding.name, finding.side): finding.value for finding in one.findings}
    assert len(values) == len(another.findings)
    for finding in another.findings:
        assert finding.value == pytest.approx(values[finding.name, finding.side], rel=1e-3, abs=1e-6)


def test_pieces_that_stay_rough_are_certified_with_the_errors_that_they_have(monkeypatch):
    for name in ("MAX_REMAINDER", "MAX_COMMAND_REMAINDER"):
        monkeypatch.setattr(unequal_drag, name, 1e-17)
    monkeypatch.setattr(unequal_drag, "HALVINGS", 1)
    flight = unequal_flight(0)
    certificate = certify(flight.trajectory, flight.vehicle, flight.environment)
    assert certificate.too_unequal is None
    assert max(outside(certificate, exactly(flight, 40)).values()) < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_a_series_of_states_has_the_references_of_its_path(seed):
    flight = unequal_flight(seed)
    times = np.linspace(0.0, 0.9 * flight.trajectory.durations[0], 200)
    path = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment).setpoint
    again = reference_of(
        3.0 + times, path.flat, flight.vehicle, flight.environment, flight.trajectory.heading
    ).setpoint
    assert so3.angle_between(path.q_world_body, again.q_world_body).max() < 1e-9
    np.testing.assert_allclose(path.omega_body, again.omega_body, atol=1e-8)


@pytest.mark.parametrize("drag", [(0.3, 0.3, 0.1), (0.4, 0.2, 0.1)])
def test_jerk_may_jump_along_the_vehicles_thrust_axis_and_no_other(drag):
    vehicle = with_lags(replace(QUAD, drag_body=QUAD.mass * np.array(drag)), 0.0)
    states = np.random.default_rng(1).normal(size=(3, 4, 3)) * np.array([1.0, 5.0, 4.0, 5.0])[:, None]

    def path(jump: np.ndarray) -> Trajectory:
        begin = states[:-1].copy()
        begin[1, 3] += jump
        return Trajectory([1.0, 1.0], hermite(begin, states[1:]))

    smooth = path(np.zeros(3))
    own = so3.thrust_axis(reference(smooth, vehicle, [1.0]).setpoint.q_world_body[0])
    drag_over_mass = 0.3 * smooth.evaluate(1.0, 1)
    mean = smooth.evaluate(1.0, 2) + 9.81 * UP + drag_over_mass
    along_own, along_mean = (
        certify(path(20.0 * axis / np.linalg.norm(axis)), vehicle).discontinuities for axis in (own, mean)
    )
    assert along_own == ()
    assert [jump.quantity for jump in along_mean] == ([] if drag[0] == drag[1] else ["body rate"])
