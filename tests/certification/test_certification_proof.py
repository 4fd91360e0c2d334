"""Laws of certificates: samples never refute them, margins are tight, and symmetries leave them alone."""

import json
from dataclasses import replace
from math import comb

import numpy as np
import pytest

from aerobat import so3
from aerobat.certification import Certificate, Envelope, Side, Verdict, certify
from aerobat.environment import Environment
from aerobat.errors import SpecError
from aerobat.flatness import reference
from aerobat.interchange import read_csv, write_csv
from aerobat.planning import BisectionSearch, Miqp, plan
from aerobat.problem import Limits, load_problem
from aerobat.reporting.plain_data import to_json
from aerobat.states import STANDARD_GRAVITY
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.vehicle import load_vehicle
from random_flights import Flight, certified_margin, moved, random_flight, sampled, with_lags

VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)
UP = np.array([0.0, 0.0, 1.0])
TIGHT = 1e-6  # of a rotor's range


def certificate_of(flight: Flight, envelope: Envelope | None = None) -> Certificate:
    return certify(flight.trajectory, flight.vehicle, flight.environment, envelope)


def reversed_in_time(trajectory: Trajectory) -> Trajectory:
    """The same path flown backwards: p(1 - s) on each segment, the last one first."""
    powers = range(trajectory.degree + 1)
    flip = np.array([[comb(j, k) * (-1.0) ** k for j in powers] for k in powers])
    return Trajectory(trajectory.durations[::-1], (flip @ trajectory.coefficients)[::-1])


def extremes_of(flight: Flight, times: np.ndarray) -> dict[tuple[str, Side], np.ndarray]:
    """Every quantity at some times, by flatness."""
    found = reference(flight.trajectory, flight.vehicle, times, environment=flight.environment)
    setpoint, most = found.setpoint, Side.MAX
    series = {
        ("speed", most): np.linalg.norm(setpoint.flat.velocity, axis=1),
        ("tilt", most): np.arccos(np.clip(so3.thrust_axis(setpoint.q_world_body)[:, 2], -1, 1)),
        ("body rate", most): np.linalg.norm(setpoint.omega_body, axis=1),
        ("moment", most): np.linalg.norm(setpoint.wrench.moment_body, axis=1),
    }
    for side in Side:
        series["collective thrust", side] = setpoint.wrench.thrust
        series |= {(f"thrust of rotor {i}", side): rotor for i, rotor in enumerate(found.rotor_thrusts.T)}
        series |= {(f"position {axis}", side): setpoint.flat.position[:, k] for k, axis in enumerate("xyz")}
        series |= {(f"jerk {axis}", side): setpoint.flat.jerk[:, k] for k, axis in enumerate("xyz")}
    return series


@pytest.mark.parametrize(
    "seeds", [range(2, 6), pytest.param([*range(2), *range(6, 30)], marks=pytest.mark.slow)]
)
def test_dense_sampling_never_refutes_a_certificate_nor_shows_that_a_refusal_was_needless(seeds):
    accepted = 0
    for seed in seeds:
        flight = random_flight(seed)
        certificate, found = certificate_of(flight), sampled(flight, 20_000)
        accepted += certificate.certified
        if certificate.certified:
            assert found.margin >= 0, seed
            assert found.determined, seed
        if found.margin >= 0.01 and found.determined:
            assert certificate.certified, (seed, certificate.why)
        assert certified_margin(flight, certificate) <= found.margin + 1e-5, seed
    assert 0.25 < accepted / len(seeds) < 0.75


@pytest.mark.parametrize("seed", range(8))
def test_each_extreme_is_taken_where_it_is_said_to_be_and_never_passed(seed):
    flight = random_flight(seed)
    far = Limits(lower=[-1e6] * 3, upper=[1e6] * 3, jerk=1e6)
    certificate = certificate_of(flight, Envelope(limits=far))
    samples = extremes_of(flight, np.linspace(0, flight.trajectory.duration, 20_001))
    named = {(finding.name, finding.side): finding for finding in certificate.findings}
    assert named.keys() == samples.keys()
    for key, finding in named.items():
        outwards = 1 if finding.side is Side.MAX else -1
        size = np.abs(samples[key]).max() + 1e-3
        assert (outwards * (finding.bound - samples[key]) >= -1e-9 * size).all(), key
        assert 0 <= outwards * (finding.bound - finding.value) <= 1e-4 * size, key
        # at a knot it may be the side before that reaches it
        around = np.clip(finding.time + np.array([-1e-8, 0.0, 1e-8]), 0, flight.trajectory.duration)
        before = np.linspace(0, around[0], 300)
        there = extremes_of(flight, np.concatenate([before, around]))[key][-3:]
        assert np.abs(there - finding.value).min() <= 1e-4 * size, key


