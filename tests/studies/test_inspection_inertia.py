"""Inertia: a log tells another inertia from other gains, rotors or mass, with noise or without.

The plans and vehicles here are others than those of `test_inspection`, by which the thresholds were chosen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import aerobat as ab
from aerobat import so3
from shared_plans import shared_plan

PLANS = (("half-flip", "agile-quad"), ("line", "agile-quad"), ("half-flip", "crazyflie"))
FACTORS = (0.5, 0.6, 1.5, 2.0, 3.0)


def named(flight: ab.Flight, plan: ab.Plan) -> bool:
    return ab.inspect_flight(flight, plan).cause == "inertia"


def flown(plan: ab.Plan, factor: float, controller: str = "full") -> ab.Flight:
    vehicle = plan.vehicle
    assert vehicle is not None
    turned = replace(vehicle, inertia=factor * vehicle.inertia)
    if controller == "rates":
        return ab.fly(plan, turned, nominal=vehicle, controller=controller, rate=1000.0)
    return ab.fly(plan, turned, nominal=vehicle, controller=controller)


@pytest.mark.parametrize("controller", ["full", pytest.param("rates", marks=pytest.mark.slow)])
@pytest.mark.parametrize(("problem", "vehicle"), PLANS)
def test_another_inertia_is_named_with_its_factor(problem: str, vehicle: str, controller: str) -> None:
    plan = shared_plan(problem, vehicle)
    for factor in FACTORS:
        found = ab.inspect_flight(flown(plan, factor, controller), plan)
        assert found.cause == "inertia"
        assert f"the inertia is {factor:.1f} times the planned one in " in str(found.fault)
    assert not named(flown(plan, 1.2, controller), plan)
    assert not named(flown(plan, 1.0, controller), plan)


@pytest.mark.parametrize("problem", ["line", pytest.param("half-flip", marks=pytest.mark.slow)])
@pytest.mark.parametrize("spread", [0.15, 0.6])
def test_of_vehicles_that_differ_in_all_those_of_another_inertia_are_named(
    problem: str, spread: float
) -> None:
    """Rotors, mass, drag, sensors and wind differ too; 0.15 is the spread of field conditions."""
    plan, flights = shared_plan(problem), range(8)
    conditions = replace(ab.load_dispersion("field"), inertia=spread)
    drawn = ab.sweep(plan, conditions, len(flights), seed=5, workers=1).table["inertia"]
    for k, flight in enumerate(ab.fly(plan, conditions=conditions, seed=5, flights=flights)):
        fault = ab.inspect_flight(flight, plan).fault
        apart = abs(np.log(drawn[k]))
        if apart < np.log(1.3):
            assert fault is None or fault.cause != "inertia"
        elif apart > np.log(1.6):
            assert fault is not None


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_neither_mass_nor_thrusts_that_a_log_misstates_are_taken_for_inertia(factor: float) -> None:
    plan = shared_plan("half-flip")
    assert plan.vehicle is not None
    heavy = ab.fly(plan, replace(plan.vehicle, mass=factor * plan.vehicle.mass), nominal=plan.vehicle)
    assert not named(heavy, plan)
    flight = ab.fly(plan)
    misstated = {name: factor**2 * flight.series[name] for name in ("thrusts", "commands")}
    assert not named(replace(flight, series={**flight.series, **misstated}), plan)


@pytest.mark.parametrize("noise", [0.02, 0.05, 1.0, 5.0])  # [rad/s] of each logged body rate
@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_noise_of_the_rates_hides_an_inertia_but_makes_none_up(noise: float, factor: float) -> None:
    plan, rng = shared_plan("half-flip"), np.random.default_rng(0)
    flight = flown(plan, factor)
    rates = flight.omega_body + noise * rng.standard_normal(flight.omega_body.shape)
    turned = so3.multiply(flight.q_world_body, so3.exp(0.01 * noise * rng.standard_normal(rates.shape)))
    logged = replace(flight, series={**flight.series, "omega_body": rates, "q_world_body": turned})
    assert named(logged, plan) == (factor == 2.0 and noise <= 0.05)
