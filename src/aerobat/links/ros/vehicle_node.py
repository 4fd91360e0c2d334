"""The node of the simulated vehicle: it receives goals and publishes odometry, nothing else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerobat.interchange.ros import NANOSECONDS, Messages, RosMessage
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.goals import TAKEOFF_THRESHOLD, Mode, PathGoal
from aerobat.links.ros import topics
from aerobat.links.ros.middleware import Middleware, PacedClock

_MAX_GOAL_DISTANCE = 0.5  # [m] largest distance of the first goal from the vehicle
_MAX_VELOCITY_ERROR = 1.0  # [m/s] largest difference of velocity of the first goal from the vehicle
_OVERLAP = 0.004  # [s] of a tick, added to the time at which the clock waits for the next goal
_MAX_GOAL_AGE = 0.5  # [s] age from which a goal is rejected


class VehicleNode:
    """A vehicle that follows goals; call `tick` often. Its clock begins with its creation.

    A goal above the ground arms the vehicle on the ground, and a goal on the ground disarms it. In the air
    the vehicle hovers; it follows goals that begin where it is, and hovers again once they stop.
    """

    def __init__(
        self,
        ros: Middleware,
        vehicle: SimulatedVehicle,
        *,
        goal: str = topics.GOAL,
        odometry: str = topics.ODOMETRY,
        rate: float = 100.0,
        clock: PacedClock | None = None,
        say: Callable[[str], None] = lambda sentence: None,
    ) -> None:
        """Subscribe and announce topics.

        Args:
            ros: access to ROS 1 or ROS 2.
            vehicle: the simulated vehicle; its time begins at zero.
            goal: the topic of goals.
            odometry: the topic of states.
            rate: of states [1/s].
            clock: the clock of all nodes, published by this node; it waits for late goals. None for ROS time.
            say: receives sentences about the progress.
        """
        self.origin = ros.time()  # [ns]
        self._ros = ros
        self.vehicle = vehicle
        self._messages, self._say = Messages(ros.make), say
        self._period, self._due = 1.0 / rate, 0.0
        self._send_odometry = ros.publisher(odometry, topics.KIND_OF_ODOMETRY)
        self._clock = clock
        self._published = self.origin  # [ns] the last published time
        if clock is not None:
            self._send_clock = ros.publisher(topics.CLOCK, topics.KIND_OF_CLOCK)
            clock.resend = self._publish_time
        self._refused = ""  # the last reason, so that it is reported once
        ros.subscribe(goal, topics.KIND_OF_GOAL, self._take_goal)

    def tick(self, now: float) -> None:
        """Advance to this time [s], and send due messages."""
        self.vehicle.advance(now)
        for sentence in self.vehicle.notices:
            self._say(sentence)
        self.vehicle.notices.clear()
        if now >= self._due - 1e-9:
            stamp = self._stamp(self.vehicle.time)
            self._send_odometry(self._messages.odometry(stamp, self.vehicle.state))
            self._due = max(self._due + self._period, now)
            if self._clock is not None:
                self._published = self._stamp(now)
                self._publish_time()

    def _publish_time(self) -> None:
        time = self._messages.time("Time", self._published)
        self._send_clock(self._messages.make(topics.KIND_OF_CLOCK, clock=time))

    def _stamp(self, time: float) -> int:
        return self.origin + round(time * NANOSECONDS)

    def _take_goal(self, message: RosMessage) -> None:
        piece = topics.read_goal(message, self.origin)
        if piece is None:
            self._refuse("a goal is malformed, or its numbers are not finite")
            return
        if self._clock is not None:  # it waits just after the piece ends, when the next goal is due
            self._clock.wait_at(self._stamp(piece.stamp + piece.duration + self._period + _OVERLAP))
        # until then the previous goal holds: goals delayed by a pause of this process each get their time
        self.vehicle.advance(min(piece.stamp, (self._ros.time() - self.origin) / NANOSECONDS))
        if self.vehicle.time - piece.stamp > _MAX_GOAL_AGE:
            self._refuse("a goal is from long ago by its stamp; set the clocks alike")
        elif self.vehicle.mode is Mode.OFFBOARD:
            self.vehicle.follow_path(piece)
            if self.vehicle.landed and piece.begin.position[2] <= 0.0 and piece.begin.velocity[2] <= 0.0:
                self.vehicle.hold()
                self.vehicle.disarm()
                self._say("landed")
        elif self._begins_here(piece.end):
            self._refused = ""
            self.vehicle.arm()
            self.vehicle.follow_path(piece)
            self.vehicle.go_offboard()
            self._say("following goals")

    def _begins_here(self, goal: PathGoal) -> bool:
        """Return True for a goal with which a vehicle may begin to follow."""
        state = self.vehicle.state
        if self.vehicle.landed and goal.position[2] < TAKEOFF_THRESHOLD:
            return False
        off = float(np.linalg.norm(goal.position - state.position))
        speed = float(np.linalg.norm(goal.velocity - state.velocity))
        if off > _MAX_GOAL_DISTANCE or speed > _MAX_VELOCITY_ERROR:
            self._refuse(f"a goal is {off:.1f} m and {speed:.1f} m/s off; goals begin where the vehicle is")
            return False
        return not self.vehicle.crashed

    def _refuse(self, reason: str) -> None:
        if not self._refused:
            self._say(f"{reason}; the vehicle stays as it is")
        self._refused = reason
