"""Rotor thrusts within limits: what is made of a load, and what is given up of one that does not fit."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from aerobat.control import Controller
from aerobat.control.parameters import controller_parameters
from aerobat.engines.floats import ArrayOps, FloatOps
from aerobat.engines.pytree import components, from_components, tree_map
from aerobat.environment import Environment
from aerobat.kernels import rigid_body
from aerobat.kernels.allocation import Mixer, desaturate, mix, within_limits
from aerobat.kernels.motors import Rotors, clamp
from aerobat.states import Wrench
from aerobat.vehicle import Rotor, Vehicle, load_vehicle, mixer, rotor_thrusts, vehicle_names, wrench
from aerobat.vehicle.fleet import Fleet
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
from suites import examples


def collective_range(vehicle: Vehicle) -> tuple[float, float]:
    low, high = Fleet.of([vehicle]).collective_range[0].tolist()
    return low, high


def parameters(vehicle: Vehicle, count: int) -> tuple[Rotors, Mixer]:
    """Rotors and mixer of so many of a vehicle."""
    model = controller_parameters(Controller(), Fleet.of([vehicle] * count), Environment())
    return model.airframe.rotors, model.mixer


def allocate(vehicle: Vehicle, load: Wrench) -> np.ndarray:
    """Thrusts for a batch of loads (k,): exact where they fit, the kernel's `desaturate` elsewhere."""
    rotors, mixer = parameters(vehicle, len(load.thrust))
    desired = rigid_body.RotorWrench(load.thrust, components(load.moment_body))
    exact = mix(mixer, desired)
    limited, feasible = desaturate(ArrayOps, rotors, mixer, desired), within_limits(rotors, exact)
    chosen = tuple(np.where(feasible, f, g) for f, g in zip(exact, limited, strict=True))
    return from_components(clamp(ArrayOps, rotors, chosen))


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


@examples(20)
@given(st.sampled_from(vehicle_names()), st.integers(0, 2**32 - 1))
def test_collective_thrust_is_lowered_as_far_as_roll_and_pitch_need_and_no_further(
    name: str, seed: int
) -> None:
    """Of rotors alike, where they fit about some lower thrust they are made whole, about the highest."""
    vehicle, rng = load_vehicle(name), np.random.default_rng(seed)
    low, high = collective_range(vehicle)
    tilted = without_yaw(wrench(vehicle, thrusts_within_limits(vehicle, rng)))
    demand = Wrench(np.maximum(tilted.thrust, rng.uniform(low, high, SAMPLES)), tilted.moment_body)
    lower = low + (np.minimum(demand.thrust, high) - low) * np.linspace(0.0, 1.0, 200)[:, None]
    moment = np.broadcast_to(tilted.moment_body, (200, SAMPLES, 3))
    fits = within(vehicle, rotor_thrusts(vehicle, Wrench(lower, moment)))
    can = fits.any(axis=0)
    got, tolerance = wrench(vehicle, allocate(vehicle, demand)), 1e-8 * span(vehicle)
    np.testing.assert_allclose(got.moment_body[can], tilted.moment_body[can], rtol=0, atol=tolerance)
    highest = np.where(fits, lower, -np.inf).max(axis=0)
    assert (got.thrust >= highest - tolerance)[can].all()


def test_the_range_of_collective_thrust_ends_where_a_rotor_does() -> None:
    """Of six rotors that turn either way, one of which pushes down to hold the others up."""
    places = [(1.0, 1.0), (1.0, -1.0), (2.0, 1.0), (2.0, -1.0), (9.0, 0.0), (-1.0, 0.0)]
    rotors = tuple(
        Rotor(np.array([x, y, 0.0]), spin, -3.0 - k, 8.0 + k, 0.05, 0.0, 0.1)
        for k, ((x, y), spin) in enumerate(zip(places, (1, -1, -1, 1, 1, -1), strict=True))
    )
    vehicle = Vehicle("uneven", 1.0, np.eye(3), rotors)
    assert mixer(vehicle)[:, 0].min() < -1e-3
    ends = np.array(collective_range(vehicle))
    for collective, holds in ((ends, True), (ends + np.array([-1e-3, 1e-3]), False)):
        thrusts = rotor_thrusts(vehicle, Wrench(collective, np.zeros((2, 3))))
        assert (within(vehicle, thrusts) == holds).all()


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
    rotors, mixer = tree_map(lambda leaf: leaf[0], parameters(vehicle, 1))
    for k in range(5):
        desired = rigid_body.RotorWrench(load.thrust[k], tuple(load.moment_body[k]))
        exact = mix(mixer, desired)
        alone = exact if within_limits(rotors, exact) else desaturate(FloatOps, rotors, mixer, desired)
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
