"""The rigid body flown open loop by a trajectory's own wrench, integrated by SciPy."""

import numpy as np
from numpy.polynomial import chebyshev
from scipy.integrate import solve_ivp

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment import Environment
from aerobat.flatness import reference
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle

DEGREE = 64  # of the interpolated wrench on each segment, which bends much where the thrust is small
NODES = chebyshev.chebpts1(DEGREE + 1)


def replayed(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> tuple[Array, Array]:
    """Position and velocity at the end, each (3,), of (3) and (4) without feedback."""
    end = replayed_at_knots(trajectory, vehicle, environment)[-1]
    return end[:3], end[3:6]


def replayed_at_knots(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> Array:
    """Position, velocity, rotation matrix and body rates at the knots, (K + 1, 18), without feedback."""
    first = reference(trajectory, vehicle, [0.0], environment=environment).setpoint
    attitude = so3.rotate(first.q_world_body[0], np.eye(3)).T
    x = np.concatenate(
        [first.flat.position[0], first.flat.velocity[0], attitude.ravel(), first.omega_body[0]]
    )
    states = [x]
    for duration, fit in zip(trajectory.durations, _wrenches(trajectory, vehicle, environment), strict=True):

        def rate(t, x, fit=fit, duration=duration):
            return _rate(x, chebyshev.chebval(2 * t / duration - 1, fit), vehicle, environment)

        x = solve_ivp(rate, (0.0, duration), x, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        states.append(x)
    return np.array(states)


def _wrenches(trajectory: Trajectory, vehicle: Vehicle, environment: Environment) -> list[Array]:
    """Thrust and moment of the rotors' thrusts as Chebyshev series on each segment, (65, 4) each."""
    times = trajectory.knots[:-1, None] + trajectory.durations[:, None] * (1 + NODES) / 2
    thrusts = reference(trajectory, vehicle, times.ravel(), environment=environment).rotor_thrusts
    values = (thrusts @ vehicle.allocation.T).reshape(*times.shape, 4)
    return [chebyshev.chebfit(NODES, segment, DEGREE) for segment in values]


def _rate(x: Array, wrench: Array, vehicle: Vehicle, environment: Environment) -> Array:
    v, R, omega = x[3:6], x[6:15].reshape(3, 3), x[15:]
    force = np.array([0.0, 0.0, wrench[0]]) - vehicle.drag_body * (R.T @ (v - environment.wind))
    acceleration = R @ force / vehicle.mass - environment.weight
    turning = np.cross(omega, np.eye(3)).T
    torque = wrench[1:] - np.cross(omega, vehicle.inertia @ omega)
    return np.concatenate([v, acceleration, (R @ turning).ravel(), np.linalg.solve(vehicle.inertia, torque)])
