"""The certificate's rotor margin against dense sampling; samples can refute a trajectory but prove none.

Thrusts are compared where rotors do not lag; where they do, thrusts and commands.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from aerobat import so3
from aerobat.certification import certify
from aerobat.environment import Environment
from aerobat.flatness import reference_of
from aerobat.flatness.inverse_dynamics import specific_thrust
from aerobat.planning import RotorMargin
from aerobat.planning.rotor_margin import sampled_margin
from aerobat.states import STANDARD_GRAVITY, FlatState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle, mixer
from random_flights import Flight, commands, with_lags
from suites import examples

seeds = st.integers(0, 2**32 - 1)
LAGGING = load_vehicle("agile-quad")
QUAD = with_lags(LAGGING, 0.0)
HEXA = with_lags(load_vehicle("hexarotor"), 0.0)
DRAGGED = replace(QUAD, name="dragged", drag_body=np.array([0.3, 0.3, 0.1]))
UP = np.array([0.0, 0.0, 1.0])


def tumbling(seed, order=4, segments=10, dt=0.1):
    """Piecewise constant inputs whose acceleration walks at random, through inversion and low thrust."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(5.0, 30.0)
    times = np.arange(segments + 1) * dt
    walk = CubicSpline(times, rng.normal(size=(segments + 1, 3)) * size - 9.81 * UP)
    middle = times[:-1] + dt / 2
    initial = [np.zeros(3), np.zeros(3), *(walk(0.0, k) for k in range(order - 2))]
    inputs = walk(middle, order - 2) if order < 5 else walk(middle, 3)
    return Trajectory.from_inputs(np.array(initial), inputs, dt)


def rotor_margin(trajectory, vehicle):
    return RotorMargin.of(certify(trajectory, vehicle))


def densely(trajectory, vehicle, count):
    """Rotor thrusts at `count` times of every segment, both ends included, (segments, count, rotors)."""
    s = np.linspace(0.0, 1.0, count)
    flat = FlatState(*(trajectory.on_segments(s, k).reshape(-1, 3) for k in range(5)))
    times = trajectory.knots[:-1, None] + s * trajectory.durations[:, None]
    return reference_of(times.ravel(), flat, vehicle).rotor_thrusts.reshape(len(times), count, -1)


def largest(sampled):
    """The largest value of densely sampled curves, a parabola through three samples at each maximum."""
    left, at, right = sampled[:, :-2], sampled[:, 1:-1], sampled[:, 2:]
    bend = np.minimum(left - 2 * at + right, -1e-300)
    tops = np.where((at >= left) & (at >= right), at - (right - left) ** 2 / (8 * bend), at)
    return max(sampled.max(), tops.max())


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("order", [3, 4, 5])
@pytest.mark.parametrize("vehicle", [QUAD, HEXA, DRAGGED], ids=lambda vehicle: vehicle.name)
def test_margin_is_that_of_dense_sampling(seed, order, vehicle):
    trajectory = tumbling(seed, order)
    found = rotor_margin(trajectory, vehicle)
    thrusts = densely(trajectory, vehicle, 5000)
    scale = np.abs(thrusts).max()
    assert found.max_thrust == pytest.approx(largest(thrusts), abs=1e-6 * scale)
    assert found.min_thrust == pytest.approx(-largest(-thrusts), abs=1e-6 * scale)
    assert found.margin == min(found.low_margin, found.high_margin)
    assert found.low_margin == pytest.approx(found.min_thrust - vehicle.min_thrusts[0], abs=1e-6 * scale)
    assert found.high_margin == pytest.approx(vehicle.max_thrusts[0] - found.max_thrust, abs=1e-6 * scale)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
def test_margin_of_rotors_with_lag_is_that_of_their_thrusts_and_commands_together(seed):
    flight = Flight(LAGGING, tumbling(seed, order=5))
    given = commands(flight, np.linspace(0.0, flight.trajectory.duration, 20_000))
    thrusts = np.concatenate([given, densely(flight.trajectory, LAGGING, 2000).reshape(-1, 4)])
    found = rotor_margin(flight.trajectory, LAGGING)
    scale = np.abs(thrusts).max()  # commands jump at knots, and differences stop 0.06 % of a segment short
    assert found.max_thrust == pytest.approx(thrusts.max(), abs=5e-4 * scale)
    assert found.min_thrust == pytest.approx(thrusts.min(), abs=5e-4 * scale)
    assert found.margin < rotor_margin(flight.trajectory, QUAD).margin


