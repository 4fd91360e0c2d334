"""Laws of the simulated body and rotors: conservation, order of convergence, and other people's physics."""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from aerobat import so3
from aerobat.control.parameters import airframe_parameters
from aerobat.engines.floats import FloatOps
from aerobat.engines.pytree import tree_map
from aerobat.kernels import motors, rigid_body
from aerobat.kernels.motors import Airframe, VehicleState, advance
from aerobat.kernels.rigid_body import Body, EnvironmentParameters, MassProperties, RotorWrench
from aerobat.simulation.bodies import bodies, body_states
from aerobat.simulation.components import rigid_body_steps
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle, load_vehicle
from aerobat.vehicle.fleet import Fleet

CALM = EnvironmentParameters(9.81, (0.0, 0.0, 0.0))
FULL_INERTIA = np.array([[0.012, 0.002, -0.001], [0.002, 0.009, 0.0015], [-0.001, 0.0015, 0.016]])
TUMBLING = BodyState(
    position=np.array([0.3, -0.2, 1.0]),
    velocity=np.array([1.0, -2.0, 0.5]),
    q_world_body=so3.exp([0.4, -1.1, 0.8]),
    omega_body=np.array([3.0, -2.0, 4.0]),
)

LEVEL = BodyState(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))


def airframe_of(vehicle: Vehicle) -> Airframe:
    return tree_map(lambda leaf: leaf[0], airframe_parameters(Fleet.of([vehicle])))


def inertial_of(**changes) -> MassProperties:
    return airframe_of(replace(load_vehicle("hexarotor"), inertia=FULL_INERTIA, **changes)).mass_properties


def body_of(state: BodyState) -> Body:
    return tree_map(float, bodies(state))


def flown(
    inertial: MassProperties, body: Body, load: Callable[[float], RotorWrench], end: float, steps: int
) -> Body:
    dt = end / steps
    for k in range(steps):
        loads = tuple(load((k + part) * dt) for part in (0.0, 0.5, 1.0))
        body = rigid_body.step(FloatOps, inertial, CALM, body, loads, dt)
    return body


def no_load(t: float) -> RotorWrench:
    return RotorWrench(0.0, (0.0, 0.0, 0.0))


def test_torque_free_tumbling_keeps_energy_and_angular_momentum() -> None:
    body = body_of(TUMBLING)
    after = body_states(flown(inertial_of(), body, no_load, end=10.0, steps=10_000))

    def energy(omega: np.ndarray) -> float:
        return float(omega @ FULL_INERTIA @ omega)

    def momentum(q: np.ndarray, omega: np.ndarray) -> np.ndarray:
        return so3.rotate(q, FULL_INERTIA @ omega)

    assert energy(after.omega_body) == pytest.approx(energy(TUMBLING.omega_body), rel=1e-12)
    before = momentum(TUMBLING.q_world_body, TUMBLING.omega_body)
    change = momentum(after.q_world_body, after.omega_body) - before
    assert np.linalg.norm(change) < 1e-10 * np.linalg.norm(before)
    assert np.linalg.norm(after.q_world_body) == pytest.approx(1.0, abs=1e-15)


def test_a_free_fall_is_a_parabola() -> None:
    after = body_states(flown(inertial_of(), body_of(TUMBLING), no_load, end=2.0, steps=100))
    fall = np.array([0.0, 0.0, -9.81])
    np.testing.assert_allclose(after.velocity, TUMBLING.velocity + 2 * fall, rtol=1e-13)
    np.testing.assert_allclose(
        after.position, TUMBLING.position + 2 * TUMBLING.velocity + 2 * fall, rtol=1e-13
    )


def test_against_drag_a_fall_ends_at_the_speed_at_which_drag_carries_the_weight() -> None:
    inertial = inertial_of(drag_body=np.array([0.5, 0.5, 0.5]))
    after = flown(inertial, body_of(TUMBLING), no_load, end=60.0, steps=6_000)
    np.testing.assert_allclose(after.velocity, [0.0, 0.0, -9.81 * 1.0 / 0.5], atol=1e-6)


def test_drag_opposes_motion_along_each_body_axis_by_its_own_coefficient() -> None:
    inertial = inertial_of(drag_body=np.array([0.1, 0.2, 0.4]))
    rate = rigid_body.derivative(inertial, CALM, body_of(TUMBLING), no_load(0.0))
    velocity_body = so3.unrotate(TUMBLING.q_world_body, TUMBLING.velocity)
    force = so3.rotate(TUMBLING.q_world_body, -np.array([0.1, 0.2, 0.4]) * velocity_body)
    np.testing.assert_allclose(rate.velocity, force / 1.0 + [0.0, 0.0, -9.81], rtol=1e-13)


