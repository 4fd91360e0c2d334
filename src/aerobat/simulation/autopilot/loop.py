"""The loop of vehicles under an autopilot's controller, with references from outside."""

from __future__ import annotations

import numpy as np

from aerobat.control.parameters import controller_parameters, hover_authority
from aerobat.environment import Environment
from aerobat.kernels.control_loops import ReferencePoint
from aerobat.kernels.rigid_body import Body
from aerobat.simulation.autopilot.attitude_law import Authority
from aerobat.simulation.autopilot.controller import AutopilotController, AutopilotModel, Guidance
from aerobat.simulation.components import StateObserver
from aerobat.simulation.loop import LoopInput, LoopPart, StepClock
from aerobat.simulation.setup import LoopSetup, plant_part
from aerobat.vehicle import Vehicle
from aerobat.vehicle.fleet import Fleet

RATE = 500.0  # [1/s] of the controller and the plant
# delays that a position loop towards points must allow for: its bandwidth is lower where they are longer
_LINEAR_ERROR = 0.3  # [rad] tilt error that must not saturate rotors
_LAG_FRACTION = 0.6  # [-] fraction of the rotors' lag that counts: the attitude loop's lead covers the rest

# [s] for which commanded rates are kept without a newer command; then the attitude is held
COMMAND_HOLD_TIME = 0.04


def autopilot_setup(start: Body, vehicle: Vehicle, environment: Environment) -> LoopSetup:
    """Return the loop of copies of a vehicle, one for each initial state, leaves (copies,)."""
    copies = len(start.position[0])
    fleet = Fleet.of([vehicle] * copies)
    tracking = controller_parameters(vehicle.controller, fleet, environment)
    accelerations = hover_authority(fleet, environment)
    # at most that of roll and pitch, since turning about both at once shares these accelerations
    authority = Authority(
        accelerations[:, :2].min(axis=-1), accelerations.min(axis=-1), fleet.lags.max(axis=-1)
    )
    with np.errstate(invalid="ignore"):  # vehicles that cannot hover have no bandwidth
        bandwidth = np.sqrt(authority.tilt / _LINEAR_ERROR)
    slewing = 1.0 / bandwidth + _LAG_FRACTION * authority.lag
    model = AutopilotModel(tracking, authority, upright=vehicle.controller.gains(1.0 / slewing))
    controller = AutopilotController(vehicle.controller.feature_flags)
    parts = LoopPart(StateObserver()), LoopPart(controller, model), plant_part(fleet, environment, RATE)
    return LoopSetup(start, parts)


def autopilot_inputs(references: ReferencePoint, by_attitude: bool, upright: bool = True) -> LoopInput:
    """Return the loop's inputs for as many ticks as there are references, leaves (T, ...).

    Args:
        references: the references to follow.
        by_attitude: whether attitude, body rates and thrust are commanded, or position.
        upright: if position is commanded, whether the vehicle's tilt is limited on the way.
    """
    ticks = len(references.position[0])
    period = np.full(ticks, 1.0 / RATE)
    own = ((), Guidance(np.full(ticks, float(by_attitude)), np.full(ticks, float(upright))), ())
    return LoopInput(StepClock(period, period), ((), (), ()), references, own)