@pytest.mark.parametrize("seed", range(8))
def test_neither_place_nor_heading_changes_the_margin(seed):
    flight = random_flight(seed)
    elsewhere = moved(flight, heading=2.1, shift=np.array([30.0, -20.0, 5.0]))
    before, after = certificate_of(flight), certificate_of(elsewhere)
    assert before.certified == after.certified
    assert certified_margin(elsewhere, after) == pytest.approx(certified_margin(flight, before), abs=TIGHT)


def drifting(trajectory: Trajectory, wind: np.ndarray) -> Trajectory:
    """The trajectory as the air sees it that moves with the wind: p(t) - w t."""
    coefficients = trajectory.coefficients.copy()
    coefficients[:, 0] -= trajectory.knots[:-1, None] * wind
    coefficients[:, 1] -= trajectory.durations[:, None] * wind
    return replace(trajectory, coefficients=coefficients)


@pytest.mark.parametrize("seed", range(12))
def test_flying_in_a_wind_is_flying_in_the_air_that_moves_with_it(seed):
    flight, wind = random_flight(seed), np.array([4.0, -7.0, 1.5])
    windy = replace(flight, environment=Environment(wind=wind))
    calm = Flight(flight.vehicle, drifting(flight.trajectory, wind))
    before, after = certificate_of(windy), certificate_of(calm)
    assert before.certified == after.certified
    assert certified_margin(calm, after) == pytest.approx(certified_margin(windy, before), abs=1e-9)
    for one, other in zip(before.findings, after.findings, strict=True):
        assert one.quantity == "speed" or one.value == pytest.approx(other.value, rel=1e-9, abs=1e-9)
    if flight.vehicle.drag_body.any():
        assert certificate_of(replace(flight, environment=Environment())).margin != before.margin


@pytest.mark.parametrize("seed", range(6))
def test_references_in_a_wind_are_those_in_the_air_that_moves_with_it(seed):
    flight, wind = random_flight(seed), np.array([4.0, -7.0, 1.5])
    windy = reference(flight.trajectory, flight.vehicle, rate=100.0, environment=Environment(wind=wind))
    calm = reference(drifting(flight.trajectory, wind), flight.vehicle, rate=100.0)
    assert so3.angle_between(windy.setpoint.q_world_body, calm.setpoint.q_world_body).max() < 1e-9
    scale = np.abs(calm.rotor_thrusts).max()
    np.testing.assert_allclose(windy.rotor_thrusts, calm.rotor_thrusts, atol=1e-9 * scale)


