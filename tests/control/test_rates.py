"""Body rates and thrust for an inner loop: what the loop does with them, and how well the pair flies."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat.control import Seen
from aerobat.control.laws.rates import Rates
from aerobat.control.parameters import airframe_parameters, controller_parameters
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.environment import Environment
from aerobat.kernels import motors, rate_loop
from aerobat.kernels.control import Commands
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.quaternions import conjugate, multiply
from aerobat.kernels.rate_loop import RateLoopModel, RateLoopState, RateSetpoint, rate_gains
from aerobat.kernels.rigid_body import Body, EnvironmentParameters
from aerobat.simulation.autopilot.braking import point_reference
from aerobat.vehicle.fleet import Fleet
from refusals import complaint
from shared_plans import shared_plan
from suites import examples

QUAD = ab.load_vehicle("agile-quad")
FLEET = Fleet.of([QUAD])
AIRFRAME = first_numbers(airframe_parameters(FLEET))
MIXER = first_numbers(controller_parameters(QUAD.controller, FLEET, Environment())).mixer
WEIGHTLESS = EnvironmentParameters(0.0, (0.0, 0.0, 0.0))
STILL = Body((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
HOVER = QUAD.mass * 9.81
TICK = 1e-4  # [s]


def turned(omega: tuple[float, float, float], duration: float) -> np.ndarray:
    """Rates of a vehicle at rest that is asked to turn, a row a tick, with filters that do nothing."""
    model = RateLoopModel(AIRFRAME, MIXER, 0.0, 0.0)
    hover = (HOVER / 4,) * 4
    motion, state = VehicleState(STILL, hover), rate_loop.init(hover, STILL.omega_body)
    rows = []
    for _ in range(round(duration / TICK)):
        rows.append(motion.body.omega_body)
        state = rate_loop.step(
            FloatOps, model, state, RateSetpoint(omega, HOVER), motion.body.omega_body, TICK
        )
        motion = motors.advance(FloatOps, AIRFRAME, WEIGHTLESS, motion, state.commands.thrusts, TICK)
    return np.array(rows)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rates_follow_their_set_point_as_the_poles_say(axis: int) -> None:
    """τ ω'' + (1 + d) ω' + p ω + i ∫ω = p r + i ∫r, solved apart from the loop."""
    gains, lag, asked = rate_gains(FloatOps, AIRFRAME), QUAD.rotors[0].lag, 0.2
    p, i, d = (part[axis] for part in gains[:3])
    rate, slope, integral, expected = 0.0, 0.0, 0.0, []
    for _ in range(2000):
        expected.append(rate)
        integral += TICK * (asked - rate)
        slope += TICK * (p * (asked - rate) + i * integral - (1.0 + d) * slope) / lag
        rate += TICK * slope
    omega = tuple(asked if k == axis else 0.0 for k in range(3))
    rows = turned(omega, 0.2)
    np.testing.assert_allclose(rows[:, axis], expected, atol=0.02 * asked)
    np.testing.assert_allclose(np.delete(rows, axis, axis=1), 0.0, atol=1e-9)


@examples(50)
@given(
    st.tuples(*[st.floats(-30.0, 30.0)] * 3), st.floats(0.0, 40.0), st.tuples(*[st.floats(-30.0, 30.0)] * 3)
)
def test_commands_stay_within_limits_and_give_the_thrust_where_moments_leave_room(
    omega: tuple[float, float, float], thrust: float, gyro: tuple[float, float, float]
) -> None:
    model = RateLoopModel(AIRFRAME, MIXER, 1e-3, 1e-3)
    nothing = (0.0, 0.0, 0.0)
    state = RateLoopState(gyro, nothing, nothing, Commands((0.0,) * 4, False))
    commands = rate_loop.step(FloatOps, model, state, RateSetpoint(omega, thrust), gyro, 1e-3).commands
    high = QUAD.max_thrusts.max()
    assert all(-1e-9 <= each <= high + 1e-9 for each in commands.thrusts)
    if not commands.saturated:
        assert sum(commands.thrusts) == pytest.approx(thrust, abs=1e-9)


