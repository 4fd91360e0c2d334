"""A body that turns about its thrust axis along the way: what that asks of it, and that it is flown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.so3 import UP
from shared_plans import shared_plan
from turning_paths import turning

VEHICLE = ab.load_vehicle("agile-quad")
DRAGS = [(0.0, 0.0, 0.0), (0.3, 0.3, 0.1), (0.1, 0.4, 0.2)]


@pytest.mark.parametrize("drag", DRAGS)
def test_rates_are_the_derivatives_of_the_attitude_and_of_each_other(drag: tuple[float, ...]) -> None:
    trajectory, vehicle = (
        turning(shared_plan("flip-roll").trajectory, 3.0),
        replace(VEHICLE, drag_body=np.array(drag)),
    )
    middle, step = np.linspace(0.01, trajectory.duration - 0.01, 200), 1e-5
    before, now, after = (
        ab.reference(trajectory, vehicle, middle + side).setpoint for side in (-step, 0.0, step)
    )
    turned = (after.q_world_body - before.q_world_body) / (2 * step)
    rate = 2 * so3.multiply(so3.conjugate(now.q_world_body), turned)[:, 1:]
    np.testing.assert_allclose(now.omega_body, rate, atol=1e-5)
    np.testing.assert_allclose(now.omega_body[:, 2], trajectory.yaw_rates(middle)[:, 1], atol=1e-12)
    slope = (after.omega_body - before.omega_body) / (2 * step)
    np.testing.assert_allclose(now.omega_dot_body, slope, atol=2e-3)


def test_a_yaw_that_stays_is_a_vehicle_that_is_turned_against_it() -> None:
    trajectory, angle = shared_plan("half-flip").trajectory, 0.7
    inertia = np.diag([0.004, 0.007, 0.009])
    vehicle = replace(VEHICLE, inertia=inertia)
    still = replace(trajectory, yaw=np.full((trajectory.segments, 1), angle))
    turn = so3.axes(so3.about_axis(UP, np.array(angle)))
    rotors = tuple(replace(rotor, position_body=turn @ rotor.position_body) for rotor in vehicle.rotors)
    turned = replace(vehicle, rotors=rotors, inertia=turn @ inertia @ turn.T)
    found, expected = (
        ab.reference(path, body, rate=100.0) for path, body in ((still, vehicle), (trajectory, turned))
    )
    np.testing.assert_allclose(found.rotor_thrusts, expected.rotor_thrusts, atol=1e-12)


def test_a_hover_that_turns_asks_yaw_torque_alone() -> None:
    hover = turning(ab.minimum_effort(np.zeros((2, 4, 3)), [1.5]), 2.0)
    found = ab.reference(hover, VEHICLE, rate=200.0)
    acceleration = hover.yaw_rates(found.times)[:, 2]
    spins = np.array([rotor.spin for rotor in VEHICLE.rotors])
    levers = np.array([rotor.torque_coefficient for rotor in VEHICLE.rotors])
    torque = VEHICLE.inertia[2, 2] * acceleration
    share = VEHICLE.mass * 9.81 / 4 - torque[:, None] * spins / (4 * levers)
    np.testing.assert_allclose(found.rotor_thrusts, share, atol=1e-9)
    np.testing.assert_allclose(
        found.setpoint.q_world_body, so3.about_axis(UP, hover.yaw_rates(found.times)[:, 0]), atol=1e-12
    )


@pytest.mark.parametrize("drag", DRAGS[::2])
def test_certificates_enclose_what_independent_samples_find(drag: tuple[float, ...]) -> None:
    vehicle = replace(VEHICLE, drag_body=np.array(drag))
    trajectory = turning(shared_plan("flip-roll").trajectory, -4.0)
    found = {(x.quantity, x.rotor, x.side): x for x in ab.certify(trajectory, vehicle).findings}
    sampled = ab.reference(trajectory, vehicle, np.linspace(0.0, trajectory.duration, 100_001))
    thrusts, step = sampled.rotor_thrusts, trajectory.duration / 100_000
    commands = thrusts[1:-1] + vehicle.lags * (thrusts[2:] - thrusts[:-2]) / (2 * step)
    moments = np.linalg.norm(sampled.setpoint.wrench.moment_body, axis=1)
    rates = np.linalg.norm(sampled.setpoint.omega_body, axis=1)
    for quantity, rotor, series, close in (
        *(("thrust", i, thrusts[:, i], 5e-3) for i in range(4)),
        *(("command", i, commands[:, i], 3e-2) for i in range(4)),
        ("moment", None, moments, 1e-5),
        ("body rate", None, rates, 1e-5),
    ):
        high = found[quantity, rotor, "max"]
        assert series.max() <= high.bound + 1e-4 * (quantity == "command")
        assert high.bound - series.max() < close
        if rotor is not None:
            low = found[quantity, rotor, "min"]
            assert low.bound - 1e-4 * (quantity == "command") <= series.min() < low.bound + close


@pytest.mark.parametrize(("powers", "name"), [((0.1,), "attitude"), ((0.0, 0.1), "body rate")])
def test_a_jump_of_the_yaw_or_of_its_rate_is_no_flight(powers: tuple[float, ...], name: str) -> None:
    path = shared_plan("half-flip").trajectory
    yaw = np.zeros((path.segments, len(powers)))
    yaw[-1] = powers
    assert ab.certify(replace(path, yaw=yaw), VEHICLE).discontinuities[0].quantity == name


@pytest.mark.parametrize("plant", [None, "mujoco"])
def test_a_plan_is_flown_with_its_yaw(plant: str | None) -> None:
    plan = shared_plan("half-flip")
    plan = replace(plan, trajectory=turning(plan.trajectory, 2.0))
    assert plan.certified
    flight = ab.fly(plan, plant=plant)
    asked = ab.reference(plan, times=flight.times).setpoint
    np.testing.assert_array_equal(flight.setpoint.q_world_body, asked.q_world_body)
    assert np.linalg.norm(flight.states.position - asked.flat.position, axis=1).max() < 1e-3
    assert np.rad2deg(so3.angle_between(flight.states.q_world_body, asked.q_world_body)).max() < 0.5


def test_files_keep_a_yaw(tmp_path: Path) -> None:
    plan = shared_plan("half-flip")
    plan = replace(plan, trajectory=turning(plan.trajectory, 2.0))
    plan.save(f"{tmp_path}/turning.plan")
    assert ab.load_plan(f"{tmp_path}/turning.plan").trajectory == plan.trajectory
    ab.save_trajectory(plan.trajectory, f"{tmp_path}/turning.npz")
    assert ab.load_trajectory(f"{tmp_path}/turning.npz") == plan.trajectory
