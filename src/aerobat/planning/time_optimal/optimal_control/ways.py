"""The way of the body through a gate, clear of its frame from before the plane until it is behind it.

A stage asks where the centre of mass is at one instant. The body is about the plane for a while, and passes
the opening if it flies on much as it flies there. With v_n along the normal and v_a along a side of the
opening, d its reach and more before and behind the plane, s what it reaches along that side as it is turned,
and r the room that is left of half the opening from where it crosses, |path − straight line| ≤ ½ a (d/v_n)²:

    (r − s) v_n ± d v_a ≥ ½ a d²/v_n    on both sides    and    v_n² ≥ 2 a d,

so that it does not turn back. The body is an ellipsoid with its semi-axes on the diagonal of D and the
attitude R, so that s = |D Rᵀ e| along e.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from aerobat.arrays import Array
from aerobat.certification import PlannedPassage
from aerobat.planning.result import OwnFlight
from aerobat.planning.time_optimal.optimal_control.collocation import Mesh
from aerobat.planning.time_optimal.optimal_control.elements import Elements
from aerobat.planning.time_optimal.optimal_control.rows import Rows
from aerobat.problem.gate import Gate
from aerobat.problem.problem import Problem
from aerobat.problem.stage import Stage
from aerobat.simulation.passages import PASSAGE_DEPTH
from aerobat.vehicle import Vehicle

FRAME_CLEARANCE = 0.01  # [m] from body to frame
BENDING = 0.4  # of the largest specific thrust: the acceleration by which a path may bend there, at first
MORE_BENDING = 1.6  # times that, where the plan's own flight does not pass


@dataclass(frozen=True, eq=False)
class Way:
    """A body's way through the gate that a stage crosses."""

    gate: Gate
    stage: int
    reach: float  # [m] before and behind the plane, over which it counts
    bending: float  # [m/s²] across a straight line, at most

    @property
    def sides(self) -> tuple[Array, Array]:
        """Outward normals of the opening's sides in the world, (K, 3), and how far they are, (K,) [m]."""
        gate, sign = self.gate, np.array([1.0, -1.0])
        outward = np.concatenate([np.outer(sign, axis) for axis in (gate.lateral, gate.up)])
        return outward, np.repeat([gate.width, gate.height], 2) / 2.0 - FRAME_CLEARANCE

    def hold(self, rows: Rows, mesh: Mesh, elements: Elements) -> None:
        """Add the constraints."""
        gate, node = self.gate, int(np.cumsum(mesh.intervals)[self.stage])
        sides = np.array([gate.width, gate.height]) / 2.0 - FRAME_CLEARANCE
        frame = [gate.position, gate.normal, gate.lateral, gate.up]
        way = np.concatenate([*frame, sides, [self.reach, self.bending]])
        lower = np.append(np.zeros(8), sqrt(2.0 * self.bending * self.reach))
        rows.hold(elements.room_ahead, mesh.states[node : node + 1], lower, np.full(9, inf), way)


def ways_through_gates(stages: Sequence[Stage], problem: Problem, vehicle: Vehicle) -> tuple[Way, ...]:
    """The ways through the gates that stages cross.

    Those among stages that do not say where they are have none: a flip in a gate begins and ends where it
    likes.
    """
    reach, bending = vehicle.body_radius + PASSAGE_DEPTH, BENDING * vehicle.max_specific_thrust
    found = []
    for k, stage in enumerate(stages):
        around = stages[max(k - 1, 0) : k + 2]
        if stage.gate is None or any(len(each.where) < 3 for each in around):
            continue
        gate = problem.gate(stage.gate)
        if PlannedPassage.of(stage, gate, 0.0).min_speed > 0.0:
            found.append(Way(gate, k, reach, bending))
    return tuple(found)


def straighter(ways: Sequence[Way], stages: Sequence[Stage], flight: OwnFlight) -> tuple[Way, ...]:
    """The ways, straighter through the gates that a flight along them did not pass.

    Args:
        ways: Through gates that the stages cross.
        stages: In order.
        flight: With a passage for each stage that names a gate.
    """
    crossing = [k for k, stage in enumerate(stages) if stage.gate is not None]
    missed = {k for k, flown in zip(crossing, flight.passages, strict=True) if flown.is_missed}
    return tuple(
        replace(way, bending=MORE_BENDING * way.bending) if way.stage in missed else way for way in ways
    )
