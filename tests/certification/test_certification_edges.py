"""What certificates say at the edges: limits met exactly, odd trajectories, and input that makes no sense."""

from dataclasses import replace
from itertools import pairwise
from math import comb

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.certification import Certificate, Envelope, Finding, Side, Verdict, certify
from aerobat.errors import SpecError
from aerobat.planning import plan
from aerobat.problem import Limits, load_problem
from aerobat.states import STANDARD_GRAVITY
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.vehicle import load_vehicle
from random_flights import certified_margin, irregular, random_flight, sampled, stretched, with_lags
from suites import examples

VEHICLE = with_lags(load_vehicle("agile-quad"), 0.0)
WEIGHT = VEHICLE.mass * STANDARD_GRAVITY
REST = [[0.0, 0.0, 0.0]] * 4


def finding_of(certificate: Certificate, quantity: str, side: Side = Side.MAX) -> Finding:
    return next(f for f in certificate.findings if (f.quantity, f.side) == (quantity, side))


def hop(size: float, seconds: float, away: float = 0.0) -> Trajectory:
    """From rest to rest along x, from the distance `away`; fastest, and its jerk least, in the middle."""
    ends = np.array([[[away, 0, 0], *REST[1:]], [[away + size, 0, 0], *REST[1:]]])
    return minimum_effort(ends, [seconds])


@examples(40)
@given(
    size=st.floats(0.01, 100),
    seconds=st.floats(0.5, 20),
    away=st.floats(-1000, 1000),
    derivative=st.integers(0, 5),
)
def test_a_limit_met_exactly_holds_and_one_a_millionth_tighter_does_not(size, seconds, away, derivative):
    trajectory = hop(size, seconds, away)
    least, most = (float(side[0]) for side in trajectory.component_range(derivative))
    name = ("position", "velocity", "acceleration", "jerk", "snap", "crackle")[derivative]
    for factor, verdict in ((0.0, Verdict.HOLDS), (1e-6, Verdict.VIOLATED)):
        tighter = factor * max(abs(least), abs(most))
        bound = max(-least, most) - tighter
        box = Limits(upper=[most - tighter, 1, 1]) if derivative == 0 else Limits(**{name: bound})
        side = Side.MAX if derivative == 0 or most >= -least else Side.MIN
        found = finding_of(certify(trajectory, VEHICLE, envelope=Envelope(limits=box)), f"{name} x", side)
        assert found.verdict is verdict
        assert found.margin == pytest.approx(-tighter, abs=2e-9 * max(abs(least), abs(most)))
        assert found.margin >= 0 or verdict is Verdict.VIOLATED


def test_a_floor_on_which_the_flight_starts_holds():
    upwards = Trajectory([2.0], hop(1.0, 2.0).coefficients[..., [1, 2, 0]])
    certificate = certify(upwards, VEHICLE, envelope=Envelope(limits=Limits(lower=[-1, -1, 0])))
    assert certificate.certified, certificate.why
    assert finding_of(certificate, "position z", Side.MIN).margin == 0.0


def test_a_ceiling_far_above_does_not_soften_the_floor():
    dipping = Trajectory([2.0], hop(-1e-4, 2.0).coefficients[..., [1, 2, 0]])
    box = Limits(lower=[-1, -1, 0], upper=[1, 1, 1e6])
    finding = finding_of(certify(dipping, VEHICLE, envelope=Envelope(limits=box)), "position z", Side.MIN)
    assert finding.verdict is Verdict.VIOLATED
    assert finding.margin == pytest.approx(-1e-4)


def test_rounding_on_an_axis_that_nothing_moves_along_is_no_violation():
    coefficients = hop(1.0, 2.0).coefficients.copy()
    coefficients[0, 5, 1], coefficients[0, 2, 2] = -1e-15, -1e-15
    box = Limits(lower=[0, 0, 0], upper=[9, 9, 9])
    certificate = certify(Trajectory([2.0], coefficients), VEHICLE, envelope=Envelope(limits=box))
    assert certificate.certified, certificate.why


@pytest.mark.parametrize("speed", [3.0, 0.1])
def test_a_speed_limit_met_exactly_holds(speed):
    level = Trajectory([1.0], [[[0, 0, 0], [0.6 * speed, 0.8 * speed, 0]]])
    assert certify(level, VEHICLE, envelope=Envelope(speed=speed)).certified
    certificate = certify(level, VEHICLE, envelope=Envelope(speed=speed * (1 - 1e-6)))
    assert certificate.why.startswith(f"speed rises to {speed:.4g} m/s at 0.000 s, ")
    assert certificate.why.endswith(" m/s above its limit")


def test_a_plan_that_runs_along_its_velocity_limit_is_certified():
    made = plan(load_problem("line"), vehicle=with_lags(load_vehicle("crazyflie"), 0.0))
    velocity = finding_of(made.certificate, "velocity x")
    assert velocity.value == pytest.approx(velocity.limit, rel=1e-3)
    assert made.certificate.certified, made.certificate.why


