"""Passages through gates and waypoints, checked at their planned instants.

Path and thrust at one instant are known up to rounding. Solvers satisfy their equations to PASSAGE_TOLERANCE.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.certification.certificate import Finding, Side, Verdict
from aerobat.certification.thrust_curve import ThrustCurve
from aerobat.flatness import force_balance, has_unequal_drag, reference
from aerobat.problem.planned_passage import PlannedPassage, PlannedWaypoint
from aerobat.trajectory import Trajectory

PASSAGE_TOLERANCE = 1e-6  # [m, m/s, rad] violation of a passage that is accepted: the accuracy of solvers
PLANE_DISTANCE = 1e-3  # [m] largest distance from the gate's plane of a point in it


def passage_findings(curve: ThrustCurve, passages: Sequence[PlannedPassage]) -> list[Finding]:
    """Return the findings about each passage: in the gate's plane, inside the opening, speed, attitude."""
    return [finding for passage in passages for finding in _Instant.of(curve, passage).findings()]


def waypoint_finding(trajectory: Trajectory, waypoint: PlannedWaypoint) -> Finding:
    """Return the finding about a waypoint: the distance from its centre."""
    ball, time = waypoint.ball, min(waypoint.time, trajectory.duration)
    distance = float(np.linalg.norm(trajectory.evaluate(time) - ball.centre))
    verdict = Verdict.HOLDS if distance <= ball.radius + PASSAGE_TOLERANCE else Verdict.VIOLATED
    judged = waypoint.time, ball.radius, verdict
    return Finding("distance", "m", Side.MAX, distance, distance, *judged, waypoint=waypoint.name)


@dataclass(frozen=True)
class _Instant:
    """The state at a planned passage, relative to the gate's centre."""

    passage: PlannedPassage
    offset: Array  # [m], (3,)
    velocity: Array  # relative to the gate's [m/s], (3,)
    thrust: Array  # specific thrust, drag included [m/s²], (3,)
    floor: float  # [m/s²] |thrust| below which no attitude is determined

    @classmethod
    def of(cls, curve: ThrustCurve, passage: PlannedPassage) -> _Instant:
        """Return the state of the curve's vehicle, its drag included."""
        trajectory, vehicle, environment = curve.trajectory, curve.vehicle, curve.environment
        time = np.array([min(passage.time, trajectory.duration)])
        position, velocity, acceleration = (trajectory.evaluate(time, k)[0] for k in range(3))
        thrust = force_balance(environment, vehicle).specific_thrust(velocity, acceleration)
        if has_unequal_drag(vehicle):
            found = reference(trajectory, vehicle, time, environment=environment)
            axis = so3.thrust_axis(found.setpoint.q_world_body[0])
            thrust = (axis @ thrust) * axis
        gate = passage.gate
        if gate.motion is not None:
            velocity = velocity - gate.motion.velocity_at(float(time[0]))
        return cls(passage, position - gate.places(time)[0], velocity, thrust, curve.floor)

    def findings(self) -> list[Finding]:
        """Return the findings about the passage, compared with what it requires."""
        gate = self.passage.gate
        along, depth = float(self.offset @ gate.normal), gate.opening.depth(gate.plane_axes @ self.offset)
        margin = min(self.passage.margin, gate.opening.inradius)
        speed = float(self.velocity @ gate.normal)
        found = [
            self._finding("off plane", "m", Side.MAX, abs(along), PLANE_DISTANCE),
            self._finding("inside by", "m", Side.MIN, float(depth), margin),
            self._finding("speed through", "m/s", Side.MIN, speed, self.passage.min_speed),
        ]
        return found if self.passage.attitude_tolerance == np.inf else [*found, self._attitude()]

    def _attitude(self) -> Finding:
        """Return the angle between the thrust axis and its required direction; undecided without thrust."""
        wanted = self.passage.up
        sine, cosine = np.linalg.norm(np.cross(wanted, self.thrust)), wanted @ self.thrust
        angle = float(np.arctan2(sine, cosine))
        found = self._finding("attitude", "rad", Side.MAX, angle, self.passage.attitude_tolerance)
        if np.linalg.norm(self.thrust) < self.floor:
            return replace(found, verdict=Verdict.UNDECIDED)
        return found

    def _finding(self, quantity: str, unit: str, side: Side, value: float, limit: float) -> Finding:
        margin = limit - value if side is Side.MAX else value - limit
        verdict = Verdict.HOLDS if margin >= -PASSAGE_TOLERANCE else Verdict.VIOLATED
        time, gate = self.passage.time, self.passage.gate.name
        return Finding(quantity, unit, side, value, value, time, limit, verdict, gate)
