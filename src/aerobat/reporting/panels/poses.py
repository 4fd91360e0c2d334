"""One vehicle's motion as figures draw it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.arrays import Array
from aerobat.flatness import Reference, reference
from aerobat.flight import Flight
from aerobat.planning import Plan
from aerobat.problem.gate import Gate
from aerobat.vehicle import Vehicle

RATE = 250.0  # [1/s] at which a plan is shown
VERTICES = 240  # of a drawn path
FAR = 0.5  # of the planned path's extent: where a flight strays further, it is drawn no more


@dataclass(frozen=True, eq=False)
class PoseHistory:
    """Where a vehicle is, or shall be, over time."""

    times: Array  # [s], (T,)
    position: Array  # [m], (T, 3)
    q_world_body: Array  # (T, 4)

    @property
    def path(self) -> Array:
        """The path with few vertices [m], (n, 3)."""
        stride = max(1, len(self.times) // VERTICES)
        return np.concatenate([self.position[:-1:stride], self.position[-1:]])

    @property
    def extent(self) -> float:
        """The longest side of the box around the path [m]."""
        return float(np.ptp(self.position, axis=0).max())

    def passage(self, gate: Gate | None) -> float:
        """The time [s] at which the vehicle is nearest to a gate; the start without one."""
        if gate is None:
            return float(self.times[0])
        return float(self.times[np.linalg.norm(self.position - gate.position, axis=-1).argmin()])

    def near(self, planned: PoseHistory) -> PoseHistory:
        """The motion up to where it strays far from the planned one, taken at the same times."""
        error = np.linalg.norm(self.position - planned.position, axis=-1)
        stray = np.flatnonzero(error > FAR * max(planned.extent, 1.0))
        end = max(int(stray[0]), 2) if len(stray) else len(self.times)
        return PoseHistory(self.times[:end], self.position[:end], self.q_world_body[:end])


def plan_reference(plan: Plan, vehicle: Vehicle) -> Reference:
    """What a plan asks of a vehicle from start to goal, sampled for drawing."""
    return reference(plan.trajectory, vehicle, rate=RATE, environment=plan.problem.environment)


def reference_poses(asked: Reference | Flight) -> PoseHistory:
    """The motion that a reference asks, or that was asked of a flight for as long as it lasted."""
    return PoseHistory(asked.times, asked.setpoint.flat.position, asked.setpoint.q_world_body)


def actual_poses(flight: Flight) -> list[PoseHistory]:
    """What each vehicle of a flight, or of a batch, did before it went astray."""
    asked = reference_poses(flight)
    positions = flight.states.position.reshape(-1, *asked.position.shape)
    attitudes = flight.states.q_world_body.reshape(-1, *asked.q_world_body.shape)
    return [PoseHistory(flight.times, p, q).near(asked) for p, q in zip(positions, attitudes, strict=True)]
