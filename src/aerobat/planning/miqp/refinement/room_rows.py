"""The body's room in gates as constraints with their slopes, at the stages that cross them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerobat.arrays import Array, Indices, xyz
from aerobat.engines.numpy import ArrayOps
from aerobat.limits.body_in_gate import BodyInGate, extent_of_thrust
from aerobat.planning.miqp.refinement.limit_rows import COMPLEX_STEP
from aerobat.planning.miqp.refinement.phases import DERIVATIVES
from aerobat.problem.condition import ForceBalance
from aerobat.vehicle import Ellipsoid

KNOWN = 3  # derivatives that room depends on: position, velocity, acceleration


@dataclass(frozen=True, eq=False)
class RoomRows:
    """Constraints c ≤ 0 on a path's derivatives at its stages, each as a fraction of its size."""

    in_gates: tuple[BodyInGate, ...]
    body: Ellipsoid
    balance: ForceBalance

    def values(self, derivatives: Array) -> Array:
        """The constraints at derivatives (stages, 6, 3), (q,)."""
        return np.array([x for body in self.in_gates for x in self._room(body, derivatives[body.stage])])

    def slopes(self, derivatives: Array) -> tuple[Indices, Array]:
        """The stages of the constraints, (q,), and their slopes by the derivatives there, (q, 6, 3)."""
        step = np.zeros((KNOWN * 3, DERIVATIVES, 3), dtype=complex)
        step[:, :KNOWN] = 1j * COMPLEX_STEP * np.eye(KNOWN * 3).reshape(-1, KNOWN, 3)
        stages: list[int] = []
        slopes = []
        for body in self.in_gates:
            for value in self._room(body, derivatives[body.stage] + step):
                slope = np.zeros((DERIVATIVES, 3))
                slope[:KNOWN] = np.reshape(value.imag / COMPLEX_STEP, (KNOWN, 3))
                stages.append(body.stage)
                slopes.append(slope)
        return np.array(stages, dtype=np.intp), np.array(slopes).reshape(-1, DERIVATIVES, 3)

    def _room(self, body: BodyInGate, derivatives: Any) -> Iterator[Any]:
        """What is missing of the room in one gate, at derivatives (..., 6, 3)."""
        position, velocity, acceleration = np.moveaxis(derivatives[..., :KNOWN, :], -2, 0)
        thrust = acceleration + self.balance.drag * velocity + self.balance.constant
        extent = extent_of_thrust(ArrayOps, self.body, xyz(thrust))
        room = body.opening.room(ArrayOps, xyz(position), xyz(velocity), extent)
        *sides, speed = room
        yield from (-side / (body.gate.opening.inradius * body.min_speed) for side in sides)
        yield -speed / body.min_speed
