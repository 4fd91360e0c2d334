"""Vehicles of any shape, wrenches that they can and cannot make: shared by the tests of allocation."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st

from aerobat.errors import SpecError
from aerobat.states import Wrench
from aerobat.vehicle import Rotor, Vehicle, load_vehicle, vehicle_names, wrench

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