@pytest.mark.parametrize("gravity", [1.62, 3.71, 9.81])
def test_a_hover_in_any_gravity_has_its_weights_margin(gravity):
    hover = certify(Trajectory([1.0], np.zeros((1, 1, 3))), VEHICLE, Environment(gravity))
    assert hover.certified
    assert hover.margin == pytest.approx(VEHICLE.mass * gravity / 4, abs=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_without_drag_the_way_back_in_time_asks_the_same_of_the_rotors(seed):
    flight = random_flight(seed)
    calm = replace(flight.vehicle, drag_body=np.zeros(3))
    flight = Flight(calm, flight.trajectory)
    end = reference(flight.trajectory, flight.vehicle, rate=500.0).setpoint.q_world_body[-1]
    upright = so3.smallest_rotation(UP, so3.thrust_axis(end))
    heading = so3.log(so3.multiply(so3.conjugate(upright), end))[2]
    backwards = Flight(flight.vehicle, replace(reversed_in_time(flight.trajectory), heading=heading))
    before, after = certificate_of(flight), certificate_of(backwards)
    assert certified_margin(backwards, after) == pytest.approx(certified_margin(flight, before), abs=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flip-roll", "half-flip"])
def test_it_accepts_the_plan_read_back_from_csv(name, tmp_path):
    # a little within its limits, for rows are not at its knots
    made = plan(load_problem(name), Miqp(reserve=0.25), vehicle=VEHICLE).trajectory
    certificate = certify(made, VEHICLE)
    assert certificate.certified, certificate.why
    write_csv(made, tmp_path / "plan.csv")
    again = certify(read_csv(tmp_path / "plan.csv"), VEHICLE)
    assert again.certified, again.why
    assert again.margin == pytest.approx(certificate.margin, abs=0.1)


def test_a_plan_whose_jerk_jumps_is_refused_for_its_body_rates():
    made = plan(
        load_problem("flip-roll"), Miqp(order=3, search=BisectionSearch()), vehicle=VEHICLE
    ).trajectory
    certificate = certify(made, VEHICLE)
    assert not certificate.certified
    assert certificate.margin > 0
    assert certificate.why.startswith("body rate jumps by ")
    assert len(certificate.discontinuities) > 10


@pytest.mark.parametrize("heading", [0.0, 1.0])
def test_a_hover_has_exactly_its_margin(heading):
    hover = certify(Trajectory([1.0], np.zeros((1, 1, 3)), heading), VEHICLE)
    assert hover.certified
    assert hover.margin == pytest.approx(VEHICLE.mass * STANDARD_GRAVITY / 4, abs=1e-9)
    most = {finding.name: finding.bound for finding in hover.findings if finding.side is Side.MAX}
    assert most["speed"] == most["body rate"] == most["moment"] == 0.0
    assert most["tilt"] < 1e-6
    assert hover.why.startswith("certified: thrust of rotor ")


def test_inverted_flight_is_certified_where_it_holds():
    upside_down = Trajectory([1.0], [[[0, 0, 0], [0, 0, 0], [0, 0, -STANDARD_GRAVITY]]])
    certificate = certify(upside_down, VEHICLE)
    assert certificate.certified
    assert certificate.margin == pytest.approx(VEHICLE.mass * STANDARD_GRAVITY / 4, abs=1e-9)


@pytest.mark.parametrize(("first", "last"), [(-1.0, -1.0), (0.0, -1.0), (0.0, -2.0), (-0.5, -1.5)])
def test_vanishing_thrust_leaves_the_attitude_and_so_the_question_open(first, last):
    g = STANDARD_GRAVITY
    upwards = [0, 0, g * first / 2, g * (last - first) / 6]
    vertical = Trajectory([1.0], np.multiply.outer([upwards], UP))
    certificate, expected = certify(vertical, VEHICLE), reference(vertical, VEHICLE, rate=100.0).undetermined
    assert not certificate.certified
    assert certificate.why.startswith("cannot decide: thrust reaches zero at ")
    assert [(s.start, s.end) for s in certificate.undetermined] == [
        (pytest.approx(s.start, abs=1e-6), pytest.approx(s.end, abs=1e-6)) for s in expected
    ]
    assert all(f.verdict is not Verdict.HOLDS for f in certificate.findings if f.rotor is not None)


def test_a_violation_counts_even_where_thrust_vanishes_elsewhere():
    g = STANDARD_GRAVITY
    rising = Trajectory([1.0], [[[0, 0, 0], [0, 0, 0], [0, 0, -g / 2], [0, 0, 6 * g / 6]]])
    certificate = certify(rising, VEHICLE)
    assert certificate.undetermined
    assert certificate.worst.verdict is Verdict.VIOLATED
    assert certificate.worst.time == pytest.approx(1.0)
    assert certificate.why == str(certificate.worst)
    assert certificate.margin == pytest.approx(6.8792625 - VEHICLE.mass * 6 * g / 4, abs=1e-5)


@pytest.mark.parametrize(
    ("jump", "quantity"),
    [
        ([[0.1, 0, 0]], "position"),
        ([[0, 0, 0], [0, 0, 1.0]], "velocity"),
        ([[0, 0, 0], [0, 0, 0], [0.5, 0, 0]], "thrust direction"),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0.1, 0]], "body rate"),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0.5]], None),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0.1]], None),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0.01, 0, 0]], None),
    ],
)
def test_only_thrusts_size_and_moments_may_jump(jump, quantity):
    coefficients = np.zeros((2, 5, 3))
    coefficients[1, : len(jump)] = jump
    certificate = certify(Trajectory([1.0, 1.0], coefficients), VEHICLE)
    assert [d.quantity for d in certificate.discontinuities] == ([] if quantity is None else [quantity])
    assert certificate.certified == (quantity is None)
    assert all(d.time == 1.0 and str(d) == certificate.why for d in certificate.discontinuities)


