"""The loop of vehicles under an autopilot's controller, whose references come from outside."""

from __future__ import annotations

import numpy as np

from aerobat.control.parameters import controller_parameters, hover_authority, max_bandwidth
from aerobat.environment import Environment
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.autopilot.attitude_law import Authority
from aerobat.simulation.autopilot.controller import AutopilotController, AutopilotModel, Guidance
from aerobat.simulation.components import StateObserver
from aerobat.simulation.loop import LoopInput, StepClock
from aerobat.simulation.setup import LoopPart, LoopSetup, plant_part
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

RATE = 500.0  # [1/s] of the controller and the plant
# what a position loop towards points has to wait for, slower where that takes longer
_FREE_ERROR = 0.3  # [rad] of tilt that must not saturate rotors
_LAG_COUNTED = 0.6  # [-] of the rotors' lag, which the attitude loop's lead makes up for while it is not

KEPT = 0.04  # [s] for which commanded rates are kept where nothing newer comes; then the attitude is


def autopilot_setup(start: Body, vehicle: Vehicle, environment: Environment) -> LoopSetup:
    """The loop of as many copies of a vehicle as there are states at first, leaves (copies,)."""
    copies = len(start.position[0])
    fleet = Fleet.of([vehicle] * copies)
    tracking = controller_parameters(vehicle.controller, fleet, environment)
    accelerations = hover_authority(fleet, environment)
    # of yaw no more than of roll and pitch: turning about both at once takes of these
    authority = Authority(
        accelerations[:, :2].min(axis=-1), accelerations.min(axis=-1), fleet.lags.max(axis=-1)
    )
    slewing = 1.0 / max_bandwidth(fleet, environment, _FREE_ERROR) + _LAG_COUNTED * fleet.lags.max(axis=-1)
    model = AutopilotModel(tracking, authority, upright=vehicle.controller.gains(1.0 / slewing))
    controller = AutopilotController(vehicle.controller.feature_flags)
    parts = LoopPart(StateObserver()), LoopPart(controller, model), plant_part(fleet, environment, RATE)
    return LoopSetup(start, parts)


def autopilot_inputs(references: ReferencePoint, by_attitude: bool, upright: bool = True) -> LoopInput:
    """Inputs of as many ticks as there are references, leaves (T, ...).

    Args:
        references: what is followed.
        by_attitude: whether their attitude, rates and thrust are commanded, or their position.
        upright: of positions, whether the vehicle stays upright on the way.
    """
    ticks = len(references.position[0])
    period = np.full(ticks, 1.0 / RATE)
    own = ((), Guidance(np.full(ticks, float(by_attitude)), np.full(ticks, float(upright))), ())
    return LoopInput(StepClock(period, period), ((), (), ()), references, own)
