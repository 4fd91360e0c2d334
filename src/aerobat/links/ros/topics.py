"""The topics of both nodes: their names, and goals and states as messages.

A goal is a trajectory_msgs/MultiDOFJointTrajectory of two points: where the vehicle is to be at its stamp,
and a period later, so that a receiver knows what comes between two messages. The first joint is the vehicle.
That message ends at accelerations; the second joint is the vehicle's velocity taken for a place, whose
velocity is therefore the acceleration, and whose acceleration is the jerk.
"""

from __future__ import annotations

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.interchange.ros import BODY, NANOSECONDS, JointMotion, Messages, RosMessage
from aerobat.links.goals import Observed, PathGoal, PathPiece, observed

GOAL, ODOMETRY = "/aerobat/goal", "/aerobat/odometry"
MARKERS, REPORT, CLOCK = "/aerobat/markers", "/aerobat/report", "/clock"
KIND_OF_GOAL = "trajectory_msgs/msg/MultiDOFJointTrajectory"
KIND_OF_ODOMETRY = "nav_msgs/msg/Odometry"
KIND_OF_MARKERS = "visualization_msgs/msg/MarkerArray"
KIND_OF_REPORT = "std_msgs/msg/String"
KIND_OF_CLOCK = "rosgraph_msgs/msg/Clock"
JERK_JOINT = f"{BODY}/velocity"

_ALONE = 1.0  # [s] for which a goal of one point tells the way, more than it is followed
_ZERO: Array = np.zeros(3)


def goal_message(messages: Messages, piece: PathPiece, stamp: int, with_jerk: bool = True) -> RosMessage:
    """A piece of a path from a stamp [ns] on; without the jerk it has the vehicle's joint alone."""
    later = round(piece.duration * NANOSECONDS)
    points = [
        messages.trajectory_point(time, *_joints(goal)[: 1 + with_jerk])
        for time, goal in ((0, piece.begin), (later, piece.end))
    ]
    names = [BODY, JERK_JOINT][: 1 + with_jerk]
    header = messages.header(stamp)
    return messages.make(KIND_OF_GOAL, header=header, joint_names=names, points=points)


def read_goal(message: RosMessage, origin: int) -> PathPiece | None:
    """The piece of a path in a message, by a clock that began at an instant [ns]; None if malformed.

    Goals of other programs may lack the jerk, a second point, velocities and accelerations.
    """
    if not message.points or not all(point.transforms for point in message.points):
        return None
    first, second = message.points[0], message.points[min(1, len(message.points) - 1)]
    duration = nanoseconds(second.time_from_start) / NANOSECONDS or _ALONE
    begin, end = _read_point(first), _read_point(second)
    if len(first.accelerations) < 2 or len(second.accelerations) < 2:
        jerk = (end.acceleration - begin.acceleration) / duration
        begin, end = begin._replace(jerk=jerk), end._replace(jerk=jerk)
    numbers = np.concatenate([*begin, *end])
    if not np.isfinite(numbers).all() or duration < 0.0 or abs(_norm(begin) * _norm(end) - 1.0) > 0.01:
        return None
    return PathPiece(begin, end, (nanoseconds(message.header.stamp) - origin) / NANOSECONDS, duration)


def read_odometry(message: RosMessage, origin: int) -> Observed | None:
    """Return a state by a clock that began at an instant [ns]; see `observed` for what is none.

    The message has its velocities in the body's axes.
    """
    pose, twist = message.pose.pose, message.twist.twist
    time = (nanoseconds(message.header.stamp) - origin) / NANOSECONDS
    q = pose.orientation
    place, velocity, rates = ((v.x, v.y, v.z) for v in (pose.position, twist.linear, twist.angular))
    return observed(time, place, (q.w, q.x, q.y, q.z), velocity, rates)


def nanoseconds(time: RosMessage) -> int:
    """An instant or a duration of either ROS [ns]."""
    if hasattr(time, "nanosec"):
        return int(time.sec) * NANOSECONDS + int(time.nanosec)
    return int(time.secs) * NANOSECONDS + int(time.nsecs)


def _joints(goal: PathGoal) -> tuple[JointMotion, JointMotion]:
    position, velocity, acceleration, jerk, q, omega, omega_dot = goal
    return (
        JointMotion(position, q, velocity, omega, acceleration, omega_dot),
        JointMotion(velocity, so3.IDENTITY, acceleration, _ZERO, jerk, _ZERO),
    )


def _read_point(point: RosMessage) -> PathGoal:
    twists = [
        (vector(found[0].linear), vector(found[0].angular)) if found else (_ZERO, _ZERO)
        for found in (point.velocities, point.accelerations)
    ]
    (velocity, omega), (acceleration, omega_dot) = twists
    jerk = vector(point.accelerations[1].linear) if len(point.accelerations) > 1 else _ZERO
    place, q = vector(point.transforms[0].translation), quaternion(point.transforms[0].rotation)
    return PathGoal(place, velocity, acceleration, jerk, q, omega, omega_dot)


def _norm(goal: PathGoal) -> float:
    return float(np.linalg.norm(goal.q_world_body))


def vector(message: RosMessage) -> Array:
    """A Vector3 or a Point of either ROS, (3,)."""
    return np.array([message.x, message.y, message.z])


def quaternion(message: RosMessage) -> Array:
    """A Quaternion of either ROS, (w, x, y, z)."""
    return np.array([message.w, message.x, message.y, message.z])
