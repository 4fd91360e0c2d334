"""The simulated vehicle as a MAVLink autopilot, with the messages of PX4 or ArduPilot."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees, inf, isfinite, nan, pi
from typing import Any

import numpy as np

from aerobat import so3
from aerobat.links.autopilot.vehicle import POINT_TIMEOUT, SimulatedVehicle
from aerobat.links.goals import AttitudeGoal, Mode, PositionGoal, yaw_of
from aerobat.links.mavlink.connection import Connection, MavlinkMessage, message_class
from aerobat.links.mavlink.dialects import ARMED, CUSTOM_MODE_ENABLED, PX4, Dialect
from aerobat.links.mavlink.frames import (
    from_global,
    swap_attitude,
    swap_body,
    swap_world,
    swap_yaw,
    to_global,
)

SYSTEM = 1  # the vehicle's system number
_TAKEOFF_HEIGHT = "MIS_TAKEOFF_ALT"  # the only parameter that clients may set
_IGNORED_POSITION, _IGNORED_VELOCITY, _IGNORED_ACCELERATION, _IGNORED_YAW = 7, 56, 448, 1024
_IGNORED_RATES, _IGNORED_ATTITUDE = 7, 128


@dataclass
class _Stream:
    """A message that is sent at an interval; with an infinite one, on request only."""

    name: str
    fields: Callable[[], Sequence[Any]]
    interval: float  # [s]
    due: float  # [s] when it is sent next


class FrontEnd:
    """The messages of a simulated vehicle: streams that it sends, and orders that it accepts."""

    def __init__(
        self,
        vehicle: SimulatedVehicle,
        connection: Connection,
        say: Callable[[str], None] = lambda sentence: None,
        speaks: Dialect = PX4,
    ) -> None:
        self.vehicle, self.dialect = vehicle, speaks
        self._guided = False  # in ArduPilot's mode GUIDED, in which it holds without set-points
        self._say = say
        self._connection = connection
        self.parameters = {
            self.dialect.hover_thrust: vehicle.hover_fraction,
            _TAKEOFF_HEIGHT: 2.5,  # [m] PX4's default, until a client sets it
            self.dialect.silence: POINT_TIMEOUT,
            **{name: float(setting.bits) for name, setting in self.dialect.settings.items()},
        }
        self._streams = {  # by the message's number
            message_class(name).id: _Stream(name, fields, interval, due=0.0 if isfinite(interval) else inf)
            for name, fields, interval in (
                ("heartbeat", self._heartbeat, 0.5),
                ("sys_status", self._sys_status, 1.0),
                ("extended_sys_state", self._extended_state, 0.2),
                ("home_position", self._home, 1.0),
                ("gps_raw_int", self._gps, 0.2),
                ("local_position_ned", self._local_position, 0.02),
                ("attitude_quaternion", self._attitude, 0.02),
                ("global_position_int", self._global_position, 0.02),
                ("odometry", self._odometry, inf),
            )
        }

    def tick(self, now: float) -> None:
        """Advance to this time [s], process received messages, and send due ones."""
        self.vehicle.advance(now)
        for message in self._connection.receive():
            if getattr(message, "target_system", SYSTEM) not in (0, SYSTEM):
                continue
            take = getattr(self, f"_take_{message.get_type().lower()}", None)
            if take is not None:
                take(message)
        for sentence in self.vehicle.notices:
            self._say(sentence)
            self._send("statustext", 4, sentence.encode()[:50])
        self.vehicle.notices.clear()
        for stream in self._streams.values():
            if stream.due <= now + 1e-9:
                self._send(stream.name, *stream.fields())
                stream.due = max(stream.due + stream.interval, now)

    def _send(self, name: str, *fields: Any) -> None:
        self._connection.send(message_class(name)(*fields))

    # the fields of streamed messages

    @property
    def _milliseconds(self) -> int:
        return round(1e3 * self.vehicle.time)

    @property
    def _microseconds(self) -> int:
        return round(1e6 * self.vehicle.time)

    def _heartbeat(self) -> Sequence[Any]:
        armed = ARMED if self.vehicle.armed else 0
        state = 4 if self.vehicle.armed else 3  # active, or on standby
        kinds = {4: 2, 6: 13, 8: 14}  # quadrotor, hexarotor, octorotor
        kind = kinds.get(len(self.vehicle.vehicle.rotors), 2)
        mode = self.dialect.custom_mode(self._mode)
        return kind, self.dialect.autopilot, CUSTOM_MODE_ENABLED | armed, mode, state, 3

    @property
    def _mode(self) -> Mode:
        """The mode that heartbeats report."""
        guided = self._guided and self.vehicle.mode in (Mode.HOLD, Mode.TAKEOFF)
        return Mode.OFFBOARD if guided else self.vehicle.mode

    def _sys_status(self) -> Sequence[Any]:
        sensors = 0x2F | 0x0C00 | 1 << 28  # gyro, accelerometer, magnetometer, GPS, control, may be armed
        return sensors, sensors, sensors, 100, 16000, -1, 100, 0, 0, 0, 0, 0, 0

    def _extended_state(self) -> Sequence[Any]:
        landed = 1 if self.vehicle.landed else {Mode.TAKEOFF: 3, Mode.LAND: 4}.get(self.vehicle.mode, 2)
        return 0, landed

    def _home(self) -> Sequence[Any]:
        latitude, longitude, altitude = to_global((0.0, 0.0, 0.0))
        upright = (1.0, 0.0, 0.0, 0.0)
        return latitude, longitude, round(1e3 * altitude), 0.0, 0.0, 0.0, upright, 0.0, 0.0, 0.0

    def _gps(self) -> Sequence[Any]:
        latitude, longitude, altitude = to_global(self.vehicle.body.position)
        return self._microseconds, 3, latitude, longitude, round(1e3 * altitude), 100, 100, 0, 0, 12

    def _local_position(self) -> Sequence[Any]:
        body = self.vehicle.body
        return self._milliseconds, *swap_world(body.position), *swap_world(body.velocity)

    def _attitude(self) -> Sequence[Any]:
        body = self.vehicle.body
        return self._milliseconds, *swap_attitude(body.q_world_body), *swap_body(body.omega_body)

    def _global_position(self) -> Sequence[Any]:
        body = self.vehicle.body
        latitude, longitude, altitude = to_global(body.position)
        velocity = (round(100 * v) for v in swap_world(body.velocity))
        heights = round(1e3 * altitude), round(1e3 * body.position[2])
        return self._milliseconds, latitude, longitude, *heights, *velocity, self._heading

    def _odometry(self) -> Sequence[Any]:
        state, body = self.vehicle.state, self.vehicle.body
        velocity = so3.unrotate(state.q_world_body, state.velocity)
        unknown = (nan, *(0.0,) * 20)
        return (
            self._microseconds,
            1,
            12,
            *swap_world(body.position),
            swap_attitude(body.q_world_body),
            *swap_body(tuple(velocity.tolist())),
            *swap_body(body.omega_body),
            unknown,
            unknown,
        )

    @property
    def _heading(self) -> int:
        yaw = swap_yaw(yaw_of(self.vehicle.state.q_world_body))
        return round(100 * degrees(yaw % (2 * pi))) % 36000

    # received messages

    def _take_timesync(self, message: MavlinkMessage) -> None:
        if message.tc1 == 0:
            self._send("timesync", round(1e9 * self.vehicle.time), message.ts1)

    def _take_param_request_read(self, message: MavlinkMessage) -> None:
        self._send_parameter(str(message.param_id))

    def _take_param_request_list(self, message: MavlinkMessage) -> None:
        for name in self.parameters:
            self._send_parameter(name)

    def _take_param_set(self, message: MavlinkMessage) -> None:
        if message.param_id == _TAKEOFF_HEIGHT and 0.5 <= message.param_value <= 100.0:
            self.parameters[message.param_id] = float(message.param_value)
        self._send_parameter(str(message.param_id))

    def _send_parameter(self, name: str) -> None:
        if name in self.parameters:
            index = list(self.parameters).index(name)
            self._send("param_value", name.encode(), self.parameters[name], 9, len(self.parameters), index)

    def _take_command_long(self, message: MavlinkMessage) -> None:
        self._execute(message, (1e7 * message.param5, 1e7 * message.param6, message.param7))

    def _take_command_int(self, message: MavlinkMessage) -> None:
        self._execute(message, (message.x, message.y, message.z))

    def _execute(self, message: MavlinkMessage, place: tuple[float, float, float]) -> None:
        """Execute a command and acknowledge it: accepted, denied, or unknown.

        `place`: latitude and longitude [1e-7 °] and altitude [m].
        """
        known: dict[int, Callable[[], bool]] = {
            400: lambda: self._arm() if message.param1 > 0.5 else self.vehicle.disarm(),
            176: lambda: self._change_mode(_whole(message.param2), _whole(message.param3)),
            22: lambda: self._take_off(place[2]),
            21: self.vehicle.land,
            192: lambda: self._reposition(place, message.param4),
            511: lambda: self._set_interval(_whole(message.param1), message.param2),
            512: lambda: self._send_requested(_whole(message.param1)),
        }
        act = known.get(message.command)
        result = 3 if act is None else 0 if act() else self.dialect.refused  # unsupported, accepted
        source = message.get_srcSystem(), message.get_srcComponent()
        self._send("command_ack", message.command, result, 0, 0, *source)

    def _arm(self) -> bool:
        """Arm; if that is impossible, send the reason and return False."""
        if not self.dialect.offboard_takeoff and not self._guided:
            reason = f"{self._mode.name} mode not armable"
        elif self.vehicle.arm():
            return True
        else:
            reason = "it lies where it crashed"
        self._send("statustext", 2, f"{self.dialect.refusal}: {reason}".encode()[:50])
        return False

    def _change_mode(self, main: int, sub: int) -> bool:
        orders = {
            Mode.TAKEOFF: self._take_off,
            Mode.HOLD: self.vehicle.hold,
            Mode.LAND: self.vehicle.land,
            Mode.OFFBOARD: self.vehicle.go_offboard if self.dialect.offboard_takeoff else self.vehicle.hold,
        }
        wanted = next((mode for mode, numbers in self.dialect.modes.items() if numbers == (main, sub)), None)
        if wanted is None or not ((wanted is Mode.OFFBOARD and self._guided) or orders[wanted]()):
            return False
        self._guided = wanted is Mode.OFFBOARD and not self.dialect.offboard_takeoff
        return True

    def _take_off(self, height: float = 0.0) -> bool:
        """Take off: PX4 by the height of its own parameter, others by the order's height [m] if guided."""
        if self.dialect.offboard_takeoff:
            height = self.parameters[_TAKEOFF_HEIGHT]
        return (
            height > 0.0 and (self.dialect.offboard_takeoff or self._guided) and self.vehicle.take_off(height)
        )

    def _reposition(self, place: tuple[float, float, float], yaw: float) -> bool:
        latitude, longitude, altitude = place
        if not all(map(isfinite, place)):
            return False
        goal = np.array(from_global(round(latitude), round(longitude), altitude))
        return self.vehicle.go_to(goal, swap_yaw(yaw) if isfinite(yaw) else None)

    def _set_interval(self, identity: int, microseconds: float) -> bool:
        if identity not in self._streams:
            return False
        stream = self._streams[identity]
        stream.interval = stream.due = inf
        if microseconds >= 0:
            stream.interval, stream.due = max(1e-6 * microseconds, 0.004), self.vehicle.time
        return True

    def _send_requested(self, identity: int) -> bool:
        if identity == message_class("autopilot_version").id:
            capabilities = 64 | 128 | 8192 | 16384  # set-points in three ways, MAVLink 2
            none = (0,) * 8
            self._send(
                "autopilot_version", capabilities, self.dialect.firmware, 0, 0, 0, none, none, none, 0, 0, 1
            )
            return True
        if identity not in self._streams:
            return False
        stream = self._streams[identity]
        self._send(stream.name, *stream.fields())
        return True

    def _take_set_position_target_local_ned(self, message: MavlinkMessage) -> None:
        """Follow a point with velocity and acceleration; for a velocity alone, from the present position."""
        mask = message.type_mask
        state = self.vehicle.state
        position = state.position
        if not mask & _IGNORED_POSITION:
            position = np.array(swap_world((message.x, message.y, message.z)))
        velocity, acceleration = np.zeros(3), np.zeros(3)
        if not mask & _IGNORED_VELOCITY:
            velocity = np.array(swap_world((message.vx, message.vy, message.vz)))
        if not mask & _IGNORED_ACCELERATION:
            acceleration = np.array(swap_world((message.afx, message.afy, message.afz)))
        yaw = yaw_of(state.q_world_body) if mask & _IGNORED_YAW else swap_yaw(message.yaw)
        numbers = np.concatenate([position, velocity, acceleration, [yaw]])
        if np.isfinite(numbers).all():
            self.vehicle.follow_point(PositionGoal(position, velocity, acceleration, yaw))
            self._obey_set_points(not self.vehicle.landed)

    def _take_set_attitude_target(self, message: MavlinkMessage) -> None:
        """Follow an attitude with its rates and thrust; a message without an attitude is ignored."""
        if message.type_mask & _IGNORED_ATTITUDE:
            return
        q = swap_attitude(tuple(message.q))
        rates = (0.0, 0.0, 0.0)
        if not message.type_mask & _IGNORED_RATES:
            rates = swap_body((message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate))
        thrust = message.thrust * float(self.vehicle.vehicle.max_thrusts.sum())
        if np.isfinite([*q, *rates, thrust]).all() and np.linalg.norm(q) > 0.5:
            self.vehicle.follow_attitude(AttitudeGoal(q, rates, thrust), 1e-3 * message.time_boot_ms)
            self._obey_set_points(thrust > 0.0)

    def _obey_set_points(self, flies: bool) -> None:
        """Enter offboard control in the mode GUIDED, which is active without set-points too."""
        if flies and self._guided and self.vehicle.mode in (Mode.HOLD, Mode.TAKEOFF):
            self.vehicle.go_offboard()


def _whole(number: float) -> int:
    """Return a command's integer that is sent as a float, −1 for a number that is not finite."""
    return int(number) if isfinite(number) else -1
