"""ROS messages of a plan, for ROS 1 and ROS 2 alike: types are those of a store of `rosbags`.

World axes are ENU and body axes FLU, as REP 103 has them and we do. Frames are named `world` and `base_link`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.flatness import Reference, reference
from aerobat.planning import Plan

WORLD, BODY = "world", "base_link"
NANOSECONDS = 10**9
START = 1  # [s] stamp of the plan's start: ROS takes a stamp of 0 for none
LINE_STRIP, CYLINDER = 4, 3  # kinds of markers
PATH_WIDTH, FRAME_WIDTH, DISC_HEIGHT = 0.02, 0.05, 0.01  # [m]
BLUE, ORANGE, GREY = (0.05, 0.2, 0.6), (0.85, 0.35, 0.05), (0.4, 0.4, 0.4)
BLANK: Mapping[str, Any] = {
    "string": "",
    "bool": False,
    "float32": 0.0,
    "float64": 0.0,
}  # all others are whole


@dataclass(frozen=True)
class Stamped:
    """A message and when it is published."""

    topic: str
    kind: str
    stamp: int  # [ns]
    message: Any


@dataclass(frozen=True)
class Messages:
    """Messages of one distribution of ROS."""

    store: Any  # of types, a Typestore of `rosbags`

    def of(self, plan: Plan, found: Reference) -> Iterator[Stamped]:
        """All messages of a plan with a vehicle, sampled as `found`, in no order of time."""
        stamps = [_stamp(time) for time in found.times]
        yield self._trajectory(found, stamps)
        poses = self._poses(found)
        stamped = [
            self.make("geometry_msgs/msg/PoseStamped", header=self._header(stamp), pose=pose)
            for stamp, pose in zip(stamps, poses, strict=True)
        ]
        path = self.make("nav_msgs/msg/Path", header=self._header(stamps[0]), poses=stamped)
        yield Stamped("/aerobat/path", "nav_msgs/msg/Path", stamps[0], path)
        states = self._odometry(found, stamps, poses)
        for stamp, pose, odometry in zip(stamps, stamped, states, strict=True):
            yield Stamped("/aerobat/pose", "geometry_msgs/msg/PoseStamped", stamp, pose)
            yield Stamped("/aerobat/odometry", "nav_msgs/msg/Odometry", stamp, odometry)
        yield from self._markers(plan, found)

    def make(self, kind: str, **given: Any) -> Any:
        """A message of that kind; what is not given is zero, empty or false."""
        fields = dict(self.store.fielddefs[kind][1])
        return self.store.types[kind](
            **{name: given[name] if name in given else self._blank(node) for name, node in fields.items()}
        )

    def _blank(self, node: Any) -> Any:
        form, content = node
        if form.name == "NAME":
            return self.make(content)
        if form.name == "BASE":
            return BLANK.get(content[0], 0)
        (_, element), count = content
        numeric = isinstance(element, tuple) and element[0] != "string"
        return np.zeros(count if form.name == "ARRAY" else 0, dtype=element[0]) if numeric else []

    def _header(self, stamp: int) -> Any:
        return self.make("std_msgs/msg/Header", stamp=self._time("Time", stamp), frame_id=WORLD)

    def _time(self, kind: str, nanoseconds: int) -> Any:
        sec, nanosec = divmod(nanoseconds, NANOSECONDS)
        return self.make(f"builtin_interfaces/msg/{kind}", sec=sec, nanosec=nanosec)

    def _vector(self, kind: str, components: Array) -> Any:
        x, y, z = components.tolist()
        return self.make(f"geometry_msgs/msg/{kind}", x=x, y=y, z=z)

    def _quaternion(self, q: Array) -> Any:
        w, x, y, z = q.tolist()
        return self.make("geometry_msgs/msg/Quaternion", w=w, x=x, y=y, z=z)

    def _pose(self, position: Array, q: Array) -> Any:
        return self.make(
            "geometry_msgs/msg/Pose",
            position=self._vector("Point", position),
            orientation=self._quaternion(q),
        )

    def _poses(self, found: Reference) -> Sequence[Any]:
        pairs = zip(found.setpoint.flat.position, found.setpoint.q_world_body, strict=True)
        return [self._pose(position, q) for position, q in pairs]

    def _twist(self, linear: Array, angular: Array) -> Any:
        return self.make(
            "geometry_msgs/msg/Twist",
            linear=self._vector("Vector3", linear),
            angular=self._vector("Vector3", angular),
        )

    def _odometry(self, found: Reference, stamps: Sequence[int], poses: Sequence[Any]) -> Sequence[Any]:
        """Poses in the world, velocities in the body, as the message has it."""
        setpoint = found.setpoint
        velocities = so3.unrotate(setpoint.q_world_body, setpoint.flat.velocity)
        twists = [self._twist(v, omega) for v, omega in zip(velocities, setpoint.omega_body, strict=True)]
        return [
            self.make(
                "nav_msgs/msg/Odometry",
                header=self._header(stamp),
                child_frame_id=BODY,
                pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose),
                twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist),
            )
            for stamp, pose, twist in zip(stamps, poses, twists, strict=True)
        ]

    def _trajectory(self, found: Reference, stamps: Sequence[int]) -> Stamped:
        """All points in one message, everything in world axes, as controllers of multirotors take them."""
        setpoint = found.setpoint
        rates, accelerations = (
            so3.rotate(setpoint.q_world_body, vectors)
            for vectors in (setpoint.omega_body, setpoint.omega_dot_body)
        )
        points = [
            self.make(
                "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint",
                transforms=[
                    self.make(
                        "geometry_msgs/msg/Transform",
                        translation=self._vector("Vector3", setpoint.flat.position[i]),
                        rotation=self._quaternion(setpoint.q_world_body[i]),
                    )
                ],
                velocities=[self._twist(setpoint.flat.velocity[i], rates[i])],
                accelerations=[self._twist(setpoint.flat.acceleration[i], accelerations[i])],
                time_from_start=self._time("Duration", stamp - stamps[0]),
            )
            for i, stamp in enumerate(stamps)
        ]
        kind = "trajectory_msgs/msg/MultiDOFJointTrajectory"
        message = self.make(kind, header=self._header(stamps[0]), joint_names=[BODY], points=points)
        return Stamped("/aerobat/trajectory", kind, stamps[0], message)

    def _markers(self, plan: Plan, found: Reference) -> Iterator[Stamped]:
        """The path and the gates at the start, the vehicle's rotors there, at each stage and at the end."""
        start = _stamp(0.0)
        lines = [self._line(start, "path", found.setpoint.flat.position, PATH_WIDTH, GREY)]
        for gate in plan.problem.gates:
            frame = np.concatenate([gate.corners, gate.corners[:1]])
            lines.append(self._line(start, gate.name, frame, FRAME_WIDTH, ORANGE))
        yield self._array(start, lines)
        instants = [
            ("start", 0.0),
            *((stage.name, stage.time) for stage in plan.stages),
            ("end", plan.duration),
        ]
        instants.sort(key=lambda each: each[1])
        shown = reference(plan, times=[time for _, time in instants]).setpoint
        for row, (name, time) in enumerate(instants):
            pose = shown.flat.position[row], shown.q_world_body[row]
            yield self._array(_stamp(time), self._discs(_stamp(time), name, row, plan, *pose))

    def _discs(self, stamp: int, name: str, row: int, plan: Plan, position: Array, q: Array) -> Sequence[Any]:
        """The rotors of the vehicle at one instant, numbered apart from those of others of its name.

        Args:
            stamp: When [ns].
            name: What is then.
            row: The number of the instant.
            plan: What is shown.
            position: [m] world, (3,).
            q: Body to world, (4,).
        """
        assert plan.vehicle is not None, "exports are of plans with a vehicle"
        return [
            self._marker(
                stamp,
                f"vehicle: {name}",
                row * len(plan.vehicle.rotors) + number,
                type=CYLINDER,
                pose=self._pose(position + so3.rotate(q, rotor.position_body), q),
                scale=self._vector("Vector3", np.array([2 * rotor.radius, 2 * rotor.radius, DISC_HEIGHT])),
                color=self._color(BLUE),
            )
            for number, rotor in enumerate(plan.vehicle.rotors)
        ]

    def _array(self, stamp: int, markers: Sequence[Any]) -> Stamped:
        kind = "visualization_msgs/msg/MarkerArray"
        return Stamped("/aerobat/markers", kind, stamp, self.make(kind, markers=list(markers)))

    def _line(self, stamp: int, name: str, points: Array, width: float, color: Sequence[float]) -> Any:
        return self._marker(
            stamp,
            name,
            0,
            type=LINE_STRIP,
            pose=self._pose(np.zeros(3), so3.IDENTITY),
            scale=self._vector("Vector3", np.array([width, 0.0, 0.0])),
            color=self._color(color),
            points=[self._vector("Point", point) for point in points],
        )

    def _marker(self, stamp: int, name: str, number: int, **given: Any) -> Any:
        return self.make(
            "visualization_msgs/msg/Marker", header=self._header(stamp), ns=name, id=number, **given
        )

    def _color(self, color: Sequence[float]) -> Any:
        red, green, blue = color
        return self.make("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=1.0)


def _stamp(time: float) -> int:
    """The stamp [ns] of a time of the plan [s]."""
    return START * NANOSECONDS + int(np.floor(time * NANOSECONDS))
