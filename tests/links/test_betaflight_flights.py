"""Flights on Betaflight's own firmware, and what goes wrong with it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import aerobat as ab
from aerobat.errors import SpecError
from aerobat.interchange import read_blackbox
from aerobat.kernels.rate_loop import RateSetpoint
from aerobat.links.betaflight import autopilot, process
from aerobat.links.betaflight.autopilot import Betaflight, BetaflightRun
from aerobat.links.betaflight.process import Firmware, FirmwareEnded, configured
from aerobat.links.betaflight.settings import betaflight_settings
from aerobat.reporting.blackbox import blackbox_figure
from aerobat.simulation.flight_controller import Sensed
from command_lines import run, without_pictures
from shared_plans import shared_plan

pytestmark = pytest.mark.betaflight

QUAD = ab.load_vehicle("agile-quad")
LEVEL = Sensed((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))
HOVER = QUAD.mass * 9.81


def armed() -> BetaflightRun:
    return Betaflight().begin(QUAD, RateSetpoint((0.0, 0.0, 0.0), HOVER), 10.0)


def hover(flying: BetaflightRun) -> None:
    """Ask for a hover for a tenth of a second."""
    for _ in range(100):
        flying.step(LEVEL, RateSetpoint((0.0, 0.0, 0.0), HOVER), 0.001)


@pytest.mark.parametrize("problem", ["half-flip", "flip-roll", "flip-pitch"])
def test_maneuvers_are_flown_through_their_gates_under_conditions(problem: str) -> None:
    plan = shared_plan(problem)
    flown = {"conditions": "lab", "seed": 1, "flights": range(1), "controller": "rates"}
    flight = ab.fly(plan, autopilot="betaflight", **flown)[0]
    score = ab.score(flight, plan)
    assert score.outcome is ab.Outcome.THROUGH_GATES
    assert score.max_position_error_m < 0.1
    predicted = ab.score_flights(plan, **flown).max_position_error_m[0]
    assert score.max_position_error_m == pytest.approx(predicted, rel=0.3)


def test_a_flight_is_the_same_bit_for_bit_beside_another() -> None:
    """Each has a clock and ports of its own."""
    plan = shared_plan("half-flip")
    with ThreadPoolExecutor(2) as together:
        first, second = together.map(lambda _: ab.fly(plan, autopilot="betaflight", rate=1000.0), range(2))
    np.testing.assert_array_equal(first.position, second.position)
    np.testing.assert_array_equal(first.commands, second.commands)
    assert first.position_error.max() < 0.005
    assert first.engine == "betaflight"


@pytest.mark.parametrize(
    ("axis", "more"),
    [
        (0, "left"),  # rolls to the right
        (1, "back"),  # pitches nose down
        (2, "clockwise"),  # yaws counter-clockwise
    ],
)
def test_a_rate_is_asked_of_the_motors_that_give_it(axis: int, more: str) -> None:
    omega = tuple(2.0 if k == axis else 0.0 for k in range(3))
    with closing(armed()) as flying:
        for _ in range(20):
            commands = flying.step(LEVEL, RateSetpoint(omega, HOVER), 0.001)
    strong = {k for k, command in enumerate(commands) if command > HOVER / 4}
    sides = {
        "left": {k for k, rotor in enumerate(QUAD.rotors) if rotor.position_body[1] > 0.0},
        "back": {k for k, rotor in enumerate(QUAD.rotors) if rotor.position_body[0] < 0.0},
        "clockwise": {k for k, rotor in enumerate(QUAD.rotors) if rotor.spin == -1},
    }
    assert strong == sides[more]
    assert sum(commands) == pytest.approx(HOVER, rel=0.01)


def test_a_firmware_that_refuses_to_arm_names_its_flags(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(autopilot, "_GRACE", 1.0)  # too early
    with pytest.raises(SpecError, match=r"refuses to arm: .*BOOTGRACE"):
        armed()


def test_a_firmware_that_disarms_in_flight_names_its_flags(monkeypatch: pytest.MonkeyPatch) -> None:
    flying = armed()
    monkeypatch.setattr(autopilot.Sticks, "packet", lambda self, *_: self.idle(armed=False))
    with closing(flying), pytest.raises(SpecError, match=r"disarmed 0\.\d\d s into the flight"):
        hover(flying)


def test_a_firmware_that_dies_in_flight_is_a_sentence() -> None:
    flying = armed()
    for pid in firmware_of(os.getpid()):
        os.kill(pid, signal.SIGKILL)
    with closing(flying), pytest.raises(FirmwareEnded, match="has ended with exit code -9; run it again"):
        hover(flying)


def test_a_line_that_the_firmware_refuses_is_named() -> None:
    with closing(Firmware()) as firmware, pytest.raises(SpecError, match="refuses 'set no_such_setting = 1'"):
        firmware.configure(("set small_angle = 180", "set no_such_setting = 1"))


def test_settings_are_taken_as_they_are_written() -> None:
    lines = betaflight_settings(QUAD, 20.0, simulated=True)
    with closing(Firmware(configured(lines))) as firmware:
        firmware.exchange(b"#", lambda answer: b"\n# " in answer)
        answer = firmware.exchange(b"get p_roll\n", lambda answer: b"\n# " in answer).decode()
    line = answer[answer.index("p_roll = ") :].splitlines()[0]
    assert f"set {line}" in lines


def test_no_process_is_left_whoever_is_killed() -> None:
    """Ten programs that fly are killed at some instant, by a signal that none can catch."""
    script = (
        "import aerobat as ab, numpy as np\n"
        "path = ab.Trajectory(np.array([60.0]), np.array([[[0.0, 0.0, 1.0]]]))\n"
        "ab.fly(path, 'agile-quad', autopilot='betaflight')\n"
    )
    programs = [subprocess.Popen([sys.executable, "-c", script]) for _ in range(10)]
    children: set[int] = set()
    while len(children) < len(programs) and all(each.poll() is None for each in programs):
        children |= {pid for each in programs for pid in firmware_of(each.pid)}
        time.sleep(0.01)
    for program in programs:
        program.kill()
        program.wait()
    for _ in range(1000):
        if not any(Path(f"/proc/{pid}").exists() and is_alive(pid) for pid in children):
            return
        time.sleep(0.01)
    pytest.fail("a firmware outlived the program that flew it")


def test_folders_that_killed_programs_left_are_removed_by_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And those of programs that live are not, however old."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    left = tmp_path / "aerobat-betaflight-left"
    left.mkdir()
    (left / "eeprom.bin").write_bytes(b"")
    with closing(Firmware()) as living:
        for folder in tmp_path.iterdir():
            os.utime(folder, (0.0, 0.0))
        with closing(Firmware()):
            assert not left.exists()
        assert living.step(0.01)
        assert len([*tmp_path.iterdir()]) == 1
    assert not [*tmp_path.iterdir()]


def firmware_of(parent: int) -> list[int]:
    """The numbers of a program's children."""
    children = [Path(f"/proc/{parent}/task/{task}/children") for task in os.listdir(f"/proc/{parent}/task")]
    return [int(pid) for each in children if each.exists() for pid in each.read_text().split()]


