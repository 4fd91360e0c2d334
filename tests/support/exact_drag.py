"""Flatness with drag of its own along each body axis, by an ODE of the attitude that knows none of ours.

Along a given path m (a + g e3) = R (T e3 − D Rᵀ u) with the airspeed u. Its time derivative is, in body axes,
linear in ω_x, ω_y and T' of a body with ω_z = 0, which drive R' = R [ω]×.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from aerobat import so3
from aerobat.environment import Environment
from aerobat.trajectory import Trajectory
from aerobat.vehicle import Vehicle, mixer

EDGE = 3  # samples at either end of a segment, where differences of differences are one-sided


@dataclass(frozen=True)
class Exact:
    """What flies a path, at T samples."""

    times: np.ndarray
    q: np.ndarray  # (T, 4), of either sign
    omega: np.ndarray  # [rad/s] (T, 3)
    thrust: np.ndarray  # [N] (T,)
    lacking: np.ndarray  # [m/s²] of the law of motion, across the thrust, (T,)
    moment: np.ndarray  # [N·m] (T, 3)
    rotors: np.ndarray  # [N] (T, n)
    commands: np.ndarray  # [N] (T, n)


def exact(
    trajectory: Trajectory, vehicle: Vehicle, environment: Environment, start: np.ndarray, count: int
) -> Exact:
    """The motion of a vehicle that begins with the attitude `start`, at about `count` samples.

    Each segment has samples of its own, so that differences know no jumps; its very ends are left out.
    """
    parts, attitude = [], so3.axes(start).ravel()
    for begin, duration, coefficients in zip(
        trajectory.knots[:-1], trajectory.durations, trajectory.coefficients, strict=True
    ):
        path = _Path(vehicle, environment, duration, coefficients)
        times = np.linspace(0.0, duration, max(int(count * duration / trajectory.duration), 20))
        solved = solve_ivp(
            path.rate, (0.0, duration), attitude, method="DOP853", dense_output=True, rtol=1e-10, atol=1e-11
        )
        attitude = solved.y[:, -1]
        rows = begin + times, *path.loads(times, solved.sol(times).T.reshape(-1, 3, 3))
        parts.append(tuple(row[EDGE:-EDGE] for row in rows))
    return Exact(*(np.concatenate(field) for field in zip(*parts, strict=True)))


class _Path:
    """A segment of a path and what flies it."""

    def __init__(self, vehicle, environment, duration, coefficients):
        self.vehicle, self.wind = vehicle, environment.wind
        self.weight = np.array([0.0, 0.0, environment.gravity])
        powers = coefficients / duration ** np.arange(len(coefficients))[:, None]
        self.rates = []
        for _ in range(3):
            powers = np.arange(1, len(powers))[:, None] * powers[1:]
            self.rates.append(powers if len(powers) else np.zeros((1, 3)))

    def turning(self, t, R):
        """ω, T and what the law of motion lacks across the thrust; t (...), R (..., 3, 3)."""
        m, drag = self.vehicle.mass, self.vehicle.drag_body
        t = np.asarray(t)[..., None]
        velocity, acceleration, jerk = (t ** np.arange(len(rate)) @ rate for rate in self.rates)

        def body(vector):
            return (vector[..., None, :] @ R)[..., 0, :]

        air, accelerated = body(velocity - self.wind), body(acceleration)
        force = m * (accelerated + body(self.weight + 0.0 * velocity)) + drag * air  # should be T e3
        # m Rᵀ j = ω × (T e3 − D u) + T' e3 − D (Rᵀ a − ω × u), of which T' is of no interest
        known = m * body(jerk) + drag * accelerated
        thrust = force[..., 2]
        lifting = thrust - drag[2] * air[..., 2]
        omega = np.zeros_like(air)
        omega[..., 0] = -known[..., 1] / (lifting + drag[1] * air[..., 2])
        omega[..., 1] = known[..., 0] / (lifting + drag[0] * air[..., 2])
        return omega, thrust, np.linalg.norm(force[..., :2], axis=-1) / m

    def rate(self, t, flat):
        R = flat.reshape(3, 3)
        (x, y, _), *_ = self.turning(t, R)
        return (R @ np.array([[0.0, 0.0, y], [0.0, 0.0, -x], [-y, x, 0.0]])).ravel()

    def loads(self, times, R):
        """What `Exact` holds beside the times."""
        vehicle = self.vehicle
        omega, thrust, lacking = self.turning(times, R)
        omega_dot = np.gradient(omega, times, axis=0, edge_order=2)
        moment = omega_dot @ vehicle.inertia + np.cross(omega, omega @ vehicle.inertia)
        rotors = np.column_stack([thrust, moment]) @ mixer(vehicle).T
        commands = rotors + vehicle.lags * np.gradient(rotors, times, axis=0, edge_order=2)
        q = Rotation.from_matrix(R).as_quat(scalar_first=True)
        return q, omega, thrust, lacking, moment, rotors, commands