def test_a_rotor_nearer_to_its_limit_than_can_be_told_is_said_to_be():
    full = VEHICLE.rotors[0].max_thrust
    climb = Trajectory(
        [1.0], [[[0, 0, 0], [0, 0, 0], [0, 0, (4 * full / WEIGHT - 1) * STANDARD_GRAVITY / 2]]]
    )
    certificate = certify(climb, VEHICLE)
    why = f"thrust of rotor 0 rises to {full:.4g} N at 0.000 s, nearer to its limit than can be told"
    assert (certificate.certified, certificate.why) == (False, f"cannot decide: {why}")


@pytest.mark.parametrize("vehicle", ["agile-quad", "hexarotor", "crazyflie", "section-v"])
@pytest.mark.parametrize("place", [0.0, 1e5])
def test_a_hover_of_many_unequal_durations_is_certified(vehicle, place):
    hover = Trajectory([1e-3, 100.0, 1.0, 1e-2], np.full((4, 1, 3), place))
    certificate = certify(hover, load_vehicle(vehicle))
    assert certificate.certified, certificate.why


def test_wildly_unequal_durations_change_no_extreme():
    flight = random_flight(3)
    whole = certify(flight.trajectory, flight.vehicle, flight.environment)
    cuts = np.array([0.0, 1e-5, 0.3, 0.3 + 1e-4, 0.9, 1.0])
    parts = [cut_out(flight.trajectory, a, b) for a, b in pairwise(cuts)]
    durations = np.outer(flight.trajectory.durations, np.diff(cuts)).ravel()
    coefficients = np.stack(parts, axis=1).reshape(len(durations), -1, 3)
    pieces = Trajectory(durations, coefficients, flight.trajectory.heading)
    again = certify(pieces, flight.vehicle, flight.environment)
    assert again.certified == whole.certified
    assert certified_margin(flight, again) == pytest.approx(certified_margin(flight, whole), abs=1e-6)


def cut_out(trajectory: Trajectory, start: float, end: float) -> np.ndarray:
    """p(start + s (end - start)) on every segment, expanded about its start."""
    powers = range(trajectory.degree + 1)
    shift = np.array([[comb(j, k) * start ** max(j - k, 0) for j in powers] for k in powers])
    return ((end - start) ** np.arange(len(powers)))[:, None] * (shift @ trajectory.coefficients)


def test_free_fall_in_the_middle_leaves_the_question_open_and_names_the_time():
    # vertical: thrust falls to nothing at 1 s and comes back, never turning
    g = STANDARD_GRAVITY
    upwards = [0.0, 0.0, 0.0, -8 * g / 3, 16 * g / 12]  # its acceleration is g ((t - 1)² - 1)
    certificate = certify(Trajectory([2.0], np.multiply.outer([upwards], [0.0, 0.0, 1.0])), VEHICLE)
    assert certificate.why == "cannot decide: thrust reaches zero at 0.968 s, where no attitude is determined"
    (span,) = certificate.undetermined
    assert (span.start + span.end) / 2 == pytest.approx(1.0, abs=1e-6)
    assert not certificate.certified


@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_a_fall_from_start_to_end_leaves_the_question_open(lag):
    falling = np.zeros((2, 3, 3))
    falling[:, 2, 2] = -STANDARD_GRAVITY / 2
    falling[1, :2, 2] = -STANDARD_GRAVITY / 2, -STANDARD_GRAVITY
    certificate = certify(Trajectory([1.0, 1.0], falling), with_lags(VEHICLE, lag))
    assert certificate.why.startswith("cannot decide: thrust reaches zero")
    assert [(span.start, span.end) for span in certificate.undetermined] == [(0.0, 2.0)]
    assert certificate.discontinuities == ()


