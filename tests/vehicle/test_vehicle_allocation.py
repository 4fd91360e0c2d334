"""Rotor thrusts and the wrench they make: laws for 4, 6 or 8 rotors, however they are placed."""

import numpy as np
import pytest
from hypothesis import given

from aerobat.vehicle import load_vehicle, mixer, rotor_thrusts, vehicle_names, wrench
from random_vehicles import SAMPLES, span, thrusts_within_limits, vehicles


@given(vehicles())
def test_the_wrench_is_the_sum_of_forces_and_torques_about_the_centre_of_mass(made: tuple) -> None:
    vehicle, rng = made
    thrusts = thrusts_within_limits(vehicle, rng)
    forces = thrusts[..., None] * [0.0, 0.0, 1.0]
    arms = np.array([rotor.position_body for rotor in vehicle.rotors])
    reaction = np.array([-rotor.spin * rotor.torque_coefficient for rotor in vehicle.rotors])
    moment = np.cross(arms, forces).sum(axis=-2)
    moment[..., 2] += thrusts @ reaction
    load = wrench(vehicle, thrusts)
    np.testing.assert_allclose(load.thrust, forces.sum(axis=(-2))[..., 2], rtol=1e-12)
    np.testing.assert_allclose(load.moment_body, moment, rtol=0, atol=1e-12 * span(vehicle))


def test_a_rotor_that_turns_counter_clockwise_drives_the_body_clockwise() -> None:
    vehicle = load_vehicle("agile-quad")
    spins = np.array([rotor.spin for rotor in vehicle.rotors])
    assert wrench(vehicle, np.where(spins > 0, 3.0, 2.0)).moment_body[2] == pytest.approx(-0.05 * 2.0)


def test_more_thrust_on_the_left_rolls_right_and_more_in_front_pitches_up() -> None:
    vehicle = load_vehicle("agile-quad")
    x, y, _ = np.array([rotor.position_body for rotor in vehicle.rotors]).T
    assert wrench(vehicle, np.where(y > 0, 3.0, 2.0)).moment_body[0] > 0
    assert wrench(vehicle, np.where(x > 0, 3.0, 2.0)).moment_body[1] < 0  # FLU: nose up turns about -y


@given(vehicles())
def test_least_norm_thrusts_make_the_wrench_and_no_others_are_smaller(made: tuple) -> None:
    vehicle, rng = made
    wild = rng.normal(size=(SAMPLES, len(vehicle.rotors))) * vehicle.max_thrusts
    thrusts = rotor_thrusts(vehicle, wrench(vehicle, wild))
    again = wrench(vehicle, thrusts)
    np.testing.assert_allclose(
        again.moment_body, wrench(vehicle, wild).moment_body, rtol=0, atol=1e-10 * span(vehicle)
    )
    np.testing.assert_allclose(again.thrust, wrench(vehicle, wild).thrust, rtol=0, atol=1e-10 * span(vehicle))
    assert (np.linalg.norm(thrusts, axis=-1) <= np.linalg.norm(wild, axis=-1) * (1 + 1e-9)).all()
    if len(vehicle.rotors) == 4:
        np.testing.assert_allclose(thrusts, wild, rtol=0, atol=1e-10 * span(vehicle))


@pytest.mark.parametrize("name", vehicle_names())
def test_the_mixer_inverts_the_allocation(name: str) -> None:
    vehicle = load_vehicle(name)
    np.testing.assert_allclose(vehicle.allocation @ mixer(vehicle), np.eye(4), rtol=0, atol=1e-12)
