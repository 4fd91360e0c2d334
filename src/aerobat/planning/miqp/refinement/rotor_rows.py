"""What a vehicle can do along a path, and its slopes: rotor thrusts, their commands, thrust and body rate.

In body axes that are carried with the thrust axis by the smallest rotation from those of the path as it is:
exact where the path is met, and exact to first order beside it. Slopes come from a complex step, which knows
no cancellation (Squire and Trapp, "Using complex variables to estimate derivatives of real functions", 1998).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array, Indices
from aerobat.environment import Environment
from aerobat.flatness import axial_drag, lateral_drag
from aerobat.flatness.parallel_transport import frames
from aerobat.flatness.references import UNDETERMINED, specific_thrust
from aerobat.kernels import flatness as kernel
from aerobat.kernels.ops import Vector
from aerobat.kernels.vectors import dot, scale
from aerobat.vehicle import Vehicle, mixer

MIN_THRUST = 0.05  # of gravity: specific thrust is kept above, lest the attitude be undetermined
COMPLEX_STEP = 1e-20
TINY = 1e-18  # [rad²/s²] beside the square of a rate, which a body at rest has with a slope
MOVING = slice(1, 6)  # velocity to crackle: what thrusts depend on


@dataclass(frozen=True, eq=False)
class RotorRows:
    """A vehicle's limits as constraints c ≤ 0 on a path's derivatives, each as a fraction of its range."""

    vehicle: Vehicle
    environment: Environment
    heading: float  # [rad]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the constraints, each in a few words."""
        rotors = range(len(self.vehicle.rotors))
        kinds = ["thrust", "command"] if self.vehicle.lags.any() else ["thrust"]
        sides = (f"the {kind} of rotor {i} is" for kind in kinds for _ in ("low", "high") for i in rotors)
        return (*sides, "the collective thrust is next to nothing,", "the body rate is")

    @property
    def count(self) -> int:
        """The number of constraints."""
        return len(self._linear[1])

    def frames(self, times: Array, derivatives: Array) -> Array:
        """Body axes in the world, as columns, (m, 3, 3), along a path's derivatives (m, 6, 3)."""
        velocity, acceleration, jerk, snap = np.moveaxis(derivatives[:, 1:5], 1, 0)
        airspeed = velocity - self.environment.wind
        thrust = specific_thrust(self.vehicle, self.environment, airspeed, acceleration, jerk, snap)
        path = frames(times, thrust, UNDETERMINED * self.environment.gravity, self.heading)
        return so3.axes(path.q_world_body[path.samples])

    def values(self, derivatives: Array, frames: Array) -> Array:
        """The constraints at derivatives (m, 6, 3), (m, c), infinite where thrust is against its frame."""
        weights, offsets = self._linear
        with np.errstate(divide="ignore", invalid="ignore"):
            values = self._demands(self._moving(derivatives) @ frames, frames) @ weights.T + offsets
        return np.where(np.isnan(values), np.inf, values)

    def slopes(self, derivatives: Array, frames: Array, place: Indices, column: Indices) -> Array:
        """Slopes of some constraints by the derivatives at their places, (q, 6, 3).

        Args:
            derivatives: Of the path, (m, 6, 3).
            frames: Body axes there, (m, 3, 3).
            place: Where each of the constraints is looked at, (q,).
            column: Which one it is, (q,).
        """
        looked_at = np.zeros(len(frames), dtype=bool)
        looked_at[place] = True
        frames = frames[looked_at]
        local = self._moving(derivatives[looked_at]) @ frames
        directions = np.eye(15).reshape(15, 1, 5, 3)
        demands = self._demands(local + 1j * COMPLEX_STEP * directions, frames)
        by_local = np.moveaxis(demands.imag / COMPLEX_STEP, 0, -1).reshape(*demands.shape[1:], 5, 3)
        by_world = (by_local @ np.swapaxes(frames, -1, -2)[:, None]).reshape(*demands.shape[1:], 15)
        slopes = np.zeros((len(place), 6, 3))
        index = looked_at.cumsum()[place] - 1
        slopes[:, MOVING] = (self._linear[0][column, None] @ by_world[index]).reshape(len(place), 5, 3)
        return slopes

    def _moving(self, derivatives: Array) -> Array:
        """Airspeed, acceleration, jerk, snap and crackle, (m, 5, 3)."""
        moving = derivatives[:, MOVING].copy()
        moving[:, 0] -= self.environment.wind
        return moving

    def _demands(self, moving: Any, frames: Array) -> Any:
        """What constraints are linear in, of airspeed to crackle in body axes (..., m, 5, 3), (..., m, 10).

        Collective thrust and moment, their derivatives, the specific thrust and the body rate.
        """
        drag = lateral_drag(self.vehicle)
        airspeed, acceleration, jerk, snap, crackle = np.moveaxis(moving, -2, 0)
        weight = self.environment.weight @ frames
        f, f1, f2 = kernel.specific_thrust(weight, drag, airspeed, acceleration, jerk, snap)
        vectors = [_components(x) for x in (f, f1, f2, crackle + drag * snap, airspeed, acceleration)]
        norm = np.sqrt(dot(vectors[0], vectors[0]))
        b3, *rates = (scale(1.0 / norm, vector) for vector in vectors[:4])
        turning = kernel.turning(b3, *rates)
        rate = np.sqrt(dot(turning[0], turning[0]) + TINY)
        return np.stack([*self._wrenches(b3, norm, vectors, turning), norm, rate], axis=-1)

    @cached_property
    def _linear(self) -> tuple[Array, Array]:
        """Weights (c, 10) and offsets (c,) of the constraints, of what they are linear in."""
        vehicle, inverse = self.vehicle, mixer(self.vehicle)
        low, high = vehicle.min_thrusts, vehicle.max_thrusts
        span = high - low
        thrusts = np.concatenate([inverse, np.zeros_like(inverse)], axis=1) / span[:, None]
        commands = np.concatenate([inverse, vehicle.lags[:, None] * inverse], axis=1) / span[:, None]
        rotors = [-thrusts, thrusts]
        offsets = [low / span, -high / span]
        if vehicle.lags.any():
            rotors += [-commands, commands]
            offsets *= 2
        others = np.diag([-1.0 / self.environment.gravity, 1.0 / vehicle.max_body_rate])
        other_offsets = np.array([MIN_THRUST, -1.0])
        kept = 1 + np.isfinite(vehicle.max_body_rate)
        rows = np.concatenate(rotors)
        weights = np.zeros((len(rows) + kept, 10))
        weights[: len(rows), :8] = rows
        weights[len(rows) :, 8:] = others[:kept]
        return weights, np.concatenate([*offsets, other_offsets[:kept]])

    def _wrenches(
        self, b3: Vector, norm: Any, vectors: list[Vector], turning: tuple[Vector, ...]
    ) -> tuple[Any, ...]:
        """Collective thrust and moment, then their derivatives, (..., m) each.

        Args:
            b3: the thrust axis.
            norm: of the specific thrust.
            vectors: specific thrust, its first three derivatives, airspeed and acceleration.
            turning: the body rates and their first two derivatives.
        """
        mass, axial, inertia = self.vehicle.mass, axial_drag(self.vehicle), self.vehicle.inertia.tolist()
        _, f1, _, _, airspeed, acceleration = vectors
        local = [(*kernel.tilted(b3, vector), 0.0 * norm) for vector in turning]
        thrust = kernel.collective(mass, axial, norm, b3, airspeed)
        thrust_rate = kernel.collective_rate(mass, axial, b3, (norm, f1), (airspeed, acceleration))
        moment, moment_rate = kernel.moment_and_rate(inertia, *local)
        return thrust, *moment, thrust_rate, *moment_rate


def _components(vectors: Any) -> Vector:
    return vectors[..., 0], vectors[..., 1], vectors[..., 2]
