"""A client that flies a plan on an autopilot over MAVLink, from take-off to landing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from math import hypot, inf, isnan, nan

import numpy as np

from aerobat.arrays import Array
from aerobat.errors import SpecError
from aerobat.links.clock import Clock, ticks
from aerobat.links.commander import rehearse
from aerobat.links.goals import Mode, Observed, PositionGoal, yaw_of
from aerobat.links.mavlink.autopilot_link import AutopilotLink
from aerobat.links.mavlink.connection import Connection
from aerobat.links.mission import Mission, MissionSettings, Phase
from aerobat.links.path_follower import PathFollower
from aerobat.links.report import LinkReport, link_report
from aerobat.links.stream import SetpointStream
from aerobat.planning import Plan

_HOVER_TOLERANCE = 0.1  # [-] largest relative difference of hover thrust from the plan's vehicle
_STREAM_TIME = 1.2  # [s] of streamed set-points that PX4 requires before the mode offboard
_TAKEOFF_HEIGHT = 1.0  # [m] height of take-off for vehicles that set-points cannot lift off the ground
_TAKEOFF_TOLERANCE = 0.2  # [m] height error within which take-off is complete
_ORDER_TIMEOUT = 8.0  # [s] time limit for a vehicle to obey an order
_HOVER_DWELL = 3.0  # [s] of hover after an abort, before landing
_HOVER_SPEED = 0.3  # [m/s] largest speed of a hover
_MAX_SILENCE = 10.0  # [s] without news after an abort; then the vehicle is ordered to land, or given up
_RECOVERY_TIMEOUT = 60.0  # [s] time limit for coming to a hover, and for a landing beside the descent
_MIN_DESCENT_SPEED = 0.2  # [m/s] slowest descent of a landing


class ClientStage(StrEnum):
    """Stage of a client's flight."""

    CONNECTING = "connecting"
    ASKING = "asking the vehicle"
    ARMING = "arming"
    TAKING_OFF = "taking off"
    FLYING = "flying"
    RECOVERING = "hovering after the abort"
    LANDING = "landing"
    LANDED = "landed"
    LOST = "out of reach"


@dataclass(frozen=True)
class ClientSettings:
    """Settings of the link."""

    rate: float = 200.0  # [1/s] of set-points
    wait: float = 10.0  # [s] for a vehicle to answer
    hover_thrust: float | None = None  # [-] where the vehicle does not say it
    system: int | None = None  # number among MAVLink's systems; None for the only vehicle


