"""Other simulators, made ready to step: each function gives one that advances its vehicles some steps."""

import contextlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass

VEHICLES = 1000


@dataclass(frozen=True)
class Peer:
    """A simulator, and what one of its steps includes."""

    name: str
    includes: str
    vehicles: int
    steps: int  # of each vehicle in a run
    ready: Callable[[int], Callable[[], None]]  # from the number of steps to a run; ImportError where missing


def crazyflow(steps: int) -> Callable[[], None]:
    import jax
    from crazyflow.control import Control
    from crazyflow.dynamics import Dynamics
    from crazyflow.sim import Sim
    from crazyflow.sim.integration import Integrator

    rates = dict.fromkeys(("freq", "state_freq", "attitude_freq", "force_torque_freq"), 1000)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):  # where MuJoCo leaves its log
        sim = Sim(
            n_worlds=VEHICLES,
            dynamics=Dynamics.first_principles,
            control=Control.state,
            integrator=Integrator.rk4,
            **rates,
        )
    sim.state_control(sim.data.controls.state.staged_cmd.at[..., 2].set(1.0))  # [m] of height

    def run() -> None:
        sim.step(steps)
        jax.block_until_ready(sim.data.states.pos)

    return run


def rotorpy(steps: int) -> Callable[[], None]:
    import numpy as np
    import torch
    from rotorpy.controllers.quadrotor_control import BatchedSE3Control
    from rotorpy.trajectories.circular_traj import BatchedThreeDCircularTraj
    from rotorpy.vehicles.crazyflie_params import quad_params
    from rotorpy.vehicles.multirotor import BatchedMultirotor, BatchedMultirotorParams

    torch.set_num_threads(1)  # more cost more processor time than they save
    device, still = torch.device("cpu"), torch.zeros(VEHICLES, 3, dtype=torch.double)
    parameters = BatchedMultirotorParams([quad_params] * VEHICLES, VEHICLES, device)
    state = {
        "x": still + torch.tensor([1.0, 0.0, 0.0]),  # where the circle begins
        "v": still,
        "q": torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.double).repeat(VEHICLES, 1),
        "w": still,
        "wind": still,
        "rotor_speeds": torch.full((VEHICLES, 4), 1788.53, dtype=torch.double),  # hovering
    }
    vehicles = BatchedMultirotor(parameters, VEHICLES, state, device, integrator="rk4")
    controller = BatchedSE3Control(parameters, VEHICLES, device)
    circles = [[[value] * 3] * VEHICLES for value in (0.0, 1.0, 0.2)]
    trajectory = BatchedThreeDCircularTraj(*circles, [False] * VEHICLES)
    everyone = np.arange(VEHICLES)

    def run() -> None:
        flown = state
        for tick in range(steps):
            flat = trajectory.update(torch.full((VEHICLES,), tick / 1000, dtype=torch.double))
            commands = controller.update(None, flown, flat, everyone)
            flown = vehicles.step(flown, commands, 0.001, everyone)

    return run


def mujoco(steps: int) -> Callable[[], None]:
    import mujoco

    arms = ((0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1), (0.1, -0.1))
    sites = "".join(f'<site name="r{i}" pos="{x} {y} 0"/>' for i, (x, y) in enumerate(arms))
    drag = (0.01, -0.01, 0.01, -0.01)  # [m] each rotor's torque per thrust
    motors = "".join(f'<general site="r{i}" gear="0 0 1 0 0 {c}"/>' for i, c in enumerate(drag))
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><option timestep="0.001" integrator="RK4"/><worldbody><body><freejoint/>'
        '<inertial pos="0 0 0" mass="0.5" diaginertia="0.002 0.002 0.003"/>'
        f"{sites}</body></worldbody><actuator>{motors}</actuator></mujoco>"
    )
    data = mujoco.MjData(model)

    def run() -> None:
        mujoco.mj_resetData(model, data)
        data.ctrl[:] = 0.5 * 9.81 / 4
        mujoco.mj_step(model, data, steps)

    return run


PEERS = (
    Peer(
        "crazyflow",
        "its Mellinger controllers of position and attitude at 1 kHz, motor mixing, rotors with lag, drag, "
        "RK4; float32; a constant set-point, no trajectory",
        VEHICLES,
        500,
        crazyflow,
    ),
    Peer(
        "RotorPy, batched",
        "its circle, its SE(3) controller, mixing, rotors with lag, drag, RK4; float64; one thread; "
        "without its simulate_batch, which also logs and measures",
        VEHICLES,
        40,
        rotorpy,
    ),
    Peer(
        "MuJoCo",
        "mj_step of one free body with four constant thrusts, RK4; float64; no controller, no trajectory",
        1,
        100_000,
        mujoco,
    ),
)