def test_a_body_that_drifts_with_the_wind_feels_no_drag() -> None:
    """Wind is another frame of reference: the same motion, seen from one that moves along."""
    inertial, wind = inertial_of(drag_body=np.array([0.1, 0.2, 0.4])), (3.0, -1.0, 0.5)
    windy = CALM._replace(wind=wind)
    body = body_of(TUMBLING)
    calm = rigid_body.derivative(inertial, CALM, body, no_load(0.0))
    blown = body._replace(velocity=tuple(v + w for v, w in zip(body.velocity, wind, strict=True)))
    moved = rigid_body.derivative(inertial, windy, blown, no_load(0.0))
    np.testing.assert_allclose(moved.velocity, calm.velocity, rtol=1e-13)
    drifting = rigid_body.derivative(inertial, windy, body._replace(velocity=wind), no_load(0.0))
    np.testing.assert_allclose(drifting.velocity, [0.0, 0.0, -9.81], rtol=1e-13)


def wavy_load(t: float) -> RotorWrench:
    return RotorWrench(
        9.0 + 4.0 * np.sin(5 * t), (0.05 * np.cos(7 * t), -0.04 * np.sin(4 * t), 0.03 * np.cos(3 * t))
    )


def test_the_integrator_is_of_order_four_against_dop853() -> None:
    """Against equations of motion written anew, with matrices, and SciPy's integrator."""
    drag = np.array([0.1, 0.2, 0.3])
    inertial = inertial_of(drag_body=drag)

    def derivative(t: float, y: np.ndarray) -> np.ndarray:
        velocity, q, omega = y[3:6], y[6:10], y[10:]
        turn, load = so3.axes(q), wavy_load(t)
        force = turn @ ([0.0, 0.0, load.thrust] - drag * (turn.T @ velocity))
        torque = np.array(load.moment_body) - np.cross(omega, FULL_INERTIA @ omega)
        spin = so3.multiply(q, [0.0, *omega]) / 2
        return np.concatenate(
            [velocity, force - [0.0, 0.0, 9.81], spin, np.linalg.solve(FULL_INERTIA, torque)]
        )

    start = np.concatenate(list(vars(TUMBLING).values()))
    reference = solve_ivp(derivative, (0.0, 1.0), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    errors = []
    for steps in (50, 100, 200):
        after = flown(inertial, body_of(TUMBLING), wavy_load, end=1.0, steps=steps)
        errors.append(np.linalg.norm(np.concatenate(after) - reference))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert ((orders > 3.9) & (orders < 4.3)).all(), orders


@pytest.mark.parametrize("name", ["hexarotor", "section-v"])
def test_body_and_rotors_together_are_of_order_four_with_lag_and_without(name: str) -> None:
    vehicle = load_vehicle(name)
    airframe = airframe_of(vehicle)
    count = len(vehicle.rotors)
    commands = (3.0, 0.5, 2.0, 7.0, 1.0, 2.5)[:count]

    def after(steps: int) -> np.ndarray:
        motion = VehicleState(body_of(TUMBLING), (1.0, 2.0, 3.0, 1.0, 2.0, 3.0)[:count])
        for _ in range(steps):
            motion = advance(FloatOps, airframe, CALM, motion, commands, 0.2 / steps)
        return np.concatenate(motion.body)

    reference = after(1600)
    errors = [np.linalg.norm(after(steps) - reference) for steps in (25, 50, 100)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert ((orders > 3.8) & (orders < 4.3)).all(), orders


@pytest.mark.parametrize("lag", [0.0, 1e-5, 5e-4, 0.02, 10.0])
def test_a_step_of_commands_gives_the_impulse_of_its_thrusts_whatever_the_lag(lag: float) -> None:
    vehicle = load_vehicle("section-v")
    vehicle = replace(vehicle, rotors=tuple(replace(rotor, lag=lag) for rotor in vehicle.rotors))
    before, wanted, period = 0.5, 0.75, 0.002
    motion = VehicleState(body_of(LEVEL), (before,) * 4)
    for k in range(1, 51):
        motion = advance(FloatOps, airframe_of(vehicle), CALM, motion, (wanted,) * 4, period)
        time = k * period
        lost = (wanted - before) * lag * -np.expm1(-time / lag) if lag else 0.0
        climb = 4.0 * (wanted * time - lost) / vehicle.mass - 9.81 * time
        assert motion.body.velocity[2] == pytest.approx(climb, rel=0, abs=1e-8)


def test_a_period_of_two_milliseconds_is_integrated_to_micrometres() -> None:
    airframe = airframe_of(load_vehicle("agile-quad"))
    finest, usual = (
        after_commands(airframe, rigid_body_steps(1.0 / 500.0) * refinement, periods=500)
        for refinement in (8, 1)
    )
    np.testing.assert_allclose(usual.position, finest.position, rtol=0, atol=1e-6)
    np.testing.assert_allclose(usual.q_world_body, finest.q_world_body, rtol=0, atol=1e-6)


def after_commands(airframe: Airframe, steps: int, periods: int) -> Body:
    """Commands that throw an agile vehicle about, to 20 rad/s and back."""
    motion = VehicleState(body_of(TUMBLING), (2.0,) * 4)
    for k in range(periods):
        wave = [2.0 + 0.5 * np.sin(0.02 * k + phase) for phase in (0.0, 0.2, 0.1, 0.3)]
        for _ in range(steps):
            motion = advance(FloatOps, airframe, CALM, motion, tuple(wave), 0.002 / steps)
    return motion.body


def test_rotors_answer_a_step_with_the_analytic_exponential_and_stop_at_their_limits() -> None:
    vehicle = load_vehicle("crazyflie")
    rotors = airframe_of(vehicle).rotors
    wanted = motors.clamp(FloatOps, rotors, (0.1, 0.05, 1.0, -1.0))
    assert wanted == (0.1, 0.05, vehicle.max_thrusts[2], 0.0)
    thrusts = start = (0.02, 0.09, 0.03, 0.04)
    for _ in range(50):
        thrusts = motors.first_order_response(thrusts, wanted, motors.decay_factors(FloatOps, rotors, 0.002))
    expected = wanted + (np.array(start) - wanted) * np.exp(-0.1 / vehicle.lags)
    np.testing.assert_allclose(thrusts, expected, rtol=1e-13)


def test_a_rotor_without_lag_follows_at_once() -> None:
    rotors = airframe_of(load_vehicle("section-v")).rotors
    after = motors.first_order_response((1.0,) * 4, (2.0,) * 4, motors.decay_factors(FloatOps, rotors, 1e-4))
    assert after == (2.0,) * 4


FREE_BODY = """
<mujoco>
  <option integrator="RK4" timestep="0.001" gravity="0 0 -9.81"/>
  <worldbody>
    <body><freejoint/><site name="centre"/>
      <inertial pos="0 0 0" mass="1.0" fullinertia="{inertia}"/>
    </body>
  </worldbody>
  <actuator>
    <general site="centre" gear="0 0 1 0 0 0"/>
    <general site="centre" gear="0 0 0 1 0 0"/>
    <general site="centre" gear="0 0 0 0 1 0"/>
    <general site="centre" gear="0 0 0 0 0 1"/>
  </actuator>
</mujoco>
"""


def test_mujocos_free_body_agrees_to_a_nanometre() -> None:
    """Two seconds under a thrust and moments that change at every step."""
    xx, yy, zz = np.diag(FULL_INERTIA)
    xy, xz, yz = FULL_INERTIA[[0, 0, 1], [1, 2, 2]]
    model = mujoco.MjModel.from_xml_string(FREE_BODY.format(inertia=f"{xx} {yy} {zz} {xy} {xz} {yz}"))
    data = mujoco.MjData(model)
    data.qpos[:] = [*TUMBLING.position, *TUMBLING.q_world_body]
    data.qvel[:] = [*TUMBLING.velocity, *TUMBLING.omega_body]
    inertial, body = inertial_of(), body_of(TUMBLING)
    for k in range(2000):
        load = wavy_load(0.001 * k)
        data.ctrl[:] = [load.thrust, *load.moment_body]
        mujoco.mj_step(model, data)
        body = rigid_body.step(FloatOps, inertial, CALM, body, (load, load, load), 0.001)
    np.testing.assert_allclose(body.position, data.qpos[:3], rtol=0, atol=1e-9)
    np.testing.assert_allclose(body.omega_body, data.qvel[3:], rtol=0, atol=1e-9)
    assert so3.angle_between(body.q_world_body, data.qpos[3:]) < 1e-9
