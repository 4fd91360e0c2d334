"""The simulated vehicle as the other node: goals in, odometry out, nothing else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aerobat.interchange.ros import NANOSECONDS, Messages, RosMessage
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.goals import Mode, PathGoal
from aerobat.links.ros import topics
from aerobat.links.ros.middleware import Middleware, PacedClock

_NEAR = 0.5  # [m] of the vehicle, within which a stream of goals is taken up
_SLOW = 1.0  # [m/s] likewise
_LIFT = 0.01  # [m] above where it stands, from which on a goal means to take off
_OVERLAP = 0.004  # [s] a tick, after which the time is told at which the next goal is due
_STALE = 0.5  # [s] after its stamp, from which on a goal is none


class VehicleNode:
    """A vehicle that obeys goals; `tick` it often. Its clock begins with it.

    On the ground it is armed by a goal above it, and disarmed where a goal leads it to the ground. In the
    air it hovers; it takes up goals that begin where it is, and hovers again once they stop.
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
        """Subscribe and announce.

        Args:
            ros: of which generation.
            vehicle: what flies; its time begins at zero.
            goal: the topic of goals.
            odometry: the topic of states.
            rate: of states [1/s].
            clock: what all live by, this node first; it waits for goals that are late. None for ROS time.
            say: what takes sentences about the course of things.
        """
        self.origin = ros.time()  # [ns]
        self._ros = ros
        self.vehicle = vehicle
        self._messages, self._say = Messages(ros.make), say
        self._period, self._due = 1.0 / rate, 0.0
        self._send_odometry = ros.publisher(odometry, topics.KIND_OF_ODOMETRY)
        self._clock = clock
        self._published = self.origin  # [ns] the last time that was told
        if clock is not None:
            self._send_clock = ros.publisher(topics.CLOCK, topics.KIND_OF_CLOCK)
            clock.tell_again = self._tell_time
        self._refused = ""  # the last reason, so that it is told once
        ros.subscribe(goal, topics.KIND_OF_GOAL, self._take_goal)

    def tick(self, now: float) -> None:
        """Go on to this time [s], and send what is due."""
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
                self._tell_time()

    def _tell_time(self) -> None:
        time = self._messages.time("Time", self._published)
        self._send_clock(self._messages.make(topics.KIND_OF_CLOCK, clock=time))

    def _stamp(self, time: float) -> int:
        return self.origin + round(time * NANOSECONDS)

    def _take_goal(self, message: RosMessage) -> None:
        piece = topics.read_goal(message, self.origin)
        if piece is None:
            self._refuse("a goal is malformed, or its numbers are not finite")
            return
        if self._clock is not None:  # time waits just after the piece ends, when the next one is due
            self._clock.wait_at(self._stamp(piece.stamp + piece.duration + self._period + _OVERLAP))
        # up to there by the goal before it: of goals that a pause of this process held up each has its time
        self.vehicle.advance(min(piece.stamp, (self._ros.time() - self.origin) / NANOSECONDS))
        if self.vehicle.time - piece.stamp > _STALE:
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
        """True for a goal by which a vehicle may begin to obey."""
        state = self.vehicle.state
        if self.vehicle.landed and goal.position[2] < _LIFT:
            return False
        off = float(np.linalg.norm(goal.position - state.position))
        speed = float(np.linalg.norm(goal.velocity - state.velocity))
        if off > _NEAR or speed > _SLOW:
            self._refuse(f"a goal is {off:.1f} m and {speed:.1f} m/s off; goals begin where the vehicle is")
            return False
        return not self.vehicle.crashed

    def _refuse(self, reason: str) -> None:
        if not self._refused:
            self._say(f"{reason}; the vehicle stays as it is")
        self._refused = reason
