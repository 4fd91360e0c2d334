"""Kernel parameters of vehicles, settings and environment, for many vehicles at once."""

from __future__ import annotations

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.pytree import components, matrix_components
from aerobat.environment import Environment
from aerobat.kernels.allocation import Mixer
from aerobat.kernels.control import ControllerModel
from aerobat.kernels.motors import Airframe, Rotors
from aerobat.kernels.rigid_body import EnvironmentParameters, MassProperties
from aerobat.vehicle.controller import Controller
from aerobat.vehicle.fleet import Fleet

FREE_ERROR = 0.06  # [rad] attitude error that must not saturate a hovering vehicle's rotors
_SLACK = 1e-12  # [-] of a rotor's range, tolerance for rounding
_MIN_TIME_CONSTANT = 1e-9  # [s] time constant of a rotor without lag


def airframe_parameters(fleet: Fleet, effectiveness: Array | None = None) -> Airframe:
    """Return airframes with leaves (vehicles,).

    With an `effectiveness` (vehicles, n), thrusts are those of nominal rotors, and their effect on the body
    is multiplied by it.
    """
    mass_properties = MassProperties(
        fleet.mass,
        matrix_components(fleet.inertia),
        matrix_components(np.asarray(np.linalg.inv(fleet.inertia))),
        components(fleet.drag_body),
    )
    ranges = fleet.max_thrusts - fleet.min_thrusts
    ranges = np.where(ranges > 0.0, ranges, ranges.max(axis=-1, keepdims=True))  # dead rotors have no range
    allocation = fleet.allocation if effectiveness is None else fleet.allocation * effectiveness[:, None]
    rotors = Rotors(
        components(fleet.min_thrusts),
        components(fleet.max_thrusts),
        components(_SLACK * ranges),
        components(1.0 / np.maximum(fleet.lags, _MIN_TIME_CONSTANT)),
        matrix_components(allocation),
    )
    return Airframe(mass_properties, rotors)


def environment_parameters(environment: Environment, vehicles: int) -> EnvironmentParameters:
    """Return one environment for all vehicles, leaves (vehicles,)."""
    wind = np.broadcast_to(environment.wind, (vehicles, 3))
    return EnvironmentParameters(np.full(vehicles, environment.gravity), components(wind))


def controller_parameters(controller: Controller, fleet: Fleet, environment: Environment) -> ControllerModel:
    """Return nominal models with leaves (vehicles,).

    Args:
        controller: the controller's settings.
        fleet: the nominal vehicles.
        environment: the nominal environment.
    """
    rows = matrix_components(np.swapaxes(fleet.mixer, 1, 2))
    return ControllerModel(
        airframe_parameters(fleet),
        environment_parameters(environment, len(fleet)),
        Mixer(*rows, *components(fleet.collective_range)),
        controller.gains(max_bandwidth(fleet, environment)),
    )


def max_bandwidth(fleet: Fleet, environment: Environment) -> Array:
    """Return the highest bandwidth [rad/s] of attitude loops that the rotors allow, (vehicles,).

    In hover the rotors then saturate only at errors of roll or pitch above FREE_ERROR. Rotors that lag by
    more than the inverse of that bandwidth allow its geometric mean with the inverse of their lag: commands
    that lead a lag are larger. The value is NaN for a vehicle that cannot hover.
    """
    with np.errstate(invalid="ignore"):
        saturating = np.sqrt(hover_authority(fleet, environment)[:, :2].min(axis=-1) / FREE_ERROR)
    lag = np.maximum(fleet.lags.max(axis=-1), _MIN_TIME_CONSTANT)
    return np.asarray(np.minimum(saturating, np.sqrt(saturating / lag)))


def hover_authority(fleet: Fleet, environment: Environment) -> Array:
    """Return the angular accelerations [rad/s²] about body axes possible in hover, (vehicles, 3)."""
    hover = (fleet.mass * environment.gravity)[:, None] * fleet.mixer[..., 0]
    room = np.minimum(hover - fleet.min_thrusts, fleet.max_thrusts - hover)
    torque = (np.abs(fleet.allocation[:, 1:]) @ room[..., None])[..., 0]
    return np.asarray(torque / np.diagonal(fleet.inertia, axis1=1, axis2=2))
