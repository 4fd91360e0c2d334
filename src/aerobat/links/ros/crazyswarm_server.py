"""The simulated vehicle as a Crazyflie behind crazyswarm2's server: orders in, odometry out.

Simplifications: routes are flown at the simulated vehicle's own speeds, trajectories with their first
heading. Full states contain no jerk and angular acceleration; these are computed from the last two.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aerobat import so3
from aerobat.environment import Environment
from aerobat.interchange.exports.crazyflie import AXES, PIECE, as_path
from aerobat.interchange.ros import NANOSECONDS, RosMessage
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.goals import ZERO, Mode, PathGoal, PathPiece
from aerobat.links.ros import topics
from aerobat.links.ros.crazyswarm import FULL_STATE, SERVICES
from aerobat.links.ros.rclpy_middleware import RclpyMiddleware
from aerobat.links.ros.vehicle_node import VehicleNode
from aerobat.links.stream import SetpointStream

_KEPT = 0.5  # [s] for which a full state is extrapolated at most
_STREAM = 0.05  # [s] largest interval between two full states of one stream
_AHEAD = 0.01  # [s] length of a trajectory's pieces for the controller


class CrazyswarmServer(VehicleNode):
    """The services of one Crazyflie; call `tick` often."""

    def __init__(self, ros: RclpyMiddleware, vehicle: SimulatedVehicle, name: str, **settings: Any) -> None:
        """Offer the services of a name, as in /cf231; see `VehicleNode` for the settings."""
        super().__init__(ros, vehicle, goal=f"{name}/goal", odometry=f"{name}/odom", **settings)
        self._trajectories: dict[int, list[RosMessage]] = {}
        self._flown: tuple[SetpointStream, float] | None = None  # the trajectory and its start time [s]
        nowhere = PathGoal(ZERO, ZERO, ZERO, ZERO, so3.IDENTITY, ZERO, ZERO)
        self._last = nowhere, -np.inf  # the last full state, and its stamp [s]
        ros.subscribe(f"{name}/cmd_full_state", FULL_STATE, self._take_full_state)
        for service, kind in SERVICES.items():
            ros.serve(f"{name}/{service}", kind, getattr(self, f"_{service}"))

    def tick(self, now: float) -> None:
        """Advance to this time [s] along the trajectory, and send due messages."""
        if self._flown is not None:
            stream, began = self._flown
            since = self.vehicle.time - began
            if since < stream.duration:
                ends = stream.goal(since), stream.goal(since + _AHEAD)
                self._follow(PathPiece(*ends, self.vehicle.time, _AHEAD))
            else:
                self._flown = None
                self.vehicle.go_to(stream.flat(stream.duration).position)
        super().tick(now)

    def _follow(self, piece: PathPiece) -> None:
        """Follow a piece of a path, in the air."""
        if not self.vehicle.landed:
            self.vehicle.follow_path(piece)
            if self.vehicle.mode is not Mode.OFFBOARD:
                self.vehicle.go_offboard()

    def _take_full_state(self, message: RosMessage) -> None:
        self._flown = None
        pose, twist = message.pose, message.twist
        q = topics.quaternion(pose.orientation)
        position, velocity, omega, acceleration = map(
            topics.vector, (pose.position, twist.linear, twist.angular, message.acc)
        )
        stamp = (topics.nanoseconds(message.header.stamp) - self.origin) / NANOSECONDS
        goal = PathGoal(position, velocity, acceleration, ZERO, q, so3.rotate(q, omega), ZERO)
        if np.isfinite(np.concatenate([*goal, [stamp]])).all():
            goal = self._with_jerk(goal, stamp)
            self.vehicle.advance(stamp)
            self._follow(PathPiece(goal, goal, stamp, _KEPT))

    def _with_jerk(self, goal: PathGoal, stamp: float) -> PathGoal:
        """Return the goal with jerk and angular acceleration by differences from the previous goal."""
        (before, when), self._last = self._last, (goal, stamp)
        elapsed = stamp - when
        if not 0.0 < elapsed < _STREAM:
            return goal
        jerk, turning = goal.acceleration - before.acceleration, goal.omega - before.omega
        return goal._replace(jerk=jerk / elapsed, omega_dot=turning / elapsed)

    def _takeoff(self, request: RosMessage) -> None:
        self.vehicle.arm()
        self.vehicle.take_off(request.height - self.vehicle.state.position[2])

    def _land(self, request: RosMessage) -> None:
        self._flown = None
        self.vehicle.land()

    def _go_to(self, request: RosMessage) -> None:
        self._flown = None
        here = self.vehicle.state.position if request.relative else ZERO
        self.vehicle.go_to(here + topics.vector(request.goal), None if request.relative else request.yaw)

    def _notify_setpoints_stop(self, request: RosMessage) -> None:
        if self.vehicle.mode is Mode.OFFBOARD and self._flown is None:
            self.vehicle.hold()

    def _upload_trajectory(self, request: RosMessage) -> None:
        known = self._trajectories.setdefault(request.trajectory_id, [])
        known[request.piece_offset :] = request.pieces

    def _start_trajectory(self, request: RosMessage) -> None:
        uploaded = self._trajectories.get(request.trajectory_id, [])
        if not uploaded or request.timescale != 1.0 or request.reversed:
            self._say("trajectories are flown once uploaded, forwards, in their own time; none begins")
            return
        pieces = np.zeros(len(uploaded), dtype=PIECE)
        for piece, part in zip(pieces, uploaded, strict=True):
            piece["duration"] = topics.nanoseconds(part.duration) / NANOSECONDS
            for numbers, axis in zip(piece["polynomials"], AXES, strict=True):
                polynomial = getattr(part, f"poly_{axis}")
                numbers[: len(polynomial)] = polynomial
        path = as_path(pieces, heading=float(pieces["polynomials"][0, 3, 0]))
        here = self.vehicle.state.position
        offset = here - path.evaluate(0.0) if request.relative else ZERO
        environment = Environment(gravity=self.vehicle.gravity)
        stream = SetpointStream(path, self.vehicle.vehicle, environment, offset)
        self._flown = stream, self.vehicle.time
