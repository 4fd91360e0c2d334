"""The autopilot's attitude law: errors of any size settle, alone and under a position loop."""

from __future__ import annotations

from dataclasses import replace
from math import exp

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from aerobat.arrays import Array
from aerobat.engines import choose
from aerobat.engines.engine import first_row
from aerobat.engines.pytree import from_components, tree_stack
from aerobat.simulation.autopilot.braking import point_reference
from aerobat.simulation.autopilot.loop import RATE, autopilot_inputs, autopilot_setup
from aerobat.simulation.bodies import bodies
from aerobat.simulation.loop import Signals
from aerobat.vehicle import Vehicle, vehicle_names

COPIES = 60
SETTLED = 0.02  # [rad] of tilt, [m/s] of speed


def tilts_and_speeds(
    fleet: list[Vehicle], q_world_body: Array, velocity: Array, seconds: float, by_attitude: bool
) -> tuple[Array, Array]:
    """Tilts [rad] and speeds [m/s] (copies, T) of vehicles that shall be level, or hover at the origin."""
    copies = len(fleet)
    zero = np.zeros((copies, 3))
    start = bodies(ab.BodyState(zero, velocity, q_world_body, zero))
    setups = [autopilot_setup(start, vehicle, ab.Environment()) for vehicle in fleet]
    own = tree_stack(
        [setup.parameters.own for setup in setups],
        lambda leaves: np.array([x[k] for k, x in enumerate(leaves)]),
    )
    parts = [replace(part, parameters=each) for part, each in zip(setups[0].parts, own, strict=True)]
    still = np.zeros((round(seconds * RATE), copies, 3))
    inputs = autopilot_inputs(point_reference(still, still, still, still, 0.0, 9.81), by_attitude)
    setup = replace(setups[0], parts=tuple(parts))
    loop = setup.compile_for(choose("auto", copies, len(still)), first_row(inputs), body_of)
    _, flown = loop.scan(loop.init(first_row(inputs)), inputs)
    up = so3.thrust_axis(from_components(flown.q_world_body))[..., 2]
    return np.arccos(np.clip(up, -1.0, 1.0)), np.linalg.norm(from_components(flown.velocity), axis=-1)


def body_of(signals: Signals) -> object:
    return signals.plant.body


def any_attitudes(rng: np.random.Generator, copies: int = COPIES) -> Array:
    return so3.normalize(rng.normal(size=(copies, 4)))


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n == "hexarotor" else n for n in vehicle_names()]
)
def test_every_vehicle_gets_level_from_any_attitude_and_to_a_hover_from_any_motion(name: str) -> None:
    rng = np.random.default_rng(3)
    fleet, q = [ab.load_vehicle(name)] * COPIES, any_attitudes(rng)
    tilts, _ = tilts_and_speeds(fleet, q, np.zeros((COPIES, 3)), 3.0, by_attitude=True)
    assert (tilts[:, -1] < SETTLED).all()
    assert (tilts.max(axis=1) < 1.02 * tilts[:, 0] + 0.05).all()  # it turns the short way, and stops in time
    tilts, speeds = tilts_and_speeds(fleet, q, rng.uniform(-4.0, 4.0, (COPIES, 3)), 7.0, by_attitude=False)
    assert (tilts[:, -1] < SETTLED).all()
    assert (speeds[:, -1] < SETTLED).all()


def drawn_vehicle(rng: np.random.Generator) -> Vehicle:
    """A quadrotor, its inertia up to thirty times an agile one's, that lags by up to 60 ms."""
    base = ab.load_vehicle("agile-quad")
    heavy = replace(base, inertia=base.inertia * exp(rng.uniform(-0.7, 3.4)))
    lag, drag = rng.uniform(0.0, 0.06), exp(rng.uniform(-0.7, 0.7))
    rotors = tuple(
        replace(rotor, lag=lag, torque_coefficient=drag * rotor.torque_coefficient) for rotor in heavy.rotors
    )
    return replace(heavy, rotors=rotors).with_thrust_to_weight(rng.uniform(1.8, 5.0))


@pytest.mark.parametrize(
    ("seed", "copies"), [(0, 12), *(pytest.param(k, COPIES, marks=pytest.mark.slow) for k in (1, 2, 3))]
)
def test_random_vehicles_settle_without_a_limit_cycle(seed: int, copies: int) -> None:
    rng = np.random.default_rng(seed)
    fleet, q = [drawn_vehicle(rng) for _ in range(copies)], any_attitudes(rng, copies)
    tilts, _ = tilts_and_speeds(fleet, q, np.zeros((copies, 3)), 8.0, by_attitude=True)
    assert (tilts[:, -1] < SETTLED).all()
    tilts, speeds = tilts_and_speeds(fleet, q, rng.uniform(-4.0, 4.0, (copies, 3)), 10.0, by_attitude=False)
    assert (tilts[:, -1] < SETTLED).all()
    assert (speeds[:, -1] < 5 * SETTLED).all()
