"""What the tracking controller owes, whatever it flies: symmetries, equilibrium, limits, recovery."""

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import aerobat as ab
from aerobat import so3
from aerobat.control import Controller
from aerobat.control.parameters import FREE_ERROR, hover_authority, max_bandwidth
from aerobat.errors import SpecError
from aerobat.simulation import Flight, Outcome, fly
from aerobat.states import STANDARD_GRAVITY, BodyState
from aerobat.trajectory import Trajectory
from aerobat.vehicle import load_vehicle, vehicle_names
from aerobat.vehicle.fleet import Fleet
from suites import examples

VEHICLES = vehicle_names()
HERE = np.array([1.0, -2.0, 3.0])


def hover(duration: float) -> Trajectory:
    return Trajectory(np.array([duration]), HERE[None, None])


def swerve() -> Trajectory:
    """A brisk move through 2 s of polynomials of degree 9, at rest at both ends."""
    s = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70]).coef
    return Trajectory(np.array([2.0]), s[None, :, None] * np.array([2.5, 1.5, -1.0]))


def start_at(position=HERE, velocity=(0.0, 0.0, 0.0), q=so3.IDENTITY, omega=(0.0, 0.0, 0.0)) -> BodyState:
    return BodyState(*(np.array(part, dtype=float) for part in (position, velocity, q, omega)))


def error(flight: Flight) -> np.ndarray:
    return np.linalg.norm(flight.states.position - flight.setpoint.flat.position, axis=-1)


@pytest.mark.parametrize("name", VEHICLES)
def test_a_hover_is_an_equilibrium(name: str) -> None:
    vehicle = load_vehicle(name)
    flight = fly(hover(2.0), vehicle)
    weight = vehicle.mass * STANDARD_GRAVITY
    np.testing.assert_allclose(flight.states.position, np.broadcast_to(HERE, (1001, 3)), atol=1e-12)
    np.testing.assert_allclose(flight.commands.sum(axis=-1), weight, rtol=1e-12)
    assert not flight.saturated.any()


@pytest.mark.parametrize("name", ["agile-quad", "hexarotor"])
def test_the_sign_of_the_quaternion_is_nothing_to_the_flight(name: str) -> None:
    q = so3.exp([0.5, -0.4, 0.3])
    flights = [fly(swerve(), load_vehicle(name), start=start_at([0.1, 0, 0], q=sign * q)) for sign in (1, -1)]
    np.testing.assert_array_equal(flights[0].states.position, flights[1].states.position)
    np.testing.assert_array_equal(flights[0].commands, flights[1].commands)


@examples(10)
@given(st.floats(-np.pi, np.pi))
def test_turned_about_the_vertical_everything_turns(angle: float) -> None:
    """Trajectory, start and heading turned by an angle: the same flight, turned; off its path, with drag."""
    vehicle = replace(load_vehicle("hexarotor"), drag_body=np.array([0.2, 0.1, 0.3]))
    turn = so3.about_axis([0.0, 0.0, 1.0], angle)
    path, start = swerve(), start_at([0.1, 0.2, -0.1], [0.0, 0.3, 0.0], so3.exp([0.2, 0.1, 0.3]), [1.0, 0, 0])
    straight = fly(path, vehicle, start=start)
    turned = fly(
        Trajectory(path.durations, so3.rotate(turn, path.coefficients), angle),
        vehicle,
        start=BodyState(
            so3.rotate(turn, start.position),
            so3.rotate(turn, start.velocity),
            so3.multiply(turn, start.q_world_body),
            start.omega_body,
        ),
    )
    expected = so3.rotate(turn, straight.states.position)
    np.testing.assert_allclose(turned.states.position, expected, rtol=0, atol=1e-9)
    np.testing.assert_allclose(turned.thrusts, straight.thrusts, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ["agile-quad", "hexarotor", "crazyflie"])
@pytest.mark.parametrize("tilt_deg", [*(pytest.param(d, marks=pytest.mark.slow) for d in (45, 135)), 90, 180])
def test_thrown_into_the_air_in_any_attitude_it_comes_back(name: str, tilt_deg: int) -> None:
    q = so3.about_axis([0.8, 0.6, 0.0], np.deg2rad(tilt_deg))
    flight = fly(hover(6.0), load_vehicle(name), start=start_at(q=q))
    assert flight.outcome is Outcome.COMPLETE
    assert error(flight)[-1] < 0.15


@pytest.mark.parametrize("name", VEHICLES)
def test_a_wrong_mass_leaves_no_lasting_error(name: str) -> None:
    vehicle = load_vehicle(name)
    heavy = replace(vehicle, mass=1.05 * vehicle.mass)
    flight = fly(hover(12.0), heavy, nominal=vehicle)
    assert error(flight).max() > 1e-3
    assert error(flight)[-1] < 0.05 * error(flight).max()


