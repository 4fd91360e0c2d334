"""A client and a simulated vehicle over MAVLink in one process, in steps of a clock that nobody waits for."""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import aerobat as ab
from aerobat.arrays import Array
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.mavlink.client import Client, ClientSettings
from aerobat.links.mavlink.connection import LossyConnection, dialect
from aerobat.links.mavlink.dialects import DIALECTS, PX4, Dialect
from aerobat.links.mavlink.front_end import FrontEnd
from aerobat.links.mission import MissionSettings, Phase
from shared_plans import shared_plan

STEP = 0.001  # [s]
VEHICLE_STEPS, CLIENT_STEPS = 4, 5  # between ticks of either end: 250 and 200 a second
ORIGIN = np.array([0.0, 0.0, 3.0])


def flip() -> ab.Plan:
    """The flip in roll by the agile quadrotor, with thrust left for what a link adds."""
    return shared_plan("flip-roll", "agile-quad", ab.Miqp(reserve=0.2))


@cache
def _reached(phase: Phase, loss: float, delay: float, name: str) -> Sky:
    """A flight whose mission is just in a phase, SETTLE or MANEUVER."""
    before = phase is Phase.SETTLE
    fresh = Sky(loss=loss, delay=delay, speaks=DIALECTS[name]) if before else None
    sky = fresh or _reached(Phase.SETTLE, loss, delay, name).branched()
    sky.run(lambda: sky.client.mission.phase is phase)
    return sky


def over_a_link(
    loss: float = 0.01,
    delay: float = 0.02,
    settings: MissionSettings | None = None,
    phase: Phase = Phase.MANEUVER,
    name: str = "px4",
) -> Sky:
    """The flip, just begun over a link that loses so many and takes so long [s], either way, in a dialect."""
    sky = _reached(phase, loss, delay, name).branched()
    if settings is not None:
        sky.client.mission.settings = settings
    return sky


class SteppedClock:
    """Time that passes when it is told to."""

    def __init__(self) -> None:
        self.steps = 0

    def now(self) -> float:
        return self.steps * STEP

    def sleep_until(self, instant: float) -> None:
        raise AssertionError("nothing waits here")


class Wire:
    """One end of a wire that carries the bytes of messages."""

    def __init__(self, system: int, component: int) -> None:
        self._numbers = system, component
        self._mav = dialect().MAVLink(self, srcSystem=system, srcComponent=component)
        self._parser = dialect().MAVLink(None)
        self._incoming: list[bytes] = []
        self.other = self

    def __deepcopy__(self, memo: dict[int, Any]) -> Wire:
        copied = memo[id(self)] = Wire(*self._numbers)
        copied._incoming = list(self._incoming)
        copied.other = copy.deepcopy(self.other, memo)
        return copied

    def write(self, data: bytes) -> None:
        self.other._incoming.append(bytes(data))

    def send(self, message: Any) -> None:
        self._mav.send(message)

    def receive(self) -> list[Any]:
        messages = [one for data in self._incoming for one in self._parser.parse_buffer(data) or []]
        self._incoming.clear()
        return messages

    def close(self) -> None:
        pass


class Cable:
    """A connection that can be cut, either way, and by which somebody may do as he likes."""

    def __init__(self, connection: Any) -> None:
        self._connection = connection
        self.receives = self.sends = True
        self.change: Callable[[Any], list[Any]] = lambda message: [message]  # of what is received
        self.sent: list[Any] = []

    def receive(self) -> list[Any]:
        messages = self._connection.receive() if self.receives else []
        return [changed for message in messages for changed in self.change(message)]

    def send(self, message: Any) -> None:
        self.sent.append(message)
        if self.sends:
            self._connection.send(message)

    def close(self) -> None:
        pass


class Sky:
    """Both ends, and what really happened."""

    def __init__(
        self,
        plan: ab.Plan | None = None,
        vehicle: ab.Vehicle | None = None,
        *,
        loss: float = 0.0,
        delay: float = 0.0,
        seed: int = 0,
        mission: MissionSettings | None = None,
        settings: ClientSettings | None = None,
        speaks: Dialect = PX4,
    ) -> None:
        plan = flip() if plan is None else plan
        flying = plan.vehicle if vehicle is None else vehicle
        assert flying is not None
        self.clock = SteppedClock()
        client_end, vehicle_end = Wire(245, 191), Wire(1, 1)
        client_end.other, vehicle_end.other = vehicle_end, client_end
        lossy = LossyConnection(vehicle_end, self.clock, loss=loss, delay=delay, seed=seed)
        self.said: list[str] = []
        self.cable = Cable(client_end)
        self.vehicle = SimulatedVehicle(flying, plan.problem.environment)
        self.front_end = FrontEnd(self.vehicle, lossy, speaks=speaks)
        self.client = Client(
            plan,
            self.cable,
            offset=ORIGIN,
            mission=mission or MissionSettings(),
            settings=settings or ClientSettings(),
            say=self.note,
        )
        self.client_lives = True
        self.heights: list[float] = []  # [m] from the plan's begin on
        self.errors: list[float] = []  # [m] along the plan

    def note(self, sentence: str) -> None:
        """Take a sentence of the client's."""
        self.said.append(sentence)

    def branched(self) -> Sky:
        """The same, to go on by itself."""
        whole = (dialect(), self.vehicle._body._loop)
        kept: dict[int, Any] = {id(part): part for part in whole}
        return copy.deepcopy(self, {**kept, id(self.cable.sent): []})

    @property
    def since_begin(self) -> float:
        """Since the plan's begin [s], NaN before it."""
        return self.clock.now() - self.client.mission.maneuver_began

    def run(self, until: Callable[[], bool], limit: float = 40.0) -> None:
        """Go on until something holds, for no longer than so many seconds."""
        end = self.clock.now() + limit
        while not until():
            assert self.clock.now() < end, f"not reached: {self.said}, {self.client.stage}"
            self.clock.steps += 1
            if self.clock.steps % VEHICLE_STEPS == 0:
                self.front_end.tick(self.clock.now())
                self._note()
            if self.clock.steps % CLIENT_STEPS == 0 and self.client_lives:
                self.client.tick(self.clock.now())

    def run_for(self, seconds: float) -> None:
        """Go on for a time [s]."""
        end = self.clock.steps + round(seconds / STEP)
        self.run(lambda: self.clock.steps >= end, limit=2 * seconds)

    def run_into_the_plan(self, seconds: float) -> None:
        """Go on until the plan is flown for so long [s]."""
        self.run(lambda: self.since_begin >= seconds)

    @property
    def position(self) -> Array:
        """The true one [m]."""
        return self.vehicle.state.position

    @property
    def hovers(self) -> bool:
        """True of a vehicle that stands in the air."""
        is_still = float(np.linalg.norm(self.vehicle.state.velocity)) < 0.05
        return is_still and not self.vehicle.landed and not self.vehicle.crashed

    def _note(self) -> None:
        mission = self.client.mission
        since = self.vehicle.time - mission.maneuver_began
        if since >= 0.0:
            self.heights.append(float(self.position[2]))
        if mission.phase is Phase.MANEUVER and 0.0 <= since <= mission.stream.duration:
            off = self.position - mission.stream.flat(since).position
            self.errors.append(float(np.linalg.norm(off)))
