"""Flights by `aerobat link mavlink` with a man in the middle: real sockets, steps of a clock of their own.

    uv run --dev python tests/support/man_in_the_middle.py 200

flies so many and prints what came of them.
"""

from __future__ import annotations

import contextlib
import heapq
import io
import json
import socket
import struct
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from aerobat.cli.failures import ExitCode
from aerobat.links.autopilot.vehicle import SimulatedVehicle
from aerobat.links.mavlink import connection
from aerobat.links.mavlink.client import Client, ClientStage
from aerobat.links.mavlink.connection import dialect
from aerobat.links.mavlink.front_end import FrontEnd
from command_lines import code
from mavlink_sky import flip

STEP = 0.004  # [s] from one tick of the vehicle to the next
LONGEST = 400.0  # [s] of a flight
OFF = 0.3  # [m] off its plan that a vehicle may be that is said to have flown it
PLAN = (6.0, 8.5)  # [s] when the plan is flown
FOREIGN = 7  # the number of another system
HANDLED = {"ODOMETRY", "HEARTBEAT", "EXTENDED_SYS_STATE", "TIMESYNC", "PARAM_VALUE", "STATUSTEXT"}


class Parcel(NamedTuple):
    """A message on its way, or what has become of it."""

    message: Any
    delay: float = 0.0  # [s]
    data: bytes | None = None  # in place of the message's own
    system: int = 1


Random = np.random.Generator
Fault = Callable[[Parcel, Random], Iterable[Parcel]]


def changed(parcel: Parcel, **fields: Any) -> Parcel:
    """A parcel with other values in its message's fields."""
    message = deepcopy(parcel.message)
    for name, value in fields.items():
        setattr(message, name, value)
    return parcel._replace(message=message)


