"""Poses over time, as figures draw them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.flatness import Reference, reference
from aerobat.planning import Plan
from aerobat.problem.gate import Gate
from aerobat.simulation import Flight
from aerobat.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class PoseHistory:
    """The actual or planned poses of a vehicle over time."""

    times: Array  # [s], (T,)
    position: Array  # [m], (T, 3)
    q_world_body: Array  # (T, 4)

    @property
    def path(self) -> Array:
        """The path with 480 vertices at most [m], (n, 3)."""
        stride = max(1, len(self.times) // 240)
        return np.concatenate([self.position[:-1:stride], self.position[-1:]])

    @property
    def extent(self) -> float:
        """The longest side of the box around the path [m]."""
        return float(np.ptp(self.position, axis=0).max())

    def rows(self, times: Sequence[float] | Array) -> list[int]:
        """Return the first rows at or after `times` [s]."""
        rows = np.searchsorted(self.times, np.asarray(times, dtype=float) - 1e-9)
        return [int(k) for k in rows.clip(0, len(self.times) - 1)]

    def rows_at_gates(self, gates: Sequence[Gate]) -> list[int]:
        """Return the row at which the vehicle is nearest to the centre of each gate."""
        return [int(np.linalg.norm(self.position - gate.position, axis=-1).argmin()) for gate in gates]

    def until_astray(self, reference: PoseHistory) -> PoseHistory:
        """Return the poses until their error exceeds half of the reference's extent, at the same times."""
        error = np.linalg.norm(self.position - reference.position, axis=-1)
        stray = np.flatnonzero(error > 0.5 * max(reference.extent, 1.0))
        end = max(int(stray[0]), 2) if len(stray) else len(self.times)
        return PoseHistory(self.times[:end], self.position[:end], self.q_world_body[:end])


def is_flat(positions: Array) -> bool:
    """Return True if a path (T, 3) is much longer than high."""
    extents = np.ptp(positions, axis=0)
    return bool(extents[2] < 0.3 * extents.max())


def plan_reference(plan: Plan, vehicle: Vehicle) -> Reference:
    """Return the reference of a plan for a vehicle, sampled for drawing."""
    return reference(plan, vehicle, rate=250.0)


def reference_poses(reference: Reference | Flight) -> PoseHistory:
    """Return the poses of a reference, or of the set-points of a flight."""
    setpoint = reference.setpoint
    return PoseHistory(reference.times, setpoint.flat.position, setpoint.q_world_body)


def actual_poses(flight: Flight) -> list[PoseHistory]:
    """Return the poses of each vehicle of a flight, or of a batch, until it is far from its reference."""
    planned = reference_poses(flight)
    positions = flight.states.position.reshape(-1, *planned.position.shape)
    attitudes = flight.states.q_world_body.reshape(-1, *planned.q_world_body.shape)
    poses = zip(positions, attitudes, strict=True)
    return [PoseHistory(flight.times, p, q).until_astray(planned) for p, q in poses]