def is_alive(pid: int) -> bool:
    """True of a process that is more than an entry in a table."""
    try:
        return ") Z" not in Path(f"/proc/{pid}/stat").read_text()
    except FileNotFoundError:
        return False


def test_the_command_flies_writes_the_settings_of_a_board_and_repeats(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    without_pictures(monkeypatch)
    ended, _, said = run(capsys, "fly", "half-flip", "--autopilot", "betaflight", "--out", tmp_path / "run")
    assert ended == 0, said
    assert "set p_roll = " in (tmp_path / "run" / "autopilot.txt").read_text()
    assert len((tmp_path / "run" / "blackbox.bfl").read_bytes()) > 10_000
    assert '"rates on betaflight"' in (tmp_path / "run" / "report.json").read_text()
    assert "bit for bit" in run(capsys, "repeat", tmp_path / "run")[2]


def test_a_controller_that_gives_no_rates_is_refused_before_anything_is_planned(
    capsys: pytest.CaptureFixture[str],
) -> None:
    ended, _, said = run(capsys, "fly", "half-flip", "--autopilot", "betaflight", "--controller", "lee")
    assert ended == 2
    assert "leave --controller out" in said


def test_a_blackbox_log_by_a_library_tells_the_flight_that_was_flown(tmp_path: Path) -> None:
    plan, file = shared_plan("half-flip"), tmp_path / "blackbox.bfl"
    flight = ab.fly(plan, autopilot=Betaflight(blackbox=str(file)), controller="rates", rate=1000.0)
    log = read_blackbox(file)
    planned = ab.reference(plan, times=flight.times)
    begin = log.begin(planned.times, planned.setpoint.omega_body)
    for logged, flown in ((log.omega_body, flight.omega_body), (log.rate_setpoint, flight.rate_setpoint)):
        there = np.stack([np.interp(flight.times + begin, log.times, axis) for axis in logged.T], axis=-1)
        assert np.sqrt(np.mean((there - flown) ** 2)) < 0.03 * np.abs(flown).max()
    assert 0.0 <= log.motors.min() < log.motors.max() <= 1.0
    drawn = blackbox_figure(log, plan).axes
    assert [len(axes.lines) for axes in drawn] == [3, 3, 3, 4]
    with pytest.raises(SpecError, match="shorter than the plan"):
        log.begin(np.array([0.0, 60.0]), np.zeros((2, 3)))


def test_what_is_no_blackbox_log_is_refused_in_a_sentence(tmp_path: Path) -> None:
    for content in (b"", b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n", b"text"):
        file = tmp_path / "log.bfl"
        file.write_bytes(content)
        with pytest.raises(SpecError, match="no flight with gyro, setpoint and motors"):
            read_blackbox(file)
    with pytest.raises(SpecError, match="no such file"):
        read_blackbox(tmp_path / "none.bfl")


DEFAULT_GAINS = tuple(
    f"set {kind}_{axis} = {gain}"
    for axis in ("roll", "pitch", "yaw")
    for kind, gain in (("p", 45), ("i", 80), ("d", 30))
)
SLOW_RATES = tuple(
    f"set {axis}_{name} = 30" for axis in ("roll", "pitch", "yaw") for name in ("rc_rate", "srate")
)
REAR_AND_FRONT_RIGHT_SWAPPED = (
    "mixer CUSTOM", "mmix reset",
    "mmix 0 1.0 -1.0 -1.0 1.0", "mmix 1 1.0 -1.0 1.0 -1.0", "mmix 2 1.0 1.0 1.0 1.0",
    "mmix 3 1.0 1.0 -1.0 -1.0",
)  # fmt: skip


@pytest.mark.parametrize(
    ("cause", "lines"),
    [
        (None, ()),
        ("rate gains", DEFAULT_GAINS),
        ("rates", SLOW_RATES),
        ("motor order", REAR_AND_FRONT_RIGHT_SWAPPED),
    ],
)
def test_a_firmware_set_wrongly_is_found_in_its_flights(cause: str | None, lines: tuple[str, ...]) -> None:
    plan = shared_plan("half-flip")
    drawn = {"conditions": "lab", "seed": 1, "flights": range(1), "controller": "rates"}
    found = ab.inspect_flight(ab.fly(plan, autopilot=Betaflight(lines=lines), **drawn)[0], plan)
    assert (found.fault and found.fault.cause) == cause
    assert cause is None or found.cause == cause


def test_rotors_twice_as_slow_are_found_in_a_flight() -> None:
    plan = shared_plan("half-flip")
    slow = replace(QUAD, rotors=tuple(replace(rotor, lag=2.0 * rotor.lag) for rotor in QUAD.rotors))
    flown = ab.fly(plan, slow, nominal=QUAD, controller="rates", autopilot="betaflight", rate=1000.0)
    assert ab.inspect_flight(flown, plan).cause == "lag"


def test_a_port_that_another_program_takes_meanwhile_costs_a_second_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    free = process._free_port
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        ports = [taken.getsockname()[1]]
        monkeypatch.setattr(process, "_free_port", lambda: ports.pop() if ports else free())
        monkeypatch.setattr(process, "_ANSWER_TIMEOUT", 2.0)
        assert process.configured.__wrapped__(betaflight_settings(QUAD, 20.0, simulated=True))