def test_thrust_just_above_nothing_is_decided():
    g = STANDARD_GRAVITY
    falling = Trajectory([1.0], [[[0, 0, 0], [0, 0, 0], [0, 0, -0.998 * g / 2]]])
    assert certify(falling, VEHICLE).certified
    assert certify(falling, VEHICLE).margin == pytest.approx(0.002 * WEIGHT / 4, abs=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_where_and_how_large_a_flight_is_changes_no_tolerance_for_jumps(scale):
    size = 1e-3 * scale
    for away in (0.0, 1000.0 * scale):
        flown = np.concatenate(
            [hop(scale, 3.0, away).coefficients, hop(scale, 3.0, away + scale).coefficients]
        )
        flown[1, 0, 1] += size
        slow = Trajectory([3.0 * max(scale, 1.0)] * 2, flown)
        (jump,) = certify(slow, VEHICLE).discontinuities
        assert (jump.quantity, jump.time) == ("position", slow.knots[1])
        assert jump.norm == pytest.approx(size, rel=1e-6)


def test_a_small_jump_of_the_body_rate_far_from_the_origin_is_found():
    flown = np.zeros((2, 10, 3))
    flown[:, 0, 2] = 1000.0
    flown[1, 3, 1] = 3e-5 / 6  # [m/s³] the jerk's jump over 3!
    (jump,) = certify(Trajectory([1.0, 1.0], flown), VEHICLE).discontinuities
    assert jump.quantity == "body rate"
    assert jump.norm == pytest.approx(3e-5 / STANDARD_GRAVITY, rel=1e-2)


def test_six_unlike_rotors_skew_inertia_and_drag_are_judged_as_sampling_judges_them():
    rng = np.random.default_rng(5)
    vehicle = next(v for v in (irregular(rng) for _ in range(99)) if len(v.rotors) == 6 and v.drag_body.any())
    assert np.abs(vehicle.inertia - np.diag(np.diag(vehicle.inertia))).max() > 0
    flight, verdicts = replace(random_flight(11), vehicle=vehicle), set()
    for factor in np.geomspace(0.2, 20.0, 6):
        at_pace = replace(flight, trajectory=stretched(flight.trajectory, factor))
        certificate = certify(at_pace.trajectory, vehicle, at_pace.environment)
        samples = sampled(at_pace, 5000)
        assert certificate.certified == (samples.margin >= 0 and samples.determined)
        verdicts.add(certificate.certified)
    assert verdicts == {False, True}


@pytest.mark.parametrize("name", ["speed", "tilt", "body_rate", "moment"])
@pytest.mark.parametrize("limit", [-np.inf, np.nan, "fast", None, [1.0, 2.0]])
def test_an_envelope_of_no_numbers_is_refused_by_name(name, limit):
    with pytest.raises(SpecError, match=rf"^Envelope\.{name} must be (a number|positive), got"):
        Envelope(**{name: limit})


@pytest.mark.parametrize(
    ("duration", "coefficient"), [(1e-100, 0.0), (1e-70, 0.0), (1e-12, 1.0), (1.0, 1e160), (1e-300, 1e300)]
)
def test_motion_beyond_all_reason_is_refused_in_a_sentence(duration, coefficient):
    with pytest.raises(SpecError, match=r"check (the unit of its durations|their units)"):
        certify(Trajectory([duration], np.full((1, 6, 3), coefficient)), VEHICLE)


@pytest.mark.parametrize(
    ("duration", "coefficient"), [(1.0, 1e20), (1e-3, 1.0), (1e-9, 1e-20), (1e6, 1.0), (1.0, 1e-300)]
)
def test_all_numbers_of_a_certificate_are_finite(duration, coefficient):
    certificate = certify(Trajectory([duration], np.full((1, 6, 3), coefficient)), VEHICLE)
    numbers = [(f.value, f.bound, f.time) for f in certificate.findings]
    assert np.isfinite(numbers).all()
    assert certificate.certified == (certificate.margin > 0)


@given(value=st.floats(-2.0, 2.0), off=st.floats(0.0, 2.0), limit=st.floats(-2.0, 2.0))
def test_a_finding_is_nearer_than_can_be_told_only_where_its_bound_is_beyond_the_limit(value, off, limit):
    """Undecided it may be elsewhere, too: where no attitude is determined."""
    bound = value + off
    said = str(Finding("collective thrust", "N", Side.MAX, value, bound, 1.0, limit, Verdict.UNDECIDED))
    assert ("nearer to its limit than can be told" in said) == (bound > limit)
    assert ("within its limit" in said) == (bound <= limit)


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [(233.71, "N", "234 N"), (99.64, "N", "99.6 N"), (12345.6, "N·m", "12346 N·m"), (3e7, "m", "3e+07 m"),
     (np.pi, "rad", "180°"), (5.84, "N", "5.8 N"), (0.0123, "N", "0.012 N")],
)  # fmt: skip
def test_a_value_is_told_in_two_digits_or_to_whole_units(value: float, unit: str, said: str) -> None:
    assert Finding("thrust", unit, Side.MAX, value, value, 0.0, None, Verdict.HOLDS).shown(value, 2) == said


def test_what_all_but_reaches_its_limit_is_named_beside_the_rotors():
    slow = ab.Problem(
        "slow", ab.at_rest((0, 0, 1.0)), ab.at_rest((4.0, 0, 1.0)), ab.Line(), limits=ab.Limits(velocity=1.0)
    )
    found, free = (
        ab.plan(problem, ab.Miqp(reserve=0.15), "agile-quad").certificate
        for problem in (slow, replace(slow, limits=ab.Limits()))
    )
    assert found.binding.name == "velocity x"
    assert found.worst.rotor is not None
    assert free.binding is None
