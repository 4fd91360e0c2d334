"""A quadrotor that is flown by channels alone: a receiver, an inner loop, a rigid body over flat ground."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

import aerobat as ab
from aerobat.control.parameters import controller_parameters
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.interchange.ros import Messages
from aerobat.kernels import motors, rate_loop
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.ops import PerRotor
from aerobat.kernels.rate_loop import RateLoopModel, RateSetpoint
from aerobat.kernels.rigid_body import Body, specific_force
from aerobat.links.betaflight.board import Board, SerialLine
from aerobat.links.betaflight.msp import MSP
from aerobat.links.betaflight.packets import state_packet
from aerobat.links.betaflight.process import Firmware, configured
from aerobat.links.betaflight.settings import betaflight_settings, board_rate, rotor_order
from aerobat.links.commander import Doing
from aerobat.links.ros import topics
from aerobat.links.ros.maneuver_node import ManeuverNode, NodeSettings
from aerobat.simulation.flight_controller import Sensed
from aerobat.simulation.law_controller import DERIVATIVE, GYRO
from aerobat.states import BodyState
from aerobat.vehicle.fleet import Fleet
from ros_sky import BEGAN, AtOnce, Graph, Reply, Ros

STEP = 0.002  # [s]
TICKS = 2  # steps from one tick of the node to the next
STANDING = Body((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)


class InnerLoop(Protocol):
    """What turns channels into rotor commands."""

    def step(self, sensed: Sensed, duration: float) -> PerRotor:
        """Rotor commands [N] for the next while [s]."""


class ModelledLoop:
    """Our model of the inner loop, with what a receiver hears: armed, roll, pitch, yaw, thrust."""

    def __init__(self, vehicle: ab.Vehicle, heard: Callable[[], tuple[bool, RateSetpoint]]) -> None:
        model = controller_parameters(vehicle.controller, Fleet.of([vehicle]), ab.Environment())
        self._model = RateLoopModel(*first_numbers((model.airframe, model.mixer)), GYRO, DERIVATIVE)
        self._idle = tuple(vehicle.min_thrusts.tolist())
        self._heard, self._state = heard, rate_loop.init(self._idle, (0.0, 0.0, 0.0))

    def step(self, sensed: Sensed, duration: float) -> PerRotor:
        armed, setpoint = self._heard()
        if not armed:
            self._state = rate_loop.init(self._idle, sensed.omega)
            return self._idle
        self._state = rate_loop.step(FloatOps, self._model, self._state, setpoint, sensed.omega, duration)
        commands: PerRotor = self._state.commands.thrusts
        return commands


class Bench:
    """The node of maneuvers on demand, a board, and the quadrotor that it flies."""

    def __init__(self, vehicle: ab.Vehicle, board: Board, inner: InnerLoop, maneuver: str) -> None:
        self.graph, self.inner = Graph(2), inner
        model = controller_parameters(vehicle.controller, Fleet.of([vehicle]), ab.Environment())
        self._airframe, self._environment = first_numbers((model.airframe, model.environment))
        self._idle = tuple(vehicle.min_thrusts.tolist())
        self.motion = VehicleState(STANDING, self._idle)
        self.said: list[str] = []
        maneuvers: dict[str, Any] = {"maneuver": (ab.load_problem(maneuver), ab.Miqp(reserve=0.15))}
        self.node = ManeuverNode(
            Ros(self.graph), vehicle, maneuvers, AtOnce(), NodeSettings(rate=1.0 / (TICKS * STEP)),
            self.said.append, lambda tick: board.take(tick.piece, tick.commander.observed, tick.now),
        )  # fmt: skip
        ros = Ros(self.graph)
        self._messages = Messages(ros.make)
        self._odometry = ros.publisher(topics.ODOMETRY, topics.KIND_OF_ODOMETRY)
        self.sees = True  # the vehicle, whoever measures its motion

    @property
    def now(self) -> float:
        return (self.graph.time - BEGAN) / 1e9

    def call(self, service: str) -> Reply:
        reply = Reply()
        self.graph.services[f"/aerobat/{service}"](reply)
        self.run(lambda: reply.success is not None)
        return reply

    def run_until(self, doing: Doing) -> None:
        self.run(lambda: self.node.commander.doing is doing)

    def run_for(self, seconds: float) -> None:
        end = self.now + seconds
        self.run(lambda: self.now >= end - 1e-9)

    def run(self, until: Callable[[], bool], limit: float = 40.0) -> None:
        end = self.now + limit
        while not until():
            assert self.now < end, f"not reached: {self.said}"
            self.graph.time += round(1e9 * STEP)
            self._fly()
            if round(self.now / STEP) % TICKS == 0:
                if self.sees:
                    self._odometry(self._messages.odometry(self.graph.time, self._seen))
                self.graph.deliver()
                self.node.tick(self.now)

    @property
    def _seen(self) -> BodyState:
        return BodyState(*(np.array(part) for part in self.motion.body))

    def _fly(self) -> None:
        body, thrust = self.motion.body, sum(self.motion.thrusts)
        stands = body.position[2] <= 0.0
        force = (0.0, 0.0, 9.81)
        if not stands:
            force = specific_force(self._airframe.mass_properties, self._environment, body, thrust)
        commands = self.inner.step(Sensed(body.omega_body, force, body.q_world_body), STEP)
        self.motion = motors.advance(FloatOps, self._airframe, self._environment, self.motion, commands, STEP)
        if self.motion.body.position[2] <= 0.0:  # it stands there
            x, y, _ = self.motion.body.position
            self.motion = self.motion._replace(body=STANDING._replace(position=(x, y, 0.0)))


class FirmwareLoop:
    """Betaflight's firmware, whose receiver hears MSP on its first serial line."""

    LINES = ("set serial_update_rate_hz = 2000",)  # its receiver is MSP by default

    def __init__(self, vehicle: ab.Vehicle) -> None:
        lines = betaflight_settings(vehicle, board_rate(vehicle), simulated=True)
        self.firmware = Firmware(configured((*lines, *self.LINES)))
        self._order, self._vehicle = rotor_order(vehicle), vehicle
        self.firmware.step(1.0)
        self.line = SerialLine(f"socket://127.0.0.1:{self.firmware._port}", 115200)
        self.protocol = MSP

    def send(self, frame: bytes) -> None:
        """As a line does; the thread that reads it in the firmware lives by the wall's time."""
        self.line.send(frame)
        time.sleep(0.001)

    def step(self, sensed: Sensed, duration: float) -> PerRotor:
        commands = self.firmware.step(duration, state_packet(sensed))
        low, high = self._vehicle.min_thrusts, self._vehicle.max_thrusts
        by_rotor = dict(zip(self._order, commands, strict=True))
        return tuple(float(low[k] + (high[k] - low[k]) * by_rotor[k]) for k in range(len(by_rotor)))

    def close(self) -> None:
        self.line.close()
        self.firmware.close()