class Client:
    """One flight of a plan; call `tick` at the settings' rate until it is `done`."""

    def __init__(
        self,
        plan: Plan,
        connection: Connection,
        *,
        offset: Array,
        mission: MissionSettings = MissionSettings(),  # noqa: B008 - frozen
        settings: ClientSettings = ClientSettings(),
        say: Callable[[str], None] = lambda sentence: None,
        announcement: str = "",
    ) -> None:
        """Prepare to fly.

        Args:
            plan: the plan; see `require_flyable`.
            connection: to the vehicle.
            offset: position of the plan's origin in the vehicle's frame [m], ENU, (3,).
            mission: settings of the flight and its abort criteria.
            settings: of the link.
            say: receives sentences about the progress.
            announcement: a sentence for `say` before the vehicle is armed.
        """
        assert plan.vehicle is not None, "a plan that is flyable has a vehicle"
        environment = plan.problem.environment
        rehearse(plan.vehicle, environment.gravity)
        stream = SetpointStream(plan.trajectory, plan.vehicle, environment, offset)
        follower = PathFollower(stream, plan.vehicle, environment)
        self.mission = Mission(plan, mission, stream, follower.command)
        self._plan = plan
        self.link = AutopilotLink(connection, settings.system, say)
        self.stage = ClientStage.CONNECTING
        self.settings = settings
        self._say = say
        self._announcement = announcement
        self._now = self._began = nan  # [s] time of the last tick, and start time of the present stage
        self._ground: PositionGoal | None = None
        self._hovering_since = inf
        self._refusal = ""  # the reason why the plan was not begun
        self._lost = ""  # the reason why the vehicle was not followed to the ground
        self._name = plan.vehicle.name
        self._weight = plan.vehicle.mass * environment.gravity
        self._max_thrust = float(plan.vehicle.max_thrusts.sum())  # [N] corrected by the vehicle's hover later

    @property
    def done(self) -> bool:
        """True once the flight has ended."""
        return self.stage in (ClientStage.LANDED, ClientStage.LOST)

    def tick(self, now: float) -> None:
        """Process received messages at this time [s], and send due ones.

        Raises SpecError for a vehicle that does not answer, is not the plan's, or cannot be armed; nothing is
        flown then.
        """
        self._now = round(now, 3)  # goals are computed for their time stamps, which are whole milliseconds
        if isnan(self._began):
            self._began = self._now
        for state in self.link.receive(self._now):
            self.mission.observe(state)
        getattr(self, f"_while_{self.stage.name.lower()}")()

    def abort(self, now: float, reason: str) -> None:
        """Abort the flight: a vehicle that may be in the air is ordered to hover, then to land."""
        if self.stage in (ClientStage.ARMING, ClientStage.TAKING_OFF, ClientStage.FLYING):
            self._now = now
            self.mission.abort(now, reason)
            self._recover()
        else:
            self._lost = reason

    def report(self) -> LinkReport:
        """Return the report of the flight."""
        return link_report(
            self._plan,
            self.mission.stream,
            self.mission.log,
            aborted=self.mission.reason or self._lost,
            ended=str(self.stage),
            delay=self.link.delay,
            late=self.mission.max_lateness,
        )

    def _enter(self, stage: ClientStage) -> None:
        self.stage, self._began = stage, self._now

    @property
    def _observed(self) -> Observed:
        assert self.link.observed is not None, "flown only once it is seen"
        return self.link.observed

    @property
    def _elapsed(self) -> float:
        """The time in the present stage [s]."""
        return self._now - self._began

    def _while_connecting(self) -> None:
        if self.link.is_known:
            self._enter(ClientStage.ASKING)
        elif self._elapsed > self.settings.wait:
            waited, heard = f"{self.settings.wait:g} s", ", ".join(map(str, sorted(self.link.systems)))
            if heard:
                raise SpecError(
                    f"system {self.settings.system} does not answer within {waited}; those heard are: {heard}"
                )
            raise SpecError(f"no vehicle answers within {waited}; check the address, and that it is on")

    def _require_one_system(self) -> None:
        """Raise SpecError where several autopilots answer and the settings name none."""
        if self.settings.system is None and len(self.link.systems) > 1:
            numbers = " and ".join(map(str, sorted(self.link.systems)))
            raise SpecError(f"the systems {numbers} answer; name the vehicle's by --system")

    def _while_asking(self) -> None:
        """Wait for the vehicle's clock, state and parameters, and check that it is the plan's vehicle."""
        self._require_one_system()
        dialect, parameters = self.link.dialect, self.link.parameters
        hover = self.settings.hover_thrust or parameters.get(dialect.hover_thrust)
        unknown = [name for name in dialect.settings if name not in parameters]
        unknown += [dialect.hover_thrust] if hover is None else []
        for name in unknown:
            self.link.ask_parameter(name)
        if hover and not unknown and self.link.observed is not None and self.link.landed is not None:
            self._check(hover)
            self._max_thrust = self._weight / hover
            body = self._observed.body
            self._ground = PositionGoal.hover(np.array(body.position), yaw_of(body.q_world_body))
            self._say(f"connected; a message takes {1e3 * self.link.delay:.0f} ms")
            if self._announcement:
                self._say(self._announcement)
            self.link.complaints.clear()
            self._enter(ClientStage.ARMING)
        elif self._elapsed > self.settings.wait:
            missing = f"its state ({', '.join(dialect.states)})"
            remedy = "have it send that"
            if unknown:
                missing, remedy = f"its parameter {unknown[-1]}", "have it send its parameters"
            if hover is None:
                remedy = "give --hover-thrust"
            waited = f"{self.settings.wait:g} s"
            raise SpecError(f"the vehicle does not tell {missing} within {waited}; {remedy}")

    def _check(self, hover: float) -> None:
        if not self.link.landed:
            raise SpecError("the vehicle is flying already; land it first")
        for name, setting in self.link.dialect.settings.items():
            value = round(self.link.parameters[name])
            if value & setting.mask != setting.bits:
                wanted = value & ~setting.mask | setting.bits
                raise SpecError(
                    f"the vehicle's parameter {name} is {value}: {setting.meaning}; set it to {wanted}"
                )
        planned = self._weight / self._max_thrust
        if not abs(hover / planned - 1.0) <= _HOVER_TOLERANCE:
            raise SpecError(
                f"the vehicle hovers at {hover:.3f} of its thrust, {self._name} at {planned:.3f}: "
                "the plan is for another vehicle; plan it for this one"
            )

    def _while_arming(self) -> None:
        """Stream the vehicle's position, as PX4 requires before offboard; then set the mode, then arm."""
        assert self._ground is not None, "its state is known"
        self.link.follow(self._ground, self._max_thrust)
        if self._elapsed <= _STREAM_TIME:
            self._require_one_system()
        else:
            self.link.set_mode(Mode.OFFBOARD)
            if self.link.mode is Mode.OFFBOARD:
                self.link.arm()
        if self.link.armed and self.link.mode is Mode.OFFBOARD:
            self._say("armed")
            self._enter(ClientStage.TAKING_OFF)
            self._while_taking_off()
        elif self._elapsed > _ORDER_TIMEOUT:
            # a vehicle that was ordered to arm may be armed, and is ordered to land
            has_mode = self.link.mode is Mode.OFFBOARD
            self._refuse("arm" if has_mode else "take the mode offboard", lands=has_mode)

    def _while_taking_off(self) -> None:
        """Order a take-off for vehicles that set-points cannot lift off the ground; then begin to fly."""
        assert self._ground is not None, "its state is known"
        height = self._observed.body.position[2] - self._ground.position[2]
        if self.link.dialect.offboard_takeoff or abs(height - _TAKEOFF_HEIGHT) < _TAKEOFF_TOLERANCE:
            self.mission.begin(self._now, self._observed)
            self._enter(ClientStage.FLYING)
        elif self._elapsed > _ORDER_TIMEOUT:
            self._refuse("take off")
        elif not self._yields_to_pilot():
            self.link.take_off(_TAKEOFF_HEIGHT)

    def _refuse(self, what: str, lands: bool = True) -> None:
        """Land, if necessary, then raise SpecError with the vehicle's own complaints."""
        complaints = "; ".join(self.link.complaints)
        reason = f": {complaints}" if complaints else "; its own ground station says why"
        self._refusal = f"the vehicle does not {what}{reason}"
        if not lands:
            raise SpecError(self._refusal)
        self._land(f"the vehicle does not {what}")

    def _while_flying(self) -> None:
        phase = self.mission.phase
        goal = self.mission.step(self._now, self._observed, self.link.delay)
        if self.mission.phase is not Phase.LAND:
            self._watch_vehicle()
        if self.mission.phase is Phase.ABORTED:
            self._recover()
            return
        if self.mission.phase is not phase:
            self._say(str(self.mission.phase))
        if self.mission.phase is Phase.LAND:
            self._land()
        elif goal is not None:
            self.link.follow(goal, self._max_thrust)

    def _watch_vehicle(self) -> None:
        """Abort where the vehicle has left the mode offboard or is disarmed."""
        if self.link.mode is not Mode.OFFBOARD:
            mode = "a mode of a pilot's" if self.link.mode is None else f"the mode {self.link.mode}"
            self.mission.abort(self._now, f"the vehicle went into {mode}")
        elif not self.link.armed:
            self.mission.abort(self._now, "the vehicle was disarmed")

    def _recover(self) -> None:
        self._say(f"aborted: {self.mission.reason}; the vehicle is told to hover")
        self._enter(ClientStage.RECOVERING)
        self._while_recovering()

    def _while_recovering(self) -> None:
        """Order a hover; once the vehicle has hovered for a while, or is not seen to, order it to land."""
        if self._yields_to_pilot():
            return
        self.link.set_mode(Mode.HOLD)
        silence = self._now - self._observed.time
        is_still = hypot(*self._observed.body.velocity) < _HOVER_SPEED
        is_seen = silence < self.mission.settings.max_silence_outside
        hovers = is_still and is_seen and self.link.mode is Mode.HOLD
        self._hovering_since = min(self._hovering_since, self._now) if hovers else inf
        if silence > _MAX_SILENCE:
            self._land("no news of the vehicle")
        elif self._now - self._hovering_since > _HOVER_DWELL or self._is_down:
            self._land()
        elif self._elapsed > _RECOVERY_TIMEOUT:
            self._land("the vehicle does not come to a hover")

    def _land(self, reason: str = "") -> None:
        """Order a landing, with a reason that is reported."""
        if reason:
            self._say(f"{reason}; it is told to land")
        self._enter(ClientStage.LANDING)
        self._while_landing()

    def _while_landing(self) -> None:
        """Order a landing until the vehicle has landed, a pilot takes over, or it does not obey in time."""
        height = max(self._observed.body.position[2], 0.0)
        if self._is_down and self._refusal:
            raise SpecError(self._refusal)
        if self._is_down:
            self._enter(ClientStage.LANDED)
            self._say("landed")
        elif not self._yields_to_pilot():
            self.link.set_mode(Mode.LAND)
            if self._now - max(self.link.heard, self._began) > _MAX_SILENCE:
                self._lose("no news of the vehicle")
            elif self._elapsed > _RECOVERY_TIMEOUT + height / _MIN_DESCENT_SPEED:
                self._lose("the vehicle does not land as it is told")

    @property
    def _is_down(self) -> bool:
        """True for a vehicle that reports, after the last order, that it is landed and disarmed."""
        return bool(self.link.landed) and not self.link.armed and self.link.beat > self._began

    def _yields_to_pilot(self) -> bool:
        """Return True where a pilot has taken over; the vehicle is then left to the pilot."""
        if self.link.mode is not None:
            return False
        self._lose("a pilot has taken over", "the pilot")
        return True

    def _lose(self, reason: str, left_to: str = "its own failsafe") -> None:
        self._enter(ClientStage.LOST)
        self._lost = reason
        self._say(f"{reason}; it is left to {left_to}")


def run(client: Client, clock: Clock) -> None:
    """Tick a client until it is done. On Ctrl-C, order the vehicle to hover first."""
    try:
        for now in ticks(clock, client.settings.rate):
            client.tick(now)
            if client.done:
                return
    except KeyboardInterrupt:
        client.abort(clock.now(), "interrupted")
        for now in ticks(clock, client.settings.rate, clock.now() + 1.0):
            if client.stage is not ClientStage.RECOVERING:
                break
            client.tick(now)
        raise
