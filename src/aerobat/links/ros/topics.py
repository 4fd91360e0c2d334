"""The topics of both nodes: their names, and goals and states as messages.

A goal is a trajectory_msgs/MultiDOFJointTrajectory of two points: the vehicle's motion at the stamp, and one
period later, so that a receiver can interpolate between messages. The first joint is the vehicle. The message
type ends at accelerations. Therefore a second joint has the vehicle's velocity as its position, so that its
velocity is the acceleration, and its acceleration the jerk.
"""

from __future__ import annotations

from importlib.resources import files

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.interchange.ros import BODY, NANOSECONDS, JointMotion, Messages, RosMessage
from aerobat.links.goals import ZERO, Observed, PathGoal, PathPiece, observed

GOAL, ODOMETRY = "/aerobat/goal", "/aerobat/odometry"
MARKERS, REPORT, CLOCK = "/aerobat/markers", "/aerobat/report", "/clock"
KIND_OF_GOAL = "trajectory_msgs/msg/MultiDOFJointTrajectory"
KIND_OF_ODOMETRY = "nav_msgs/msg/Odometry"
KIND_OF_MARKERS = "visualization_msgs/msg/MarkerArray"
KIND_OF_REPORT = "std_msgs/msg/String"
KIND_OF_CLOCK = "rosgraph_msgs/msg/Clock"
JERK_JOINT = f"{BODY}/velocity"

_FOLDER = files("aerobat.links.ros") / "rviz"
# the command that shows the topics, by the generation of ROS
RVIZ = {"1": f"rviz -d {_FOLDER / 'ros1.rviz'}", "2": f"rviz2 -d {_FOLDER / 'ros2.rviz'}"}

_ALONE = 1.0  # [s] duration of a goal of a single point, longer than it is followed


def goal_message(messages: Messages, piece: PathPiece, stamp: int, with_jerk: bool = True) -> RosMessage:
    """Return the message of a piece of a path from a stamp [ns] on; without jerk only the vehicle's joint."""
    later = round(piece.duration * NANOSECONDS)
    points = [
        messages.trajectory_point(time, *_joints(goal)[: 1 + with_jerk])
        for time, goal in ((0, piece.begin), (later, piece.end))
    ]
    names = [BODY, JERK_JOINT][: 1 + with_jerk]
    header = messages.header(stamp)
    return messages.make(KIND_OF_GOAL, header=header, joint_names=names, points=points)


def read_goal(message: RosMessage, origin: int) -> PathPiece | None:
    """Return a message's piece of a path, by a clock that began at `origin` [ns]; None if it is malformed.

    Goals of other programs may lack jerk, the second point, velocities and accelerations.
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
    """Return the state by a clock that began at `origin` [ns]; None if it is implausible, see `observed`.

    The message has its velocities in body axes.
    """
    pose, twist = message.pose.pose, message.twist.twist
    time = (nanoseconds(message.header.stamp) - origin) / NANOSECONDS
    q = pose.orientation
    place, velocity, rates = ((v.x, v.y, v.z) for v in (pose.position, twist.linear, twist.angular))
    return observed(time, place, (q.w, q.x, q.y, q.z), velocity, rates)


def nanoseconds(time: RosMessage) -> int:
    """Return an instant or a duration of ROS 1 or ROS 2 [ns]."""
    if hasattr(time, "nanosec"):
        return int(time.sec) * NANOSECONDS + int(time.nanosec)
    return int(time.secs) * NANOSECONDS + int(time.nsecs)


def _joints(goal: PathGoal) -> tuple[JointMotion, JointMotion]:
    position, velocity, acceleration, jerk, q, omega, omega_dot = goal
    return (
        JointMotion(position, q, velocity, omega, acceleration, omega_dot),
        JointMotion(velocity, so3.IDENTITY, acceleration, ZERO, jerk, ZERO),
    )


def _read_point(point: RosMessage) -> PathGoal:
    twists = [
        (vector(found[0].linear), vector(found[0].angular)) if found else (ZERO, ZERO)
        for found in (point.velocities, point.accelerations)
    ]
    (velocity, omega), (acceleration, omega_dot) = twists
    jerk = vector(point.accelerations[1].linear) if len(point.accelerations) > 1 else ZERO
    place, q = vector(point.transforms[0].translation), quaternion(point.transforms[0].rotation)
    return PathGoal(place, velocity, acceleration, jerk, q, omega, omega_dot)


def _norm(goal: PathGoal) -> float:
    return float(np.linalg.norm(goal.q_world_body))


def vector(message: RosMessage) -> Array:
    """Return a Vector3 or a Point as an array, (3,)."""
    return np.array([message.x, message.y, message.z])


def quaternion(message: RosMessage) -> Array:
    """Return a Quaternion as an array, (w, x, y, z)."""
    return np.array([message.w, message.x, message.y, message.z])
