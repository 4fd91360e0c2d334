"""Rotor thrusts and the wrench they make: laws for 4, 6 or 8 rotors, however they are placed."""

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.states import Wrench
from aerobat.vehicle import (
    Rotor,
    Vehicle,
    allocate,
    collective_range,
    load_vehicle,
    mixer,
    rotor_thrusts,
    vehicle_names,
    wrench,
)

SAMPLES = 64  # demands per vehicle


def random_vehicle(rng: np.random.Generator, rotors: int) -> Vehicle:
    """An irregular vehicle: no two rotors alike, weight a tenth to two thirds of full thrust."""
    angles = 2 * np.pi * np.arange(rotors) / rotors + rng.uniform(-0.2, 0.2, rotors)
    reach, spins = rng.uniform(0.8, 1.2, rotors), np.resize([1, -1], rotors)
    most, least = rng.uniform(0.8, 1.2, rotors), rng.uniform(-0.05, 0.05, rotors)
    size, scale = 10 ** rng.uniform(-1.5, 0), 10 ** rng.uniform(-1, 1.5)
    made = [
        Rotor(
            position_body=size * reach[i] * np.array([np.cos(angles[i]), np.sin(angles[i]), rng.normal()]),
            spin=int(spins[i]),
            min_thrust=scale * least[i],
            max_thrust=scale * most[i],
            torque_coefficient=size * rng.uniform(0.1, 0.5),
            lag=0.02,
            radius=0.1,
        )
        for i in range(rotors)
    ]
    mass = rng.uniform(0.1, 0.67) * scale * most.sum() / 9.81
    try:
        return Vehicle("random", mass, np.eye(3), tuple(made))
    except SpecError:  # so irregular that it cannot hover
        assume(False)
        raise


@st.composite
def vehicles(draw: st.DrawFn) -> tuple[Vehicle, np.random.Generator]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    if draw(st.booleans()):
        return load_vehicle(draw(st.sampled_from(vehicle_names()))), rng
    return random_vehicle(rng, draw(st.sampled_from([4, 6, 8]))), rng


def thrusts_within_limits(vehicle: Vehicle, rng: np.random.Generator) -> np.ndarray:
    """Some of them on limits."""
    share = np.clip(rng.uniform(-0.2, 1.2, (SAMPLES, len(vehicle.rotors))), 0, 1)
    return vehicle.min_thrusts + share * (vehicle.max_thrusts - vehicle.min_thrusts)


def demands(vehicle: Vehicle, rng: np.random.Generator, strength: float = 3.0) -> Wrench:
    """Wrenches of which many are far out of reach."""
    wild = strength * rng.normal(size=(SAMPLES, len(vehicle.rotors))) * vehicle.max_thrusts
    return wrench(vehicle, wild)


def span(vehicle: Vehicle) -> float:
    return float((vehicle.max_thrusts - vehicle.min_thrusts).max())


def within(vehicle: Vehicle, thrusts: np.ndarray) -> np.ndarray:
    slack = 1e-9 * span(vehicle)
    return np.all(
        (thrusts >= vehicle.min_thrusts - slack) & (thrusts <= vehicle.max_thrusts + slack), axis=-1
    )


def without_yaw(load: Wrench) -> Wrench:
    return Wrench(load.thrust, load.moment_body * [1, 1, 0])


def level(load: Wrench) -> Wrench:
    return Wrench(load.thrust, 0 * load.moment_body)


def on_a_limit(vehicle: Vehicle, thrusts: np.ndarray) -> np.ndarray:
    gap = np.minimum(thrusts - vehicle.min_thrusts, vehicle.max_thrusts - thrusts)
    return gap.min(axis=-1) <= 1e-9 * span(vehicle)


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


@given(vehicles())
def test_a_wrench_whose_thrusts_fit_is_made_exactly(made: tuple) -> None:
    vehicle, rng = made
    demand = wrench(vehicle, thrusts_within_limits(vehicle, rng))
    exact = rotor_thrusts(vehicle, demand)
    fits = within(vehicle, exact)
    assert fits.all() or len(vehicle.rotors) > 4
    np.testing.assert_allclose(
        allocate(vehicle, demand)[fits], exact[fits], rtol=0, atol=2e-9 * span(vehicle)
    )


@given(vehicles(), st.floats(0.0, 1e6))
@example((load_vehicle("section-v"), np.random.default_rng(0)), 1e300)
def test_allocated_thrusts_are_always_within_limits(made: tuple, strength: float) -> None:
    vehicle, rng = made
    thrusts = allocate(vehicle, demands(vehicle, rng, strength))
    assert ((thrusts >= vehicle.min_thrusts) & (thrusts <= vehicle.max_thrusts)).all()


