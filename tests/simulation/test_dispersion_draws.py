"""Draws: each flight's own, whatever flies beside it; means and spreads as the conditions state them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from aerobat import so3
from aerobat.environment import Dispersion, load_dispersion
from aerobat.simulation.conditions.draw import STREAMS, Draws, dispersed_fleet
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle, load_vehicle, vehicle_names
from aerobat.vehicle.fleet import Fleet

FLIGHTS = 3000
ALPHA = 1e-3  # of each test by which a right spread would be refused; seeds are fixed
LAB = load_dispersion("lab")
ROTORS = 6


@pytest.fixture(scope="module")
def draws() -> Draws:
    return Draws(LAB, ROTORS, 11, range(FLIGHTS))


def column(draws: Draws, name: str) -> np.ndarray:
    return draws.columns[name]


def of_flight(draws: Draws, k: int) -> dict[str, np.ndarray]:
    return {name: values[k] for name, values in draws.columns.items()}


def differing(one: Draws, other: Draws) -> set[str]:
    return {name for name in one.columns if not np.array_equal(one.columns[name], other.columns[name])}


def test_a_flight_draws_the_same_whatever_flies_beside_it(draws: Draws) -> None:
    some = Draws(LAB, ROTORS, 11, [2, 40, 7])
    for k, flight in enumerate((2, 40, 7)):
        np.testing.assert_equal(of_flight(some, k), of_flight(draws, flight))
    assert not np.isin(Draws(LAB, ROTORS, 12, [2]).columns["mass"], draws.columns["mass"]).any()
    assert len(np.unique(draws.columns["mass"])) == FLIGHTS


@pytest.mark.parametrize(
    ("name", "spread"),
    [
        ("start_position", 0.02),
        ("start_velocity", 0.05),
        ("start_attitude", np.radians(1.0)),
        ("gyro_bias", 0.02),
        ("accelerometer_bias", 0.1),
        ("first_position_error", 0.001),
        ("first_attitude_error", np.radians(0.3)),
    ],
)
def test_offsets_are_normal_with_the_spread_stated(draws: Draws, name: str, spread: float) -> None:
    for axis in column(draws, name).T:
        assert stats.kstest(axis / spread, "norm").pvalue > ALPHA


@pytest.mark.parametrize(
    ("name", "spread"), [("mass", 0.03), ("inertia", 0.1), ("effectiveness", 0.03), ("lags", 0.25)]
)
def test_factors_have_mean_one_and_the_spread_stated(draws: Draws, name: str, spread: float) -> None:
    factors = column(draws, name).ravel()
    standard_error = spread / np.sqrt(len(factors))
    assert abs(factors.mean() - 1.0) < 3.3 * standard_error
    assert factors.std() == pytest.approx(spread, rel=5.0 * (1.0 + 4.0 * spread) / np.sqrt(len(factors)))
    shape = np.sqrt(np.log1p(spread**2))
    assert stats.kstest(factors, "lognorm", (shape, 0.0, np.exp(-0.5 * shape**2))).pvalue > ALPHA


def test_drag_charge_and_wind_are_drawn_as_stated(draws: Draws) -> None:
    assert stats.kstest(column(draws, "drag") / 0.1, "halfnorm").pvalue > ALPHA
    assert stats.kstest((1.0 - column(draws, "charge")) / 0.1, "uniform").pvalue > ALPHA
    assert stats.kstest(column(draws, "gust_heading") / (2 * np.pi), "uniform").pvalue > ALPHA
    wind = column(draws, "mean_wind")
    for axis in wind.T[:2]:
        assert stats.kstest(axis / 0.1, "norm").pvalue > ALPHA
    assert not wind[:, 2].any()


@pytest.mark.parametrize(
    ("name", "length"),
    [("hand_off_translation", 0.005), ("hand_off_rotation", np.radians(0.2)), ("warp", 0.003)],
)
def test_misfits_have_the_length_stated_in_any_direction(draws: Draws, name: str, length: float) -> None:
    """On a sphere each component of a unit vector is uniform (Archimedes)."""
    vectors = column(draws, name) / length
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=1e-12)
    for component in vectors.T:
        assert stats.kstest(component, "uniform", (-1.0, 2.0)).pvalue > ALPHA


def test_a_cause_that_is_switched_off_leaves_the_draws_of_others_alone() -> None:
    causes: dict[str, tuple[dict[str, object], set[str]]] = {
        "mass": ({"mass": 0.0}, {"mass"}),
        "gusts": ({"gusts": None}, {"mean_wind"}),
        "battery": ({"battery": None}, {"charge"}),
        "start": ({"start_position": 0.0, "start_velocity": 0.0}, {"start_position", "start_velocity"}),
        "hand-off": (
            {"motion_capture": replace(LAB.motion_capture, hand_off=None)},
            {"hand_off_translation", "hand_off_rotation", "warp"},
        ),
    }
    whole = Draws(LAB, ROTORS, 3, [5])
    for changes, own in causes.values():
        other = Draws(replace(LAB, **changes), ROTORS, 3, [5])
        assert differing(whole, other) == own


def test_a_vehicle_with_other_rotors_draws_all_else_alike() -> None:
    six, four = (Draws(LAB, rotors, 3, [5]) for rotors in (6, 4))
    assert differing(six, four) == {"effectiveness", "lags"}


def flown(nominal: Vehicle, draw: dict[str, np.ndarray]) -> Vehicle:
    """The vehicle that really flies, its rotors' effectiveness apart."""
    lags = zip(nominal.rotors, draw["lags"].tolist(), strict=True)
    return replace(
        nominal,
        mass=float(draw["mass"]) * nominal.mass,
        inertia=draw["inertia"] * nominal.inertia,
        drag_body=nominal.drag_body + draw["drag"] * nominal.mass,
        rotors=tuple(replace(rotor, lag=factor * rotor.lag) for rotor, factor in lags),
    )


