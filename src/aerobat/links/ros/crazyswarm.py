"""A Crazyflie behind crazyswarm2's ROS 2 server: requests to its services, full states on its topic.

Routes to a hover and to the ground are flown by the firmware. It hovers by itself if it receives nothing.
Maneuvers are streamed as full states or, if the plan has polynomial pieces, uploaded and flown by the
firmware.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from aerobat import so3
from aerobat.interchange.exports.crazyflie import AXES
from aerobat.interchange.ros import NANOSECONDS, Messages, RosMessage
from aerobat.links.commander import Doing
from aerobat.links.goals import PathPiece
from aerobat.links.ros.maneuver_node import Tick
from aerobat.links.ros.preparation import Prepared
from aerobat.links.ros.rclpy_middleware import RclpyMiddleware
from aerobat.links.routes import Route

PREFIX = "crazyswarm2:"  # prefix of a goal that is a Crazyflie's name
FULL_STATE = "crazyflie_interfaces/msg/FullState"
SERVICES = {
    "takeoff": "crazyflie_interfaces/srv/Takeoff",
    "land": "crazyflie_interfaces/srv/Land",
    "go_to": "crazyflie_interfaces/srv/GoTo",
    "upload_trajectory": "crazyflie_interfaces/srv/UploadTrajectory",
    "start_trajectory": "crazyflie_interfaces/srv/StartTrajectory",
    "notify_setpoints_stop": "crazyflie_interfaces/srv/NotifySetpointsStop",
}
_MIN_DURATION = 0.5  # [s] shortest duration of a route
_TRAJECTORY = 1  # number of the uploaded trajectory


class Crazyflie:
    """The orders to the server at each tick; see `take`."""

    def __init__(self, ros: RclpyMiddleware, name: str) -> None:
        """Find the services of a Crazyflie by its name, as in /cf231."""
        self._messages = Messages(ros.make)
        self._publish = ros.publisher(f"{name}/cmd_full_state", FULL_STATE)
        self._ask = {service: ros.client(f"{name}/{service}", kind) for service, kind in SERVICES.items()}
        self._doing = Doing.NOTHING
        self._streams = self._flies = False  # whether full states are sent, and whether a trajectory is flown

    def take(self, tick: Tick) -> None:
        """Send due orders: a service call when a route begins, the goal's full state in a maneuver."""
        doing, route = tick.commander.doing, tick.commander.route
        enters, self._doing = doing is not self._doing, doing
        uploaded = None if tick.flown is None or tick.flown.pieces is None else tick.flown
        if doing is Doing.NOTHING:
            if enters and self._streams:  # in the air: the firmware stops rotors when full states end
                self._order("go_to", relative=True, duration=self._duration(_MIN_DURATION))
        elif route is not None and doing is not Doing.BRAKING:
            if enters:
                self._go(tick, route)
        elif uploaded is not None and tick.is_flown:
            if not self._flies:
                start = {"trajectory_id": _TRAJECTORY, "timescale": 1.0}
                self._order("start_trajectory", **start, reversed=False, relative=False)
            self._flies = True
        elif tick.piece is not None:
            if enters and uploaded is not None:
                self._upload(uploaded)
            self._flies, self._streams = False, True
            self._publish(self._full_state(tick.piece, tick.stamp))

    def _go(self, tick: Tick, route: Route) -> None:
        """Order the route that begins."""
        end, remaining = route.end, route.began + route.path.duration - tick.now
        duration = self._duration(max(remaining, _MIN_DURATION))
        if self._doing is Doing.CLIMBING:
            self._order("takeoff", height=float(end[2]), duration=duration)
        elif self._doing is Doing.LANDING:
            self._order("land", height=tick.commander.ground, duration=duration)
        else:
            goal = self._messages.vector("Point", end)
            self._order("go_to", relative=False, goal=goal, yaw=route.yaw, duration=duration)

    def _order(self, service: str, **given: Any) -> None:
        """Request a route by the firmware, in place of full states."""
        if self._streams:
            self._ask["notify_setpoints_stop"](group_mask=0, remain_valid_millisecs=100)
        self._streams = False
        self._ask[service](group_mask=0, **given)

    def _upload(self, flown: Prepared) -> None:
        assert flown.pieces is not None, "asked of plans that have them"
        moved = flown.pieces.copy()
        moved["polynomials"][:, :3, 0] += flown.stream.offset
        pieces = [
            self._messages.make(
                "crazyflie_interfaces/msg/TrajectoryPolynomialPiece",
                **{
                    f"poly_{axis}": numbers
                    for axis, numbers in zip(AXES, piece["polynomials"].tolist(), strict=True)
                },
                duration=self._duration(float(piece["duration"])),
            )
            for piece in moved
        ]
        self._ask["upload_trajectory"](trajectory_id=_TRAJECTORY, piece_offset=0, pieces=pieces)

    def _full_state(self, piece: PathPiece, stamp: int) -> RosMessage:
        """Return the full state of the goal that begins; its body rates are in body axes."""
        goal = piece.begin
        omega_body = so3.unrotate(goal.q_world_body, np.asarray(goal.omega))
        return self._messages.make(
            FULL_STATE,
            header=self._messages.header(stamp),
            pose=self._messages.pose(goal.position, goal.q_world_body),
            twist=self._messages.twist(goal.velocity, omega_body),
            acc=self._messages.vector("Vector3", goal.acceleration),
        )

    def _duration(self, seconds: float) -> RosMessage:
        return self._messages.time("Duration", round(seconds * NANOSECONDS))
