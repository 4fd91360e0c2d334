"""The commands over UDP, in processes of their own, by the wall's clock; and what they say to bad input."""

from __future__ import annotations

import json
import re
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import aerobat as ab
from aerobat.links.mavlink import connection
from aerobat.links.mavlink.connection import LossyConnection, dialect
from aerobat.links.mavlink.dialects import DIALECTS
from command_lines import run
from mavlink_sky import SteppedClock, Wire, flip
from places import SUPPORT

Flown = tuple[dict[str, Any], str]  # a flight's report, and what was said of it
SPEEDS = ("0.3", "0.1", "0.03")  # of the wall's time: a machine that does much else at once keeps up
MAVSDK_SPEEDS = ("3", "1", "0.5")  # likewise; MAVSDK takes three seconds without a heartbeat for a loss


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def simulated_vehicle(*options: str) -> Iterator[str]:
    """A vehicle in a process of its own; where it listens."""
    address = f"udp:127.0.0.1:{free_port()}"
    command = [
        sys.executable,
        "-m",
        "aerobat",
        "link",
        "mavlink-vehicle",
        "agile-quad",
        "--listen",
        address,
        *options,
    ]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stderr is not None
        assert "listens on" in process.stderr.readline()
        yield address
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 130
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("plans") / "flip.plan"
    flip().save(path)
    return path


@pytest.fixture(scope="module")
def flights(plan: Path) -> Iterator[dict[str, Future[Flown]]]:
    """Flights by each dialect, side by side: they wait for most of their time."""
    with ThreadPoolExecutor() as pool:
        yield {name: pool.submit(flown, plan, name) for name in DIALECTS}


@pytest.mark.process
@pytest.mark.parametrize("name", DIALECTS)
def test_two_processes_fly_the_flip_through_its_gate_over_udp(
    name: str, flights: dict[str, Future[Flown]]
) -> None:
    """With 1 % of the messages lost and 20 ms of delay, either way."""
    report, said = flights[name].result()
    assert report["aborted"] == "", said
    assert report["max_position_error_m"] < 0.25
    (gate,) = report["passages"]
    assert gate["inside"]
    assert gate["clearance"] > 0.0


def flown(plan: Path, name: str) -> Flown:
    """What came of a flight in two processes.

    A machine that does not keep up gives a flight up, and lands: then it is flown again, slower.
    """
    for speed in SPEEDS:
        report, said = flown_at(speed, plan, name)
        assert report["ended"] == "landed", said
        if not re.search("no news|late|the mode hold", report["aborted"]):
            break
    return report, said


def flown_at(speed: str, plan: Path, name: str) -> Flown:
    """What came of a flight at a speed."""
    with simulated_vehicle(
        "--loss", "0.01", "--delay", "0.02", "--speed", speed, "--dialect", name
    ) as address:
        command = [
            sys.executable,
            "-m",
            "aerobat",
            "link",
            "mavlink",
            str(plan),
            "--connect",
            address,
            "--json",
        ]
        options = ["--speed", speed, "--origin", "0", "0", "1.5"]
        done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    report = json.loads(done.stdout)
    assert done.returncode == (0 if report["success"] else 1)
    return report, done.stderr


@pytest.mark.peer
@pytest.mark.process
def test_mavsdk_takes_off_goes_somewhere_flies_offboard_and_lands() -> None:
    """A client that others wrote takes our vehicle for one that it knows.

    Where the machine does not keep up, set-points or heartbeats are late: then it is flown again, slower.
    """
    script = SUPPORT / "mavsdk_flight.py"
    for speed in MAVSDK_SPEEDS:
        with simulated_vehicle("--speed", speed) as address:
            command = [sys.executable, str(script), address.replace("udp:", "udpout://")]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not re.search("TIMEOUT|no set-points|timed out", done.stderr):
            break
    words = [line for line in done.stdout.splitlines() if "[" not in line]
    assert words == ["took off", "went there", "flew offboard", "landed"], done.stderr


