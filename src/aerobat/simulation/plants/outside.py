"""The simulation loop with an external plant, external flight-controller firmware, or both.

The rest of the loop is compiled as usual and stepped tick by tick. The firmware takes measurements and the
controller's body rates; the plant takes the firmware's rotor commands.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from aerobat.declaration import shown
from aerobat.engines.engine import expanded
from aerobat.engines.floats import FloatOps, first_numbers
from aerobat.engines.pytree import tree_map, tree_stack
from aerobat.errors import SpecError
from aerobat.kernels import motors
from aerobat.kernels.control import Commands, Controlling
from aerobat.kernels.imu import ImuState
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.ops import Vector
from aerobat.kernels.rate_loop import RateSetpoint
from aerobat.kernels.rigid_body import EnvironmentParameters, specific_force
from aerobat.kernels.vectors import ZERO
from aerobat.problem.gate import Gate
from aerobat.registry import placed
from aerobat.simulation.components import (
    LogRow,
    PlantParameters,
    RateLoop,
    commands_in_effect,
    gyro,
    log_row,
    rigid_body_steps,
    rotor_commands,
    with_ceiling,
    with_wind,
)
from aerobat.simulation.flight_controller import AutopilotRun, Sensed
from aerobat.simulation.loop import Component, LoopInput, LoopPart, Signals, compose
from aerobat.simulation.outcome import Contact
from aerobat.simulation.plants.plant import Actuation, Plant, PlantRun, PlantScene
from aerobat.simulation.setup import FlightSetup
from aerobat.vehicle.ellipsoid import Ellipsoid


@dataclass(frozen=True)
class OutsidePlant(Component):
    """A plant whose state is an input at every tick."""

    def init(self, parameters: tuple[()], signals: Signals) -> VehicleState:
        """See `Component.init`."""
        motion: VehicleState = signals.inputs
        return motion

    def step(self, parameters: tuple[()], state: VehicleState, signals: Signals) -> VehicleState:
        """See `Component.step`."""
        motion: VehicleState = signals.inputs
        return motion


@dataclass(frozen=True)
class Actuator(Component):
    """The inputs of the external plant: commands, wind, and the rotor limits that the battery allows."""

    def init(self, parameters: PlantParameters, signals: Signals) -> Actuation:
        """See `Component.init`."""
        thrusts = rotor_commands(signals).thrusts
        return Actuation(thrusts, parameters.environment.wind, parameters.airframe.rotors.max_thrust)

    def step(self, parameters: PlantParameters, state: Actuation, signals: Signals) -> Actuation:
        """See `Component.step`."""
        return Actuation(
            commands_in_effect(signals),
            with_wind(parameters.environment, signals).wind,
            with_ceiling(parameters.airframe, signals).rotors.max_thrust,
        )


class FirmwareInputs(NamedTuple):
    """The inputs of an autopilot's firmware at a tick."""

    gyro: Vector  # [rad/s] body
    specific_force: Vector | tuple[()]  # [m/s²] body; () where there is no IMU
    setpoint: RateSetpoint


class OutsideRow(NamedTuple):
    """The log row of a tick, and the inputs of external plant and firmware."""

    log: LogRow
    actuation: Actuation
    firmware: FirmwareInputs | tuple[()]  # () where no body rates are commanded


class RigidBodyRun:
    """The built-in rigid body and rotors, advanced outside of the compiled loop; see `PlantRun`."""

    contact = Contact.NOTHING

    def __init__(self, scene: PlantScene, motion: VehicleState) -> None:
        self.motion = motion
        self._airframe, self._gravity = scene.airframe, scene.gravity

    def advance(self, actuation: Actuation, duration: float) -> None:
        """See `PlantRun.advance`."""
        environment = EnvironmentParameters(self._gravity, actuation.wind)
        rotors = self._airframe.rotors._replace(max_thrust=actuation.ceilings)
        airframe = self._airframe._replace(rotors=rotors)
        steps = rigid_body_steps(duration)
        for _ in range(steps):
            self.motion = motors.advance(
                FloatOps, airframe, environment, self.motion, actuation.commands, duration / steps
            )