@given(vehicles())
def test_yaw_is_given_up_before_roll_and_pitch_and_no_further_than_needed(made: tuple) -> None:
    vehicle, rng = made
    tilted = without_yaw(wrench(vehicle, thrusts_within_limits(vehicle, rng)))
    yaw = 10 * rng.normal(size=SAMPLES) * vehicle.allocation[3].max() * span(vehicle)
    demand = Wrench(tilted.thrust, tilted.moment_body + yaw[:, None] * [0, 0, 1])
    thrusts = allocate(vehicle, demand)
    made_load, tolerance = wrench(vehicle, thrusts), 1e-9 * span(vehicle)

    low, high = collective_range(vehicle)
    holds = within(vehicle, rotor_thrusts(vehicle, tilted)) & (low <= demand.thrust) & (demand.thrust <= high)
    np.testing.assert_allclose(made_load.thrust[holds], demand.thrust[holds], rtol=0, atol=tolerance)
    np.testing.assert_allclose(
        made_load.moment_body[holds, :2], demand.moment_body[holds, :2], rtol=0, atol=tolerance
    )
    share = made_load.moment_body[holds, 2] / yaw[holds]
    assert ((share >= -1e-6) & (share <= 1 + 1e-6)).all()
    assert on_a_limit(vehicle, thrusts[holds])[share < 1 - 1e-6].all()


@given(vehicles())
def test_roll_and_pitch_shrink_together_about_the_collective(made: tuple) -> None:
    vehicle, rng = made
    low, high = collective_range(vehicle)
    demand = without_yaw(demands(vehicle, rng))
    demand = Wrench(rng.uniform(low, high, SAMPLES), demand.moment_body)
    thrusts = allocate(vehicle, demand)
    made_load = wrench(vehicle, thrusts)
    np.testing.assert_allclose(made_load.thrust, demand.thrust, rtol=0, atol=1e-9 * span(vehicle))

    wanted, got = demand.moment_body[:, :2], made_load.moment_body[:, :2]
    share = np.sum(wanted * got, axis=-1) / np.sum(wanted**2, axis=-1)
    assert ((share >= -1e-9) & (share <= 1 + 1e-9)).all()
    np.testing.assert_allclose(got, share[:, None] * wanted, rtol=0, atol=1e-8 * span(vehicle))
    assert on_a_limit(vehicle, thrusts)[share < 1 - 1e-6].all()


@given(vehicles())
def test_a_collective_out_of_reach_is_brought_to_the_nearest_that_can_be_held(made: tuple) -> None:
    vehicle, _ = made
    low, high = collective_range(vehicle)
    demand = Wrench(np.array([low - 1.0, low, high, high + 1.0]), np.zeros((4, 3)))
    thrusts = allocate(vehicle, demand)
    assert on_a_limit(vehicle, thrusts).all()
    load = wrench(vehicle, thrusts)
    np.testing.assert_allclose(load.thrust, [low, low, high, high], rtol=0, atol=1e-9 * span(vehicle))
    np.testing.assert_allclose(load.moment_body, 0, rtol=0, atol=1e-9 * span(vehicle))
    assert low <= vehicle.mass * vehicle.gravity <= high


@given(vehicles())
def test_a_batch_is_allocated_as_its_members_are(made: tuple) -> None:
    vehicle, rng = made
    demand = demands(vehicle, rng)
    batch = allocate(vehicle, demand).reshape(SAMPLES // 4, 4, -1)
    grid = Wrench(demand.thrust.reshape(-1, 4), demand.moment_body.reshape(-1, 4, 3))
    np.testing.assert_allclose(allocate(vehicle, grid), batch, rtol=0, atol=1e-12 * span(vehicle))
    one = allocate(vehicle, Wrench(demand.thrust[0], demand.moment_body[0]))
    np.testing.assert_allclose(one, batch[0, 0], rtol=0, atol=1e-12 * span(vehicle))
    shared = allocate(vehicle, Wrench(demand.thrust[0], demand.moment_body))
    assert shared.shape == (SAMPLES, len(vehicle.rotors))


@pytest.mark.parametrize("name", vehicle_names())
def test_the_mixer_inverts_the_allocation(name: str) -> None:
    vehicle = load_vehicle(name)
    np.testing.assert_allclose(vehicle.allocation @ mixer(vehicle), np.eye(4), rtol=0, atol=1e-12)