@pytest.mark.peer
@pytest.mark.process
def test_pymavlinks_own_client_takes_the_vehicle_for_a_copter_and_flies_it() -> None:
    """Its table of modes follows from the heartbeat."""
    from pymavlink import mavutil

    def heard(kind: str, is_so: Callable[[Any], bool]) -> None:
        for _ in range(300):
            message = copter.recv_match(type=kind, blocking=True, timeout=2.0)
            assert message is not None
            if is_so(message):
                return
        raise AssertionError(kind)

    with simulated_vehicle("--speed", "3", "--dialect", "ardupilot") as address:
        copter = mavutil.mavlink_connection(address.replace("udp:", "udpout:"), dialect="common")
        copter.mav.heartbeat_send(6, 8, 0, 0, 4)
        copter.wait_heartbeat()
        copter.set_mode("GUIDED")
        heard("HEARTBEAT", lambda _: copter.flightmode == "GUIDED")
        copter.arducopter_arm()
        copter.motors_armed_wait()
        order = copter.target_system, 1, mavutil.mavlink.MAV_CMD_NAV_TAKEOFF
        copter.mav.command_long_send(*order, 0, *[0] * 6, 5.0)
        heard("LOCAL_POSITION_NED", lambda place: place.z < -4.9)
        copter.set_mode("LAND")
        copter.motors_disarmed_wait()
        copter.close()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("PLAN", "--connect", "NOBODY", "--wait", "0.3"), "no vehicle answers within 0.3 s"),
        (("PLAN", "--connect", "udp:14540"), "udp:14540 is no address; give udp:HOST:PORT"),
        (("PLAN", "--connect", "udp:here:port"), "is no address"),
        (("PLAN", "--connect", "/dev/none"), "neither a device nor an address"),
        (("PLAN", "--connect", "tcp:127.0.0.1:9"), "cannot open tcp:127.0.0.1:9"),
        (("PLAN", "--connect", "udp:nohost.invalid:9"), "cannot open udp:nohost.invalid:9"),
        (("PLAN", "--vehicle", "hexarotor"), "certified for agile-quad, not for hexarotor"),
        (("PLAN", "--origin", "0", "0", "0"), "raise its origin"),
        (("path.csv",), "holds a path alone"),
        (("none.plan",), "none.plan"),
        (("PLAN", "--rate", "20"), "--rate"),
    ],
)
def test_bad_input_ends_in_a_sentence_and_flies_nothing(
    arguments: tuple[str, ...], words: str, plan: Path, tmp_path: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    ab.write_csv(flip().trajectory, "path.csv")
    meant = {"PLAN": str(plan), "NOBODY": f"udp:127.0.0.1:{free_port()}"}
    code, _, err = run(capsys, "link", "mavlink", *(meant.get(each, each) for each in arguments))
    assert code == 2, err
    assert err.count("\n") == 1, err
    assert words in err


def test_an_interrupt_while_a_flight_is_prepared_ends_as_any_other(plan: Path, monkeypatch, capsys) -> None:
    """Nothing was sent by then, and there is nothing to report."""

    def interrupted(*arguments: object, **settings: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("aerobat.cli.commands.mavlink.Client", interrupted)
    code, out, err = run(capsys, "link", "mavlink", str(plan), "--connect", f"udp:127.0.0.1:{free_port()}")
    assert code == 130, err
    assert not out


def test_a_port_that_is_taken_is_told(capsys) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        code, _, err = run(
            capsys,
            "link",
            "mavlink-vehicle",
            "--listen",
            f"tcpin:127.0.0.1:{taken.getsockname()[1]}",
            "--for",
            "0.1",
        )
    assert code == 2
    assert re.search("cannot open .*: Address already in use", err)


@pytest.mark.parametrize("how", ["closed", "reset"])
def test_a_server_by_tcp_lets_the_next_client_in_where_one_has_hung_up(how: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    server = connection.connect(f"tcpin:127.0.0.1:{port}", listen=True, system=1)
    for _ in range(3):
        with socket.create_connection(("127.0.0.1", port)) as client:
            server.receive()
            server.send(dialect().MAVLink_timesync_message(1, 2))
            assert client.recv(100)
            if how == "reset":
                client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        server.receive()
    server.close()


def test_without_pymavlink_the_command_that_installs_it_is_told(plan: Path, capsys, monkeypatch) -> None:
    connection.dialect.cache_clear()
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20.common", None)
    code, _, err = run(capsys, "link", "mavlink", str(plan))
    assert code == 2
    assert err.endswith('install it with pip install "aerobat[mavlink]"\n')


def test_a_link_for_trials_loses_as_many_as_it_shall_and_delays_the_rest_alike() -> None:
    clock = SteppedClock()
    near, far = Wire(1, 1), Wire(2, 1)
    near.other, far.other = far, near
    lossy = LossyConnection(near, clock, loss=0.2, delay=0.02, seed=3)
    arrived: list[tuple[int, int]] = []
    for sent in range(1500):
        far.send(dialect().MAVLink_timesync_message(sent, 0))
        arrived += [(message.tc1, clock.steps) for message in lossy.receive()]
        clock.steps += 1
    numbers, times = np.array(arrived).T
    assert (np.diff(numbers) > 0).all()
    np.testing.assert_allclose(times - numbers, 20, atol=1)  # steps
    assert len(numbers) / 1480 == pytest.approx(0.8, abs=0.03)