def fly_outside(setup: FlightSetup, gates: tuple[Gate, ...]) -> tuple[LogRow, NDArray[np.int64]]:
    """Return the rows of all ticks, leaves (1, ticks), and the contacts before each, as codes of Contact.

    Args:
        setup: of one vehicle; its config's plant replaces the rigid body, its config's autopilot the model of
            the inner loop.
        gates: that the vehicle may touch.

    Raises:
        SpecError: there are several vehicles, or plant or firmware cannot fly this one.
        BackendMissing: the plant's simulator, or the firmware, is not installed.
    """
    plant, autopilot = setup.config.plant, setup.config.autopilot
    if len(setup.fleet) != 1:
        name = next(each.kind for each in (plant, autopilot) if each is not None)
        raise SpecError(f"plant: {name} flies one vehicle at a time, not {len(setup.fleet)}")
    parameters: PlantParameters = setup.parts[-1].parameters
    inner = setup.parts[:-1]
    if autopilot is not None:
        inner = tuple(part for part in inner if not isinstance(part.component, RateLoop))
    parts = (LoopPart(OutsidePlant()), *inner, LoopPart(Actuator(), parameters))
    inside = replace(setup, parts=parts)
    motion = VehicleState(
        first_numbers(setup.start), tuple(0.0 for _ in parameters.airframe.rotors.max_thrust)
    )
    first = _with_motion(inside.first_tick, motion)
    init, step = compose(inside.components, _outside_row)
    loop = inside.engine().compile(init, step, inside.parameters, first)
    carry = loop.init(first)
    numbers = first_numbers(inside.parameters), first_numbers(expanded(first))
    controller = next(each for each in init(FloatOps, *numbers) if isinstance(each, Controlling))
    motion = motion._replace(thrusts=controller.thrusts)
    scene = _scene(setup, gates)
    run: PlantRun = RigidBodyRun(scene, motion) if plant is None else _begin_run(plant, scene, motion)
    rows, touched = [], np.zeros(len(setup.times), dtype=np.int64)
    with closing(_Firmware(setup, scene)) as firmware:
        for tick, period in enumerate(np.diff(setup.times, append=setup.times[-1]).tolist()):
            before = run.motion
            carry, row = loop.step(carry, _with_motion(inside.tick(tick), before))
            log_row, actuation = firmware.step(row, before, period)
            rows.append(log_row)
            touched[tick] = run.contact
            if period > 0.0:
                run.advance(actuation, period)
    return tree_stack(rows, lambda parts: np.stack(parts, axis=-1)), touched


def _begin_run(plant: Plant, scene: PlantScene, motion: VehicleState) -> PlantRun:
    """Return the plant's vehicle at its start. Raises SpecError if begin() returns something else."""
    run: Any = plant.begin(scene, motion)
    names = ("motion", "contact", "advance")
    missing = [
        name for name in names if not hasattr(type(run), name) and name not in getattr(run, "__dict__", ())
    ]
    if missing:
        wrong = f"returned {shown(run)} from begin(), which has no {' and no '.join(missing)}"
    elif not isinstance(run.motion, VehicleState):
        wrong = f"has {shown(run.motion)} for its motion, not a VehicleState"
    else:
        return cast(PlantRun, run)
    raise placed(SpecError(f"plant '{plant.kind}' {wrong}"), plant.begin)


class _Firmware:
    """The firmware of a flight's config, if it has one, between the loop and the plant."""

    def __init__(self, setup: FlightSetup, scene: PlantScene) -> None:
        self._setup, self._scene = setup, scene
        self._run: AutopilotRun | None = None

    def close(self) -> None:
        """End the firmware, if it has begun."""
        if self._run is not None:
            self._run.close()

    def step(self, row: OutsideRow, motion: VehicleState, period: float) -> tuple[LogRow, Actuation]:
        """Return the row of a tick and the actuation until the next, with the firmware's commands, if any."""
        actuation: Actuation = first_numbers(row.actuation)
        autopilot = self._setup.config.autopilot
        if autopilot is None:
            return row.log, actuation
        inputs: FirmwareInputs = first_numbers(row.firmware)
        sensed = Sensed(
            inputs.gyro, inputs.specific_force or self._specific_force(motion), motion.body.q_world_body
        )
        if self._run is None:
            rates = self._setup.reference.max_rate
            self._run = autopilot.begin(self._setup.reference.vehicle, inputs.setpoint, rates)
        commands = self._run.step(sensed, inputs.setpoint, period)
        rotors = self._scene.airframe.rotors
        limits = zip(commands, rotors.min_thrust, rotors.max_thrust, strict=True)
        saturated = any(not low < command < high for command, low, high in limits)
        logged = Commands(tuple(np.array([each]) for each in commands), np.array([saturated]))
        return row.log._replace(commands=logged), actuation._replace(commands=commands)

    def _specific_force(self, motion: VehicleState) -> Vector:
        """Return the specific force in calm air, used where no IMU measures it."""
        properties, rotors = self._scene.airframe
        thrust = motors.collective_thrust(rotors, motion.thrusts)
        environment = EnvironmentParameters(self._scene.gravity, ZERO)
        return specific_force(properties, environment, motion.body, thrust)


def _outside_row(signals: Signals) -> OutsideRow:
    row, imu = log_row(signals), signals.find(ImuState)
    specific_force = () if imu is None else imu.sample.specific_force
    firmware = FirmwareInputs(gyro(signals), specific_force, row.rate_setpoint) if row.rate_setpoint else ()
    return OutsideRow(row, signals.of(Actuation), firmware)


def _with_motion(inputs: LoopInput, motion: VehicleState) -> LoopInput:
    """Return the inputs of a tick with the plant's motion, which is the input of the first component."""
    return inputs._replace(own=(tree_map(np.float64, motion), *inputs.own[1:]))


def _scene(setup: FlightSetup, gates: tuple[Gate, ...]) -> PlantScene:
    airframe = first_numbers(setup.parts[-1].parameters.airframe)
    body = Ellipsoid(setup.fleet.semi_axes[0], setup.fleet.body_centres[0])
    place = setup.environment
    return PlantScene(airframe, place.gravity, place.ground, body, gates, place.obstacles)
