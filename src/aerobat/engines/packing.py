"""Between arrays with a last axis of components and the kernels' tuples of components."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from aerobat.arrays import Array
from aerobat.engines.trees import Tree
from aerobat.environment import Environment
from aerobat.kernels.allocation import Mixer
from aerobat.kernels.control import Model
from aerobat.kernels.controller import Controller
from aerobat.kernels.integrator import Airframe
from aerobat.kernels.motors import Rotors
from aerobat.kernels.rigid_body import Body, Inertial
from aerobat.states import BodyState
from aerobat.vehicle import Vehicle
from aerobat.vehicle.allocation import collective_range, mixer

_FREE_ERROR = 0.06  # [rad] of attitude that must not saturate a hovering vehicle's rotors
_SLACK = 1e-12  # [-] of a rotor's range, for rounding
_SHORTEST_LAG = 1e-9  # [s] a rotor without lag follows within it


def components(array: Array) -> Tree:
    """(..., n) -> a tuple of n leaves of shape (...)."""
    return tuple(np.ascontiguousarray(np.moveaxis(array, -1, 0)))


def joined(leaves: Tree) -> Array:
    """n leaves of shape (...) -> (..., n)."""
    return np.stack(leaves, axis=-1)


def bodies(state: BodyState) -> Body:
    """A state with leaves of components."""
    return Body(
        components(state.position),
        components(state.velocity),
        components(state.q_world_body),
        components(state.omega_body),
    )


def body_states(body: Body) -> BodyState:
    """The inverse of `bodies`."""
    return BodyState(*(joined(part) for part in body))


def airframes(vehicles: Sequence[Vehicle], environment: Environment) -> Airframe:
    """What the kernels read of vehicles with as many rotors each; leaves (vehicles,)."""
    inertia = np.array([vehicle.inertia for vehicle in vehicles])
    inertial = Inertial(
        np.array([vehicle.mass for vehicle in vehicles]),
        _matrix(inertia),
        _matrix(np.linalg.inv(inertia)),
        components(np.array([vehicle.drag_body for vehicle in vehicles])),
        np.full(len(vehicles), environment.gravity),
        components(np.broadcast_to(environment.wind, (len(vehicles), 3))),
    )
    lags = np.array([vehicle.lags for vehicle in vehicles])
    rotors = Rotors(
        components(np.array([vehicle.min_thrusts for vehicle in vehicles])),
        components(np.array([vehicle.max_thrusts for vehicle in vehicles])),
        components(_SLACK * np.array([vehicle.max_thrusts - vehicle.min_thrusts for vehicle in vehicles])),
        components(1.0 / np.maximum(lags, _SHORTEST_LAG)),
        _matrix(np.array([vehicle.allocation for vehicle in vehicles])),
    )
    return Airframe(inertial, rotors)


def models(
    controller: Controller, vehicles: Sequence[Vehicle], environment: Environment, ops: Any = np
) -> Model:
    """What a controller believes of vehicles with as many rotors each, and its gains; leaves (vehicles,).

    `ops` are of the arithmetic of the controller's numbers; see `Controller.gains`.
    """
    # vehicle by vehicle: each of these asks for the vehicle's mixer, which is kept for a while
    each = [
        (mixer(vehicle).T, collective_range(vehicle), _agility(vehicle, environment.gravity))
        for vehicle in vehicles
    ]
    columns, level, agility = (np.array(values) for values in zip(*each, strict=True))
    return Model(
        airframes(vehicles, environment),
        Mixer(*_matrix(columns), *components(level)),
        controller.gains(agility, ops),
    )


def _agility(vehicle: Vehicle, gravity: float) -> float:
    """The highest frequency [rad/s] of an attitude loop that a vehicle has the rotors for.

    Hovering, they then meet their limits only at larger errors of roll or pitch than the free one.
    """
    hover = vehicle.mass * gravity * mixer(vehicle)[:, 0]
    room = np.minimum(hover - vehicle.min_thrusts, vehicle.max_thrusts - hover)
    torque = np.abs(vehicle.allocation[1:3]) @ room
    acceleration = torque / np.diag(vehicle.inertia)[:2]
    return float(np.sqrt(acceleration.min() / _FREE_ERROR))


def _matrix(matrices: Array) -> Tree:
    """(vehicles, rows, columns) -> rows of columns of leaves (vehicles,)."""
    return tuple(components(row) for row in np.moveaxis(matrices, 1, 0))
