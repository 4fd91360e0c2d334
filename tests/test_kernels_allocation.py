"""Rotor thrusts within limits: what is made of a load, and what is given up of one that does not fit."""

import numpy as np
from aerobat.engines.packing import airframes, components, controller_models, joined
from aerobat.engines.trees import rows
from hypothesis import example, given
from hypothesis import strategies as st

from aerobat.control import Controller
from aerobat.engines.floats import FloatOps
from aerobat.engines.numpy import ArrayOps
from aerobat.kernels.allocation import demand, fits, nearest
from aerobat.kernels.motors import clamp
from aerobat.kernels.rigid_body import Wrench
from aerobat.states import Wrench
from aerobat.vehicle import Vehicle, collective_range, load_vehicle, rotor_thrusts, wrench
from random_vehicles import (
    SAMPLES,
    demands,
    on_a_limit,
    span,
    thrusts_within_limits,
    vehicles,
    within,
    without_yaw,
)


def allocate(vehicle: Vehicle, load: Wrench) -> np.ndarray:
    """Thrusts for a batch of loads (k,): exact where they fit, the kernel's `nearest` elsewhere."""
    count = len(load.thrust)
    airframe, mixer = airframes([vehicle] * count), controller_models(Controller(), [vehicle] * count).mixer
    asked = Load(load.thrust, components(load.moment_body))
    exact = demand(mixer, asked)
    limited, whole = nearest(ArrayOps, airframe.rotors, mixer, asked), fits(airframe.rotors, exact)
    chosen = tuple(np.where(whole, f, g) for f, g in zip(exact, limited, strict=True))
    return joined(clamp(ArrayOps, airframe.rotors, chosen))


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
def test_collective_thrust_is_lowered_for_roll_and_pitch_and_never_raised(made: tuple) -> None:
    vehicle, rng = made
    load = Wrench(rng.uniform(*collective_range(vehicle), SAMPLES), demands(vehicle, rng).moment_body)
    load = without_yaw(load)
    got, tolerance = wrench(vehicle, allocate(vehicle, load)), 1e-9 * span(vehicle)
    assert (got.thrust <= load.thrust + tolerance).all()
    whole = within(vehicle, rotor_thrusts(vehicle, load))
    np.testing.assert_allclose(got.thrust[whole], load.thrust[whole], rtol=0, atol=tolerance)


@given(vehicles())
def test_roll_and_pitch_shrink_together_and_no_further_than_needed(made: tuple) -> None:
    vehicle, rng = made
    load = Wrench(rng.uniform(*collective_range(vehicle), SAMPLES), demands(vehicle, rng).moment_body)
    load = without_yaw(load)
    thrusts = allocate(vehicle, load)
    wanted, got = load.moment_body[:, :2], wrench(vehicle, thrusts).moment_body[:, :2]
    share = np.sum(wanted * got, axis=-1) / np.sum(wanted**2, axis=-1)
    assert ((share >= -1e-9) & (share <= 1 + 1e-9)).all()
    np.testing.assert_allclose(got, share[:, None] * wanted, rtol=0, atol=1e-8 * span(vehicle))
    assert on_a_limit(vehicle, thrusts)[share < 1 - 1e-6].all()


@given(st.sampled_from([4, 6]), st.integers(0, 2**32 - 1))
def test_floats_allocate_as_arrays_do(rotors: int, seed: int) -> None:
    vehicle, rng = load_vehicle({4: "agile-quad", 6: "hexarotor"}[rotors]), np.random.default_rng(seed)
    load = demands(vehicle, rng)
    together = allocate(vehicle, load)
    airframe, mixer = airframes([vehicle]), controller_models(Controller(), [vehicle]).mixer
    one_airframe, one_mixer = next(rows((airframe.rotors, mixer), iter))
    for k in range(5):
        asked = next(rows(Load(load.thrust[k : k + 1], components(load.moment_body[k : k + 1])), iter))
        exact = demand(one_mixer, asked)
        alone = exact if fits(one_airframe, exact) else nearest(FloatOps, one_airframe, one_mixer, asked)
        np.testing.assert_allclose(alone, together[k], rtol=0, atol=1e-12 * span(vehicle))


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