@examples(25)
@given(seed=seeds, order=st.integers(3, 5))
def test_no_sample_goes_beyond_the_extremes(seed, order):
    trajectory = tumbling(seed, order, segments=5)
    certificate = certify(trajectory, QUAD)
    if certificate.undetermined:
        return
    found, thrusts = RotorMargin.of(certificate), densely(trajectory, QUAD, 1000)
    scale = np.abs(thrusts).max()
    assert thrusts.max() <= found.max_thrust + 1e-8 * scale
    assert thrusts.min() >= found.min_thrust - 1e-8 * scale


def test_a_long_segment_of_high_degree_is_searched_all_along():
    rng = np.random.default_rng(5)
    sizes = np.array([0, 0, 20, 60, 90, 90, 60, 40, 20, 10])[:, None]
    trajectory = Trajectory([3.0], rng.normal(size=(1, 10, 3)) * sizes)
    found, thrusts = rotor_margin(trajectory, QUAD), densely(trajectory, QUAD, 50_000)
    scale = np.abs(thrusts).max()
    assert found.max_thrust == pytest.approx(largest(thrusts), abs=1e-6 * scale)
    assert found.min_thrust == pytest.approx(-largest(-thrusts), abs=1e-6 * scale)


def test_the_extremes_are_taken_where_they_are_said_to_be():
    trajectory = tumbling(2, 5)
    found = rotor_margin(trajectory, QUAD)
    for thrust, time, rotor in (
        (found.min_thrust, found.min_time, found.min_rotor),
        (found.max_thrust, found.max_time, found.max_rotor),
    ):
        times = np.append(np.linspace(0.0, time, 4000)[:-1], time)
        there = reference_of(times, trajectory.flat(times), QUAD).rotor_thrusts[-1, rotor]
        assert there == pytest.approx(thrust, rel=1e-4)


@examples(25)
@given(seed=seeds)
def test_straight_up_and_down_the_rotors_share_the_acceleration(seed):
    # no rotation: thrust = m (a + g) shared by the mixer, its extremes those of a quintic's second derivative
    coefficients = np.zeros((1, 6, 3))
    coefficients[0, :, 2] = np.random.default_rng(seed).normal(size=6) * 0.1
    trajectory = Trajectory([1.0], coefficients)
    least, most = trajectory.specific_thrust_range(STANDARD_GRAVITY)
    if least.value < 1.0:
        return
    found = rotor_margin(trajectory, HEXA)
    shares = HEXA.mass * mixer(HEXA)[:, 0]
    assert found.min_thrust == pytest.approx(shares.min() * least.value, rel=1e-6)
    assert found.max_thrust == pytest.approx(shares.max() * most.value, rel=1e-6)


@pytest.mark.parametrize("vehicle", [QUAD, HEXA], ids=lambda vehicle: vehicle.name)
def test_hover_leaves_the_margin_of_its_weight(vehicle):
    found = rotor_margin(Trajectory([2.0], np.zeros((1, 5, 3)), heading=1.0), vehicle)
    shares = vehicle.mass * STANDARD_GRAVITY * mixer(vehicle)[:, 0]
    assert found.min_thrust == pytest.approx(shares.min())
    assert found.max_thrust == pytest.approx(shares.max())
    assert found.margin > 0.0


def test_the_margin_changes_sign_where_a_limit_meets_the_extreme():
    trajectory = tumbling(3)
    extremes = rotor_margin(trajectory, QUAD)

    def limited(low, high):
        rotors = tuple(
            replace(rotor, min_thrust=extremes.min_thrust + low, max_thrust=extremes.max_thrust + high)
            for rotor in QUAD.rotors
        )
        return rotor_margin(trajectory, replace(QUAD, rotors=rotors))

    assert limited(-1e-4, 1e-4).margin == pytest.approx(1e-4, rel=0.1)
    assert limited(1e-4, 1e-4).margin < 0.0
    assert limited(-1e-4, -1e-4).margin < 0.0
    assert "too little" in str(limited(1.0, 1.0))
    assert "too much" in str(limited(-1.0, -1.0))
    assert "within limits by 1.00 N" in str(limited(-1.0, 1.0))