def of_states(change: Callable[[Any, Random], dict[str, Any]], chance: float = 1.0) -> Fault:
    """A fault of states alone: the fields that change."""

    def fault(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
        is_hit = parcel.message.get_type() == "ODOMETRY" and rng.random() < chance
        yield changed(parcel, **change(parcel.message, rng)) if is_hit else parcel

    return fault


def spoilt(value: float) -> Callable[[Any, Random], dict[str, Any]]:
    """A number of a state, whichever, replaced."""

    def change(message: Any, rng: Random) -> dict[str, Any]:
        name = rng.choice(["x", "y", "z", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed", "q"])
        return {str(name): [value, *message.q[1:]] if name == "q" else value}

    return change


def shifted(seconds: float) -> Fault:
    """The vehicle's clock, ahead by so long: states and answers."""

    def fault(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
        kind, message = parcel.message.get_type(), parcel.message
        if kind == "ODOMETRY":
            yield changed(parcel, time_usec=max(round(message.time_usec + 1e6 * seconds), 0))
        elif kind == "TIMESYNC" and message.tc1:
            yield changed(parcel, tc1=max(round(message.tc1 + 1e9 * seconds), 1))
        else:
            yield parcel

    return fault


def delayed(longest: float) -> Fault:
    return lambda parcel, rng: [parcel._replace(delay=parcel.delay + rng.uniform(0.0, longest))]


def doubled(parcel: Parcel, rng: Random) -> list[Parcel]:
    return [parcel, parcel._replace(delay=parcel.delay + rng.uniform(0.0, 0.3))]


def lost(chance: float) -> Fault:
    return lambda parcel, rng: [] if rng.random() < chance else [parcel]


def foreign_system(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
    """Another autopilot beside ours, of another mode and place."""
    yield parcel
    kind = parcel.message.get_type()
    if kind == "HEARTBEAT":
        yield changed(parcel, base_mode=1, custom_mode=int(rng.integers(2**32)))._replace(system=FOREIGN)
    elif kind == "ODOMETRY":
        yield changed(parcel, x=50.0, time_usec=int(rng.integers(2**40)))._replace(system=FOREIGN)
    else:
        yield parcel._replace(system=FOREIGN)


def foreign_answers(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
    """Those that a ground station asked for, beside each of ours."""
    yield parcel
    if parcel.message.get_type() == "TIMESYNC":
        yield changed(parcel, ts1=parcel.message.ts1 + int(rng.integers(-(10**9), 10**9)))


def lies(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
    """On the ground or not, and parameters, at random."""
    kind = parcel.message.get_type()
    if kind == "EXTENDED_SYS_STATE":
        yield changed(parcel, landed_state=int(rng.integers(0, 5)))
    elif kind == "PARAM_VALUE":
        yield changed(parcel, param_value=float(rng.choice([np.nan, np.inf, 0.0, -1.0])))
    else:
        yield parcel


def of_heartbeats(change: Callable[[Random], dict[str, Any]]) -> Fault:
    def fault(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
        is_beat = parcel.message.get_type() == "HEARTBEAT"
        yield changed(parcel, **change(rng)) if is_beat else parcel

    return fault


def damaged(chance: float) -> Fault:
    """Packets cut short, or with other bytes, or with some between."""

    def fault(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
        data = packed(parcel)
        if data and rng.random() < chance:
            place = int(rng.integers(len(data)))
            junk = rng.bytes(int(rng.integers(1, 20)))
            data = [data[:place], data[:place] + junk + data[place:], data[:place] + junk][rng.integers(3)]
        yield parcel._replace(data=data)

    return fault


def of_any_kind(parcel: Parcel, rng: Random) -> Iterator[Parcel]:
    """Whole messages of kinds that we do not handle, or rarely of those that we do, of random bytes."""
    yield parcel
    kinds = list(dialect().mavlink_map.values())
    kind = kinds[rng.integers(len(kinds))]
    if kind.msgname not in HANDLED or rng.random() < 0.2:
        payload = rng.bytes(struct.calcsize(kind.unpacker.format))
        head = struct.pack("<BBBBBBBHB", 253, len(payload), 0, 0, 0, 1, 1, kind.id & 0xFFFF, kind.id >> 16)
        crc = dialect().x25crc((head + payload)[1:] + bytes([kind.crc_extra])).crc
        yield parcel._replace(data=head + payload + struct.pack("<H", crc))


# what happens to messages for the client, each for a span of time
FAULTS: dict[str, Fault] = {
    "states of NaN": of_states(spoilt(np.nan)),
    "some states of NaN": of_states(spoilt(np.nan), 0.1),
    "states of infinity": of_states(spoilt(np.inf)),
    "some huge states": of_states(spoilt(3e38), 0.1),
    "states of no attitude": of_states(lambda message, rng: {"q": [0.3 * part for part in message.q]}),
    "states 5 m aside": of_states(lambda message, rng: {"x": message.x + 5.0}),
    "early states": of_states(lambda m, rng: {"time_usec": m.time_usec + int(10 ** rng.uniform(4, 13))}),
    "some early states": of_states(lambda m, rng: {"time_usec": m.time_usec + 10**12}, 0.05),
    "old states": of_states(lambda m, rng: {"time_usec": rng.integers(0, m.time_usec, endpoint=True)}),
    "delays": delayed(0.2),
    "long delays": delayed(1.0),
    "other order": delayed(0.03),
    "copies": doubled,
    "losses": lost(0.3),
    "silence": lost(1.0),
    "a foreign system": foreign_system,
    "foreign answers": foreign_answers,
    "lies": lies,
    "no arms": of_heartbeats(lambda rng: {"base_mode": 1}),
    "a pilot": of_heartbeats(lambda rng: {"custom_mode": 1 << 16}),
    "random modes": of_heartbeats(lambda rng: {"custom_mode": int(rng.integers(2**32))}),
    "damaged packets": damaged(0.3),
    "more damaged packets": damaged(0.9),
    "random messages": of_any_kind,
    **{f"a clock {shift:+g} s off": shifted(shift) for shift in (-1e6, -0.3, 0.02, 0.3, 1e6)},
}
MODES = ("a reboot", "a failsafe")
BREAKS = ("the connection closed", "the connection reset")
# what happens at an instant, or to messages of the client
EVENTS = (*MODES, "a deaf vehicle", "orders lost", *BREAKS)


@dataclass
class Mischief:
    """A fault, when it is on."""

    name: str
    begin: float  # [s]
    end: float  # [s]

    def is_on(self, now: float) -> bool:
        return self.begin <= now < self.end

    def __str__(self) -> str:
        return f"{self.name} from {self.begin:.1f} to {self.end:.1f} s"


def packed(parcel: Parcel, first: bool = False) -> bytes:
    """A parcel's bytes, by MAVLink 1 where that is asked and has such messages."""
    if parcel.data is not None:
        return parcel.data
    packer = dialect().MAVLink(None, srcSystem=parcel.system, srcComponent=1)
    data: bytes = parcel.message.pack(packer, force_mavlink1=first and parcel.message.id < 256)
    return data


class Middle:
    """The man in the middle: the vehicle's connection, and a server to the client."""

    def __init__(self, tcp: bool, first: bool, mischief: list[Mischief], rng: Random) -> None:
        self.tcp, self._first, self.mischief, self._rng = tcp, first, mischief, rng
        self.now = 0.0
        self.not_finite = 0  # set-points
        self._parser = dialect().MAVLink(None)
        self._parser.robust_parsing = True
        self._going: list[tuple[float, int, bytes]] = []
        self._order = count()
        self._client: Any = None  # an address, or a socket
        self._server = socket.socket(socket.AF_INET, socket.SOCK_STREAM if tcp else socket.SOCK_DGRAM)
        self._server.bind(("127.0.0.1", 0))
        self._server.setblocking(False)
        if tcp:
            self._server.listen()

    @property
    def address(self) -> str:
        return f"{'tcp' if self.tcp else 'udp'}:127.0.0.1:{self._server.getsockname()[1]}"

    def is_on(self, *names: str) -> bool:
        return any(each.name in names and each.is_on(self.now) for each in self.mischief)

    def close(self) -> None:
        self.hang_up(reset=False)
        self._server.close()

    def hang_up(self, reset: bool) -> None:
        """End a client's connection by TCP."""
        if self.tcp and self._client is not None:
            if reset:
                self._client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            self._client.close()
            self._client = None

    def receive(self) -> list[Any]:
        """The orders of the client that reach the vehicle."""
        messages = self._parser.parse_buffer(self._read()) or []
        for message in messages:
            numbers = [getattr(message, name) for name in message.fieldnames if name != "yaw_rate"]
            is_setpoint = message.get_type().startswith("SET_")
            self.not_finite += is_setpoint and not np.isfinite(np.hstack(numbers)).all()
        if self.is_on("a deaf vehicle"):
            return []
        return [m for m in messages if not (self.is_on("orders lost") and self._rng.random() < 0.4)]

    def send(self, message: Any) -> None:
        """Send what becomes of a message of the vehicle's."""
        parcels = [Parcel(message)]
        for each in self.mischief:
            if each.is_on(self.now) and each.name in FAULTS:
                parcels = [made for parcel in parcels for made in FAULTS[each.name](parcel, self._rng)]
        for parcel in parcels:
            due = self.now + parcel.delay
            heapq.heappush(self._going, (due, next(self._order), packed(parcel, self._first)))

    def pump(self) -> None:
        """Send what is due."""
        if self.is_on(*BREAKS):
            self.hang_up(reset=self.is_on(BREAKS[1]))
            self._going.clear()
            with contextlib.suppress(OSError):  # nor is another one let in
                if self.tcp:
                    self._server.accept()[0].close()
            return
        if self.tcp and self._client is None:
            with contextlib.suppress(BlockingIOError):
                self._client, _ = self._server.accept()
                self._client.setblocking(False)
        while self._going and self._going[0][0] <= self.now:
            _, _, data = heapq.heappop(self._going)
            with contextlib.suppress(OSError):
                if self._client is not None and self.tcp:
                    self._client.send(data)
                elif self._client is not None:
                    self._server.sendto(data, self._client)

    def _read(self) -> bytes:
        chunks = b""
        while True:
            try:
                if self.tcp:
                    data = self._client.recv(65536) if self._client is not None else b""
                else:
                    data, self._client = self._server.recvfrom(65536)
            except BlockingIOError:
                return chunks
            except OSError:
                data = b""
            if not data:
                if self.tcp and self._client is not None:
                    self.hang_up(reset=False)
                return chunks
            chunks += data


class Endless(Exception):
    """A flight that does not end."""


class SteppedFlight:
    """The vehicle of a flight, and its clock, by which it and the man in the middle go on."""

    def __init__(self, middle: Middle) -> None:
        plan = flip()
        assert plan.vehicle is not None
        self.steps = 0
        self.middle = middle
        self.vehicle = SimulatedVehicle(plan.vehicle, plan.problem.environment)
        self.front_end = FrontEnd(self.vehicle, middle)
        self.path: list[tuple[float, np.ndarray]] = []  # [s], [m] where it really was
        events = (each for each in middle.mischief if each.name in (*MODES, "an interrupt"))
        self._pending = sorted(events, key=lambda each: each.begin)

    def now(self) -> float:
        return self.steps * STEP / 4

    monotonic = now

    def sleep_until(self, instant: float) -> None:
        while self.now() < instant - 1e-9:
            self.steps += 1
            if self.steps % 4 == 0:
                self.tick()

    def tick(self) -> None:
        now = self.middle.now = self.now()
        if now > LONGEST:
            raise Endless
        self._happen(now)
        self.middle.pump()
        self.front_end.tick(now)
        self.middle.pump()
        self.path.append((self.vehicle.time, self.vehicle.state.position))

    def _happen(self, now: float) -> None:
        while self._pending and self._pending[0].begin <= now:
            name = self._pending.pop(0).name
            if name == "an interrupt":
                raise KeyboardInterrupt
            if name == "a reboot":
                self.front_end = FrontEnd(self.vehicle, self.middle)
            self.vehicle.hold()

    def error(self, client: Client) -> float:
        """How far the vehicle really was off the plan at most [m], NaN where that was not flown."""
        mission = client.mission
        since = [(time - mission.maneuver_began, position) for time, position in self.path]
        inside = [(time, at) for time, at in since if 0.0 <= time <= mission.stream.duration]
        offs = [np.linalg.norm(at - mission.stream.flat(time).position) for time, at in inside]
        return float(max(offs, default=np.nan))


@dataclass
class Flight:
    """What came of a flight."""

    seed: int
    way: str
    mischief: list[Mischief]
    code: int | None = None
    out: str = ""
    said: str = ""
    raised: str = ""
    wrong: list[str] = field(default_factory=list)

    @property
    def verdict(self) -> str:
        """One of four."""
        if self.wrong:
            return "wrong"
        return {0: "flown well", 1: "given up in a sentence", 2: "refused on the ground"}[self.code or 0]

    def __str__(self) -> str:
        faults = "; ".join(map(str, self.mischief)) or "nothing"
        last = self.said.strip().splitlines()[-1:]
        return f"{self.seed}: {self.way}, {faults}: {self.verdict} {self.wrong or ''} {last}{self.raised}"


def drawn(seed: int) -> tuple[bool, bool, list[Mischief]]:
    """Whether by TCP and by MAVLink 1, and what happens; nothing in every tenth flight."""
    rng = np.random.default_rng(seed)
    tcp, first = bool(rng.integers(2)), bool(rng.integers(2))
    names = [*FAULTS, *EVENTS]
    mischief = []
    for _ in range(0 if seed % 10 == 0 else rng.integers(1, 4)):
        spans = [(0.0, 0.0), (0.0, PLAN[0]), PLAN, PLAN, (PLAN[1], 14.0)]
        begin = rng.uniform(*spans[rng.integers(len(spans))])
        lasts = rng.choice([0.3, 1.0, 3.0, np.inf])
        name = str(rng.choice(names))
        mischief.append(Mischief(name, float(begin), float(begin + lasts)))
    return tcp, first, mischief


def flown(seed: int, plan: Path) -> Flight:
    """Fly with what a seed draws, and see what was wrong."""
    tcp, first, mischief = drawn(seed)
    return flown_with(mischief, plan, tcp, first, seed)


def flown_with(mischief: list[Mischief], plan: Path, tcp: bool, first: bool = False, seed: int = 0) -> Flight:
    """Fly with mischief, by TCP or UDP and MAVLink 1 or 2, and see what was wrong."""
    middle = Middle(tcp, first, mischief, np.random.default_rng(seed))
    stepped = SteppedFlight(middle)
    clients: list[Client] = []

    class Seen(Client):
        def __init__(self, *given: Any, **named: Any) -> None:
            super().__init__(*given, **named)
            clients.append(self)

    flight = Flight(seed, f"{'TCP' if tcp else 'UDP'}, MAVLink {2 - first}", mischief)
    out, said = io.StringIO(), io.StringIO()
    told = contextlib.redirect_stdout(out), contextlib.redirect_stderr(said)
    with pytest.MonkeyPatch.context() as patch, told[0], told[1]:
        patch.setattr("aerobat.cli.commands.mavlink.WallClock", lambda speed: stepped)
        patch.setattr("aerobat.cli.commands.mavlink.Client", Seen)
        patch.setattr(connection, "time", stepped)
        try:
            flight.code = code("link", "mavlink", plan, "--connect", middle.address, "--json")
        except Endless:
            flight.raised = "it does not end"
        except Exception:
            flight.raised = traceback.format_exc()
    middle.close()
    flight.out, flight.said = out.getvalue(), said.getvalue()
    flight.wrong = list(wrongs(flight, stepped, clients))
    return flight


def is_an_error(out: str) -> bool:
    """True of the JSON of an error."""
    try:
        return list(json.loads(out)) == ["error"]
    except ValueError:
        return False


def wrongs(flight: Flight, stepped: SteppedFlight, clients: list[Client]) -> Iterator[str]:
    """What must not be."""
    if flight.raised:
        yield "no sentence"
        return
    if stepped.middle.not_finite:
        yield f"{stepped.middle.not_finite} set-points that are not finite"
    vehicle, is_flying = stepped.vehicle, not stepped.vehicle.landed
    if flight.code == ExitCode.BAD_INPUT:
        if not (flight.said.strip() and is_an_error(flight.out)):
            yield "another output than an error where nothing was flown, or no sentence"
        if is_flying or (vehicle.armed and clients and clients[0].stage is ClientStage.FLYING):
            yield "refused in flight"
        return
    try:
        report = json.loads(flight.out, parse_constant=lambda name: 1 / 0)
    except (ValueError, ZeroDivisionError):
        yield "no JSON"
        return
    error = stepped.error(clients[0])
    if report["success"] and (is_flying or vehicle.crashed or not error < OFF):
        yield f"success of a vehicle that was {error:.2f} m off, or has not landed"
    if not report["success"] and not report["aborted"] and not report["failures"]:
        yield "a failure without a word"
    if not flight.mischief and not report["success"]:
        yield "a good flight that was given up"
    if is_flying and "left to" not in flight.said.strip().splitlines()[-1]:
        yield "left flying without a word"
    if vehicle.crashed:
        yield "a crash"


def main() -> None:
    """Fly, and print the flights that were wrong, and a table."""
    first, last = (int(sys.argv[1]), int(sys.argv[2])) if len(sys.argv) > 2 else (0, int(sys.argv[1]))
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "flip.plan"
        flip().save(plan)
        for seed in range(first, last):
            flight = flown(seed, plan)
            counts[flight.way, flight.verdict] += 1
            print(flight, flush=True)
    for (way, verdict), number in sorted(counts.items()):
        print(f"| {way} | {verdict} | {number} |")


if __name__ == "__main__":
    main()
