"""ROS messages of states and shapes, for ROS 1 and ROS 2 alike.

World axes are ENU and body axes FLU, as in REP 103. Frames are named `world` and `base_link`.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeAlias

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.states import BodyState

WORLD, BODY = "world", "base_link"
NANOSECONDS = 10**9
LINE_STRIP, LINE_LIST, CYLINDER, TRIANGLE_LIST = 4, 5, 3, 11  # kinds of markers
_ORIGIN: Array = np.zeros(3)
RosMessage: TypeAlias = Any  # of the class that a distribution generates


class Make(Protocol):
    """A maker of one distribution's messages."""

    def __call__(self, kind: str, /, **given: Any) -> RosMessage:
        """Return a message of a kind, as "geometry_msgs/msg/Pose"; other fields are zero, empty or false."""


class JointMotion(NamedTuple):
    """The motion of one joint at a point of a trajectory, in world axes."""

    position: Array  # [m], (3,)
    q_world_body: Array  # (4,)
    velocity: Array  # [m/s], (3,)
    omega: Array  # [rad/s], (3,)
    acceleration: Array  # [m/s²], (3,)
    omega_dot: Array  # [rad/s²], (3,)


@dataclass(frozen=True)
class Messages:
    """Messages of one distribution of ROS; stamps are in nanoseconds."""

    make: Make

    def header(self, stamp: int) -> RosMessage:
        """Return a header with the frame `world`."""
        return self.make("std_msgs/msg/Header", stamp=self.time("Time", stamp), frame_id=WORLD)

    def time(self, kind: str, nanoseconds: int) -> RosMessage:
        """Return a `Time` or a `Duration`."""
        sec, nanosec = divmod(nanoseconds, NANOSECONDS)
        return self.make(f"builtin_interfaces/msg/{kind}", sec=sec, nanosec=nanosec)

    def vector(self, kind: str, components: Array) -> RosMessage:
        """Return a `Vector3` or a `Point`."""
        x, y, z = components.tolist()
        return self.make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def quaternion(self, q: Array) -> RosMessage:
        """Return a `Quaternion` of (w, x, y, z)."""
        w, x, y, z = q.tolist()
        return self.make("geometry_msgs/msg/Quaternion", w=w, x=x, y=y, z=z)

    def pose(self, position: Array, q: Array) -> RosMessage:
        """Return a pose of a position [m] and an attitude."""
        place, turn = self.vector("Point", position), self.quaternion(q)
        return self.make("geometry_msgs/msg/Pose", position=place, orientation=turn)

    def twist(self, linear: Array, angular: Array) -> RosMessage:
        """Return a twist of a velocity [m/s] and a rate [rad/s], or of their derivatives."""
        vectors = self.vector("Vector3", linear), self.vector("Vector3", angular)
        return self.make("geometry_msgs/msg/Twist", linear=vectors[0], angular=vectors[1])

    def odometry(self, stamp: int, state: BodyState) -> RosMessage:
        """Return the odometry of a state: the pose in world axes, velocities in body axes."""
        velocity = so3.unrotate(state.q_world_body, state.velocity)
        pose, twist = self.pose(state.position, state.q_world_body), self.twist(velocity, state.omega_body)
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(stamp),
            child_frame_id=BODY,
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist),
        )

    def trajectory_point(self, time_from_start: int, *joints: JointMotion) -> RosMessage:
        """Return the point of a trajectory at a time [ns] since its start."""
        transforms = [
            self.make(
                "geometry_msgs/msg/Transform",
                translation=self.vector("Vector3", joint.position),
                rotation=self.quaternion(joint.q_world_body),
            )
            for joint in joints
        ]
        return self.make(
            "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint",
            transforms=transforms,
            velocities=[self.twist(joint.velocity, joint.omega) for joint in joints],
            accelerations=[self.twist(joint.acceleration, joint.omega_dot) for joint in joints],
            time_from_start=self.time("Duration", time_from_start),
        )

    def marker(
        self,
        kind: int,
        stamp: int,
        name: str,
        number: int = 0,
        *,
        scale: tuple[float, float, float],
        color: tuple[float, float, float],
        opacity: float = 1.0,
        points: Iterable[Array] = (),
        position: Array = _ORIGIN,
        q: Array = so3.IDENTITY,
    ) -> RosMessage:
        """Return a marker for RViz.

        Args:
            kind: LINE_STRIP, LINE_LIST, CYLINDER or TRIANGLE_LIST.
            stamp: its time [ns].
            name: its namespace.
            number: its number in the namespace.
            scale: its size [m]; for lines, the width; for triangles, 1.
            color: red, green and blue, 0 to 1.
            opacity: 0 to 1.
            points: along lines, or the corners of triangles [m], in the marker's axes, (3,) each.
            position: the origin of these axes [m], (3,).
            q: their attitude, (4,).
        """
        red, green, blue = color
        return self.make(
            "visualization_msgs/msg/Marker",
            header=self.header(stamp),
            ns=name,
            id=number,
            type=kind,
            pose=self.pose(position, q),
            scale=self.vector("Vector3", np.array(scale)),
            color=self.make("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=opacity),
            points=[self.vector("Point", point) for point in points],
        )