def test_unequal_rotors_are_each_held_to_their_own_limits():
    trajectory = tumbling(3)
    thrusts = densely(trajectory, QUAD, 2000)
    weak = int(thrusts.max(axis=(0, 1)).argmin())
    rotors = [replace(rotor, max_thrust=1e3, min_thrust=-1e3) for rotor in QUAD.rotors]
    rotors[weak] = replace(rotors[weak], max_thrust=15.0, min_thrust=-15.0)
    found = rotor_margin(trajectory, replace(QUAD, rotors=tuple(rotors)))
    assert (found.max_rotor, found.min_rotor) == (weak, weak)
    assert found.max_thrust == pytest.approx(thrusts[..., weak].max(), rel=1e-3)
    assert found.high_margin == pytest.approx(15.0 - found.max_thrust)


@examples(15)
@given(seed=seeds, heading=st.floats(-3.1, 3.1))
def test_turning_trajectory_and_vehicle_together_changes_nothing(seed, heading):
    trajectory = tumbling(seed, segments=5)
    turned = Trajectory(
        trajectory.durations, so3.rotate(so3.about_axis(UP, heading), trajectory.coefficients)
    )
    before, after = rotor_margin(trajectory, QUAD), rotor_margin(replace(turned, heading=heading), QUAD)
    scale = max(abs(before.min_thrust), abs(before.max_thrust))
    assert after.min_thrust == pytest.approx(before.min_thrust, abs=1e-6 * scale)
    assert after.max_thrust == pytest.approx(before.max_thrust, abs=1e-6 * scale)


@examples(25)
@given(seed=seeds, order=st.integers(3, 5), vehicle=st.sampled_from([QUAD, LAGGING]))
def test_samples_never_refute_more_than_the_certificate_does(seed, order, vehicle):
    trajectory = tumbling(seed, order, segments=5)
    certificate, sampled = certify(trajectory, vehicle), sampled_margin(trajectory, vehicle, Environment())
    if certificate.undetermined:
        return
    proven = RotorMargin.of(certificate)
    scale = max(abs(proven.min_thrust), abs(proven.max_thrust))
    assert sampled.margin >= proven.margin - 1e-6 * scale


def test_samples_refute_what_is_far_beyond_the_limits_as_the_certificate_says_it():
    trajectory = tumbling(3)
    sampled, proven = sampled_margin(trajectory, QUAD, Environment()), rotor_margin(trajectory, QUAD)
    assert sampled.margin < 0.0
    assert sampled.margin == pytest.approx(proven.margin, rel=0.05)
    assert (sampled.min_rotor, sampled.max_rotor) == (proven.min_rotor, proven.max_rotor)


@pytest.mark.parametrize("vehicle", [QUAD, DRAGGED], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("across", [0.0, 1e-3])
def test_jerk_may_jump_along_the_thrust_axis_only(vehicle, across):
    """There it is a kink in the thrust's size; across, however little, body rates jump with it."""
    before = np.array([[0.0, 0.0, 0.0], [3.0, 1.0, 0.0], [4.0, -2.0, 1.0], [2.0, 0.0, -3.0], [0.0, 0.5, 1.0]])
    first = Trajectory([1.0], before[None])
    ends = [first.on_segments([1.0], k)[0, 0] for k in range(4)]
    thrust = specific_thrust(FlatState(*ends, snap=np.zeros(3)), vehicle, Environment())[0]
    axis = thrust / np.linalg.norm(thrust)
    after = [*ends[:3], ends[3] + 40.0 * axis + across * 40.0 * np.cross(axis, UP), np.zeros(3)]
    after = np.array(after) * (0.2 ** np.arange(5) / [1, 1, 2, 6, 24])[:, None]
    jumps = certify(Trajectory([1.0, 0.2], np.stack([before, after])), vehicle).discontinuities
    assert [jump.quantity for jump in jumps] == ([] if across == 0.0 else ["body rate"])
