"""The disturbance observer: what the model does not know is answered where an IMU feels it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import aerobat as ab
from aerobat.control import named_controller
from aerobat.environment import load_dispersion
from shared_plans import shared_plan

LAB = load_dispersion("lab")
WITHOUT = ab.Controller(disturbance_filter=0.0)
BODY = 0.43  # [m] agile-quad's width


def flip(vehicle: str) -> ab.Plan:
    return shared_plan("flip-roll", vehicle, ab.Miqp(order=4, reserve=0.15))


@cache
def swept(vehicle: str, controller: ab.Controller) -> ab.Sweep:
    return ab.sweep(flip(vehicle), LAB, runs=100, seed=5, controller=controller, workers=1)


def few(conditions: ab.Dispersion, controller: ab.Controller, flights: int) -> ab.Passage:
    """Passages of some flights."""
    options = {"seed": 5, "flights": flights, "controller": controller, "engine": "compiled"}
    return ab.score_flights(flip("agile-quad"), conditions=conditions, **options).passages[0]


def test_the_gate_is_passed_nearer_to_its_centre_where_disturbances_are_observed() -> None:
    """The first two of the flights below."""
    alone, observed = (few(LAB, controller, 2) for controller in (WITHOUT, ab.Controller()))
    assert observed.miss.max() < 0.02 < 0.025 < alone.miss.max()
    assert abs(observed.up.mean()) < 0.008 < 0.01 < alone.up.mean()


def test_a_rotor_that_pulls_unevenly_does_not_carry_a_light_vehicle_sideways_any_more() -> None:
    uneven = replace(LAB, name="uneven rotors", rotor=0.06)
    alone, observed = (few(uneven, controller, 1) for controller in (WITHOUT, ab.Controller()))
    assert observed.needed_width[0] < 1.2 * BODY < 1.3 * BODY < alone.needed_width[0]


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", ["hexarotor", "agile-quad"])
def test_under_lab_the_gate_is_passed_within_3_cm_where_disturbances_are_observed(vehicle: str) -> None:
    """At 95 % the gains alone leave 5 cm, 2 cm of it the mean that drag makes."""
    alone, observed = swept(vehicle, WITHOUT), swept(vehicle, ab.Controller())
    assert observed.quantile("gate_miss_m", 0.95) < 0.032 < 0.044 < alone.quantile("gate_miss_m", 0.95)
    assert abs(np.nanmean(observed.table["gate_up_m"])) < 0.008 < 0.01 < np.nanmean(alone.table["gate_up_m"])


@pytest.mark.slow
def test_rotors_that_pull_unevenly_no_longer_carry_a_light_vehicle_sideways() -> None:
    """Their moment, which a gyro feels, is what made the widest passages."""
    uneven = replace(LAB, name="uneven rotors", rotor=0.06)
    widths = [
        ab.sweep(flip("agile-quad"), uneven, runs=100, seed=5, controller=each, workers=1).quantile(
            "gate_needed_width_m", 0.95
        )
        for each in (WITHOUT, ab.Controller())
    ]
    assert widths[1] < 1.8 * BODY < widths[0]


@pytest.mark.parametrize(
    ("lag", "same", "count"),
    [
        (0.072, (0.02, 0.0), 1),
        pytest.param(0.04, (0.02, 0.04), 20, marks=pytest.mark.slow),
        pytest.param(0.072, (0.02, 0.0), 20, marks=pytest.mark.slow),
    ],
)
def test_a_vehicle_of_slow_rotors_is_observed_no_faster_than_they_turn_or_not(
    lag: float, same: tuple[float, float], count: int
) -> None:
    """A filter of 20 ms beside rotors of 72 ms, their lag known to 25 %, would lose flights."""
    quad = ab.load_vehicle("agile-quad")
    slow = replace(quad, rotors=tuple(replace(rotor, lag=lag) for rotor in quad.rotors))
    plan = ab.plan("half-flip", ab.Miqp(order=4, reserve=0.2), slow)
    flights = [
        ab.score_flights(plan, conditions=LAB, flights=count, controller=ab.Controller(disturbance_filter=t))
        for t in same
    ]
    np.testing.assert_array_equal(flights[0].max_position_error_m, flights[1].max_position_error_m)
    assert flights[0].max_position_error_m.max() < 0.5


def test_flights_without_an_imu_are_flown_as_without_the_observer() -> None:
    blind = replace(LAB, imu=None, motion_capture=None)
    flights = [
        ab.fly(flip("agile-quad"), conditions=blind, flights=3, controller=each)
        for each in (WITHOUT, ab.Controller())
    ]
    np.testing.assert_array_equal(flights[0].position, flights[1].position)


def test_the_papers_law_has_no_observer() -> None:
    assert named_controller("paper", ab.Controller()) == ab.Controller.paper()
    assert ab.Controller.paper().disturbance_filter == 0.0
    own = ab.Controller(disturbance_filter=0.03)
    assert named_controller("full", own) == own
