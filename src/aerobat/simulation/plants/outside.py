"""The loop with a plant outside of it: the rest is compiled as ever, and stepped tick by tick."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerobat.engines.floats import first_numbers
from aerobat.engines.pytree import tree_map, tree_stack
from aerobat.errors import SpecError
from aerobat.kernels.motors import VehicleState
from aerobat.kernels.ops import Ops
from aerobat.problem.gate import Gate
from aerobat.simulation.components import (
    LogRow,
    PlantParameters,
    commands_in_effect,
    log_row,
    with_ceiling,
    with_wind,
)
from aerobat.simulation.loop import Controlling, LoopInput, Signals
from aerobat.simulation.plants.plant import Actuation, Plant, PlantScene
from aerobat.simulation.setup import FlightSetup, LoopPart
from aerobat.vehicle.ellipsoid import Ellipsoid


@dataclass(frozen=True)
class OutsidePlant:
    """A plant that the loop is told of at every tick; its parameters are those of the vehicle's model."""

    period: int = 1
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: PlantParameters, inputs: VehicleState, signals: Signals
    ) -> VehicleState:
        """See `Component.init`."""
        return inputs

    def step(
        self,
        ops: Ops,
        parameters: PlantParameters,
        state: VehicleState,
        inputs: VehicleState,
        signals: Signals,
    ) -> VehicleState:
        """See `Component.step`."""
        return inputs


@dataclass(frozen=True)
class Actuator:
    """The inputs of the plant outside: commands, wind, and the rotors' limits as the battery leaves them."""

    period: int = 1
    feedthrough: bool = True

    def init(self, ops: Ops, parameters: PlantParameters, inputs: tuple[()], signals: Signals) -> Actuation:
        """See `Component.init`."""
        thrusts = signals.controller.commands.thrusts
        return Actuation(thrusts, parameters.environment.wind, parameters.airframe.rotors.max_thrust)

    def step(
        self, ops: Ops, parameters: PlantParameters, state: Actuation, inputs: tuple[()], signals: Signals
    ) -> Actuation:
        """See `Component.step`."""
        return Actuation(
            commands_in_effect(signals),
            with_wind(parameters.environment, signals).wind,
            with_ceiling(ops, parameters.airframe, signals).rotors.max_thrust,
        )


class OutsideRow(NamedTuple):
    """The row that a tick logs, and the actuation that the plant outside is told."""

    log: LogRow
    actuation: Actuation


def fly_outside(
    setup: FlightSetup, plant: Plant, gates: tuple[Gate, ...]
) -> tuple[LogRow, NDArray[np.int64]]:
    """Rows of all ticks with leaves (1, ticks), and what was touched before each, by the codes of Contact.

    Args:
        setup: of one vehicle.
        plant: that takes the place of the rigid body.
        gates: that it may touch.

    Raises:
        SpecError: there are several vehicles, or the plant cannot fly this one.
        BackendMissing: the plant's simulator is not installed.
    """
    if len(setup.fleet) != 1:
        raise SpecError(f"plant: {plant.kind} flies one vehicle at a time, not {len(setup.fleet)}")
    parameters: PlantParameters = setup.parts[-1].parameters
    parts = (LoopPart(OutsidePlant()), *setup.parts[:-1], LoopPart(Actuator(), parameters))
    inside = replace(setup, parts=parts)
    motion = VehicleState(
        first_numbers(setup.start), tuple(0.0 for _ in parameters.airframe.rotors.max_thrust)
    )
    first = _told(inside.first_tick, motion)
    loop = inside.compile_for(inside.engine(), first, _outside_row)
    carry = loop.init(first)
    controller = next(state for state in carry if isinstance(state, Controlling))
    run = plant.begin(_scene(setup, gates), motion._replace(thrusts=first_numbers(controller.thrusts)))
    rows, touched = [], np.zeros(len(setup.times), dtype=np.int64)
    for tick, period in enumerate(np.diff(setup.times, append=setup.times[-1]).tolist()):
        carry, row = loop.step(carry, _told(inside.tick(tick), run.motion))
        rows.append(row.log)
        touched[tick] = run.contact
        if period > 0.0:
            run.advance(first_numbers(row.actuation), period)
    return tree_stack(rows, lambda parts: np.stack(parts, axis=-1)), touched


def _outside_row(signals: Signals) -> OutsideRow:
    return OutsideRow(log_row(signals), signals.of(Actuation))


def _told(inputs: LoopInput, motion: VehicleState) -> LoopInput:
    """The inputs of a tick with the plant's motion, which is the first component's."""
    return inputs._replace(own=(tree_map(np.float64, motion), *inputs.own[1:]))


def _scene(setup: FlightSetup, gates: tuple[Gate, ...]) -> PlantScene:
    fleet, environment = setup.fleet, setup.environment
    return PlantScene(
        airframe=first_numbers(setup.parts[-1].parameters.airframe),
        gravity=environment.gravity,
        ground=environment.ground,
        body=Ellipsoid(fleet.semi_axes[0], fleet.body_centres[0]),
        gates=gates,
    )
