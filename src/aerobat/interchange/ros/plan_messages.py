"""ROS messages of a plan: its trajectory, path, poses and states, and markers that show it in RViz."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.environment.obstacles.surface import Surface
from aerobat.flatness import Reference, reference
from aerobat.interchange.ros.messages import (
    BODY,
    CYLINDER,
    LINE_LIST,
    LINE_STRIP,
    NANOSECONDS,
    TRIANGLE_LIST,
    JointMotion,
    Messages,
    RosMessage,
)
from aerobat.interchange.solids import solid_surfaces
from aerobat.planning import Plan
from aerobat.states import BodyState

PATH, FRAME = (0.02, 0.0, 0.0), (0.05, 0.0, 0.0)  # [m] scales of lines: the width
BLUE, ORANGE = (0.05, 0.2, 0.6), (0.85, 0.35, 0.05)
GREY, BLACK = (0.4, 0.4, 0.4), (0.1, 0.1, 0.1)
KIND_OF_MARKERS = "visualization_msgs/msg/MarkerArray"


@dataclass(frozen=True)
class Stamped:
    """A message with its topic and time."""

    topic: str
    kind: str
    stamp: int  # [ns]
    message: RosMessage


@dataclass(frozen=True)
class PlanMessages:
    """The messages of a plan with a vehicle."""

    messages: Messages
    plan: Plan
    start: int = NANOSECONDS  # [ns] stamp of the plan's start; in ROS, a stamp of 0 means none
    origin: Array = field(default_factory=lambda: np.zeros(3))  # [m] position of its origin in the world

    def all(self, found: Reference) -> Iterator[Stamped]:
        """Yield all messages of the plan with the samples `found`, not sorted by time."""
        stamps = [self._stamp(time) for time in found.times]
        yield self._trajectory(found, stamps)
        setpoint = found.setpoint
        poses = [
            self.messages.make(
                "geometry_msgs/msg/PoseStamped",
                header=self.messages.header(stamp),
                pose=self.messages.pose(position + self.origin, q),
            )
            for stamp, position, q in zip(stamps, setpoint.flat.position, setpoint.q_world_body, strict=True)
        ]
        header = self.messages.header(stamps[0])
        path = self.messages.make("nav_msgs/msg/Path", header=header, poses=poses)
        yield Stamped("/aerobat/path", "nav_msgs/msg/Path", stamps[0], path)
        for row, (stamp, pose) in enumerate(zip(stamps, poses, strict=True)):
            yield Stamped("/aerobat/pose", "geometry_msgs/msg/PoseStamped", stamp, pose)
            state = BodyState(
                setpoint.flat.position[row] + self.origin,
                setpoint.flat.velocity[row],
                setpoint.q_world_body[row],
                setpoint.omega_body[row],
            )
            odometry = self.messages.odometry(stamp, state)
            yield Stamped("/aerobat/odometry", "nav_msgs/msg/Odometry", stamp, odometry)
        yield self._array(self._stamp(0.0), self.lines(found))
        for time, discs in self.snapshots():
            yield self._array(self._stamp(time), discs)

    def lines(self, found: Reference) -> Sequence[RosMessage]:
        """Return markers of the path with the samples `found`, and of unmoving gates and obstacles."""
        stamp, path = self._stamp(0.0), found.setpoint.flat.position + self.origin
        line = self.messages.marker(LINE_STRIP, stamp, "path", scale=PATH, color=GREY, points=path)
        return [line, *self._around(0.0, moving=False)]

    def _around(self, time: float, moving: bool, when: str = "") -> Iterator[RosMessage]:
        """Yield markers of moving, or of unmoving, gates and obstacles at a time [s]."""
        stamp = self._stamp(time)
        for gate in self.plan.problem.gates:
            if (gate.motion is not None) is moving:
                outline = gate.at(time).outline
                frame = np.concatenate([outline, outline[:1]]) + self.origin
                name = gate.name + when
                yield self.messages.marker(LINE_STRIP, stamp, name, scale=FRAME, color=ORANGE, points=frame)
        for number, solid in enumerate(self._solids, 1):
            if (solid.motion is not None) is moving:
                corners = solid.at(time).triangles.reshape(-1, 3) + self.origin
                yield self.messages.marker(
                    TRIANGLE_LIST,
                    stamp,
                    solid.name + when,
                    number,
                    scale=(1.0, 1.0, 1.0),
                    color=GREY,
                    opacity=0.4,
                    points=corners,
                )

    @cached_property
    def _solids(self) -> tuple[Surface, ...]:
        return solid_surfaces(self.plan)

    def snapshots(self, every: float = np.inf) -> Iterator[tuple[float, Sequence[RosMessage]]]:
        """Yield times [s] with markers of the vehicle and all that moves: the start, the stages and the end.

        `every`: the interval [s] of further times.
        """
        stages = ((stage.name, stage.time) for stage in self.plan.stages)
        between = np.arange(every, self.plan.duration, every) if np.isfinite(every) else ()
        instants = [("start", 0.0), *stages, ("end", self.plan.duration)]
        instants += [(f"{time:.2f} s", float(time)) for time in between]
        instants.sort(key=lambda instant: instant[1])
        shown = reference(self.plan, times=[time for _, time in instants]).setpoint
        for row, (name, time) in enumerate(instants):
            position, q = shown.flat.position[row] + self.origin, shown.q_world_body[row]
            vehicle = self._vehicle(f"vehicle: {name}", row, position, q, self._stamp(time))
            yield time, [*vehicle, *self._around(time, moving=True, when=f": {name}")]

    def _vehicle(self, name: str, row: int, position: Array, q: Array, stamp: int) -> Sequence[RosMessage]:
        """Return markers of the vehicle's rotors and arms at one instant.

        Args:
            name: namespace of the markers, which other instants may share.
            row: the number of the instant, by which the markers' numbers differ from those of others.
            position: [m] world, (3,).
            q: body to world, (4,).
            stamp: the time [ns].
        """
        assert self.plan.vehicle is not None, "messages are of plans with a vehicle"
        rotors = self.plan.vehicle.rotors
        first = row * (len(rotors) + 1)
        ends = np.array([rotor.position_body for rotor in rotors])
        arms = self.messages.marker(
            LINE_LIST,
            stamp,
            name,
            first + len(rotors),
            scale=PATH,
            color=BLACK,
            points=np.stack([np.zeros_like(ends), ends], axis=1).reshape(-1, 3),
            position=position,
            q=q,
        )
        discs = [
            self.messages.marker(
                CYLINDER,
                stamp,
                name,
                first + number,
                scale=(2.0 * rotor.radius, 2.0 * rotor.radius, 0.01),  # flat, across its z axis
                color=BLUE,
                position=position + so3.rotate(q, rotor.position_body),
                q=q,
            )
            for number, rotor in enumerate(rotors)
        ]
        return [arms, *discs]

    def _trajectory(self, found: Reference, stamps: Sequence[int]) -> Stamped:
        """Return all points in one message, in world axes, as controllers of multirotors take them."""
        setpoint = found.setpoint
        rates, accelerations = (
            so3.rotate(setpoint.q_world_body, vectors)
            for vectors in (setpoint.omega_body, setpoint.omega_dot_body)
        )
        rows = zip(
            setpoint.flat.position + self.origin,
            setpoint.q_world_body,
            setpoint.flat.velocity,
            rates,
            setpoint.flat.acceleration,
            accelerations,
            strict=True,
        )
        points = [
            self.messages.trajectory_point(stamp - stamps[0], JointMotion(*row))
            for stamp, row in zip(stamps, rows, strict=True)
        ]
        kind = "trajectory_msgs/msg/MultiDOFJointTrajectory"
        header = self.messages.header(stamps[0])
        message = self.messages.make(kind, header=header, joint_names=[BODY], points=points)
        return Stamped("/aerobat/trajectory", kind, stamps[0], message)

    def _array(self, stamp: int, markers: Sequence[RosMessage]) -> Stamped:
        message = self.messages.make(KIND_OF_MARKERS, markers=list(markers))
        return Stamped("/aerobat/markers", KIND_OF_MARKERS, stamp, message)

    def _stamp(self, time: float) -> int:
        """Return the stamp [ns] of a time of the plan [s]."""
        return self.start + int(np.floor(time * NANOSECONDS))
