"""An autopilot as seen by a client: its clock, state and mode, and the orders to it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from math import inf, isfinite, nan
from random import randrange
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.links.goals import AttitudeGoal, Mode, Observed, PositionGoal, observed
from aerobat.links.mavlink.connection import Connection, MavlinkMessage, message_class
from aerobat.links.mavlink.dialects import ARMED, CUSTOM_MODE_ENABLED, PX4, Dialect, dialect_of
from aerobat.links.mavlink.frames import swap_attitude, swap_body, swap_world, swap_yaw

SYSTEM, COMPONENT = 245, 191  # our system and component: a companion computer
_AUTOPILOT = 1  # the component number of an autopilot
_GROUND_STATION = 8  # the autopilot number of systems that are no autopilots
_SYNCHRONIZATIONS = 50  # clock synchronizations that are kept; the one with the shortest round trip is used
_MAX_AHEAD = 0.02  # [s] added to the one-way delay: largest lead of a state's time stamp
_MAX_TIME_DIFFERENCE = 0.1  # [s] largest difference between the times of a state's attitude and position


class AutopilotLink:
    """An autopilot at the other end of a connection."""

    def __init__(self, connection: Connection, system: int | None, say: Callable[[str], None]) -> None:
        """Prepare the link.

        Args:
            connection: to the autopilot.
            system: the autopilot's number; None for the first one that is heard.
            say: receives sentences that the autopilot sends, and sentences about ignored states.
        """
        self._connection = connection
        self._wanted = system
        self._system: int | None = None  # number of the autopilot, once it has answered
        self.systems: set[int] = set()  # numbers of all autopilots that are heard
        self._sent: dict[object, float] = {}  # [s] time when an order or a question was last sent
        self._mark = randrange(10**6)  # [ns] offset that distinguishes our time questions from other clients'
        self._requested: dict[int, float] = {}  # [s] times of time questions without an answer
        self._times: deque[tuple[float, float]] = deque(maxlen=_SYNCHRONIZATIONS)  # [s] round trip, offset
        self._now = 0.0
        self.heard = self.beat = -inf  # [s] times of the last message and of the last heartbeat
        self.mode: Mode | None = None
        self.armed = False
        self.landed: bool | None = None
        self.observed: Observed | None = None
        self.dialect: Dialect = PX4  # the autopilot's, once it is known
        self.parameters: dict[str, float] = {}
        self.complaints: dict[str, None] = {}  # the autopilot's warnings, each once
        self._attitude: MavlinkMessage = None  # the last attitude message
        self._say = say
        self._left_out: set[str] = set()  # the reasons why states were ignored, each reported once

    @property
    def is_known(self) -> bool:
        """True once the autopilot has answered."""
        return self._system is not None

    @property
    def is_synchronized(self) -> bool:
        """True once the autopilot's clock is known."""
        return len(self._times) >= 5

    @property
    def delay(self) -> float:
        """The one-way delay of a message [s]: half of the shortest round trip."""
        return 0.5 * min(self._times, default=(0.0, 0.0))[0]

    def receive(self, now: float) -> list[Observed]:
        """Process received messages at this time [s], keep the link alive, and return the received states."""
        self._now = now
        states = []
        for message in self._connection.receive():
            if not self._is_ours(message):
                continue
            self.heard = now
            if message.get_type() in ("ODOMETRY", "LOCAL_POSITION_NED"):
                states += self._state(message)
            take = getattr(self, f"_take_{message.get_type().lower()}", None)
            if take is not None:
                take(message)
        if self._is_due("heartbeat", 0.5):
            self._send("heartbeat", 18, _GROUND_STATION, 0, 0, 4, 3)
        if self.is_known:
            if self._is_due("time", 0.1):
                self._ask_time()
            if self.observed is None or now - self.observed.time > 1.0:
                for name, every in self.dialect.states.items():
                    self.command(511, message_class(name.lower()).id, every * 1e4)  # [µs]
        return states

    def ask_parameter(self, name: str) -> None:
        """Request a parameter, repeatedly until it is received."""
        if name not in self.parameters and self._is_due(name):
            self._send("param_request_read", self._system, _AUTOPILOT, name.encode(), -1)

    def set_mode(self, mode: Mode) -> None:
        """Order a mode, repeatedly until it is active."""
        if self.mode is not mode:
            self.command(176, CUSTOM_MODE_ENABLED, *self.dialect.modes[mode])

    def arm(self) -> None:
        """Order arming, repeatedly until the autopilot is armed."""
        if not self.armed:
            self.command(400, 1.0)

    def take_off(self, height: float) -> None:
        """Order a climb by `height` [m], repeatedly while this is called."""
        self.command(22, *(0.0,) * 6, height)

    def command(self, number: int, *parameters: float) -> None:
        """Send an order, unless the same order was sent just now."""
        if self._is_due((number, parameters)):
            padded = (*parameters, *(0.0,) * (7 - len(parameters)))
            self._send("command_long", self._system, _AUTOPILOT, number, 0, *padded)

    def follow(self, goal: PositionGoal | AttitudeGoal, max_thrust: float) -> None:
        """Send a goal, its thrust as a fraction of `max_thrust` [N]."""
        stamp = round(1e3 * self._now)
        if isinstance(goal, AttitudeGoal):
            q, rates = swap_attitude(goal.q_world_body), swap_body(goal.omega_body)
            thrust = min(max(goal.thrust / max_thrust, 0.0), 1.0)
            self._send("set_attitude_target", stamp, self._system, _AUTOPILOT, 0, q, *rates, thrust)
            return
        vectors = (goal.position, goal.velocity, goal.acceleration)
        numbers = [x for vector in vectors for x in swap_world(tuple(vector.tolist()))]
        yaw_rate_ignored, local_ned = 2048, 1
        self._send(
            "set_position_target_local_ned",
            stamp,
            self._system,
            _AUTOPILOT,
            local_ned,
            yaw_rate_ignored,
            *numbers,
            swap_yaw(goal.yaw),
            nan,
        )

    def _is_ours(self, message: MavlinkMessage) -> bool:
        """Return True for messages of the autopilot: the requested one, or the first that is heard."""
        if message.get_srcComponent() != _AUTOPILOT:
            return False
        system: int = message.get_srcSystem()
        if message.get_type() == "HEARTBEAT" and message.autopilot != _GROUND_STATION:
            self.systems.add(system)
            if not self.is_known and self._wanted in (None, system):
                self._system, self.dialect = system, dialect_of(message.autopilot)
        return system == self._system

    def _is_due(self, order: object, every: float = 0.3) -> bool:
        """Return True if an order was not sent for `every` [s]; the order then counts as sent now."""
        if self._now - self._sent.get(order, -inf) < every - 1e-9:
            return False
        self._sent[order] = self._now
        return True

    def _send(self, name: str, *fields: Any) -> None:
        self._connection.send(message_class(name)(*fields))

    def _take_heartbeat(self, message: MavlinkMessage) -> None:
        self.mode = self.dialect.mode_of(message.custom_mode)
        self.armed = bool(message.base_mode & ARMED)
        self.beat = self._now

    def _take_extended_sys_state(self, message: MavlinkMessage) -> None:
        self.landed = message.landed_state == 1

    def _ask_time(self) -> None:
        """Ask for the time, by a number that no other client uses."""
        question = round(1e9 * self._now) + self._mark
        self._requested = dict([*self._requested.items(), (question, self._now)][-_SYNCHRONIZATIONS:])
        self._send("timesync", 0, question)

    def _take_timesync(self, message: MavlinkMessage) -> None:
        """Process an answer to one of our time questions; answers to other clients are ignored."""
        sent = self._requested.pop(message.ts1, None)
        if sent is not None and message.tc1 > 0:
            self._times.append((self._now - sent, 1e-9 * message.tc1 - 0.5 * (self._now + sent)))

    def _take_param_value(self, message: MavlinkMessage) -> None:
        if isfinite(message.param_value):
            self.parameters[str(message.param_id)] = float(message.param_value)

    def _take_statustext(self, message: MavlinkMessage) -> None:
        self._say(f"the vehicle: {message.text}")
        if message.severity <= 4:  # a warning, or worse
            self.complaints[str(message.text)] = None

    def _take_attitude_quaternion(self, message: MavlinkMessage) -> None:
        self._attitude = message

    def _state(self, message: MavlinkMessage) -> list[Observed]:
        """Return a state by our clock, if it is newer than the last and plausible.

        Nothing is returned before the vehicle's clock is known. If messages take longer one way than the
        other, time stamps of states are ahead by up to half a round trip.
        """
        if not self.is_synchronized or message.get_type() not in self.dialect.states:
            return []
        _, offset = min(self._times)
        if message.get_type() == "ODOMETRY":
            state = _of_odometry(message, offset)
        elif self._attitude is None:
            return []
        else:
            age = 1e-3 * (message.time_boot_ms - self._attitude.time_boot_ms)
            if abs(age) > _MAX_TIME_DIFFERENCE:
                return []
            state = _of_position(message, self._attitude, age, offset)
        if state is None:
            self._report_ignored("not finite, or their attitude is no unit quaternion")
            return []
        if state.time > self._now + self.delay + _MAX_AHEAD:
            self._report_ignored("stamped later than now")
            return []
        if self.observed is not None and state.time <= self.observed.time:
            return []  # a late message, or a copy
        self.observed = state
        return [state]

    def _report_ignored(self, reason: str) -> None:
        """Report once that states of a kind are ignored."""
        if reason not in self._left_out:
            self._left_out.add(reason)
            self._say(f"states are left out that are {reason}")


def _of_odometry(message: MavlinkMessage, offset: float) -> Observed | None:
    """Return the state in one message, by a clock that is `offset` [s] behind the vehicle's."""
    return observed(
        1e-6 * message.time_usec - offset,
        swap_world((message.x, message.y, message.z)),
        swap_attitude(tuple(message.q)),
        swap_body((message.vx, message.vy, message.vz)),
        swap_body((message.rollspeed, message.pitchspeed, message.yawspeed)),
    )


def _of_position(
    position: MavlinkMessage, attitude: MavlinkMessage, age: float, offset: float
) -> Observed | None:
    """Return the state in two messages, the attitude extrapolated by its rates to the position's time."""
    rates = swap_body((attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed))
    attitude_then = np.array(swap_attitude((attitude.q1, attitude.q2, attitude.q3, attitude.q4)))
    q = so3.multiply(attitude_then, so3.exp(age * np.array(rates)))
    velocity = so3.unrotate(q, np.array(swap_world((position.vx, position.vy, position.vz))))
    w, x, y, z = q.tolist()
    forward, left, up = velocity.tolist()
    place = swap_world((position.x, position.y, position.z))
    return observed(1e-3 * position.time_boot_ms - offset, place, (w, x, y, z), (forward, left, up), rates)
