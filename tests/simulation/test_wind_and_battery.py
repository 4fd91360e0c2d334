"""Gusts with the spectrum of MIL-F-8785C, whatever the tick; a battery that only ever sags."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

import aerobat as ab
from aerobat.engines.engine import expanded
from aerobat.environment import Battery, Dispersion, Environment, Gusts
from aerobat.kernels import wind
from aerobat.kernels.battery import BatteryState
from aerobat.kernels.wind import GustFilter, GustNoise
from aerobat.simulation.conditions.draw import Draws, dispersed_fleet
from aerobat.simulation.conditions.parts import DispersedFlights, gust_filter, wind_part
from aerobat.simulation.conditions.random_source import RandomSource
from aerobat.simulation.conditions.sensors import GUST_NOISE
from aerobat.simulation.reference_source import ReferenceSource
from aerobat.trajectory import Trajectory
from dispersed_loops import dispersed_setup, drawn, rows_of

HEXA = ab.load_vehicle("hexarotor")
INTENSITY, LENGTH, AIRSPEED = 0.7, 1.5, 5.0
FLIGHTS = 200
STATIONARY = np.array([[0.5, 0.25], [0.25, 0.25]])  # of the two filters of a component across


def gusts_of(rate: float, steps: int, **changes: float) -> np.ndarray:
    """Gusts at so many ticks a second, along, across and vertical, (3, steps, flights)."""
    dispersion = Dispersion(gusts=Gusts(intensity=INTENSITY, length=LENGTH, airspeed=AIRSPEED, **changes))
    draws = Draws(dispersion, 6, 3, range(FLIGHTS))
    path = ReferenceSource(hover(1.0), HEXA, Environment(), rate)
    flights = DispersedFlights(draws, dispersed_fleet(HEXA, draws), path)
    part = wind_part(dispersion.gusts, flights)
    state = wind.init(part.parameters)
    noise = expanded(RandomSource(draws.stream("wind"), GUST_NOISE, block=32).chunk(0, steps))
    rows = []
    for k in range(steps):
        along, across, vertical = noise.along[k], *(tuple(x[k] for x in pair) for pair in noise[1:])
        state = wind.step(part.parameters, state, GustNoise(along, across, vertical))
        rows.append(state.velocity)
    x, y, z = np.array(rows).transpose(1, 0, 2) - np.array(part.parameters.mean)[:, None]
    cosine, sine = part.parameters.along
    return np.array([cosine * x + sine * y, cosine * y - sine * x, z])


def test_gusts_have_the_intensity_stated_from_the_first_tick_to_the_last() -> None:
    for component in gusts_of(100.0, 300):
        for when in (slice(0, 20), slice(280, 300)):
            assert component[when].std() == pytest.approx(INTENSITY, rel=0.12)
        assert component.std() == pytest.approx(INTENSITY, rel=0.06)


def test_gusts_have_the_dryden_spectrum_of_mil_f_8785c() -> None:
    """Φ of the frequency in time, one-sided, by Welch's periodograms, within 10 %; ∫ Φ df = σ²."""
    rate, steps = 100.0, 4096
    along, across, vertical = gusts_of(rate, steps)
    reach = LENGTH / AIRSPEED
    for component, is_along in ((along, True), (across, False), (vertical, False)):
        frequency, density = signal.welch(component, rate, nperseg=1024, axis=0)
        middle = (frequency > 0.3) & (frequency < 7.0)  # above, what is aliased adds to it
        squared = (2.0 * np.pi * frequency[middle] * reach) ** 2
        shape = 2.0 / (1.0 + squared) if is_along else (1.0 + 3.0 * squared) / (1.0 + squared) ** 2
        expected = 2.0 * INTENSITY**2 * reach * shape
        np.testing.assert_allclose(density.mean(axis=1)[middle], expected, rtol=0.1)


def transition(made: GustFilter) -> tuple[np.ndarray, np.ndarray]:
    """Φ and the covariance of the inputs, of a component across."""
    decay, coupling = made.decay, made.coupling
    a, b, c = made.across
    root = np.array([[a, 0.0], [b, c]])
    return np.array([[decay, 0.0], [coupling, decay]]), root @ root.T


@given(st.floats(1e-5, 5.0))
def test_two_steps_are_one_of_twice_the_length(step: float) -> None:
    """The discretisation is exact: it does not depend on the tick, and keeps the stationary covariance."""
    one, two = gust_filter(step), gust_filter(2.0 * step)
    phi, covariance = transition(one)
    np.testing.assert_allclose(transition(two)[0], phi @ phi, atol=1e-14)
    np.testing.assert_allclose(transition(two)[1], phi @ covariance @ phi.T + covariance, atol=1e-14)
    np.testing.assert_allclose(phi @ STATIONARY @ phi.T + covariance, STATIONARY, atol=1e-14)
    assert one.along**2 + one.decay**2 == pytest.approx(1.0, abs=1e-14)


def test_the_mean_wind_is_that_of_the_place_and_the_flight_s_own() -> None:
    dispersion = Dispersion(gusts=Gusts(mean_wind=1.0))
    draws = Draws(dispersion, 6, 3, range(3))
    windy = Environment(wind=(0.0, 2.0, 0.5))
    path = ReferenceSource(hover(1.0), HEXA, windy, 1000.0)
    flights = DispersedFlights(draws, dispersed_fleet(HEXA, draws), path)
    state = wind.init(wind_part(dispersion.gusts, flights).parameters)
    expected = windy.wind + draws.columns["mean_wind"]
    np.testing.assert_allclose(np.transpose(state.velocity), expected, atol=1e-15)


def hover(duration: float) -> Trajectory:
    return Trajectory(np.array([duration]), np.zeros((1, 1, 3)))


def battery_rows(plan: Any, battery: Battery, flights: int = 1) -> Any:
    dispersion = Dispersion(battery=battery)
    setup = dispersed_setup(plan, HEXA, dispersion, drawn(dispersion, HEXA, flights))
    return rows_of(setup, lambda signals: (signals.of(BatteryState), signals.plant.thrusts))


def test_a_hover_empties_the_battery_in_its_endurance_and_not_further() -> None:
    state, _ = battery_rows(hover(2.0), Battery(endurance=1.0, sag=0.3))
    charge, ceiling = (leaf[0] for leaf in state)
    np.testing.assert_allclose(charge[np.arange(0, 1000, 10)], 0.99 - 0.01 * np.arange(100), atol=2e-3)
    assert (np.diff(charge) <= 0.0).all()
    assert charge[-1] == 0.0
    np.testing.assert_allclose(ceiling, 1.0 - 0.3 * (1.0 - charge), rtol=1e-15)


def test_no_rotor_gives_more_than_its_sagging_ceiling() -> None:
    """Half empty at the start, and a path that asks for more than is left."""
    steep = Trajectory(np.array([0.5]), np.array([[[0, 0, 0], [0, 0, 0], [0, 0, 18.0]]], dtype=float))
    battery = Battery(endurance=5.0, sag=0.6, charge_spread=0.9)
    (charge, ceiling), thrusts = battery_rows(steep, battery, 8)
    lags = np.exp(-1e-3 / 0.02)  # a thrust above a lower ceiling falls to it with the rotor's lag
    limit = 8.175 * ceiling
    assert (charge[:, 0] < 1.0).all()
    for thrust in thrusts:
        excess = np.maximum(thrust - limit, 0.0)
        assert (excess[:, 1:] <= excess[:, :-1] * lags + 8.175 * np.abs(np.diff(ceiling)) + 1e-12).all()
    assert max(float((thrust / limit)[:, 100:].max()) for thrust in thrusts) > 0.99