def test_every_limit_holds_just_outside_what_is_reached_and_fails_just_inside():
    flight = next(f for f in map(random_flight, range(99)) if certificate_of(f).certified)
    names = {"speed": "speed", "tilt": "tilt", "body rate": "body_rate", "moment": "moment"}
    found = {f.quantity: f for f in certificate_of(flight).findings if f.quantity in names}
    for quantity, name in names.items():
        for factor, verdict in ((1.001, Verdict.HOLDS), (0.999, Verdict.VIOLATED)):
            limit = factor * found[quantity].value
            certificate = certificate_of(flight, Envelope(**{name: limit}))
            finding = next(f for f in certificate.findings if f.quantity == quantity)
            assert finding.verdict is verdict
            assert certificate.certified == (verdict is Verdict.HOLDS)
            assert finding.margin == pytest.approx(limit - found[quantity].value, abs=1e-5 * limit)
            assert certificate.certified or quantity in certificate.why


def test_a_certificate_is_plain_data():
    flight = random_flight(0)
    certificate = certificate_of(flight)
    record = json.loads(to_json(certificate))
    assert record["certified"] == certificate.certified
    assert record["margin_n"] == certificate.margin
    assert record["why"] == str(certificate)
    assert len(record["findings"]) == len(certificate.findings)


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_an_envelope_refuses_limits_that_are_not_positive(limit):
    with pytest.raises(SpecError, match=r"^Envelope\.body_rate must be positive, got"):
        Envelope(body_rate=limit)


@pytest.mark.parametrize("heading", [np.nan, np.inf, "north", [0.0, 1.0]])
def test_a_heading_that_is_no_number_is_refused(heading):
    with pytest.raises(SpecError, match="heading must be"):
        Trajectory([1.0], np.zeros((1, 1, 3)), heading)


@pytest.mark.parametrize(
    ("iteration", "thrust", "moment", "rate", "rotors"),
    [
        (1, (1.2, 100.2), 2705, 186, (-4509, 4509)),
        (6, (5.9, 35.3), 8.02, 7.9, (-11.7, 15.0)),
        (11, (8.5, 26.5), 1.68, 2.5, (-0.54, 6.66)),
        (12, (8.6, 25.8), 1.45, 2.2, (-0.14, 6.46)),
        (13, (8.6, 25.2), 1.26, 1.9, (0.18, 6.31)),
    ],
)
def test_the_example_of_section_v_has_the_published_extremes(iteration, thrust, moment, rate, rotors):
    given = np.zeros((3, 5, 3))
    given[1] = np.nan
    given[1, 0, 2], given[2, 0, 0] = -2.0, 6.0
    shift = 0.1 * (iteration - 1)
    certificate = certify(
        minimum_effort(given, [0.5 + shift, 1.5]), load_vehicle("section-v"), Environment(gravity=9.80665)
    )
    values = {(finding.name, finding.side): finding.value for finding in certificate.findings}
    found = [values["collective thrust", Side.MIN], values["collective thrust", Side.MAX]]
    found += [values["moment", Side.MAX], values["body rate", Side.MAX]]
    found += [min(values[f"thrust of rotor {i}", Side.MIN] for i in range(4))]
    found += [max(values[f"thrust of rotor {i}", Side.MAX] for i in range(4))]
    printed = np.array([*thrust, moment, rate, *rotors])
    half_digits = np.array([0.06, 0.06, 0.006, 0.06, 0.006, 0.006])
    assert (np.abs(found - printed) <= np.maximum(half_digits, 6e-3 * np.abs(printed))).all()