@pytest.mark.parametrize("name", vehicle_names())
def test_vehicles_drawn_one_by_one_and_all_at_once_are_the_same(name: str) -> None:
    nominal = load_vehicle(name)
    draws = Draws(LAB, len(nominal.rotors), 3, range(20))
    each = [of_flight(draws, k) for k in range(len(draws))]
    at_once, one_by_one = dispersed_fleet(nominal, draws), Fleet.of([flown(nominal, draw) for draw in each])
    for field, value in vars(one_by_one).items():
        np.testing.assert_array_equal(getattr(at_once, field), value)


def test_where_nothing_varies_the_nominal_vehicle_starts_at_the_reference() -> None:
    nominal = load_vehicle("hexarotor")
    reference = BodyState(np.ones(3), np.zeros(3), np.array([0.6, 0.0, 0.8, 0.0]), np.zeros(3))
    draws = Draws(Dispersion(), ROTORS, 3, [4])
    assert flown(nominal, of_flight(draws, 0)) == nominal
    for name, part in vars(draws.starts(reference)).items():
        np.testing.assert_array_equal(part[0], getattr(reference, name))
    assert draws.columns["charge"] == 1.0
    np.testing.assert_array_equal(draws.columns["effectiveness"], 1.0)


def test_a_flight_starts_off_the_reference_by_what_it_draws() -> None:
    reference = BodyState(np.ones(3), np.zeros(3), np.array([0.6, 0.0, 0.8, 0.0]), np.ones(3))
    draws = Draws(LAB, ROTORS, 3, [2])
    start = draws.starts(reference)
    np.testing.assert_array_equal(start.position, 1.0 + draws.columns["start_position"])
    np.testing.assert_array_equal(start.velocity, draws.columns["start_velocity"])
    turned = so3.box_minus(start.q_world_body, reference.q_world_body)
    np.testing.assert_allclose(turned, draws.columns["start_attitude"], atol=1e-14)
    np.testing.assert_array_equal(start.omega_body, 1.0)


def test_streams_of_random_numbers_are_each_their_own() -> None:
    draws = Draws(LAB, ROTORS, 3, range(20))
    first = {tuple(seed.generate_state(2).tolist()) for name in STREAMS for seed in draws.stream(name)}
    assert len(first) == len(draws) * len(STREAMS)
