"""The simulated vehicle as an autopilot: what it obeys, and how it comes to a hover from anywhere."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.links.autopilot.vehicle import ATTITUDE_TIMEOUT, POINT_TIMEOUT, SimulatedVehicle
from aerobat.links.goals import AttitudeGoal, Mode, PositionGoal
from aerobat.links.routes import rest_to_rest
from aerobat.links.stream import SetpointStream
from aerobat.simulation.autopilot.braking import Braking
from suites import examples

ZERO = np.zeros(3)
SPEEDS = st.tuples(*[st.floats(-6.0, 6.0)] * 3)


def flying(height: float = 3.0) -> SimulatedVehicle:
    """A vehicle that hovers."""
    hovering = _hovering(height)
    loop = hovering._body._loop
    return copy.deepcopy(hovering, {id(loop): loop})


@cache
def _hovering(height: float) -> SimulatedVehicle:
    vehicle = SimulatedVehicle(ab.load_vehicle("agile-quad"), ab.Environment())
    assert vehicle.arm()
    assert vehicle.take_off(height)
    vehicle.advance(8.0)
    return vehicle


def on(vehicle: SimulatedVehicle, seconds: float) -> SimulatedVehicle:
    """The vehicle so much later."""
    vehicle.advance(vehicle.time + seconds)
    return vehicle


def speed(vehicle: SimulatedVehicle) -> float:
    return float(np.linalg.norm(vehicle.state.velocity))


def test_it_takes_off_goes_somewhere_and_lands() -> None:
    vehicle = flying(2.0)
    assert vehicle.mode is Mode.HOLD
    np.testing.assert_allclose(vehicle.state.position, [0.0, 0.0, 2.0], atol=0.01)
    assert vehicle.go_to(np.array([1.0, -2.0, 3.0]), yaw=1.0)
    on(vehicle, 8.0)
    np.testing.assert_allclose(vehicle.state.position, [1.0, -2.0, 3.0], atol=0.01)
    assert so3.axes(vehicle.state.q_world_body)[1, 0] == pytest.approx(np.sin(1.0), abs=0.01)
    assert vehicle.land()
    on(vehicle, 10.0)
    assert (vehicle.landed, vehicle.armed, vehicle.crashed) == (True, False, False)
    np.testing.assert_allclose(vehicle.state.position, [1.0, -2.0, 0.0], atol=0.02)
    assert vehicle.notices == []


def test_it_refuses_what_makes_no_sense() -> None:
    vehicle = SimulatedVehicle(ab.load_vehicle("agile-quad"), ab.Environment())
    assert not vehicle.take_off(2.0)  # disarmed
    assert not vehicle.go_to(np.ones(3))  # on the ground
    assert not vehicle.go_offboard()  # nothing was sent
    on(vehicle, 1.0)
    assert vehicle.state.position[2] == 0.0
    assert not flying().disarm()  # in the air
    assert not flying().take_off(2.0)


def test_a_client_that_streams_points_is_followed_and_missed_after_its_time() -> None:
    vehicle = flying()
    goal = PositionGoal(np.array([0.5, 0.5, 3.0]), ZERO, ZERO, 0.0)
    for _ in range(150):
        vehicle.follow_point(goal)
        assert vehicle.mode is Mode.OFFBOARD or vehicle.go_offboard()
        on(vehicle, 0.02)
    np.testing.assert_allclose(vehicle.state.position, goal.position, atol=0.05)
    on(vehicle, POINT_TIMEOUT - 0.1)
    assert vehicle.mode is Mode.OFFBOARD
    on(vehicle, 0.2)
    assert vehicle.mode is Mode.HOLD
    assert vehicle.notices[0].startswith("no set-points for 0.5")


def test_a_client_that_streams_attitudes_is_missed_sooner() -> None:
    vehicle = flying(5.0)
    hover = vehicle.vehicle.mass * vehicle.gravity
    for k in range(20):
        vehicle.follow_attitude(AttitudeGoal((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), hover), 0.01 * k)
        assert vehicle.go_offboard()
        on(vehicle, 0.01)
    on(vehicle, ATTITUDE_TIMEOUT - 0.02)
    assert vehicle.mode is Mode.OFFBOARD
    on(vehicle, 0.04)
    assert vehicle.mode is Mode.HOLD


def test_attitudes_are_followed_with_their_rates_whatever_is_lost_of_them() -> None:
    """A slow roll to and fro, of which every third goal is lost: turned as commanded, to 1.7°."""
    vehicle = flying(8.0)
    hover = vehicle.vehicle.mass * vehicle.gravity
    off = []
    for k in range(200):
        t = 0.005 * k
        angle, rate = 0.2 - 0.2 * np.cos(6.0 * t), 1.2 * np.sin(6.0 * t)
        if k % 3:
            q = tuple(so3.exp(np.array([angle, 0.0, 0.0])).tolist())
            vehicle.follow_attitude(AttitudeGoal(q, (rate, 0.0, 0.0), hover), t)
        assert vehicle.mode is Mode.OFFBOARD or not k or vehicle.go_offboard()
        on(vehicle, 0.005)
        after = 0.2 - 0.2 * np.cos(6.0 * (t + 0.005))
        off.append(abs(so3.log(vehicle.state.q_world_body)[0] - after))
    assert max(off) < np.deg2rad(1.7)


@examples(10)
@given(SPEEDS, st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_it_comes_to_a_hover_from_any_attitude_and_motion(velocity: tuple, q: tuple) -> None:
    vehicle = flying()
    place(vehicle, np.array([0.0, 0.0, 30.0]), np.array(velocity), so3.normalize(np.array(q)))
    vehicle.hold()
    on(vehicle, 5.0)
    assert speed(vehicle) < 0.05
    assert not vehicle.landed
    assert so3.thrust_axis(vehicle.state.q_world_body)[2] > 0.999


def test_a_fall_to_the_ground_is_told_and_ends_the_flight() -> None:
    vehicle = flying()
    place(vehicle, np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, -9.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    vehicle.hold()
    on(vehicle, 3.0)
    assert (vehicle.crashed, vehicle.landed, vehicle.armed) == (True, True, False)
    assert vehicle.notices[0].startswith("hit the ground at")
    assert not vehicle.arm()


def place(vehicle: SimulatedVehicle, position: Array, velocity: Array, q: Array) -> None:
    """Put a flying vehicle into a state."""
    live = vehicle._body
    observer, controller, motion = live._carry
    parts = (position, velocity, q, ZERO)
    body = type(motion.body)(*(tuple(np.array([x]) for x in part) for part in parts))
    live._carry = (observer, controller, motion._replace(body=body))


@given(SPEEDS, st.floats(1.0, 20.0))
def test_braking_ends_at_rest_within_its_bounds(velocity: tuple, height: float) -> None:
    start = np.array([1.0, 2.0, height])
    vehicle = ab.load_vehicle("agile-quad")
    path = Braking.of(start, np.array(velocity), vehicle, 9.81, 0.5).trajectory
    times = np.linspace(0.0, path.duration, 200)
    np.testing.assert_allclose(path.evaluate(0.0), start, atol=1e-9)
    np.testing.assert_allclose(path.evaluate(0.0, 1), velocity, atol=1e-9)
    np.testing.assert_allclose(path.evaluate(path.duration, 1), 0.0, atol=1e-9)
    assert path.evaluate(path.duration)[2] >= 0.5 - 1e-9
    if path.evaluate(path.duration)[2] > 0.5 + 1e-6:  # the floor asks nothing more
        assert np.linalg.norm(path.evaluate(times, 2), axis=-1).max() <= 0.8 * 2.3 * 9.81 + 1e-6


@given(SPEEDS)
def test_ways_between_hovers_keep_their_speed_and_acceleration(goal: tuple) -> None:
    path = rest_to_rest(ZERO, np.array(goal), 2.0, 3.0)
    assert path.peak(1).value <= 2.0 + 1e-6
    assert path.peak(2).value <= 3.0 + 1e-6
    np.testing.assert_allclose(path.evaluate(path.duration), goal, atol=1e-9)


def test_streamed_set_points_are_those_of_the_plan_between_rows_and_beyond_its_ends() -> None:
    plan = ab.plan("half-flip", vehicle="agile-quad")
    assert plan.vehicle is not None
    offset = np.array([1.0, 2.0, 3.0])
    stream = SetpointStream(plan.trajectory, plan.vehicle, plan.problem.environment, offset)
    times = np.append(np.random.default_rng(0).uniform(0.0, plan.duration, 50), plan.duration)
    asked = ab.reference(plan, times=np.sort(times)).setpoint
    for k, t in enumerate(np.sort(times)):
        point = stream.at(t)
        np.testing.assert_allclose(point.position, asked.flat.position[k] + offset, atol=1e-4)
        np.testing.assert_allclose(point.velocity, asked.flat.velocity[k], atol=1e-4)
        assert so3.angle_between(np.array(point.q_world_body), asked.q_world_body[k]) < 2e-4
    assert stream.at(-1.0) == stream.at(0.0)
    assert stream.at(plan.duration + 1.0) == stream.at(plan.duration)


def test_a_vehicle_that_cannot_hover_is_refused() -> None:
    heavy = replace(ab.load_vehicle("agile-quad"), mass=5.0)
    with pytest.raises(ab.SpecError, match="cannot lift"):
        SimulatedVehicle(heavy, ab.Environment())