def test_rates_are_corrected_by_the_square_of_the_thrust_below_a_hovers() -> None:
    """Of a tilted vehicle: hardly any thrust has a direction that small errors swing about."""
    law, model = Rates(), first_numbers(controller_parameters(QUAD.controller, FLEET, Environment()))
    tilted = STILL._replace(q_world_body=(np.cos(0.05), np.sin(0.05), 0.0, 0.0))

    def corrected(specific_thrust: float) -> float:
        up, zero = np.array([[0.0, 0.0, specific_thrust - 9.81]]), np.zeros((1, 3))
        wanted = first_numbers(point_reference(zero, zero, up, zero, 0.0, 9.81))
        seen = Seen(tilted, (HOVER / 4,) * 4, wanted)
        state, _ = law.step(FloatOps, model, law.init(FloatOps, model, seen), seen, 1e-3)
        return float(state.setpoint.omega[0])

    whole = corrected(12.0)
    assert whole == pytest.approx(-16.0 * 0.1, rel=0.01)
    assert corrected(0.98) == pytest.approx(0.01 * whole, rel=0.02)


def test_flights_of_a_lab_pass_by_rates_as_by_the_tracking_controller() -> None:
    plan = shared_plan("half-flip")
    by = {
        name: ab.score_flights(plan, conditions="lab", flights=40, controller=name).max_position_error_m
        for name in ("full", "rates")
    }
    assert np.median(by["rates"]) < 1.3 * np.median(by["full"])
    assert by["rates"].max() < 0.2


@pytest.mark.parametrize(
    ("vehicle", "largest"), [("agile-quad", 10.0), pytest.param("crazyflie", 20.0, marks=pytest.mark.slow)]
)
def test_a_heading_is_held_by_rotors_that_differ(vehicle: str, largest: float) -> None:
    """Rotors 3 % apart turn a vehicle by their drag; nine of ten flights hold their heading [deg]."""
    flights = ab.fly(shared_plan("line", vehicle), conditions="lab", flights=range(40), controller="rates")
    assert np.quantile([headings_missed(flights[k]).max() for k in range(40)], 0.9) < largest


@pytest.mark.parametrize("vehicle", ["x500", pytest.param("crazyflie", marks=pytest.mark.slow)])
def test_weak_rotors_are_asked_for_no_more_than_they_turn(vehicle: str) -> None:
    """Nine of ten flights of a lab come no more than 20 cm off their line."""
    by_rates = {"conditions": "lab", "flights": 40, "controller": "rates"}
    off = ab.score_flights(shared_plan("line", vehicle), **by_rates).max_position_error_m
    assert np.quantile(off, 0.9) < 0.2


def headings_missed(flight: ab.Flight) -> np.ndarray:
    """How far a vehicle is turned about its thrust axis from its set-point at every tick [deg]."""
    w, *_, z = multiply(conjugate(flight.setpoint.q_world_body.T), flight.q_world_body.T)
    turned = 2.0 * np.arctan2(z, w)
    return np.degrees(np.abs(np.arctan2(np.sin(turned), np.cos(turned))))


def test_rates_stay_within_what_a_gyro_tells() -> None:
    """A start at a right angle asks for a fast turn; the outer loop asks no faster than it may."""
    start = ab.BodyState(
        [0.0, 0.0, 1.0], [0.0] * 3, [0.7071067811865476, 0.7071067811865475, 0.0, 0.0], [0.0] * 3
    )
    path = ab.Trajectory(np.array([3.0]), np.array([[[0.0, 0.0, 1.0]]]))
    flight = ab.fly(path, QUAD, start=start, controller="rates")
    assert np.abs(flight.omega_body).max() < 8.0
    assert flight.position_error[-1] < 0.3


def test_a_firmware_is_flown_by_a_controller_that_gives_rates() -> None:
    said = complaint(lambda: ab.fly(shared_plan("half-flip"), controller="lee", autopilot="betaflight"))
    assert "fly by controller='rates'" in said
