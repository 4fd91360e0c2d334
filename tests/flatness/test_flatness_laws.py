"""Laws of differential flatness: round trips through inverted flight, rates, frames and zero thrust."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from aerobat import so3
from aerobat.errors import SpecError
from aerobat.flatness import reference, reference_of
from aerobat.states import STANDARD_GRAVITY, FlatState
from aerobat.trajectory import Trajectory
from aerobat.trajectory.minimum_effort import minimum_effort
from aerobat.vehicle import load_vehicle, wrench
from suites import examples

seeds = st.integers(0, 2**32 - 1)
VEHICLE = load_vehicle("agile-quad")
GRAVITY = np.array([0.0, 0.0, STANDARD_GRAVITY])
UP = np.array([0.0, 0.0, 1.0])


def aerobatic(seed, segments=8, size=40.0):
    """A random tumbling trajectory of degree 5, its specific thrust a smooth random walk through knots."""
    rng = np.random.default_rng(seed)
    durations = rng.uniform(0.15, 0.4, segments)
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    walk = CubicSpline(knots, rng.normal(size=(segments + 1, 3)) * size - GRAVITY).antiderivative(2)
    powers = durations[:, None, None] ** np.arange(6)[:, None]
    return Trajectory(durations, walk.c[::-1].swapaxes(0, 1) * powers)


def flat_of(q, omega, alpha, n, dn, ddn):
    """The flat state of a body with the specific thrust n, and no spin about its thrust axis."""
    f, df, ddf = thrust_of(q, omega, alpha, n, dn, ddn)
    return FlatState(*np.random.default_rng(0).normal(size=(2, *f.shape)), f - GRAVITY, df, ddf)


def thrust_of(q, omega, alpha, n, dn, ddn):
    n, dn, ddn = (np.asarray(x)[..., None] for x in (n, dn, ddn))
    b3 = so3.rotate(q, UP)
    db3 = so3.rotate(q, np.cross(omega, UP))
    ddb3 = so3.rotate(q, np.cross(alpha, UP) + np.cross(omega, np.cross(omega, UP)))
    return n * b3, dn * b3 + n * db3, ddn * b3 + 2 * dn * db3 + n * ddb3


@pytest.mark.parametrize("tilt", [None, 0.0, np.pi, np.pi - 1e-4, np.pi - 1e-8, np.pi - 1e-12, np.pi / 2])
def test_states_come_back_from_their_flat_outputs_upside_down_too(tilt):
    rng = np.random.default_rng(1)
    for _ in range(25):
        axis = np.append(rng.normal(size=2), 0.0)
        angle = rng.uniform(0, np.pi) if tilt is None else tilt
        b3 = so3.rotate(so3.exp(axis / np.linalg.norm(axis) * angle), UP) if angle != np.pi else -UP
        yaw = rng.uniform(-3, 3)
        q = so3.multiply(so3.smallest_rotation(UP, b3), so3.about_axis(UP, yaw))
        omega, alpha = np.append(rng.normal(size=(2, 2)) * [[10], [100]], np.zeros((2, 1)), axis=1)
        n, dn, ddn = rng.uniform(1, 50), *rng.normal(size=2) * [100, 1000]
        flat = flat_of(*(np.asarray(x)[None] for x in (q, omega, alpha, n, dn, ddn)))
        found = reference_of([0.0], flat, VEHICLE, heading=yaw).setpoint
        back = so3.thrust_axis(found.q_world_body[0])
        np.testing.assert_allclose(back, so3.thrust_axis(q), atol=1e-9)
        # around ±1e-12 rad of inverted, rounding of the thrust itself leaves the smallest rotation open
        if angle <= np.pi - 1e-4 or angle == np.pi:
            assert so3.angle_between(found.q_world_body[0], q) < 1e-9
            np.testing.assert_allclose(found.omega_body[0], omega, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(found.omega_dot_body[0], alpha, rtol=1e-9, atol=1e-9)
        assert found.wrench.thrust[0] == pytest.approx(VEHICLE.mass * n, rel=1e-12)
        inertia = VEHICLE.inertia
        moment = inertia @ found.omega_dot_body[0] + np.cross(
            found.omega_body[0], inertia @ found.omega_body[0]
        )
        np.testing.assert_allclose(found.wrench.moment_body[0], moment, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_a_tumbling_body_is_recovered_along_its_path(seed):
    # body rates about x and y as sums of sines; an ODE solver gives the attitude, flatness must find it again
    rng = np.random.default_rng(seed)
    size, speed, phase = rng.normal(size=(3, 2)) * 8, rng.uniform(1, 6, (3, 2)), rng.uniform(0, 6, (3, 2))
    times = np.linspace(0.0, 2.0, 1001)

    def rates(t, derivative=0):
        angles = np.multiply.outer(t, speed) + phase + derivative * np.pi / 2
        plane = np.sum(size * speed**derivative * np.sin(angles), axis=-2)
        return np.concatenate([plane, np.zeros((*np.shape(t), 1))], axis=-1)

    def kinematics(t, q):
        return 0.5 * so3.multiply(q, np.append(0.0, rates(t)))

    start = so3.exp([0.3, -0.2, 0.0])
    q = solve_ivp(kinematics, (0, 2), start, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-13).y.T
    q = so3.normalize(q)
    assert so3.thrust_axis(q)[:, 2].min() < -0.7
    n, dn, ddn = 12 + 3 * np.sin(5 * times), 15 * np.cos(5 * times), -75 * np.sin(5 * times)
    flat = flat_of(q, rates(times), rates(times, 1), n, dn, ddn)
    found = reference_of(times, flat, VEHICLE).setpoint
    assert so3.angle_between(found.q_world_body, q).max() < 2e-9
    np.testing.assert_allclose(found.omega_body, rates(times), atol=1e-7)
    np.testing.assert_allclose(found.omega_dot_body, rates(times, 1), atol=1e-6)


@examples(15)
@given(seed=seeds, yaw=st.floats(-3.0, 3.0))
def test_body_rates_and_accelerations_are_those_of_the_attitude(seed, yaw):
    trajectory = replace(aerobatic(seed), heading=yaw)
    h = 1e-6
    inner = trajectory.knots[:-1, None] + trajectory.durations[:, None] * np.linspace(0.1, 0.9, 9)
    series = (inner.ravel()[:, None] + [-h, 0.0, h]).ravel()
    found = reference(trajectory, VEHICLE, times=series).setpoint
    q, omega, omega_dot = (
        x.reshape(-1, 3, x.shape[-1]) for x in (found.q_world_body, found.omega_body, found.omega_dot_body)
    )
    size = 1 + np.linalg.norm(omega[:, 1], axis=-1, keepdims=True)
    jerky = 1 + np.linalg.norm(omega_dot[:, 1], axis=-1, keepdims=True)
    turned = so3.box_minus(q[:, 2], q[:, 0]) / (2 * h)
    assert (np.abs(turned - omega[:, 1]) <= 1e-6 * size + 1e-5 * h * jerky).all()
    gained = (omega[:, 2] - omega[:, 0]) / (2 * h)
    assert (np.abs(gained - omega_dot[:, 1]) <= 1e-5 * (jerky + size**3)).all()
    assert np.abs(omega[..., 2]).max() == 0.0


@pytest.mark.parametrize("drag", [(0.0, 0.0, 0.0), (0.3, 0.3, 0.3), (0.3, 0.3, 0.05)])
def test_flying_the_moments_open_loop_follows_the_trajectory(drag):
    # the rigid body's equations, written out once more, driven by rotor thrusts alone
    rng = np.random.default_rng(7)
    sizes = np.array([2, 2, 6, 8, 8, 6, 4, 2, 1, 1])[:, None]
    trajectory = Trajectory([1.2], rng.normal(size=(1, 10, 3)) * sizes)
    times = np.linspace(0.0, 1.2, 4001)
    # three unlike moments of inertia about axes of their own: gyroscopic moments count
    own = so3.axes(so3.exp([0.3, -0.5, 0.4]))
    inertia = own @ np.diag(np.linalg.eigvalsh(VEHICLE.inertia) * [0.8, 1.3, 1.1]) @ own.T
    vehicle = replace(VEHICLE, drag_body=np.array(drag), inertia=(inertia + inertia.T) / 2)
    flown = reference(replace(trajectory, heading=0.4), vehicle, times=times)
    assert so3.thrust_axis(flown.setpoint.q_world_body)[:, 2].min() < 0.3
    thrusts = CubicSpline(times, flown.rotor_thrusts)
    inertia = vehicle.inertia

    def dynamics(t, x):
        q, omega = x[6:10], x[10:]
        acting = wrench(vehicle, thrusts(t))
        force = acting.thrust * UP - vehicle.drag_body * so3.unrotate(q, x[3:6])
        return np.concatenate(
            [
                x[3:6],
                so3.rotate(q, force) / vehicle.mass - GRAVITY,
                0.5 * so3.multiply(q, np.append(0.0, omega)),
                np.linalg.solve(inertia, acting.moment_body - np.cross(omega, inertia @ omega)),
            ]
        )

    setpoint, flat = flown.setpoint, flown.setpoint.flat
    begin = (flat.position, flat.velocity, setpoint.q_world_body, setpoint.omega_body)
    start = np.concatenate([series[0] for series in begin])
    end = solve_ivp(dynamics, (0, 1.2), start, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(end[:3], flat.position[-1], atol=1e-6)
    np.testing.assert_allclose(end[3:6], flat.velocity[-1], atol=1e-6)
    assert so3.angle_between(end[6:10], setpoint.q_world_body[-1]) < 1e-6
    np.testing.assert_allclose(end[10:], setpoint.omega_body[-1], atol=1e-5)


@examples(15)
@given(seed=seeds)
def test_attitude_does_not_depend_on_the_times_asked_for(seed):
    trajectory = aerobatic(seed)
    fine = reference(trajectory, VEHICLE, rate=500.0)
    for times in (fine.times[::7], fine.times[123:130], fine.times[-1:], np.repeat(fine.times[::50], 2)):
        asked = np.searchsorted(fine.times, times)
        found = reference(trajectory, VEHICLE, times=times)
        turned = so3.angle_between(found.setpoint.q_world_body, fine.setpoint.q_world_body[asked])
        assert turned.max() < 1e-9


@examples(15)
@given(seed=seeds, drag=st.sampled_from([0.0, 0.3]))
def test_nor_where_the_thrust_is_of_a_higher_degree_than_what_stands_for_it_between_times(seed, drag):
    """Degree 9, as of closed-form plans, whose segments turn by a lot."""
    rng = np.random.default_rng(seed)
    knots = np.full((5, 5, 3), np.nan)
    knots[:, 0] = rng.normal(size=(5, 3)) * 2.0
    knots[[0, -1], 1:] = 0.0
    trajectory = minimum_effort(knots, rng.uniform(0.6, 1.2, 4))
    vehicle = replace(VEHICLE, drag_body=np.full(3, drag))
    fine = reference(trajectory, vehicle, rate=1000.0)
    if fine.undetermined:
        return
    for times in (fine.times[-1:], fine.times[::400]):
        asked = np.searchsorted(fine.times, times)
        found = reference(trajectory, vehicle, times=times)
        turned = so3.angle_between(found.setpoint.q_world_body, fine.setpoint.q_world_body[asked])
        assert turned.max() < 1e-4


@examples(15)
@given(seed=seeds, heading=st.floats(-3.1, 3.1))
def test_a_turned_trajectory_is_flown_by_a_turned_vehicle_with_the_same_thrusts(seed, heading):
    trajectory = aerobatic(seed)
    turn = so3.about_axis(UP, heading)
    turned = Trajectory(trajectory.durations, so3.rotate(turn, trajectory.coefficients), heading)
    before = reference(trajectory, VEHICLE, rate=100.0)
    after = reference(turned, VEHICLE, rate=100.0)
    expected = so3.multiply(turn, before.setpoint.q_world_body)
    assert so3.angle_between(after.setpoint.q_world_body, expected).max() < 1e-8
    scale = np.abs(before.rotor_thrusts).max()
    np.testing.assert_allclose(after.rotor_thrusts, before.rotor_thrusts, atol=1e-7 * scale)


@pytest.mark.parametrize("direction", [0.0, np.pi / 2, 0.7, 4.0])
@pytest.mark.parametrize("rate", [7.0, 100.0])
def test_a_planar_flip_keeps_its_lateral_axis_and_turns_the_quaternion_once(direction, rate):
    # thrust of constant size turns once around in a vertical plane, in 1 s
    forward = np.array([np.cos(direction), np.sin(direction), 0.0])
    lateral = np.cross(UP, forward)
    times = np.append(np.arange(0.0, 1.0, 1 / rate), 1.0)
    angle, speed = 2 * np.pi * times[:, None], 2 * np.pi
    f, df = np.sin(angle) * forward + np.cos(angle) * UP, np.cos(angle) * forward - np.sin(angle) * UP
    zero = np.zeros_like(f)
    flat = FlatState(zero, zero, 20 * f - GRAVITY, 20 * speed * df, -20 * speed**2 * f)
    q = reference_of(times, flat, VEHICLE).setpoint.q_world_body
    np.testing.assert_allclose(so3.rotate(q, lateral), np.broadcast_to(lateral, f.shape), atol=1e-12)
    np.testing.assert_allclose(q[-1], [-1, 0, 0, 0], atol=1e-12)


@examples(15)
@given(seed=seeds)
def test_the_quaternion_never_changes_sign(seed):
    q = reference(aerobatic(seed), VEHICLE, rate=2000.0).setpoint.q_world_body
    assert (np.sum(q[1:] * q[:-1], axis=-1) > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(q, axis=-1), 1.0, atol=1e-12)


def test_hover_asks_each_rotor_for_its_share_of_the_weight():
    hover = reference(Trajectory([1.0], np.zeros((1, 1, 3)), 0.5), VEHICLE, rate=10.0)
    share = VEHICLE.mass * STANDARD_GRAVITY / len(VEHICLE.rotors)
    np.testing.assert_allclose(hover.rotor_thrusts.sum(axis=1), share * len(VEHICLE.rotors))
    np.testing.assert_allclose(hover.rotor_thrusts, share, rtol=0.2)
    np.testing.assert_allclose(hover.setpoint.q_world_body, [so3.about_axis(UP, 0.5)] * 11, atol=1e-15)


def test_what_is_handed_out_cannot_be_written():
    found = reference(aerobatic(0), VEHICLE, rate=10.0)
    for array in (found.times, found.rotor_thrusts, found.setpoint.q_world_body, found.setpoint.flat.jerk):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


@pytest.mark.parametrize(
    "asked",
    [
        {},
        {"times": [0.0], "rate": 10.0},
        {"times": []},
        {"times": [[0.0, 0.1]]},
        {"times": [0.1, 0.0]},
        {"times": [0.0, np.nan]},
        {"times": [0.0, 99.0]},
        {"rate": 0.0},
    ],
)
def test_wrong_questions_are_refused(asked):
    with pytest.raises(SpecError):
        reference(aerobatic(0), VEHICLE, **asked)


def test_a_series_of_unlike_lengths_is_refused():
    zero = np.zeros((3, 3))
    with pytest.raises(SpecError, match="jerk"):
        reference_of([0.0, 0.1, 0.2], FlatState(zero, zero, zero, zero[:2], zero), VEHICLE)


def test_more_than_one_series_at_a_time_is_refused():
    zero = np.zeros((2, 3, 3))
    with pytest.raises(SpecError, match="one series"):
        reference_of([0.0, 0.1, 0.2], FlatState(zero, zero, zero, zero, zero), VEHICLE)
