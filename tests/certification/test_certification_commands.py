"""Rotors that lag behind their commands: a certificate bounds the commands, and says where there are none."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat.certification import Side, Verdict, certify
from aerobat.certification.certify import interpolated
from aerobat.certification.subdivision import subdivide
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.flatness import reference
from aerobat.planning import Miqp, plan
from aerobat.planning.rotor_margin import RotorMargin
from aerobat.problem import load_problem
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle
from random_flights import Flight, certified_margin, commands, random_flight, sampled, stretched, with_lags

VEHICLE = load_vehicle("agile-quad")
STENCIL = 1e-6  # of a command's size: what differences of samples are good for


@pytest.mark.parametrize("seeds", [range(6, 8), pytest.param(range(8, 26), marks=pytest.mark.slow)])
def test_dense_sampling_of_commands_never_refutes_a_certificate_nor_shows_a_refusal_needless(seeds):
    accepted = 0
    for seed in seeds:
        flight = random_flight(seed, lags=True)
        certificate = certify(flight.trajectory, flight.vehicle, flight.environment)
        found = sampled(flight, 10_000)
        accepted += certificate.certified
        if certificate.certified:
            assert found.margin >= -STENCIL, seed
            assert found.determined, seed
        if found.margin >= 0.01 and found.determined:
            assert certificate.certified, (seed, certificate.why)
        assert not certificate.discontinuities
        assert certified_margin(flight, certificate) <= found.margin + 3e-4, seed
    assert 0.25 < accepted / len(seeds) < 0.75


@pytest.mark.parametrize("seed", [2, *(pytest.param(k, marks=pytest.mark.slow) for k in (0, 1, 3, 4, 5))])
def test_commands_are_enclosed_tightly_and_taken_where_they_are_said_to_be(seed):
    flight = random_flight(seed, lags=True)
    certificate = certify(flight.trajectory, flight.vehicle, flight.environment)
    times = np.linspace(0, flight.trajectory.duration, 20_001)
    samples = commands(flight, times)
    findings = [f for f in certificate.findings if f.quantity == "command"]
    lagging = np.flatnonzero(flight.vehicle.lags)
    assert [f.name for f in findings[::2]] == [f"command of rotor {i}" for i in lagging]
    for finding in findings:
        own = samples[:, finding.rotor]
        outwards = 1 if finding.side is Side.MAX else -1
        size = np.ptp(own) + np.abs(own).max()
        assert (outwards * (finding.bound - own) >= -STENCIL * size).all()
        assert 0 <= outwards * (finding.bound - finding.value) <= 1e-4 * size
        near = np.clip(finding.time + np.array([-1e-8, 0, 1e-8]), 0, times[-1])
        before = np.linspace(0, near[0], 300)  # which help to carry the attitude there
        around = commands(flight, np.concatenate([before, near]))[-3:, finding.rotor]
        assert np.abs(around - finding.value).min() <= 1e-3 * size


@pytest.mark.parametrize("seed", range(6))
def test_series_of_commands_are_as_near_to_those_of_a_far_higher_degree_as_they_say(seed):
    flight = random_flight(seed, lags=True)
    count = len(flight.vehicle.rotors)
    coarse, truth = (
        ThrustCurve.of(flight.trajectory, flight.vehicle, flight.environment, degree) for degree in (14, 40)
    )
    pieces = subdivide(coarse)
    near, exact = (interpolated(curve, pieces) for curve in (coarse, truth))
    s = np.linspace(-1, 1, 41)
    values = [
        np.einsum(
            "tk,pkq->ptq", np.polynomial.chebyshev.chebvander(s, found.series.shape[1] - 1), found.series
        )
        for found in (near, exact)
    ]
    off = np.abs(values[0] - values[1]).max(axis=1)[:, -count:]
    assert (off <= (near.error + exact.error)[:, -count:]).all()


def test_the_longer_the_lag_the_less_margin_commands_have():
    flight = random_flight(3, lags=True)
    margins = []
    for lag in (0.0, 0.01, 0.03, 0.08):
        vehicle = with_lags(flight.vehicle, lag)
        margins.append(certify(flight.trajectory, vehicle, flight.environment).margin)
    assert (np.diff(margins) <= 1e-6).all()
    assert margins[-1] < margins[0] - 1e-3


def test_a_climb_whose_thrust_rises_too_fast_for_a_lagging_rotor_is_refused_for_its_command():
    # the thrust of each rotor rises evenly from hover to 95 % of what it has, its command by τ f' above it
    weight, most = VEHICLE.mass * 9.81, 4 * VEHICLE.rotors[0].max_thrust
    seconds, lag = 0.2, 0.05
    jerk = (0.95 * most - weight) / VEHICLE.mass / seconds
    climb = Trajectory([seconds], [[[0, 0, 0]] * 3 + [[0, 0, jerk * seconds**3 / 6]]])
    slow = with_lags(VEHICLE, lag)
    assert certify(climb, with_lags(VEHICLE, 0.0)).certified
    certificate = certify(climb, slow)
    beyond = 0.95 * most / 4 + lag * jerk * VEHICLE.mass / 4 - most / 4
    assert certificate.margin == pytest.approx(-beyond, abs=1e-6)
    assert certificate.worst.quantity == "command"
    assert certificate.worst.time == pytest.approx(seconds)
    assert certificate.why.startswith("command of rotor ")
    assert RotorMargin.of(certificate).margin == pytest.approx(-beyond, abs=1e-6)
    thrusts = [f for f in certificate.findings if f.quantity == "thrust"]
    assert all(f.verdict is Verdict.HOLDS for f in thrusts)


@pytest.mark.parametrize("order", [4, 5])
def test_thrusts_that_jump_at_knots_are_refused_of_rotors_with_lag_alone(order):
    inputs = 500 * np.random.default_rng(2).normal(size=(6, 3))
    path = Trajectory.from_inputs(np.zeros((order, 3)), inputs, 0.15)
    assert not certify(path, with_lags(VEHICLE, 0.0)).discontinuities
    jumps = certify(path, VEHICLE).discontinuities
    if order == 5:
        assert not jumps
        return
    assert [jump.time for jump in jumps] == pytest.approx(path.knots[1:-1])
    for jump in jumps:
        times = np.append(np.linspace(0.0, jump.time - 1e-9, 300), jump.time + 1e-9)
        before, after = reference(path, VEHICLE, times).rotor_thrusts[-2:]
        assert jump.norm == pytest.approx(np.abs(after - before).max(), rel=1e-3)
        assert str(jump) == (
            f"rotor thrusts jump by up to {jump.norm:.2g} N at {jump.time:.3f} s, which rotors with lag "
            "cannot follow; plan with continuous snap (--order 5)"
        )


def test_only_rotors_with_lag_count_in_a_jump():
    coefficients = np.zeros((2, 5, 3))
    coefficients[1, 4, 0] = 0.5  # snap along x: a moment about y, of the front and the rear rotors
    path = Trajectory([1.0, 1.0], coefficients)
    plus = load_vehicle("section-v")  # its rotors 0 and 2 lie on the y axis
    assert certify(path, with_lags(plus, [0.02, 0.0, 0.02, 0.0])).discontinuities == ()
    (jump,) = certify(path, with_lags(plus, [0.0, 0.02, 0.0, 0.0])).discontinuities
    moment = plus.inertia[1, 1] * 0.5 * 24 / 9.81
    assert jump.norm == pytest.approx(moment / 0.3 / 2, rel=1e-6)


@pytest.mark.slow
def test_a_plan_of_order_five_is_judged_by_its_commands():
    problem = load_problem("half-flip")
    little = problem.maneuver.with_stage_thrust(problem.gates, 7.0)
    made = plan(replace(problem, maneuver=little), Miqp(order=5), VEHICLE).trajectory
    flight = Flight(VEHICLE, stretched(made, 1.05))
    certificate = certify(flight.trajectory, flight.vehicle)
    assert not certificate.discontinuities
    times = np.linspace(0, flight.trajectory.duration, 20_000)
    given = commands(flight, times)
    gaps = np.minimum(given - VEHICLE.min_thrusts, VEHICLE.max_thrusts - given)
    # at knots, where the commands have a kink, differences over a small step cut it off
    assert gaps.min() - 1e-3 < certificate.margin <= gaps.min()


@pytest.mark.parametrize("factor", [0.999, 1.001])
def test_the_body_rate_of_the_vehicle_is_a_limit_always(factor):
    flight = random_flight(5)
    envelope = certify(flight.trajectory, flight.vehicle, flight.environment)
    reached = next(f for f in envelope.findings if f.quantity == "body rate")
    assert reached.limit is None
    limited = replace(flight.vehicle, max_body_rate=factor * reached.value)
    certificate = certify(flight.trajectory, limited, flight.environment)
    finding = next(f for f in certificate.findings if f.quantity == "body rate")
    assert finding.limit == limited.max_body_rate
    assert finding.verdict is (Verdict.HOLDS if factor > 1 else Verdict.VIOLATED)