@pytest.mark.parametrize("switch", ["moment_feedforward", "motor_lag_compensation"])
def test_each_feed_forward_brings_the_vehicle_nearer_to_its_path(switch: str) -> None:
    vehicle = load_vehicle("agile-quad")
    off = fly(swerve(), vehicle, controller=Controller(**{switch: False}))
    assert error(off).max() > 5 * error(fly(swerve(), vehicle)).max()


def test_drag_that_the_controller_knows_of_is_made_up_for() -> None:
    vehicle = load_vehicle("agile-quad")
    dragged = replace(vehicle, drag_body=np.array([0.3, 0.3, 0.3]))
    unknown = error(fly(swerve(), dragged, nominal=vehicle)).max()
    assert unknown > 0.01
    assert error(fly(swerve(), dragged)).max() < 0.1 * unknown


def test_commands_keep_within_limits_and_say_when_limits_changed_them() -> None:
    vehicle = load_vehicle("hexarotor")
    flight = fly(
        hover(2.0), vehicle, start=start_at(HERE + np.array([1.0, 1.0, -1.0]), q=so3.exp([2.0, 0.0, 0.0]))
    )
    assert ((flight.commands >= vehicle.min_thrusts) & (flight.commands <= vehicle.max_thrusts)).all()
    inside = (flight.commands > vehicle.min_thrusts) & (flight.commands < vehicle.max_thrusts)
    assert flight.saturated.any()
    assert not flight.saturated.all()
    assert not inside.all(axis=-1)[flight.saturated].all()
    assert flight.saturated[(~inside).any(axis=-1)].all()


# ---- settings


@pytest.mark.parametrize("field", [f.name for f in fields(Controller) if not isinstance(f.default, bool)])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf, "fast", None, True])
def test_a_gain_that_is_no_gain_is_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(SpecError, match=rf"^Controller\.{field} must be (a (finite )?number|0 or more), got"):
        Controller(**{field: value})


def test_a_switch_is_on_or_off() -> None:
    with pytest.raises(SpecError, match=r"^Controller\.prioritize_tilt must be true or false, got 1"):
        Controller(prioritize_tilt=1)


def test_filters_of_no_length_are_no_filters() -> None:
    sharp = Controller(lead_time_constant=0.0, jerk_filter=0.0, max_integral=0.0)
    assert error(fly(swerve(), load_vehicle("agile-quad"), controller=sharp)).max() < 1e-3


def test_a_vehicle_with_weak_rotors_gets_slower_loops_of_the_same_shape() -> None:
    controller = Controller()
    usual, half = controller.gains(100.0), controller.gains(controller.attitude_frequency / 2)
    assert usual.stiffness == 2 * controller.attitude_frequency**2
    assert half.position == pytest.approx(usual.position / 4)
    assert half.velocity == pytest.approx(usual.velocity / 2)
    assert half.stiffness / half.damping**2 == pytest.approx(usual.stiffness / usual.damping**2)


def test_slow_rotors_of_a_heavy_vehicle_hold_it_in_a_lab() -> None:
    """Leads of such rotors' lag saturated them in a hover: most flights of 10 kg diverged."""
    small = load_vehicle("hexarotor")
    rotors = tuple(
        replace(rotor, position_body=3.0 * rotor.position_body, min_thrust=1.5, max_thrust=40.0, lag=0.12)
        for rotor in small.rotors
    )
    heavy = replace(small, mass=10.0, inertia=np.diag([0.6, 0.6, 1.1]), rotors=rotors)
    flights = fly(hover(3.0), heavy, conditions="lab", flights=range(30))
    assert set(flights.outcomes) == {Outcome.COMPLETE}


@pytest.mark.parametrize("name", VEHICLES)
def test_the_lag_slows_no_vehicle_that_comes_with_aerobat(name: str) -> None:
    fleet, environment = Fleet.of([load_vehicle(name)]), ab.Environment()
    saturating = np.sqrt(hover_authority(fleet, environment)[0, :2].min() / FREE_ERROR)
    least = min(saturating, Controller().attitude_frequency)
    assert max_bandwidth(fleet, environment)[0] >= least


@pytest.mark.parametrize("name", ["full", "paper"])
def test_a_law_of_ones_own_takes_no_name_that_comes_with_aerobat(name: str) -> None:
    with pytest.raises(ab.SpecError, match=f"controller '{name}' comes with Aerobat"):

        @ab.controller(name)
        class Mine(ab.ControlLaw):
            def init(self, *args: object) -> object:
                return ()

            def step(self, *args: object) -> object:  # type: ignore[override]
                return args
