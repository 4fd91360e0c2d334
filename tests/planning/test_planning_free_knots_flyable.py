"""What free knots and min-snap hold: commands of lagging rotors, rates, attitudes with drag, windows."""

from dataclasses import replace

import numpy as np
import pytest

from aerobat import so3
from aerobat.arrays import Array
from aerobat.errors import Infeasible
from aerobat.flatness import force_balance, reference
from aerobat.planning import MinSnap, Plan, own_flight
from aerobat.planning.polynomial.free_knots import FreeKnots
from aerobat.problem import (
    GatePassage,
    Line,
    Problem,
    Waypoint,
    Waypoints,
    at_rest,
    load_problem,
    tilted_gate,
)
from aerobat.problem.stage import CrossingTime
from aerobat.vehicle import Vehicle, load_vehicle
from shared_plans import closed_form

SAMPLES = 10_000
HALF_FLIP, LINE = load_problem("half-flip"), load_problem("line")


def dragging(name: str, drag: float) -> Vehicle:
    """A preset with a drag over its mass [1/s]."""
    vehicle = load_vehicle(name)
    return replace(vehicle, drag_body=drag * vehicle.mass * np.array([1.0, 1.0, 0.6]))


def tilted(angle_deg: float) -> Problem:
    gates = HALF_FLIP.maneuver.with_gate_tilt(HALF_FLIP.gates, np.deg2rad(angle_deg))
    return replace(HALF_FLIP, gates=gates)


def thrust_axes(plan: Plan, times: Array) -> Array:
    assert plan.vehicle is not None
    environment = plan.problem.environment
    setpoint = reference(plan.trajectory, plan.vehicle, times=times, environment=environment).setpoint
    return so3.axes(setpoint.q_world_body)[..., :, 2]


def degrees_off_upright(plan: Plan) -> float:
    """The angle [deg] between the thrust axis and the upright of the gate as it is passed."""
    (stage,) = plan.stages
    axis = thrust_axes(plan, np.array([stage.time]))[0]
    return float(np.degrees(np.arccos(np.clip(axis @ plan.problem.gates[0].up, -1.0, 1.0))))


@pytest.fixture(scope="module", params=["line", pytest.param("half-flip", marks=pytest.mark.slow)])
def lagging(request: pytest.FixtureRequest) -> Plan:
    if request.param == "line":
        return FreeKnots(segments=2).plan(LINE, load_vehicle("crazyflie"))
    return FreeKnots().plan(tilted(-70.0), load_vehicle("crazyflie"))


def test_commands_of_rotors_with_lag_stay_within_limits(lagging: Plan) -> None:
    """f + τ f′, f′ by differences, 10⁴ samples and both sides of every knot among them."""
    vehicle, trajectory = lagging.vehicle, lagging.trajectory
    assert vehicle is not None
    assert lagging.certified
    step = 1e-6
    times = np.linspace(step, trajectory.duration - step, SAMPLES)
    times = times[np.abs(times[:, None] - trajectory.knots).min(axis=1) > 2 * step]
    before, here, after = (
        reference(trajectory, vehicle, times=times + shift).rotor_thrusts for shift in (-step, 0.0, step)
    )
    commands = here + vehicle.lags * (after - before) / (2 * step)
    slack = 1e-5 * vehicle.max_thrusts.max()
    assert (commands > vehicle.min_thrusts - slack).all()
    assert (commands < vehicle.max_thrusts + slack).all()
    for k in range(5):  # thrusts do not jump
        assert trajectory.jumps(k).max() < 1e-5 * 10.0**k


def test_a_vehicle_with_lag_flies_its_certified_plan(lagging: Plan) -> None:
    """It missed the gate by 93 cm where lag was left out."""
    assert lagging.vehicle is not None
    flown = own_flight(lagging.evidence.task, lagging.trajectory, lagging.stages)
    assert flown.error < 0.05


@pytest.mark.slow
def test_body_rates_stay_within_the_vehicles() -> None:
    slow = replace(load_vehicle("agile-quad"), max_body_rate=4.0)
    plan = FreeKnots(segments=2).plan(LINE, slow)
    assert plan.certified
    times = np.linspace(0.0, plan.duration, SAMPLES)
    omega = reference(plan.trajectory, slow, times=times).setpoint.omega_body
    assert 3.8 < np.linalg.norm(omega, axis=-1).max() < 4.0 + 1e-6


def test_the_thrust_is_along_the_gates_upright_drag_counted() -> None:
    """A goal far beyond the gate and strong drag both turn the thrust away; half the tolerance is left."""
    far = replace(tilted(80.0), goal=at_rest((15.0, 0.0, 0.0)))
    plan = FreeKnots(segments=2).plan(far, dragging("agile-quad", 0.6))
    assert plan.certified
    assert degrees_off_upright(plan) < np.degrees(far.gates[0].attitude_tolerance) / 2 + 1e-3
    assert thrust_axes(plan, np.linspace(0.0, plan.duration, SAMPLES))[:, 2].min() > -1e-6


@pytest.mark.slow
@pytest.mark.parametrize(("at", "segments"), [(0.4, 2), ((0.55, 0.7), 4)])
def test_a_gate_is_passed_when_its_stage_asks(at: CrossingTime, segments: int) -> None:
    gate = tilted_gate((2.5, 0.0, 0.0))
    problem = replace(LINE, gates=(gate,), maneuver=Line(GatePassage(at=at)))
    plan = FreeKnots(segments=segments).plan(problem, load_vehicle("agile-quad"))
    earliest, latest = (at, at) if isinstance(at, float) else at
    assert plan.certified
    assert earliest - 1e-4 < plan.stages[0].time / plan.duration < latest + 1e-4


def test_min_snap_counts_drag_at_an_attitude_to_rounding() -> None:
    """Aimed at exactly `up`, whether a gate's or a waypoint's, with the drag of the path's own velocity."""
    plan = MinSnap(stop_after=12).plan(tilted(60.0), dragging("agile-quad", 0.6))
    assert degrees_off_upright(plan) < 1e-5
    vehicle = dragging("hexarotor", 0.6)
    points = (
        Waypoint(position=(2.0, 0.5, 1.0), up=(1.0, 0.0, 1.0), thrust=15.0),
        Waypoint(position=(5.0, 1.0, 1.5)),
    )
    problem = Problem("slalom", at_rest((0, 0, 1)), at_rest((8, 0, 1)), Waypoints(points))
    slalom = MinSnap().plan(problem, vehicle)
    assert slalom.certified
    balance = force_balance(problem.environment, vehicle)
    time = slalom.stages[0].time
    v, a = (slalom.trajectory.evaluate(time, k) for k in (1, 2))
    thrust = a + balance.constant + balance.drag * v
    np.testing.assert_allclose(thrust, 15.0 * np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0), atol=1e-6)


def test_min_snap_never_flies_a_half_flip_upside_down() -> None:
    """It was certified at a tilt of 127°."""
    plan = closed_form()
    assert plan.certified
    assert thrust_axes(plan, np.linspace(0.0, plan.duration, 10 * SAMPLES))[:, 2].min() > -1e-6


@pytest.mark.slow
def test_min_snap_says_what_bound_before_the_stages_did() -> None:
    little = HALF_FLIP.maneuver.with_stage_thrust(HALF_FLIP.gates, 7.0)
    with pytest.raises(Infeasible, match=r"falls to -.*; at the last"):
        MinSnap().plan(replace(HALF_FLIP, maneuver=little), dragging("agile-quad", 0.4))
